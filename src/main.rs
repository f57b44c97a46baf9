//! The command `seedbed`. It is a crate of its own on top of the library, so that a change of the
//! command line does not compile the library again.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
