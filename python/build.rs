//! Embeds the task files of the repository, so that they are part of the Python package.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders of task files, relative to the repository.
const FOLDERS: [&str; 2] = ["envs", "envs/mistakes"];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let package = env::var("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let repository = package.expect("cargo sets the directory of the package");
    let repository = repository.parent().expect("the package is in a repository");
    let mut entries = String::new();
    for folder in FOLDERS {
        println!(
            "cargo::rerun-if-changed={}",
            repository.join(folder).display()
        );
        for name in task_files(&repository.join(folder)) {
            let file = repository.join(folder).join(&name);
            entries += &format!(
                "    BuiltinFile {{ path: \"{folder}/{name}\", text: include_str!(r#\"{}\"#) }},\n",
                file.display()
            );
        }
    }
    let out = env::var("OUT_DIR").map(PathBuf::from);
    let out = out.expect("cargo sets the directory of outputs");
    let table = format!("&[\n{entries}]\n");
    fs::write(out.join("builtin_tasks.rs"), table).expect("the directory of outputs is writable");
}

/// Names of the RON files in a folder, sorted.
fn task_files(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("the repository has task files");
    let mut names: Vec<String> = entries
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| Path::new(name).extension() == Some("ron".as_ref()))
        .collect();
    names.sort();
    names
}
