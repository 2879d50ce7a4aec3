//! `metalith check`: design rules for a build server.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::drc::{self, CheckInput, Date, Deck, DrcReport, Waivers};
use metalith::file::InputFiles;
use metalith::gds::{LayerNumber, ReadLimits};
use metalith::report::counted;
use metalith::schema::FileKind;
use metalith::text::printable_json;
use metalith::{AtomicFile, Error, Layout, Result};

use super::compensated::CompensatedFor;
use super::course::Course;
use super::output::is_standard_output;
use super::paths::name_of;
use super::reading::ReadingArgs;
use super::standard_input::InputFile;
use super::{Outcome, Terminal, print_line, print_text, standard_input};

/// Check a layout against design rules.
#[derive(Args)]
#[command(
    after_help = "Exit codes: 0 clean or all waived, 1 violations, 2 bad input, 3 a rule did not run.\n\
    Example:\n  metalith check out/mini_3x3/mini_3x3_pillars.gds \\\n    --design designs/mini_3x3.toml --sarif check.sarif"
)]
pub(crate) struct CheckArgs {
    /// The layout, in any hierarchy, of any program; `-` for standard input.
    layout: PathBuf,

    /// Rules file. If left out a shipped one: squares.toml, circles.toml or rectangles.toml, whichever the pillars are; with a
    /// design of the published cell sin_pillars.toml.
    #[arg(long, value_name = "RULES.toml")]
    rules: Option<PathBuf>,

    /// Write a rules file with the pitch, widths and gaps that the layout holds, instead of checking it.
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["rules", "design", "waivers", "with", "lyrdb", "junit", "sarif", "json"])]
    new_rules: Option<PathBuf>,

    /// Another layout on the same substrate, such as the pillars when apertures are checked.
    #[arg(long, value_name = "FILE.gds")]
    with: Vec<PathBuf>,

    /// The design that the layout should contain; activates the rules that compare with it.
    #[arg(long, value_name = "DESIGN.toml")]
    design: Option<PathBuf>,

    #[command(flatten)]
    reading: ReadingArgs,

    #[command(flatten)]
    compensated: CompensatedFor,

    /// File with violations that have been accepted.
    #[arg(long, value_name = "WAIVERS.toml")]
    waivers: Option<PathBuf>,

    /// Largest number of markers stored for each rule; all violations are counted.
    #[arg(long, value_name = "N", default_value_t = 100)]
    markers: usize,

    /// Print the result as JSON.
    #[arg(long)]
    json: bool,

    /// Write the result for KLayout's marker browser. With `-` it is printed instead of the summary. --junit and --sarif also
    /// take `-`.
    #[arg(long, value_name = "FILE.lyrdb")]
    lyrdb: Option<PathBuf>,

    /// Write the result for build servers that read JUnit.
    #[arg(long, value_name = "FILE.xml")]
    junit: Option<PathBuf>,

    /// Write the result as SARIF 2.1.0.
    #[arg(long, value_name = "FILE.sarif")]
    sarif: Option<PathBuf>,
}

type Form = fn(&DrcReport) -> String;

impl CheckArgs {
    /// Refuse to overwrite what is read, and to print two things at once.
    fn paths_are_apart(&self) -> Result<()> {
        let inputs = [&self.rules, &self.design, &self.waivers, &self.compensated.model];
        let inputs = inputs.into_iter().flatten().chain(&self.with).chain([&self.layout]);
        let outputs = self.outputs().map(|(path, _)| path);
        let (printed, files): (Vec<&Path>, Vec<&Path>) = outputs
            .chain(self.new_rules.as_deref())
            .partition(|path| is_standard_output(path));
        if printed.len() + usize::from(self.json) > 1 {
            return Err(Error::refused(
                "option/two-on-standard-output",
                "two results go to standard output",
                "give `-` to one of --lyrdb, --junit and --sarif, without --json",
            ));
        }
        InputFiles::of(inputs.map(PathBuf::as_path)).check_outputs(&files)
    }

    /// Paths of the results, each with its form.
    fn outputs(&self) -> impl Iterator<Item = (&Path, Form)> {
        let all: [(&Option<PathBuf>, Form); 3] = [
            (&self.lyrdb, drc::lyrdb),
            (&self.junit, drc::junit),
            (&self.sarif, drc::sarif),
        ];
        all.into_iter()
            .filter_map(|(path, form)| Some((path.as_deref()?, form)))
    }
}

pub(crate) fn run(args: &CheckArgs, terminal: &Terminal) -> Result<Outcome> {
    args.paths_are_apart()?;
    let named = args.rules.as_deref().map(Deck::read).transpose()?;
    let waivers = args.waivers.as_deref().map(Waivers::read).transpose()?;
    let mut design = {
        let read = |path| standard_input::design(path, terminal);
        args.design.as_deref().map(read).transpose()?
    };
    terminal.stop_on_interrupt();
    let file = InputFile::of(&args.layout)?;
    terminal.follow(Course::of_check(&file));
    let open = |path: &Path| Layout::open_with(path, ReadLimits::default(), terminal);
    let deck = match (named, &design) {
        (Some(deck), Some(design)) => Some(deck.for_pillars_of(design)),
        (Some(deck), None) => Some(deck),
        (None, Some(design)) => Some(Deck::for_design(design).for_pillars_of(design)),
        (None, None) => None,
    };
    let deck = match (deck, args.reading.layer) {
        (Some(deck), Some(layer)) => Some(deck.with_pillars_on(layer)),
        (deck, _) => deck,
    };
    let layout = match deck {
        Some(_) => args.reading.open(&file, terminal)?,
        None => args.reading.open_counted(&file, terminal)?,
    };
    if let Some(layer) = args.reading.layer {
        has_shapes(&layout, layer)?;
    }
    if let Some(path) = &args.new_rules {
        return write_rules(&layout, args.reading.layer, path, terminal);
    }
    let with = args.with.iter().map(|path| open(path)).collect::<Result<Vec<_>, _>>()?;
    let array = match &mut design {
        Some(design) if args.compensated.model.is_some() => Some(args.compensated.array(design, terminal)?),
        _ => None,
    };
    let input = CheckInput {
        with: with.iter().collect(),
        design: design.as_ref(),
        array: array.as_ref(),
        waivers: waivers.as_ref(),
        today: Date::today(),
        markers: args.markers,
    };
    let report = match &deck {
        Some(deck) => {
            let mut report = drc::check(&layout, deck, &input, terminal)?;
            // Several layers of pillars are doses of one.
            if let Some(layer) =
                args.reading
                    .layer
                    .or(deck.pillars.first().copied().filter(|_| deck.pillars.len() == 1))
            {
                drc::add_recognition(&mut report, &layout, layer, &input, terminal)?;
            }
            report
        }
        None => drc::check_generic(&layout, args.reading.layer, &input, terminal)?,
    };
    terminal.clear();
    let mut text: Form = if args.json { json } else { drc::text };
    let mut files = Vec::new();
    for (path, form) in args.outputs() {
        if is_standard_output(path) {
            text = form;
        } else {
            files.push((path, form(&report)));
        }
    }
    write_together(&files, terminal)?;
    print_text(text(&report).trim_end());
    Ok(match report.exit_code() {
        0 => Outcome::Fine,
        1 => Outcome::OutsideLimits,
        _ => Outcome::NotDone,
    })
}

/// Write the forms of one result: those of a folder together.
fn write_together(files: &[(&Path, String)], terminal: &Terminal) -> Result<()> {
    let folder_of = |path: &Path| path.parent().unwrap_or(Path::new("")).to_owned();
    for (k, (first, _)) in files.iter().enumerate() {
        let of_one: Vec<_> = files
            .iter()
            .filter(|(path, _)| folder_of(path) == folder_of(first))
            .collect();
        if files[..k].iter().any(|(path, _)| folder_of(path) == folder_of(first)) {
            continue;
        }
        if let [(path, text)] = of_one[..] {
            AtomicFile::write(path, text.as_bytes())?;
            continue;
        }
        // None of them is an input: asked at first.
        terminal
            .turn_at(&folder_of(first), [])?
            .replace(&name_of(first), &[], |folder| {
                let mut each = of_one.iter();
                each.try_for_each(|(path, text)| AtomicFile::write(&folder.join(name_of(path)), text.as_bytes()))
            })?;
    }
    Ok(())
}

/// Rules of an empty layer hold, and say nothing.
fn has_shapes(layout: &Layout, layer: LayerNumber) -> Result<()> {
    let used = layout.used_layers();
    if used.contains(&layer) {
        return Ok(());
    }
    let words: Vec<String> = used.iter().map(LayerNumber::to_string).collect();
    Err(Error::refused(
        "check/layer-empty",
        format!("{} has no shapes on layer {layer}", layout.path().display()),
        format!("name a layer that has shapes: {}", words.join(", ")),
    ))
}

/// Write the rules that a layout keeps.
fn write_rules(layout: &Layout, layer: Option<LayerNumber>, path: &Path, terminal: &Terminal) -> Result<Outcome> {
    if path.exists() {
        return Err(Error::refused(
            "new/exists",
            format!("{} exists", path.display()),
            "give another name, or move the file away: limits that a person changed are kept",
        ));
    }
    let rules = drc::new_rules(layout, layer, terminal)?;
    let text = FileKind::Rules.reference() + &rules.text;
    AtomicFile::write(path, text.as_bytes())?;
    FileKind::Rules.write_beside(path)?;
    terminal.clear();
    let left_out = match rules.left_out {
        0 => String::new(),
        n => format!(", {n} more as comments: the layout breaks them"),
    };
    print_line!("{}: {}{left_out}", path.display(), counted(rules.in_force, "rule"));
    Ok(Outcome::Fine)
}

fn json(report: &DrcReport) -> String {
    let value = serde_json::to_value(report).expect("a report is plain data");
    printable_json(&format!("{value:#}")).into_owned()
}
