//! `mrfgs man`.

use std::io::ErrorKind;
use std::path::PathBuf;

use clap::Command;
use clap_mangen::Man;
use mrfgs::Error;
use mrfgs::image::write;

use crate::failure::Result;
use crate::outputs::{Written, files};

/// Write man pages: mrfgs.1 and one per subcommand
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder to write to, such as ~/.local/share/man/man1; created if it does not exist
    folder: PathBuf,
}

/// Writes the man pages of `program`.
pub(crate) fn run(args: &Args, mut program: Command) -> Result<()> {
    files::create_folder(&args.folder).map_err(|e| match e.kind() {
        ErrorKind::NotFound => {
            Error::write(&args.folder, "its parent folder does not exist; create that first")
        }
        _ => Error::write(&args.folder, e),
    })?;
    program.build();
    let mut written = Written::default();
    for (name, command) in pages(&program, "mrfgs") {
        let path = args.folder.join(format!("{name}.1"));
        let mut page = Vec::new();
        Man::new(command).title(name.as_str()).render(&mut page).map_err(|e| Error::write(&path, e))?;
        written.note(&path, write::save(&path, &page))?;
    }
    written.keep();
    Ok(())
}

/// The pages of a command called `name` and of all its subcommands, each with its name.
fn pages(command: &Command, name: &str) -> Vec<(String, Command)> {
    let subcommands = command.get_subcommands().filter(|command| command.get_name() != "help");
    let below = subcommands.flat_map(|command| pages(command, &format!("{name}-{}", command.get_name())));
    std::iter::once((name.to_owned(), command.clone().display_name(name.to_owned()))).chain(below).collect()
}
