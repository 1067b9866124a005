//! `mrfgs completions` and `mrfgs man`: the command line as shells and readers take it.

use std::fs;
use std::io::ErrorKind;
use std::path::PathBuf;

use clap::{Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use mrfgs::image::write;
use mrfgs::{Error, Result};

use crate::Cli;
use crate::outputs::Written;

const COMPLETIONS: &str = "\
Examples:
  mrfgs completions bash > ~/.local/share/bash-completion/completions/mrfgs
  mrfgs completions zsh > ~/.zfunc/_mrfgs
  mrfgs completions fish > ~/.config/fish/completions/mrfgs.fish";

/// Print what a shell needs to complete the command line
#[derive(clap::Args)]
#[command(after_help = COMPLETIONS)]
pub(super) struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

/// Write the man pages: mrfgs.1 and one for each subcommand
#[derive(clap::Args)]
pub(super) struct ManArgs {
    /// Folder to write to, such as ~/.local/share/man/man1; created where there is none
    folder: PathBuf,
}

pub(super) fn completions(args: &CompletionsArgs) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "mrfgs", &mut script);
    crate::print(&String::from_utf8_lossy(&script))
}

pub(super) fn man(args: &ManArgs) -> Result<()> {
    match fs::create_dir(&args.folder) {
        Err(e) if e.kind() == ErrorKind::NotFound => {
            return Err(Error::write(&args.folder, "there is no folder to make it in; create that first"));
        }
        Err(e) if e.kind() != ErrorKind::AlreadyExists => return Err(Error::write(&args.folder, e)),
        _ => {}
    }
    let mut root = Cli::command();
    root.build();
    let mut written = Written::default();
    for (name, command) in pages(&root) {
        let path = args.folder.join(format!("{name}.1"));
        let mut page = Vec::new();
        Man::new(command).title(name.as_str()).render(&mut page).map_err(|e| Error::write(&path, e))?;
        written.note(&path, write::save(&path, &page))?;
    }
    written.keep();
    Ok(())
}

/// The name and the command of every page.
fn pages(root: &Command) -> impl Iterator<Item = (String, Command)> {
    let subcommands = root.get_subcommands().filter(|command| command.get_name() != "help");
    let subcommands = subcommands.map(|command| {
        let name = format!("mrfgs-{}", command.get_name());
        (name.clone(), command.clone().display_name(name))
    });
    std::iter::once(("mrfgs".into(), root.clone())).chain(subcommands)
}
