//! The command `seedbed`. It is a crate of its own on top of the library, so that a change of the
//! command line does not compile the library again.

#![warn(
    clippy::print_stderr,
    reason = "a line that cannot be written must not end the process: use `note!`"
)]

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
