//! Numbers on the command line: negative ones, and those that come with a unit.

use std::ffi::OsString;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, CommandFactory, FromArgMatches};

use super::Arguments;

/// Unit of the numbers of some options.
struct Unit {
    /// Ending of the names of these options.
    ending: &'static str,
    name: &'static str,
    /// Units that people write, each with what it is in this one.
    written: &'static [(&'static str, f64)],
}

const UNITS: [Unit; 5] = [
    Unit {
        ending: "-nm",
        name: "nanometres (nm)",
        written: &[("nm", 1.0), ("um", 1e3), ("mm", 1e6), ("m", 1e9)],
    },
    Unit {
        ending: "-um",
        name: "micrometres (um)",
        written: &[("nm", 1e-3), ("um", 1.0), ("mm", 1e3), ("cm", 1e4), ("m", 1e6)],
    },
    Unit {
        ending: "-mb",
        name: "megabytes (MB)",
        written: &[
            ("kB", 1e-3),
            ("MB", 1.0),
            ("GB", 1e3),
            ("TB", 1e6),
            ("M", 1.0),
            ("G", 1e3),
        ],
    },
    Unit {
        ending: "-ms",
        name: "milliseconds (ms)",
        written: &[("us", 1e-3), ("ms", 1.0), ("s", 1e3)],
    },
    Unit {
        ending: "-deg",
        name: "degrees (deg)",
        written: &[("deg", 1.0)],
    },
];

/// The arguments of a process. A number below zero is the value of the option before it, which says what it takes.
pub(super) fn parse(given: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> Result<Arguments, clap::Error> {
    let matches = with_negative_numbers(Arguments::command()).try_get_matches_from(given)?;
    Arguments::from_arg_matches(&matches)
}

fn with_negative_numbers(command: Command) -> Command {
    let is_number = |name: &str| UNITS.iter().any(|unit| name.ends_with(unit.ending));
    let command = command.mut_args(|arg| match arg.get_long() {
        Some(name) if is_number(name) => arg.allow_negative_numbers(true),
        _ => arg,
    });
    command.mut_subcommands(with_negative_numbers)
}

/// Hint for a value that is no number, where a number of some unit is asked for.
pub(super) fn hint(error: &clap::Error) -> Option<String> {
    let (Some(ContextValue::String(option)), Some(ContextValue::String(value))) =
        (error.get(ContextKind::InvalidArg), error.get(ContextKind::InvalidValue))
    else {
        return None;
    };
    let name = option.split_whitespace().next()?;
    let unit = UNITS.iter().find(|unit| name.ends_with(unit.ending))?;
    if error.kind() != ErrorKind::ValueValidation || value.parse::<f64>().is_ok() {
        return None;
    }
    let value = value.trim();
    let in_unit = unit.written.iter().find_map(|(symbol, factor)| {
        let split = value.len().checked_sub(symbol.len())?;
        let (number, end) = value.split_at_checked(split)?;
        let is_unit = end.eq_ignore_ascii_case(symbol);
        let number: f64 = number.trim().parse().ok().filter(|_| is_unit)?;
        Some(format!(": {value} is {}", number * factor))
    });
    let separators = if value.contains(',') {
        ": write a decimal point, and no separators of thousands"
    } else {
        ""
    };
    Some(format!(
        "give a plain number of {}, such as 850 or 0.5{}",
        unit.name,
        in_unit.unwrap_or_else(|| separators.into())
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_with_units_are_told_in_that_of_the_option() {
        let hint_of = |words: &str| {
            let given = ["metalith"].into_iter().chain(words.split(' '));
            parse(given).err().and_then(|error| hint(&error))
        };
        let told = |words: &str, end: &str| {
            let hint = hint_of(words).unwrap();
            assert!(hint.ends_with(end), "{hint}");
        };
        told("new a.toml --diameter-um 20mm", "20mm is 20000");
        told("new a.toml --wavelength-nm 1.55um", "1.55um is 1550");
        told("verify a.toml b.gds --memory-mb 2GB", "2GB is 2000");
        told("new a.toml --focal-length-um 8,5e2", "no separators of thousands");
        told("new a.toml --focal-length-um far", "such as 850 or 0.5");
        assert_eq!(hint_of("new a.toml --diameter-um 20000"), None);
        assert_eq!(hint_of("new a.toml --diameter-um -5"), None);
        assert_eq!(hint_of("new a.toml --array 3"), None);
    }
}
