//! The program `mrfgs`.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    mrfgs_cli::main()
}
