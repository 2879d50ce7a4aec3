//! `metalith schema`: the keys of a kind of file, for editors.

use std::path::PathBuf;

use clap::Args;
use metalith::Result;
use metalith::schema::{FileKind, write_schema};

use super::{Outcome, Terminal, print_line, print_text};

/// Print the JSON schema of a kind of TOML file: keys, types, units, ranges, defaults and meanings.
///
/// Editors that know the schema complete keys and mark mistakes. Taplo (in VS Code: Even Better TOML) finds it by the first line of
/// the file: `#:schema ./design.schema.json`.
#[derive(Args)]
#[command(after_help = "Example:\n  metalith schema design --out design.schema.json")]
pub(crate) struct SchemaArgs {
    /// Kind of file.
    #[arg(value_name = "KIND", value_parser = names(), required_unless_present = "list")]
    kind: Option<String>,

    /// Print the kinds, one in a line, and no schema.
    #[arg(long, conflicts_with_all = ["kind", "out"])]
    list: bool,

    /// Let the readers say their keys anew, in place of the schema that comes with the program: seconds of work.
    #[arg(long, hide = true, conflicts_with = "out")]
    of_readers: bool,

    /// The file to write; standard output if left out. A schema of an earlier version is replaced, any other file is not.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Kinds of files, each with what it is.
fn names() -> clap::builder::PossibleValuesParser {
    let value =
        |(name, _, what): (&'static str, FileKind, &'static str)| clap::builder::PossibleValue::new(name).help(what);
    FileKind::ALL.map(value).into()
}

pub(crate) fn run(args: &SchemaArgs, _terminal: &Terminal) -> Result<Outcome> {
    let Some(kind) = args.kind.as_deref().and_then(FileKind::of_name) else {
        let names: Vec<_> = FileKind::ALL.iter().map(|(name, ..)| *name).collect();
        print_text(&names.join("\n"));
        return Ok(Outcome::Fine);
    };
    match &args.out {
        Some(path) => {
            write_schema(kind, path)?;
            print_line!("{}", path.display());
        }
        None if args.of_readers => print_text(kind.schema_of_readers().trim_end()),
        None => print_text(kind.schema().trim_end()),
    }
    Ok(Outcome::Fine)
}
