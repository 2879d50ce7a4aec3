//! How a line makes pillars: transmission as stated and as made, and the bias at each site.

use num_complex::Complex64;
use rayon::prelude::*;

use metalith_calibrate::{CalibratedModel, MadeCell, fill};
use metalith_cell::{CellModel, PointwiseCell};
use metalith_core::{Error, Result};
use metalith_core::{Progress, WidthMap};
use metalith_design::Design;

/// Biases are told apart to this [nm]: a quarter of a step of the widths, 10 mrad of phase.
const LEVEL_NM: f64 = 0.5;

/// Realised widths are tabulated so far beyond the range of the design [nm]; a bias greater than this is no
/// bias any more.
const MOST_BIAS_NM: u16 = 40;

/// Transmissions at one wavelength.
#[derive(Clone, Debug)]
pub struct Colour {
    pub wavelength_um: f64,
    /// |t| of a stated cell that passes everything.
    pub full: f64,
    /// Of intended pillars as stated, by width [nm].
    pub stated: Vec<Complex64>,
    /// Of made pillars, by realised width from `least` on [nm].
    made: Vec<Complex64>,
    least_nm: f64,
}

impl Colour {
    /// A pillar realised this wide [nm].
    pub fn made(&self, width_nm: f64) -> Complex64 {
        let x = (width_nm - self.least_nm).clamp(0.0, (self.made.len() - 1) as f64);
        let below = (x.floor() as usize).min(self.made.len() - 2);
        let share = x - below as f64;
        self.made[below] * (1.0 - share) + self.made[below + 1] * share
    }
}

/// A line, for the wavelengths that a design is verified at.
#[derive(Clone, Debug)]
pub struct Line {
    pub colours: Vec<Colour>,
    /// Widths that may be drawn [nm].
    pub drawn_nm: Vec<u16>,
    bias_nm: f64,
    density_nm: f64,
}

impl Line {
    /// Solve the cells as stated and as made.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn new(design: &Design, model: &CalibratedModel, progress: &dyn Progress) -> Result<Self> {
        let drawn_nm: Vec<u16> = design.cell.widths_nm().collect();
        let (narrow, wide) = design.cell.width_range_nm;
        let stack = design.cell_stack()?;
        let stated = PointwiseCell::new(stack, drawn_nm.iter().copied());
        let made: MadeCell = model.cell(design, 0.0)?;
        let realised: Vec<u16> = (narrow.saturating_sub(MOST_BIAS_NM).max(1)..=wide + MOST_BIAS_NM).collect();
        let wavelengths = &design.verify.wavelengths_um;
        progress.begin("pillars as they are made", (wavelengths.len() * realised.len()) as u64);
        let colour = |&wavelength_um: &f64| {
            let one = |&w: &u16| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let t = made.realised(f64::from(w), wavelength_um);
                progress.advance(1);
                t
            };
            Ok(Colour {
                wavelength_um,
                full: stated.full_transmission(wavelength_um)?,
                stated: stated.transmissions(wavelength_um, wide)?,
                made: realised.par_iter().map(one).collect::<Result<_>>()?,
                least_nm: f64::from(realised[0]),
            })
        };
        let geometry = &model.departure.geometry;
        Ok(Self {
            colours: wavelengths.iter().map(colour).collect::<Result<_>>()?,
            drawn_nm,
            bias_nm: geometry.cd_bias_nm,
            density_nm: geometry.cd_bias_density_nm,
        })
    }

    /// Whether a pillar's bias depends on what is drawn around it.
    pub fn follows_density(&self) -> bool {
        self.density_nm != 0.0
    }

    /// The bias of every site of a layout as drawn, row by row, in steps of [`bias_of`].
    pub fn levels(&self, drawn: &WidthMap) -> Vec<i32> {
        if !self.follows_density() {
            return vec![level(self.bias_nm); drawn.width_nm.len()];
        }
        let at = |f: &f32| level(self.bias_nm + self.density_nm * f64::from(*f));
        fill(drawn).iter().map(at).collect()
    }
}

fn level(bias_nm: f64) -> i32 {
    (bias_nm / LEVEL_NM).round() as i32
}

/// The bias of a level [nm].
pub fn bias_of(level: i32) -> f64 {
    f64::from(level) * LEVEL_NM
}
