//! What was measured, as the statistics see it: whitened frames and widths, with what the lab states of them.

use ndarray::{Array2, Zip};
use rayon::prelude::*;

use crate::set::{CaptureIndex, ElementIndex, LedIndex, MeasuredSet, PerCapture, PerLed, expected, saturated};

/// How a capture was lit and where it was taken: captures are grouped by this.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CaptureSetup {
    pub element: ElementIndex,
    pub led: LedIndex,
    /// Angle of incidence along x and y (rad).
    pub aoi_rad: [f64; 2],
    pub distance_um: f64,
}

/// A width by SEM.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WidthDeviation {
    /// Measured less designed (nm).
    pub deviation_nm: f64,
    /// One standard deviation (nm).
    pub sigma_nm: f64,
}

/// Frames with their noise, and widths with theirs.
#[derive(Clone)]
pub struct Data {
    /// One over the standard deviation of each pixel (1 / DN), zero where a pixel does not count.
    pub weight: PerCapture<Array2<f32>>,
    /// DN less the stated black level.
    pub signal: PerCapture<Array2<f32>>,
    pub beam: PerCapture<CaptureSetup>,
    /// DN for unit intensity.
    pub scale: PerCapture<f64>,
    /// Number of LEDs.
    pub leds: usize,
    pub pixel_um: f64,
    /// Standard deviation of the position of a window along each axis (um).
    pub registration_um: f64,
    /// Relative standard deviation of the flux of each LED.
    pub flux_sigma: f64,
    /// Widths by SEM.
    pub widths: Vec<WidthDeviation>,
    /// Standard deviation of the offset that all widths share (nm).
    pub width_offset_sigma_nm: f64,
}

impl Data {
    /// Frames of a set, whitened by Poisson and read noise over their frames, or by the noise that comes with them. Saturated
    /// pixels do not count, nor do their neighbours, which the charge of a full pixel spills into. A pixel of few electrons has the
    /// noise that its neighbours expect.
    pub fn new(set: &MeasuredSet) -> Self {
        let camera = &set.camera;
        let black = camera.black_level_dn as f32;
        let signal: PerCapture<Array2<f32>> = set.captures.iter().map(|c| c.dn.mapv(|v| v - black)).collect();
        let weight = set
            .captures
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
        let beam = set.captures.iter().map(|c| CaptureSetup {
            element: c.element,
            led: c.led,
            aoi_rad: c.aoi_rad,
            distance_um: c.distance_um,
        });
        let widths = set.sem.iter().map(|site| WidthDeviation {
            deviation_nm: site.measured_nm - site.designed_nm,
            sigma_nm: site.sigma_nm,
        });
        Self {
            weight,
            signal,
            beam: beam.collect(),
            scale: set.captures.iter().map(|c| c.scale_dn).collect(),
            leds: set.leds.len(),
            pixel_um: camera.pixel_um,
            registration_um: camera.registration_sigma_px * camera.pixel_um,
            flux_sigma: camera.flux_sigma,
            widths: widths.collect(),
            width_offset_sigma_nm: set.sem_offset_sigma_nm,
        }
    }

    /// All captures.
    pub fn captures(&self) -> impl Iterator<Item = CaptureIndex> + use<> {
        (0..self.signal.len()).map(CaptureIndex::from)
    }

    /// One value for each capture, computed in parallel.
    pub fn for_captures<T: Send>(&self, of: impl Fn(CaptureIndex) -> T + Sync + Send) -> PerCapture<T> {
        let all: Vec<T> = (0..self.signal.len())
            .into_par_iter()
            .map(|c| of(CaptureIndex::from(c)))
            .collect();
        all.into()
    }

    /// The LED of each capture.
    pub fn led_of_captures(&self) -> PerCapture<LedIndex> {
        self.beam.iter().map(|b| b.led).collect()
    }

    /// All LEDs as stated: a relative flux of one.
    pub fn stated_flux(&self) -> PerLed<f64> {
        vec![1.0; self.leds].into()
    }

    /// Pixels of a capture that count.
    pub fn pixels(&self, capture: CaptureIndex) -> usize {
        self.weight[capture].iter().filter(|w| **w > 0.0).count()
    }
}
