//! The page of pictures that were restored from a recorded frame: nobody knows the scene.

use std::path::Path;

use metalith_camera::Camera;
use metalith_core::{Result, srgb};
use metalith_made::ModelStatement;
use metalith_report::{Page, PhotoRow, fixed, write_json};
use ndarray::Array3;
use serde::Serialize;

use crate::exposure::Frame;
use crate::files::{picture_file, write_restored};
use crate::page::{list_assumptions, shown};
use crate::report::Assumption;
use crate::restore::RestorationMethod;

/// What the page of a restored frame says, in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct RestoredReport {
    pub design: String,
    pub layout: String,
    pub camera: String,
    /// Name of the file of the frame.
    pub frame: String,
    pub field_deg: f64,
    /// Distance of the scene (mm); none for one that is far.
    pub distance_mm: Option<f64>,
    pub saturated: usize,
    /// The same as a share of all pixels.
    pub saturated_share: f64,
    /// The calibrated model that the chip is made by, if one was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelStatement>,
    /// What is to be known before anything else.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    pub pictures: Vec<RestoredPicture>,
    /// What the operator of the restoration errs by, by channel; see [`crate::Rehearsal::operator_error`].
    pub operator_error: Vec<f64>,
    pub assumptions: Vec<Assumption>,
}

/// One way of restoring, and its file.
#[derive(Clone, Debug, Serialize)]
pub struct RestoredPicture {
    pub method: String,
    /// By all elements at once, or each alone.
    pub joint: bool,
    /// Name of the file of the picture, 16 bits in sRGB.
    pub picture: String,
}

impl RestoredPicture {
    /// Of a method.
    pub fn new(method: RestorationMethod, joint: bool) -> Self {
        Self {
            method: method.name().to_owned(),
            joint,
            picture: picture_file(method, joint),
        }
    }
}

impl RestoredReport {
    /// Name of its page.
    pub const PAGE: &str = "restored.html";

    /// Write the page, its numbers and all pictures, linear sRGB in the order of the report, into a folder.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write(&self, frame: &Frame, pictures: &[Array3<f64>], camera: &Camera, folder: &Path) -> Result<()> {
        for (restored, picture) in self.pictures.iter().zip(pictures) {
            write_restored(&folder.join(&restored.picture), picture)?;
        }
        write_json(&folder.join("restored.json"), "restored", self)?;
        self.page(frame, pictures, camera).write(&folder.join(Self::PAGE))
    }

    fn page(&self, frame: &Frame, pictures: &[Array3<f64>], camera: &Camera) -> Page {
        let mut page = Page::new(
            format!("The picture of {}", self.frame),
            format!("recorded by {} behind {}, {}", self.camera, self.design, self.layout),
        );
        for note in &self.notes {
            page.note(note);
        }
        let names = camera.channel_names();
        let mut row = PhotoRow::new("Frame and pictures", 380.0);
        row.photo("frame as recorded", &shown(frame, &names));
        for (restored, picture) in self.pictures.iter().zip(pictures) {
            let way = if restored.joint { "" } else { ", each element alone" };
            row.photo(format!("{}{way}", restored.method), &picture.mapv(srgb::encoded));
        }
        page.figure(row.caption(
            "The mosaic of the frame is shown as colours. Pictures are restored from this frame alone; how bright they are follows from `white` in [exposure] of the camera.",
        ));
        let errors: Vec<String> = self
            .operator_error
            .iter()
            .map(|e| format!("{} %", fixed(100.0 * e, 2)))
            .collect();
        page.facts(&[
            (
                "Pixels at full scale",
                format!("{} ({} %)", self.saturated, fixed(100.0 * self.saturated_share, 1)),
            ),
            ("Mean signal, of full scale", fixed(frame.mean_signal(), 3)),
            ("The operator of the restoration errs by", errors.join(", ")),
        ]);
        list_assumptions(&mut page, &self.assumptions);
        page
    }
}
