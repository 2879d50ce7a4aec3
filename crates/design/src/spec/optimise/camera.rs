//! `[optimise.camera]`: which whole cameras `metalith optimise` tries.

use serde::Serialize;

use crate::spec::lens::FOCAL_LENGTH;
use metalith_core::document::{Limits, Section};

/// Cameras that are tried, and the light in which they are judged.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraSearchSpec {
    /// Angle from the left to the right edge of a scene (degrees), and the pixels between them.
    pub field_deg: f64,
    pub scene_pixels: usize,
    /// Illuminances of the scene (lux); the best camera is found for each.
    pub illuminance_lux: Vec<f64>,
    /// Longest exposure (s).
    pub longest_s: f64,
    /// Largest distance from the pillar tops to the sensor (um).
    pub most_track_um: f64,
    /// Elements along x and y.
    pub arrangements: Vec<[usize; 2]>,
    /// Distances of the sensor (um); none: for each arrangement the largest at which the images of the elements do not overlap.
    pub focal_lengths_um: Vec<f64>,
    pub diameters_um: Vec<f64>,
    /// Shares of the wedge that steers an element to its part of the field.
    pub wedge_shares: Vec<f64>,
    /// Distances and diameters that are tried.
    pub sizes: CameraSizes,
    /// Phases that each search begins with, at most.
    pub starts: usize,
    /// Steps of a descent while cameras are compared, and of the last one of the best.
    pub steps: usize,
    pub final_steps: usize,
}

/// Distances and diameters that a search tries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraSizes {
    /// Listed sizes alone.
    Listed,
    /// Sizes about the best one too, between the listed ones and beyond.
    Refined,
}

/// Most elements of a camera: the cost grows with their number times that of the frequencies.
const MOST_ELEMENTS: usize = 64;
/// Most cameras of a search.
const MOST_CAMERAS: usize = 500;

impl CameraSearchSpec {
    pub(super) fn read(s: &Section<'_, '_>) -> Self {
        let list = |key: &str, limits: Limits, default: &[f64]| {
            let values = s.floats(key, limits);
            if s.has(key) && values.is_empty() {
                s.fault(key, "an empty list", "give one number or more, or leave the key out");
            }
            if values.is_empty() { default.to_vec() } else { values }
        };
        let whole = |key: &str, range, default: usize| s.integer_or(key, range, "", default as i64) as usize;
        let count = Limits::new(1.0..=20.0, "elements");
        let [columns, rows] = ["columns", "rows"].map(|key| {
            s.must_have(key, "a list of numbers of elements");
            list(key, count.clone(), &[])
        });
        if columns.len() != rows.len() || columns.iter().chain(&rows).any(|v| v.fract() != 0.0) {
            s.fault_given(
                &["optimise.camera.columns"],
                "rows",
                format!("{} numbers of columns and {} of rows", columns.len(), rows.len()),
                "give one whole number of each for every arrangement",
            );
        }
        let arrangements: Vec<[usize; 2]> = columns
            .iter()
            .zip(&rows)
            .map(|(x, y)| [*x as usize, *y as usize])
            .collect();
        if let Some([x, y]) = arrangements.iter().find(|[x, y]| x * y > MOST_ELEMENTS) {
            s.fault(
                "columns",
                format!("{x} by {y} elements, more than {MOST_ELEMENTS}"),
                "take fewer: the search would take hours",
            );
        }
        // The exact time is `time_ms` in camera files.
        s.renamed("time_ms", "longest_ms");
        s.must_have("diameters_um", "a list of diameters");
        let spec = Self {
            field_deg: s.float("field_deg", Limits::new(1.0..=120.0, "degrees")),
            scene_pixels: whole("scene_pixels", 16..=4096, 400),
            illuminance_lux: list("illuminance_lux", Limits::new(1e-3..=1e6, "lux"), &[500.0]),
            longest_s: s.float_or("longest_ms", Limits::new(1e-3..=1e6, "ms"), 10.0) * 1e-3,
            most_track_um: s.float("most_track_um", FOCAL_LENGTH),
            arrangements,
            focal_lengths_um: list("focal_lengths_um", FOCAL_LENGTH, &[]),
            diameters_um: list("diameters_um", Limits::new(10.0..=5000.0, "um"), &[]),
            wedge_shares: list("wedge_shares", Limits::new(0.0..=1.0, "of the wedge"), &[0.0]),
            sizes: s.choice(
                "sizes",
                &[("listed", CameraSizes::Listed), ("refined", CameraSizes::Refined)],
                Some(CameraSizes::Listed),
            ),
            starts: whole("starts", 1..=4, 2),
            steps: whole("steps", 1..=1000, 15),
            final_steps: whole("final_steps", 1..=1000, 60),
        };
        if let Some(um) = spec.focal_lengths_um.iter().find(|um| **um > spec.most_track_um) {
            s.fault_given(
                &["optimise.camera.most_track_um"],
                "focal_lengths_um",
                format!("{um} um, and the track is at most {} um", spec.most_track_um),
                "leave it out, or raise `most_track_um`",
            );
        }
        let cameras = spec.arrangements.len()
            * spec.focal_lengths_um.len().max(1)
            * spec.diameters_um.len()
            * spec.wedge_shares.len()
            * spec.illuminance_lux.len();
        if cameras > MOST_CAMERAS {
            s.fault(
                "diameters_um",
                format!("{cameras} cameras, more than {MOST_CAMERAS}"),
                "shorten one of the lists",
            );
        }
        s.finish();
        spec
    }
}
