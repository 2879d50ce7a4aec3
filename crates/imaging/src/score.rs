//! Score of a restored picture: its similarity to its scene.

use metalith_core::srgb::encoded;
use metalith_core::{Error, Result, part};
use metalith_restoration::{psnr_db, ssim_colour};
use ndarray::Array3;
use serde::{Deserialize, Deserializer, Serialize};

use crate::geometry::SceneView;
use crate::scene::{SCORED_SIDES, sides_words};

/// PSNR of pictures that are equal (dB). It stands for infinity, which JSON does not know; rounding in single precision leaves 140.
pub const MOST_DB: f64 = 200.0;

/// A part of the field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Zone {
    Whole,
    Centre,
    Edge,
    Corner,
}

impl Zone {
    /// All of them, as they are listed.
    pub const ALL: [Self; 4] = [Self::Whole, Self::Centre, Self::Edge, Self::Corner];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Whole => "whole",
            Self::Centre => "centre",
            Self::Edge => "edge",
            Self::Corner => "corner",
        }
    }

    /// Rectangles of a picture of this shape: of a division by three along both axes the middle, the four beside it, the
    /// four in the corners.
    pub fn rectangles(self, rows: usize, columns: usize) -> Vec<[std::ops::Range<usize>; 2]> {
        let third = |n: usize, k: usize| k * n / 3..(k + 1) * n / 3;
        let cells: &[(usize, usize)] = match self {
            Self::Whole => return vec![[0..rows, 0..columns]],
            Self::Centre => &[(1, 1)],
            Self::Edge => &[(0, 1), (1, 0), (1, 2), (2, 1)],
            Self::Corner => &[(0, 0), (0, 2), (2, 0), (2, 2)],
        };
        cells
            .iter()
            .map(|(y, x)| [third(rows, *y), third(columns, *x)])
            .collect()
    }
}

/// Scores of one zone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZoneScore {
    pub zone: Zone,
    /// Peak signal to noise ratio of sRGB values (dB), at most [`MOST_DB`].
    #[serde(deserialize_with = "decibels")]
    pub psnr_db: f64,
    /// Peak signal-to-noise ratio of linear light from 0 to 1 (dB), as saved pictures hold it.
    #[serde(deserialize_with = "decibels")]
    pub psnr_linear_db: f64,
    /// Structural similarity of sRGB values, mean over the colours.
    pub ssim: f64,
}

/// PSNR as it was written (dB); files had nothing in place of infinity.
fn decibels<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.map_or(MOST_DB, |db| db.min(MOST_DB)))
}

/// PSNR of a mean squared error (dB).
fn psnr_of(error: f64) -> Result<f64> {
    if error.is_nan() {
        Err(Error::refused(
            "score/not-numbers",
            "the picture has values that are not numbers",
            "look at its frame: where next to no pixel is below full scale nothing can be restored; if that is not so, report this",
        ))
    } else {
        Ok((-10.0 * error.log10()).min(MOST_DB))
    }
}

/// PSNR in words.
pub fn psnr_words(db: f64) -> String {
    if db < MOST_DB {
        format!("{db:.2} dB")
    } else {
        "without an error".into()
    }
}

/// Checks that pictures of a scene can be scored, before they are taken.
///
/// # Errors
/// If it is too small for the zones of the field.
pub fn check_scored(view: &SceneView) -> Result<()> {
    if view.rows.min(view.columns) >= *SCORED_SIDES.start() {
        return Ok(());
    }
    Err(Error::refused(
        "score/too-small",
        format!(
            "a scene of {} x {} pixels is too small for the similarity of its pictures, which is taken in nine parts of it",
            view.columns, view.rows
        ),
        format!("give a scene of {}", sides_words()),
    ))
}

/// Scores of linear sRGB against a truth in linear sRGB, `[row, column, colour]`, in all zones.
///
/// # Errors
/// If the shapes differ, the picture is too small for the window of the similarity, or holds what is no number.
pub fn scores(picture: &Array3<f64>, truth: &Array3<f64>) -> Result<Vec<ZoneScore>> {
    let (rows, columns, colours) = truth.dim();
    if picture.dim() != truth.dim() || colours != 3 {
        return Err(Error::refused(
            "score/sizes-differ",
            format!("the pictures have the shapes {:?} and {:?}", picture.dim(), truth.dim()),
            "give two of one shape, (rows, columns, 3)",
        ));
    }
    let (shown, wanted) = (picture.mapv(encoded), truth.mapv(encoded));
    // Files hold no light below 0 and above 1.
    let [saved, saved_truth] = [picture, truth].map(|p| p.mapv(|v| v.clamp(0.0, 1.0)));
    let score = |zone: Zone| {
        let parts = zone.rectangles(rows, columns);
        let (mut error, mut linear, mut ssim) = (0.0, 0.0, 0.0);
        for [y, x] in &parts {
            let cut = |a: &Array3<f64>| part(a.view(), y.clone(), x.clone()).to_owned();
            let share = 1.0 / parts.len() as f64;
            let mean = |db: f64| 10f64.powf(-0.1 * db) * share;
            error += mean(psnr_db(cut(&shown).view(), cut(&wanted).view())?);
            linear += mean(psnr_db(cut(&saved).view(), cut(&saved_truth).view())?);
            ssim += ssim_colour(cut(&shown).view(), cut(&wanted).view())? * share;
        }
        Ok(ZoneScore {
            zone,
            psnr_db: psnr_of(error)?,
            psnr_linear_db: psnr_of(linear)?,
            ssim,
        })
    };
    Zone::ALL.into_iter().map(score).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zones_tell_where_a_picture_is_wrong() {
        let truth = Array3::from_shape_fn((60, 60, 3), |(y, x, c)| {
            0.3 + 0.2 * ((y * 3 + x * 5 + c) % 7) as f64 / 7.0
        });
        let mut wrong = truth.clone();
        for y in 40..60 {
            for x in 40..60 {
                wrong[[y, x, 1]] += 0.1;
            }
        }
        let found = scores(&wrong, &truth).unwrap();
        let at = |zone: Zone| *found.iter().find(|s| s.zone == zone).unwrap();
        assert_eq!(at(Zone::Centre).psnr_linear_db, MOST_DB);
        // A tenth in one of three colours of one of four corners: 0.01 / 12.
        assert!((at(Zone::Corner).psnr_linear_db + 10.0 * (0.01f64 / 12.0).log10()).abs() < 1e-9);
        assert!(at(Zone::Corner).ssim < at(Zone::Edge).ssim);
        wrong[[3, 3, 0]] = f64::NAN;
        assert_eq!(scores(&wrong, &truth).unwrap_err().id(), "score/not-numbers");
    }

    /// A picture below black and above white is saved as black and white.
    #[test]
    fn light_that_no_file_holds_is_no_error() {
        let truth = Array3::from_shape_fn((40, 40, 3), |(y, _, _)| f64::from(u8::from(y < 20)));
        let found = scores(&truth.mapv(|v| 1.5 * v - 0.2), &truth).unwrap();
        assert!(
            found
                .iter()
                .all(|s| s.psnr_linear_db == MOST_DB && s.psnr_db == MOST_DB)
        );
    }

    /// Scores of equal pictures go through a file, also of one that has nothing in place of infinity.
    #[test]
    fn scores_come_back_from_files() {
        let truth = Array3::from_elem((40, 40, 3), 0.3);
        let equal = scores(&truth, &truth).unwrap();
        let text = serde_json::to_string(&equal).unwrap();
        assert_eq!(serde_json::from_str::<Vec<ZoneScore>>(&text).unwrap(), equal);
        let old = text.replace("200.0", "null");
        assert_ne!(old, text);
        assert_eq!(serde_json::from_str::<Vec<ZoneScore>>(&old).unwrap(), equal);
        assert_eq!(
            (psnr_words(MOST_DB), psnr_words(21.456)),
            ("without an error".into(), "21.46 dB".into())
        );
    }

    #[test]
    fn a_scene_that_is_accepted_can_be_scored() {
        let least = *SCORED_SIDES.start();
        for side in [least - 1, least, least + 1, 64] {
            let view = SceneView {
                rows: side,
                columns: 80,
                field_deg: 60.0,
                distance_um: f64::INFINITY,
            };
            let truth = Array3::from_elem((side, 80, 3), 0.3);
            let accepted = check_scored(&view);
            assert_eq!(accepted.is_ok(), scores(&truth, &truth).is_ok(), "{side}");
            assert_eq!(accepted.is_ok(), side >= least);
        }
    }
}
