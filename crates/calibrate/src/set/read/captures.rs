//! The measurements of a set: captures, and widths by SEM.

use crate::set::frame::SensorFrames;
use crate::set::{
    Capture, ElementIndex, Led, LedIndex, MeasuredElement, PerElement, PerLed, RelayCamera, SemSite, frame, sem,
};
use metalith_core::document::{Limits, Section};

pub(super) fn captures(
    root: &Section<'_, '_>,
    camera: &RelayCamera,
    sensor: &SensorFrames,
    leds: &PerLed<Led>,
    elements: &PerElement<MeasuredElement>,
) -> Vec<Capture> {
    let mut captures = Vec::new();
    for s in root.sections("capture") {
        let path = s.file("file");
        let index = s
            .array::<2>("element", Limits::new(-1000.0..=1000.0, ""))
            .map(|v| v as i64);
        let known = elements.iter_enumerated().find(|(_, e)| e.index == index);
        let element = known.map(|(e, _)| e).unwrap_or_else(|| {
            s.fault(
                "element",
                format!("no [[element]] has the index {index:?}"),
                "add it, or correct the index",
            );
            ElementIndex::from(0)
        });
        let led_nm = s.float("led_nm", Limits::new(200.0..=3000.0, "nm"));
        let known = leds.iter_enumerated().find(|(_, l)| l.centre_nm == led_nm);
        let led = known.map(|(l, _)| l).unwrap_or_else(|| {
            s.fault(
                "led_nm",
                format!("no [[led]] has its centre at {led_nm} nm"),
                "add it, or correct the wavelength",
            );
            LedIndex::from(0)
        });
        let aoi_deg: [f64; 2] = s.array("aoi_deg", Limits::new(-80.0..=80.0, "degrees"));
        let distance_um = s.float("distance_um", Limits::new(1.0..=100_000.0, "um"));
        let window_centre_um = s.array("window_centre_um", Limits::new(-10_000.0..=10_000.0, "um"));
        let scale_dn = s.float("scale_dn", Limits::new(f64::MIN_POSITIVE..=1e12, "DN"));
        let frames = s.integer("frames", 1..=1_000_000, "frames") as u32;
        s.finish();
        let dn = match frame::read(&path, camera.rows, camera.cols) {
            Ok(mut dn) => {
                sensor.take_out(&mut dn, camera);
                dn
            }
            Err(what) => {
                // A file that is not there has been named as such already.
                if path.is_file() {
                    s.fault(
                        "file",
                        what,
                        "save it as NPY [rows, cols] or as grey PNG, or leave the capture out",
                    );
                }
                ndarray::Array2::zeros((camera.rows, camera.cols))
            }
        };
        captures.push(Capture {
            name: path
                .file_stem()
                .map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            element,
            led,
            aoi_rad: aoi_deg.map(f64::to_radians),
            distance_um,
            window_centre_um,
            scale_dn,
            frames,
            dn,
        });
    }
    if captures.is_empty() {
        root.fault("capture", "no capture", "add one [[capture]] for each frame");
    }
    captures
}

pub(super) fn widths(root: &Section<'_, '_>, elements: &PerElement<MeasuredElement>) -> (Vec<SemSite>, f64) {
    let Some(s) = root.optional_section("cd_sem") else {
        return (Vec::new(), 1.0);
    };
    let path = s.file("file");
    let offset = s.float("edge_offset_nm", Limits::new(f64::MIN_POSITIVE..=100.0, "nm"));
    s.finish();
    if !path.is_file() {
        return (Vec::new(), offset);
    }
    match sem::read(&path) {
        Err(e) => {
            s.fault("file", e.to_string(), "mend the table of widths");
            (Vec::new(), offset)
        }
        Ok(sites) => {
            for site in &sites {
                if !elements.iter().any(|e| e.index == site.element) {
                    s.fault(
                        "file",
                        format!("it names element {:?}, which is not described", site.element),
                        "add an [[element]] for it",
                    );
                    break;
                }
            }
            (sites, offset)
        }
    }
}
