//! `mrfgs completions`.

use clap::Command;
use clap_complete::Shell;
use mrfgs::Result;

use crate::console;

const EXAMPLES: &str = "\
Examples:
  mrfgs completions bash > ~/.local/share/bash-completion/completions/mrfgs
  mrfgs completions zsh > ~/.zfunc/_mrfgs
  mrfgs completions fish > ~/.config/fish/completions/mrfgs.fish";

/// Print a completion script for a shell
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Args {
    /// The shell
    shell: Shell,
}

/// Prints the completions of `program`.
pub(crate) fn run(args: &Args, mut program: Command) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "mrfgs", &mut script);
    console::print(&String::from_utf8_lossy(&script))
}
