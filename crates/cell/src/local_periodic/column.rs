//! One width of a table over the band: solved at some wavelengths, a function between them.

use num_complex::Complex64;
use rayon::prelude::*;

use super::barycentric::Barycentric;
use super::rational_spectrum::{RationalSpectrum, Resonance};
use super::width_spectrum::WidthSpectrum;
use metalith_core::Result;

/// Share of the tolerance of a table at which its rational functions are settled. What is left of a narrow resonance far away from it
/// is as small as this: with a quarter of the tolerance one column in three misses one, with a twentieth one in thirty.
const SETTLED: f64 = 0.05;

/// Share of the tolerance above which a resonance counts, and an error at a wavelength that is held out is repaired.
const SEEN: f64 = 0.4;

/// Wavelength (um) by which a resonance moves at the most for each micrometre of width, in wavelengths over the pitch.
const SHIFT: f64 = 2.0;

/// Rounds of columns that ask their neighbours for resonances: most take three.
const ROUNDS: usize = 64;

/// Wavelengths at which a function is compared with the solver, one after another, until one is met.
const TRIALS: usize = 3;

/// Inverse of the golden ratio: its multiples lie evenly over a band, and on no grid.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Transmission between the wavelengths that were solved.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Between {
    Rational(Barycentric),
    /// Cubics, where a rational function takes too many samples or missed what it was compared with.
    Cubic(WidthSpectrum),
}

/// One width over the band.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Column {
    pub between: Between,
    /// Wavelengths solved.
    pub solved: u32,
    /// Error of t at a wavelength that was held out, before it was repaired if it was too large.
    pub held_out: f64,
}

impl Column {
    pub(super) fn at(&self, wavelength_um: f64) -> Complex64 {
        match &self.between {
            Between::Rational(function) => function.at(wavelength_um),
            Between::Cubic(spectrum) => spectrum.at(wavelength_um),
        }
    }
}

/// Columns of widths (nm), rising, on a pitch (nm) over a band (um): `solve` gives t of the column at an index at a wavelength (um),
/// `done` is called for each. `tolerance` is that of the cubics; rational functions are nearer.
///
/// # Errors
/// The first of `solve`.
pub(super) fn columns(
    widths_nm: &[f64],
    pitch_nm: f64,
    band_um: (f64, f64),
    tolerance: f64,
    solve: &(impl Fn(usize, f64) -> Result<Complex64> + Sync),
    done: &(impl Fn() + Sync),
) -> Result<Vec<Column>> {
    let begun = (0..widths_nm.len()).into_par_iter().map(|i| {
        let spectrum = RationalSpectrum::sample(band_um, SETTLED * tolerance, &|um| solve(i, um))?;
        done();
        Ok(spectrum)
    });
    let mut spectra = begun.collect::<Result<Vec<_>>>()?;
    for _ in 0..ROUNDS {
        let asked: Vec<Vec<f64>> = (0..spectra.len())
            .map(|i| unmet(&spectra, i, widths_nm, pitch_nm, tolerance))
            .collect();
        if asked.iter().all(Vec::is_empty) {
            break;
        }
        let resumed = spectra
            .par_iter_mut()
            .zip(asked)
            .enumerate()
            .map(|(i, (spectrum, asked))| {
                if let Some(own) = spectrum
                    && !asked.is_empty()
                    && !own.resume(&asked, &|um| solve(i, um))?
                {
                    *spectrum = None;
                }
                Ok(())
            });
        resumed.collect::<Result<()>>()?;
    }
    let finish = |(i, spectrum)| finished(i, spectrum, band_um, tolerance, &|um| solve(i, um));
    spectra.into_par_iter().enumerate().map(finish).collect()
}

/// Wavelengths (um) at which the column at `i` must be solved because a neighbour has a resonance there and it has none near by.
/// A resonance moves with the width: what one column has, the next has too.
fn unmet(spectra: &[Option<RationalSpectrum>], i: usize, widths_nm: &[f64], pitch_nm: f64, tolerance: f64) -> Vec<f64> {
    let Some(own) = &spectra[i] else { return Vec::new() };
    let mut asked: Vec<f64> = Vec::new();
    for j in [i.wrapping_sub(1), i + 1] {
        let Some(Some(beside)) = spectra.get(j) else { continue };
        let step = (widths_nm[i] - widths_nm[j]).abs() / pitch_nm;
        for there in beside.resonances().iter().filter(|r| r.height > SEEN * tolerance) {
            let shift_um = SHIFT * there.um * step;
            let alike = |r: &Resonance| {
                let apart = (r.um - there.um).abs();
                apart < shift_um + 0.5 * there.half_um && r.half_um < 3.0 * there.half_um + 0.1 * shift_um
            };
            let near = (0.25 * shift_um).max(0.5 * there.half_um);
            let known = own.resonances().iter().any(alike)
                || own.nearest_um(there.um) <= near
                || asked.iter().any(|um| (um - there.um).abs() <= near);
            if !known {
                asked.push(there.um);
            }
        }
    }
    asked
}

/// Column of a spectrum after it was compared with the solver at a wavelength that it was not made from.
fn finished(
    i: usize,
    spectrum: Option<RationalSpectrum>,
    band_um: (f64, f64),
    tolerance: f64,
    solve: &impl Fn(f64) -> Result<Complex64>,
) -> Result<Column> {
    let place = |trial: usize| {
        let share = (GOLDEN * (1 + i * TRIALS + trial) as f64).fract();
        band_um.0 + (band_um.1 - band_um.0) * share
    };
    let mut solved = 0;
    let mut first = None;
    if let Some(mut spectrum) = spectrum {
        for um in (0..TRIALS).map(place) {
            let error = (spectrum.at(um) - solve(um)?).norm();
            let held_out = *first.get_or_insert(error);
            if error <= SEEN * tolerance {
                return Ok(Column {
                    solved: spectrum.solved() as u32 + 1,
                    between: Between::Rational(spectrum.into_function()),
                    held_out,
                });
            }
            if !spectrum.resume(&[um], solve)? {
                break;
            }
        }
        solved = spectrum.solved();
    }
    let spectrum = WidthSpectrum::sample(band_um, tolerance, solve)?;
    let held_out = match first {
        Some(error) => error,
        None => (spectrum.at(place(0)) - solve(place(0))?).norm(),
    };
    Ok(Column {
        solved: (solved + spectrum.t.len()) as u32,
        between: Between::Cubic(spectrum),
        held_out,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Resonance at a wavelength (um), so wide (um), on a slow phase.
    fn resonant(um: f64, at_um: f64, half_um: f64) -> Complex64 {
        let detuning = (um - at_um) / half_um;
        Complex64::cis(20.0 / um) * (detuning / Complex64::new(detuning, 1.0))
    }

    const BAND_UM: (f64, f64) = (0.4, 0.7);
    const TOLERANCE: f64 = 0.01;

    /// A resonance from 0.02 to 1 nm wide that moves by 1.3 nm for each nanometre of width is found in all columns.
    #[test]
    fn a_narrow_resonance_is_followed_through_the_columns() {
        for half_um in [1e-3, 2e-4, 6e-5] {
            let widths_nm: Vec<f64> = (150..210).map(f64::from).collect();
            let at_um = |i: usize| 0.3 + 1.3e-3 * widths_nm[i];
            let solve = |i: usize, um: f64| Ok(resonant(um, at_um(i), half_um));
            let columns = columns(&widths_nm, 350.0, BAND_UM, TOLERANCE, &solve, &|| ()).unwrap();
            let mut worst: f64 = 0.0;
            for (i, column) in columns.iter().enumerate() {
                assert!(matches!(column.between, Between::Rational(_)) && column.solved < 60);
                for k in -40..=40 {
                    let um = at_um(i) + 0.1 * f64::from(k) * half_um;
                    worst = worst.max((column.at(um) - resonant(um, at_um(i), half_um)).norm());
                }
            }
            assert!(worst < SEEN * TOLERANCE, "{half_um} {worst}");
        }
    }

    /// Cubics stand in for a function with a kink, with their error.
    #[test]
    fn a_kink_has_cubics() {
        let solve = |_: usize, um: f64| Ok(Complex64::from((200.0 * um).sin().abs()));
        let columns = columns(&[100.0], 350.0, BAND_UM, TOLERANCE, &solve, &|| ()).unwrap();
        let Between::Cubic(spectrum) = &columns[0].between else {
            panic!("{columns:?}")
        };
        assert!(columns[0].solved as usize >= spectrum.t.len());
    }
}
