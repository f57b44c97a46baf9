//! Tells the program what it is built from: the commit, and the versions of the libraries on which
//! results depend. It runs again only if the commit or a source file changes.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Physics, linear algebra, recordings.
const DEPENDENCIES: [&str; 3] = ["rapier2d", "nalgebra", "rerun"];

/// Digits of a commit's hash.
const COMMIT_DIGITS: usize = 12;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let package = env::var("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let package = package.expect("cargo sets the directory of the package");
    if let Some(commit) = packaged_commit(&package).or_else(|| checked_out_commit(&package)) {
        println!("cargo::rustc-env=SEEDBED_COMMIT={commit}");
    }
    if let Some(lock) = lock_file(&package) {
        println!("cargo::rerun-if-changed={}", lock.display());
        let versions = dependency_versions(&fs::read_to_string(lock).unwrap_or_default());
        println!(
            "cargo::rustc-env=SEEDBED_DEPENDENCIES={}",
            versions.join(", ")
        );
    }
}

/// Commit from which `cargo package` made an archive.
fn packaged_commit(package: &Path) -> Option<String> {
    let info = fs::read_to_string(package.join(".cargo_vcs_info.json")).ok()?;
    let (_, rest) = info.split_once("\"sha1\"")?;
    let commit = rest.split('"').nth(1)?;
    Some(marked(commit, info.contains("\"dirty\": true")))
}

/// Commit of the repository whose root is the package.
fn checked_out_commit(package: &Path) -> Option<String> {
    let git = |arguments: &[&str]| {
        let mut command = Command::new("git");
        let output = command.args(arguments).current_dir(package).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim_end().to_owned())
    };
    // A copy of the package inside another repository has nothing to do with that one's commits.
    if !git(&["rev-parse", "--show-prefix"])?.is_empty() {
        return None;
    }
    let commit = git(&["rev-parse", "HEAD"])?;
    for name in ["HEAD", "logs/HEAD", "refs/heads"] {
        let path = package.join(git(&["rev-parse", "--git-path", name])?);
        rerun_if_changed(&path);
    }
    let sources = sources(package);
    for source in &sources {
        if source == "src" {
            watch_library(&package.join(source));
        } else {
            rerun_if_changed(&package.join(source));
        }
    }
    let mut status = vec!["status", "--porcelain", "--"];
    status.extend(sources.iter().map(String::as_str));
    let is_dirty = !git(&status)?.is_empty();
    Some(marked(&commit, is_dirty))
}

/// Files and directories that are built, relative to the package.
fn sources(package: &Path) -> Vec<String> {
    let mut sources = vec![
        "src".to_owned(),
        "build.rs".to_owned(),
        "Cargo.toml".to_owned(),
        "Cargo.lock".to_owned(),
    ];
    let crates = fs::read_dir(package.join("crates"));
    for member in crates.into_iter().flatten().flatten() {
        let name = member.file_name().to_string_lossy().into_owned();
        sources.push(format!("crates/{name}/src"));
        sources.push(format!("crates/{name}/Cargo.toml"));
    }
    sources.sort();
    sources.retain(|source| package.join(source).exists());
    sources
}

/// Watches the sources of the library. A change of the command line alone would otherwise compile the
/// library again, because Cargo does so whenever this script has run. Programs that differ in the
/// command line only differ in their build id, and the commit is marked at the next change of the
/// library.
fn watch_library(src: &Path) {
    for entry in fs::read_dir(src).into_iter().flatten().flatten() {
        if entry.file_name() != "cli" && entry.file_name() != "main.rs" {
            rerun_if_changed(&entry.path());
        }
    }
}

/// Cargo would run the script each time if a path did not exist.
fn rerun_if_changed(path: &Path) {
    if path.exists() {
        println!("cargo::rerun-if-changed={}", path.display());
    }
}

fn marked(commit: &str, is_dirty: bool) -> String {
    let commit = &commit[..commit.len().min(COMMIT_DIGITS)];
    let mark = if is_dirty { "-dirty" } else { "" };
    format!("{commit}{mark}")
}

/// Lock file of the workspace that is being built, which may be that of another package: it lists
/// this package, and is above the build directory or the package. As a dependency, the package's own
/// lock file is not used, so none is better than that.
fn lock_file(package: &Path) -> Option<PathBuf> {
    let name = env::var("CARGO_PKG_NAME").ok()?;
    let build_directory = PathBuf::from(env::var("OUT_DIR").ok()?);
    let is_dependency = package
        .components()
        .any(|part| part.as_os_str() == "registry")
        || package
            .components()
            .any(|part| part.as_os_str() == "checkouts");
    let above_package = package.ancestors().filter(|_| !is_dependency);
    build_directory
        .ancestors()
        .chain(above_package)
        .map(|directory| directory.join("Cargo.lock"))
        .find(|path| {
            let lock = fs::read_to_string(path).unwrap_or_default();
            lock.contains(&format!("name = \"{name}\"\n"))
        })
}

/// Names and versions of the dependencies in a lock file.
fn dependency_versions(lock: &str) -> Vec<String> {
    let mut versions = Vec::new();
    for name in DEPENDENCIES {
        for entry in lock.split("[[package]]") {
            if field(entry, "name") == Some(name)
                && let Some(version) = field(entry, "version")
            {
                versions.push(format!("{name} {version}"));
            }
        }
    }
    versions
}

/// Value of a line such as `name = "value"`.
fn field<'a>(entry: &'a str, name: &str) -> Option<&'a str> {
    let prefix = format!("{name} = \"");
    let line = entry.lines().find(|line| line.starts_with(&prefix))?;
    line[prefix.len()..].strip_suffix('"')
}
