//! Options of earlier versions: each is refused, and the one that stands for it now is named.

use std::ffi::OsString;

use clap::error::{ContextKind, ContextValue};

/// The cell of `psf` is stated by a file.
const CELL: &str = "give --cell FILE.toml with [cell]: the keys of the pillar and what surrounds it, as in a design";

/// An option, the commands that had it, and what to do.
const RENAMED: [(&str, &[&str], &str); 10] = [
    ("--as-lit", &["run", "verify", "psf"], "it is now called --oblique"),
    ("--rivals", &["compare"], "it is now called --baselines"),
    ("--height-nm", &["psf"], CELL),
    ("--pillar-material", &["psf"], CELL),
    ("--substrate-material", &["psf"], CELL),
    ("--spacer-nm", &["psf"], CELL),
    ("--spacer-material", &["psf"], CELL),
    ("--residual-nm", &["psf"], CELL),
    ("--ambient-index", &["psf"], CELL),
    ("--ambient-material", &["psf"], CELL),
];

/// Hint on what to do instead, for arguments that were refused for an option of an earlier version.
pub(crate) fn hint(error: &clap::Error, given: &[OsString]) -> Option<&'static str> {
    let Some(ContextValue::String(option)) = error.get(ContextKind::InvalidArg) else {
        return None;
    };
    let of = |commands: &[&str]| given.iter().any(|word| commands.iter().any(|c| word == c));
    let found = RENAMED.iter().find(|(old, commands, _)| option == old && of(commands));
    found.map(|(_, _, hint)| *hint)
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::*;
    use crate::cli::Arguments;

    #[test]
    fn options_of_earlier_versions_name_those_of_now() {
        for (old, commands, wanted) in RENAMED {
            for command in commands {
                let given = ["metalith", command, "file", old].map(OsString::from);
                let error = Arguments::try_parse_from(&given).err().expect("no such option");
                assert_eq!(hint(&error, &given), Some(wanted), "{command} {old}");
                let command = Arguments::command().find_subcommand(command).cloned().unwrap();
                assert!(command.get_arguments().all(|a| a.get_long() != old.strip_prefix("--")));
            }
        }
        let given = ["metalith", "check", "file", "--as-lit"].map(OsString::from);
        let error = Arguments::try_parse_from(&given).err().unwrap();
        assert_eq!(hint(&error, &given), None);
    }
}
