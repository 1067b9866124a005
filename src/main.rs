//! The command line of mrfgs.

mod cli;

use std::io::Write;
use std::panic;
use std::process::ExitCode;

fn main() -> ExitCode {
    cli::tell_panics_in_one_line();
    match panic::catch_unwind(cli::run) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        // It has been told.
        Err(_) => ExitCode::FAILURE,
        Ok(Err(failure)) => {
            // Where standard error is closed there is nobody left to tell.
            let _ = writeln!(std::io::stderr(), "mrfgs: {failure}");
            failure.exit_code()
        }
    }
}
