//! The search: arrangements, distances and diameters outside, phases inside.

use std::f64::consts::TAU;

use metalith_core::{Progress, Result};
use metalith_sensor::{ColourFilter, Sensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::element::{CameraElement, TERMS, fitted, mirrored_signs};
use super::lbfgs;
use super::model::{CameraModel, Judged};
use super::pupil::landing_um;

/// Elements of one diameter on a grid before a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Arrangement {
    /// Elements along x and y.
    pub count: [usize; 2],
    /// Distance of the sensor (um).
    pub distance_um: f64,
    pub diameter_um: f64,
    /// Share of the wedge that steers each element to the middle of its part of the field.
    pub wedge_share: f64,
    /// Steering of an element by each step from the middle, besides (degrees).
    pub steering_deg: f64,
}

/// Phases that a descent begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CameraStart {
    /// Every element is the same hyperbola.
    Identical,
    /// Focus of each element on the light from the middle of its part of the field.
    Parts,
    /// The same, with focal lengths that differ by up to a tenth from element to element.
    PartsAtFoci,
    /// Hyperbolas that focus at distances that differ by up to a tenth.
    Foci,
}

impl CameraStart {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Identical => "identical",
            Self::Parts => "parts",
            Self::PartsAtFoci => "parts at several foci",
            Self::Foci => "several foci",
        }
    }

    /// All starts, in the order in which they are tried.
    pub const ALL: [Self; 4] = [Self::Parts, Self::PartsAtFoci, Self::Identical, Self::Foci];
}

/// Wavelength that elements focus at first (um).
const FOCUSED_UM: f64 = 0.53;
/// Smallest gain of a step of a descent (dB).
const LEAST_GAIN_DB: f64 = 2e-4;
/// Length of the first step of a descent (rad).
const FIRST_STEP_RAD: f64 = 1.0;
/// Space from rim to rim of neighbours (um).
const APART_UM: f64 = 20.0;
/// Share by which foci of elements differ at most.
const FOCI: f64 = 0.1;

/// Sensor as far as it decides the places of elements.
#[derive(Clone, Copy, Debug)]
pub struct SensorLattice {
    /// Sides along x and y (um).
    pub sides_um: [f64; 2],
    /// Pitch of a lattice of pixels (um).
    pub pitch_um: f64,
}

impl SensorLattice {
    /// Lattice of a sensor.
    pub fn of(sensor: &Sensor) -> Self {
        let is_mosaic = sensor.filter != ColourFilter::None;
        Self {
            sides_um: [sensor.columns, sensor.rows].map(|n| f64::from(n) * sensor.pixel_um),
            pitch_um: sensor.pixel_um * if is_mosaic { 2.0 } else { 1.0 },
        }
    }

    /// Pitch of so many elements along an axis (um), as wanted or as the sensor has room.
    fn pitch_um(&self, axis: usize, count: usize, wanted_um: f64) -> f64 {
        let count = count as f64;
        let own = wanted_um.min(self.sides_um[axis] / count);
        let part = self.pitch_um / count;
        let periods = ((own - part) / self.pitch_um).floor();
        periods * self.pitch_um + part
    }
}

impl Arrangement {
    /// Pitch of the elements along an axis (um): as the images are wide, or as the sensor has room. It is a whole number of periods of a
    /// lattice of pixels and a part, by which all phases of the lattice are on the images alike.
    pub fn pitch_um(&self, axis: usize, sensor: &SensorLattice, edge: f64) -> f64 {
        let image = 2.0 * edge * self.distance_um;
        sensor.pitch_um(axis, self.count[axis], (self.diameter_um + APART_UM).max(image))
    }

    /// Diameter (um) from which on neighbours of an arrangement overlap on a chip of the size of the sensor; infinite for one element.
    pub(super) fn diameters_below_um(count: [usize; 2], sensor: &SensorLattice) -> f64 {
        let largest = |axis: usize| match count[axis] {
            1 => f64::INFINITY,
            elements => sensor.pitch_um(axis, elements, f64::INFINITY),
        };
        largest(0).min(largest(1))
    }

    /// The largest distance (um) at which the images of a field stand beside one another on the sensor.
    pub fn largest_um(count: [usize; 2], sensor: &SensorLattice, edge: f64) -> f64 {
        let each = [0, 1].map(|a| sensor.sides_um[a] / count[a] as f64);
        each[0].min(each[1]) / (2.0 * edge)
    }

    /// True if the images of neighbours overlap on the sensor.
    pub fn overlaps(&self, sensor: &SensorLattice, edge: f64) -> bool {
        (0..2).any(|a| {
            self.count[a] > 1 && 2.0 * edge * self.distance_um > self.pitch_um(a, sensor, edge) + sensor.pitch_um
        })
    }

    fn masters(&self) -> Vec<([usize; 2], usize)> {
        let half = self.count.map(|n| n.div_ceil(2));
        (0..half[1])
            .flat_map(|n| (0..half[0]).map(move |m| [m, n]))
            .enumerate()
            .map(|(k, at)| (at, k))
            .collect()
    }

    /// The elements, row by row from the lowest, with the phases of a start.
    pub fn elements(&self, sensor: &SensorLattice, edge: f64, start: CameraStart, seed: u64) -> Vec<CameraElement> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let foci: Vec<f64> = self
            .masters()
            .iter()
            .map(|_| random.random_range(-FOCI..FOCI))
            .collect();
        let pitch = [0, 1].map(|a| self.pitch_um(a, sensor, edge));
        let mut all = Vec::new();
        for n in 0..self.count[1] {
            for m in 0..self.count[0] {
                let at = [m, n];
                let half_steps = [0, 1].map(|a| 2.0 * at[a] as f64 - (self.count[a] as f64 - 1.0));
                let part = [0, 1].map(|a| -half_steps[a] / self.count[a] as f64 * edge);
                let sines = sines_of(part);
                let mut element = CameraElement {
                    centre_um: [0, 1].map(|a| (500.0 * half_steps[a] * pitch[a]).round() / 1000.0),
                    diameter_um: self.diameter_um,
                    wedge: [0, 1].map(|a| {
                        (0.5 * half_steps[a] * self.steering_deg).to_radians().sin() - self.wedge_share * sines[a]
                    }),
                    hyperbola_um: [FOCUSED_UM, self.distance_um],
                    terms_rad: [0.0; TERMS],
                };
                let (master, _) = self.master(at);
                let focus = match start {
                    CameraStart::Identical | CameraStart::Parts => 0.0,
                    CameraStart::Foci | CameraStart::PartsAtFoci => foci[master],
                };
                let part = match start {
                    CameraStart::Identical | CameraStart::Foci => [0.0; 2],
                    CameraStart::Parts | CameraStart::PartsAtFoci => sines.map(|s| s * (1.0 - self.wedge_share)),
                };
                element.terms_rad = oblique(&element, part, self.distance_um * (1.0 + focus));
                all.push(element);
            }
        }
        all
    }

    /// Number of the element that another mirrors, and the axes along which it does.
    fn master(&self, at: [usize; 2]) -> (usize, [bool; 2]) {
        let half = self.count.map(|n| n.div_ceil(2));
        let mirror = [0, 1].map(|a| at[a] >= half[a]);
        let folded = [0, 1].map(|a| at[a].min(self.count[a] - 1 - at[a]));
        (folded[1] * half[0] + folded[0], mirror)
    }

    /// The terms that are free, master by master.
    fn free(&self) -> Vec<(usize, usize)> {
        let mut free = Vec::new();
        for (at, k) in self.masters() {
            let middle = [0, 1].map(|a| self.count[a] % 2 == 1 && at[a] == self.count[a] / 2);
            let x = mirrored_signs([middle[0], false]);
            let y = mirrored_signs([false, middle[1]]);
            free.extend((0..TERMS).filter(|t| x[*t] > 0.0 && y[*t] > 0.0).map(|t| (k, t)));
        }
        free
    }

    /// Best phases of a descent from a start.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn descend(
        &self,
        model: &CameraModel,
        start: &[CameraElement],
        steps: usize,
        progress: &dyn Progress,
    ) -> Result<(Vec<CameraElement>, Judged)> {
        let free = self.free();
        let count = self.count;
        let index = |k: usize| [k % count[0], k / count[0]];
        let roles: Vec<(usize, [f64; TERMS])> = (0..start.len())
            .map(|k| {
                let (master, mirror) = self.master(index(k));
                (master, mirrored_signs(mirror))
            })
            .collect();
        let of_master = |master: usize| {
            let at = roles.iter().position(|(m, _)| *m == master);
            at.expect("every master is an element")
        };
        let placed = |place: &[f64]| {
            let mut elements = start.to_vec();
            for ((master, term), v) in free.iter().zip(place) {
                for (element, (own, signs)) in elements.iter_mut().zip(&roles) {
                    if own == master {
                        element.terms_rad[*term] = signs[*term] * v;
                    }
                }
            }
            elements
        };
        let begin: Vec<f64> = free.iter().map(|(m, t)| start[of_master(*m)].terms_rad[*t]).collect();
        let found = lbfgs::minimise(
            begin,
            steps,
            LEAST_GAIN_DB,
            FIRST_STEP_RAD,
            |place, slopes| -> Result<f64> {
                progress.check_stopped()?;
                let judged = model.judge(&placed(place), true);
                // Decibels.
                let scale = 10.0 / std::f64::consts::LN_10 / judged.error;
                for ((master, term), slope) in free.iter().zip(slopes) {
                    let all = roles.iter().zip(&judged.slopes).filter(|((own, _), _)| own == master);
                    *slope = scale * all.map(|((_, signs), s)| signs[*term] * s[*term]).sum::<f64>();
                }
                Ok(-judged.psnr_db())
            },
        )?;
        let elements = placed(&found.place);
        let judged = model.judge(&elements, false);
        Ok((elements, judged))
    }
}

/// Sines of the direction of these tangents.
pub(super) fn sines_of(tangents: [f64; 2]) -> [f64; 2] {
    let length = (1.0 + tangents[0].powi(2) + tangents[1].powi(2)).sqrt();
    tangents.map(|t| t / length)
}

/// Terms by which an element focuses light that leaves its wedge with these sines onto the place of its chief ray on a sensor, all but
/// the hyperbola and a linear term.
fn oblique(element: &CameraElement, sines: [f64; 2], distance_um: f64) -> [f64; TERMS] {
    let rho = landing_um(sines, distance_um).unwrap_or([0.0; 2]);
    let r0 = (rho[0].powi(2) + rho[1].powi(2) + distance_um.powi(2)).sqrt();
    let k = TAU / FOCUSED_UM;
    let bare = CameraElement {
        terms_rad: [0.0; TERMS],
        ..element.clone()
    };
    fitted(|u| {
        let r = u.map(|v| v * element.radius_um());
        let change = r[0] * (r[0] - 2.0 * rho[0]) + r[1] * (r[1] - 2.0 * rho[1]);
        let path = change / ((r0 * r0 + change).sqrt() + r0);
        -k * (sines[0] * r[0] + sines[1] * r[1] + path) - bare.phase_rad(r)
    })
}
