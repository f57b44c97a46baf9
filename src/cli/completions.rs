//! `seedbed completions`, and the manual pages for packages.

use std::fs;
use std::path::Path;

use clap::CommandFactory;
use clap_complete::Shell;

use super::{Cli, CliError};

/// Prints the script that completes commands in a shell.
pub(super) fn print(shell: Shell) {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "seedbed", &mut script);
    say!("{}", String::from_utf8_lossy(&script).trim_end());
}

/// Writes `seedbed.1`, and `seedbed-COMMAND.1` of each command.
pub(super) fn write_manual(folder: &Path) -> Result<(), CliError> {
    let error = |error: std::io::Error| {
        CliError::Runtime(format!("cannot write to {}: {error}", folder.display()))
    };
    fs::create_dir_all(folder).map_err(error)?;
    clap_mangen::generate_to(Cli::command(), folder).map_err(error)
}
