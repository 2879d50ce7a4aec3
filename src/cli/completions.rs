//! `metalith completions` and `metalith manual`: what shells and `man` know of the program.

use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_complete::Shell;
use metalith::{AtomicFile, Result};

use super::{Arguments, Outcome, Terminal, output, print_line};

/// Print the completion script of a shell.
#[derive(Args)]
#[command(after_help = "Example:\n  metalith completions bash > ~/.local/share/bash-completion/completions/metalith")]
pub(crate) struct CompletionsArgs {
    shell: Shell,
}

/// Write the manual pages of the program and of each command into a folder.
#[derive(Args)]
pub(crate) struct ManualArgs {
    /// Folder for `metalith.1`, `metalith-run.1` and so on.
    folder: PathBuf,
}

pub(crate) fn run(args: &CompletionsArgs, _terminal: &Terminal) -> Result<Outcome> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Arguments::command(), "metalith", &mut text);
    output::print_text(String::from_utf8_lossy(&text).trim_end());
    Ok(Outcome::Fine)
}

pub(crate) fn manual(args: &ManualArgs, _terminal: &Terminal) -> Result<Outcome> {
    let mut program = Arguments::command();
    program.build();
    let whole = std::iter::once(program.clone());
    for command in whole.chain(program.get_subcommands().filter(|c| !c.is_hide_set()).cloned()) {
        let name = command.get_display_name().unwrap_or(command.get_name()).to_owned();
        let path = args.folder.join(format!("{name}.1"));
        let mut page = Vec::new();
        clap_mangen::Man::new(command)
            .render(&mut page)
            .map_err(metalith::Error::io("format", &path))?;
        AtomicFile::write(&path, &page)?;
        print_line!("{}", path.display());
    }
    Ok(Outcome::Fine)
}
