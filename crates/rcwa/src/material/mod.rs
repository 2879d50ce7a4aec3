//! Refractive indices: published dispersion formulas with their ranges, constants, tables.

mod dispersion;
mod named;
mod table;
mod yaml;

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use num_complex::Complex64;
use serde::Serialize;

use crate::{Error, Result, TableError};
use dispersion::Dispersion;
use named::KNOWN;
use table::TableFault;

/// An optical material: complex index n + i k over the wavelength.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Material {
    name: String,
    form: Dispersion,
    /// Added to n at every wavelength.
    offset: f64,
}

/// Longest table of indices that is read (bytes).
const LONGEST_TABLE: u64 = 8 << 20;

/// Rounding (um) where tables in nm and bands in um meet at their ends.
const ROUNDING: f64 = 1e-9;

/// True if a file is read as YAML of refractiveindex.info.
pub(crate) fn is_yaml(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    ending.is_some_and(|ending| ending == "yml" || ending == "yaml")
}

fn of_csv(text: &str) -> Result<Dispersion, TableFault> {
    Ok(Dispersion::Table {
        samples: table::parse(text)?,
    })
}

impl Material {
    /// A material that can be named in a design.
    ///
    /// # Errors
    /// If there is none of that name; the error lists those there are.
    pub fn named(name: &str) -> Result<Self> {
        let own = Self::own_name(name);
        let known = KNOWN
            .iter()
            .find(|k| own == Some(k.name))
            .ok_or_else(|| Error::UnknownMaterial {
                name: name.to_owned(),
                known: named::nearest_first(name),
            })?;
        Ok(Self {
            name: known.name.to_owned(),
            form: (known.form)(),
            offset: 0.0,
        })
    }

    /// The name here of a material that is called by it or by a formula or word of the field, such as TiO2 or a-Si.
    pub fn own_name(name: &str) -> Option<&'static str> {
        named::own_name(name)
    }

    /// The material that a text file names: one of [`Material::named`], or a table whose path counts from `folder`.
    ///
    /// # Errors
    /// As [`Material::named`] and [`Material::read_file`].
    pub fn resolve(text: &str, folder: &Path) -> Result<Self> {
        if Self::is_table(text) {
            Self::read_file(&folder.join(text))
        } else {
            Self::named(text)
        }
    }

    /// True if a text in a file that names a material means a file: a CSV table, or YAML of refractiveindex.info.
    pub fn is_table(text: &str) -> bool {
        text.to_ascii_lowercase().ends_with(".csv") || is_yaml(Path::new(text))
    }

    /// A material of a file: YAML as refractiveindex.info gives it, by the ending of its name, else [`Material::read_csv`].
    ///
    /// # Errors
    /// If the file cannot be read, is too large, or does not say an index.
    pub fn read_file(path: &Path) -> Result<Self> {
        Self::read_as(path, if is_yaml(path) { yaml::parse } else { of_csv })
    }

    /// Wavelengths (um) of the samples about one between which the index is a guess: they are far apart, and n or k changes much
    /// between them.
    pub fn wide_gap_um(&self, wavelength_um: f64) -> Option<(f64, f64)> {
        /// Gap over the wavelength, and change of n and of k across it.
        const FAR: [f64; 3] = [0.04, 0.05, 0.01];
        let all: Vec<f64> = self.form.samples_um().collect();
        let after = all.partition_point(|um| *um < wavelength_um);
        let (low, high) = (*all.get(after.checked_sub(1)?)?, *all.get(after)?);
        let change = self.form.index(high) - self.form.index(low);
        let is_far = high > wavelength_um
            && high - low > FAR[0] * wavelength_um
            && (change.re.abs() > FAR[1] || change.im.abs() > FAR[2]);
        is_far.then_some((low, high))
    }

    /// Material of one index at all wavelengths.
    ///
    /// # Errors
    /// If `n` is not positive or `k` is negative.
    pub fn constant(n: f64, k: f64) -> Result<Self> {
        if !(n.is_finite() && n > 0.0 && k.is_finite() && k >= 0.0) {
            return Err(Error::MaterialIndex { n, k });
        }
        Ok(Self {
            name: if k == 0.0 {
                format!("n = {n}")
            } else {
                format!("n = {n} + {k} i")
            },
            form: Dispersion::Constant { n, k },
            offset: 0.0,
        })
    }

    /// A table of the index by wavelength: a header with `wavelength_nm` or `wavelength_um`, `n` and, if
    /// wanted, `k`; lines that begin with `#` are skipped. Between its rows a monotone cubic.
    ///
    /// # Errors
    /// If the file cannot be read, is too large, or a row is not what the header says.
    pub fn read_csv(path: &Path) -> Result<Self> {
        Self::read_as(path, of_csv)
    }

    fn read_as(path: &Path, parse: fn(&str) -> Result<Dispersion, TableFault>) -> Result<Self> {
        let fault = |line: Option<usize>, cause: TableError| Error::Table {
            path: path.to_owned(),
            line,
            cause,
        };
        let found = std::fs::metadata(path).map_err(Error::io(path))?;
        if !found.is_file() {
            return Err(fault(None, TableError::NotAFile));
        }
        let bytes = found.len();
        if bytes > LONGEST_TABLE {
            return Err(fault(None, TableError::TooLong { bytes }));
        }
        let mut text = Vec::new();
        File::open(path)
            .and_then(|file| file.take(LONGEST_TABLE).read_to_end(&mut text))
            .map_err(Error::io(path))?;
        let form = parse(&String::from_utf8_lossy(&text)).map_err(|(line, cause)| fault(line, cause))?;
        let name = path
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into());
        Ok(Self {
            name,
            form,
            offset: 0.0,
        })
    }

    /// Copy of the material with `offset` added to n.
    #[must_use]
    pub fn shifted(&self, offset: f64) -> Self {
        Self {
            offset: self.offset + offset,
            ..self.clone()
        }
    }

    /// Name, or that of its file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Source of its numbers, for a report.
    pub fn source(&self) -> &str {
        let known = KNOWN.iter().find(|k| k.name == self.name);
        known.map_or(self.name.as_str(), |k| k.source)
    }

    /// Wavelengths it is known for (um).
    pub fn range_um(&self) -> (f64, f64) {
        self.form.range_um()
    }

    /// Wavelength (um) of its largest absorption in a range (um), as far as it is known there, and its k.
    pub fn most_absorbing(&self, (from_um, to_um): (f64, f64)) -> (f64, f64) {
        let (low, high) = self.range_um();
        let ends = [from_um, to_um].map(|um| um.max(low).min(high));
        let between = self.form.samples_um().filter(|um| *um > ends[0] && *um < ends[1]);
        let all = ends.into_iter().chain(between);
        let k = |um: f64| (um, self.form.index(um).im);
        // The first of equals.
        all.map(k)
            .fold((ends[0], 0.0), |most, own| if own.1 > most.1 { own } else { most })
    }

    /// Complex index n + i k at a wavelength (um).
    ///
    /// # Errors
    /// If the wavelength is outside [`Material::range_um`].
    pub fn index(&self, wavelength_um: f64) -> Result<Complex64> {
        let (low, high) = self.range_um();
        if !(wavelength_um > 0.0 && wavelength_um >= low - ROUNDING && wavelength_um <= high + ROUNDING) {
            return Err(Error::OutOfRange {
                material: self.to_string(),
                from_um: low,
                to_um: high,
                wavelength_um,
            });
        }
        Ok(self.form.index(wavelength_um) + self.offset)
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

#[cfg(test)]
mod tests {
    use super::dispersion::monotone_cubic;
    use super::*;

    /// Indices as published, to the digits given there.
    const PRINTED: f64 = 2e-4;

    /// One-sided slopes at the ends of a table of 20 nm steps are what is left of the error of its cubics.
    const CUBIC: f64 = 3e-4;

    /// Rounding of one sum near 2.
    const ROUNDED: f64 = 1e-12;

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
            ("a_si_pierce_1972", 1.550, 3.48),
            ("c_si_salzberg_1957", 10.6, 3.4175),
            ("tio2_siefke_2016", 0.533_748, 2.448_51),
            ("tio2_rutile_devore_1951", 0.5893, 2.613),
            ("gan_barker_1973", 0.6, 2.394_8),
            ("nb2o5_lemarchand_2013", 0.55, 2.360_3),
            ("sin_poor_vogt_2015", 0.64, 1.904),
            ("sin_rich_vogt_2015", 0.64, 2.131),
        ] {
            let got = index(name, wavelength_um);
            assert!((got - want).abs() < PRINTED, "{name}: {got}");
        }
    }

    #[test]
    fn out_of_range_says_the_range() {
        let error = Material::named("sin_philipp_1973").unwrap().index(1.5).unwrap_err();
        assert_eq!(error.id(), "rcwa/material-out-of-range");
        insta::assert_snapshot!(error, @"sin_philipp_1973 is known from 207 to 1240 nm, not at 1500 nm");
        match Material::named("glass").unwrap_err() {
            Error::UnknownMaterial { name, known } => {
                assert!(
                    name == "glass" && known.contains(&"fused_silica_malitson_1965"),
                    "{known:?}"
                );
            }
            other => panic!("{other:?}"),
        }
        assert!(Material::constant(0.0, 0.0).is_err() && Material::constant(1.5, -0.1).is_err());
    }

    #[test]
    fn tables_pass_through_their_rows_and_follow_a_smooth_curve() {
        let exact = Material::named("sin_luke_2015").unwrap();
        let mut text = "# film\nwavelength_nm,n,k\n".to_owned();
        for nm in (400..=700).step_by(20) {
            text += &format!("{nm},{},0\n", exact.index(f64::from(nm) * 1e-3).unwrap().re);
        }
        let samples = table::parse(&text).unwrap();
        for nm in 400..=700 {
            let wavelength_um = f64::from(nm) * 1e-3;
            let error = monotone_cubic(&samples, 1, wavelength_um) - exact.index(wavelength_um).unwrap().re;
            assert!(error.abs() < CUBIC, "{nm}: {error}");
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
            assert_eq!(table::parse(text).unwrap_err().0, line, "{text}");
        }
    }

    #[test]
    fn most_loss_is_found_between_two_wavelengths() {
        let text = "wavelength_um,n,k\n0.4,2,0.3\n0.5,2,0.01\n0.6,2,0.04\n0.7,2,0\n";
        let film = Material {
            name: "film".into(),
            form: Dispersion::Table {
                samples: table::parse(text).unwrap(),
            },
            offset: 0.0,
        };
        assert_eq!(film.most_absorbing((0.2, 0.9)), (0.4, 0.3));
        assert_eq!(film.most_absorbing((0.5, 0.9)), (0.6, 0.04));
        let (at_um, k) = film.most_absorbing((0.62, 0.65));
        assert!(at_um == 0.62 && k > 0.03 && k < 0.04, "{k}");
        let clear = Material::named("sin_luke_2015").unwrap();
        assert_eq!(clear.most_absorbing((0.4, 0.7)), (0.4, 0.0));
        assert_eq!(
            Material::constant(1.5, 0.2).unwrap().most_absorbing((0.5, 0.6)),
            (0.5, 0.2)
        );
    }

    /// Formulas and words of the field are names, and what is no name is answered with the nearest first.
    #[test]
    fn names_of_the_field_are_understood() {
        for (name, own) in [
            ("TiO2", "tio2_siefke_2016"),
            ("SiO2", "fused_silica_malitson_1965"),
            ("a-Si", "a_si_pierce_1972"),
            ("Si3N4", "sin_luke_2015"),
            ("GaN", "gan_barker_1973"),
            ("sin_rich_vogt_2015", "sin_rich_vogt_2015"),
        ] {
            assert_eq!(Material::named(name).unwrap().name(), own, "{name}");
        }
        let remedy = Material::named("TiO2 film").unwrap_err().remedy();
        assert!(remedy.starts_with("use one of tio2"), "{remedy}");
        assert!(Material::is_table("Film.YML") && Material::is_table("a.csv") && !Material::is_table("tio2"));
    }

    /// k of amorphous silicon ends between two samples that are far apart.
    #[test]
    fn wide_gaps_are_found() {
        let film = Material::named("a-si").unwrap();
        assert_eq!(film.wide_gap_um(0.94), Some((0.8856, 0.9538)));
        assert_eq!(film.wide_gap_um(1.55), None);
        assert_eq!(Material::named("sio2").unwrap().wide_gap_um(0.94), None);
    }

    #[test]
    fn a_shift_adds_to_n() {
        let film = Material::named("sin_luke_2015").unwrap();
        let shifted = film.shifted(0.02).index(0.5).unwrap() - film.index(0.5).unwrap();
        assert!((shifted.re - 0.02).abs() < ROUNDED && shifted.im == 0.0);
        assert_eq!(film.shifted(-0.01).to_string(), "sin_luke_2015 -0.01 in n");
    }
}
