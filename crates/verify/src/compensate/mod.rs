//! The layout whose pillars, as a measured line makes them, do what was intended.
//!
//! Each intended width is exchanged for the drawn one whose pillar, as fabricated, transmits most like the intended
//! pillar as stated, at the design's wavelengths together; of upright rectangles both widths, in light along both axes
//! together. A phase common to all pillars of a wavelength and polarisation is free: it moves no light. Bias that
//! follows density is looked up site by site, of the layout as drawn.

mod cases;
mod choose;
mod line;
mod page;

use serde::Serialize;

use choose::Kinds;
use line::Line;
use metalith_core::{Progress, Result};
use metalith_design::Design;
use metalith_design::array::{PillarArray, SymmetryGroup};
use metalith_optics::{CalibratedModel, NotApplied};
use metalith_pillars::PillarId;

pub use cases::{CompensationCase, compensation_cases};
pub use line::check_equal_copies;
pub use page::write_compensation_report;

/// Passes over the layout: the second sees the density of what the first has drawn.
const PASSES: usize = 2;

/// Ending of the name of a design whose layout is compensated.
const SUFFIX: &str = "_compensated";

/// The name of the compensated layout of a design, and of its folder.
pub fn compensated_name(design: &str) -> String {
    format!("{design}{SUFFIX}")
}

/// A compensated array and what it is worth.
pub struct Compensated {
    /// Widths to draw.
    pub array: PillarArray,
    pub summary: CompensationSummary,
    /// The line that it was made for, solved.
    line: Line,
}

impl Compensated {
    /// Parts of the model that neither the compensation nor its report applies.
    pub fn not_applied(&self) -> Vec<NotApplied> {
        self.line.chip.perturbation().not_applied()
    }
}

/// Numbers of a compensation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompensationSummary {
    /// Root mean square of how far drawn widths moved (nm); of upright rectangles those of both edges.
    pub moved_rms_nm: f64,
    /// Root mean square error of the complex transmission over the pillars and wavelengths, made against
    /// intended, over the root mean square of the intended one: of the layout as it was, and compensated; of upright rectangles in
    /// both polarisations together.
    pub error: [f64; 2],
    /// Pillars that now have the least or greatest width of the design and had not before: the range ends there.
    pub at_limit: u64,
}

/// Compensate the pillars of a design for what a model says of the line.
///
/// # Errors
/// If pillars are rotated rectangles, a cell cannot be solved, or the user stopped it.
pub fn compensate(
    design: &Design,
    array: &PillarArray,
    model: &CalibratedModel,
    progress: &dyn Progress,
) -> Result<Compensated> {
    let mut line = Line::new(design, model, progress)?;
    let copies = |class: usize| array.placed.iter().filter(|p| p.class == class).count() as u64;
    let opening_um = |class: usize| {
        let first = array.first_of(class);
        first.map_or(0.0, |placed| design.aperture_radius_of_um(&placed.element))
    };
    let openings_um: Vec<f64> = (0..array.classes.len()).map(opening_um).collect();
    let mut drawn = array.clone();
    drawn.compensated = true;
    let mut error = [0.0; 2];
    for pass in 0..PASSES {
        progress.check_stopped()?;
        let classes = drawn.classes.iter().zip(&openings_um);
        let steps: Vec<Vec<i32>> = classes.map(|(c, um)| line.steps(&c.widths.map(), *um)).collect();
        let mut kinds = Kinds::default();
        for (k, (class, steps)) in array.classes.iter().zip(&steps).enumerate() {
            kinds.count(&class.widths.map(), steps, copies(k));
        }
        let (least, most) = kinds.steps();
        line.solve(least, most, progress)?;
        let choice = kinds.choose(&line);
        if pass == 0 {
            error[0] = choice.before;
        }
        error[1] = choice.after;
        for ((to, class), steps) in drawn.classes.iter_mut().zip(&array.classes).zip(&steps) {
            let (to, from) = (to.widths.map_mut(), class.widths.map());
            for ((to, &w), &step) in to.number.iter_mut().zip(&from.number).zip(steps) {
                if w > 0 {
                    *to = choice.drawn[&(w, step)];
                }
            }
        }
        if !line.varies_by_site() {
            break;
        }
    }
    let shape = design.cell.shape;
    // Least and greatest width there is, of rectangles of either edge.
    let edges = |number: u16| shape.edges_nm(PillarId(number)).map(f64::from);
    let (first, last) = design.cell.width_range_nm;
    let (narrow, wide) = (edges(first)[0], edges(last)[0]);
    let (mut moved, mut pillars, mut at_limit) = (0.0, 0, 0);
    for (k, (new, old)) in drawn.classes.iter_mut().zip(&array.classes).enumerate() {
        let (drawn, intended) = (new.widths.map_mut(), old.widths.map());
        for (&d, &w) in drawn.number.iter().zip(&intended.number) {
            if w > 0 {
                let pairs = edges(d).into_iter().zip(edges(w));
                moved += copies(k) as f64 * 0.5 * pairs.clone().map(|(d, w)| (d - w).powi(2)).sum::<f64>();
                pillars += copies(k);
                let newly = |(d, w): (f64, f64)| d != w && (d == narrow || d == wide);
                at_limit += copies(k) * u64::from(pairs.clone().any(newly));
            }
        }
        new.group = SymmetryGroup::of_shape(drawn, shape);
    }
    Ok(Compensated {
        array: drawn,
        summary: CompensationSummary {
            moved_rms_nm: (moved / pillars.max(1) as f64).sqrt(),
            error,
            at_limit,
        },
        line,
    })
}
