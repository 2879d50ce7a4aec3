//! The layout whose pillars, as this line makes them, do what was intended.
//!
//! Each intended width is exchanged for the drawn one whose pillar, as made, has the complex transmission
//! nearest to that of the intended pillar as stated, at the design's wavelengths together. A phase common to
//! all pillars of a wavelength is free. Bias that follows density is looked up site by site.

use std::collections::BTreeMap;
use std::path::Path;

use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use super::density;
use super::model::CalibratedModel;
use crate::array::PillarArray;
use crate::cell::CellStack;
use crate::design::Design;
use crate::error::Result;
use crate::image::{Psf, incident, landing_um, pixel_mtf};
use crate::lattice::WidthMap;
use crate::report::{Axis, Chart, Column, Figure, ImageGrid, Page, Table};
use crate::wave::{Accuracy, Fold, Pillars, Propagator, Scratch, Window};

/// Biases are told apart to this [nm]: half a step of the writer's grid.
const LEVEL_NM: f64 = 0.5;

/// Rounds of choosing widths and then the free phases; both come to rest in a few.
const ROUNDS: usize = 4;

/// Orders along an axis.
const ORDERS: usize = 13;

/// A compensated array and what it is worth.
pub struct Compensated {
    pub array: PillarArray,
    pub summary: CompensationSummary,
    figures: Vec<Figure>,
    spots: Vec<Spot>,
}

/// Numbers of a compensation.
#[derive(Clone, Debug, Serialize)]
pub struct CompensationSummary {
    /// Root mean square of how far drawn widths moved [nm].
    pub moved_rms_nm: f64,
    /// Root mean square error of the complex transmission over the pillars, made against intended, in units of
    /// the intended one's root mean square: before and after.
    pub error: [f64; 2],
    /// Pillars that would need a width outside the design's range.
    pub at_limit: u64,
}

struct Spot {
    wavelength_um: f64,
    case: &'static str,
    peak: f64,
    mtf: f64,
}

/// Transmissions at one wavelength: of intended pillars as stated by width, of made ones by realised width.
struct Colour {
    wavelength_um: f64,
    stated: BTreeMap<u16, Complex64>,
    made: Vec<Complex64>,
}

impl Colour {
    /// A pillar realised this wide [nm].
    fn made(&self, width_nm: f64) -> Complex64 {
        let x = width_nm.clamp(0.0, (self.made.len() - 1) as f64);
        let below = (x.floor() as usize).min(self.made.len() - 2);
        let share = x - below as f64;
        self.made[below] * (1.0 - share) + self.made[below + 1] * share
    }
}

/// Compensate the pillars of a design for what a model says of the line.
///
/// # Errors
/// If a cell cannot be solved.
pub fn compensate(design: &Design, array: &PillarArray, model: &CalibratedModel) -> Result<Compensated> {
    let geometry = &model.departure.geometry;
    let folder = design.path.parent().unwrap_or(Path::new(""));
    let stated = CellStack::of_spec(&design.cell, folder)?;
    let orders = crate::cell::rcwa::Orders::new(ORDERS)?;
    let made = model.cell(design, 0.0)?;
    let drawn: Vec<u16> = design.cell.widths_nm().collect();
    let widest = usize::from(design.cell.width_range_nm.1) + MOST_BIAS_NM;
    let least = usize::from(design.cell.width_range_nm.0)
        .saturating_sub(MOST_BIAS_NM)
        .max(1);
    let colours = design
        .verify
        .wavelengths_um
        .iter()
        .map(|&um| {
            let of = drawn
                .par_iter()
                .map(|&w| Ok((w, stated.transmission(f64::from(w), um, orders)?)));
            let by_width = (0..=widest)
                .into_par_iter()
                .map(|w| {
                    if w < least {
                        Ok(Complex64::ZERO)
                    } else {
                        made.realised(w as f64, um)
                    }
                })
                .collect::<Result<Vec<_>>>()?;
            Ok(Colour {
                wavelength_um: um,
                stated: of.collect::<Result<BTreeMap<_, _>>>()?,
                made: by_width,
            })
        })
        .collect::<Result<Vec<_>>>()?;

    let biases: Vec<Vec<f64>> = array
        .classes
        .iter()
        .map(|class| {
            let sites = class.widths.width_nm.len();
            if geometry.cd_bias_density_nm == 0.0 {
                return vec![geometry.cd_bias_nm; sites];
            }
            let fill = density::fill(&class.widths);
            fill.iter()
                .map(|f| geometry.cd_bias_nm + geometry.cd_bias_density_nm * f64::from(*f))
                .collect()
        })
        .collect();
    let level = |bias: f64| (bias / LEVEL_NM).round() as i32;
    let mut kinds: BTreeMap<(u16, i32), u64> = BTreeMap::new();
    for (class, biases) in array.classes.iter().zip(&biases) {
        for (&w, &bias) in class.widths.width_nm.iter().zip(biases) {
            if w > 0 {
                *kinds.entry((w, level(bias))).or_default() += 1;
            }
        }
    }
    let bias_of = |level: i32| f64::from(level) * LEVEL_NM;
    let mut chosen: BTreeMap<(u16, i32), u16> = kinds.keys().map(|&(w, l)| ((w, l), w)).collect();
    let (before, mut pistons) = agreement(&colours, &kinds, &chosen, bias_of);
    let mut after = before;
    for _ in 0..ROUNDS {
        for (&(w, l), choice) in &mut chosen {
            let miss = |d: u16| -> f64 {
                colours
                    .iter()
                    .zip(&pistons)
                    .map(|(c, p)| (c.made(f64::from(d) + bias_of(l)) * p - c.stated[&w]).norm_sqr())
                    .sum()
            };
            *choice = drawn
                .iter()
                .copied()
                .min_by(|a, b| miss(*a).total_cmp(&miss(*b)))
                .unwrap_or(w);
        }
        (after, pistons) = agreement(&colours, &kinds, &chosen, bias_of);
    }

    let mut corrected = array.clone();
    let mut at_limit = 0;
    let (mut moved, mut count) = (0.0, 0u64);
    let (narrow, wide) = design.cell.width_range_nm;
    for (class, biases) in corrected.classes.iter_mut().zip(&biases) {
        for (w, &bias) in class.widths.width_nm.iter_mut().zip(biases) {
            if *w == 0 {
                continue;
            }
            let drawn = chosen[&(*w, level(bias))];
            moved += (f64::from(drawn) - f64::from(*w)).powi(2);
            count += 1;
            at_limit += u64::from(drawn != *w && (drawn == narrow || drawn == wide));
            *w = drawn;
        }
        class.group = crate::array::Group::of(&class.widths);
    }
    let (figures, spots) = pictures(design, array, &corrected, &colours, &biases)?;
    Ok(Compensated {
        array: corrected,
        summary: CompensationSummary {
            moved_rms_nm: (moved / count.max(1) as f64).sqrt(),
            error: [before, after],
            at_limit,
        },
        figures,
        spots,
    })
}

/// Beyond the range of the design by so much a bias may take a pillar [nm].
const MOST_BIAS_NM: usize = 40;

/// How far made pillars miss intended ones, and the free phases at which they do.
fn agreement(
    colours: &[Colour],
    kinds: &BTreeMap<(u16, i32), u64>,
    chosen: &BTreeMap<(u16, i32), u16>,
    bias_of: impl Fn(i32) -> f64,
) -> (f64, Vec<Complex64>) {
    let (mut miss, mut size) = (0.0, 0.0);
    let pistons = colours
        .iter()
        .map(|c| {
            let pairs = || {
                kinds
                    .iter()
                    .map(|(k, n)| (c.made(f64::from(chosen[k]) + bias_of(k.1)), c.stated[&k.0], *n as f64))
            };
            let overlap: Complex64 = pairs().map(|(made, stated, n)| stated * made.conj() * n).sum();
            let piston = if overlap.norm() > 0.0 {
                overlap / overlap.norm()
            } else {
                Complex64::ONE
            };
            for (made, stated, n) in pairs() {
                miss += n * (made * piston - stated).norm_sqr();
                size += n * stated.norm_sqr();
            }
            piston
        })
        .collect();
    ((miss / size).sqrt(), pistons)
}

/// PSF and MTF on the axis of the first element: intended, made of the intended layout, made of the
/// compensated one.
fn pictures(
    design: &Design,
    intended: &PillarArray,
    corrected: &PillarArray,
    colours: &[Colour],
    biases: &[Vec<f64>],
) -> Result<(Vec<Figure>, Vec<Spot>)> {
    let class = intended.placed[intended.placed.len() / 2].class;
    let element = intended.placed[intended.placed.len() / 2].element;
    let (plain, moved) = (&intended.classes[class].widths, &corrected.classes[class].widths);
    let mut figures = Vec::new();
    let mut spots = Vec::new();
    let mut scratch = Scratch::default();
    for c in colours {
        let um = c.wavelength_um;
        let wave = incident(&element.wedge, um, [0.0, 0.0])?;
        let chief = landing_um(&element.wedge, &wave, design.lens.focal_length_um)?;
        let window = Window::about(
            chief,
            plain.lattice.pitch_um(),
            design.verify.window_samples,
            design.lens.focal_length_um,
        );
        let fold = Fold::plan(plain.lattice, design.lens.radius_um(), um, window, Accuracy::Accurate)?;
        let mut images = ImageGrid::new(format!("PSF at {:.0} nm", um * 1e3), 3)
            .pixel_um(window.step_um)
            .values("|E|^2 / |E_inc|^2", "")
            .log(3.0);
        let frequency = Axis::linear("spatial frequency", "1/mm");
        let mut curves = Chart::new(
            format!("MTF at {:.0} nm", um * 1e3),
            frequency,
            Axis::linear("MTF", "").range(0.0, 1.0),
        );
        // Pillars as tables by kind: realised widths to half a nanometre.
        let cases: [(&'static str, &WidthMap, bool); 3] = [
            ("intended", plain, false),
            ("as made, uncorrected", plain, true),
            ("as made, corrected", moved, true),
        ];
        for (case, widths, as_made) in cases {
            let (kinds, table) = realised(c, widths, &biases[class], as_made);
            let psf = Psf::of(&fold.field(&Pillars::new(&kinds, &table)?, &wave, &mut scratch)?);
            let frequencies: Vec<f64> = (0..=60).map(|k| 2.0 * f64::from(k)).collect();
            let [x, y] = [0, 1].map(|axis| psf.mtf_curve(axis, &frequencies));
            let mtf: Vec<f64> = (0..frequencies.len())
                .map(|k| 0.5 * (x[k] + y[k]) * pixel_mtf(design.verify.pixel_um, frequencies[k]))
                .collect();
            spots.push(Spot {
                wavelength_um: um,
                case,
                peak: psf.peak().0,
                mtf: mtf[frequencies.len() / 3],
            });
            curves.line(case, frequencies.iter().copied().zip(mtf));
            images.image(case, psf.values.clone());
        }
        figures.push(images.caption("On the axis of the field of the middle element, one logarithmic scale."));
        figures.push(curves.caption("With the sensor's pixel, mean of both axes."));
    }
    Ok((figures, spots))
}

/// Pillars as a map of kinds and the transmission of each kind.
fn realised(c: &Colour, widths: &WidthMap, biases: &[f64], as_made: bool) -> (WidthMap, Vec<Complex64>) {
    let mut table = vec![Complex64::ZERO];
    let mut known: BTreeMap<(u16, i32), u16> = BTreeMap::new();
    let mut kinds = widths.clone();
    for (w, bias) in kinds.width_nm.iter_mut().zip(biases) {
        if *w == 0 {
            continue;
        }
        let level = if as_made { (bias / LEVEL_NM).round() as i32 } else { 0 };
        *w = *known.entry((*w, level)).or_insert_with(|| {
            table.push(if as_made {
                c.made(f64::from(*w) + f64::from(level) * LEVEL_NM)
            } else {
                c.stated[w]
            });
            (table.len() - 1) as u16
        });
    }
    (kinds, table)
}

impl Compensated {
    /// Write the report: intended, as it would be made, as it would be made corrected.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_report(&self, design: &Design, model: &CalibratedModel, path: &Path) -> Result<()> {
        let mut page = Page::new(
            format!("{}, compensated", design.name),
            format!("for {}: {}", model.set, model.finding),
        );
        let s = &self.summary;
        page.facts(&[
            ("Widths moved, rms", format!("{:.2} nm", s.moved_rms_nm)),
            ("Error uncorrected", format!("{:.4}", s.error[0])),
            ("Error corrected", format!("{:.4}", s.error[1])),
            ("At the end of the range", s.at_limit.to_string()),
        ]);
        page.paragraph(
            "Error: rms difference of the complex transmission of the pillars as made from that intended, over the rms of the latter, at all wavelengths of the design together, one phase a wavelength free.",
        );
        let mut table = Table::new([
            Column::number("Wavelength", "nm"),
            Column::text("Pillars"),
            Column::number("Peak", ""),
            Column::number("MTF at 40 / mm", ""),
        ]);
        for spot in &self.spots {
            table.row([
                (spot.wavelength_um * 1e3).into(),
                spot.case.into(),
                spot.peak.into(),
                spot.mtf.into(),
            ]);
        }
        page.section("On axis").table(table);
        page.row(self.figures.iter().cloned());
        page.write(path)
    }
}
