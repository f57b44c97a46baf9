//! The house rules that a compiler does not check: who may import what.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::{Path, PathBuf};

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries
        .flat_map(|path| {
            if path.is_dir() {
                sources(&path)
            } else {
                vec![path]
            }
        })
        .collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "rs"));
    files.sort();
    files
}

/// The files below `src`, by their path from there, with their text; comments do not count.
fn house() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let read = |path: PathBuf| {
        let name = path
            .strip_prefix(&root)
            .unwrap()
            .to_string_lossy()
            .replace('\\', "/");
        let text = fs::read_to_string(&path).unwrap();
        let code: Vec<&str> = text
            .lines()
            .filter(|line| !line.trim_start().starts_with("//"))
            .collect();
        (name, code.join("\n"))
    };
    sources(&root).into_iter().map(read).collect()
}

/// Whether `text` names `path` other than as the tail of a longer one, such as `crate::record::rerun::` for `rerun::`.
fn names(text: &str, path: &str) -> bool {
    text.match_indices(path)
        .any(|(at, _)| !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'))
}

#[test]
fn each_heavy_crate_has_a_sole_importer() {
    for (crate_path, home) in [
        ("rerun::", "record/rerun/"),
        ("re_protos::", "record/rerun/"),
        ("tonic::", "record/rerun/"),
        ("tokio::", "record/rerun/"),
        ("rapier2d::", "env/physics/"),
        ("parry2d::", "env/physics/"),
        ("resvg::", "figure/"),
    ] {
        let mut importers = 0;
        for (file, text) in house() {
            let names_it = names(&text, crate_path);
            assert!(
                !names_it || file.starts_with(home),
                "{file} names {crate_path}, which only {home} may"
            );
            importers += usize::from(names_it);
        }
        assert!(
            importers > 0 || crate_path == "parry2d::",
            "nobody imports {crate_path}"
        );
    }
}

/// Floors from the ground up; a room may use those below it and its own.
const FLOORS: [&[&str]; 9] = [
    &["input", "random"],
    &["nn", "rl"],
    &["env", "seed"],
    &["experience"],
    &["agent", "figure", "record"],
    &["scenario"],
    &["run"],
    &["tabular"],
    &["study"],
];

#[test]
fn dependencies_go_one_way() {
    let floor_of = |room: &str| {
        FLOORS
            .iter()
            .position(|rooms| rooms.contains(&room))
            .unwrap_or(FLOORS.len())
    };
    let mut rooms_seen = 0;
    for (file, text) in house() {
        let room = file.split(['/', '.']).next().unwrap();
        if room == "main" || room == "lib" {
            continue;
        }
        rooms_seen += 1;
        for (at, _) in text.match_indices("crate::") {
            let used: String = text[at + 7..]
                .chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect();
            let allowed = used == room || floor_of(&used) < floor_of(room);
            assert!(
                allowed,
                "{file} uses crate::{used}, which stands no lower than its own floor"
            );
        }
    }
    assert!(rooms_seen > 30, "{rooms_seen} files seen");
}

#[test]
fn formulas_know_no_threads_files_or_clocks() {
    for (file, text) in house().into_iter().filter(|(file, _)| {
        ["rl/", "nn/", "env/", "agent/"]
            .iter()
            .any(|room| file.starts_with(room))
    }) {
        for banned in [
            "std::thread",
            "std::time",
            "rayon::",
            "HashMap",
            "SystemTime",
        ] {
            assert!(!text.contains(banned), "{file} names {banned}");
        }
        let does_files = ["std::fs", "File::"].iter().any(|name| text.contains(name));
        assert!(
            !does_files || file.starts_with("env/file"),
            "{file} touches files"
        );
    }
}

#[test]
fn nothing_of_the_cartpole_is_in_code_but_its_twin() {
    for (file, text) in house()
        .into_iter()
        .filter(|(file, _)| !file.starts_with("env/analytic"))
    {
        let code = text.split("#[cfg(test)]").next().unwrap();
        for word in ["theta_dot", "pole_mass", "cart_mass", "half_length"] {
            assert!(!code.contains(word), "{file} knows {word}");
        }
    }
}
