//! The house rules that a compiler does not check: who may import what.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::util::{REPOSITORY, files_below};

/// The files of the workbench and of its crates, by their path from the repository, with their
/// text; comments do not count.
fn code() -> Vec<(String, String)> {
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

/// The packages that `package` is built from, itself included; names only.
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

/// What each library crate must be buildable without.
#[test]
fn library_crates_stay_small() {
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
        ("seedbed-figure", &["seedbed-env", "ron", "rayon"]),
    ] {
        let used = dependencies(package);
        assert!(used.len() > 3 && used[0] == package, "{used:?}");
        for name in HEAVY.iter().chain(banned) {
            assert!(
                !used.iter().any(|used| used == name),
                "{package} needs {name}"
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
fn each_heavy_crate_has_a_sole_importer() {
    for (crate_path, home) in [
        ("rerun::", "src/record/rerun/"),
        ("re_protos::", "src/record/rerun/"),
        ("tonic::", "src/record/rerun/"),
        ("tokio::", "src/record/rerun/"),
        ("rapier2d::", "crates/seedbed-env/src/physics/"),
        ("parry2d::", "crates/seedbed-env/src/physics/"),
    ] {
        let importers: Vec<String> = code()
            .into_iter()
            .filter(|(_, text)| names(text, crate_path))
            .map(|(file, _)| file)
            .collect();
        assert!(!importers.is_empty(), "nobody imports {crate_path}");
        for file in importers {
            assert!(
                file.starts_with(home),
                "{file} names {crate_path}, which only {home} may"
            );
        }
    }
}

/// The workbench's modules from the ground up; a module may use those before it and its own.
const FLOORS: [&[&str]; 7] = [
    &["plotting", "text"],
    &["record"],
    &["scenario"],
    &["run"],
    &["tabular"],
    &["study"],
    &["cli"],
];

#[test]
fn dependencies_go_one_way() {
    let floor_of = |room: &str| {
        FLOORS
            .iter()
            .position(|rooms| rooms.contains(&room))
            .unwrap_or(FLOORS.len())
    };
    let mut files_seen = 0;
    for (file, text) in code() {
        let Some(room) = file
            .strip_prefix("src/")
            .and_then(|rest| rest.split(['/', '.']).next())
        else {
            continue;
        };
        if room == "main" || room == "lib" {
            continue;
        }
        files_seen += 1;
        assert!(
            floor_of(room) < FLOORS.len(),
            "{file}: `{room}` has no place in FLOORS"
        );
        for (at, _) in text.match_indices("crate::") {
            let used: String = text[at + 7..]
                .chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect();
            let allowed = used == room || floor_of(&used) < floor_of(room);
            assert!(
                allowed,
                "{file} uses crate::{used}, which is not below {room}"
            );
        }
    }
    assert!(files_seen > 30, "{files_seen} files seen");
}

#[test]
fn tasks_and_learning_know_no_threads_files_or_clocks() {
    for (file, text) in code() {
        let Some(inside) = file.strip_prefix("crates/") else {
            continue;
        };
        for banned in ["std::thread", "std::time", "ThreadPoolBuilder", "HashMap"] {
            assert!(!text.contains(banned), "{file} names {banned}");
        }
        let uses_files = ["std::fs", "File::"].iter().any(|name| text.contains(name));
        let allowed = ["seedbed-env/src/file", "seedbed-env/src/input"];
        assert!(
            !uses_files || allowed.iter().any(|place| inside.starts_with(place)),
            "{file} touches files"
        );
    }
}

#[test]
fn nothing_of_the_cartpole_is_in_code_but_its_analytic_model() {
    for (file, text) in code() {
        if file.starts_with("crates/seedbed-env/src/analytic") {
            continue;
        }
        let code = text.split("#[cfg(test)]").next().unwrap();
        for word in ["theta_dot", "pole_mass", "cart_mass", "half_length"] {
            assert!(!code.contains(word), "{file} knows {word}");
        }
    }
}

/// The relative links of a Markdown page, without anchors; text in code blocks does not count.
fn relative_links(page: &str) -> Vec<String> {
    let text: Vec<&str> = page
        .lines()
        .filter(|line| !line.starts_with("    "))
        .collect();
    let text = text.join("\n");
    let targets = text.split("](").skip(1);
    targets
        .filter_map(|rest| rest.split([')', '#']).next())
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
    let mut links = 0;
    for page in pages {
        for target in relative_links(&fs::read_to_string(&page).unwrap()) {
            links += 1;
            let path = page.parent().unwrap().join(&target);
            assert!(path.exists(), "{} links to {target}", page.display());
        }
    }
    assert!(links > 50, "{links} links found");
}
