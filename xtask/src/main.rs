//! The project's chores: `cargo xtask bless`, `cargo xtask docs`, `cargo xtask sample`.

use std::path::Path;
use std::process::{Command, ExitCode};

const HELP: &str = "Usage: cargo xtask COMMAND

Commands:
  bless   Write the golden files as the outputs are now; read `git diff` afterwards
  docs    Build the documentation of the workspace; warnings are errors
  sample  Record recordings/sample/ again, by the commands in recordings/README.md";

fn main() -> ExitCode {
    let command = std::env::args().nth(1);
    let done = match command.as_deref() {
        Some("bless") => bless(),
        Some("docs") => docs(),
        Some("sample") => sample(),
        _ => Err(HELP.to_owned()),
    };
    if let Err(message) = done {
        eprintln!("{message}");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// The tests that compare golden files, each with its package.
const GOLDEN_TESTS: [(&str, &str); 2] = [("seedbed-env", "broken_envs"), ("seedbed", "messages")];

fn bless() -> Result<(), String> {
    for (package, tests) in GOLDEN_TESTS {
        let arguments = ["test", "--package", package, "--test", "it", tests];
        run(cargo(&arguments).env("UPDATE_EXPECT", "1"))?;
    }
    Ok(())
}

fn docs() -> Result<(), String> {
    run(cargo(&["doc", "--workspace", "--no-deps"]).env("RUSTDOCFLAGS", "--deny warnings"))
}

/// Runs the commands of `recordings/README.md`: the first makes the recording, the others read it.
fn sample() -> Result<(), String> {
    let page = std::fs::read_to_string(root().join("recordings/README.md"))
        .map_err(|error| format!("cannot read recordings/README.md: {error}"))?;
    let mut commands = page
        .lines()
        .filter_map(|line| line.strip_prefix("    seedbed "));
    let record = commands
        .next()
        .ok_or("recordings/README.md has no command")?;
    seedbed(&format!("{record} --out target/sample --overwrite"))?;
    let [made, kept] = ["target/sample/run.rrd", "recordings/sample/run.rrd"];
    std::fs::copy(root().join(made), root().join(kept))
        .map_err(|error| format!("cannot copy {made} to {kept}: {error}"))?;
    commands.try_for_each(seedbed)
}

/// Runs the program; the shell takes away the quotes of its arguments.
fn seedbed(arguments: &str) -> Result<(), String> {
    let line = format!("cargo run --release --quiet -- {arguments}");
    run(Command::new("sh").args(["-c", &line]))
}

fn cargo(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO"));
    command.args(arguments);
    command
}

fn run(command: &mut Command) -> Result<(), String> {
    let status = command.current_dir(root()).status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{command:?} failed: {status}")),
        Err(error) => Err(format!("cannot run {command:?}: {error}")),
    }
}

/// The repository.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap_or(Path::new("."))
}
