//! Development tasks: `cargo xtask bless`, `cargo xtask dist`, `cargo xtask docs`, `cargo xtask sample`, `cargo xtask site`.

mod dist;
mod site;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

const HELP: &str = "Usage: cargo xtask COMMAND

Commands:
  bless   Replace the golden files by the current outputs; review the result with `git diff`
  dist    Make an archive of the program with licenses, completions and manual, and install it for a trial
  docs    Build the documentation of the workspace; warnings are errors
  sample  Record recordings/sample/ again, by the commands in recordings/README.md
  site    Build the documentation as a site with search in target/site/html, and check its links";

fn main() -> ExitCode {
    let command = std::env::args().nth(1);
    let result = match command.as_deref() {
        Some("bless") => bless(),
        Some("dist") => dist::dist(),
        Some("docs") => build_docs(),
        Some("sample") => record_sample(),
        Some("site") => site::site(),
        _ => Err(HELP.to_owned()),
    };
    if let Err(message) = result {
        eprintln!("{message}");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// Package and name filter of the tests that compare golden files.
const GOLDEN_TESTS: [(&str, &str); 2] = [("seedbed-env", "broken_envs"), ("seedbed", "messages")];

/// Replaces the golden files by the current outputs.
fn bless() -> Result<(), String> {
    for (package, name_filter) in GOLDEN_TESTS {
        let arguments = ["test", "--package", package, "--test", "it", name_filter];
        run_command(cargo_command(&arguments).env("UPDATE_EXPECT", "1"))?;
    }
    write_golden_episodes()
}

/// Plays the episodes with which the Python package compares its own.
fn write_golden_episodes() -> Result<(), String> {
    const FILE: &str = "python/tests/golden_episodes.txt";
    let arguments = "run --release --quiet --package seedbed-python --example golden_episodes";
    let arguments: Vec<&str> = arguments.split(' ').collect();
    let episodes = output(cargo_command(&arguments).current_dir(repository_folder()))?;
    std::fs::write(repository_folder().join(FILE), episodes)
        .map_err(|error| format!("cannot write {FILE}: {error}"))
}

fn build_docs() -> Result<(), String> {
    run_command(
        cargo_command(&["doc", "--workspace", "--no-deps"]).env("RUSTDOCFLAGS", "--deny warnings"),
    )
}

/// Runs the commands of `recordings/README.md`: the first command records the sample, the others
/// read it.
fn record_sample() -> Result<(), String> {
    let readme = std::fs::read_to_string(repository_folder().join("recordings/README.md"))
        .map_err(|error| format!("cannot read recordings/README.md: {error}"))?;
    let mut commands = readme
        .lines()
        .filter_map(|line| line.strip_prefix("    seedbed "));
    let record_arguments = commands
        .next()
        .ok_or("recordings/README.md has no command")?;
    run_seedbed(&format!(
        "{record_arguments} --out target/sample --overwrite"
    ))?;
    let [recorded, stored] = ["target/sample/run.rrd", "recordings/sample/run.rrd"];
    std::fs::copy(
        repository_folder().join(recorded),
        repository_folder().join(stored),
    )
    .map_err(|error| format!("cannot copy {recorded} to {stored}: {error}"))?;
    commands.try_for_each(run_seedbed)
}

/// Runs `seedbed ARGUMENTS` in a shell, which removes quotes around arguments.
fn run_seedbed(arguments: &str) -> Result<(), String> {
    let line = format!("cargo run --release --quiet -- {arguments}");
    run_command(Command::new("sh").args(["-c", &line]))
}

/// What `seedbed ARGUMENTS` prints.
fn seedbed_output(arguments: &str) -> Result<String, String> {
    let line = format!("cargo run --release --quiet -- {arguments}");
    output(
        Command::new("sh")
            .args(["-c", &line])
            .current_dir(repository_folder()),
    )
}

/// A Cargo command without the environment variables that Cargo sets for this program. Build
/// scripts of some dependencies read these variables, so Cargo would build the dependencies again.
fn cargo_command(arguments: &[&str]) -> Command {
    const PREFIXES: [&str; 3] = ["CARGO_PKG_", "CARGO_MANIFEST_", "CARGO_BIN_"];
    let mut command = Command::new(env!("CARGO"));
    for (name, _) in std::env::vars() {
        if PREFIXES.iter().any(|prefix| name.starts_with(prefix)) {
            command.env_remove(name);
        }
    }
    command.args(arguments);
    command
}

fn run_command(command: &mut Command) -> Result<(), String> {
    let status = command.current_dir(repository_folder()).status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{command:?} failed: {status}")),
        Err(error) => Err(format!("cannot run {command:?}: {error}")),
    }
}

/// Folder of the repository.
fn repository_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap_or(Path::new("."))
}

fn target_folder() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| repository_folder().join("target"), PathBuf::from)
}

/// The standard output of a command that must succeed.
fn output(command: &mut Command) -> Result<String, String> {
    let run = command
        .output()
        .map_err(|error| format!("cannot run {command:?}: {error}"))?;
    if !run.status.success() {
        return Err(format!(
            "{command:?} failed: {}",
            String::from_utf8_lossy(&run.stderr)
        ));
    }
    Ok(String::from_utf8_lossy(&run.stdout).into_owned())
}
