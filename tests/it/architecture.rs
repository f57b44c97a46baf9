//! Rules that the compiler does not check: which modules and crates may depend on which, and which
//! names may occur where.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::util::{REPOSITORY, files_below};

/// Path from the repository and text, without comment lines, of each source file of the workbench,
/// and of the crates for tasks, input, learning and random streams.
fn source_files() -> Vec<(String, String)> {
    let root = Path::new(REPOSITORY);
    let read = |path: PathBuf| {
        let relative_path = path
            .strip_prefix(root)
            .unwrap()
            .to_string_lossy()
            .into_owned();
        let text = fs::read_to_string(&path).unwrap();
        let code: Vec<&str> = text
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .collect();
        (relative_path.replace('\\', "/"), code.join("\n"))
    };
    let folders = [
        "src",
        "crates/seedbed-env/src",
        "crates/seedbed-input/src",
        "crates/seedbed-learn/src",
        "crates/seedbed-random/src",
    ];
    folders
        .iter()
        .flat_map(|folder| files_below(&root.join(folder), "rs"))
        .map(read)
        .collect()
}

/// Names of the packages that `cargo tree ARGUMENTS` lists: the selected package first, then its
/// direct and indirect dependencies.
fn packages_in_tree(arguments: &[&str]) -> Vec<String> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--locked", "--edges", "normal", "--prefix", "none"])
        .args(["--format", "{p}"])
        .args(arguments)
        .current_dir(REPOSITORY)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines()
        .filter_map(|line| Some(line.split_whitespace().next()?.to_owned()))
        .collect()
}

/// The library crates depend neither on heavy packages nor on crates that they must not use.
#[test]
fn library_crates_do_not_need_heavy_packages() {
    const HEAVY: [&str; 13] = [
        "rerun", "re_sdk", "re_types", "arrow", "tonic", "tokio", "hyper", "mio", "socket2",
        "rustls", "ureq", "clap", "seedbed",
    ];
    for (package, banned) in [
        (
            "seedbed-env",
            ["seedbed-learn", "seedbed-figure", "resvg", "rayon"].as_slice(),
        ),
        (
            "seedbed-learn",
            &["seedbed-figure", "seedbed-stats", "resvg"],
        ),
        ("seedbed-stats", &["seedbed-env", "ron", "rayon"]),
        ("seedbed-settings", &["seedbed-env", "ron", "rayon"]),
        ("seedbed-input", &["seedbed-env", "rayon"]),
        ("seedbed-random", &["seedbed-env", "ron", "rayon"]),
        ("seedbed-figure", &["seedbed-env", "ron", "rayon"]),
        ("seedbed-scene", &["seedbed-learn", "rayon"]),
        ("seedbed-python", &["seedbed-stats"]),
    ] {
        let used = packages_in_tree(&["--package", package]);
        assert!(used.len() > 3 && used[0] == package, "{used:?}");
        for name in HEAVY.iter().chain(banned) {
            assert!(
                !used.iter().any(|used| used == name),
                "{package} needs {name}"
            );
        }
    }
}

/// Without the feature `rerun`, the workbench does not depend on packages of the recording SDK.
#[test]
fn the_workbench_needs_the_recording_sdk_only_with_its_feature() {
    let used = packages_in_tree(&["--package", "seedbed", "--no-default-features"]);
    for name in ["rerun", "re_sdk", "re_protos", "arrow", "tonic", "tokio"] {
        assert!(
            !used.iter().any(|used| used == name),
            "seedbed needs {name}"
        );
    }
}

/// Crates use each other by name only: no crate compiles files of another one.
#[test]
fn no_crate_compiles_files_of_another() {
    let sources = ["src", "crates", "python/src", "xtask/src"];
    let files = sources.map(|folder| files_below(&Path::new(REPOSITORY).join(folder), "rs"));
    for file in files.concat() {
        let text = fs::read_to_string(&file).unwrap();
        assert!(!text.contains("#[path"), "{}", file.display());
    }
}

/// Only `record/mod.rs` and `record/rerun/` may name the feature `rerun` or the module
/// `record::rerun`; all other files use `record::recording`.
#[test]
fn only_the_module_record_names_the_feature_rerun() {
    for (file, text) in source_files() {
        let is_allowed = file == "src/record/mod.rs" || file.starts_with("src/record/rerun/");
        let names_rerun = text.contains("record::rerun") || text.contains("feature = \"rerun\"");
        assert!(
            is_allowed || !names_rerun,
            "{file} names the feature or module `rerun`"
        );
    }
}

/// Whether `text` has a path that begins with `crate_path`: `rerun::` occurs in `use rerun::Chunk`,
/// but not in `use crate::record::rerun::Recording`.
fn uses_crate(text: &str, crate_path: &str) -> bool {
    let ends_within_a_path =
        |before: &str| before.ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':');
    text.match_indices(crate_path)
        .any(|(start, _)| !ends_within_a_path(&text[..start]))
}

#[test]
fn each_heavy_crate_is_used_in_one_folder_only() {
    for (crate_path, only_folder) in [
        ("rerun::", "src/record/rerun/"),
        ("re_protos::", "src/record/rerun/"),
        ("tonic::", "src/record/rerun/"),
        ("tokio::", "src/record/rerun/"),
        ("rapier2d::", "crates/seedbed-env/src/physics/"),
        ("parry2d::", "crates/seedbed-env/src/physics/"),
    ] {
        let using_files: Vec<String> = source_files()
            .into_iter()
            .filter(|(_, text)| uses_crate(text, crate_path))
            .map(|(file, _)| file)
            .collect();
        assert!(!using_files.is_empty(), "no file uses {crate_path}");
        for file in using_files {
            assert!(
                file.starts_with(only_folder),
                "{file} uses {crate_path}, which only files in {only_folder} may use"
            );
        }
    }
}

/// The top modules of the workbench in layers. A module may use itself and modules of earlier
/// layers.
const LAYERS: [&[&str]; 12] = [
    &["input_files", "plotting", "provenance", "storage", "text"],
    &["run_log", "scenario"],
    &["open_loop", "run"],
    &["record"],
    &["review"],
    &["export", "figures", "film"],
    &["explore"],
    &["tabular"],
    &["experiment"],
    &["study"],
    &["salvage"],
    &["cli"],
];

#[test]
fn modules_use_only_earlier_layers() {
    let layer_of = |module: &str| {
        LAYERS
            .iter()
            .position(|modules| modules.contains(&module))
            .unwrap_or(LAYERS.len())
    };
    let mut files_seen = 0;
    for (file, text) in source_files() {
        let Some(module) = file
            .strip_prefix("src/")
            .and_then(|path| path.split(['/', '.']).next())
        else {
            continue;
        };
        if module == "main" || module == "lib" {
            continue;
        }
        files_seen += 1;
        assert!(
            layer_of(module) < LAYERS.len(),
            "{file}: add `{module}` to LAYERS"
        );
        for (start, _) in text.match_indices("crate::") {
            let used: String = text[start + "crate::".len()..]
                .chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect();
            let is_allowed = used == module || layer_of(&used) < layer_of(module);
            assert!(
                is_allowed,
                "{file} uses crate::{used}, which is not in an earlier layer than {module}"
            );
        }
    }
    assert!(files_seen > 30, "{files_seen} files seen");
}

#[test]
fn env_and_learn_use_no_threads_clocks_hash_maps_or_files() {
    for (file, text) in source_files() {
        let Some(path_in_crates) = file.strip_prefix("crates/") else {
            continue;
        };
        // Waits for processes, whose answers do not depend on time.
        if path_in_crates.starts_with("seedbed-env/src/gymnasium/") {
            continue;
        }
        for banned in ["std::thread", "std::time", "ThreadPoolBuilder", "HashMap"] {
            assert!(!text.contains(banned), "{file} names {banned}");
        }
        let uses_files = ["std::fs", "File::"].iter().any(|name| text.contains(name));
        let may_read_files = ["seedbed-env/src/file", "seedbed-input/src"];
        assert!(
            !uses_files
                || may_read_files
                    .iter()
                    .any(|path| path_in_crates.starts_with(path)),
            "{file} uses files"
        );
    }
}

/// Files are opened for reading by `seedbed_input::limits`, which refuses pipes and devices and limits sizes. The
/// other files are those of the operating system, of the program itself, and those that it writes.
#[test]
fn files_are_read_in_one_place() {
    const CALLS: [&str; 7] = [
        "File::open(",
        "fs::read(",
        "fs::read_to_string(",
        "::from_path(",
        ".read(true)",
        "image::open(",
        "mmap",
    ];
    const ALLOWED: [&str; 9] = [
        "crates/seedbed-input/src/limits.rs",
        // Streams that arguments name.
        "src/input_files/streams.rs",
        // `/proc`.
        "src/cli/interruption.rs",
        "src/cli/memory.rs",
        "src/study/store/run_marks.rs",
        // Its own executable.
        "src/provenance.rs",
        // Files and folders that it writes.
        "src/record/rerun/serve.rs",
        "src/storage/files.rs",
        "src/storage/written.rs",
    ];
    for (file, text) in source_files() {
        let code = text.split("#[cfg(test)]").next().unwrap();
        let is_test = file.ends_with("/tests.rs") || file.contains("/tests/");
        if is_test || ALLOWED.contains(&file.as_str()) {
            continue;
        }
        // The constructors of types of this repository have the same names.
        let code = code
            .replace("HashedFile::open(", "")
            .replace("RecordingFile::open(", "");
        for call in CALLS {
            assert!(!code.contains(call), "{file} reads a file by `{call}…)`");
        }
    }
}

/// Checksums are computed by `storage`, so that formats share their code. Studies have some of their own.
#[test]
fn checksums_are_computed_in_one_place() {
    for (file, text) in source_files() {
        let is_allowed = [
            "src/storage/",
            "src/experiment/",
            "src/provenance.rs",
            "src/study/",
            "crates/",
        ]
        .iter()
        .any(|folder| file.starts_with(folder));
        for package in ["xxhash_rust::", "sha2::"] {
            assert!(
                is_allowed || !text.contains(package),
                "{file} uses {package}"
            );
        }
    }
}

#[test]
fn only_the_analytic_model_names_quantities_of_the_cartpole() {
    for (file, text) in source_files() {
        if file.starts_with("crates/seedbed-env/src/analytic") {
            continue;
        }
        let code = text.split("#[cfg(test)]").next().unwrap();
        for word in ["theta_dot", "pole_mass", "cart_mass", "half_length"] {
            assert!(!code.contains(word), "{file} contains {word}");
        }
    }
}

/// The relative links of a Markdown page, without anchors and without links in code blocks.
fn relative_links(page: &str) -> Vec<String> {
    let text: Vec<&str> = page
        .lines()
        .filter(|line| !line.starts_with("    "))
        .collect();
    let text = text.join("\n");
    let texts_after_link_starts = text.split("](").skip(1);
    texts_after_link_starts
        .filter_map(|text| text.split([')', '#']).next())
        .filter(|target| !target.is_empty() && !target.contains("://"))
        .map(str::to_owned)
        .collect()
}

#[test]
fn links_between_pages_lead_to_files() {
    let root = Path::new(REPOSITORY);
    let mut pages = files_below(&root.join("docs"), "md");
    for folder in ["envs", "scenarios", "recordings"] {
        pages.extend(files_below(&root.join(folder), "md"));
    }
    pages.extend(["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"].map(|page| root.join(page)));
    // Pages of the site alone link to others from the root of the repository; `cargo xtask site` follows all links.
    pages.retain(|page| !page.starts_with(root.join("docs/site")));
    let mut link_count = 0;
    for page in pages {
        for target in relative_links(&fs::read_to_string(&page).unwrap()) {
            link_count += 1;
            let path = page.parent().unwrap().join(&target);
            assert!(
                path.exists(),
                "{} links to {target}, which does not exist",
                page.display()
            );
        }
    }
    assert!(link_count > 50, "{link_count} links found");
}

/// Every published package contains the licenses.
#[test]
fn packages_have_the_texts_of_the_licenses() {
    let repository = Path::new(REPOSITORY);
    for package in ["env", "figure", "learn", "scene", "stats"] {
        for name in ["LICENSE-APACHE", "LICENSE-MIT"] {
            let copy = repository.join(format!("crates/seedbed-{package}/{name}"));
            let copied = std::fs::read_to_string(&copy).unwrap();
            let text = std::fs::read_to_string(repository.join(name)).unwrap();
            assert_eq!(copied, text, "{}", copy.display());
        }
    }
}

/// The Python package compares its episodes with those of the workbench in each task: `cargo xtask bless` plays them.
#[test]
fn every_task_has_golden_episodes() {
    let root = Path::new(REPOSITORY);
    let episodes = fs::read_to_string(root.join("python/tests/golden_episodes.txt")).unwrap();
    let with_episodes: BTreeSet<&str> = episodes
        .lines()
        .filter_map(|line| line.split(' ').next())
        .collect();
    let files = fs::read_dir(root.join("envs")).unwrap();
    let files = files.map(|file| file.unwrap().path());
    let tasks: BTreeSet<String> = files
        .filter(|path| path.extension().is_some_and(|extension| extension == "ron"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    assert!(tasks.iter().map(String::as_str).eq(with_episodes));
}
