//! The simulated bench: from pillars to the expected pixels of each measurement, under any perturbation.

mod light;
#[cfg(test)]
mod scene;
mod view;

use std::borrow::Cow;

use ndarray::Array2;
use rayon::prelude::*;

pub(crate) use light::IlluminatedChip;

use super::optics::{Optic, PixelGrid, Quadrature};
use super::set::{
    ElementIndex, LedIndex, MeasuredSet, Measurement, MeasurementIndex, PerElement, PerLed, PerMeasurement,
};
use metalith_core::numerical_aperture;
use metalith_optics::{DrawnElement, GeometryChange, KernelFilter, Perturbation, veiled};
use metalith_sensor::RelayCamera;
use metalith_wave::propagation::{Distances, DistancesPlan};

/// Sampling of the simulated bench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BenchSampling {
    /// Largest step in wavelength, as a share of the full width of the spectrum.
    pub spectrum: f64,
    /// Largest step in wavelength (nm).
    pub step_nm: f64,
    /// Sample spacing of the intensity (um); less where a lens is so steep that its images are finer.
    pub step_um: f64,
    /// Samples around each window, for registration, blur and borders; more where pixels or windows are large.
    pub margin: usize,
}

impl Default for BenchSampling {
    fn default() -> Self {
        Self {
            spectrum: 0.13,
            step_nm: 2.5,
            step_um: 0.5,
            margin: 22,
        }
    }
}

/// A measured set with everything that its simulation can compute in advance.
pub struct Bench<'a> {
    set: &'a MeasuredSet,
    quadratures: PerLed<Quadrature>,
    /// Index of the first wavelength of each LED in the list of all wavelengths.
    first: PerLed<usize>,
    groups: Vec<FocusSeries>,
    /// The elements as drawn.
    drawn: PerElement<DrawnElement<'a>>,
    /// Windows move with the image when the incident light is tilted: registration is a nuisance parameter, and
    /// the intensity in a fixed window is not a polynomial of the tilt.
    pub follows: bool,
}

/// Step over the half of the finest period of an image.
const OF_NYQUIST: f64 = 0.95;

/// Step that the intensity of an element in the colour of a measurement is resolved by, at the nearest distance that it was taken at (um):
/// light from both sides of the aperture interferes with a period of half a wavelength over the sine of its half-angle.
fn resolved_um(set: &MeasuredSet, measurement: &Measurement) -> f64 {
    let alike = set
        .measurements
        .iter()
        .filter(|c| (c.element, c.led) == (measurement.element, measurement.led));
    let nearest_um = alike.map(|c| c.distance_um).fold(f64::INFINITY, f64::min);
    let radius_um = 0.5 * set.elements[measurement.element].aperture_diameter_um;
    OF_NYQUIST * 0.25e-3 * set.leds[measurement.led].centre_nm / numerical_aperture(radius_um, nearest_um)
}

/// Standard deviations of its place by which a window can be moved before its surroundings end.
const PLACE_SIGMAS: f64 = 3.0;

/// Margin (um) to compute around a window that reaches so far from its middle along an axis (um), so that nothing that
/// is faded out comes into it, wherever it is: the fade is a share of window and surroundings.
fn margin_um(half_um: f64, camera: &RelayCamera) -> f64 {
    let moved = PLACE_SIGMAS * camera.registration_sigma_px * camera.pixel_um;
    (2.0 * PixelGrid::FADED * half_um + moved) / (1.0 - 2.0 * PixelGrid::FADED)
}

/// Measurements that differ only in their distance.
struct FocusSeries {
    element: ElementIndex,
    led: LedIndex,
    aoi_rad: [f64; 2],
    centre_um: [f64; 2],
    measurements: Vec<MeasurementIndex>,
    plan: DistancesPlan,
}

impl<'a> Bench<'a> {
    /// Plan the simulation of a set.
    pub fn new(set: &'a MeasuredSet, sampling: BenchSampling) -> Self {
        let (low, high) = set.stack.cell.range_um();
        let quadratures: PerLed<_> = set
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
        let mut groups: Vec<FocusSeries> = Vec::new();
        for (i, c) in set.measurements.iter_enumerated() {
            let same = groups.iter_mut().find(|g| {
                (g.element, g.led, g.aoi_rad, g.centre_um) == (c.element, c.led, c.aoi_rad, c.window_centre_um)
            });
            if let Some(group) = same {
                group.measurements.push(i);
                continue;
            }
            let half_um = 0.5 * set.camera.rows.max(set.camera.cols) as f64 * set.camera.pixel_um;
            let usual_um = sampling.margin as f64 * sampling.step_um;
            let planes = Distances {
                lattice: set.elements[c.element].pillars.lattice,
                radius_um: 0.5 * set.elements[c.element].aperture_diameter_um,
                centre_um: c.window_centre_um,
                half_width_um: half_um + (margin_um(half_um, &set.camera) - usual_um).max(0.0),
                step_um: sampling.step_um.min(resolved_um(set, c)),
            };
            // As far as with the usual step.
            let margin = (usual_um / planes.step_um).round() as usize;
            groups.push(FocusSeries {
                element: c.element,
                led: c.led,
                aoi_rad: c.aoi_rad,
                centre_um: c.window_centre_um,
                measurements: vec![i],
                plan: DistancesPlan::new(planes, margin),
            });
        }
        Self {
            set,
            quadratures,
            first,
            groups,
            drawn: set
                .elements
                .iter()
                .map(|e| {
                    DrawnElement::new(&e.pillars, 0.5 * e.aperture_diameter_um)
                        .of_shape(set.stack.cell.shape)
                        .placed(e.centre_um)
                        .with_axis(e.axis_um)
                })
                .collect(),
            follows: true,
        }
    }

    /// The measured set that is simulated.
    pub fn set(&self) -> &'a MeasuredSet {
        self.set
    }

    /// Memory of the pixel grids of all captures, about (bytes): the bins that the light of each lens reaches.
    pub fn grid_bytes(&self) -> f64 {
        let of_group = |g: &FocusSeries| {
            let first = &self.set.measurements[g.measurements[0]];
            let lit = OF_NYQUIST * g.plan.step_um() / resolved_um(self.set, first);
            g.measurements.len() as f64 * PixelGrid::bytes_of(g.plan.window() as f64 * lit.min(1.0))
        };
        self.groups.iter().map(of_group).sum()
    }

    /// All wavelengths at which cells are needed (nm).
    pub fn wavelengths_nm(&self) -> Vec<f64> {
        self.quadratures
            .iter()
            .flat_map(|q| q.wavelengths_nm.iter().copied())
            .collect()
    }

    /// Smallest and largest width of the layout (nm).
    pub fn widths_nm(&self) -> (f64, f64) {
        let all = self
            .set
            .elements
            .iter()
            .flat_map(|e| e.pillars.number.iter().filter(|w| **w > 0));
        all.fold((f64::MAX, 0.0), |(a, b), &w| (a.min(f64::from(w)), b.max(f64::from(w))))
    }

    /// Width added to the pillar at a site of an element by bias and density (nm).
    pub fn bias_nm(&self, element: ElementIndex, site: usize, geometry: &GeometryChange) -> f64 {
        self.drawn[element].bias_nm(site, geometry)
    }

    /// Pixel values of each measurement, before registration, flux and black level are applied.
    pub fn grids(&self, intensities: &PerMeasurement<Vec<f32>>, perturbation: &Perturbation) -> Vec<PixelGrid> {
        self.grids_with(intensities, perturbation, 0.0)
    }

    /// Images with the places at which declared kernels are evaluated moved by `moved` of the distance between two.
    pub fn grids_with(
        &self,
        intensities: &PerMeasurement<Vec<f32>>,
        perturbation: &Perturbation,
        moved: f64,
    ) -> Vec<PixelGrid> {
        let camera = &self.set.camera;
        let work: Vec<(&FocusSeries, MeasurementIndex)> = {
            let mut work: Vec<_> = self
                .groups
                .iter()
                .flat_map(|g| g.measurements.iter().map(move |&c| (g, c)))
                .collect();
            work.sort_by_key(|w| w.1);
            work
        };
        // Most windows are alike, and so are the filters of kernels on them.
        let mut kernels: Vec<(usize, f64, Option<KernelFilter>)> = Vec::new();
        for plan in self.groups.iter().map(|g| &g.plan) {
            let (n, step) = (plan.window(), plan.step_um());
            if !kernels.iter().any(|k| (k.0, k.1) == (n, step)) {
                kernels.push((n, step, perturbation.camera.kernels_on_places((n, n), step, moved)));
            }
        }
        work.par_iter()
            .map(|(group, measurement)| {
                let centre = self.set.elements[group.element].centre_um;
                let z = self.set.measurements[*measurement].distance_um + perturbation.path.added_distance_um(centre);
                let optic = Optic {
                    pixel_um: camera.pixel_um,
                    disc_um: self.disc_um(group, z, perturbation),
                    blur_um: perturbation.camera.pixel_blur_um.hypot(camera.relay_blur_um),
                };
                let stray = perturbation.camera.stray_light;
                let (step, n) = (group.plan.step_um(), group.plan.window());
                let off = self.off_um(group, z, perturbation);
                let mut light = Cow::Borrowed(intensities[*measurement].as_slice());
                let own = kernels.iter().find(|k| (k.0, k.1) == (n, step));
                if let Some(kernels) = own.and_then(|k| k.2.as_ref()) {
                    light = Cow::Owned(filtered(kernels, &light, n));
                }
                if stray != 0.0 {
                    let mean = window_mean(&light, n, self.set.camera.pixel_um / step, camera);
                    let veiled = light.iter().map(|v| veiled(f64::from(*v), mean, stray) as f32);
                    light = Cow::Owned(veiled.collect());
                }
                PixelGrid::new(&light, step, &optic, camera.rows, camera.cols).moved(off)
            })
            .collect()
    }

    /// Images of the two radii of the source disc on the sensor (um).
    fn disc_um(&self, group: &FocusSeries, z: f64, perturbation: &Perturbation) -> [[f64; 2]; 2] {
        let radius = 0.5 * self.set.divergence_rad * (1.0 + perturbation.light.source_size);
        let [x, y] = Self::landing_um(group, z);
        [x.map(|v| v * radius), y.map(|v| v * radius)]
    }

    /// Shift of the image for a tilt of the incident light by one radian about each axis (um).
    fn landing_um(group: &FocusSeries, z: f64) -> [[f64; 2]; 2] {
        let [cx, cy] = group.centre_um;
        let r = (cx * cx + cy * cy + z * z).sqrt();
        let (sx, sy, sz) = (cx / r, cy / r, z / r);
        // Light lands at z s / sz; sines of incidence change by the cosine of the angle on each axis.
        let [ax, ay] = group.aoi_rad.map(f64::cos);
        let cross = sx * sy / sz.powi(3);
        [
            [z * (1.0 / sz + sx * sx / sz.powi(3)) * ax, z * cross * ax],
            [z * cross * ay, z * (1.0 / sz + sy * sy / sz.powi(3)) * ay],
        ]
    }

    /// Shift of the image by tilted light that the windows follow (um); zero if they do not.
    fn off_um(&self, group: &FocusSeries, z: f64, perturbation: &Perturbation) -> [f64; 2] {
        if !self.follows {
            return [0.0; 2];
        }
        let [x, y] = Self::landing_um(group, z);
        let [tx, ty] = perturbation.path.tilt_mrad.map(|t| t * 1e-3);
        [0, 1].map(|axis| x[axis] * tx + y[axis] * ty)
    }
}

/// The light of a square of samples with what declared kernels add.
fn filtered(kernels: &KernelFilter, light: &[f32], n: usize) -> Vec<f32> {
    let mut image = Array2::from_shape_fn((n, n), |(y, x)| f64::from(light[y * n + x]));
    kernels.apply(&mut image);
    image.iter().map(|v| *v as f32).collect()
}

/// Mean intensity over each pixel of a window that is centred in `n` x `n` samples.
fn window_mean(intensity: &[f32], n: usize, samples_per_pixel: f64, camera: &RelayCamera) -> f64 {
    let range = |pixels: usize| {
        let wide = ((pixels as f64 * samples_per_pixel).round() as usize).clamp(1, n);
        (n - wide) / 2..(n + wide) / 2
    };
    let (rows, cols) = (range(camera.rows), range(camera.cols));
    let sum: f32 = rows
        .clone()
        .map(|y| intensity[y * n..][cols.clone()].iter().sum::<f32>())
        .sum();
    f64::from(sum / (rows.len() * cols.len()) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;
    use metalith_gds::extract::PillarsAt;

    /// Windows of a relay are as they were; those of large pixels, and large ones, have room to be moved in.
    #[test]
    fn nothing_that_is_faded_out_comes_into_a_window() {
        /// A window is a whole number of samples (um).
        const ROUNDING_UM: f64 = 0.6;
        /// Share of a step by which a whole number of them may be off: rounding.
        const ROUNDING: f64 = 1e-9;
        let folder = tempfile::tempdir().unwrap();
        metalith_testing::session::small_set(folder.path());
        let mut set = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
        let usual = BenchSampling::default().margin;
        for (pixels, pixel_um, is_usual) in [
            (48, 0.5, true),
            (128, 0.5, true),
            (16, 5.86, false),
            (64, 5.86, false),
            (512, 0.5, false),
        ] {
            (set.camera.rows, set.camera.cols, set.camera.pixel_um) = (pixels, pixels, pixel_um);
            let bench = Bench::new(&set, BenchSampling::default());
            let plan = &bench.groups[0].plan;
            let (n, step) = (plan.window() as f64, plan.step_um());
            let window_um = pixels as f64 * pixel_um;
            let faded_um = PixelGrid::FADED * n * step;
            let room_um = 0.5 * (n * step - window_um) - faded_um;
            let moved_um = PLACE_SIGMAS * set.camera.registration_sigma_px * pixel_um;
            assert!(room_um > moved_um - ROUNDING_UM, "{pixels} x {pixel_um}: {room_um}");
            let margin = (usual as f64 * BenchSampling::default().step_um / step - ROUNDING).ceil() as usize;
            let inner = (window_um / step).ceil() as usize + 2 * margin;
            assert_eq!(plan.window() == inner + inner % 2, is_usual, "{pixels} x {pixel_um}");
        }
    }
}
