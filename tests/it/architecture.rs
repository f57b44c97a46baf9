//! Rules on dependencies between modules and crates that the compiler does not check.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::util::{REPOSITORY, files_below};

/// Path and text of each source file of the workbench, `seedbed-env` and `seedbed-learn`. Paths are
/// relative to the repository; comment lines are removed from the text.
fn library_source_files() -> Vec<(String, String)> {
    let root = Path::new(REPOSITORY);
    let read = |path: PathBuf| {
        let name = path
            .strip_prefix(root)
            .unwrap()
            .to_string_lossy()
            .into_owned();
        let text = fs::read_to_string(&path).unwrap();
        let code: Vec<&str> = text
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .collect();
        (name.replace('\\', "/"), code.join("\n"))
    };
    let folders = ["src", "crates/seedbed-env/src", "crates/seedbed-learn/src"];
    folders
        .iter()
        .flat_map(|folder| files_below(&root.join(folder), "rs"))
        .map(read)
        .collect()
}

/// Names of all packages that `package` depends on, beginning with `package` itself.
fn dependencies(package: &str) -> Vec<String> {
    dependencies_with(&["--package", package])
}

fn dependencies_with(selection: &[&str]) -> Vec<String> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--locked", "--edges", "normal", "--prefix", "none"])
        .args(["--format", "{p}"])
        .args(selection)
        .current_dir(REPOSITORY)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines()
        .filter_map(|line| Some(line.split_whitespace().next()?.to_owned()))
        .collect()
}

/// Library crates build without the recording SDK, network libraries and the command line.
#[test]
fn library_crates_do_not_depend_on_heavy_packages() {
    const HEAVY_PACKAGES: [&str; 13] = [
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
        ("seedbed-figure", &["seedbed-env", "ron", "rayon"]),
    ] {
        let used = dependencies(package);
        assert!(used.len() > 3 && used[0] == package, "{used:?}");
        for name in HEAVY_PACKAGES.iter().chain(banned) {
            assert!(
                !used.iter().any(|used| used == name),
                "{package} must not depend on {name}"
            );
        }
    }
}

/// What the root package must be buildable without, when its feature `rerun` is off.
#[test]
fn the_workbench_builds_without_rerun() {
    let used = dependencies_with(&["--package", "seedbed", "--no-default-features"]);
    for name in ["rerun", "re_sdk", "re_protos", "arrow", "tonic", "tokio"] {
        assert!(!used.iter().any(|used| used == name), "needs {name}");
    }
}

/// Only the module of recordings may depend on the feature: others use `record::recording`.
#[test]
fn only_recordings_ask_for_the_feature_rerun() {
    for (file, text) in code() {
        let home = file == "src/record/mod.rs" || file.starts_with("src/record/rerun/");
        let named = text.contains("record::rerun") || text.contains("feature = \"rerun\"");
        assert!(home || !named, "{file} names the feature or module `rerun`");
    }
}

/// Whether `text` names `path` other than as the tail of a longer one, such as
/// `crate::record::rerun::` for `rerun::`.
fn names(text: &str, path: &str) -> bool {
    text.match_indices(path)
        .any(|(at, _)| !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'))
}

#[test]
fn each_heavy_crate_is_imported_by_one_module_only() {
    for (crate_path, importer_folder) in [
        ("rerun::", "src/record/rerun/"),
        ("re_protos::", "src/record/rerun/"),
        ("tonic::", "src/record/rerun/"),
        ("tokio::", "src/record/rerun/"),
        ("rapier2d::", "crates/seedbed-env/src/physics/"),
        ("parry2d::", "crates/seedbed-env/src/physics/"),
    ] {
        let importers: Vec<String> = library_source_files()
            .into_iter()
            .filter(|(_, text)| contains_path(text, crate_path))
            .map(|(file, _)| file)
            .collect();
        assert!(!importers.is_empty(), "no module imports {crate_path}");
        for file in importers {
            assert!(
                file.starts_with(importer_folder),
                "{file} imports {crate_path}; only {importer_folder} may import it"
            );
        }
    }
}

/// The modules of the workbench, the lowest layer first. A module may import modules of lower
/// layers.
const LAYERS: [&[&str]; 7] = [
    &["plotting", "text"],
    &["record"],
    &["scenario"],
    &["run"],
    &["tabular"],
    &["study"],
    &["cli"],
];

#[test]
fn modules_import_only_lower_layers() {
    let layer_of = |module: &str| {
        LAYERS
            .iter()
            .position(|modules| modules.contains(&module))
            .unwrap_or(LAYERS.len())
    };
    let mut file_count = 0;
    for (file, text) in library_source_files() {
        let Some(module) = file
            .strip_prefix("src/")
            .and_then(|rest| rest.split(['/', '.']).next())
        else {
            continue;
        };
        if module == "main" || module == "lib" {
            continue;
        }
        file_count += 1;
        assert!(
            layer_of(module) < LAYERS.len(),
            "{file}: add the module `{module}` to LAYERS"
        );
        for (at, _) in text.match_indices("crate::") {
            let used: String = text[at + 7..]
                .chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect();
            let allowed = used == module || layer_of(&used) < layer_of(module);
            assert!(
                allowed,
                "{file} imports crate::{used}, whose layer is not below that of {module}"
            );
        }
    }
    assert!(file_count > 30, "only {file_count} files were checked");
}

#[test]
fn library_crates_use_no_threads_files_or_clocks() {
    for (file, text) in library_source_files() {
        let Some(path_in_crates) = file.strip_prefix("crates/") else {
            continue;
        };
        for banned in ["std::thread", "std::time", "ThreadPoolBuilder", "HashMap"] {
            assert!(!text.contains(banned), "{file} must not use {banned}");
        }
        let reads_files = ["std::fs", "File::"].iter().any(|name| text.contains(name));
        let allowed = ["seedbed-env/src/file", "seedbed-env/src/input"];
        assert!(
            !reads_files
                || allowed
                    .iter()
                    .any(|place| path_in_crates.starts_with(place)),
            "{file} must not read or write files"
        );
    }
}

#[test]
fn only_the_analytic_model_names_cartpole_quantities() {
    for (file, text) in library_source_files() {
        if file.starts_with("crates/seedbed-env/src/analytic") {
            continue;
        }
        let code = text.split("#[cfg(test)]").next().unwrap();
        for word in ["theta_dot", "pole_mass", "cart_mass", "half_length"] {
            assert!(!code.contains(word), "{file} contains {word}");
        }
    }
}
