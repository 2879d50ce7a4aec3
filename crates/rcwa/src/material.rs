//! Refractive indices: published dispersion formulas with their ranges, constants, tables.

use std::path::Path;
use std::{fmt, fs};

use num_complex::Complex64;
use serde::Serialize;

use metalith_core::{Error, Result};

/// An optical material: complex index n + i k over the wavelength.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Material {
    name: String,
    form: Form,
    /// Added to n at every wavelength.
    offset: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
enum Form {
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
    /// Samples (L [um], n, k) with rising L, joined by monotone cubics.
    Table {
        samples: Vec<[f64; 3]>,
    },
}

/// A named material: name, source, formula.
struct Known {
    name: &'static str,
    source: &'static str,
    form: fn() -> Form,
}

/// What can be named in a design. Each is the published fit, in its published range.
const KNOWN: [Known; 6] = [
    Known {
        name: "sin_luke_2015",
        source: "silicon nitride, LPCVD film: Luke et al., Opt. Lett. 40, 4823 (2015)",
        form: || Form::Sellmeier {
            terms: vec![(3.0249, 0.135_340_6), (40314.0, 1239.842)],
            range_um: (0.310, 5.504),
        },
    },
    Known {
        name: "sin_philipp_1973",
        source: "silicon nitride: Philipp, J. Electrochem. Soc. 120, 295 (1973)",
        form: || Form::Sellmeier {
            terms: vec![(2.8939, 0.139_67)],
            range_um: (0.207, 1.24),
        },
    },
    Known {
        name: "fused_silica_malitson_1965",
        source: "fused silica: Malitson, J. Opt. Soc. Am. 55, 1205 (1965)",
        form: || Form::Sellmeier {
            terms: vec![
                (0.696_166_3, 0.068_404_3),
                (0.407_942_6, 0.116_241_4),
                (0.897_479_4, 9.896_161),
            ],
            range_um: (0.21, 3.71),
        },
    },
    Known {
        name: "alumina_malitson_dodge_1972",
        source: "sapphire, ordinary ray: Malitson and Dodge, J. Opt. Soc. Am. 62, 1405 (1972)",
        form: || Form::Sellmeier {
            terms: vec![
                (1.431_349_3, 0.072_663_1),
                (0.650_547_13, 0.119_324_2),
                (5.341_402_1, 18.028_251),
            ],
            range_um: (0.20, 5.0),
        },
    },
    Known {
        name: "alumina_zhukovsky_2015",
        source: "amorphous alumina film, ALD: Cauchy fit, to 1e-5 in n, of the data of Zhukovsky et al., \
                 Phys. Rev. Lett. 115, 177402 (2015)",
        form: || Form::Cauchy {
            coefficients: vec![1.611_862_08, 5.221_481_2e-3, 5.521_611e-5, 1.888_894e-6],
            range_um: (0.30, 1.0),
        },
    },
    Known {
        name: "air",
        source: "n = 1",
        form: || Form::Constant { n: 1.0, k: 0.0 },
    },
];

/// Longest table of indices that is read [bytes].
const LONGEST_TABLE: u64 = 8 << 20;

impl Material {
    /// A material that can be named in a design.
    ///
    /// # Errors
    /// If there is none of that name; the error lists those there are.
    pub fn named(name: &str) -> Result<Self> {
        let known = KNOWN.iter().find(|k| k.name == name).ok_or_else(|| {
            let names: Vec<_> = KNOWN.iter().map(|k| k.name).collect();
            Error::invalid(
                format!("no material is called \"{name}\""),
                format!(
                    "use one of {}, or the path of a .csv table of n and k",
                    names.join(", ")
                ),
            )
        })?;
        Ok(Self {
            name: name.to_owned(),
            form: (known.form)(),
            offset: 0.0,
        })
    }

    /// The material that a text file names: one of [`Material::named`], or a CSV table whose path counts
    /// from `folder`.
    ///
    /// # Errors
    /// As [`Material::named`] and [`Material::read_csv`].
    pub fn resolve(text: &str, folder: &Path) -> Result<Self> {
        if text.to_ascii_lowercase().ends_with(".csv") {
            Self::read_csv(&folder.join(text))
        } else {
            Self::named(text)
        }
    }

    /// The same index at all wavelengths.
    ///
    /// # Errors
    /// If `n` is not positive or `k` is negative.
    pub fn constant(n: f64, k: f64) -> Result<Self> {
        if !(n.is_finite() && n > 0.0 && k.is_finite() && k >= 0.0) {
            return Err(Error::invalid(
                format!("a material of index {n} + {k} i"),
                "use n > 0 and k >= 0",
            ));
        }
        Ok(Self {
            name: if k == 0.0 {
                format!("n = {n}")
            } else {
                format!("n = {n} + {k} i")
            },
            form: Form::Constant { n, k },
            offset: 0.0,
        })
    }

    /// A table of the index by wavelength: a header with `wavelength_nm` or `wavelength_um`, `n` and, if
    /// wanted, `k`; lines that begin with `#` are skipped. Between its rows a monotone cubic.
    ///
    /// # Errors
    /// If the file cannot be read, is too large, or a row is not what the header says.
    pub fn read_csv(path: &Path) -> Result<Self> {
        let size = fs::metadata(path).map_err(Error::io("read", path))?.len();
        let fault = |line: Option<usize>, what: String| Error::Table {
            path: path.to_owned(),
            line,
            what,
            hint: "give columns wavelength_nm (or wavelength_um), n and, if it absorbs, k, with rising wavelengths"
                .into(),
        };
        if size > LONGEST_TABLE {
            return Err(fault(None, format!("{size} bytes are not a table of indices")));
        }
        let bytes = fs::read(path).map_err(Error::io("read", path))?;
        let text = String::from_utf8_lossy(&bytes);
        let samples = parse_table(&text).map_err(|(line, what)| fault(line, what))?;
        let name = path
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into());
        Ok(Self {
            name,
            form: Form::Table { samples },
            offset: 0.0,
        })
    }

    /// The same material with `offset` added to n.
    #[must_use]
    pub fn shifted(&self, offset: f64) -> Self {
        Self {
            offset: self.offset + offset,
            ..self.clone()
        }
    }

    /// Its name, or that of its file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where its numbers come from, for a report.
    pub fn source(&self) -> &str {
        let known = KNOWN.iter().find(|k| k.name == self.name);
        known.map_or(self.name.as_str(), |k| k.source)
    }

    /// Wavelengths it is known for [um].
    pub fn range_um(&self) -> (f64, f64) {
        match &self.form {
            Form::Constant { .. } => (0.0, f64::INFINITY),
            Form::Sellmeier { range_um, .. } | Form::Cauchy { range_um, .. } => *range_um,
            Form::Table { samples } => (samples[0][0], samples[samples.len() - 1][0]),
        }
    }

    /// Complex index n + i k at a wavelength [um].
    ///
    /// # Errors
    /// If the wavelength is outside [`Material::range_um`].
    pub fn index(&self, wavelength_um: f64) -> Result<Complex64> {
        let (low, high) = self.range_um();
        // Tables in nm and bands in um meet at their ends but for rounding.
        let slack = 1e-9;
        if !(wavelength_um > 0.0 && wavelength_um >= low - slack && wavelength_um <= high + slack) {
            return Err(Error::invalid(
                format!("{self} is known from {low} to {high} um, not at {wavelength_um} um"),
                "choose wavelengths in that range, or another material",
            ));
        }
        let l2 = wavelength_um * wavelength_um;
        let index = match &self.form {
            Form::Constant { n, k } => Complex64::new(*n, *k),
            Form::Sellmeier { terms, .. } => {
                let sum: f64 = terms.iter().map(|(b, c)| b * l2 / (l2 - c * c)).sum();
                Complex64::from((1.0 + sum).sqrt())
            }
            Form::Cauchy { coefficients, .. } => {
                Complex64::from(coefficients.iter().rev().fold(0.0, |sum, a| sum / l2 + a))
            }
            Form::Table { samples } => Complex64::new(
                monotone_cubic(samples, 1, wavelength_um),
                monotone_cubic(samples, 2, wavelength_um).max(0.0),
            ),
        };
        Ok(index + self.offset)
    }
}

impl fmt::Display for Material {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        if self.offset != 0.0 {
            write!(f, " {:+} in n", self.offset)?;
        }
        Ok(())
    }
}

type Fault = (Option<usize>, String);

fn parse_table(text: &str) -> std::result::Result<Vec<[f64; 3]>, Fault> {
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let (number, header) = lines.next().ok_or((None, "the table is empty".to_owned()))?;
    let names: Vec<_> = header.split(',').map(str::trim).collect();
    let column = |name: &str| names.iter().position(|n| *n == name);
    let (wavelength, unit) = match (column("wavelength_nm"), column("wavelength_um")) {
        (Some(at), _) => (at, 1e-3),
        (None, Some(at)) => (at, 1.0),
        (None, None) => return Err((Some(number), format!("no column of wavelengths in \"{header}\""))),
    };
    let n = column("n").ok_or((Some(number), format!("no column n in \"{header}\"")))?;
    let k = column("k");
    let mut samples: Vec<[f64; 3]> = Vec::new();
    for (number, line) in lines {
        let cells: Vec<_> = line.split(',').map(str::trim).collect();
        let value = |at: usize| -> std::result::Result<f64, Fault> {
            let text = cells.get(at).ok_or((Some(number), "a value is missing".to_owned()))?;
            let value: f64 = text
                .parse()
                .map_err(|_| (Some(number), format!("\"{text}\" is not a number")))?;
            if value.is_finite() {
                Ok(value)
            } else {
                Err((Some(number), format!("\"{text}\" is not a finite number")))
            }
        };
        let sample = [value(wavelength)? * unit, value(n)?, k.map_or(Ok(0.0), value)?];
        if sample[0] <= 0.0 || sample[1] <= 0.0 || sample[2] < 0.0 {
            return Err((Some(number), "a wavelength, n or k that is not physical".to_owned()));
        }
        if samples.last().is_some_and(|last| last[0] >= sample[0]) {
            return Err((Some(number), "the wavelengths do not rise".to_owned()));
        }
        samples.push(sample);
    }
    if samples.len() < 2 {
        return Err((None, "fewer than two rows".to_owned()));
    }
    Ok(samples)
}

/// Cubic between samples that does not overshoot them (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5,
/// 300 (1984)): the slope at a sample is a harmonic mean of those beside it.
fn monotone_cubic(samples: &[[f64; 3]], column: usize, x: f64) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Indices as published, to the digits given there.
    const PRINTED: f64 = 2e-4;

    fn index(name: &str, wavelength_um: f64) -> f64 {
        Material::named(name).unwrap().index(wavelength_um).unwrap().re
    }

    #[test]
    fn published_values_at_lines() {
        // Malitson's table at the d and h lines; the others by hand from their formulas.
        for (name, wavelength_um, want) in [
            ("fused_silica_malitson_1965", 0.587_562, 1.458_46),
            ("fused_silica_malitson_1965", 0.404_656, 1.469_62),
            ("sin_luke_2015", 0.6328, 2.0395),
            ("sin_philipp_1973", 0.5876, 2.0167),
            ("alumina_malitson_dodge_1972", 0.5876, 1.7682),
            ("alumina_zhukovsky_2015", 0.500_005, 1.633_752),
        ] {
            let got = index(name, wavelength_um);
            assert!((got - want).abs() < PRINTED, "{name}: {got}");
        }
    }

    #[test]
    fn out_of_range_says_the_range() {
        let error = Material::named("sin_philipp_1973")
            .unwrap()
            .index(1.5)
            .unwrap_err()
            .to_string();
        assert!(error.contains("0.207 to 1.24 um"), "{error}");
        let error = Material::named("glass").unwrap_err().to_string();
        assert!(error.contains("fused_silica_malitson_1965"), "{error}");
        assert!(Material::constant(0.0, 0.0).is_err() && Material::constant(1.5, -0.1).is_err());
    }

    #[test]
    fn tables_pass_through_their_rows_and_follow_a_smooth_curve() {
        let exact = Material::named("sin_luke_2015").unwrap();
        let mut text = "# film\nwavelength_nm,n,k\n".to_owned();
        for nm in (400..=700).step_by(20) {
            text += &format!("{nm},{},0\n", exact.index(f64::from(nm) * 1e-3).unwrap().re);
        }
        let samples = parse_table(&text).unwrap();
        for nm in 400..=700 {
            let wavelength_um = f64::from(nm) * 1e-3;
            let error = monotone_cubic(&samples, 1, wavelength_um) - exact.index(wavelength_um).unwrap().re;
            // One-sided slopes at the ends are what is left of the error.
            assert!(error.abs() < 3e-4, "{nm}: {error}");
        }
    }

    #[test]
    fn bad_tables_name_the_line() {
        for (text, line) in [
            ("", None),
            ("wavelength_nm,k\n", Some(1)),
            ("lambda,n\n", Some(1)),
            ("wavelength_nm,n\n400,2\n400,2\n", Some(3)),
            ("wavelength_nm,n\n400,2\n410,abc\n", Some(3)),
            ("wavelength_nm,n\n400,2\n410\n", Some(3)),
            ("wavelength_nm,n\n400,nan\n", Some(2)),
            ("wavelength_nm,n\n400,2\n", None),
        ] {
            assert_eq!(parse_table(text).unwrap_err().0, line, "{text}");
        }
    }

    #[test]
    fn a_shift_adds_to_n() {
        let film = Material::named("sin_luke_2015").unwrap();
        let shifted = film.shifted(0.02).index(0.5).unwrap() - film.index(0.5).unwrap();
        assert!((shifted.re - 0.02).abs() < 1e-12 && shifted.im == 0.0);
        assert_eq!(film.shifted(-0.01).to_string(), "sin_luke_2015 -0.01 in n");
    }
}
