//! `metalith handoff`: everything that a cleanroom needs, in one folder and one archive.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use clap::Args;
use metalith::compensate::compensated_name;
use metalith::file::InputFiles;
use metalith::gds::LayerNumber;
use metalith::handoff::{
    DesignSource, Handoff, HandoffOptions, HandoffSource, HandoffVerification, LayoutSource, handoff, handoff_name,
    verify_handoff,
};
use metalith::report::{Verdict, counted};
use metalith::{Design, Error, Result};

use super::accuracy_args::AccuracyArgs;
use super::compensated::judged_as_made;
use super::layout::FormatArg;
use super::out_folder::OutFolder;
use super::psf::layer;
use super::reading::FileArgs;
use super::standard_input::InputFile;
use super::verify::FidelityArg;
use super::{Outcome, Terminal, print_json, print_line};

/// Make the folder and the archive for the cleanroom, from a design or from a layout of any program, or check that a received
/// folder is complete.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  metalith handoff designs/mini_3x3.toml --process processes/jbx6300_zep520a.toml\n  \
                  metalith handoff lens.gds --process processes/jbx6300_tio2.toml --layer 10/0\n  \
                  metalith handoff --verify out/mini_3x3_handoff\n\n\
                  Exit codes: 0 fine; 1 a check failed, or the folder was altered; 2 bad input; \
                  3 a check could not run."
)]
pub(crate) struct HandoffArgs {
    /// The design file; or a layout in GDSII or OASIS, which is handed over as it is, `-` for standard input.
    #[arg(
        required_unless_present = "verify",
        conflicts_with = "verify",
        value_name = "DESIGN|LAYOUT"
    )]
    source: Option<PathBuf>,

    /// Process file: writer, resist, doses, currents, overheads. If left out, a shipped one is used and stored in `inputs/`; a
    /// layout needs one.
    #[arg(long, value_name = "FILE")]
    process: Option<PathBuf>,

    /// Folder to make; `out/NAME_handoff` if left out. The archive has the same name.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    #[command(flatten)]
    reading: FileArgs,

    /// Of a layout: layer and datatype of the pillars. If left out, 1/0; if that has no shapes, the only layer with shapes or with
    /// pillars on a lattice.
    #[arg(long, value_parser = layer)]
    layer: Option<LayerNumber>,

    /// Of a layout: a further layer of the first step, such as marks; may be given several times.
    #[arg(long, value_name = "LAYER", value_parser = layer)]
    expose: Vec<LayerNumber>,

    /// Only check that this received folder is complete and unaltered.
    #[arg(long, value_name = "FOLDER")]
    verify: Option<PathBuf>,

    /// Hand over the layout that is compensated by this `model.toml` of `metalith calibrate`. It is simulated as
    /// fabricated, so `--fidelity` cannot be given with it.
    #[arg(long, value_name = "MODEL")]
    compensate: Option<PathBuf>,

    /// Also write dose classes that undo the biases of this `model.toml` of a set of widths: a layout with a dose factor for each
    /// class, for a writer that corrects by dose. The pillar layout stays as intended.
    #[arg(long, value_name = "MODEL", conflicts_with = "compensate")]
    dose_classes: Option<PathBuf>,

    /// Format of the layouts that are made; GDSII if left out. A layout that is handed over stays as it is.
    #[arg(long, value_enum)]
    format: Option<FormatArg>,

    #[command(flatten)]
    accuracy: AccuracyArgs,

    /// Simulation model of the pillars; `fidelity` in [verify] of the design if left out.
    #[arg(long, value_enum)]
    fidelity: Option<FidelityArg>,

    /// File with violations of the design rules that have been accepted.
    #[arg(long, value_name = "FILE")]
    waivers: Option<PathBuf>,

    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &HandoffArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    match (&args.verify, &args.source) {
        (Some(folder), _) => look(folder, args.json, terminal),
        (None, Some(path)) => {
            let file = InputFile::of(path)?;
            if is_layout(&file)? {
                make_of_layout(path, &file, args, terminal)
            } else {
                make_of_design(path, args, terminal)
            }
        }
        (None, None) => unreachable!("one of both is required"),
    }
}

/// Endings of the names of layouts.
const LAYOUT_ENDINGS: [&str; 7] = ["gds", "gds2", "gdsii", "oas", "oasis", "gz", "dxf"];

/// True if a file is a layout by its name or its first bytes: a design is text.
fn is_layout(path: &Path) -> Result<bool> {
    let ending = path.extension().unwrap_or_default();
    if LAYOUT_ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known)) {
        return Ok(true);
    }
    if !path.is_file() {
        return Ok(false);
    }
    let mut head = Vec::new();
    let file = File::open(path).map_err(Error::io("read", path))?;
    file.take(64).read_to_end(&mut head).map_err(Error::io("read", path))?;
    Ok(head.contains(&0) || head.starts_with(b"%SEMI-OASIS") || head.starts_with(&[0x1f, 0x8b]))
}

fn make_of_design(design: &Path, args: &HandoffArgs, terminal: &Terminal) -> Result<Outcome> {
    args.reading.apply(terminal);
    let of_a_layout = [
        ("--top", args.reading.top.is_some()),
        ("--layer", args.layer.is_some()),
        ("--expose", !args.expose.is_empty()),
    ];
    only("a layout", "a design names its cell and layers", &of_a_layout)?;
    judged_as_made("--compensate", args.compensate.as_deref(), args.fidelity)?;
    let default = match (&args.out, &args.compensate) {
        (Some(out), _) => out.clone(),
        (None, Some(_)) => handoff_of(&compensated_name(&Design::read_with(design, terminal)?.name)),
        (None, None) => handoff_of(&Design::read_with(design, terminal)?.name),
    };
    let source = HandoffSource::Design(DesignSource {
        path: design.to_owned(),
        compensate: args.compensate.clone(),
        dose_classes: args.dose_classes.clone(),
        fidelity: args.fidelity.map(Into::into),
        accuracy: args.accuracy.accuracy(),
    });
    make(
        source,
        OutFolder::of(args.out.as_deref(), default, design)?,
        args,
        terminal,
    )
}

fn make_of_layout(path: &Path, file: &Path, args: &HandoffArgs, terminal: &Terminal) -> Result<Outcome> {
    args.reading.apply(terminal);
    let of_a_design = [
        ("--compensate", args.compensate.is_some()),
        ("--dose-classes", args.dose_classes.is_some()),
        ("--fidelity", args.fidelity.is_some()),
        ("--fast", args.accuracy.fast),
    ];
    only(
        "a design",
        "a layout is not simulated and has no elements of a design",
        &of_a_design,
    )?;
    let default = handoff_of(&handoff_name(file));
    let source = HandoffSource::Layout(LayoutSource {
        path: file.to_owned(),
        top: args.reading.top.clone(),
        layer: args.layer,
        exposed: args.expose.clone(),
    });
    make(
        source,
        OutFolder::of(args.out.as_deref(), default, path)?,
        args,
        terminal,
    )
}

/// Refuse options, given or not, that are for another source.
fn only(source: &str, why: &str, options: &[(&str, bool)]) -> Result<()> {
    match options.iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((option, _)) => Err(Error::refused(
            "option/of-another-source",
            format!("{option} is for the hand-off of {source}: {why}"),
            format!("leave {option} out"),
        )),
    }
}

fn make(source: HandoffSource, out: OutFolder, args: &HandoffArgs, terminal: &Terminal) -> Result<Outcome> {
    // The folder is replaced as a whole.
    let inputs = [
        &args.source,
        &args.process,
        &args.compensate,
        &args.dose_classes,
        &args.waivers,
    ];
    let inputs: Vec<&Path> = inputs.into_iter().flatten().map(PathBuf::as_path).collect();
    InputFiles::of(inputs).check_outside(&out.path)?;
    let options = HandoffOptions {
        source,
        process: args.process.clone(),
        out: out.path.clone(),
        command: std::iter::once("metalith".to_owned())
            .chain(std::env::args().skip(1))
            .collect::<Vec<_>>()
            .join(" "),
        waivers: args.waivers.clone(),
        format: args.format.map_or_else(Default::default, Into::into),
    };
    let made = handoff(&options, terminal)?;
    out.note()?;
    terminal.clear();
    if args.json {
        print_json(&serde_json::json!({
            "folder": made.folder,
            "archive": made.archive,
            "checks": made.checks,
            "manifest": made.manifest,
        }));
    } else {
        tell(&made);
    }
    Ok(outcome(&made))
}

/// Default folder of the hand-off of a design.
fn handoff_of(name: &str) -> PathBuf {
    PathBuf::from("out").join(format!("{name}_handoff"))
}

fn outcome(made: &Handoff) -> Outcome {
    let any = |verdict| made.checks.iter().any(|c| c.verdict == verdict);
    if any(Verdict::Fail) {
        Outcome::OutsideLimits
    } else if any(Verdict::NotRun) {
        Outcome::NotDone
    } else {
        Outcome::Fine
    }
}

/// Rules that are not held and whose limits no lab has confirmed.
fn exceeded(made: &Handoff) -> usize {
    let broken = made.checks.iter().flat_map(|check| &check.broken);
    broken.filter(|rule| rule.assumed).count()
}

/// The verdict, with what fails and what did not run.
fn verdict(made: &Handoff) -> String {
    let named = |verdict| {
        let checks = made.checks.iter().filter(|c| c.verdict == verdict);
        checks.map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    match (named(Verdict::Fail), named(Verdict::NotRun)) {
        (fail, _) if !fail.is_empty() => format!("FAIL: {fail}"),
        (_, not_run) if !not_run.is_empty() => format!("NOT ALL CHECKED: {not_run}"),
        _ => {
            let checks = counted(made.checks.len(), "check");
            match exceeded(made) {
                0 => format!("PASS: {checks}"),
                rules => format!(
                    "PASS: {checks}, but {} whose limits are assumed: ask the cleanroom before you send it",
                    counted(rules, "broken rule")
                ),
            }
        }
    }
}

fn tell(made: &Handoff) {
    print_line!("{}", verdict(made));
    print_line!("{}  start with index.html", made.folder.display());
    print_line!("{}  the same, packed", made.archive.display());
    for check in &made.checks {
        print_line!("{}: {}: {}", check.verdict.word(), check.name, check.words);
        for broken in &check.broken {
            let limit = if broken.assumed { "assumed: " } else { "" };
            print_line!("  {limit}{}: {}: {}", broken.rule, broken.requirement, broken.cure);
        }
    }
    let files = counted(made.manifest.files.len(), "file");
    print_line!("{files}, seal {}", made.manifest.seal);
}

fn look(folder: &Path, json: bool, terminal: &Terminal) -> Result<Outcome> {
    let found = verify_handoff(folder, terminal)?;
    terminal.clear();
    if json {
        let mut value = serde_json::to_value(&found).expect("plain data serialises");
        value["whole_and_unaltered"] = found.holds().into();
        print_json(&value);
    } else {
        describe(&found);
    }
    Ok(Outcome::of(found.holds()))
}

fn describe(found: &HandoffVerification) {
    let m = &found.manifest;
    print_line!(
        "hand-off of {}, process {}, made by metalith {}",
        m.design,
        m.process,
        m.metalith
    );
    print_line!("seal {}", m.seal);
    for (what, names) in [
        ("missing", &found.missing),
        ("altered", &found.altered),
        ("not in the manifest", &found.unknown),
    ] {
        for name in names {
            print_line!("{what}: {name}");
        }
    }
    if !found.seal_holds {
        print_line!("altered: the manifest itself, its seal does not match");
    }
    if found.holds() {
        print_line!(
            "whole and unaltered: {} files. Compare the seal with the sender's.",
            m.files.len()
        );
    } else {
        print_line!("not as it was sent: ask the sender for it again");
    }
}
