//! A measured set: its text and its captures.

use std::fs;
use std::path::{Path, PathBuf};

use metalith::Silent;
use metalith::calibrate::MeasuredSet;
use metalith::gds::extract::PillarsAt;
use metalith_testing::session::{PIXELS, small_set};

use super::{Format, Kind};
use crate::images;

/// A measured set: its text and its captures.
pub(super) fn all(folder: &Path) -> Vec<Format> {
    let set = small_set(folder);
    let text = fs::read_to_string(&set).unwrap();
    // One capture in each of the formats that frames come in; the rest of the set stays as it is.
    let first = text
        .split("file = \"")
        .nth(1)
        .and_then(|t| t.split('"').next())
        .unwrap()
        .to_owned();
    let with = |ending: &str| {
        let own = folder.join(format!("with_{ending}.toml"));
        fs::write(&own, text.replacen(&first, &format!("frame.{ending}"), 1)).unwrap();
        own
    };
    let reads = |set: PathBuf| move |_: &Path| MeasuredSet::read(&set, &PillarsAt::STATED, &Silent);
    let size = PIXELS as u32;
    vec![
        Format::new(
            "measured_set",
            folder.join("mutant.toml"),
            Kind::Text,
            vec![text.clone().into()],
            |path| MeasuredSet::read(path, &PillarsAt::STATED, &Silent),
        ),
        Format::new(
            "capture_npy",
            folder.join("frame.npy"),
            Kind::Bytes,
            vec![
                images::npy(&[PIXELS, PIXELS], images::FLOAT),
                images::npy(&[3, PIXELS, PIXELS], images::WORD),
            ],
            reads(with("npy")),
        ),
        Format::new(
            "capture_png",
            folder.join("frame.png"),
            Kind::Bytes,
            [png::BitDepth::Eight, png::BitDepth::Sixteen]
                .map(|depth| images::png(size, size, png::ColorType::Grayscale, depth))
                .into(),
            reads(with("png")),
        ),
        Format::new(
            "capture_tiff",
            folder.join("frame.tiff"),
            Kind::Bytes,
            vec![images::tiff(PIXELS, 1), images::tiff(PIXELS, 3)],
            reads(with("tiff")),
        ),
        Format::new(
            "capture_fits",
            folder.join("frame.fits"),
            Kind::Bytes,
            vec![images::fits(PIXELS)],
            reads(with("fits")),
        ),
    ]
}
