//! The program: arguments in, exit code out. Everything it does is a call of the library.

mod accuracy_args;
mod calibrate;
mod camera_args;
mod cells;
mod check;
#[cfg(feature = "baselines")]
mod compare;
mod compensated;
mod completions;
mod convert;
mod course;
mod dataset;
mod denoise;
mod diff;
mod exposure_args;
mod handoff;
mod images;
mod info;
mod layout;
mod new;
mod new_set;
mod numbers;
mod optimise;
mod optimise_camera;
mod out_folder;
mod output;
mod paths;
mod picture;
mod plan;
mod psf;
mod reading;
mod renamed;
mod restore;
mod run;
mod schema;
mod section_text;
mod shipped_designs;
mod standard_input;
mod study;
mod terminal;
#[cfg(feature = "training")]
mod train;
mod verify;

use std::ffi::OsString;
use std::fmt;
use std::path::PathBuf;
use std::sync::OnceLock;

use clap::{Parser, Subcommand};
use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, SourceCode};

use metalith::text::{printable, printable_lines};
use metalith::{Error, Faults};
use output::{print_json, print_line, print_text};
pub use terminal::Terminal;

/// Outcome of a command that did its work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Exit code 0.
    Fine,
    /// Exit code 1: done, but outside the limits.
    OutsideLimits,
    /// Exit code 3: something that was asked for could not be done.
    NotDone,
}

impl Outcome {
    /// Fine, if what was asked holds.
    fn of(holds: bool) -> Self {
        if holds { Self::Fine } else { Self::OutsideLimits }
    }
}

/// More threads than any machine here has cores; each takes memory of its own.
const MOST_THREADS: i64 = 512;

/// Turn the phase of a metalens array into a layout that a cleanroom can write, read that file back, and simulate the
/// image that the chip makes.
#[derive(Parser)]
#[command(version, propagate_version = true, arg_required_else_help = true)]
#[command(after_help = "Exit codes: 0 fine, 1 outside limits, 2 bad input, 3 could not be done.")]
struct Arguments {
    #[command(subcommand)]
    command: Command,

    /// Number of threads; all cores if left out. Results do not depend on it.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    threads: Option<u16>,

    /// Print only errors and requested output.
    #[arg(long, short, global = true)]
    quiet: bool,
}

/// One file in this folder for each.
#[derive(Subcommand)]
enum Command {
    New(new::NewArgs),
    Run(run::RunArgs),
    Layout(layout::LayoutArgs),
    #[command(visible_alias = "optimize")]
    Optimise(optimise::OptimiseArgs),
    Picture(picture::PictureArgs),
    Restore(restore::RestoreArgs),
    Dataset(dataset::DatasetArgs),
    #[cfg(feature = "training")]
    Train(train::TrainArgs),
    Denoise(denoise::DenoiseArgs),
    #[cfg(feature = "baselines")]
    Compare(compare::CompareArgs),
    Verify(verify::VerifyArgs),
    Psf(Box<psf::PsfArgs>),
    Handoff(handoff::HandoffArgs),
    Cells(cells::CellsArgs),
    Info(info::InfoArgs),
    Check(check::CheckArgs),
    Diff(diff::DiffArgs),
    Convert(convert::ConvertArgs),
    Plan(plan::PlanArgs),
    NewSet(new_set::NewSetArgs),
    Calibrate(calibrate::CalibrateArgs),
    Study(study::StudyArgs),
    Schema(schema::SchemaArgs),
    Completions(completions::CompletionsArgs),
    #[command(hide = true)]
    Manual(completions::ManualArgs),
    /// Names the commands that do its work.
    #[command(hide = true)]
    Photographs {
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
        _ignored: Vec<OsString>,
    },
}

/// Command by which the program is started again, if it was started by another name than its file's.
static STARTED_AS: OnceLock<PathBuf> = OnceLock::new();

/// The program as a separate process can be started.
///
/// # Errors
/// If the system does not say.
fn program() -> metalith::Result<PathBuf> {
    match STARTED_AS.get() {
        Some(path) => Ok(path.clone()),
        None => std::env::current_exe().map_err(Error::io("find", "the program".as_ref())),
    }
}

/// Run the program with the arguments of a process, the first of which is its name; the answer is its exit code. Some hosts
/// of the library, such as an interpreter, are not the program themselves: then the first argument is a file that is.
pub fn run_with(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let given: Vec<OsString> = arguments.into_iter().collect();
    let arguments = match numbers::parse(&given) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help is no error, and goes to standard output. Errors repeat what was given, which may be the name of a file.
            // A break in a name would begin a line: the error is that of the names as they are shown.
            let names = given.iter().map(|name| printable(&name.to_string_lossy()).into_owned());
            let error = numbers::parse(names).err().unwrap_or(error);
            let plain = error.render().to_string();
            if printable_lines(&plain) == plain {
                let _ = error.print();
            } else {
                output::tell(&plain);
            }
            let hint = renamed::hint(&error, &given).map(str::to_owned);
            if let Some(hint) = hint.or_else(|| numbers::hint(&error)) {
                output::tell(&format!("\n  help: {hint}\n"));
            }
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    if let Some(first) = given.first().map(PathBuf::from)
        && std::env::current_exe().is_ok_and(|own| own.file_stem() != first.file_stem())
        && first.is_file()
    {
        let _ = STARTED_AS.set(first);
    }
    if let Some(threads) = arguments.threads {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.into())
            .build_global();
        if let Err(error) = pool {
            output::tell(&format!(
                "error: {threads} threads cannot be started: {error}\n  help: use fewer with --threads\n"
            ));
            return 2;
        }
    }
    let terminal = Terminal::new(arguments.quiet);
    let outcome = dispatch(&arguments.command, &terminal);
    terminal.clear();
    if let Some(reason) = output::failure() {
        output::tell(&format!("error: cannot write to standard output: {reason}\n"));
        return 3;
    }
    match outcome {
        Ok(Outcome::Fine) => 0,
        Ok(Outcome::OutsideLimits) => 1,
        Ok(Outcome::NotDone) => 3,
        Err(error) => {
            report(&error);
            error.exit_code()
        }
    }
}

fn dispatch(command: &Command, terminal: &Terminal) -> metalith::Result<Outcome> {
    match command {
        Command::New(args) => new::run(args, terminal),
        Command::Run(args) => run::run(args, terminal),
        Command::Layout(args) => layout::run(args, terminal),
        Command::Optimise(args) => optimise::run(args, terminal),
        Command::Photographs { .. } => Err(Error::refused(
            "command/removed",
            "there is no command `photographs` any more",
            "use `picture` for one scene, `compare` for a table of many photographs and several designs",
        )),
        Command::Dataset(args) => dataset::run(args, terminal),
        #[cfg(feature = "training")]
        Command::Train(args) => train::run(args, terminal),
        Command::Denoise(args) => denoise::run(args, terminal),
        #[cfg(feature = "baselines")]
        Command::Compare(args) => compare::run(args, terminal),
        Command::Picture(args) => picture::run(args, terminal),
        Command::Restore(args) => restore::run(args, terminal),
        Command::Handoff(args) => handoff::run(args, terminal),
        Command::Verify(args) => verify::run(args, terminal),
        Command::Psf(args) => psf::run(args, terminal),
        Command::Cells(args) => cells::run(args, terminal),
        Command::Info(args) => info::run(args, terminal),
        Command::Check(args) => check::run(args, terminal),
        Command::Diff(args) => diff::run(args, terminal),
        Command::Convert(args) => convert::run(args, terminal),
        Command::Plan(args) => plan::run(args, terminal),
        Command::NewSet(args) => new_set::run(args, terminal),
        Command::Calibrate(args) => calibrate::run(args, terminal),
        Command::Study(args) => study::run(args, terminal),
        Command::Schema(args) => schema::run(args, terminal),
        Command::Completions(args) => completions::run(args, terminal),
        Command::Manual(args) => completions::manual(args, terminal),
    }
}

/// Errors in text files are shown with the text and its places marked, all others as one paragraph. Each is shown with its identity,
/// which stays when the words change.
fn report(error: &Error) {
    if let Error::Text(faults) = error {
        let (mut drawn, mut plain) = (String::new(), String::new());
        let headline = Headline(faults);
        let drawer = GraphicalReportHandler::new();
        let drawer_of_plain = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
        if drawer.render_report(&mut drawn, &headline).is_ok()
            && drawer_of_plain.render_report(&mut plain, &headline).is_ok()
        {
            output::tell_drawn(&drawn, &plain);
            return;
        }
    }
    output::tell(&format!("error[{}]: {error}\n", error.id()));
}

/// The faults of a file under one line that counts them; each is then drawn at its place.
#[derive(Debug)]
struct Headline<'a>(&'a Faults);

impl fmt::Display for Headline<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.0.path().display().to_string();
        let path = printable(&path);
        match (self.0.count(), self.0.faults().len()) {
            (1, _) => write!(f, "one mistake in {path}"),
            (count, shown) if shown < count => write!(f, "{count} mistakes in {path}, the first {shown} are"),
            (count, _) => write!(f, "{count} mistakes in {path}"),
        }
    }
}

impl std::error::Error for Headline<'_> {}

impl Diagnostic for Headline<'_> {
    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0.source_code()
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        self.0.related()
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::Arguments;

    /// A terminal breaks lines where it ends: a sentence that holds its own breaks is broken twice.
    #[test]
    fn sentences_below_a_help_are_not_broken() {
        let commands = Arguments::command();
        for command in commands.get_subcommands() {
            let below = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            // Examples are indented.
            for line in below.lines().filter(|l| !l.is_empty() && !l.starts_with(' ')) {
                assert!(
                    line.ends_with(['.', ':']),
                    "{}: `{line}` does not end with a sentence",
                    command.get_name()
                );
            }
        }
    }
}
