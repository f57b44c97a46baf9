//! Development tasks: `cargo xtask bless`, `cargo xtask docs`, `cargo xtask sample`.

use std::path::Path;
use std::process::{Command, ExitCode};

const HELP: &str = "Usage: cargo xtask COMMAND

Commands:
  bless   Write the golden files as the outputs are now; read `git diff` afterwards
  docs    Build the documentation of the workspace; warnings are errors
  sample  Record recordings/sample/ again, by the commands in recordings/README.md";

fn main() -> ExitCode {
    let command = std::env::args().nth(1);
    let result = match command.as_deref() {
        Some("bless") => bless(),
        Some("docs") => docs(),
        Some("sample") => sample(),
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

fn bless() -> Result<(), String> {
    for (package, tests) in GOLDEN_TESTS {
        let arguments = ["test", "--package", package, "--test", "it", tests];
        run_command(cargo_command(&arguments).env("UPDATE_EXPECT", "1"))?;
    }
    Ok(())
}

fn docs() -> Result<(), String> {
    run_command(
        cargo_command(&["doc", "--workspace", "--no-deps"]).env("RUSTDOCFLAGS", "--deny warnings"),
    )
}

/// Runs the commands of `recordings/README.md`: the first command records the sample, the others
/// read it.
fn sample() -> Result<(), String> {
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

/// A command of Cargo without the variables that `cargo xtask` sets for this program: build scripts
/// of dependencies look at some of them, so that Cargo would rebuild these dependencies.
fn cargo_command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO"));
    for (name, _) in std::env::vars() {
        let is_of_xtask = name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_");
        if is_of_xtask || name.starts_with("CARGO_BIN_") {
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
