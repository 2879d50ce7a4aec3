//! Where a point of the scene is seen, and where each element puts it on the sensor.
//!
//! The scene is a plane before the chip, in perspective: a place on it is the pair of tangents under which the middle of
//! the chip sees its light arrive. Columns of a picture of the scene run along +x and rows along +y, so that the
//! sub-image of an element that does not steer stands as the scene does.

use metalith_core::Wedge;
use metalith_wave::PlaneWave;
use metalith_wave::propagation::leaving;
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

/// One element before its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ElementView {
    /// Middle of the element on the chip (um).
    pub centre_um: [f64; 2],
    pub wedge: Wedge,
    /// From the pillar tops to the sensor below the middle of the chip (um).
    pub focal_um: f64,
    /// Slope of the sensor's plane against the chip, along x and y.
    pub slope: [f64; 2],
}

impl ElementView {
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

    /// Where the chief ray of light from these sines meets the sensor, from the element's axis (um); none if it does not.
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

    /// From the pillar tops to the sensor at a place from the element's axis (um).
    pub fn distance_um(&self, place_um: [f64; 2]) -> f64 {
        self.axis_distance_um() + self.slope[0] * place_um[0] + self.slope[1] * place_um[1]
    }

    fn axis_distance_um(&self) -> f64 {
        self.focal_um + self.slope[0] * self.centre_um[0] + self.slope[1] * self.centre_um[1]
    }

    /// Projected solid angle of the light whose chief rays land on a small area about a place, over that area (1/um^2):
    /// d^2 sines / d^2 x. A flat surface of unit radiance sends so much power to each unit of the element's own area.
    pub fn projected_per_um2(&self, place_um: [f64; 2]) -> f64 {
        let z = self.distance_um(place_um);
        let r2 = place_um[0].powi(2) + place_um[1].powi(2) + z * z;
        self.axis_distance_um() * z / (r2 * r2)
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
            focal_um: 2400.0,
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
    fn a_near_scene_is_seen_from_two_places() {
        // 991 / Z[mm] pixels of 5.86 um between elements 2.42 mm apart.
        let flat = |x: f64| ElementView {
            centre_um: [x, 0.0],
            wedge: Wedge {
                wavelength_um: 0.55,
                sin_x: 0.0,
                sin_y: 0.0,
            },
            focal_um: 2400.0,
            slope: [0.0; 2],
        };
        let at = |x: f64| flat(x).landing_um(flat(x).sines([0.0; 2], 100e3), 0.5).unwrap()[0];
        // The published figure has three digits.
        assert!(((at(2420.0) - at(0.0)) / 5.86 - 9.91).abs() < 5e-3);
    }
}
