//! Light on its way into pixels: their response by angle, and walls between the elements of an array.

use std::path::Path;

use metalith_core::{Error, Result};
use serde::Serialize;

use crate::spectrum::read_samples;

/// Largest response: microlenses of some sensors favour a small angle.
const MOST: f64 = 2.0;

/// Response of pixels to light at an angle, over that at normal incidence. Microlenses, walls of metal and crosstalk below
/// the colour filters decide it; quantum efficiencies are stated at normal incidence.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AngularResponse {
    /// Not stated by the camera file: light counts alike at every angle, which is a guess.
    #[default]
    Unstated,
    /// Angles from the normal of the sensor (degrees), rising from zero, and response; straight lines between them.
    Table(Vec<(f64, f64)>),
}

impl AngularResponse {
    /// A table with a header `deg,value`, a line for each angle, and comments after `#`. The first angle is 0, with the value 1.
    ///
    /// # Errors
    /// If the file cannot be read, or a line is not such a sample.
    pub fn read_csv(path: &Path) -> Result<Self> {
        let hint = format!(
            "give a header `deg,value` and lines of both, angles rising from 0 to at most 90, values from 0 to {MOST} and 1 at 0 degrees"
        );
        let mistake = |last: Option<f64>, deg: f64, value: f64| {
            if !(0.0..=90.0).contains(&deg) {
                return Some(format!("an angle of {deg} degrees, where 0 to 90 can be"));
            }
            if !(0.0..=MOST).contains(&value) {
                return Some(format!("a response of {value}, where 0 to {MOST} can be"));
            }
            match last {
                None if deg != 0.0 || value != 1.0 => {
                    Some(format!("{deg} degrees with {value}, where 0 degrees with 1 should be"))
                }
                Some(last) if last >= deg => Some(format!("{deg} degrees stands after an angle that is not smaller")),
                _ => None,
            }
        };
        let samples = read_samples(path, "a response by angle", "deg,value", &hint, mistake)?;
        if samples.len() < 2 {
            return Err(Error::table(path, None, "fewer than two angles", &hint));
        }
        Ok(Self::Table(samples))
    }

    /// Response to light at an angle whose cosine is this; beyond the last angle of a table, that of the last.
    pub fn at_cosine(&self, cosine: f64) -> f64 {
        let Self::Table(samples) = self else { return 1.0 };
        let deg = cosine.clamp(0.0, 1.0).acos().to_degrees();
        let after = samples.partition_point(|(at, _)| *at <= deg);
        let (a, low) = samples[after.max(1) - 1];
        match samples.get(after) {
            Some((b, high)) => low + (high - low) * (deg - a) / (b - a),
            None => low,
        }
    }

    /// Last angle of the table (degrees); none where nothing is stated.
    pub fn last_deg(&self) -> Option<f64> {
        match self {
            Self::Unstated => None,
            Self::Table(samples) => samples.last().map(|(deg, _)| *deg),
        }
    }

    /// Test by which serde leaves the key out where nothing is stated.
    pub(crate) fn is_unstated(&self) -> bool {
        *self == Self::Unstated
    }
}

/// Opaque walls between the elements of an array.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Walls {
    /// No walls: light of an element may land anywhere.
    #[default]
    None,
    /// Thin walls from the chip to the sensor, halfway between elements: pixels receive light of the nearest element alone.
    BetweenElements,
}

impl Walls {
    /// Test by which serde leaves the key out where there are none.
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
    pub(crate) fn are_none(&self) -> bool {
        *self == Self::None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn responses_are_straight_lines_between_angles_and_level_beyond_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("angles.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            AngularResponse::read_csv(&path)
        };
        let table = read("# source\ndeg,value\n0,1\n20,0.9\n40,0.5\n").unwrap();
        // Rounding of an inverse cosine.
        const ROUNDING: f64 = 1e-12;
        for (deg, want) in [
            (0.0f64, 1.0),
            (10.0, 0.95),
            (20.0, 0.9),
            (30.0, 0.7),
            (40.0, 0.5),
            (70.0, 0.5),
        ] {
            let found = table.at_cosine(deg.to_radians().cos());
            assert!((found - want).abs() < ROUNDING, "{deg}: {found}");
            assert_eq!(AngularResponse::Unstated.at_cosine(deg.to_radians().cos()), 1.0);
        }
        assert_eq!(
            [table.last_deg(), AngularResponse::Unstated.last_deg()],
            [Some(40.0), None]
        );
        for (text, line) in [
            ("nm,value\n0,1\n10,1\n", Some(1)),
            ("deg,value\n5,1\n10,1\n", Some(2)),
            ("deg,value\n0,0.9\n10,1\n", Some(2)),
            ("deg,value\n0,1\n10,3\n", Some(3)),
            ("deg,value\n0,1\n95,0.1\n", Some(3)),
            ("deg,value\n0,1\n20,1\n10,1\n", Some(4)),
            ("deg,value\n0,1\n", None),
        ] {
            match read(text) {
                Err(Error::Table { line: found, .. }) => assert_eq!(found, line, "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
