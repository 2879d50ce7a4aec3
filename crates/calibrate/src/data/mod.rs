//! The measurements of a set as the statistics see them: whitened frames and widths, with what the lab states of them.

mod equations;
mod nuisance_fit;
mod nuisances;
mod registration;

use metalith_attribution::{MeasurementIndex, Measurements, PerMeasurement, ReferenceValue, References};
use nalgebra::{DMatrix, DVector};

use ndarray::{Array2, Zip};

pub(crate) use equations::FrameEquations;
pub(crate) use nuisances::BLACK_SIGMA_DN;
pub use nuisances::Nuisances;

use crate::grouping::Grouping;
use crate::optics::PixelGrid;

use crate::set::{ElementIndex, LedIndex, MeasuredSet, PerLed};
use metalith_sensor::frame::{expected, saturated};

/// Illumination and place of a measurement: measurements are grouped by both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasurementSetup {
    pub element: ElementIndex,
    pub led: LedIndex,
    /// Angle of incidence along x and y (rad).
    pub aoi_rad: [f64; 2],
    pub distance_um: f64,
}

/// Frames with their noise, and widths with theirs.
#[derive(Clone)]
pub struct Data {
    /// One over the standard deviation of each pixel (1 / DN), zero where a pixel does not count.
    pub weight: PerMeasurement<Array2<f32>>,
    /// DN less the stated black level.
    pub signal: PerMeasurement<Array2<f32>>,
    pub beam: PerMeasurement<MeasurementSetup>,
    /// DN for unit intensity.
    pub scale: PerMeasurement<f64>,
    /// Number of LEDs.
    pub leds: usize,
    pub pixel_um: f64,
    /// Standard deviation of the position of a window along each axis (um).
    pub registration_um: f64,
    /// Relative standard deviation of the flux of each LED.
    pub flux_sigma: f64,
    /// True if the scale of each measurement is fitted separately, because it is not stated.
    pub free_scale: bool,
    /// Widths by SEM, measured less designed (nm).
    pub references: References,
}

impl Data {
    /// Frames of a set, whitened by Poisson and read noise over their frames, or by the noise that comes with them. Saturated
    /// pixels do not count, nor do their neighbours, which the charge of a full pixel spills into. A pixel of few electrons has the
    /// noise that its neighbours expect.
    pub fn new(set: &MeasuredSet) -> Self {
        let camera = &set.camera;
        let black = camera.black_level_dn as f32;
        let signal: PerMeasurement<Array2<f32>> = set.measurements.iter().map(|c| c.dn.mapv(|v| v - black)).collect();
        let weight = set
            .measurements
            .iter()
            .zip(&signal)
            .map(|(c, signal)| {
                if let Some(noise) = &c.noise {
                    return noise.mapv(|variance| variance.sqrt().recip());
                }
                let full = saturated(&c.dn, camera.saturation_dn);
                let told = Zip::from(signal).and(&full).map_collect(|v, full| match full {
                    true => 0.0,
                    false => camera.electrons(f64::from(*v), c.frames) as f32,
                });
                let expected = expected(signal, &told);
                Zip::from(&expected).and(&full).map_collect(|v, full| match full {
                    true => 0.0,
                    false => camera.variance_dn2(f64::from(*v), c.frames).sqrt().recip() as f32,
                })
            })
            .collect();
        let beam = set.measurements.iter().map(|c| MeasurementSetup {
            element: c.element,
            led: c.led,
            aoi_rad: c.aoi_rad,
            distance_um: c.distance_um,
        });
        let widths = set.sem.iter().map(|site| ReferenceValue {
            deviation: site.measured_nm - site.designed_nm,
            sigma: site.sigma_nm,
        });
        Self {
            weight,
            signal,
            beam: beam.collect(),
            scale: set.measurements.iter().map(|c| c.scale_dn).collect(),
            leds: set.leds.len(),
            pixel_um: camera.pixel_um,
            registration_um: camera.registration_sigma_px * camera.pixel_um,
            flux_sigma: camera.flux_sigma,
            free_scale: set.free_scale,
            references: References {
                values: widths.collect(),
                offset_sigma: set.sem_offset_sigma_nm,
            },
        }
    }

    /// The same bench without measurements and widths.
    pub(crate) fn empty(&self) -> Self {
        Self {
            weight: PerMeasurement::default(),
            signal: PerMeasurement::default(),
            beam: PerMeasurement::default(),
            scale: PerMeasurement::default(),
            references: References {
                values: Vec::new(),
                ..self.references
            },
            ..*self
        }
    }

    /// Sum of squares of the images of some measurements over their noise, without the noise.
    pub(crate) fn energy(&self, used: &PerMeasurement<bool>) -> f64 {
        let of = |c: MeasurementIndex| {
            let pairs = self.signal[c].iter().zip(&self.weight[c]);
            pairs.map(|(v, w)| f64::from(v * w).powi(2)).sum::<f64>() - self.points(c) as f64
        };
        self.indices().filter(|&c| used[c]).map(of).sum::<f64>().max(0.0)
    }

    /// Scale of a measurement over what is stated by which an image fits it best; one where no light is.
    fn scale_of(&self, c: MeasurementIndex, image: &Array2<f32>) -> f64 {
        let mut sums = [0.0; 2];
        for ((v, m), w) in self.signal[c].iter().zip(image).zip(&self.weight[c]) {
            let [v, m] = [v, m].map(|a| f64::from(a * w));
            sums[0] += v * m;
            sums[1] += m * m;
        }
        let scale = sums[0] / sums[1] / self.scale[c];
        if scale > 0.0 && scale.is_finite() { scale } else { 1.0 }
    }

    /// All LEDs as stated: a relative flux of one.
    pub fn stated_flux(&self) -> PerLed<f64> {
        vec![1.0; self.leds].into()
    }

    /// The group of each measurement by a key; groups are numbered as they appear.
    fn groups<K: PartialEq>(&self, key: impl Fn(&MeasurementSetup) -> K) -> PerMeasurement<usize> {
        let mut known: Vec<K> = Vec::new();
        let group = |setup| {
            let own = key(setup);
            known.iter().position(|k| *k == own).unwrap_or_else(|| {
                known.push(own);
                known.len() - 1
            })
        };
        self.beam.iter().map(group).collect()
    }

    /// Measurements by distance, the nearest first.
    fn by_distance(&self) -> PerMeasurement<usize> {
        let mut distances: Vec<f64> = self.beam.iter().map(|b| b.distance_um).collect();
        distances.sort_by(f64::total_cmp);
        distances.dedup();
        let place = |b: &MeasurementSetup| distances.iter().position(|d| *d == b.distance_um).unwrap_or(0);
        self.beam.iter().map(place).collect()
    }
}

impl Measurements for Data {
    type Prediction = PixelGrid;
    type Nuisances = Nuisances;
    type Equations = FrameEquations;

    fn combine(parts: &[(&PixelGrid, f32)]) -> PixelGrid {
        PixelGrid::combine(parts)
    }

    fn mean_square(prediction: &PixelGrid) -> f64 {
        prediction.mean_square()
    }

    fn count(&self) -> usize {
        self.signal.len()
    }

    fn points(&self, measurement: MeasurementIndex) -> usize {
        self.weight[measurement].iter().filter(|w| **w > 0.0).count()
    }

    /// The flux of each LED, and the black level.
    fn shared(&self) -> usize {
        self.leds + 1
    }

    /// Measurements are left out by colour, by element and by distance.
    fn folds(&self) -> Vec<PerMeasurement<usize>> {
        vec![
            self.beam.iter().map(|b| b.led.into()).collect(),
            self.beam.iter().map(|b| b.element.into()).collect(),
            self.by_distance(),
        ]
    }

    /// Measurements of one element, in one direction and colour, are not independent.
    fn clusters(&self) -> PerMeasurement<usize> {
        self.groups(|b| (b.element, b.led, b.aoi_rad))
    }

    fn groupings(&self) -> Vec<PerMeasurement<usize>> {
        let of = |by: &Grouping| match by {
            Grouping::Element => self.groups(|b| b.element),
            Grouping::Colour => self.groups(|b| b.led),
            Grouping::Distance => self.groups(|b| b.distance_um),
            Grouping::Angle => self.groups(|b| b.aoi_rad),
        };
        Grouping::ALL.iter().map(of).collect()
    }

    fn fitted_nuisances(&self, predictions: &PerMeasurement<PixelGrid>, used: &PerMeasurement<bool>) -> Nuisances {
        Nuisances::registered(self, predictions).fit(self, predictions, used)
    }

    fn prior(&self, nuisances: &Nuisances, size: usize) -> DMatrix<f64> {
        nuisances.prior(self, size)
    }

    fn equations(
        &self,
        measurement: MeasurementIndex,
        nuisances: &Nuisances,
        prediction: &PixelGrid,
        derivatives: &[PixelGrid],
    ) -> FrameEquations {
        FrameEquations::new(self, measurement, nuisances, prediction, derivatives)
    }

    fn advance(&self, nuisances: &mut Nuisances, equations: &PerMeasurement<FrameEquations>, step: &DVector<f64>) {
        nuisances.advance(self, equations, step);
    }

    fn references(&self) -> &References {
        &self.references
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::Optic;
    use crate::set::PerLed;

    /// Edge of a window, its pixels, and the step of samples (um).
    const PIXELS: usize = 32;
    const PIXEL_UM: f64 = 1.0;
    const STEP_UM: f64 = 0.5;
    /// DN for unit intensity, and the noise of a pixel (DN).
    const SCALE_DN: f64 = 1000.0;
    const SIGMA_DN: f64 = 0.1;

    fn spot() -> PixelGrid {
        let n = 2 * PIXELS;
        let at = |i: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * STEP_UM;
        let samples: Vec<f32> = (0..n * n)
            .map(|i| (-(at(i % n).powi(2) + at(i / n).powi(2)) / 18.0).exp() as f32)
            .collect();
        let optic = Optic {
            pixel_um: PIXEL_UM,
            disc_um: [[0.0; 2]; 2],
            blur_um: 0.0,
        };
        PixelGrid::new(&samples, STEP_UM, &optic, PIXELS, PIXELS)
    }

    /// Two measurements in each of two colours, whose windows are off: with lamps of a flux over what is stated, a black level, and
    /// a scale of each over what is stated, which is one DN where scales are free.
    fn measured(
        shifts: [[f64; 2]; 4],
        (flux, black_dn): (&PerLed<f64>, f64),
        scales: Option<[f64; 4]>,
    ) -> (Data, PerMeasurement<PixelGrid>) {
        let beam = (0..4).map(|c| MeasurementSetup {
            element: ElementIndex::from(c / 2),
            led: LedIndex::from(c % 2),
            aoi_rad: [0.0; 2],
            distance_um: 100.0,
        });
        let beam: PerMeasurement<MeasurementSetup> = beam.collect();
        let image = spot();
        let signal: PerMeasurement<Array2<f32>> = beam
            .iter()
            .zip(shifts)
            .zip(scales.unwrap_or([SCALE_DN; 4]))
            .map(|((b, shift), scale)| {
                image
                    .pixels(shift)
                    .mapv(|v| (f64::from(v) * scale * flux[b.led] + black_dn) as f32)
            })
            .collect();
        let data = Data {
            weight: signal.iter().map(|s| s.mapv(|_| (1.0 / SIGMA_DN) as f32)).collect(),
            scale: vec![scales.map_or(SCALE_DN, |_| 1.0); signal.len()].into(),
            leds: flux.len(),
            pixel_um: PIXEL_UM,
            registration_um: 2.0,
            flux_sigma: 0.01,
            free_scale: scales.is_some(),
            references: References {
                values: Vec::new(),
                offset_sigma: 1.0,
            },
            beam,
            signal,
        };
        (data, vec![image; 4].into())
    }

    const SHIFTS: [[f64; 2]; 4] = [[0.3, -0.2], [2.2, 1.1], [-1.4, 0.6], [0.0, -3.1]];

    fn are_near(found: &PerMeasurement<[f64; 2]>, tolerance: f64) {
        for (found, shift) in found.iter().zip(SHIFTS) {
            for axis in [0, 1] {
                assert!((found[axis] - shift[axis]).abs() < tolerance, "{found:?} {shift:?}");
            }
        }
    }

    #[test]
    fn nuisances_are_fitted_as_they_were() {
        /// Relative to the noise: priors hold flux and black level back a little.
        const TOLERANCE: f64 = 2e-3;
        let (flux, black_dn): (PerLed<f64>, f64) = (vec![1.004, 0.993].into(), 0.2);
        let (data, images) = measured(SHIFTS, (&flux, black_dn), None);
        assert_eq!(data.folds()[2].raw, [0; 4]);
        assert_eq!(data.clusters().raw, [0, 1, 2, 3]);
        let found = data.fitted_nuisances(&images, &vec![true; 4].into());
        are_near(&found.shift_um, TOLERANCE);
        for (found, flux) in found.flux.iter().zip(&flux) {
            assert!((found - flux).abs() < TOLERANCE, "{found} {flux}");
        }
        assert!(
            (found.black_dn - black_dn).abs() < 10.0 * TOLERANCE,
            "{}",
            found.black_dn
        );
    }

    #[test]
    fn free_scales_are_fitted_wherever_they_are() {
        const TOLERANCE: f64 = 2e-3;
        let (flux, scales) = (vec![1.0; 2].into(), [400.0, 1700.0, 30.0, 52_000.0]);
        let (data, images) = measured(SHIFTS, (&flux, 0.2), Some(scales));
        let found = data.fitted_nuisances(&images, &vec![true; 4].into());
        are_near(&found.shift_um, TOLERANCE);
        for (found, scale) in found.scale.iter().zip(scales) {
            assert!((found / scale - 1.0).abs() < TOLERANCE, "{found} {scale}");
        }
    }
}
