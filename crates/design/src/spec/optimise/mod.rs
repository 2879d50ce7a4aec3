//! `[optimise]`: how `metalith optimise` finds the radial phase.

mod camera;
mod refusals;

pub use camera::{CameraSearchSpec, CameraSizes};

use serde::Serialize;

use super::cell::CellSpec;
use super::lens::WAVELENGTH;
use super::verify::USUAL_PIXEL_UM;
use crate::VISIBLE_UM;
use metalith_cell::Fidelity;
use metalith_core::document::{Limits, Section};

/// Settings for optimising the radial phase. Every key has a default: an empty section asks for the largest mean
/// logarithm of the Strehl ratio from 400 to 700 nm with the rigorous cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OptimiseSpec {
    /// The cell that phases are optimised with.
    pub fidelity: Fidelity,
    pub solver: SolverSpec,
    /// First and last wavelength (um): those of the design's band where the section does not say them. And their distance.
    pub band_um: (f64, f64),
    pub step_um: f64,
    /// True for each key that the section gives: its band, the distance, and the distance of the views.
    #[serde(skip)]
    said: [bool; 3],
    /// Largest wrapped phase step from ring to ring (turns); 0.5 is no limit.
    pub step_limit_waves: f64,
    pub start: StartSpec,
    /// Decides all that is random.
    pub seed: u64,
    pub merit: MeritSpec,
    pub robust: Option<RobustSpec>,
    pub views: ViewSpec,
    /// Whole cameras that are searched in place of a radial phase.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraSearchSpec>,
    /// Bound of all kernels together (MB).
    pub memory_mb: u64,
}

impl OptimiseSpec {
    /// Seeds that one run takes, one after the other from its own.
    pub fn seeds(&self) -> u64 {
        match self.solver {
            SolverSpec::Exchange { chains, .. } => chains.into(),
            SolverSpec::Adam { .. } => 1,
        }
    }
}

/// Solver, and how long it runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SolverSpec {
    /// Ring by ring, the best of all widths, and then blocks of rings. With the merit `deconvolution`, blocks
    /// alone, one chain, from the first start; chains, sweeps and temperature then make the start `log`.
    Exchange {
        /// Exchanges that begin from different phases or seeds.
        chains: u32,
        hot_sweeps: u32,
        /// First and last temperature, in units of the merit.
        temperature: (f64, f64),
        /// Blocks at most; they end when none promises any gain.
        blocks: u32,
    },
    /// Up the gradient.
    Adam { steps: u32, rate_waves: f64 },
}

/// Phases to begin from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StartSpec {
    /// One chain after the other takes the next of all below.
    All,
    LogAsphere,
    Hyperbolic,
    Random,
    /// The `[phase]` of the design.
    Previous,
    /// Result of exchange from a logarithmic asphere for the merit `log`.
    Log,
}

/// Weights of the merits in their sum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeritSpec {
    pub sum: f64,
    pub log: f64,
    pub deconvolution: f64,
    pub side_lobes: f64,
    /// Energy beyond this is side lobe (um).
    pub side_lobe_radius_um: f64,
}

/// Errors of fabrication that merits are taken in expectation over, as standard deviations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RobustSpec {
    pub width_bias_nm: f64,
    /// Film height, of itself.
    pub height: f64,
    pub defocus_um: f64,
    /// Errors drawn to optimise over.
    pub draws: u32,
}

/// Views over which image errors are expected.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewSpec {
    pub angles_deg: Vec<f64>,
    /// Distance of wavelengths (um).
    pub step_um: f64,
    /// Pixels along a side of the window, even.
    pub pixels: usize,
    pub pixel_um: f64,
    /// Weight of the error with one filter for all wavelengths of a colour channel.
    pub shared_filter: f64,
    /// Wavelengths of each channel that a step draws.
    pub drawn: usize,
}

impl OptimiseSpec {
    /// Read the section, or take the defaults where there is none.
    pub fn read(s: Option<&Section<'_, '_>>, cell: &CellSpec) -> Self {
        let Some(s) = s else { return Self::default() };
        let default = Self::default();
        let merit = s
            .optional_section("merit")
            .map_or(default.merit, |m| MeritSpec::read(&m));
        let images = merit.deconvolution != 0.0;
        let (short, long) = s
            .optional_array::<2>("band_nm", WAVELENGTH)
            .map_or(default.band_um, |b| {
                if b[0] >= b[1] {
                    s.fault(
                        "band_nm",
                        "the band ends before it begins",
                        "give the shorter wavelength first",
                    );
                }
                (b[0] * 1e-3, b[1] * 1e-3)
            });
        s.renamed("step_limit_turns", "step_limit_waves");
        let solver = SolverSpec::read(s, images);
        let views = s.optional_section("views");
        let says_step = |s: &Section<'_, '_>| s.has("step_nm");
        let spec = Self {
            fidelity: s.choice(
                "cell",
                &[
                    ("neighbours", Fidelity::Neighbours),
                    ("rigorous", Fidelity::Rigorous),
                    ("fitted", Fidelity::Fitted),
                    ("published", Fidelity::Published),
                ],
                Some(default.fidelity),
            ),
            solver,
            band_um: (short, long),
            said: [s.has("band_nm"), says_step(s), views.as_ref().is_some_and(says_step)],
            step_um: s.float_or("step_nm", Limits::new(0.1..=50.0, "nm"), 1.0) * 1e-3,
            step_limit_waves: s.float_or(
                "step_limit_waves",
                Limits::new(0.01..=0.5, "waves; 0.5 is no limit"),
                default.step_limit_waves,
            ),
            start: s.choice(
                "start",
                &[
                    ("all", StartSpec::All),
                    ("log_asphere", StartSpec::LogAsphere),
                    ("hyperbolic", StartSpec::Hyperbolic),
                    ("random", StartSpec::Random),
                    ("previous", StartSpec::Previous),
                    ("log", StartSpec::Log),
                ],
                Some(match solver {
                    SolverSpec::Adam { .. } if images => StartSpec::Log,
                    _ => default.start,
                }),
            ),
            seed: s.integer_or("seed", 0..=i64::MAX, "", 1) as u64,
            merit,
            robust: s.optional_section("robust").map(|r| RobustSpec::read(&r)),
            views: views.map_or_else(|| default.views.clone(), |v| ViewSpec::read(&v)),
            camera: s.optional_section("camera").map(|c| CameraSearchSpec::read(&c)),
            memory_mb: s.integer_or(
                "memory_mb",
                16..=1 << 20,
                "MB",
                (if images { 8192 } else { default.memory_mb }) as i64,
            ) as u64,
        };
        spec.check_neighbours(s, cell);
        spec.check_rotations(s, cell);
        s.finish();
        spec
    }

    /// Take the band of the design where the section does not say its own, at as many wavelengths as the visible has.
    pub(crate) fn within(&mut self, band_um: (f64, f64)) {
        let [band, step, step_of_views] = self.said;
        if !band {
            self.band_um = band_um;
        }
        // Whole picometres: whole nanometres in the visible, to the last bit.
        let part_um = |parts: f64| ((self.band_um.1 - self.band_um.0) * 1e6 / parts).round().max(1.0) / 1e3 * 1e-3;
        if !step {
            self.step_um = part_um(STEPS);
        }
        if !step_of_views {
            self.views.step_um = part_um(STEPS_OF_VIEWS);
        }
    }

    /// The band that the section says (um), if it does.
    pub(crate) fn said_band_um(&self) -> Option<(f64, f64)> {
        self.said[0].then_some(self.band_um)
    }
}

/// Steps of a band: one of 1 nm in the visible.
const STEPS: f64 = 300.0;

/// Steps of a band where images are expected: one of 10 nm in the visible.
const STEPS_OF_VIEWS: f64 = 30.0;

impl Default for OptimiseSpec {
    fn default() -> Self {
        Self {
            fidelity: Fidelity::Rigorous,
            solver: SolverSpec::EXCHANGE,
            band_um: VISIBLE_UM,
            said: [false; 3],
            step_um: 1e-3,
            step_limit_waves: 0.2,
            start: StartSpec::All,
            seed: 1,
            merit: MeritSpec::LOG,
            robust: None,
            views: ViewSpec {
                angles_deg: vec![0.0, 15.0, 30.0],
                step_um: 0.01,
                pixels: 160,
                pixel_um: USUAL_PIXEL_UM,
                shared_filter: 0.5,
                drawn: 3,
            },
            camera: None,
            memory_mb: 1024,
        }
    }
}

impl SolverSpec {
    /// Chains, hot sweeps and temperatures of an exchange where nothing else is asked for.
    pub const ANNEALED: (u32, u32, (f64, f64)) = (4, 60, (3e-3, 1e-4));

    /// Blocks after the sweeps, and of image errors: where they commonly gain no more.
    const BLOCKS: (u32, u32) = (60, 120);

    const EXCHANGE: Self = {
        let (chains, hot_sweeps, temperature) = Self::ANNEALED;
        Self::Exchange {
            chains,
            hot_sweeps,
            temperature,
            blocks: Self::BLOCKS.0,
        }
    };

    fn read(s: &Section<'_, '_>, images: bool) -> Self {
        s.renamed("rate_turns", "rate_waves");
        let words = [("exchange", false), ("adam", true)];
        let (chains, hot_sweeps, temperature) = Self::ANNEALED;
        if s.choice("solver", &words, Some(false)) {
            Self::Adam {
                steps: s.integer_or("steps", 1..=1_000_000, "", 400) as u32,
                rate_waves: s.float_or("rate_waves", Limits::new(1e-6..=0.5, "waves"), 0.01),
            }
        } else {
            let temperature = s
                .optional_array::<2>("temperature", Limits::new(1e-12..=1e3, ""))
                .map_or(temperature, |t| (t[0], t[1]));
            Self::Exchange {
                chains: s.integer_or("chains", 1..=1024, "", chains.into()) as u32,
                hot_sweeps: s.integer_or("hot_sweeps", 0..=100_000, "", hot_sweeps.into()) as u32,
                temperature,
                blocks: s.integer_or(
                    "blocks",
                    0..=1_000_000,
                    "",
                    (if images { Self::BLOCKS.1 } else { Self::BLOCKS.0 }).into(),
                ) as u32,
            }
        }
    }
}

impl MeritSpec {
    /// The mean logarithm of the Strehl ratio alone.
    pub const LOG: Self = Self {
        sum: 0.0,
        log: 1.0,
        deconvolution: 0.0,
        side_lobes: 0.0,
        side_lobe_radius_um: 10.0,
    };

    fn read(s: &Section<'_, '_>) -> Self {
        let weight = |key| s.float_or(key, Limits::new(0.0..=1e9, ""), 0.0);
        let merit = Self {
            sum: weight("sum"),
            log: weight("log"),
            deconvolution: weight("deconvolution"),
            side_lobes: weight("side_lobes"),
            side_lobe_radius_um: s.float_or(
                "side_lobe_radius_um",
                Limits::new(0.5..=80.0, "um"),
                Self::LOG.side_lobe_radius_um,
            ),
        };
        if merit.sum + merit.log + merit.deconvolution + merit.side_lobes == 0.0 {
            s.fault_given(
                &[
                    "optimise.merit.sum",
                    "optimise.merit.deconvolution",
                    "optimise.merit.side_lobes",
                ],
                "log",
                "all merits have a weight of zero",
                "give one of sum, log, deconvolution, side_lobes a weight",
            );
        }
        s.finish();
        merit
    }
}

impl RobustSpec {
    fn read(s: &Section<'_, '_>) -> Self {
        s.renamed("gap_um", "defocus_um");
        let float = |key, most, unit, default| s.float_or(key, Limits::new(0.0..=most, unit), default);
        let spec = Self {
            width_bias_nm: float("width_bias_nm", 50.0, "nm", 6.0),
            height: float("height_percent", 20.0, "%", 2.0) * 1e-2,
            defocus_um: float("defocus_um", 1000.0, "um", 10.0),
            draws: s.integer_or("draws", 1..=256, "", 16) as u32,
        };
        s.finish();
        spec
    }
}

impl ViewSpec {
    fn read(s: &Section<'_, '_>) -> Self {
        let default = OptimiseSpec::default().views;
        let angles = s.floats("angles_deg", Limits::new(-60.0..=60.0, "degrees"));
        let spec = Self {
            angles_deg: if angles.is_empty() { default.angles_deg } else { angles },
            step_um: s.float_or("step_nm", Limits::new(1.0..=50.0, "nm"), default.step_um * 1e3) * 1e-3,
            pixels: s.integer_or("pixels", 8..=1024, "", default.pixels as i64) as usize & !1,
            pixel_um: s.float_or("pixel_um", Limits::new(0.5..=50.0, "um"), default.pixel_um),
            shared_filter: s.float_or("shared_filter", Limits::new(0.0..=1.0, ""), default.shared_filter),
            drawn: s.integer_or("drawn", 1..=100, "", default.drawn as i64) as usize,
        };
        s.finish();
        spec
    }
}
