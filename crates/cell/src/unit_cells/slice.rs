//! The phase curve of a table of unit cells at the height and wavelength of a design.

use std::f64::consts::TAU;

use num_complex::Complex64;
use serde::Serialize;

use super::{AXES, PhaseConvention, UnitCellTable, nearest, same};
use crate::PhaseCurve;
use metalith_core::{Error, Result, lagrange_weight};

/// Samples that a value between them is interpolated from, along an axis.
const NODES: usize = 4;

/// Fewest widths of a table: fewer give no curve.
const FEWEST_WIDTHS: usize = 4;

/// Least rise of the phase over all widths that shows a convention (waves): a quarter of a wave is more than the piston and ripple of a
/// table that hardly varies.
const LEAST_RISE: f64 = 0.25;

/// Least share of all changes of phase that go one way: resonances turn the phase back over a few widths.
const LEAST_SHARE: f64 = 0.75;

/// Greatest step of the phase from width to width by which it can still be continued (waves); half a wave is the limit.
const MOST_STEP: f64 = 0.4;

/// Rms error of interpolation beyond which nothing is known of the cells between the samples.
const MOST_ERROR: f64 = 0.3;

/// Error of interpolation between the samples of a table: difference from the interpolation that leaves out the nearest sample, which is
/// an upper estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TabulatedPhase {
    /// Phase error of all widths (rad).
    pub rms_rad: f64,
    pub worst_rad: f64,
    /// Error of the amplitude.
    pub rms_amplitude: f64,
    pub worst_amplitude: f64,
}

/// The table of unit cells that a mapping was made from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TabulatedCells {
    /// Name of its file.
    pub file: String,
    /// Meaning of the columns that were read.
    pub columns: String,
    /// Number of widths, heights and wavelengths; 0 where the table has no such axis.
    pub samples: [usize; 3],
    pub convention: PhaseConvention,
    /// How the convention is known.
    pub reason: String,
    /// Error of interpolation; none if each width of the cell, its height and its wavelength are samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interpolation: Option<TabulatedPhase>,
}

impl TabulatedCells {
    /// One line of the table.
    pub fn words(&self) -> String {
        let axes = AXES.iter().zip(self.samples).filter(|(_, count)| *count > 0);
        let axes: Vec<_> = axes
            .map(|(name, count)| format!("{count} {name}{}", if count == 1 { "" } else { "s" }))
            .collect();
        let error = match &self.interpolation {
            Some(error) => format!(
                "interpolated, error at most {:.4} rad rms ({:.4} worst) and {:.4} of the amplitude ({:.4} worst)",
                error.rms_rad, error.worst_rad, error.rms_amplitude, error.worst_amplitude
            ),
            None => "no interpolation".into(),
        };
        format!(
            "{} ({}; {}); phase convention {}: {}; {error}",
            self.file,
            axes.join(" x "),
            self.columns,
            self.convention.name(),
            self.reason
        )
    }
}

impl UnitCellTable {
    /// The phase curve of pillars of these widths (nm), which rise, at a height (nm) and a wavelength (um), in the convention of this
    /// program; `stated` is the convention of the table, if somebody says it.
    ///
    /// # Errors
    /// If the table does not reach the height, the wavelength or the widths, is too coarse, or its convention is not to be found or is
    /// another than stated.
    pub fn curve(
        &self,
        height_nm: f64,
        wavelength_um: f64,
        widths_nm: &[u16],
        stated: Option<PhaseConvention>,
    ) -> Result<(PhaseCurve, TabulatedCells)> {
        let wavelength_nm = wavelength_um * 1e3;
        let [low, high] = [widths_nm.first(), widths_nm.last()].map(|w| f64::from(w.copied().unwrap_or(0)));
        if self.axes_nm[0].len() < FEWEST_WIDTHS {
            return Err(Error::refused(
                "mapping/table-too-coarse",
                format!(
                    "{}: {} widths give no curve",
                    self.path.display(),
                    self.axes_nm[0].len()
                ),
                format!(
                    "give {FEWEST_WIDTHS} widths or more, in steps over which the phase changes by a tenth of a wave"
                ),
            ));
        }
        self.reaches(0, low, "width_min_nm")?;
        self.reaches(0, high, "width_max_nm")?;
        self.reaches(1, height_nm, "pillar_height_nm")?;
        self.reaches(2, wavelength_nm, "wavelength_nm of [mapping]")?;
        let at = |width_nm: f64| [width_nm, height_nm, wavelength_nm];
        let samples: Vec<Complex64> = self.axes_nm[0].iter().map(|w| self.value(at(*w), None)).collect();
        let (convention, reason) = self.convention(&samples, stated)?;
        let turned = |t: Complex64| match convention {
            PhaseConvention::Minus => t,
            PhaseConvention::Plus => t.conj(),
        };
        let t: Vec<Complex64> = widths_nm
            .iter()
            .map(|w| turned(self.value(at(f64::from(*w)), None)))
            .collect();
        let mut off = false;
        let coarser = widths_nm.iter().zip(&t).map(|(w, t)| {
            let place = at(f64::from(*w));
            (0..3).fold(*t, |sum, axis| {
                if self.is_sample(axis, place[axis]) {
                    sum
                } else {
                    off = true;
                    sum + turned(self.value(place, Some(axis))) - *t
                }
            })
        });
        let coarser: Vec<Complex64> = coarser.collect();
        let interpolation = off.then(|| errors(&t, &coarser));
        let apart = t.iter().zip(&coarser).map(|(a, b)| (a - b).norm_sqr()).sum::<f64>();
        if apart > MOST_ERROR * MOST_ERROR * t.len() as f64 {
            return Err(Error::refused(
                "mapping/table-too-coarse",
                format!(
                    "{}: transmissions between its samples are uncertain by {:.2} rms",
                    self.path.display(),
                    (apart / t.len() as f64).sqrt()
                ),
                "simulate finer steps of width, height and wavelength, or these of the design",
            ));
        }
        let note = TabulatedCells {
            file: self.path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            columns: self.columns.clone(),
            samples: self.axes_nm.each_ref().map(Vec::len),
            convention,
            reason,
            interpolation,
        };
        Ok((PhaseCurve::of_transmissions(wavelength_um, widths_nm.to_vec(), t), note))
    }

    /// Succeeds if a value (nm) is within the samples of an axis; `key` is the one of the design that asks for it.
    fn reaches(&self, axis: usize, at: f64, key: &str) -> Result<()> {
        let samples = &self.axes_nm[axis];
        let (Some(&least), Some(&greatest)) = (samples.first(), samples.last()) else {
            return Ok(());
        };
        if (least..=greatest).contains(&at) || same(least, at) || same(greatest, at) {
            return Ok(());
        }
        let [least, greatest, at] = [least, greatest, at].map(|nm| (nm * 1e4).round() / 1e4);
        let range = match samples.len() {
            1 => format!("the {} {least} nm alone", AXES[axis]),
            _ => format!("{}s from {least} to {greatest} nm", AXES[axis]),
        };
        Err(Error::refused(
            "mapping/table-range",
            format!(
                "{}: the table has {range}, and the design asks for {at} nm",
                self.path.display()
            ),
            format!("change `{key}`, or simulate further cells: nothing is extrapolated"),
        ))
    }

    fn is_sample(&self, axis: usize, at: f64) -> bool {
        let samples = &self.axes_nm[axis];
        samples.is_empty() || same(samples[nearest(samples, at)], at)
    }

    /// The transmission at a width, height and wavelength (nm) by the polynomial through the nearest samples along each axis; along
    /// one axis the nearest of all may be left out.
    fn value(&self, at: [f64; 3], without: Option<usize>) -> Complex64 {
        let weights = [0, 1, 2].map(|axis| weights(&self.axes_nm[axis], at[axis], without == Some(axis)));
        let counts = self.axes_nm.each_ref().map(|axis| axis.len().max(1));
        let mut sum = Complex64::ZERO;
        for (i, a) in &weights[0] {
            for (j, b) in &weights[1] {
                for (k, c) in &weights[2] {
                    sum += self.t[(i * counts[1] + j) * counts[2] + k] * (a * b * c);
                }
            }
        }
        sum
    }

    /// Convention of phases (of the widths of the table), stated or found, and how it is known.
    fn convention(&self, samples: &[Complex64], stated: Option<PhaseConvention>) -> Result<(PhaseConvention, String)> {
        let steps: Vec<f64> = samples
            .windows(2)
            .map(|pair| (pair[1] * pair[0].conj()).arg() / TAU)
            .collect();
        let rise: f64 = steps.iter().sum();
        let all: f64 = steps.iter().map(|step| step.abs()).sum();
        let longest = steps.iter().map(|step| step.abs()).fold(0.0, f64::max);
        let is_clear =
            rise.abs() >= LEAST_RISE && (all + rise.abs()) * 0.5 >= LEAST_SHARE * all && longest <= MOST_STEP;
        let word = if rise < 0.0 { "falls" } else { "rises" };
        let [narrow, wide] = [self.axes_nm[0].first(), self.axes_nm[0].last()].map(|w| w.copied().unwrap_or(0.0));
        let seen = format!(
            "the phase {word} by {:.2} waves from {narrow:.0} to {wide:.0} nm of width",
            rise.abs()
        );
        let found = if rise < 0.0 {
            PhaseConvention::Plus
        } else {
            PhaseConvention::Minus
        };
        match stated {
            Some(stated) if is_clear && stated != found => Err(Error::refused(
                "mapping/phase-convention",
                format!(
                    "{}: {seen}, so its convention is {}, and the design says {}",
                    self.path.display(),
                    found.name(),
                    stated.name()
                ),
                "a wider pillar delays light more: correct `phase_convention` of [mapping], or leave it out",
            )),
            Some(stated) => Ok((stated, "stated by the design".into())),
            None if is_clear => Ok((
                found,
                format!("found, since {seen} and a wider pillar delays light more"),
            )),
            None => Err(Error::refused(
                "mapping/phase-convention",
                format!(
                    "{}: {seen}, {:.2} of all changes one way, in steps of up to {longest:.2} waves: this does not show the sign of the phase",
                    self.path.display(),
                    (all + rise.abs()) * 0.5 / all.max(f64::MIN_POSITIVE)
                ),
                "say it in [mapping]: `phase_convention = \"exp(-iwt)\"` (Lumerical, Tidy3D, Meep) or `\"exp(+iwt)\"` (COMSOL, CST)",
            )),
        }
    }
}

/// Samples near a place and their weights; the nearest may be left out where there are others.
fn weights(samples: &[f64], at: f64, without_nearest: bool) -> Vec<(usize, f64)> {
    if samples.is_empty() {
        return vec![(0, 1.0)];
    }
    let nearest = nearest(samples, at);
    if same(samples[nearest], at) && !without_nearest {
        return vec![(nearest, 1.0)];
    }
    let left: Vec<usize> = (nearest.saturating_sub(NODES)..samples.len().min(nearest + NODES + 1))
        .filter(|i| !(without_nearest && *i == nearest && samples.len() > 1))
        .collect();
    let count = left.len().min(NODES);
    let after = left.partition_point(|i| samples[*i] <= at);
    let first = after.saturating_sub(count / 2).min(left.len() - count);
    let near = &left[first..first + count];
    near.iter()
        .map(|&own| {
            let others = near.iter().filter(|other| **other != own).map(|other| samples[*other]);
            (own, lagrange_weight(at, samples[own], others))
        })
        .collect()
}

/// Errors of a curve by a coarser one.
fn errors(t: &[Complex64], coarser: &[Complex64]) -> TabulatedPhase {
    let each = || t.iter().zip(coarser);
    let phases = || each().map(|(a, b)| (b * a.conj()).arg().abs());
    let amplitudes = || each().map(|(a, b)| (a.norm() - b.norm()).abs());
    let count = t.len().max(1) as f64;
    TabulatedPhase {
        rms_rad: (phases().map(|v| v * v).sum::<f64>() / count).sqrt(),
        worst_rad: phases().fold(0.0, f64::max),
        rms_amplitude: (amplitudes().map(|v| v * v).sum::<f64>() / count).sqrt(),
        worst_amplitude: amplitudes().fold(0.0, f64::max),
    }
}
