//! `metalith verify`: a layout is read back and held to its design.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::cell::{cache_folder, oblique_refused};
use metalith::design::CellIncidence;
use metalith::imaging::thumbnail;
use metalith::report::{Figure, count, counted, exact, sig};
use metalith::sensor::Camera;
use metalith::{
    AsBuiltChip, CalibratedModel, Design, Error, Fidelity, FolderLock, PillarArray, PillarRows, Result,
    SimulationCases, Verification, cell_models, verify,
    verify::{Simulation, lens_figures, verdict_words, verify_in_parts, verify_sampled},
    write_report,
};

use super::accuracy_args::AccuracyArgs;
use super::compensated::{CompensatedFor, judged_as_made};
use super::course::Course;
use super::paths::{inputs_of, paths};
use super::reading::ReadingArgs;
use super::standard_input::InputFile;
use super::{Outcome, Terminal, print_json, print_line, standard_input};

/// Memory that may be asked for at least (MB): below it, all that is larger is sampled.
const LEAST_MEMORY_MB: f64 = 1.0;

/// Name of the set of the files of the report.
const REPORT: &str = "report";

/// Names of its files, and of their list.
pub(crate) const REPORT_FILES: [&str; 3] = ["report.html", "report.json", ".report.sha256"];

/// Read a layout back, compare every pillar with its design, simulate it, and write the report.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith verify designs/mini_3x3.toml out/mini_3x3/mini_3x3_pillars.gds --fast\n\n\
    A compensated layout (--compensated MODEL) is simulated as fabricated by that model, unless --model names another one."
)]
pub(crate) struct VerifyArgs {
    /// The design file.
    design: PathBuf,

    /// The pillar layout, of any program; `-` for standard input.
    layout: PathBuf,

    /// Folder for `report.html` and `report.json`; the folder of the layout if left out.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    #[command(flatten)]
    reading: ReadingArgs,

    #[command(flatten)]
    compensated: CompensatedFor,

    #[command(flatten)]
    judging: Judging,
}

/// Settings of the simulation of a layout.
#[derive(Args, Clone)]
pub(crate) struct Judging {
    #[command(flatten)]
    accuracy: AccuracyArgs,

    /// Simulation model of the pillars; `fidelity` in [verify] of the design if left out. If the design names none:
    /// `neighbours` for the published cell, else `rigorous`.
    #[arg(long, value_enum)]
    fidelity: Option<FidelityArg>,

    /// Simulate the chip as fabricated, by the `model.toml` of `metalith calibrate`. Effects of lamps do not apply to
    /// PSFs of one wavelength and point; they are listed.
    #[arg(long, value_name = "MODEL", conflicts_with = "fidelity")]
    model: Option<PathBuf>,

    /// Solve the unit cells for the angles at which light arrives (oblique incidence) and for both polarisations. Same as
    /// `incidence = "oblique"` in [verify] of the design. If left out, the cells are solved for normal incidence.
    #[arg(long)]
    oblique: bool,

    /// Memory for reading back and simulating (MB). Larger layouts are simulated in parts, which takes more time, and without
    /// other models for comparison. If a part is still too large, all pillars are compared with the design, and a sample of zones
    /// is simulated.
    #[arg(long, value_name = "MB", default_value_t = 8000.0)]
    memory_mb: f64,

    /// Add to the page the picture of a test chart that the camera of this file takes. Its kernels take minutes of CPU time
    /// once; then they are cached.
    #[arg(long, value_name = "CAMERA")]
    picture: Option<PathBuf>,

    /// Print `report.json` to standard output, without its first two fields, `report` and `metalith`.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
pub enum FidelityArg {
    /// Phase by the published polynomials, no loss.
    Published,
    /// Phase by polynomials fitted to `rigorous`, no loss.
    Fitted,
    /// Local periodic approximation (LPA): complex transmission by RCWA in a lattice of equal pillars.
    Rigorous,
    /// Coupled model: each pillar with its neighbours, by pair sums fitted to RCWA of supercells. Solved once for a
    /// design in some minutes, then cached.
    #[value(alias = "grating")]
    Neighbours,
}

impl From<FidelityArg> for Fidelity {
    fn from(arg: FidelityArg) -> Self {
        match arg {
            FidelityArg::Published => Self::Published,
            FidelityArg::Fitted => Self::Fitted,
            FidelityArg::Rigorous => Self::Rigorous,
            FidelityArg::Neighbours => Self::Neighbours,
        }
    }
}

impl Judging {
    /// Simulation of a layout of this design, at `path`, decided before work is spent.
    ///
    /// # Errors
    /// If it could be neither simulated nor compared with its design, or its pillars cannot be judged by the cell.
    pub(crate) fn simulation(&self, design: &Design, path: &Path) -> Result<Simulation> {
        if self.memory_mb.is_nan() || self.memory_mb < LEAST_MEMORY_MB {
            return Err(Error::refused(
                "option/memory-out-of-range",
                format!("--memory-mb {}", self.memory_mb),
                format!("give {LEAST_MEMORY_MB} MB or more"),
            ));
        }
        let fidelity = self.fidelity(design);
        design.check_fidelity(fidelity)?;
        if self.oblique && design.cell.shape.basis().is_some() {
            return Err(oblique_refused());
        }
        if let Some(model) = self.model()? {
            model.check_shape(design.cell.shape)?;
        }
        let by_site = self.model.is_some() || fidelity == Fidelity::Neighbours;
        Simulation::choose(design, path, self.accuracy.accuracy(), by_site, self.memory_mb)
    }

    /// Succeeds if the pillars of an array can be as the model says; called before anything is written.
    ///
    /// # Errors
    /// If they cannot.
    pub(crate) fn check_drawn(&self, design: &Design, array: &PillarArray) -> Result<()> {
        match self.model()? {
            Some(model) => {
                let counts = array.classes.iter().map(|class| class.widths.histogram());
                model.check_drawn(&design.cell_stack()?, counts)
            }
            None => Ok(()),
        }
    }

    fn model(&self) -> Result<Option<CalibratedModel>> {
        self.model.as_deref().map(CalibratedModel::read).transpose()
    }

    /// Say how a layout will be simulated, if not as usual.
    pub(crate) fn announce(simulation: &Simulation, terminal: &Terminal) {
        match simulation {
            Simulation::Whole => {}
            Simulation::InParts { parts, needed_mb, .. } => terminal.say(&format!(
                "note: large elements take about {needed_mb:.0} MB of memory{}; other cell models are not compared with the one \
                 that judges",
                match *parts {
                    1 => String::new(),
                    parts => format!(", each field simulated in up to {parts} parts"),
                }
            )),
            Simulation::Not(why) => {
                terminal.say(&format!(
                    "note: every pillar is compared, but no more than a sample of zones is simulated: {why}"
                ));
            }
        }
    }

    /// Read back, simulate, write the report into the folder of a turn, and say what came out.
    pub(crate) fn judge(
        &self,
        design: &Design,
        array: &PillarArray,
        layout: &Path,
        turn: &FolderLock,
        terminal: &Terminal,
    ) -> Result<Outcome> {
        let mut design = design.clone();
        if self.oblique {
            design.verify.incidence = CellIncidence::Oblique;
        }
        // One cell judges, in the picture too.
        design.verify.fidelity = self.fidelity(&design);
        let design = &design;
        let judge = design.verify.fidelity;
        let camera = self.picture.as_deref().map(Camera::read).transpose()?;
        match self.simulation(design, layout)? {
            Simulation::Whole => {}
            _ if camera.is_some() => {
                return Err(Error::refused(
                    "verify/picture-too-large",
                    "the elements are too large for a picture: they do not fit into memory",
                    "leave out --picture, or allow more memory with --memory-mb",
                ));
            }
            Simulation::InParts { part_bytes, .. } => {
                let models = cell_models(design, &[judge])?;
                let cases = SimulationCases::of_cells(&models)?;
                let accuracy = self.accuracy.accuracy();
                let found = verify_in_parts(design, array, layout, &cases, accuracy, part_bytes, terminal)?;
                return self.report(design, array, &found, None, turn, terminal);
            }
            Simulation::Not(why) => {
                let drawn: &[Fidelity] = if self.model.is_none() { &[judge] } else { &[] };
                let models = cell_models(design, drawn)?;
                let cases = models.first().map(|cell| SimulationCases::judged_by(cell.as_ref()));
                let found = verify_sampled(design, array, layout, (judge, cases.as_ref()), why, terminal)?;
                return self.report(design, array, &found, None, turn, terminal);
            }
        }
        let model = self.model()?;
        let chip = |model| -> Result<AsBuiltChip> {
            Ok(AsBuiltChip::in_light(&design.lit_stack()?, model)?.cached_in(cache_folder().as_deref()))
        };
        let made = model.as_ref().map(chip).transpose()?;
        // A made chip judges, and cells of the pillars as drawn stand beside it.
        let judge = if made.is_some() { Fidelity::Rigorous } else { judge };
        // Polynomials in width and wavelength are of the paper's cell: of another they would only confuse.
        let beside: &[Fidelity] = if design.cell.is_of_the_paper() {
            &[Fidelity::Rigorous, Fidelity::Fitted, Fidelity::Published]
        } else {
            &[Fidelity::Rigorous]
        };
        let beside = beside.iter().copied().filter(|f| *f != judge);
        let wanted = std::iter::once(judge).chain(beside).collect::<Vec<_>>();
        let models = cell_models(design, &wanted)?;
        let cases = match &made {
            Some(chip) => SimulationCases::judged_by(chip).with_cells(&models),
            None => SimulationCases::of_cells(&models)?,
        }
        .with_through_focus();
        let found = verify(design, array, layout, &cases, self.accuracy.accuracy(), terminal)?;
        let picture = match camera {
            Some(camera) => match thumbnail(design, layout, &camera, model.as_ref(), terminal) {
                Ok(figure) => Some(figure),
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                // The report is worth more than its picture.
                Err(why) => {
                    terminal.say(&format!("note: there is no picture on the page: {why}"));
                    None
                }
            },
            None => None,
        };
        self.report(design, array, &found, picture, turn, terminal)
    }

    /// Files that the judgement of a layout of this design reads, besides the layout.
    pub(crate) fn inputs(&self, design: &Design) -> Vec<PathBuf> {
        inputs_of(design, self.model.as_deref().into_iter().chain(self.picture.as_deref()))
    }

    /// The cell of the pillars as drawn that judges a layout of this design.
    fn fidelity(&self, design: &Design) -> Fidelity {
        self.fidelity.map_or(design.verify.fidelity, Fidelity::from)
    }

    fn report(
        &self,
        design: &Design,
        array: &PillarArray,
        found: &Verification,
        picture: Option<Figure>,
        turn: &FolderLock,
        terminal: &Terminal,
    ) -> Result<Outcome> {
        turn.publish(REPORT, &[], |folder| {
            write_report(design, array, found, picture, folder)
        })?;
        terminal.clear();
        if self.json {
            print_json(found);
        } else if terminal.is_quiet() {
            print_failed(found);
        } else {
            summary(design, array, found, turn.folder());
        }
        Ok(Outcome::of(found.passed()))
    }
}

/// What was made and where, the verdict on the file, what the lens does, and the page.
fn summary(design: &Design, array: &PillarArray, found: &Verification, folder: &Path) {
    print_line!(
        "layout: {} pillars in {}, {} of them distinct; {}, {} MB",
        count(found.layout.pillars),
        counted(array.placed.len(), "element"),
        array.classes.len(),
        found.layout.file,
        sig(found.layout.bytes as f64 * 1e-6, 3)
    );
    if found.foreign.total() > 0 {
        print_line!(
            "shapes that are no pillars of the design: {}",
            found.foreign.by_why.words()
        );
    }
    for quantity in found.model.iter().flat_map(|m| &m.not_applied) {
        print_line!("{quantity}");
    }
    print_line!("{}", verdict_words(found));
    print_failed(found);
    for line in lens_figures(design, found) {
        print_line!("lens ({}): {line}", found.fidelity);
    }
    print_line!("report: {}", folder.join("report.html").display());
}

/// Limits that do not hold and are printed one by one.
const MOST_FAILED: usize = 3;

/// The limits that do not hold.
fn print_failed(found: &Verification) {
    let failed: Vec<_> = found.checks.iter().filter(|check| !check.passed()).collect();
    let shown = match failed.len() {
        0..=MOST_FAILED => failed.len(),
        _ => MOST_FAILED - 1,
    };
    let (shown, others) = failed.split_at(shown);
    for check in shown {
        print_line!(
            "FAILS: {}: {} (limit {}, `{}`)",
            check.what,
            check.reached_words(),
            exact(check.limit),
            check.key
        );
    }
    if !others.is_empty() {
        let keys: Vec<_> = others.iter().map(|check| format!("`{}`", check.key)).collect();
        print_line!("FAILS too: {}", keys.join(", "));
    }
}

pub(crate) fn run(args: &VerifyArgs, terminal: &Terminal) -> Result<Outcome> {
    let mut design = standard_input::design(&args.design, terminal)?;
    args.reading.aim(&mut design);
    terminal.warnings(&design.warnings()?);
    let layout = InputFile::of(&args.layout)?.below(&args.reading.file, terminal)?;
    judged_as_made(
        "--compensated",
        args.compensated.model.as_deref(),
        args.judging.fidelity,
    )?;
    Judging::announce(&args.judging.simulation(&design, &layout)?, terminal);
    terminal.follow(Course::of_verification(&design, false));
    terminal.stop_on_interrupt();
    let array = args.compensated.array(&mut design, terminal)?;
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| args.layout.parent().map_or_else(PathBuf::new, Path::to_owned));
    // A compensated layout is right when it is made, not as it is drawn.
    let judging = Judging {
        model: args.judging.model.clone().or_else(|| args.compensated.model.clone()),
        ..args.judging.clone()
    };
    judging.check_drawn(&design, &array)?;
    let inputs = judging.inputs(&design).into_iter().chain([args.layout.clone()]);
    let turn = terminal.turn_at(&folder, paths(&inputs.collect::<Vec<_>>()))?;
    judging.judge(&design, &array, &layout, &turn, terminal)
}
