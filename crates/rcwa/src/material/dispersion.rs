//! The index over the wavelength: dispersion formulas and tables.

use num_complex::Complex64;
use serde::Serialize;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) enum Dispersion {
    Constant {
        n: f64,
        k: f64,
    },
    /// n^2 = 1 + sum of b L^2 / (L^2 - c^2), L in um; pairs (b, c).
    Sellmeier {
        terms: Vec<(f64, f64)>,
        range_um: (f64, f64),
    },
    /// n = sum of a_i L^(-2 i), L in um.
    Cauchy {
        coefficients: Vec<f64>,
        range_um: (f64, f64),
    },
    /// Samples (L (um), n, k) with rising L, joined by monotone cubics.
    Table {
        samples: Vec<[f64; 3]>,
    },
    /// n and k of their own, k as samples (L (um), k, 0).
    Parts {
        n: IndexOver,
        k: Option<Vec<[f64; 3]>>,
    },
}

/// The real index over the wavelength.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) enum IndexOver {
    /// Samples (L (um), n, 0) with rising L, joined by monotone cubics.
    Samples(Vec<[f64; 3]>),
    /// A formula of the refractiveindex.info database by its number, L in um.
    Formula {
        number: u8,
        coefficients: Vec<f64>,
        range_um: (f64, f64),
    },
}

fn ends(samples: &[[f64; 3]]) -> (f64, f64) {
    (samples[0][0], samples[samples.len() - 1][0])
}

impl IndexOver {
    fn range_um(&self) -> (f64, f64) {
        match self {
            Self::Samples(samples) => ends(samples),
            Self::Formula { range_um, .. } => *range_um,
        }
    }

    /// Index at a wavelength (um).
    fn at(&self, um: f64) -> f64 {
        let (number, c) = match self {
            Self::Samples(samples) => return monotone_cubic(samples, 1, um),
            Self::Formula {
                number, coefficients, ..
            } => (*number, coefficients.as_slice()),
        };
        let l2 = um * um;
        let pairs = |from: usize| c[from.min(c.len())..].as_chunks::<2>().0.iter();
        let powers = |from: usize| pairs(from).map(|[a, b]| a * um.powf(*b)).sum::<f64>();
        // Coefficients that a file leaves out are zero, and a term without a coefficient has no pole.
        let term = |coefficient: f64, of: f64| if coefficient == 0.0 { 0.0 } else { coefficient * of };
        match number {
            1 => (1.0 + c[0] + pairs(1).map(|[a, b]| a * l2 / (l2 - b * b)).sum::<f64>()).sqrt(),
            2 => (1.0 + c[0] + pairs(1).map(|[a, b]| a * l2 / (l2 - b)).sum::<f64>()).sqrt(),
            3 => (c[0] + powers(1)).sqrt(),
            4 => {
                let pole = |k: usize| term(c[k], um.powf(c[k + 1]) / (l2 - c[k + 2].powf(c[k + 3])));
                (c[0] + pole(1) + pole(5) + powers(9)).sqrt()
            }
            5 => c[0] + powers(1),
            6 => 1.0 + c[0] + pairs(1).map(|[a, b]| a / (b - 1.0 / l2)).sum::<f64>(),
            7 => {
                let pole = 1.0 / (l2 - 0.028);
                c[0] + c[1] * pole + c[2] * pole * pole + l2 * (c[3] + l2 * (c[4] + l2 * c[5]))
            }
            8 => {
                let share = c[0] + term(c[1], l2 / (l2 - c[2])) + c[3] * l2;
                ((1.0 + 2.0 * share) / (1.0 - share)).sqrt()
            }
            _ => {
                let off = um - c[4];
                (c[0] + term(c[1], (l2 - c[2]).recip()) + term(c[3], off / (off * off + c[5]))).sqrt()
            }
        }
    }
}

impl Dispersion {
    /// Wavelengths it is known for (um).
    pub(crate) fn range_um(&self) -> (f64, f64) {
        match self {
            Self::Constant { .. } => (0.0, f64::INFINITY),
            Self::Sellmeier { range_um, .. } | Self::Cauchy { range_um, .. } => *range_um,
            Self::Table { samples } => ends(samples),
            Self::Parts { n, k } => {
                let (low, high) = n.range_um();
                let of_k = k.as_ref().map_or((low, high), |k| ends(k));
                (low.max(of_k.0), high.min(of_k.1))
            }
        }
    }

    /// Wavelengths of its samples (um), rising: from one to the next n and k stay between their values there.
    pub(crate) fn samples_um(&self) -> impl Iterator<Item = f64> + '_ {
        let samples: &[[f64; 3]] = match self {
            Self::Table { samples } | Self::Parts { k: Some(samples), .. } => samples,
            Self::Parts {
                n: IndexOver::Samples(samples),
                k: None,
            } => samples,
            Self::Parts { .. } | Self::Constant { .. } | Self::Sellmeier { .. } | Self::Cauchy { .. } => &[],
        };
        samples.iter().map(|sample| sample[0])
    }

    /// Complex index n + i k at a wavelength (um) in that range.
    pub(crate) fn index(&self, wavelength_um: f64) -> Complex64 {
        let l2 = wavelength_um * wavelength_um;
        match self {
            Self::Constant { n, k } => Complex64::new(*n, *k),
            Self::Sellmeier { terms, .. } => {
                let sum: f64 = terms.iter().map(|(b, c)| b * l2 / (l2 - c * c)).sum();
                Complex64::from((1.0 + sum).sqrt())
            }
            Self::Cauchy { coefficients, .. } => {
                Complex64::from(coefficients.iter().rev().fold(0.0, |sum, a| sum / l2 + a))
            }
            Self::Table { samples } => Complex64::new(
                monotone_cubic(samples, 1, wavelength_um),
                monotone_cubic(samples, 2, wavelength_um).max(0.0),
            ),
            Self::Parts { n, k } => Complex64::new(
                n.at(wavelength_um),
                k.as_ref().map_or(0.0, |k| monotone_cubic(k, 1, wavelength_um).max(0.0)),
            ),
        }
    }
}

/// Cubic between samples that does not overshoot them (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5,
/// 300 (1984)): the slope at a sample is a harmonic mean of those beside it.
pub(super) fn monotone_cubic(samples: &[[f64; 3]], column: usize, x: f64) -> f64 {
    let last = samples.len() - 1;
    let i = samples.partition_point(|s| s[0] <= x).clamp(1, last) - 1;
    let step = |j: usize| samples[j + 1][0] - samples[j][0];
    let secant = |j: usize| (samples[j + 1][column] - samples[j][column]) / step(j);
    let slope = |j: usize| -> f64 {
        if j == 0 {
            return secant(0);
        }
        if j == last {
            return secant(last - 1);
        }
        let (a, b) = (secant(j - 1), secant(j));
        if a * b <= 0.0 {
            return 0.0;
        }
        let (wa, wb) = (2.0 * step(j) + step(j - 1), step(j) + 2.0 * step(j - 1));
        (wa + wb) / (wa / a + wb / b)
    };
    let h = step(i);
    let u = ((x - samples[i][0]) / h).clamp(0.0, 1.0);
    let (y0, y1, d0, d1) = (
        samples[i][column],
        samples[i + 1][column],
        slope(i) * h,
        slope(i + 1) * h,
    );
    let v = 1.0 - u;
    y0 * v * v * (1.0 + 2.0 * u) + y1 * u * u * (3.0 - 2.0 * u) + d0 * u * v * v - d1 * u * u * v
}
