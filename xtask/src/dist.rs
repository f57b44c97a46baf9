//! `cargo xtask dist`: an archive of the program for this kind of machine, with its licenses, shell completions
//! and manual pages, and a trial installation from it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::{cargo_command, output, repository_folder, run_command, target_folder};

const INSTALL_SCRIPT: &str = include_str!("install.sh");

/// Shells, and the paths of their completions below the directory of the archive.
const COMPLETIONS: [(&str, &str); 3] = [
    ("bash", "share/bash-completion/completions/seedbed"),
    ("zsh", "share/zsh/site-functions/_seedbed"),
    ("fish", "share/fish/vendor_completions.d/seedbed.fish"),
];

/// Maximum size of the archive and of the program, in bytes.
const MAX_SIZE: u64 = 40_000_000;

/// Builds the program, writes the archive to `target/dist`, and installs it in a temporary directory.
pub(super) fn dist() -> Result<(), String> {
    let mut build = cargo_command(&["rustc", "--release", "--locked", "--bin", "seedbed", "--"]);
    build.args(linker_flags());
    run_command(build.env("CARGO_ENCODED_RUSTFLAGS", flags_without_paths()))?;
    let target = target_folder();
    let program = target.join("release/seedbed");
    check_paths(&program)?;
    let name = format!("seedbed-{}-{}", env!("CARGO_PKG_VERSION"), host()?);
    let folder = target.join("dist").join(&name);
    let _ = fs::remove_dir_all(&folder);
    fill(&folder, &program)?;
    let archive = target.join("dist").join(format!("{name}.tar.gz"));
    run_command(
        Command::new("tar")
            .args([
                "--sort=name",
                "--owner=0",
                "--group=0",
                "--numeric-owner",
                "-czf",
            ])
            .arg(&archive)
            .arg("-C")
            .arg(target.join("dist"))
            .arg(&name),
    )?;
    check_size(&archive)?;
    check_size(&program)?;
    try_installation(&archive, &name)
}

/// Flags with which the paths in messages of panics do not begin with the folder of Cargo's packages. Flags of the
/// caller stay: Cargo builds all dependencies again when they change.
fn flags_without_paths() -> String {
    std::env::var("CARGO_ENCODED_RUSTFLAGS")
        .unwrap_or_else(|_| format!("--remap-path-prefix={}=cargo", cargo_home()))
}

fn cargo_home() -> String {
    let home = std::env::var("HOME").unwrap_or_default();
    std::env::var("CARGO_HOME").unwrap_or_else(|_| format!("{home}/.cargo"))
}

/// A program that is given away does not tell where it was built.
fn check_paths(program: &Path) -> Result<(), String> {
    let bytes = fs::read(program).map_err(|error| error.to_string())?;
    for folder in [cargo_home(), repository_folder().display().to_string()] {
        if bytes
            .windows(folder.len())
            .any(|part| part == folder.as_bytes())
        {
            return Err(format!("{} contains the path {folder}", program.display()));
        }
    }
    Ok(())
}

/// Writes all files of the archive.
fn fill(folder: &Path, program: &Path) -> Result<(), String> {
    let repository = repository_folder();
    copy(program, &folder.join("bin/seedbed"))?;
    for name in [
        "README.md",
        "CHANGELOG.md",
        "LICENSE-APACHE",
        "LICENSE-MIT",
        "CITATION.cff",
    ] {
        copy(
            &repository.join(name),
            &folder.join("share/doc/seedbed").join(name),
        )?;
    }
    let licenses = third_party_licenses()?;
    write(
        &folder.join("share/doc/seedbed/THIRD-PARTY-LICENSES.txt"),
        &licenses,
    )?;
    for (shell, path) in COMPLETIONS {
        let script = output(Command::new(program).args(["completions", shell]))?;
        write(&folder.join(path), &script)?;
    }
    let manual = folder.join("share/man/man1");
    output(Command::new(program).arg("manual").arg(manual))?;
    write(&folder.join("install.sh"), INSTALL_SCRIPT)?;
    run_command(
        Command::new("chmod")
            .arg("+x")
            .arg(folder.join("install.sh")),
    )
}

/// Names, versions and license texts of all packages that are linked into the program.
fn third_party_licenses() -> Result<String, String> {
    let tree = [
        "tree",
        "--locked",
        "--package",
        "seedbed",
        "--edges",
        "normal",
        "--prefix",
        "none",
    ];
    let listed = output(cargo_command(&tree).args(["--format", "{p}"]))?;
    let metadata = output(&mut cargo_command(&[
        "metadata",
        "--locked",
        "--format-version",
        "1",
    ]))?;
    let metadata: serde_json::Value =
        serde_json::from_str(&metadata).map_err(|error| error.to_string())?;
    let mut sections = BTreeMap::new();
    for package in metadata["packages"].as_array().into_iter().flatten() {
        let text = |key: &str| package[key].as_str().unwrap_or_default();
        let name = format!("{} v{}", text("name"), text("version"));
        let is_linked = listed
            .lines()
            .any(|line| line == name || line.starts_with(&format!("{name} ")));
        if is_linked && package["source"].is_string() {
            let folder = Path::new(text("manifest_path"))
                .parent()
                .unwrap_or(Path::new("."));
            let texts = license_texts(folder);
            sections.insert(
                name.clone(),
                format!("{name}\nlicense: {}\n\n{texts}", text("license")),
            );
        }
    }
    let separator = format!("\n{}\n", "=".repeat(100));
    Ok(sections.into_values().collect::<Vec<_>>().join(&separator))
}

/// The texts of all license files of a package.
fn license_texts(folder: &Path) -> String {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    let is_license = |path: &PathBuf| {
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().to_uppercase());
        name.is_some_and(|name| {
            ["LICENSE", "LICENCE", "COPYING", "NOTICE"]
                .iter()
                .any(|word| name.contains(word))
        })
    };
    let texts = paths.iter().filter(|path| is_license(path));
    texts
        .filter_map(|path| fs::read_to_string(path).ok())
        .collect::<Vec<_>>()
        .join("\n")
}

/// Unpacks the archive, installs it, and uses the program where there is nothing else.
fn try_installation(archive: &Path, name: &str) -> Result<(), String> {
    let folder = target_folder().join("dist/trial");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(folder.join("empty")).map_err(|error| error.to_string())?;
    run_command(
        Command::new("tar")
            .arg("-xzf")
            .arg(archive)
            .arg("-C")
            .arg(&folder),
    )?;
    let prefix = folder.join("prefix");
    run_command(Command::new(folder.join(name).join("install.sh")).arg(&prefix))?;
    let program = prefix.join("bin/seedbed");
    for arguments in [&["init"][..], &["run", "short_pole", "--quiet"], &["runs"]] {
        let mut command = Command::new(&program);
        print!(
            "{}",
            output(command.args(arguments).current_dir(folder.join("empty")))?
        );
    }
    fs::remove_dir_all(&folder).map_err(|error| error.to_string())
}

fn check_size(path: &Path) -> Result<(), String> {
    let size = fs::metadata(path).map_err(|error| error.to_string())?.len();
    println!("{}: {:.1} MB", path.display(), size as f64 / 1e6);
    if size > MAX_SIZE {
        return Err(format!(
            "{} is larger than {MAX_SIZE} bytes",
            path.display()
        ));
    }
    Ok(())
}

/// For example `x86_64-unknown-linux-gnu`.
fn host() -> Result<String, String> {
    let version = output(Command::new("rustc").arg("-vV"))?;
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned)
        .ok_or_else(|| "rustc -vV has no line `host:`".to_owned())
}

/// Functions with the same machine code are stored once, which makes the program 5 % smaller. Rust never promises that
/// two functions have different addresses. Only where the linker that comes with Rust is the default.
fn linker_flags() -> &'static [&'static str] {
    if cfg!(all(
        target_arch = "x86_64",
        target_os = "linux",
        target_env = "gnu"
    )) {
        &["-C", "link-arg=-Wl,--icf=all"]
    } else {
        &[]
    }
}

fn copy(from: &Path, to: &Path) -> Result<(), String> {
    create_parent(to)?;
    fs::copy(from, to)
        .map(|_| ())
        .map_err(|error| format!("cannot copy {}: {error}", from.display()))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    create_parent(path)?;
    fs::write(path, text).map_err(|error| format!("cannot write {}: {error}", path.display()))
}

fn create_parent(path: &Path) -> Result<(), String> {
    let parent = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(parent)
        .map_err(|error| format!("cannot create {}: {error}", parent.display()))
}
