//! Planes along z of a layout without a design, and the memory that PSFs take.

use metalith_core::{Error, Result};
use metalith_gds::extract::ElementSite;
use metalith_pillars::PillarMap;
use metalith_report::{counted, sig};
use metalith_wave::psf::FocusPlanes;

use super::single::Lighting;

/// Bytes of a sample of a plane: its field and its PSF.
const BYTES_OF_SAMPLE: f64 = 16.0;

/// Most samples of all PSFs that one call returns: 8.6 GB, about what `verify` takes by default.
const MOST_HELD: usize = 1 << 30;

/// Planes along z that are asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FocusRequest {
    /// Distance of the first and the last plane from the sensor (um); two depths of focus if left out.
    pub range_um: Option<f64>,
    pub planes: usize,
}

impl FocusRequest {
    /// Most planes: each holds a PSF.
    pub const PLANES: std::ops::RangeInclusive<usize> = 3..=101;

    /// Most samples of the planes of a series together. All planes of a series are formed at once: so many take 2.1 GB, a quarter
    /// of what `verify` takes by default.
    pub const MOST_SAMPLES: usize = 1 << 27;

    /// Check against the distance of the sensor (um).
    ///
    /// # Errors
    /// If there are too few or too many planes, or they reach farther than half of the distance.
    pub fn check(&self, sensor_um: f64) -> Result<()> {
        let range = 0.0..=0.5 * sensor_um;
        let right = self.range_um.is_none_or(|um| um > 0.0 && range.contains(&um));
        if right && Self::PLANES.contains(&self.planes) {
            return Ok(());
        }
        let range = self
            .range_um
            .map_or_else(String::new, |um| format!(", up to {um} um from the sensor"));
        Err(Error::refused(
            "psf/through-focus",
            format!("{} planes{range} through focus", self.planes),
            format!(
                "give {} to {} planes, and at most half of the distance to the sensor, {} um",
                Self::PLANES.start(),
                Self::PLANES.end(),
                sig(0.5 * sensor_um, 4)
            ),
        ))
    }

    /// Check against the samples along an axis of a window, `parts` of them a pitch.
    ///
    /// # Errors
    /// If the planes have more than [`Self::MOST_SAMPLES`].
    pub(super) fn check_samples(&self, samples: usize, parts: usize) -> Result<()> {
        let plane = samples.saturating_mul(samples).max(1);
        if self.planes.saturating_mul(plane) <= Self::MOST_SAMPLES {
            return Ok(());
        }
        let pitches = (Self::MOST_SAMPLES / self.planes.max(1)).isqrt() / parts.max(1);
        let most = Self::MOST_SAMPLES / plane;
        let fewer = if most >= *Self::PLANES.start() {
            format!("at most {most} planes by --planes, or ")
        } else {
            String::new()
        };
        Err(Error::refused(
            "psf/through-focus",
            format!(
                "{} planes of {samples} x {samples} samples through focus take {} GB of memory",
                self.planes,
                sig(1e-9 * BYTES_OF_SAMPLE * self.planes as f64 * plane as f64, 3)
            ),
            format!("give {fewer}a window of at most {pitches} pitches by --samples"),
        ))
    }

    pub(super) fn planes(&self, wavelength_um: f64, radius_um: f64, sensor_um: f64) -> FocusPlanes {
        let usual = FocusPlanes::usual(wavelength_um, radius_um, sensor_um);
        FocusPlanes {
            range_um: self.range_um.unwrap_or(usual.range_um),
            planes: self.planes,
        }
    }
}

impl Lighting {
    /// Check that PSFs can be held: `times` of each element at each of the wavelengths (um).
    ///
    /// # Errors
    /// If they have too many samples.
    pub(super) fn check_held(
        &self,
        elements: &[(&ElementSite, &PillarMap)],
        wavelengths_um: &[f64],
        times: usize,
    ) -> Result<()> {
        let mut held = 0;
        for (_, widths) in elements {
            for um in wavelengths_um {
                let samples = self.window(self.at_um, widths, *um).samples;
                held += times.saturating_mul(samples.saturating_pow(2));
            }
        }
        if held <= MOST_HELD {
            return Ok(());
        }
        let fits = (self.samples as f64 * (MOST_HELD as f64 / held as f64).sqrt()).floor();
        Err(Error::refused(
            "psf/too-many-samples",
            format!(
                "{} of {} take {} GB of memory",
                counted(elements.len() * wavelengths_um.len() * times, "PSF"),
                counted(elements.len(), "distinct element"),
                sig(8e-9 * held as f64, 3)
            ),
            format!("give fewer wavelengths, one element by --top, or at most {fits} pitches by --samples"),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_that_do_not_fit_into_memory_are_refused() {
        let said = |planes: usize, samples: usize, parts: usize| {
            let request = FocusRequest { range_um: None, planes };
            request.check_samples(samples, parts).map_err(|error| {
                assert_eq!(error.id(), "psf/through-focus");
                error.to_string()
            })
        };
        assert_eq!(said(9, 1024, 4), Ok(()));
        assert_eq!(said(2, 8192, 1), Ok(()));
        let many = said(101, 2048, 4).unwrap_err();
        assert!(
            many.contains("at most 32 planes") && many.contains("at most 288 pitches"),
            "{many}"
        );
        let large = said(101, 8192, 1).unwrap_err();
        assert!(
            !large.contains("--planes") && large.contains("at most 1152 pitches"),
            "{large}"
        );
    }
}
