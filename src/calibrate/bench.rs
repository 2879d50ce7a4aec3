//! The bench in the computer: from pillars to what each capture should show, whatever departs from what is
//! stated.

use std::sync::OnceLock;

use num_complex::Complex32;
use rayon::prelude::*;

use super::cells::CellTable;
use super::density;
use super::departure::{Departure, Geometry, LightChange};
use super::optics::{Optic, PixelGrid, Planes, Planned, Quadrature, Scratch, cis};
use super::set::{Camera, MeasuredSet};
use super::zernike;
use crate::error::{Error, Result};
use crate::progress::Progress;

/// Local biases that differ by less than this share a table entry [nm]; it is 3 mrad of phase.
const BIAS_STEP_NM: f64 = 0.1;

/// How finely a bench is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Wavelengths are at most this share of a spectrum's full width apart.
    pub spectrum: f64,
    /// And at most so far [nm].
    pub step_nm: f64,
    /// Distance of the samples of the intensity [um].
    pub step_um: f64,
    /// Samples around each window that placement, blur and borders may use up.
    pub margin: usize,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            spectrum: 0.13,
            step_nm: 2.5,
            step_um: 0.5,
            margin: 22,
        }
    }
}

/// A set, planned.
pub struct Bench<'a> {
    set: &'a MeasuredSet,
    quadratures: Vec<Quadrature>,
    /// Where the wavelengths of each LED begin among all.
    first: Vec<usize>,
    groups: Vec<Group>,
    /// Area fraction around each site of each element, made when first asked for.
    fill: Vec<OnceLock<Vec<f32>>>,
}

/// Captures that differ in their distance alone.
struct Group {
    element: usize,
    led: usize,
    aoi_rad: [f64; 2],
    centre_um: [f64; 2],
    captures: Vec<usize>,
    plan: Planned,
}

/// Which table entry each site of an element has.
struct Sites {
    /// Zero where light is blocked.
    class: Vec<u16>,
    /// Width of each class [nm]; that of class zero is of no use.
    width_nm: Vec<f64>,
    /// Sites in each class.
    count: Vec<u32>,
}

impl<'a> Bench<'a> {
    /// Plan a set.
    pub fn new(set: &'a MeasuredSet, sampling: Sampling) -> Self {
        let (low, high) = set.stack.film.range_um();
        let quadratures: Vec<_> = set
            .leds
            .iter()
            .map(|led| {
                let step = (sampling.spectrum * led.fwhm_nm).min(sampling.step_nm);
                Quadrature::new(*led, step, (low * 1e3, high * 1e3))
            })
            .collect();
        let first = quadratures
            .iter()
            .scan(0, |at, q| {
                let first = *at;
                *at += q.wavelengths_nm.len();
                Some(first)
            })
            .collect();
        let mut groups: Vec<Group> = Vec::new();
        for (i, c) in set.captures.iter().enumerate() {
            let same = groups.iter_mut().find(|g| {
                (g.element, g.led, g.aoi_rad, g.centre_um) == (c.element, c.led, c.aoi_rad, c.window_centre_um)
            });
            if let Some(group) = same {
                group.captures.push(i);
                continue;
            }
            let longest = set.camera.rows.max(set.camera.cols) as f64;
            let planes = Planes {
                lattice: set.elements[c.element].pillars.lattice,
                radius_um: 0.5 * set.elements[c.element].aperture_diameter_um,
                centre_um: c.window_centre_um,
                half_width_um: 0.5 * longest * set.camera.pixel_um,
                step_um: sampling.step_um,
            };
            groups.push(Group {
                element: c.element,
                led: c.led,
                aoi_rad: c.aoi_rad,
                centre_um: c.window_centre_um,
                captures: vec![i],
                plan: Planned::new(planes, sampling.margin),
            });
        }
        Self {
            set,
            quadratures,
            first,
            groups,
            fill: set.elements.iter().map(|_| OnceLock::new()).collect(),
        }
    }

    /// The set that it stands for.
    pub fn set(&self) -> &'a MeasuredSet {
        self.set
    }

    /// All wavelengths that cells are needed at [nm].
    pub fn wavelengths_nm(&self) -> Vec<f64> {
        self.quadratures
            .iter()
            .flat_map(|q| q.wavelengths_nm.iter().copied())
            .collect()
    }

    /// Least and greatest width of the layout [nm].
    pub fn widths_nm(&self) -> (f64, f64) {
        let all = self
            .set
            .elements
            .iter()
            .flat_map(|e| e.pillars.width_nm.iter().filter(|w| **w > 0));
        all.fold((f64::MAX, 0.0), |(a, b), &w| (a.min(f64::from(w)), b.max(f64::from(w))))
    }

    /// Width added to the pillar at a site by bias and density [nm].
    pub fn bias_nm(&self, element: usize, site: usize, geometry: &Geometry) -> f64 {
        let density = if geometry.cd_bias_density_nm == 0.0 {
            0.0
        } else {
            geometry.cd_bias_density_nm * f64::from(self.fill(element)[site])
        };
        geometry.cd_bias_nm + density
    }

    /// Intensity around the window of each capture, for each of `lights`: `[light][capture][sample]`.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn intensities(
        &self,
        cells: &CellTable,
        departure: &Departure,
        lights: &[LightChange],
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<Vec<f32>>>> {
        let sites: Vec<Sites> = (0..self.set.elements.len())
            .map(|e| self.sites(e, &departure.geometry))
            .collect();
        let tasks: Vec<(usize, Vec<Vec<Vec<f32>>>)> = self
            .groups
            .par_iter()
            .enumerate()
            .map(|(g, group)| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                Ok((g, self.group(group, &sites[group.element], cells, departure, lights)))
            })
            .collect::<Result<_>>()?;
        let mut out = vec![vec![Vec::new(); self.set.captures.len()]; lights.len()];
        for (g, of_lights) in tasks {
            for (l, planes) in of_lights.into_iter().enumerate() {
                for (plane, &capture) in planes.into_iter().zip(&self.groups[g].captures) {
                    out[l][capture] = plane;
                }
            }
        }
        Ok(out)
    }

    /// What the pixels of each capture see, before placement, flux and black level.
    pub fn grids(&self, intensities: &[Vec<f32>], departure: &Departure) -> Vec<PixelGrid> {
        let camera = &self.set.camera;
        let work: Vec<(&Group, usize)> = {
            let mut work: Vec<_> = self
                .groups
                .iter()
                .flat_map(|g| g.captures.iter().map(move |&c| (g, c)))
                .collect();
            work.sort_by_key(|w| w.1);
            work
        };
        work.par_iter()
            .map(|(group, capture)| {
                let z = self.set.captures[*capture].distance_um + departure.path.gap_um;
                let optic = Optic {
                    pixel_um: camera.pixel_um,
                    disc_um: self.disc_um(group, z, departure),
                    blur_um: departure.camera.pixel_blur_um,
                };
                let stray = departure.camera.stray_light as f32;
                let step = group.plan.step_um();
                if stray == 0.0 {
                    return PixelGrid::new(&intensities[*capture], step, &optic, camera.rows, camera.cols);
                }
                let mean = window_mean(
                    &intensities[*capture],
                    group.plan.window(),
                    self.set.camera.pixel_um / step,
                    camera,
                );
                let veiled: Vec<f32> = intensities[*capture].iter().map(|v| v + stray * (mean - v)).collect();
                PixelGrid::new(&veiled, step, &optic, camera.rows, camera.cols)
            })
            .collect()
    }

    fn group(
        &self,
        group: &Group,
        sites: &Sites,
        cells: &CellTable,
        departure: &Departure,
        lights: &[LightChange],
    ) -> Vec<Vec<Vec<f32>>> {
        let set = self.set;
        let lattice = set.elements[group.element].pillars.lattice;
        let n = lattice.sites();
        let path = &departure.path;
        let distances: Vec<f64> = group
            .captures
            .iter()
            .map(|&c| set.captures[c].distance_um + path.gap_um)
            .collect();
        let quadrature = &self.quadratures[group.led];
        let weights: Vec<Vec<f64>> = lights
            .iter()
            .map(|l| quadrature.weights(l.shift_nm(group.led), 1.0 + l.led_width))
            .collect();
        let samples = group.plan.window() * group.plan.window();
        let mut sums = vec![vec![vec![0.0f32; samples]; distances.len()]; lights.len()];
        let mut scratch = Scratch::default();
        let mut planes = vec![Vec::new(); distances.len()];
        let sine = |axis: usize| (group.aoi_rad[axis] + path.tilt_mrad[axis] * 1e-3).sin();
        let missing = departure.geometry.missing_pillars;
        let wavefront_um = (!departure.geometry.wavefront_nm.is_empty()).then(|| {
            let radius = 0.5 * set.elements[group.element].aperture_diameter_um;
            zernike::map(&departure.geometry.wavefront_nm, lattice, radius)
        });
        let (narrow, wide) = self.widths_nm();
        for (k, nm) in quadrature.wavelengths_nm.iter().enumerate() {
            let at = self.first[group.led] + k;
            let um = nm * 1e-3;
            let bare = cells.bare(at);
            let zero_order = departure.geometry.zero_order as f32;
            let mut haze = 0.0f64;
            let table: Vec<Complex32> = sites
                .width_nm
                .iter()
                .zip(&sites.count)
                .enumerate()
                .map(|(class, (width, &count))| {
                    if class == 0 {
                        return Complex32::ZERO;
                    }
                    let place = (2.0 * width - narrow - wide) / (wide - narrow).max(1.0);
                    let t = cells.at(at, *width) * (1.0 + legendre(&departure.geometry.transmission, place)) as f32;
                    haze += f64::from(count) * f64::from((t - bare).norm_sqr());
                    t + (bare - t) * missing as f32 + zero_order
                })
                .collect();
            let wave = |axis: usize| -> Vec<Complex32> {
                (0..n)
                    .map(|i| {
                        let x = lattice.coordinate_um(i);
                        // A source at a finite distance adds the sag of its sphere; 1 / m is 1e-6 / um.
                        cis((x * sine(axis) + 0.5e-6 * path.source_per_m * x * x) / um)
                    })
                    .collect()
            };
            let (wx, wy) = (wave(0), wave(1));
            let fill = |iy: usize, row: &mut [Complex32]| {
                let classes = &sites.class[iy * n..(iy + 1) * n];
                for ((to, &class), x) in row.iter_mut().zip(classes).zip(&wx) {
                    *to = table[usize::from(class)] * x * wy[iy];
                }
                if let Some(path) = &wavefront_um {
                    for (to, p) in row.iter_mut().zip(&path[iy * n..]) {
                        *to *= cis(f64::from(*p) / um);
                    }
                }
            };
            group.plan.intensities(um, &distances, &fill, &mut scratch, &mut planes);
            for (d, plane) in planes.iter_mut().enumerate() {
                if missing > 0.0 {
                    // What missing pillars take from the wave they scatter, each on its own.
                    let [x, y] = group.centre_um;
                    let r2 = x * x + y * y + distances[d].powi(2);
                    let area = lattice.pitch_um().powi(2) / (um * r2) * distances[d];
                    let level = (missing * (1.0 - missing) * haze * area * area) as f32;
                    plane.iter_mut().for_each(|v| *v += level);
                }
                for (sum, weights) in sums.iter_mut().zip(&weights) {
                    let w = weights[k] as f32;
                    for (to, v) in sum[d].iter_mut().zip(plane.iter()) {
                        *to += w * v;
                    }
                }
            }
        }
        sums
    }

    /// Images of the two radii of the source disc on the sensor [um].
    fn disc_um(&self, group: &Group, z: f64, departure: &Departure) -> [[f64; 2]; 2] {
        let [cx, cy] = group.centre_um;
        let r = (cx * cx + cy * cy + z * z).sqrt();
        let (sx, sy, sz) = (cx / r, cy / r, z / r);
        let radius = 0.5 * self.set.divergence_rad * (1.0 + departure.light.source_size);
        // Landing is z s / sz; sines of incidence change by the cosine of the angle on each axis.
        let [ax, ay] = group.aoi_rad.map(|a| radius * a.cos());
        let cross = sx * sy / sz.powi(3);
        [
            [z * (1.0 / sz + sx * sx / sz.powi(3)) * ax, z * cross * ax],
            [z * cross * ay, z * (1.0 / sz + sy * sy / sz.powi(3)) * ay],
        ]
    }

    fn sites(&self, element: usize, geometry: &Geometry) -> Sites {
        let measured = &self.set.elements[element];
        let lattice = measured.pillars.lattice;
        let n = lattice.sites();
        let radius = 0.5 * measured.aperture_diameter_um;
        let [ox, oy] = geometry.aperture_offset_um;
        let mut levels: std::collections::BTreeMap<(u16, i32), u16> = std::collections::BTreeMap::new();
        let mut out = Sites {
            class: vec![0; n * n],
            width_nm: vec![0.0],
            count: vec![0],
        };
        for (site, &w) in measured.pillars.width_nm.iter().enumerate() {
            if w == 0 {
                continue;
            }
            if ox != 0.0 || oy != 0.0 {
                let (x, y) = (
                    lattice.coordinate_um(site % n) - ox,
                    lattice.coordinate_um(site / n) - oy,
                );
                if x * x + y * y > radius * radius {
                    continue;
                }
            }
            let bias = self.bias_nm(element, site, geometry);
            let level = if geometry.cd_bias_density_nm == 0.0 {
                0
            } else {
                (bias / BIAS_STEP_NM).round() as i32
            };
            let class = *levels.entry((w, level)).or_insert_with(|| {
                let bias = if geometry.cd_bias_density_nm == 0.0 {
                    bias
                } else {
                    f64::from(level) * BIAS_STEP_NM
                };
                out.width_nm.push(f64::from(w) + bias);
                out.count.push(0);
                (out.width_nm.len() - 1) as u16
            });
            out.class[site] = class;
            out.count[usize::from(class)] += 1;
        }
        out
    }

    /// Area fraction around each site.
    fn fill(&self, element: usize) -> &[f32] {
        self.fill[element].get_or_init(|| density::fill(&self.set.elements[element].pillars))
    }
}

/// Sum of Legendre polynomials from the first on.
pub fn legendre(coefficients: &[f64], x: f64) -> f64 {
    let (mut before, mut now, mut sum) = (1.0, x, 0.0);
    for (k, c) in coefficients.iter().enumerate() {
        sum += c * now;
        let n = k as f64 + 1.0;
        (before, now) = (now, ((2.0 * n + 1.0) * x * now - n * before) / (n + 1.0));
    }
    sum
}

/// Mean intensity over the pixels of a window that stands in the middle of `n` x `n` samples.
fn window_mean(intensity: &[f32], n: usize, samples_per_pixel: f64, camera: &Camera) -> f32 {
    let range = |pixels: usize| {
        let wide = ((pixels as f64 * samples_per_pixel).round() as usize).clamp(1, n);
        (n - wide) / 2..(n + wide) / 2
    };
    let (rows, cols) = (range(camera.rows), range(camera.cols));
    let sum: f32 = rows
        .clone()
        .map(|y| intensity[y * n..][cols.clone()].iter().sum::<f32>())
        .sum();
    sum / (rows.len() * cols.len()) as f32
}
