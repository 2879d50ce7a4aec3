//! Frames of stacks: which files they are in, at which positions, and pixels that cannot be used.

use std::path::{Path, PathBuf};

use metalith_core::document::{Limits, Section};
use ndarray::Array2;

use super::bench::length_um;
use super::files;
use super::set::StackPlane;
use crate::pattern::NamePattern;

/// Largest window that is simulated, and smallest (pixels).
const LARGEST: usize = 512;
const SMALLEST: usize = 16;

/// What the set says of frames.
pub(super) struct Frames {
    folder: PathBuf,
    /// Pattern for all objects.
    files: Option<String>,
    /// Stated positions (um): a list, or start and step.
    positions: Vec<f64>,
    start_step: Option<[f64; 2]>,
    not_fitted: Vec<usize>,
    background: Option<Array2<f32>>,
    black: f32,
    window: Option<usize>,
    pub(super) saturation_dn: Option<f32>,
}

impl Frames {
    pub(super) fn read(root: &Section<'_, '_>, folder: &Path) -> Self {
        let sensor = root.section("sensor");
        let dn = || Limits::new(0.0..=1e9, "DN");
        let background = sensor.optional_text("background").and_then(|file| {
            let path = folder.join(file);
            let mean = files::frames(&path).map(|all| {
                let sum = all[1..].iter().fold(all[0].clone(), |sum, f| sum + f);
                sum / all.len() as f32
            });
            let broken = |what| sensor.fault("background", format!("{}: {what}", path.display()), "check this file");
            mean.map_err(broken).ok()
        });
        let black = sensor.float_or("black_level_dn", dn(), 0.0) as f32;
        if background.is_some() && black > 0.0 {
            sensor.fault(
                "black_level_dn",
                "a background frame includes the black level",
                "leave one of them out",
            );
        }
        let window = sensor.optional_integer("window_px", SMALLEST as i64..=LARGEST as i64, "pixels");
        let saturation_dn = sensor.optional_float("saturation_dn", dn()).map(|v| v as f32);
        let files = sensor.optional_text("files");
        // The bench reads these.
        for key in ["distance_um", "distance_mm", "pixel_um"] {
            sensor.optional_float(key, Limits::new(0.0..=1e9, ""));
        }
        sensor.finish();
        let planes = root.section_or_none("planes");
        let [um, mm] = [("positions_um", 1.0), ("positions_mm", 1e3)].map(|(key, unit)| {
            let list = planes.floats(key, Limits::new(-1e6 / unit..=1e6 / unit, ""));
            list.into_iter().map(|v| v * unit).collect::<Vec<_>>()
        });
        let step = length_um(&planes, "step", [-1e5, 1e5]);
        let start = length_um(&planes, "start", [-1e6, 1e6]);
        let positions = if um.is_empty() { mm } else { um };
        if !positions.is_empty() && step.is_some() {
            planes.fault(
                "step_um",
                "positions are given as a list too",
                "keep the list, or start and step",
            );
        }
        let not_fitted = planes.floats("not_fitted", Limits::new(0.0..=9999.0, ""));
        planes.finish();
        Self {
            folder: folder.to_owned(),
            files,
            positions,
            start_step: step.map(|step| [start.unwrap_or(0.0), step]),
            not_fitted: not_fitted.into_iter().map(|v| v as usize).collect(),
            background,
            black,
            window: window.map(|n| n as usize),
            saturation_dn,
        }
    }

    /// Planes of an object.
    pub(super) fn stack(&mut self, s: &Section<'_, '_>, name: &str, object: usize, fitted: bool) -> Vec<StackPlane> {
        const HINT: &str =
            "write names in braces in the last part: frames/{object}_{z_um}.tif, or name one file of all planes";
        let own = s.optional_text("files");
        let Some(text) = own.or_else(|| self.files.clone()) else {
            s.must_have("files", "a file or a pattern of names, here or in [sensor]");
            return Vec::new();
        };
        let found = NamePattern::parse(&text, &self.folder).and_then(|pattern| placed(&pattern, name));
        let found = match found {
            Ok(found) => found,
            Err(what) => {
                s.fault("files", what, HINT);
                return Vec::new();
            }
        };
        let mut out: Vec<(Option<f64>, Array2<f32>)> = Vec::new();
        for (path, position) in found {
            match files::frames(&path) {
                Ok(frames) if position.is_some() && frames.len() > 1 => {
                    // Repeats at one position are one plane: their mean.
                    let n = frames.len() as f32;
                    let sum = frames.into_iter().reduce(|a, b| a + b);
                    out.extend(sum.map(|sum| (position, sum / n)));
                }
                Ok(frames) => out.extend(frames.into_iter().map(|f| (position, f))),
                Err(what) => s.fault("files", format!("{}: {what}", path.display()), "check this file"),
            }
        }
        self.placed(s, name, object, fitted, out)
    }

    fn placed(
        &self,
        s: &Section<'_, '_>,
        name: &str,
        object: usize,
        fitted: bool,
        frames: Vec<(Option<f64>, Array2<f32>)>,
    ) -> Vec<StackPlane> {
        let n = frames.len();
        let listed = |k: usize| match self.start_step {
            Some([start, step]) => Some(start + k as f64 * step),
            None => self.positions.get(k).copied(),
        };
        if !self.positions.is_empty() && self.positions.len() != n && frames.iter().any(|f| f.0.is_none()) {
            let what = format!(
                "{n} frames of `{name}`, and {} positions in [planes]",
                self.positions.len()
            );
            s.fault("files", what, "give one position for each frame");
            return Vec::new();
        }
        let mut out = Vec::new();
        for (number, (position, mut frame)) in frames.into_iter().enumerate() {
            let Some(position_um) = position.or_else(|| listed(number)) else {
                let hint = "give positions_um, or start_um and step_um, in [planes], or {z_um} in the names of files";
                s.fault("files", "the positions of the planes are not stated", hint);
                return Vec::new();
            };
            match &self.background {
                Some(dark) if dark.dim() == frame.dim() => frame -= dark,
                Some(dark) => {
                    let [d, f] = [dark.dim(), frame.dim()];
                    let what = format!("{} x {} pixels, the background has {} x {}", f.0, f.1, d.0, d.1);
                    s.fault("files", what, "give a background frame of the size of the frames");
                    return Vec::new();
                }
                None => frame -= self.black,
            }
            out.push(StackPlane {
                name: format!("{name} {position_um} um"),
                object,
                number,
                position_um,
                used: Array2::from_elem(frame.dim(), true),
                frame,
                fitted: fitted && !self.not_fitted.contains(&number),
            });
        }
        if let Some(window) = self.window {
            crop(&mut out, window);
        }
        out
    }

    /// Check what holds for all stacks together.
    pub(super) fn check(&self, root: &Section<'_, '_>, planes: &[StackPlane], objects: usize) {
        let Some(first) = planes.first() else { return };
        let (rows, cols) = first.frame.dim();
        if let Some(other) = planes.iter().find(|p| p.frame.dim() != (rows, cols)) {
            let (r, c) = other.frame.dim();
            let what = format!(
                "{} has {r} x {c} pixels, {} has {rows} x {cols}",
                other.name, first.name
            );
            root.fault(
                "sensor",
                what,
                "all frames of a set have one size; give `window_px` to cut all to one",
            );
        }
        if rows.min(cols) < SMALLEST || rows.max(cols) > LARGEST {
            let what = format!("frames have {rows} x {cols} pixels; {SMALLEST} to {LARGEST} are simulated");
            root.fault(
                "sensor",
                what,
                "give `window_px` in [sensor]: pixels about the brightest place",
            );
        }
        if planes.iter().filter(|p| p.fitted).count() < 2 {
            root.fault(
                "object",
                "fewer than two planes are fitted",
                "leave fewer out of the fit",
            );
        }
        if self.not_fitted.iter().any(|n| planes.iter().all(|p| p.number != *n)) {
            root.fault(
                "planes",
                "`not_fitted` names a plane that no stack has",
                "planes count from 0",
            );
        }
        let all: usize = planes.iter().map(|p| p.frame.len()).sum();
        if objects > 64 || planes.len() > 2000 || all > 1 << 26 {
            let what = format!("{objects} objects, {} planes, {all} pixels", planes.len());
            root.fault(
                "object",
                what,
                "a set has up to 64 objects, 2000 planes and 67 million pixels",
            );
        }
    }
}

/// Files of an object, in the order of their positions or numbers, with the positions that their names have (um).
fn placed(pattern: &NamePattern, object: &str) -> Result<Vec<(PathBuf, Option<f64>)>, String> {
    let mut found = Vec::new();
    for (path, named) in pattern.files()? {
        if named.get("object").is_some_and(|o| o != object) {
            continue;
        }
        let number = |key: &str| -> Result<Option<f64>, String> {
            let wrong = |text: &String| format!("{}: `{text}` is no number", path.display());
            let parsed = |text: &String| {
                text.parse::<f64>()
                    .ok()
                    .filter(|v| v.abs() <= 1e6)
                    .ok_or_else(|| wrong(text))
            };
            named.get(key).map(parsed).transpose()
        };
        let position = number("z_um")?
            .or(number("z_mm")?.map(|mm| mm * 1e3))
            .or(number("z_nm")?.map(|nm| nm * 1e-3));
        let order = position.or(number("plane")?).unwrap_or(0.0);
        found.push((order, path.clone(), position));
    }
    if found.is_empty() {
        return Err(format!("no file of `{object}` fits"));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(found.into_iter().map(|(_, path, position)| (path, position)).collect())
}

/// Cut the frames of an object to a window about the middle of its light.
fn crop(planes: &mut [StackPlane], window: usize) {
    let Some((rows, cols)) = planes.first().map(|p| p.frame.dim()) else {
        return;
    };
    if planes.iter().any(|p| p.frame.dim() != (rows, cols)) || rows.min(cols) <= window {
        return;
    }
    let mut sum = Array2::<f64>::zeros((rows, cols));
    for plane in planes.iter() {
        let level = level_of(&plane.frame);
        let top = plane.frame.iter().fold(f32::MIN, |a, b| a.max(*b));
        sum += &plane.frame.mapv(|v| f64::from((v - level) / (top - level).max(1e-9)));
    }
    // Means of 5 x 5 pixels, so that a hot pixel has no say.
    let smooth = |y: usize, x: usize| near(&sum, y, x, 2).sum::<f64>() / 25.0;
    let places: Vec<_> = (2..rows - 2).flat_map(|y| (2..cols - 2).map(move |x| (y, x))).collect();
    let values: Vec<f64> = places.iter().map(|&(y, x)| smooth(y, x)).collect();
    let half = 0.5 * values.iter().copied().fold(0.0, f64::max);
    let bright = || places.iter().zip(&values).filter(|(_, v)| **v >= half);
    let weight: f64 = bright().map(|(_, v)| v).sum();
    let [y, x] = [
        bright().map(|((y, _), v)| *y as f64 * v).sum::<f64>() / weight.max(1e-12),
        bright().map(|((_, x), v)| *x as f64 * v).sum::<f64>() / weight.max(1e-12),
    ];
    let first = |middle: f64, n: usize| (middle.round() as usize).saturating_sub(window / 2).min(n - window);
    let (y, x) = (first(y, rows), first(x, cols));
    for plane in planes {
        let inside = Array2::from_shape_fn((window, window), |(r, c)| plane.frame[(y + r, x + c)]);
        plane.frame = inside;
        plane.used = Array2::from_elem((window, window), true);
    }
}

/// Values of the square about a pixel, as far as the frame has it.
fn near<T: Copy>(frame: &Array2<T>, y: usize, x: usize, reach: usize) -> impl Iterator<Item = T> + '_ {
    let (rows, cols) = frame.dim();
    let lines = y.saturating_sub(reach)..(y + reach + 1).min(rows);
    lines.flat_map(move |r| (x.saturating_sub(reach)..(x + reach + 1).min(cols)).map(move |c| frame[(r, c)]))
}

/// Level of a frame without light: the median of its rim.
pub(super) fn level_of(frame: &Array2<f32>) -> f32 {
    let (rows, cols) = frame.dim();
    let rim = frame
        .indexed_iter()
        .filter(|((y, x), _)| *y < 2 || *x < 2 || y + 2 >= rows || x + 2 >= cols);
    median(rim.map(|(_, v)| *v).collect())
}

fn median(mut values: Vec<f32>) -> f32 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Pixels that share the largest value of a frame, from which it looks saturated.
const FLAT_TOP: usize = 5;

/// Share of the planes of a sensor in which a pixel stands out if it is hot.
const HOT_IN: f64 = 0.7;

/// Standard deviations by which a hot pixel stands out of its neighbours.
const HOT_SIGMAS: f32 = 8.0;

/// Mask saturated and hot pixels; what was found, in words.
pub(super) fn mask_defects(planes: &mut [StackPlane], saturation_dn: Option<f32>) -> Vec<String> {
    let mut remarks = Vec::new();
    for plane in planes.iter_mut() {
        let top = plane.frame.iter().fold(f32::MIN, |a, b| a.max(*b));
        let equal = plane.frame.iter().filter(|v| **v == top).count();
        let full = match saturation_dn {
            Some(dn) => 0.98 * dn,
            None if equal >= FLAT_TOP && top > level_of(&plane.frame) => top,
            None => continue,
        };
        let found = plane.frame.iter().filter(|v| **v >= full).count();
        if found > 0 {
            plane.used.zip_mut_with(&plane.frame, |used, v| *used &= *v < full);
            remarks.push(format!("{}: {found} saturated pixels are masked", plane.name));
        }
    }
    if remarks.len() > 4 {
        let n = remarks.len();
        remarks.truncate(3);
        remarks.push(format!("saturated pixels are masked in {n} planes"));
    }
    let Some(dim) = planes.first().map(|p| p.frame.dim()) else {
        return remarks;
    };
    if planes.iter().any(|p| p.frame.dim() != dim) || planes.len() < 3 {
        return remarks;
    }
    let mut counts = Array2::<u32>::zeros(dim);
    for plane in planes.iter() {
        let beyond = outliers(&plane.frame);
        counts.zip_mut_with(&beyond, |n, is| *n += u32::from(*is));
    }
    let least = (HOT_IN * planes.len() as f64).ceil() as u32;
    let hot: Vec<_> = counts
        .indexed_iter()
        .filter(|(_, n)| **n >= least)
        .map(|(at, _)| at)
        .collect();
    if !hot.is_empty() && hot.len() * 50 < counts.len() {
        planes
            .iter_mut()
            .for_each(|p| hot.iter().for_each(|at| p.used[*at] = false));
        let places: Vec<String> = hot.iter().take(4).map(|(y, x)| format!("[{y}, {x}]")).collect();
        remarks.push(format!("{} hot pixels are masked: {}", hot.len(), places.join(", ")));
    }
    remarks
}

/// Pixels that stand out of all their neighbours.
fn outliers(frame: &Array2<f32>) -> Array2<bool> {
    let (rows, cols) = frame.dim();
    let around = |y: usize, x: usize| {
        let mut all: Vec<f32> = near(frame, y, x, 1).collect();
        all.sort_by(f32::total_cmp);
        // The pixel itself is the last one if it stands out.
        (all[all.len() / 2], all[all.len() - 2])
    };
    let differences = Array2::from_shape_fn((rows, cols), |(y, x)| frame[(y, x)] - around(y, x).0);
    let sigma = 1.48 * median(differences.iter().map(|v| v.abs()).collect());
    let level = level_of(frame);
    Array2::from_shape_fn((rows, cols), |(y, x)| {
        let second = around(y, x).1;
        differences[(y, x)] > HOT_SIGMAS * sigma.max(1e-6) && frame[(y, x)] - level > 2.0 * (second - level)
    })
}
