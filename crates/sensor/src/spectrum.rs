//! Curves over wavelength.

use std::path::Path;

use metalith_core::file::read_at_most;
use metalith_core::{Error, Result, csv_rows};
use serde::Serialize;

/// Longest table that is read (bytes): 1 nm steps over all that silicon sees take 10 kB.
const LONGEST: u64 = 1 << 20;

/// Values at rising wavelengths, straight lines between them and zero beyond their ends.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spectrum {
    /// Wavelength (nm) and value.
    samples: Vec<(f64, f64)>,
}

/// Samples of a table of two columns, one in each row. `mistake`: what is wrong with a sample after the place of the one before it.
///
/// # Errors
/// If the file cannot be read, or a row has no two numbers or a mistake.
pub(crate) fn read_samples(
    path: &Path,
    what: &str,
    columns: &str,
    hint: &str,
    mistake: impl Fn(Option<f64>, f64, f64) -> Option<String>,
) -> Result<Vec<(f64, f64)>> {
    let refuse = |line: Option<usize>, what: String| Error::table(path, line, what, hint);
    let bytes = read_at_most(path, LONGEST, what)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut samples: Vec<(f64, f64)> = Vec::new();
    for row in csv_rows(&text, columns, &refuse)? {
        let row = row?;
        let [place, value] = row.numbers()?;
        if let Some(what) = mistake(samples.last().map(|last| last.0), place, value) {
            return Err(row.refused(what));
        }
        samples.push((place, value));
    }
    Ok(samples)
}

impl Spectrum {
    /// Spectrum from samples with rising wavelengths (nm) and values that are not negative; `None` if they are not.
    pub fn new(samples: Vec<(f64, f64)>) -> Option<Self> {
        let rising = samples.is_sorted_by(|a, b| a.0 < b.0);
        let physical = samples
            .iter()
            .all(|(nm, v)| *nm > 0.0 && nm.is_finite() && *v >= 0.0 && v.is_finite());
        let lit = samples.iter().any(|(_, v)| *v > 0.0);
        (samples.len() >= 2 && rising && physical && lit).then_some(Self { samples })
    }

    /// A table with a header `nm,value`, a line for each wavelength, and comments after `#`. Values are at most
    /// `most`.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is not such a sample.
    pub fn read_csv(path: &Path, most: f64) -> Result<Self> {
        let range = if most < f64::MAX {
            format!("from 0 to {most}")
        } else {
            "of 0 or more".to_owned()
        };
        let hint =
            format!("give a header `nm,value` and lines of both, wavelengths rising, values {range}, not all zero");
        let mistake = |last: Option<f64>, nm: f64, value: f64| {
            if nm <= 0.0 || !(0.0..=most).contains(&value) {
                return Some(format!("{nm} nm with {value} cannot be"));
            }
            let falls = last.is_some_and(|last| last >= nm);
            falls.then(|| format!("{nm} nm stands after a wavelength that is not shorter"))
        };
        let samples = read_samples(path, "a curve over wavelength", "nm,value", &hint, mistake)?;
        Self::new(samples)
            .ok_or_else(|| Error::table(path, None, "fewer than two wavelengths, or no light at all", &hint))
    }

    /// Value at a wavelength (nm).
    pub fn at(&self, nm: f64) -> f64 {
        let after = self.samples.partition_point(|(at, _)| *at <= nm);
        let before = after.checked_sub(1).map(|i| self.samples[i]);
        match (before, self.samples.get(after)) {
            (Some((a, low)), Some((b, high))) => low + (high - low) * (nm - a) / (b - a),
            (Some((a, low)), None) if a == nm => low,
            _ => 0.0,
        }
    }

    /// First and last wavelength (nm).
    pub fn ends_nm(&self) -> [f64; 2] {
        [self.samples[0].0, self.samples[self.samples.len() - 1].0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_samples_are_straight_lines_and_beyond_them_is_nothing() {
        let curve = Spectrum::new(vec![(500.0, 0.2), (510.0, 0.6), (600.0, 0.0)]).unwrap();
        let want = [
            (499.9, 0.0),
            (500.0, 0.2),
            (505.0, 0.4),
            (510.0, 0.6),
            (600.0, 0.0),
            (601.0, 0.0),
        ];
        // Rounding of one interpolation.
        assert!(want.iter().all(|(nm, v)| (curve.at(*nm) - v).abs() < 1e-15));
        assert_eq!(curve.ends_nm(), [500.0, 600.0]);
        assert!(Spectrum::new(vec![(500.0, 0.2)]).is_none());
        assert!(Spectrum::new(vec![(510.0, 0.2), (500.0, 0.2)]).is_none());
    }

    #[test]
    fn each_mistake_of_a_table_has_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curve.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Spectrum::read_csv(&path, 1.0)
        };
        for mark in ["", "\u{feff}"] {
            let text = format!("{mark}# source\nnm, value\n500, 0.5\n510,1\n");
            assert_eq!(read(&text).unwrap().at(505.0), 0.75);
        }
        assert!(read("\u{feff}nm,value\r\n500,0.5\r\n510,1\r\n").is_ok());
        for (text, line) in [
            ("wavelength,value\n500,1\n510,1\n", Some(1)),
            ("nm,value\n500,1\n510,1.5\n", Some(3)),
            ("nm,value\n500,1\n510,x\n", Some(3)),
            ("nm,value\n500,1\n490,1\n", Some(3)),
            ("nm,value\n500,nan\n", Some(2)),
            ("nm,value\n500,1\n", None),
            ("nm,value\n500,0\n510,0\n", None),
            ("", None),
        ] {
            match read(text) {
                Err(Error::Table { line: found, .. }) => assert_eq!(found, line, "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
