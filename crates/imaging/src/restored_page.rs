//! The page of pictures that were restored from a recorded frame: nobody knows the scene.

use metalith_core::{FolderLock, Result, srgb};
use metalith_report::{Page, PhotoRow, fixed, write_json};
use metalith_restoration::RestorationMethod;
use metalith_sensor::Camera;
use ndarray::Array3;
use serde::Serialize;

use crate::exposure::Frame;
use crate::files::{picture_file, write_restored};
use crate::page::{list_assumptions, shown, shown_words};
use crate::report::FrameStatement;

/// Numbers of the page of a restored frame.
#[derive(Clone, Debug, Serialize)]
pub struct RestoredReport {
    /// Name of the file of the frame.
    pub frame: String,
    #[serde(flatten)]
    pub of_frame: FrameStatement,
    pub pictures: Vec<RestoredPicture>,
}

/// One way of restoring, and its file.
#[derive(Clone, Debug, Serialize)]
pub struct RestoredPicture {
    pub method: String,
    /// True if by all elements at once; false for each alone.
    pub joint: bool,
    /// Name of the file of the picture, 16 bits in sRGB.
    pub picture: String,
}

impl RestoredPicture {
    /// Picture of a method.
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

    /// Write the page, its numbers and all pictures, linear sRGB in the order of the report, into the folder of a turn.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write(&self, frame: &Frame, pictures: &[Array3<f64>], camera: &Camera, turn: &FolderLock) -> Result<()> {
        turn.publish("restored", &[], |folder| {
            for (restored, picture) in self.pictures.iter().zip(pictures) {
                write_restored(&folder.join(&restored.picture), picture)?;
            }
            write_json(&folder.join("restored.json"), "restored", self)?;
            self.page(frame, pictures, camera).write(&folder.join(Self::PAGE))
        })
    }

    fn page(&self, frame: &Frame, pictures: &[Array3<f64>], camera: &Camera) -> Page {
        let of = &self.of_frame;
        let mut page = Page::new(
            format!("The picture of {}", self.frame),
            format!("recorded by {} behind {}, {}", of.camera, of.design, of.layout),
        );
        for note in &of.notes {
            page.note(note);
        }
        let names = camera.channel_names();
        let mut row = PhotoRow::new("Frame and pictures", 380.0);
        row.photo("frame as recorded", &shown(frame, &names));
        for (restored, picture) in self.pictures.iter().zip(pictures) {
            let way = if restored.joint { "" } else { ", each element alone" };
            row.photo(format!("{}{way}", restored.method), &picture.mapv(srgb::encoded));
        }
        page.figure(row.caption(format!(
            "The frame is the recorded signal of the sensor. {} Pictures are restored from this frame alone. Their brightness is that of the light on the page; in a frame from a bench `white` in [exposure] of the camera sets it.",
            shown_words(frame, &names)
        )));
        page.facts(&[
            ("Pixels at full scale", of.saturated_words()),
            ("Mean signal, of full scale", fixed(frame.mean_signal(), 3)),
            ("Error of the operator of the restoration", of.error_words()),
            ("Light and exposure", of.light.words()),
            ("Electrons of a white pixel", of.light.each(|w| Some(w.electrons), 0)),
        ]);
        list_assumptions(&mut page, &of.assumptions);
        page
    }
}
