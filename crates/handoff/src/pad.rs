//! Pillars of uniform pads: outline, words, and what is measured of them.

use std::collections::BTreeSet;

use metalith_design::Design;
use metalith_layout::PillarForm;
use metalith_pillars::{PillarId, PillarShape, Rectangles, RotatedRectangles, UprightRectangles};
use serde::Serialize;

use super::process::Process;

/// Rotations of the pads of a dose matrix of rectangles (degrees): edges along both axes and between them.
const DOSE_ROTATIONS_DEG: [f64; 3] = [0.0, 45.0, 90.0];

/// Rotations of the pads of test structures of rectangles (degrees): half a turn of a rectangle is none.
const TEST_ROTATIONS_DEG: [f64; 6] = [0.0, 30.0, 60.0, 90.0, 120.0, 150.0];

/// Edges of upright rectangles of the pads of a dose matrix and of test structures, as shares of the way from the shortest to the
/// longest: small, large, thin along either axis, and in the middle.
const SHARES: [[f64; 2]; 5] = [[0.25, 0.25], [0.25, 0.75], [0.5, 0.5], [0.75, 0.25], [0.75, 0.75]];

/// Sizes of rotated rectangles beside the nominal one, without rotation, in steps of both edges.
const SIZES: [i64; 4] = [-2, -1, 1, 2];

/// Shortest edge of a rectangle of a pad (nm).
const SHORTEST: i64 = 20;

/// Drawn size of something that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DrawnSize {
    /// Width, diameter, shorter edge of a rotated rectangle, or edge along x of an upright one (nm).
    pub width_nm: u16,
    /// Longer edge of a rotated rectangle, or edge along y of an upright one (nm).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_nm: Option<u16>,
    /// Direction of the shorter edge of a rotated rectangle, from x towards y (degrees).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_deg: Option<f64>,
}

impl DrawnSize {
    /// A width alone.
    pub(super) fn width(width_nm: u16) -> Self {
        Self {
            width_nm,
            length_nm: None,
            rotation_deg: None,
        }
    }

    /// A pillar of this shape with this width (nm) or number.
    pub(super) fn of(shape: PillarShape, number: u16) -> Self {
        if shape.has_width() {
            return Self::width(number);
        }
        let [width_nm, length_nm] = shape.edges_nm(PillarId(number));
        Self {
            width_nm,
            length_nm: Some(length_nm),
            rotation_deg: shape.has_one_size().then(|| whole_mdeg(shape.value(PillarId(number)))),
        }
    }
}

/// An angle (degrees) without the rounding of its computation.
pub(super) fn whole_mdeg(deg: f64) -> f64 {
    (deg * 1e3).round() / 1e3
}

/// The pillar that a pad is made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct PadPillar {
    form: PillarForm,
    number: u16,
    /// True if a pad of rectangles is identified by its size, not by a number.
    by_size: bool,
}

impl PadPillar {
    /// The pillar that the design may write whose width is nearest to one that is asked for (nm).
    fn of_width(design: &Design, width_nm: f64) -> Self {
        Self {
            form: PillarForm::of(design),
            number: legal_width(design, width_nm),
            by_size: false,
        }
    }

    /// The rectangle of the design with the rotation nearest to one that is asked for (degrees).
    fn rotated(design: &Design, pillars: RotatedRectangles, rotation_deg: f64) -> Self {
        Self {
            form: PillarForm::of(design),
            number: pillars.number(rotation_deg.to_radians()),
            by_size: false,
        }
    }

    /// An upright rectangle with both edges longer by this (nm), if it fits into its cell.
    fn resized(design: &Design, pillars: RotatedRectangles, by_nm: i64) -> Option<Self> {
        let edge = |nm: u16| i64::from(nm) + by_nm;
        let (width, length) = (edge(pillars.width_nm), edge(pillars.length_nm));
        let fits = width >= SHORTEST && (width as f64).hypot(length as f64) <= f64::from(design.cell.pitch_nm);
        let resized = RotatedRectangles {
            width_nm: u16::try_from(width).ok()?,
            length_nm: u16::try_from(length).ok()?,
            steps: pillars.steps,
        };
        fits.then(|| Self {
            form: PillarForm::of(design).with_shape(resized.into()),
            number: pillars.steps,
            by_size: true,
        })
    }

    /// A pillar that was found in a layout: a width (nm), which becomes an even one, or a number.
    pub(crate) fn found(form: PillarForm, number: u16) -> Self {
        let shape = form.shape();
        Self {
            form,
            number: if shape.has_width() {
                (number & !1).max(2)
            } else {
                number
            },
            by_size: !shape.has_width() && !shape.has_one_size(),
        }
    }

    /// Corners about its middle (nm), counter-clockwise.
    pub(crate) fn corners(&self) -> Vec<(i64, i64)> {
        self.form.corners(self.number)
    }

    pub(crate) fn drawn(&self) -> DrawnSize {
        DrawnSize::of(self.form.shape(), self.number)
    }

    /// Digits next to the pad: its width (nm), its rotation (degrees), or its edges.
    pub(crate) fn digits(&self) -> String {
        let drawn = self.drawn();
        match (drawn.length_nm, drawn.rotation_deg) {
            (Some(length), _) if self.by_size => format!("{}X{length}", drawn.width_nm),
            (_, Some(deg)) => format!("{deg:.0}"),
            _ => drawn.width_nm.to_string(),
        }
    }

    /// Name of its cell.
    pub(crate) fn cell_name(&self) -> String {
        if self.by_size {
            format!("W{}", self.digits())
        } else {
            self.form.cell_name(self.number)
        }
    }

    /// Size and direction in words.
    pub(crate) fn words(&self) -> String {
        let drawn = self.drawn();
        match (drawn.length_nm, drawn.rotation_deg) {
            (Some(length), Some(deg)) => {
                format!("{} by {length} nm, rotated by {deg} degrees", drawn.width_nm)
            }
            (Some(length), None) => format!("{} by {length} nm", drawn.width_nm),
            _ if self.form.is_square() => format!("{} nm", drawn.width_nm),
            _ => format!("{} nm in diameter", drawn.width_nm),
        }
    }
}

/// Pillars of the pads of a dose matrix.
pub(super) fn dose_pads(design: &Design, process: &Process) -> Vec<PadPillar> {
    let pad = |number: u16| PadPillar {
        form: PillarForm::of(design),
        number,
        by_size: !design.cell.shape.has_one_size(),
    };
    let mut pads: Vec<PadPillar> = if let Some(numbers) = standing_for_all(design, &DOSE_ROTATIONS_DEG) {
        numbers.into_iter().map(pad).collect()
    } else {
        let widths = process.dose_matrix.pad_widths_nm.iter();
        widths.map(|&w| PadPillar::of_width(design, w)).collect()
    };
    // Several widths of the process may be nearest to the same one of the design.
    let mut known = BTreeSet::new();
    pads.retain(|pad| known.insert(pad.number));
    pads
}

/// Numbers of rectangles that stand for all of a design: those with the rotations nearest to these (degrees), or some sizes; none
/// where pillars are chosen by their width.
pub(super) fn standing_for_all(design: &Design, rotations_deg: &[f64]) -> Option<Vec<u16>> {
    match design.cell.shape {
        PillarShape::Rectangle(Rectangles::Rotated(pillars)) => {
            let number = |deg: &f64| pillars.number(deg.to_radians());
            Some(rotations_deg.iter().map(number).collect())
        }
        PillarShape::Rectangle(Rectangles::Upright(pillars)) => Some(upright_sizes(design, pillars)),
        PillarShape::Square | PillarShape::Circle | PillarShape::Mixed => None,
    }
}

/// Upright rectangles that the design chooses from, which stand for all of them.
fn upright_sizes(design: &Design, pillars: UprightRectangles) -> Vec<u16> {
    let known = design
        .mapping
        .pillar_library
        .iter()
        .flat_map(|library| library.pillars());
    let known: Vec<u16> = known.map(|pillar| pillar.number).collect();
    let span = f64::from(pillars.longest_nm() - pillars.shortest_nm);
    let nearest = |shares: [f64; 2]| {
        let off = |number: &u16| -> f64 {
            let edges = pillars.edges_nm(*number).into_iter().zip(shares);
            let off = |(nm, share): (u16, f64)| (f64::from(nm - pillars.shortest_nm) - share * span).powi(2);
            edges.map(off).sum()
        };
        known.iter().copied().min_by(|a, b| off(a).total_cmp(&off(b)))
    };
    let mut sizes: Vec<u16> = SHARES.into_iter().filter_map(nearest).collect();
    sizes.sort_unstable();
    sizes.dedup();
    sizes
}

fn upright_pads(design: &Design, pillars: UprightRectangles) -> Vec<PadPillar> {
    let pad = |number: u16| PadPillar {
        form: PillarForm::of(design),
        number,
        by_size: true,
    };
    upright_sizes(design, pillars).into_iter().map(pad).collect()
}

/// Pillars of the pads of test structures: all widths in steps, from the narrowest to the widest that the design may write; of
/// rotated rectangles some rotations, then some sizes about that of the design; of upright ones some sizes.
pub(super) fn test_pads(design: &Design, process: &Process) -> Vec<PadPillar> {
    if let Some(pillars) = design.cell.shape.upright() {
        return upright_pads(design, pillars);
    }
    if let Some(pillars) = design.cell.shape.rotated() {
        // Edges stay even numbers.
        let step = (process.tests.pad_width_step_nm / 2.0).round() as i64 * 2;
        let rotated = TEST_ROTATIONS_DEG.iter();
        let rotated = rotated.map(|&deg| PadPillar::rotated(design, pillars, deg));
        let sized = SIZES
            .iter()
            .filter_map(|k| PadPillar::resized(design, pillars, k * step));
        return rotated.chain(sized).collect();
    }
    let (low, high) = design.cell.width_range_nm;
    let step = process
        .tests
        .pad_width_step_nm
        .max(f64::from(design.cell.width_step_nm));
    let count = (f64::from(high - low) / step).floor() as i64;
    let mut pads: Vec<PadPillar> = (0..=count)
        .map(|k| PadPillar::of_width(design, f64::from(low) + k as f64 * step))
        .collect();
    pads.dedup_by_key(|pad| pad.number);
    pads
}

/// Width of a line to measure (nm), nearest to one that is asked for: one that pillars may have, or for rectangles any even one.
pub(super) fn line_width(design: &Design, width_nm: f64) -> i64 {
    if design.cell.shape.has_width() {
        i64::from(legal_width(design, width_nm))
    } else {
        (width_nm / 2.0).round() as i64 * 2
    }
}

/// The width that the design may write nearest to one that is asked for (nm).
pub(super) fn legal_width(design: &Design, width_nm: f64) -> u16 {
    let nearest = design.cell.widths_nm().min_by(|a, b| {
        let off = |w: &u16| (f64::from(*w) - width_nm).abs();
        off(a).total_cmp(&off(b))
    });
    nearest.unwrap_or(design.cell.width_range_nm.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn widths_of_a_dose_matrix_that_are_equal_for_the_design_make_one_pad() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../designs/mini_3x3.toml");
        let design = Design::read(&path).unwrap();
        let widest = f64::from(design.cell.width_range_nm.1);
        let mut process = Process::standard();
        process.dose_matrix.pad_widths_nm = vec![widest + 50.0, 200.0, widest + 90.0];
        let widths: Vec<u16> = dose_pads(&design, &process).iter().map(|pad| pad.number).collect();
        assert_eq!(widths, [legal_width(&design, widest), legal_width(&design, 200.0)]);
    }
}
