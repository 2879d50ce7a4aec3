//! `metalith optimise`: the radial phase that all elements share.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::cell::cache_folder;
use metalith::file::InputFiles;
use metalith::layout::read_pillars;
use metalith::optimise::{
    Checkpoint, Deconvolution, OptimiseReport, OptimiseTask, Optimised, OverWavelength, StrehlSummary, TaskCells,
    lens_alone, mean_and_deviation, views, wavelengths, write_phase_table,
};
use metalith::report::{counted, sig};
use metalith::study::plan_starts;
use metalith::{AtomicFile, Design, Hierarchy, PillarArray, Result, write_pillars};

use super::optimise_camera::{self, CameraSearch};
use super::out_folder::OutFolder;
use super::paths::paths;
use super::{Outcome, Terminal, print_json, print_line, standard_input};

/// Find the best phase of every ring over the whole band, and report the gain.
#[derive(Args)]
#[command(
    after_help = "The section [optimise] of the design sets merit, time and simulation model.\n\
    Ctrl-C stores the best phase so far; the same command continues from there.\n\
    The table of the cell comes first and is stored when it is whole: two to four CPU minutes for a new cell.\n\n\
    Example:\n  metalith optimise designs/broadband_3x3.toml --out out/optimised"
)]
pub(crate) struct OptimiseArgs {
    /// The design file.
    design: PathBuf,

    /// Folder for `report.html`, `report.json` and the layout that is read back; `out/NAME/optimise` if left
    /// out.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// File for the phase; `phase.csv` in the folder if left out.
    #[arg(long, value_name = "FILE")]
    phase: Option<PathBuf>,

    /// Search a whole camera before the sensor and in the light of this camera file: the section [optimise.camera] of the design says
    /// which.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["phase", "fresh", "no_report", "plan"])]
    camera: Option<PathBuf>,

    /// Ignore the state of an interrupted run.
    #[arg(long)]
    fresh: bool,

    /// Stop when the phase is written, without a report.
    #[arg(long)]
    no_report: bool,

    /// Print `report.json` to standard output, without its first two fields, `report` and `metalith`.
    #[arg(long)]
    json: bool,

    /// Only plan this number of starts, each with its own seed, as shards that any number of machines can run. `metalith study
    /// run`, `submit`, `status` and `merge` work on the folder; `merge` writes the best phase.
    #[arg(long, value_name = "STARTS", value_parser = clap::value_parser!(u64).range(1..=1_000_000), conflicts_with_all = ["phase", "fresh", "no_report", "json"])]
    plan: Option<u64>,

    /// Starts in a shard.
    #[arg(long, value_name = "N", requires = "plan", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    starts_per_shard: u64,
}

/// Reason why a search of cameras names its design.
const OF_CAMERAS: [&str; 2] = [
    "a search of cameras",
    "its text is that of the designs that are found, but for the elements",
];

/// Files that speak of a phase, and their list.
const STALE: [&str; 4] = ["report.html", "report.json", "lens.gds", ".report.sha256"];

pub(crate) fn run(args: &OptimiseArgs, terminal: &Terminal) -> Result<Outcome> {
    if args.plan.is_some() {
        standard_input::named(standard_input::OF_PLANS, [args.design.as_path()])?;
    }
    if args.camera.is_some() {
        standard_input::named(OF_CAMERAS, [args.design.as_path()])?;
    }
    let design = standard_input::design(&args.design, terminal)?;
    terminal.stop_on_interrupt();
    let default = Path::new("out").join(&design.name);
    let out = OutFolder::of(args.out.as_deref(), default, &args.design)?;
    let folder = match &args.out {
        Some(out) => out.clone(),
        None => out.path.join("optimise"),
    };
    if let Some(camera) = &args.camera {
        let search = CameraSearch {
            design: &design,
            camera,
            folder: &folder,
            out: &out,
            command: format!(
                "{} --camera {} --out {}",
                command(args),
                camera.display(),
                folder.display()
            ),
            json: args.json,
        };
        return optimise_camera::run(&search, terminal);
    }
    if let Some(starts) = args.plan {
        let plan = plan_starts(&args.design, starts, args.starts_per_shard, &folder, terminal)?;
        out.note()?;
        terminal.clear();
        print_line!(
            "{} in {}: {}",
            counted(plan.starts as usize, "start"),
            counted(plan.cut().shards() as usize, "shard"),
            folder.display()
        );
        return Ok(Outcome::Fine);
    }
    let phase = args.phase.clone().unwrap_or_else(|| folder.join("phase.csv"));
    let kept = folder.join("checkpoint.bin");
    let inputs = design.inputs();
    InputFiles::of(paths(&inputs)).check_outputs(&[&phase, &kept])?;
    let task = OptimiseTask::of(&design)?;
    let cells = TaskCells::of(&design, !args.no_report, cache_folder().as_deref(), terminal)?;
    let turn = terminal.turn_at(&folder, paths(&inputs))?;
    out.note()?;
    let checkpoint = if args.fresh {
        Checkpoint::begin(&design)
    } else {
        Checkpoint::load(&kept, &design)?
    };
    if checkpoint.begun() {
        terminal.say(&format!("going on from {}", kept.display()));
    }
    let found = task.solve(&cells.all(), checkpoint, terminal)?;
    terminal.clear();
    // A report of an earlier phase must not stand beside this one.
    turn.replace("phase", &STALE, |folder| {
        let phase = args.phase.clone().unwrap_or_else(|| folder.join("phase.csv"));
        write_phase_table(&phase, &task.lens.rings, &found.waves, &remarks(args, &design))
    })?;
    if let Some(checkpoint) = &found.interrupted {
        checkpoint.save(&kept)?;
        terminal.say(&format!("interrupted; the best so far is in {}", phase.display()));
        terminal.say("the same command goes on from here");
        return Ok(Outcome::NotDone);
    }
    // Only of use to an interrupted run; there may be none.
    AtomicFile::clear(&kept);
    let _ = std::fs::remove_file(&kept);
    if !args.json {
        print_line!("phase: {}", phase.display());
    }
    if args.no_report {
        return Ok(Outcome::Fine);
    }
    let findings = turn.publish("report", &[], |folder| {
        let findings = findings(args, &design, &task, &cells, &found, &phase, folder, terminal)?;
        findings.write(folder)?;
        Ok(findings)
    })?;
    terminal.clear();
    if args.json {
        print_json(&findings);
    } else {
        summary(&findings);
        print_line!("report: {}", folder.join("report.html").display());
    }
    Ok(Outcome::of(findings.limit_kept()))
}

fn remarks(args: &OptimiseArgs, design: &Design) -> Vec<String> {
    vec![
        format!(
            "Phase of each ring of {}, in the middle of the ring; nearest row.",
            design.name
        ),
        format!("Made by: {}", command(args)),
    ]
}

fn command(args: &OptimiseArgs) -> String {
    let mut words = format!("metalith optimise {}", args.design.display());
    if let Some(phase) = &args.phase {
        words.push_str(&format!(" --phase {}", phase.display()));
    }
    words
}

#[allow(clippy::too_many_arguments)] // all that a report is about
fn findings(
    args: &OptimiseArgs,
    design: &Design,
    task: &OptimiseTask,
    cells: &TaskCells,
    found: &Optimised,
    phase: &Path,
    folder: &Path,
    terminal: &Terminal,
) -> Result<OptimiseReport> {
    let judge = |waves: &[f64]| -> Result<Vec<StrehlSummary>> {
        let mut judged = vec![task.judge_rings(waves, cells.own())?];
        if cells.own().fidelity() != cells.rigorous().fidelity() {
            judged.push(task.judge_rings(waves, cells.rigorous())?);
        }
        Ok(judged)
    };
    let (before, mut after) = (judge(&task.reference_waves)?, judge(&found.waves)?);
    let own = if task.own_waves == task.reference_waves {
        Vec::new()
    } else {
        judge(&task.own_waves)?
    };
    let alone = lens_alone(design, phase)?;
    let array = PillarArray::build(&alone, terminal)?;
    let layout = folder.join("lens.gds");
    write_pillars(&alone, &array, Hierarchy::Folded, &layout, terminal)?;
    let read = read_pillars(&alone, &layout, terminal)?;
    after.push(task.judge_layout(&read.elements[0].widths, cells.judge())?);
    let at_single_wavelengths = match cells.at_single_wavelengths() {
        Some(cell) => {
            let single = &design.verify.wavelengths_um;
            let strehl = task.lens.strehl_of_layout(&read.elements[0].widths, cell, single)?;
            single.iter().copied().zip(strehl.ratio).collect()
        }
        None => Vec::new(),
    };
    let limits = [0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5];
    let over_limit = task.merit_over_limit(&cells.all(), &found.waves, &limits, terminal)?;
    let reference_widths = task.widths_nm(&task.reference_waves);
    let spectrum = OverWavelength {
        lens: &task.lens,
        cell: cells.judge(),
        widths_nm: &[&reference_widths, &found.widths_nm],
    };
    let band_nm = (task.spec.band_um.0 * 1e3, task.spec.band_um.1 * 1e3);
    let spread = |count: f64| wavelengths(band_nm.0, band_nm.1, (band_nm.1 - band_nm.0) / count);
    let (fine, coarse) = (spread(120.0), spread(15.0));
    let radii = (0..80).map(|i| 0.5 * f64::from(i)).collect::<Vec<_>>();
    terminal_step(terminal, "pictures over wavelength");
    let psf = spectrum.psf(&radii, &fine)?;
    let mtf = spectrum.mtf(task.spec.views.pixel_um, &coarse)?;
    let with_errors = with_errors(task, cells, found, terminal)?;
    Ok(OptimiseReport {
        design: format!("{}: {}", design.name, design.title),
        command: command(args),
        start: found.start.into(),
        merit: found.merit,
        rotation_step_deg: design.cell.shape.rotated().map(metalith::RotatedRectangles::step_deg),
        step_limit_waves: task.limit().waves(),
        before,
        own,
        after,
        at_single_wavelengths,
        merit_over_limit: over_limit,
        expected_psnr_db: expected_images(task, cells, &reference_widths, &found.widths_nm, terminal)?,
        with_errors,
        history: found.history.clone(),
        rings: (0..task.lens.rings.len())
            .map(|k| {
                (
                    task.lens.rings.middle_um(k),
                    task.reference_waves[k],
                    found.waves[k],
                    found.widths_nm[k],
                )
            })
            .collect(),
        psf: (fine, 39.5, psf),
        mtf: (coarse, mtf),
    })
}

/// Figures of a robust design: what it begins from, what is best without errors in mind, and what was found, each with
/// the same drawn errors.
fn with_errors(
    task: &OptimiseTask,
    cells: &TaskCells,
    found: &Optimised,
    terminal: &Terminal,
) -> Result<Vec<(&'static str, Vec<f64>)>> {
    let Some(robust) = &task.spec.robust else {
        return Ok(Vec::new());
    };
    let plain = task
        .regardless_of_errors()
        .solve(&[cells.own()], Checkpoint::default(), terminal)?;
    [
        ("before", &task.reference_waves),
        ("plain optimum", &plain.waves),
        ("after", &found.waves),
    ]
    .into_iter()
    .map(|(name, waves)| Ok((name, task.judge_errors(waves, robust, &cells.all(), DRAWS)?)))
    .collect()
}

/// Errors of fabrication that a robust design is judged with.
const DRAWS: usize = 64;

fn terminal_step(terminal: &Terminal, what: &str) {
    use metalith::Progress;
    terminal.begin(what, 1);
}

/// Expected PSNR at wavelengths half a step off those optimised on, for designs that ask for it.
fn expected_images(
    task: &OptimiseTask,
    cells: &TaskCells,
    before: &[u16],
    after: &[u16],
    terminal: &Terminal,
) -> Result<Vec<(f64, f64, f64)>> {
    if task.spec.merit.deconvolution == 0.0 {
        return Ok(Vec::new());
    }
    let between = views(&task.spec, &task.spec.views, 0.5);
    let memory = task.spec.memory_mb << 20;
    let images = Deconvolution::new(&task.lens, between, cells.own(), task.mapping.clone(), memory, terminal)?;
    let of = |widths: &[u16]| {
        images
            .expected_psnr(&widths.iter().map(|&w| f64::from(w)).collect::<Vec<_>>())
            .1
    };
    let angles = task.spec.views.angles_deg.iter().copied();
    Ok(angles
        .zip(of(before))
        .zip(of(after))
        .map(|((a, b), c)| (a, b, c))
        .collect())
}

fn summary(findings: &OptimiseReport) {
    for (name, list) in findings.phases() {
        for judged in list {
            print_line!(
                "{name}, {} with the {} cell: Strehl {} (geometric mean), {} smallest, step {:.3} waves",
                judged.source,
                judged.fidelity,
                sig(judged.geometric_mean, 3),
                sig(judged.smallest, 3),
                judged.largest_step_waves,
            );
        }
    }
    for (um, strehl) in &findings.at_single_wavelengths {
        print_line!(
            "after, layout at {} nm, solved as for `run`: Strehl {}",
            sig(um * 1e3, 5),
            sig(*strehl, 3)
        );
    }
    for (angle, before, after) in &findings.expected_psnr_db {
        print_line!("expected PSNR at {angle} degrees: {before:.2} dB before, {after:.2} dB after");
    }
    for (name, values) in &findings.with_errors {
        let (mean, deviation) = mean_and_deviation(values);
        print_line!(
            "{name}, with errors of fabrication: Strehl {} +- {}",
            sig(mean, 4),
            sig(deviation, 2)
        );
    }
    print_line!("{}", findings.neighbours());
    if let Some(words) = findings.limit_costs() {
        print_line!("{words}");
    }
}
