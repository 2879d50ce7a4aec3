//! The stated bench: source, aperture, lens, sensor.

use std::path::Path;

use metalith_core::document::{Limits, Section};
use metalith_core::text::quoted;
use ndarray::Array2;

use super::files;

/// Opening in the plane of the object.
#[derive(Clone, Debug)]
pub enum ApertureShape {
    Round,
    Square,
    /// Amplitudes on samples, with the edge of a sample (um).
    Map {
        amplitude: Array2<f32>,
        sample_um: f64,
    },
}

/// A thin lens.
#[derive(Clone, Copy, Debug)]
pub struct ThinLens {
    pub focal_um: f64,
    /// From the object; 0 if the object is in the plane of the lens.
    pub distance_um: f64,
    /// Diameter of a lens that is not in the plane of the object.
    pub diameter_um: f64,
}

/// The bench as stated.
#[derive(Clone, Debug)]
pub struct StackBench {
    /// Wavelengths (um) with their weights, which sum to one.
    pub wavelengths: Vec<[f64; 2]>,
    /// Distance of a point source; none at infinity.
    pub source_um: Option<f64>,
    pub shape: ApertureShape,
    /// Diameter or edge of the opening.
    pub aperture_um: f64,
    pub lens: Option<ThinLens>,
    /// From the lens, or from the object without one, to plane position 0.
    pub sensor_um: f64,
    pub pixel_um: f64,
    /// True if each plane has a displacement, or a background level, that is not known.
    pub shift: bool,
    pub background: bool,
}

/// Rows of a spectrum that is read, and samples of a Gaussian one.
const MOST_WAVELENGTHS: usize = 64;
const GAUSSIAN_SAMPLES: i32 = 7;

/// A length in um or mm, under one of two keys; a fault if both or none is there.
pub(super) fn length_um(s: &Section<'_, '_>, key: &str, [least, most]: [f64; 2]) -> Option<f64> {
    let [um, mm] = [format!("{key}_um"), format!("{key}_mm")];
    let of_um = s.optional_float(&um, Limits::new(least..=most, "um"));
    let of_mm = s.optional_float(&mm, Limits::new(least * 1e-3..=most * 1e-3, "mm"));
    if of_um.is_some() && of_mm.is_some() {
        s.fault(&mm, format!("`{um}` and `{mm}` are one length"), "keep one of them");
    }
    of_um.or(of_mm.map(|v| v * 1e3))
}

/// As [`length_um`], of a length that must be there.
fn must_um(s: &Section<'_, '_>, key: &str, range: [f64; 2]) -> f64 {
    length_um(s, key, range).unwrap_or_else(|| {
        s.must_have(&format!("{key}_um"), &format!("a length (um), or `{key}_mm`"));
        range[1]
    })
}

pub(super) fn read(root: &Section<'_, '_>, folder: &Path) -> StackBench {
    let source = root.section("source");
    let wavelengths = wavelengths(&source, folder);
    let source_um = length_um(&source, "distance", [1.0, 1e8]);
    source.finish();
    let aperture = root.section("aperture");
    let shape = match aperture.choice("shape", &[("round", 0), ("square", 1), ("map", 2)], Some(0)) {
        0 => ApertureShape::Round,
        1 => ApertureShape::Square,
        _ => aperture_map(&aperture, folder),
    };
    let aperture_um = match &shape {
        ApertureShape::Map { amplitude, sample_um } => {
            let (rows, cols) = amplitude.dim();
            rows.max(cols) as f64 * sample_um
        }
        _ => must_um(&aperture, "diameter", [1.0, 25_000.0]),
    };
    aperture.finish();
    let lens = root.optional_section("lens").map(|s| {
        let distance_um = length_um(&s, "distance", [0.0, 1e6]).unwrap_or(0.0);
        let focal_um = must_um(&s, "focal_length", [10.0, 1e6]);
        let diameter_um = if distance_um > 0.0 {
            must_um(&s, "diameter", [1.0, 100_000.0])
        } else {
            aperture_um
        };
        s.finish();
        ThinLens {
            focal_um,
            distance_um,
            diameter_um,
        }
    });
    let sensor = root.section_or_none("sensor");
    let sensor_um = must_um(&sensor, "distance", [1.0, 1e6]);
    let pixel_um = sensor.float("pixel_um", Limits::new(0.01..=100.0, "um"));
    let (shift, background) = nuisances(root);
    StackBench {
        wavelengths,
        source_um,
        shape,
        aperture_um,
        lens,
        sensor_um,
        pixel_um,
        shift,
        background,
    }
}

fn nuisances(root: &Section<'_, '_>) -> (bool, bool) {
    let Some(s) = root.optional_section("nuisances") else {
        return (true, true);
    };
    let (mut shift, mut background) = (false, false);
    for word in s.texts("each_plane") {
        match word.as_str() {
            "shift" => shift = true,
            "background" => background = true,
            other => s.fault(
                "each_plane",
                format!("no nuisance is called `{}`", quoted(other)),
                "known here: shift, background; the gain of a plane is always free",
            ),
        }
    }
    s.finish();
    (shift, background)
}

fn aperture_map(s: &Section<'_, '_>, folder: &Path) -> ApertureShape {
    let sample_um = s.float("sample_um", Limits::new(0.01..=100.0, "um"));
    let path = folder.join(s.text("file"));
    let amplitude = files::map(&path).unwrap_or_else(|what| {
        s.fault(
            "file",
            format!("{}: {what}", path.display()),
            "give a map of amplitudes from 0 to 1",
        );
        Array2::ones((8, 8))
    });
    if amplitude.iter().any(|v| !(0.0..=1.0).contains(v)) || amplitude.iter().all(|v| *v == 0.0) {
        s.fault(
            "file",
            "amplitudes are not from 0 to 1, or all are 0",
            "divide by the largest",
        );
    }
    ApertureShape::Map { amplitude, sample_um }
}

fn wavelengths(s: &Section<'_, '_>, folder: &Path) -> Vec<[f64; 2]> {
    let nm = || Limits::new(100.0..=20_000.0, "nm");
    let mut rows: Vec<[f64; 2]> = if s.has("spectrum") {
        let path = folder.join(s.text("spectrum"));
        table(&path).unwrap_or_else(|what| {
            s.fault(
                "spectrum",
                what,
                "give a CSV table with the header wavelength_nm,weight",
            );
            vec![[0.5, 1.0]]
        })
    } else {
        let centre = s.float("wavelength_nm", nm());
        match s.optional_float("fwhm_nm", Limits::new(0.0..=200.0, "nm")) {
            Some(width) if width > 0.0 => {
                let sigma = (width / (8.0 * 2f64.ln()).sqrt()).min(0.2 * centre);
                let half = GAUSSIAN_SAMPLES / 2;
                let row = |k: i32| {
                    // Steps of 0.75 standard deviations reach 2.25 of them on either side.
                    let t = 0.75 * f64::from(k);
                    [(centre + t * sigma) * 1e-3, (-0.5 * t * t).exp()]
                };
                (-half..=half).map(row).collect()
            }
            _ => vec![[centre * 1e-3, 1.0]],
        }
    };
    let sum: f64 = rows.iter().map(|r| r[1]).sum();
    rows.iter_mut().for_each(|r| r[1] /= sum);
    rows
}

fn table(path: &Path) -> Result<Vec<[f64; 2]>, String> {
    let text = metalith_core::document::load(path).map_err(|e| e.to_string())?;
    let refuse = |line: Option<usize>, what: String| {
        let line = line.map_or_else(String::new, |line| format!(", line {line}"));
        format!("{}{line}: {what}", path.display())
    };
    let rows = metalith_core::csv_rows(&text, "wavelength_nm,weight", &refuse)?;
    let mut out = Vec::new();
    for row in rows {
        let row = row?;
        let [nm, weight] = row.numbers()?;
        if !(100.0..=20_000.0).contains(&nm) || !(0.0..=1e9).contains(&weight) {
            return Err(row.refused(format!("a weight of {weight} at {nm} nm")));
        }
        if weight > 0.0 {
            out.push([nm * 1e-3, weight]);
        }
    }
    match out.len() {
        0 => Err(format!("{}: no weight is above 0", path.display())),
        n if n > MOST_WAVELENGTHS => Err(format!(
            "{}: {n} rows, {MOST_WAVELENGTHS} are simulated",
            path.display()
        )),
        _ => Ok(out),
    }
}
