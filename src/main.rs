//! The command `seedbed`. See [`seedbed::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    seedbed::cli::main()
}
