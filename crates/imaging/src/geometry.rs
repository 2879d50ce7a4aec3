//! Geometry of scenes: the direction in which a point is seen, and the place on the sensor at which each element images
//! it.
//!
//! The scene is a plane before the chip, in perspective: a place on it is the pair of tangents under which the middle of
//! the chip sees its light arrive. Columns of a picture of the scene run along +x and rows along +y, so that the
//! sub-image of an element that does not steer stands as the scene does.

use std::sync::Arc;

use metalith_core::Wedge;
use metalith_wave::PlaneWave;
use metalith_wave::propagation::leaving;
use ndarray::Array2;
use serde::Serialize;

/// A picture of the scene: its size, and the field that it fills.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SceneView {
    pub rows: usize,
    pub columns: usize,
    /// Angle from its left to its right edge (degrees).
    pub field_deg: f64,
    /// Distance of its plane from the chip (um); infinite for a scene that is far.
    pub distance_um: f64,
}

impl SceneView {
    /// Tangent from one pixel of the picture to the next.
    pub fn pixel(&self) -> f64 {
        2.0 * (0.5 * self.field_deg).to_radians().tan() / self.columns as f64
    }

    /// Tangents along x and y at a place of the picture, in pixels from the middle of its first one.
    pub fn tangents(&self, row: f64, column: f64) -> [f64; 2] {
        let at = |i: f64, n: usize| (i - 0.5 * (n as f64 - 1.0)) * self.pixel();
        [at(column, self.columns), at(row, self.rows)]
    }

    /// The place, row and column, that has these tangents.
    pub fn place(&self, tangents: [f64; 2]) -> [f64; 2] {
        let at = |t: f64, n: usize| t / self.pixel() + 0.5 * (n as f64 - 1.0);
        [at(tangents[1], self.rows), at(tangents[0], self.columns)]
    }
}

/// A scene in space: flat, or with a distance for each of its pixels.
#[derive(Clone)]
pub struct SceneSpace {
    pub view: SceneView,
    depth: Option<Arc<Depth>>,
}

struct Depth {
    um: Array2<f32>,
    /// One over the least and over the greatest distance (1/um).
    inverse: [f64; 2],
}

impl SceneSpace {
    /// A scene that is flat.
    pub fn flat(view: &SceneView) -> Self {
        Self {
            view: *view,
            depth: None,
        }
    }

    /// True for a plane, false for a scene with a distance of each pixel.
    pub(crate) fn is_flat(&self) -> bool {
        self.depth.is_none()
    }

    /// Space of a scene with the distance of each pixel (um, positive).
    pub fn with_depth(view: &SceneView, um: &Array2<f32>) -> Self {
        let ends = um.iter().fold([f32::MAX, 0.0f32], |[a, b], v| [a.min(*v), b.max(*v)]);
        Self {
            view: *view,
            depth: Some(Arc::new(Depth {
                um: um.clone(),
                inverse: ends.map(|v| f64::from(v).recip()),
            })),
        }
    }

    /// Tangents under which the middle of the chip sees what an element sees under these sines: the first surface on the
    /// way from the element. None if no light arrives so.
    pub fn tangents(&self, element: &ElementView, sines: [f64; 2]) -> Option<[f64; 2]> {
        let Some(depth) = &self.depth else {
            return element.tangents(sines, self.view.distance_um);
        };
        let far = element.tangents(sines, f64::INFINITY)?;
        let [near, last] = depth.inverse;
        let at = |inverse: f64| [0, 1].map(|a| far[a] - element.centre_um[a] * inverse);
        let inverse_there = |tangents: [f64; 2]| {
            let pixel = |place: f64, n: usize| place.round().clamp(0.0, n as f64 - 1.0) as usize;
            let place = self.view.place(tangents);
            let (rows, columns) = depth.um.dim();
            f64::from(depth.um[[pixel(place[0], rows), pixel(place[1], columns)]]).recip()
        };
        // Half a pixel of the scene a step.
        let pixels = element.centre_um[0].hypot(element.centre_um[1]) * (near - last) / self.view.pixel();
        let steps = (2.0 * pixels).ceil().max(1.0) as usize;
        let met = (0..steps).find_map(|k| {
            let inverse = near + (last - near) * k as f64 / steps as f64;
            let there = inverse_there(at(inverse));
            (there >= inverse).then_some(there)
        });
        Some(at(met.unwrap_or(last)))
    }
}

/// One element before its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ElementView {
    /// Middle of the element on the chip (um).
    pub centre_um: [f64; 2],
    pub wedge: Wedge,
    /// Area of the element that is open, over that of the lens that the elements of a design share.
    pub area: f64,
    /// Distance from the pillar tops to the sensor below the middle of the chip (um).
    pub sensor_um: f64,
    /// Slope of the sensor's plane against the chip, along x and y.
    pub slope: [f64; 2],
}

impl ElementView {
    /// Element of the area of a lens that does not steer, before a sensor that is not tilted.
    #[cfg(test)]
    pub(crate) fn ahead(centre_um: [f64; 2], sensor_um: f64) -> Self {
        Self {
            centre_um,
            wedge: Wedge {
                wavelength_um: 0.55,
                sin_x: 0.0,
                sin_y: 0.0,
            },
            area: 1.0,
            sensor_um,
            slope: [0.0; 2],
        }
    }

    /// Sines under which light arrives here that arrives at the middle of the chip under these tangents.
    pub fn sines(&self, tangents: [f64; 2], scene_distance_um: f64) -> [f64; 2] {
        let t = [0, 1].map(|a| tangents[a] + self.centre_um[a] / scene_distance_um);
        let length = (1.0 + t[0] * t[0] + t[1] * t[1]).sqrt();
        t.map(|t| t / length)
    }

    /// Tangents under which the middle of the chip sees the scene that is seen here under these sines; none if no light
    /// arrives so.
    pub fn tangents(&self, sines: [f64; 2], scene_distance_um: f64) -> Option<[f64; 2]> {
        let cosine2 = 1.0 - sines[0] * sines[0] - sines[1] * sines[1];
        (cosine2 > 0.0).then(|| [0, 1].map(|a| sines[a] / cosine2.sqrt() - self.centre_um[a] / scene_distance_um))
    }

    /// Place where the chief ray of light from these sines meets the sensor, from the element's axis (um); `None` if it
    /// does not.
    pub fn landing_um(&self, sines: [f64; 2], wavelength_um: f64) -> Option<[f64; 2]> {
        let wave = PlaneWave {
            wavelength_um,
            sin_x: sines[0],
            sin_y: sines[1],
        };
        let u = leaving(&self.wedge, &wave);
        let cosine2 = 1.0 - u[0] * u[0] - u[1] * u[1];
        if cosine2 <= 0.0 {
            return None;
        }
        let t = u.map(|s| s / cosine2.sqrt());
        // The plane of the sensor: z = z0 + slope . (x - axis).
        let closing = 1.0 - self.slope[0] * t[0] - self.slope[1] * t[1];
        (closing > 0.0).then(|| t.map(|t| t * self.axis_distance_um() / closing))
    }

    /// The sines whose chief ray lands there.
    pub fn sines_of_landing(&self, place_um: [f64; 2], wavelength_um: f64) -> [f64; 2] {
        let z = self.distance_um(place_um);
        let length = (place_um[0].powi(2) + place_um[1].powi(2) + z * z).sqrt();
        let (x, y) = self.wedge.looks_at(wavelength_um);
        [place_um[0] / length + x, place_um[1] / length + y]
    }

    /// Distance from the pillar tops to the sensor at a place from the element's axis (um).
    pub fn distance_um(&self, place_um: [f64; 2]) -> f64 {
        self.axis_distance_um() + self.slope[0] * place_um[0] + self.slope[1] * place_um[1]
    }

    /// Cosine of the angle between the normal of the sensor and light that arrives at a place of the chip (um) from the middle of the
    /// element.
    pub(crate) fn arrival_cosine(&self, place_um: [f64; 2]) -> f64 {
        let way = [0, 1].map(|a| place_um[a] - self.centre_um[a]);
        let z = self.distance_um(way);
        let [sx, sy] = self.slope;
        let along = z - sx * way[0] - sy * way[1];
        along / ((way[0].powi(2) + way[1].powi(2) + z * z) * (1.0 + sx * sx + sy * sy)).sqrt()
    }

    fn axis_distance_um(&self) -> f64 {
        self.sensor_um + self.slope[0] * self.centre_um[0] + self.slope[1] * self.centre_um[1]
    }

    /// Projected solid angle of the light whose chief rays land on a small area about a place, over that area (1/um^2):
    /// d^2 sines / d^2 x.
    fn projected_per_um2(&self, place_um: [f64; 2]) -> f64 {
        let z = self.distance_um(place_um);
        let r2 = place_um[0].powi(2) + place_um[1].powi(2) + z * z;
        self.axis_distance_um() * z / (r2 * r2)
    }

    /// Power that a flat surface of unit radiance sends through the element to a small area about a place, over that area and
    /// that of the lens that the elements share (1/um^2).
    pub fn flux_per_um2(&self, place_um: [f64; 2]) -> f64 {
        self.area * self.projected_per_um2(place_um)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tilted() -> ElementView {
        ElementView {
            centre_um: [2420.0, -2420.0],
            wedge: Wedge {
                wavelength_um: 0.55,
                sin_x: 15.0_f64.to_radians().sin(),
                sin_y: -15.0_f64.to_radians().sin(),
            },
            area: 1.0,
            sensor_um: 2400.0,
            slope: [0.01, -0.02],
        }
    }

    #[test]
    fn each_way_undoes_the_other() {
        // Sines of size one, places of a millimetre.
        const ROUNDING: f64 = 1e-12;
        let view = tilted();
        let scene = 300e3;
        for tangents in [[0.1, -0.2], [-0.4, 0.5]] {
            let sines = view.sines(tangents, scene);
            let back = view.tangents(sines, scene).unwrap();
            let landing = view.landing_um(sines, 0.6).unwrap();
            let again = view.sines_of_landing(landing, 0.6);
            assert!((0..2).all(|a| (back[a] - tangents[a]).abs() < ROUNDING));
            assert!(
                (0..2).all(|a| (again[a] - sines[a]).abs() < ROUNDING),
                "{again:?} {sines:?}"
            );
        }
        let picture = SceneView {
            rows: 31,
            columns: 40,
            field_deg: 70.0,
            distance_um: scene,
        };
        let place = picture.place(picture.tangents(3.0, 8.5));
        assert!((place[0] - 3.0).abs() < ROUNDING && (place[1] - 8.5).abs() < 10.0 * ROUNDING);
        let edge = picture.tangents(0.0, 39.5)[0];
        assert!((edge - 35.0_f64.to_radians().tan()).abs() < ROUNDING);
    }

    #[test]
    fn solid_angles_are_those_of_small_squares() {
        // Second differences over 2 um of places of a millimetre.
        const FINITE: f64 = 1e-5;
        let view = tilted();
        let (at, h) = ([700.0, -300.0], 1.0);
        let s = |dx: f64, dy: f64| view.sines_of_landing([at[0] + dx, at[1] + dy], 0.5);
        let [ax, bx, ay, by] = [s(h, 0.0), s(-h, 0.0), s(0.0, h), s(0.0, -h)];
        let area = ((ax[0] - bx[0]) * (ay[1] - by[1]) - (ax[1] - bx[1]) * (ay[0] - by[0])) / (4.0 * h * h);
        assert!((view.projected_per_um2(at) / area - 1.0).abs() < FINITE);
    }

    #[test]
    fn what_is_near_hides_what_is_far() {
        let view = SceneView {
            rows: 101,
            columns: 101,
            field_deg: 60.0,
            distance_um: f64::INFINITY,
        };
        // A post in front of a wall, ten pixels wide.
        let depth = Array2::from_shape_fn((101, 101), |(_, x)| if (45..55).contains(&x) { 100e3 } else { 1e6 });
        let space = SceneSpace::with_depth(&view, &depth);
        let element = tilted();
        let seen = |tangents: [f64; 2], um: f64| {
            let found = space.tangents(&element, element.sines(tangents, um)).unwrap();
            view.place(found)
        };
        // Half a pixel of the scene, by which the way is walked.
        const STEP: f64 = 0.5;
        for (column, um) in [(50.0, 100e3), (80.0, 1e6), (20.0, 1e6)] {
            let place = seen(view.tangents(50.0, column), um);
            assert!(
                (place[1] - column).abs() < STEP && (place[0] - 50.0).abs() < STEP,
                "{place:?}"
            );
        }
        // The element stands 2.42 mm to the right: at this place of the wall the post is in its way.
        let hidden = seen(view.tangents(50.0, 56.0), 1e6);
        assert!((44.5..54.5).contains(&hidden[1]), "{hidden:?}");
        // A flat map is a flat scene.
        let flat = SceneView {
            distance_um: 1e6,
            ..view
        };
        let even = SceneSpace::with_depth(&view, &Array2::from_elem((101, 101), 1e6));
        let sines = element.sines([0.1, -0.2], 1e6);
        let (a, b) = (
            even.tangents(&element, sines).unwrap(),
            SceneSpace::flat(&flat).tangents(&element, sines).unwrap(),
        );
        // Distances are kept in single precision.
        assert!((0..2).all(|k| (a[k] - b[k]).abs() < 1e-8), "{a:?} {b:?}");
    }

    #[test]
    fn a_near_scene_is_seen_from_two_places() {
        // 991 / Z[mm] pixels of 5.86 um between elements 2.42 mm apart.
        let flat = |x: f64| ElementView::ahead([x, 0.0], 2400.0);
        let at = |x: f64| flat(x).landing_um(flat(x).sines([0.0; 2], 100e3), 0.5).unwrap()[0];
        // The published figure has three digits.
        assert!(((at(2420.0) - at(0.0)) / 5.86 - 9.91).abs() < 5e-3);
    }
}
