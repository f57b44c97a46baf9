//! Embeds the task files of the repository, so that they are part of the Python package.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders of task files, relative to the package or the repository.
const FOLDERS: [&str; 2] = ["envs", "envs/mistakes"];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let package = env::var("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let parent = parent_of_envs(package.expect("cargo sets the directory of the package"));
    let mut entries = String::new();
    for folder in FOLDERS {
        let path = parent.join(folder);
        println!("cargo::rerun-if-changed={}", path.display());
        for name in task_files(&path) {
            let file = path.join(&name);
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

/// The folder that has the folder `envs`: the package, where `envs` is a link to that of the
/// repository, and a folder in source distributions; otherwise the repository, if Git did not make
/// the link, as on Windows.
fn parent_of_envs(package: PathBuf) -> PathBuf {
    if package.join("envs").is_dir() {
        return package;
    }
    let repository = package.parent().expect("the package is in a repository");
    repository.to_path_buf()
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
