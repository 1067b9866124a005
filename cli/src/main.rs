//! The program `mrfgs`.

use std::process::ExitCode;

fn main() -> ExitCode {
    mrfgs_cli::main()
}
