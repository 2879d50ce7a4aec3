//! The optimised phase: kernels against the propagators, going on after an interruption, and the way from
//! the command to a layout that keeps the limit.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use metalith_cell::{CellModel, PublishedCell};
use metalith_core::{FaultKind, Progress, Silent};
use metalith_design::Design;
use metalith_optimise::{Checkpoint, Lens, OptimiseTask, RingField, Rings, Start, largest_step};
use metalith_pillars::Lattice;
use metalith_testing::optimised as design;
use metalith_wave::{Accuracy, Direct, FoldedPropagator, Pillars, PlaneWave, Propagator, Scratch, Window};
use num_complex::Complex64;

/// The kernel at full size, on the axis: a broadband phase, every ring of the 1 mm lens.
#[test]
fn the_kernel_agrees_with_direct_sum_and_fold() {
    /// Tolerance as a share of the matched peak. Apertures hold transmissions in single precision.
    const DIRECT: f64 = 1e-6;
    /// Tolerance of the accurate mode.
    const FOLD: f64 = 1e-5;
    let lattice = Lattice::covering(1_000_000, 350).unwrap();
    let rings = Rings::new(lattice, 1_000_000).unwrap();
    let lens = Lens {
        rings,
        distance_um: 2400.0,
    };
    let waves = Start::LogAsphere { band_um: (0.4, 0.7) }.waves(&lens, 0);
    let widths = waves
        .iter()
        .map(|t| 2 * (51.0 + 93.0 * t.rem_euclid(1.0)) as u16)
        .collect::<Vec<_>>();
    let map = lens.rings.width_map(&widths);
    let wavelength = 0.52;
    let t = PublishedCell::new(350).transmissions(wavelength, 300).unwrap();
    let field = RingField::new(&lens.rings, wavelength, lens.distance_um);
    let quick = (0..lens.rings.len())
        .map(|k| field.on_axis(k) * t[usize::from(widths[k])])
        .sum::<Complex64>();
    let pillars = Pillars::new(&map, &t).unwrap();
    let wave = PlaneWave::normal(wavelength);
    // The kernel leaves out the phase common to all.
    let common = Complex64::cis(std::f64::consts::TAU * (lens.distance_um / wavelength).fract());
    let direct = Direct::at(&pillars, &wave, &[[0.0, 0.0, lens.distance_um]])[0];
    let error = (quick * common - direct).norm() / field.matched();
    assert!(error < DIRECT, "{error:e}");
    let window = Window::about([0.0, 0.0], 0.35, 16, lens.distance_um);
    let fold = FoldedPropagator::plan(lattice, 500.0, wavelength, window, Accuracy::Accurate).unwrap();
    let found = fold.field(&pillars, &wave, &mut Scratch::default()).unwrap().values[[8, 8]];
    let found = Complex64::new(found.re.into(), found.im.into());
    let error = (found.norm() - direct.norm()).abs() / field.matched();
    assert!(error < FOLD, "{error:e}");
}

/// Says stop once a solver has asked so often.
struct StopAfter {
    asked: AtomicU64,
    often: u64,
    solving: AtomicBool,
}

impl StopAfter {
    fn new(often: u64) -> Self {
        Self {
            asked: AtomicU64::new(0),
            often,
            solving: AtomicBool::new(false),
        }
    }
}

impl Progress for StopAfter {
    fn begin(&self, what: &str, _steps: u64) {
        let solving = ["exchange", "exchange of blocks", "Adam"].contains(&what);
        self.solving.store(solving, Ordering::SeqCst);
    }

    fn advance(&self, _steps: u64) {}

    fn stopped(&self) -> bool {
        self.solving.load(Ordering::SeqCst) && self.asked.fetch_add(1, Ordering::SeqCst) >= self.often
    }
}

const EXCHANGE: &str = "[optimise]\ncell = \"published\"\nstep_nm = 5\nchains = 3\nhot_sweeps = 12\nseed = 4\n";
const ADAM: &str =
    "[optimise]\ncell = \"published\"\nstep_nm = 5\nsolver = \"adam\"\nstart = \"hyperbolic\"\nsteps = 40\n";
/// Settings of few views of a small window; two merits in one sum.
const IMAGES: &str = "[optimise]\ncell = \"published\"\nstep_nm = 5\nstart = \"hyperbolic\"\nblocks = 24\n\
    [optimise.merit]\ndeconvolution = 1\nlog = 0.01\n\
    [optimise.views]\nangles_deg = [0, 15]\nstep_nm = 30\npixels = 16\n";

/// Limit on the step of phase in the designs of this file (waves), and the rounding of a difference of phases.
const STEP_TURNS: f64 = 0.2 + 1e-9;

#[test]
fn an_interrupted_run_goes_on_to_the_same_end() {
    for section in [EXCHANGE, ADAM, IMAGES] {
        let folder = tempfile::tempdir().unwrap();
        let design = Design::read(&design(folder.path(), section)).unwrap();
        let (task, cell) = (OptimiseTask::of(&design).unwrap(), PublishedCell::new(350));
        let cells: [&dyn CellModel; 1] = [&cell];
        let begin = || Checkpoint::begin(&design);
        let whole = task.solve(&cells, begin(), &Silent).unwrap();
        assert!(whole.interrupted.is_none());
        assert!(largest_step(&whole.waves) <= STEP_TURNS);

        // Over and over, in every stage.
        let kept = folder.path().join("checkpoint.bin");
        let (mut checkpoint, mut interruptions) = (begin(), 0);
        let rest = loop {
            let part = task.solve(&cells, checkpoint, &StopAfter::new(14)).unwrap();
            assert!(largest_step(&part.waves) <= STEP_TURNS);
            let Some(interrupted) = part.interrupted else {
                break part;
            };
            interruptions += 1;
            assert!(interruptions < 100);
            interrupted.save(&kept).unwrap();
            checkpoint = Checkpoint::load(&kept, &design).unwrap();
            assert!(checkpoint.begun());
        };
        assert!(interruptions > 0);
        assert_eq!(rest.widths_nm, whole.widths_nm);
        assert_eq!(rest.merit, whole.merit);

        // A damaged one is of no use.
        let whole = std::fs::read(&kept).unwrap();
        for at in (0..whole.len()).step_by(whole.len() / 50 + 1) {
            let mut damaged = whole.clone();
            damaged[at] ^= 1;
            std::fs::write(&kept, damaged).unwrap();
            assert!(!Checkpoint::load(&kept, &design).unwrap().begun());
        }
        std::fs::write(&kept, whole).unwrap();

        // A checkpoint of another design is of no use.
        let other = Design::read(&metalith_testing::design("mini_3x3")).unwrap();
        assert!(!Checkpoint::load(&kept, &other).unwrap().begun());
    }
}

#[test]
fn both_solvers_beat_what_they_begin_from_and_exchange_beats_adam() {
    /// Least gain of broadband phases over a hyperbolic one; the paper's gain is several times.
    const GAIN: f64 = 1.5;
    let folder = tempfile::tempdir().unwrap();
    let cell = PublishedCell::new(350);
    let reached = [ADAM, EXCHANGE].map(|section| {
        let design = Design::read(&design(folder.path(), section)).unwrap();
        let task = OptimiseTask::of(&design).unwrap();
        let found = task.solve(&[&cell], Checkpoint::begin(&design), &Silent).unwrap();
        let before = task.judge_rings(&task.own_waves, &cell).unwrap();
        let after = task.judge_rings(&found.waves, &cell).unwrap();
        assert!(after.geometric_mean > GAIN * before.geometric_mean);
        after.geometric_mean
    });
    assert!(reached[1] > reached[0], "{reached:?}");
}

/// Rings have one phase each: a phase over the plane would be left out.
#[test]
fn phases_over_the_plane_are_refused() {
    let hologram = Design::read(&metalith_testing::design("hologram")).unwrap();
    assert_eq!(OptimiseTask::of(&hologram).unwrap_err().id(), "design/phase-not-radial");
}

#[test]
fn mistakes_of_the_section_are_found_together() {
    let folder = tempfile::tempdir().unwrap();
    let section = "[optimise]\nsolver = \"exchange\"\nstep_limit_waves = 0.7\nseeed = 1\nblocks = -1\n[optimise.merit]\nlog = 0\n";
    let error = Design::read(&design(folder.path(), section)).unwrap_err();
    for (kind, key) in [
        (FaultKind::OutOfRange, "optimise.step_limit_waves"),
        (FaultKind::Unknown, "optimise.seeed"),
        (FaultKind::OutOfRange, "optimise.blocks"),
        (FaultKind::Inconsistent, "optimise.merit.log"),
    ] {
        assert!(error.has_fault(kind, key), "{kind:?} {key}: {error}");
    }
}
