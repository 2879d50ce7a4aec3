//! The camera model: from elements to the expected error of what is restored.

use std::f64::consts::PI;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use metalith_restoration::MEAN_LIGHT;
use metalith_sensor::Walls;

use super::element::{CameraElement, TERMS};
use super::light::CameraLight;
use super::pupil::{Transform, View};
use super::scene::{self, NaturalScene};
use super::search::sines_of;
use super::wiener::{Groups, Recorded};

/// Window that images of points are confined to unless a wedge smears them (um): twice the blur of the widest channel behind 400 um.
pub const WINDOW_UM: f64 = 180.0;

/// A part of the field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldPart {
    /// Tangents of its middle.
    pub tangents: [f64; 2],
    /// Share of the field.
    pub share: f64,
}

/// Settings of a model that do not depend on the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelSettings {
    pub scene: NaturalScene,
    /// Angle from the left to the right edge of the square scene (degrees).
    pub field_deg: f64,
    /// Wavelength of wedges (um).
    pub wedge_um: f64,
    /// With walls between the elements no image overlaps another.
    pub walls: Walls,
    /// Window that images of points are confined to (um).
    pub window_um: f64,
}

/// Everything but the elements.
pub struct CameraModel {
    light: CameraLight,
    groups: Groups,
    parts: Vec<FieldPart>,
    /// Tangents at the edges of the scene.
    edge: f64,
    distance_um: f64,
    wedge_um: f64,
    walls: Walls,
    perfect: bool,
}

/// What the model finds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// Mean square error of linear light, white being one.
    pub error: f64,
    /// Error of each part of the field.
    pub parts: Vec<f64>,
    /// Slope of the error by the terms of each element.
    pub slopes: Vec<[f64; TERMS]>,
    /// Electrons of white on the axis, channel by channel, and the time (s) after which they are there.
    pub white_e: Vec<f64>,
    pub time_s: f64,
}

impl Judged {
    /// Expected PSNR of linear light (dB).
    pub fn psnr_db(&self) -> f64 {
        -10.0 * self.error.log10()
    }
}

/// Light of an element in one part of the field.
struct Seen {
    element: usize,
    /// Signal over the root of the power of the noise, by channel.
    gains: Vec<f64>,
    place_um: [f64; 2],
}

impl CameraModel {
    /// The model of a camera whose sensor is at a distance (um), its pupils at `nodes` points along half of the field.
    pub fn new(light: CameraLight, settings: &ModelSettings, distance_um: f64, nodes: usize) -> Self {
        let ModelSettings {
            scene,
            field_deg,
            wedge_um,
            walls,
            window_um,
        } = *settings;
        let edge = (0.5 * field_deg).to_radians().tan();
        let planes = light.channels.len();
        let inverse = NaturalScene::inverse_covariance(planes, light.colours);
        let periods = (window_um / light.pitch_um).ceil() as usize;
        let groups = Groups::new(&scene, scene.pixel * distance_um, light.pitch_um, periods, inverse);
        let line = gauss(nodes);
        let parts = line
            .iter()
            .flat_map(|(y, b)| {
                line.iter().map(move |(x, a)| FieldPart {
                    tangents: [x * edge, y * edge],
                    share: a * b,
                })
            })
            .collect();
        Self {
            light,
            groups,
            parts,
            edge,
            distance_um,
            wedge_um,
            walls,
            perfect: false,
        }
    }

    /// The bound: elements of these places and diameters without any aberration.
    #[must_use]
    pub fn perfect(self) -> Self {
        Self { perfect: true, ..self }
    }

    /// Parts of the field: a quadrant, for elements stand symmetrically.
    pub fn parts(&self) -> &[FieldPart] {
        &self.parts
    }

    /// Distance of the sensor (um).
    pub fn distance_um(&self) -> f64 {
        self.distance_um
    }

    /// Expected error behind elements, with slopes if they are asked for.
    pub fn judge(&self, elements: &[CameraElement], sloped: bool) -> Judged {
        let area = |e: &CameraElement| PI * e.radius_um().powi(2);
        let etendue = |e: &CameraElement| area(e) * (self.light.pixel_um / self.distance_um).powi(2);
        let brightest = elements.iter().map(etendue).fold(0.0, f64::max);
        let time_s = self.light.exposed_s(brightest);
        let found: Vec<(f64, Vec<[f64; TERMS]>)> = self
            .parts
            .par_iter()
            .map(|part| self.judge_part(elements, part, time_s, sloped))
            .collect();
        let mut slopes = vec![[0.0; TERMS]; if sloped { elements.len() } else { 0 }];
        for (part, (_, own)) in self.parts.iter().zip(&found) {
            for (sum, own) in slopes.iter_mut().zip(own) {
                sum.iter_mut().zip(own).for_each(|(a, b)| *a += part.share * b);
            }
        }
        Judged {
            error: self.parts.iter().zip(&found).map(|(p, f)| p.share * f.0).sum(),
            parts: found.into_iter().map(|f| f.0).collect(),
            slopes,
            white_e: self
                .light
                .channels
                .iter()
                .map(|c| c.focused_e_s * brightest * time_s)
                .collect(),
            time_s,
        }
    }

    fn view(&self, part: &FieldPart, wavelength_um: f64, chief_um: f64) -> View {
        View {
            sines: sines_of(part.tangents),
            wavelength_um,
            wedge_um: self.wedge_um,
            chief_um,
            distance_um: self.distance_um,
            step: self.groups.step,
            steps: self.groups.steps,
            perfect: self.perfect,
        }
    }

    /// Elements that image a part onto the sensor, with the noise there.
    fn seen(&self, elements: &[CameraElement], part: &FieldPart, time_s: f64) -> Vec<Seen> {
        let landing = |e: &CameraElement| {
            let sines = sines_of(part.tangents);
            let at = super::pupil::landing_um([0, 1].map(|a| sines[a] + e.wedge[a]), self.distance_um)?;
            Some([0, 1].map(|a| e.centre_um[a] + at[a]))
        };
        let mut all = Vec::new();
        for (k, element) in elements.iter().enumerate() {
            let Some(place) = landing(element) else { continue };
            if (0..2).any(|a| place[a].abs() > 0.5 * self.light.sides_um[a]) || self.is_walled(elements, k, place) {
                continue;
            }
            let own = self.etendue(element, place);
            // Light of other elements at the same place.
            let mut other = 0.0;
            if self.walls == Walls::None {
                for (j, next) in elements.iter().enumerate() {
                    if j != k && self.sees(next, place) {
                        other += self.etendue(next, place);
                    }
                }
            }
            let gains = self
                .light
                .channels
                .iter()
                .map(|c| {
                    let signal = c.focused_e_s * own * time_s;
                    let foreign = c.focused_e_s * other * time_s;
                    let stray = c.stray_e_s * (own + other) * time_s;
                    let light = (signal + foreign + stray) * f64::from(MEAN_LIGHT);
                    let variance = self.light.variance_e2(light, time_s) + (foreign * scene::DEVIATION).powi(2);
                    signal / variance.sqrt() / self.light.pitch_um
                })
                .collect();
            all.push(Seen {
                element: k,
                gains,
                place_um: [0, 1].map(|a| -element.centre_um[a]),
            });
        }
        all
    }

    /// True if a wall stands between an element and a place: another element is nearer to it.
    fn is_walled(&self, elements: &[CameraElement], k: usize, place: [f64; 2]) -> bool {
        let far = |e: &CameraElement| (place[0] - e.centre_um[0]).hypot(place[1] - e.centre_um[1]);
        self.walls == Walls::BetweenElements && elements.iter().any(|e| far(e) < far(&elements[k]))
    }

    /// Area of an element times the projected solid angle of a pixel at a place on the sensor (um^2 sr), and the response of the pixel at
    /// the angle.
    fn etendue(&self, element: &CameraElement, place: [f64; 2]) -> f64 {
        let t2 = (0..2)
            .map(|a| ((place[a] - element.centre_um[a]) / self.distance_um).powi(2))
            .sum::<f64>();
        let response = self.light.angular_response.at_cosine((1.0 + t2).sqrt().recip());
        PI * (element.radius_um() * self.light.pixel_um / (self.distance_um * (1.0 + t2))).powi(2) * response
    }

    /// True if an element images a part of the scene onto a place.
    fn sees(&self, element: &CameraElement, place: [f64; 2]) -> bool {
        let t = [0, 1].map(|a| (place[a] - element.centre_um[a]) / self.distance_um);
        let out = sines_of(t);
        let sines = [0, 1].map(|a| out[a] - element.wedge[a]);
        let cos2 = 1.0 - sines[0].powi(2) - sines[1].powi(2);
        cos2 > 0.0 && sines.iter().all(|s| (s / cos2.sqrt()).abs() <= self.edge)
    }

    fn judge_part(
        &self,
        elements: &[CameraElement],
        part: &FieldPart,
        time_s: f64,
        sloped: bool,
    ) -> (f64, Vec<[f64; TERMS]>) {
        let seen = self.seen(elements, part, time_s);
        let channels = self.light.channels.len();
        let least = |s: &Seen| {
            let each = self.light.wavelengths_um.iter();
            each.filter_map(|um| self.view(part, *um, self.wedge_um).samples(&elements[s.element]))
                .max()
        };
        let pixel = |at: usize| -> f64 {
            let sinc = |u: f64| {
                if u == 0.0 {
                    1.0
                } else {
                    (PI * u * self.light.pixel_um).sin() / (PI * u * self.light.pixel_um)
                }
            };
            self.groups.frequency(at).map(sinc).iter().product()
        };
        let pixels: Vec<f64> = (0..self.groups.len()).map(pixel).collect();
        let transforms: Vec<Option<Transform>> = seen.iter().map(|s| least(s).map(Transform::new)).collect();
        let transfers: Vec<Vec<Vec<Complex64>>> = seen
            .par_iter()
            .zip(&transforms)
            .map(|(s, transform)| {
                let mut sums = vec![vec![Complex64::ZERO; self.groups.len()]; channels];
                let Some(transform) = transform else { return sums };
                let mut buffers: [Vec<Complex32>; 2] = Default::default();
                for (i, um) in self.light.wavelengths_um.iter().enumerate() {
                    let mut weighted: Vec<(f64, &mut [Complex64])> = sums
                        .iter_mut()
                        .zip(&self.light.channels)
                        .filter(|(_, c)| c.weights[i] > LEAST_WEIGHT)
                        .map(|(sum, c)| (c.weights[i], &mut sum[..]))
                        .collect();
                    if !weighted.is_empty() {
                        let view = self.view(part, *um, self.wedge_um);
                        view.add_transfer(&elements[s.element], transform, &mut buffers, &mut weighted);
                    }
                }
                for sum in &mut sums {
                    sum.iter_mut().zip(&pixels).for_each(|(h, p)| *h *= p);
                }
                sums
            })
            .collect();
        let recorded: Vec<Recorded<'_>> = seen
            .iter()
            .zip(&transfers)
            .flat_map(|(s, own)| {
                self.light.lattices.iter().map(move |(c, place)| Recorded {
                    plane: self.light.plane(*c),
                    transfer: &own[*c],
                    gain: s.gains[*c],
                    place_um: [0, 1].map(|a| place[a] + s.place_um[a]),
                })
            })
            .collect();
        if !sloped {
            return (self.groups.error(&recorded, 1.0, None), Vec::new());
        }
        let mut by_lattice = vec![vec![Complex64::ZERO; self.groups.len()]; recorded.len()];
        let error = self.groups.error(&recorded, 1.0, Some(&mut by_lattice));
        let lattices = self.light.lattices.len();
        let own: Vec<(usize, [f64; TERMS])> = seen
            .par_iter()
            .zip(&transforms)
            .enumerate()
            .map(|(k, (s, transform))| {
                let mut slopes = [0.0; TERMS];
                let Some(transform) = transform else {
                    return (s.element, slopes);
                };
                let mut by_channel = vec![vec![Complex64::ZERO; self.groups.len()]; channels];
                for ((c, _), slope) in self.light.lattices.iter().zip(&by_lattice[k * lattices..]) {
                    for ((sum, v), p) in by_channel[*c].iter_mut().zip(slope).zip(&pixels) {
                        *sum += v * p;
                    }
                }
                let mut buffers: [Vec<Complex32>; 3] = Default::default();
                for (i, um) in self.light.wavelengths_um.iter().enumerate() {
                    let used: Vec<(f64, &Vec<Complex64>)> = by_channel
                        .iter()
                        .zip(&self.light.channels)
                        .filter(|(_, c)| c.weights[i] > LEAST_WEIGHT)
                        .map(|(v, c)| (c.weights[i], v))
                        .collect();
                    if used.is_empty() {
                        continue;
                    }
                    let of = |at: usize| used.iter().map(|(w, v)| v[at] * *w).sum();
                    let view = self.view(part, *um, self.wedge_um);
                    view.add_slopes(&elements[s.element], transform, &mut buffers, of, &mut slopes);
                }
                (s.element, slopes)
            })
            .collect();
        let mut slopes = vec![[0.0; TERMS]; elements.len()];
        for (k, own) in own {
            slopes[k] = own;
        }
        (error, slopes)
    }
}

/// Share of a wavelength in a channel below which it is left out.
const LEAST_WEIGHT: f64 = 2e-3;

/// Places and weights of Gauss and Legendre from 0 to 1.
fn gauss(nodes: usize) -> Vec<(f64, f64)> {
    let n = nodes as f64;
    (0..nodes)
        .map(|k| {
            let mut x = (PI * (k as f64 + 0.75) / (n + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..50 {
                let (mut p, mut before) = (x, 1.0);
                for j in 2..=nodes {
                    let j = j as f64;
                    (p, before) = (((2.0 * j - 1.0) * x * p - (j - 1.0) * before) / j, p);
                }
                slope = n * (x * p - before) / (x * x - 1.0);
                x -= p / slope;
            }
            (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}
