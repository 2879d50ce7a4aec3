//! The measurements of a set: measurements, and widths by SEM.

use std::path::PathBuf;
use std::sync::Arc;

use ndarray::Array2;

use super::{DISTANCE_UM, WINDOW_CENTRE_UM, holds_its_pages, is_varied, recorded, sensor_frame, whole};
use crate::set::{BenchLed, ElementIndex, LedIndex, MeasuredElement, Measurement, PerElement, PerLed, SemSite, sem};
use metalith_core::document::{Limits, Section};
use metalith_sensor::RelayCamera;
use metalith_sensor::frame::{self, DarkPixels, ExposedFrame, Orientation, SensorFrames};

pub(super) fn measurements(
    root: &Section<'_, '_>,
    (camera, free_scale): (&RelayCamera, bool),
    frames: &SensorFrames,
    leds: &PerLed<BenchLed>,
    elements: &PerElement<MeasuredElement>,
) -> Vec<Measurement> {
    let sensor = frames.pixels(camera);
    let mut darks = DarkFrames::new((camera, free_scale), frames);
    let mut measurements = Vec::new();
    for s in root.sections("capture") {
        let index = whole(&s, "element", Limits::new(-1000.0..=1000.0, ""));
        let known = elements.iter_enumerated().find(|(_, e)| e.index == index);
        let element = known.map_or_else(
            || {
                s.fault(
                    "element",
                    format!("no [[element]] has the index {index:?}"),
                    "add it, or correct the index",
                );
                ElementIndex::from(0)
            },
            |(e, _)| e,
        );
        let led_nm = s.float("led_nm", Limits::new(200.0..=20_000.0, "nm"));
        let known = leds.iter_enumerated().find(|(_, l)| l.centre_nm == led_nm);
        let led = known.map_or_else(
            || {
                s.fault(
                    "led_nm",
                    format!("no [[led]] has its centre at {led_nm} nm"),
                    "add it, or correct the wavelength",
                );
                LedIndex::from(0)
            },
            |(l, _)| l,
        );
        let aoi_deg: [f64; 2] = s.array("aoi_deg", Limits::new(-80.0..=80.0, "degrees"));
        let distance_um = s.float("distance_um", DISTANCE_UM);
        let window_centre_um: [f64; 2] = s.array("window_centre_um", WINDOW_CENTRE_UM);
        let axis_um = elements.get(element).map_or([0.0; 2], |e| e.axis_um);
        let window_centre_um = [0, 1].map(|axis| window_centre_um[axis] + axis_um[axis]);
        let filter = camera.filter.pixels_of(leds.get(led).and_then(|l| l.channel));
        let (path, exposures) = exposures(&s, led, &mut darks);
        let joined = frame::joined(exposures, sensor.as_ref(), camera, filter);
        let is_same = |other: &&Measurement| is_varied(&joined.dn) && other.dn == joined.dn;
        if let Some(other) = measurements.iter().find(is_same) {
            s.fault(
                if s.has("file") { "file" } else { "exposure" },
                format!("it has the same values as the frame of `{}`", other.name),
                "give each measurement its own frame",
            );
        }
        s.finish();
        measurements.push(Measurement {
            name: path
                .file_stem()
                .map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            element,
            led,
            aoi_rad: aoi_deg.map(f64::to_radians),
            distance_um,
            window_centre_um,
            scale_dn: joined.scale_dn,
            frames: joined.frames,
            dn: joined.dn,
            noise: joined.noise,
        });
    }
    if measurements.is_empty() {
        root.fault("capture", "no capture", "add one [[capture]] for each frame");
    }
    measurements
}

/// Exposures of one LED whose scales differ by more than this factor had unlike times, or unlike light: a dark current that is taken
/// out of the other for less is wrong by a fifth of itself.
const UNLIKE: f64 = 1.25;

/// Dark frames of single exposures, and what that of the camera has served so far.
struct DarkFrames<'a> {
    camera: &'a RelayCamera,
    free_scale: bool,
    orientation: Orientation,
    /// Frames that were read: one that several exposures name is one object.
    known: Vec<Arc<DarkPixels>>,
    /// True if there is one of the camera that is of one exposure.
    is_of_one: bool,
    /// The scale of the first exposure of each LED that it is taken out of.
    served: Vec<(LedIndex, f64)>,
}

impl<'a> DarkFrames<'a> {
    fn new((camera, free_scale): (&'a RelayCamera, bool), frames: &SensorFrames) -> Self {
        Self {
            camera,
            free_scale,
            orientation: frames.orientation,
            known: Vec::new(),
            is_of_one: frames.dark.is_some() && !frames.dark_of_any_exposure,
            served: Vec::new(),
        }
    }

    /// The dark frame that a section names, if it names one.
    fn of(&mut self, s: &Section<'_, '_>) -> Option<Arc<DarkPixels>> {
        let frame = sensor_frame(s, (self.camera, self.orientation), "dark_frame", "dark_frames")?;
        let own = DarkPixels::new(&frame, self.camera);
        if let Some(known) = self.known.iter().find(|known| ***known == own) {
            return Some(Arc::clone(known));
        }
        self.known.push(Arc::new(own));
        self.known.last().cloned()
    }

    /// Fault an exposure of another time than one that the dark frame of the camera was taken out of already; one for all of them.
    fn check_one_time(&mut self, s: &Section<'_, '_>, led: LedIndex, scale_dn: f64) {
        if !self.is_of_one {
            return;
        }
        let Some(&(_, first)) = self.served.iter().find(|(own, _)| *own == led) else {
            self.served.push((led, scale_dn));
            return;
        };
        let times = (scale_dn / first).max(first / scale_dn);
        if times > UNLIKE {
            s.fault(
                "scale_dn",
                format!(
                    "the dark frame of [camera] is taken out of exposures of unlike time: this one of {scale_dn} DN, and one of {first} \
                     DN of the same LED"
                ),
                "name the dark frame of each exposure by `dark_frame` and `dark_frames` beside its `file`; if dark current is next to \
                 nothing, or the light was changed and not the time, say `dark_holds_for = \"any_exposure\"` in [camera]",
            );
            self.is_of_one = false;
        }
    }
}

/// The exposures of a measurement, at least one, and the file of the first: those of its `[[capture.exposure]]`, or its own. A dark frame
/// of the measurement is that of its exposures which name none.
fn exposures(s: &Section<'_, '_>, led: LedIndex, darks: &mut DarkFrames<'_>) -> (PathBuf, Vec<ExposedFrame>) {
    let (of_measurement, is_named) = (darks.of(s), s.has("dark_frame"));
    if !s.has("exposure") {
        let (path, only) = exposure(s, led, (of_measurement, is_named, false), darks);
        return (path, vec![only]);
    }
    let mut name = None;
    let mut all = Vec::new();
    for own in s.sections("exposure") {
        let dark = darks.of(&own).or_else(|| of_measurement.clone());
        let (path, exposure) = exposure(&own, led, (dark, is_named || own.has("dark_frame"), true), darks);
        own.finish();
        name.get_or_insert(path);
        all.push(exposure);
    }
    if all.is_empty() {
        s.fault(
            "exposure",
            "no exposure",
            "add one [[capture.exposure]] for each, or give `file`",
        );
        all.push(nothing(darks.camera));
    }
    (name.unwrap_or_default(), all)
}

/// Placeholder for an exposure that is missing.
fn nothing(camera: &RelayCamera) -> ExposedFrame {
    ExposedFrame {
        dn: Array2::zeros((camera.rows, camera.cols)),
        scale_dn: 1.0,
        frames: 1,
        rounding_dn2: 0.0,
        dark: None,
    }
}

/// One exposure, with its separate dark frame, if it has one, and whether one is named, be it sound or not.
fn exposure(
    s: &Section<'_, '_>,
    led: LedIndex,
    (dark, is_named, is_joined): (Option<Arc<DarkPixels>>, bool, bool),
    darks: &mut DarkFrames<'_>,
) -> (PathBuf, ExposedFrame) {
    let camera = darks.camera;
    let path = s.file("file");
    let scale = Limits::new(f64::MIN_POSITIVE..=1e12, "DN");
    let scale_dn = if darks.free_scale && !is_joined {
        s.float_or("scale_dn", scale, 1.0)
    } else {
        s.float("scale_dn", scale)
    };
    let frames = s.integer("frames", 1..=1_000_000, "frames") as u32;
    let recorded = recorded(&path, camera, darks.orientation).map_err(|what| {
        // A file that is not there has been named as such already.
        if path.is_file() {
            s.fault(
                "file",
                what,
                "save it as NPY [rows, cols], as grey PNG or as grey TIFF, or leave the capture out",
            );
        }
    });
    if !is_named {
        darks.check_one_time(s, led, scale_dn);
    }
    let mut exposure = ExposedFrame {
        scale_dn,
        frames,
        dark,
        ..nothing(camera)
    };
    if let Ok(recorded) = recorded {
        holds_its_pages(s, "frames", &recorded, frames);
        exposure.rounding_dn2 = recorded.rounding_dn2(frames);
        exposure.dn = recorded.dn;
    }
    (path, exposure)
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
            // One of them, for there may be thousands of a kind.
            if let Some((what, hint)) = sites.iter().find_map(|site| misplaced(site, elements)) {
                s.fault("file", what, hint);
            }
            (sites, offset)
        }
    }
}

/// Largest difference of a width as designed by the table and by the layout (nm): both may be rounded.
const ROUNDED_NM: f64 = 1.0;

/// Fault of a width by SEM, and what to do: no such element, no pillar there, or another one by the layout.
fn misplaced(site: &SemSite, elements: &PerElement<MeasuredElement>) -> Option<(String, &'static str)> {
    let Some(element) = elements.iter().find(|e| e.index == site.element) else {
        let what = format!("it names element {:?}, which is not described", site.element);
        return Some((what, "add an [[element]] for it"));
    };
    // A layout that cannot be read has been named as such already.
    if element.pillars.pillars() == 0 {
        return None;
    }
    let place = format!("at {:?} um in element {:?}", site.at_um, site.element);
    let written = element
        .site_at(site.at_um)
        .map_or(0, |at| element.pillars.number.as_slice().map_or(0, |w| w[at]));
    if written == 0 {
        let what = format!("it names a pillar {place}, where the layout has none");
        return Some((
            what,
            "count places from the middle of the element, or leave the line out",
        ));
    }
    ((site.designed_nm - f64::from(written)).abs() > ROUNDED_NM).then(|| {
        let what = format!(
            "a pillar of {} nm by design {place}, of {written} nm in the layout",
            site.designed_nm
        );
        (
            what,
            "give the width of the layout as the designed one, or the layout that was written",
        )
    })
}
