//! Scenes whose truth is a formula: bars, a star, an edge.

use std::str::FromStr;

use metalith_core::Error;
use ndarray::{Array2, Array3};

use super::SceneImage;

/// A built-in scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BuiltIn {
    /// Groups of three bars along both axes, from coarse to fine, in the middle, towards the edges and in the corners.
    Chart,
    /// A Siemens star of 36 spokes.
    Star,
    /// An edge that leans by five degrees (ISO 12233).
    Edge,
}

impl FromStr for BuiltIn {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "chart" => Ok(Self::Chart),
            "star" => Ok(Self::Star),
            "edge" => Ok(Self::Edge),
            _ => Err(Error::refused(
                "scene/unknown",
                format!("`{text}` is not a built-in scene"),
                "use chart, star or edge, or the path of an image",
            )),
        }
    }
}

/// Light of black and of white parts: what paper and print reflect.
const DARK: f64 = 0.05;
const BRIGHT: f64 = 0.9;
/// Spokes of the star.
pub(crate) const SPOKES: f64 = 36.0;
/// Radius of the star over the side of the scene.
pub(crate) const STAR: f64 = 0.45;
/// Lean of the edge (degrees).
pub(crate) const LEAN_DEG: f64 = 5.0;
/// Points an axis that a pixel is the mean of.
const WITHIN: usize = 4;
/// Widths of a bar, in pixels of the scene.
const BARS: [f64; 5] = [8.0, 5.0, 3.0, 2.0, 1.0];

/// A built-in scene of `size` pixels an axis.
pub fn chart(kind: BuiltIn, size: usize, field_deg: f64, distance_um: f64) -> SceneImage {
    let bright: Box<dyn Fn(f64, f64) -> bool> = match kind {
        BuiltIn::Chart => Box::new(bars(size)),
        BuiltIn::Star => Box::new(move |x, y| {
            let radius = x.hypot(y);
            let spokes = (y.atan2(x) * SPOKES / std::f64::consts::TAU).rem_euclid(1.0) < 0.5;
            radius > STAR * size as f64 || spokes
        }),
        BuiltIn::Edge => Box::new(|x, y| x + y * LEAN_DEG.to_radians().tan() > 0.0),
    };
    let middle = 0.5 * size as f64;
    let plane = Array2::from_shape_fn((size, size), |(iy, ix)| {
        let at = |i: usize, k: usize| i as f64 + (k as f64 + 0.5) / WITHIN as f64 - middle;
        let lit = (0..WITHIN * WITHIN)
            .filter(|k| bright(at(ix, k % WITHIN), at(iy, k / WITHIN)))
            .count();
        DARK + (BRIGHT - DARK) * lit as f64 / (WITHIN * WITHIN) as f64
    });
    let rgb = Array3::from_shape_fn((size, size, 3), |(y, x, _)| plane[[y, x]]);
    let name = match kind {
        BuiltIn::Chart => "resolution chart",
        BuiltIn::Star => "Siemens star",
        BuiltIn::Edge => "slanted edge",
    };
    SceneImage::of_rgb(name, &rgb, field_deg, distance_um)
}

/// True if a place from the middle (pixels) is bright on the chart: bars are dark.
fn bars(size: usize) -> impl Fn(f64, f64) -> bool {
    let mut groups: Vec<[f64; 3]> = Vec::new();
    let reach = 0.5 * size as f64;
    for cy in [-0.72, 0.0, 0.72] {
        for cx in [-0.72, 0.0, 0.72] {
            let mut x = cx * reach - 50.0;
            for width in BARS {
                groups.push([x, cy * reach, width]);
                x += 6.0 * width + 8.0;
            }
        }
    }
    move |x, y| {
        !groups.iter().any(|[gx, gy, w]| {
            let (u, v) = (x - gx, y - gy);
            let upright = (0.0..5.0 * w).contains(&u) && (0.0..5.0 * w).contains(&v) && (u / w) as i64 % 2 == 0;
            let lying =
                (0.0..5.0 * w).contains(&u) && (-6.0 * w..-w).contains(&v) && ((v + 6.0 * w) / w) as i64 % 2 == 0;
            upright || lying
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_scenes_are_what_they_say() {
        for kind in [BuiltIn::Chart, BuiltIn::Star, BuiltIn::Edge] {
            let scene = chart(kind, 200, 60.0, f64::INFINITY);
            let plane = &scene.planes[0];
            // Values are stored in single precision.
            let inside = |v: &f32| (DARK as f32 - 1e-6..=BRIGHT as f32 + 1e-6).contains(v);
            assert!(plane.iter().all(inside) && plane.iter().any(|v| *v < 0.1) && plane.iter().any(|v| *v > 0.8));
        }
        let edge = chart(BuiltIn::Edge, 100, 60.0, f64::INFINITY);
        // The edge moves by one pixel in eleven rows.
        let bright = |row: usize| edge.planes[0].row(row).iter().map(|v| f64::from(*v)).sum::<f64>();
        let moved = (bright(95) - bright(5)) / (BRIGHT - DARK);
        assert!((moved - 90.0 * LEAN_DEG.to_radians().tan()).abs() < 0.3, "{moved}");
    }
}
