//! The numbers that are reported of a PSF.

use serde::Serialize;

use super::{FOCUS_FWHM, IdealPsf, PixelFrequencies, Psf, pixel_mtf};

/// Peak, width and focusing efficiency of a PSF.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FocusMetrics {
    /// Largest sample over the peak of the same aperture with all its power and the perfect phase.
    pub strehl: f64,
    /// Place of the largest sample from the element's centre, x and y (um).
    pub peak_um: [f64; 2],
    /// Full width at half maximum along x and y (um); none if it reaches beyond the window.
    pub fwhm_um: [Option<f64>; 2],
    /// Focusing efficiency: power in a circle of three full widths about the peak, over the power incident on the aperture. None without
    /// a width.
    pub focusing_efficiency: Option<f64>,
}

/// The numbers that two PSFs are compared by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PsfMetrics {
    /// Largest sample over the peak of the same aperture with all its power and the perfect phase.
    pub strehl: f64,
    /// Place of the largest sample from the element's centre, x and y (um).
    pub peak_um: [f64; 2],
    /// Centre of gravity of the window from the element's centre, x and y (um).
    pub centroid_um: [f64; 2],
    /// Full width at half maximum along x and y (um); none if it reaches beyond the window.
    pub fwhm_um: [Option<f64>; 2],
    /// Focusing efficiency: power in a circle of three full widths about the peak, over the power incident on the aperture. None without
    /// a width.
    pub focusing_efficiency: Option<f64>,
    /// Energy in a square of one pixel about the peak, over what the perfect aperture passes.
    pub energy_1_pixel: f64,
    /// Share of the energy in a square of two pixels an edge.
    pub energy_2_pixels: f64,
    /// Energy in the whole window, over the same.
    pub energy_window: f64,
    /// Energy of all light that the element passes, over the same; that of the window where no more is known.
    pub energy_passed: f64,
    /// MTF at half of the finest frequency that the pixels tell ([`PixelFrequencies`]: 42.7 line pairs a millimetre for 5.86 um)
    /// along x and y, over all light that the element passes.
    pub mtf_half_nyquist: [f64; 2],
    /// MTF at all of it (85.3) along x and y.
    pub mtf_nyquist: [f64; 2],
    /// The first times the MTF of a pixel.
    pub mtf_half_nyquist_pixel: [f64; 2],
    /// The second times the MTF of a pixel.
    pub mtf_nyquist_pixel: [f64; 2],
}

impl Psf {
    /// Peak, width and focusing efficiency.
    pub fn focus(&self, matched: &IdealPsf) -> FocusMetrics {
        self.focus_in(self.fwhm_um(), matched)
    }

    /// Variant of [`Psf::focus`] with the focusing efficiency in a circle of three of these widths (um): those of the PSF in focus, for a
    /// plane out of focus, whose own width holds more light the more it is blurred.
    pub(super) fn focus_in(&self, in_focus_um: [Option<f64>; 2], matched: &IdealPsf) -> FocusMetrics {
        let (peak, peak_um) = self.peak();
        let fwhm_um = self.fwhm_um();
        let focusing_efficiency = match in_focus_um {
            [Some(x), Some(y)] => {
                let focus_um = FOCUS_FWHM * (x * y).sqrt();
                Some(self.power_in_circle_um2(peak_um, focus_um) / matched.power_um2)
            }
            _ => None,
        };
        FocusMetrics {
            strehl: peak / matched.peak,
            peak_um,
            fwhm_um,
            focusing_efficiency,
        }
    }

    /// All numbers that are reported of a PSF, for pixels with this edge (um). Contrast is over all light that passes if the PSF was
    /// formed with the frequencies of these pixels.
    pub fn metrics(&self, matched: &IdealPsf, pixel_um: f64) -> PsfMetrics {
        let FocusMetrics {
            strehl,
            peak_um,
            fwhm_um,
            focusing_efficiency,
        } = self.focus(matched);
        let mtf = |lp_mm: f64| [0, 1].map(|axis| self.contrast(axis, lp_mm));
        let passed = self.otf.as_ref().map_or_else(|| self.energy_um2(), |otf| otf.power_um2);
        let [half, nyquist] = PixelFrequencies::of(pixel_um).reported();
        let seen = |lp_mm: f64| mtf(lp_mm).map(|m| m * pixel_mtf(pixel_um, lp_mm));
        let share = |edge_um| self.energy_in_square_um2(peak_um, edge_um) / matched.power_um2;
        PsfMetrics {
            strehl,
            peak_um,
            fwhm_um,
            focusing_efficiency,
            centroid_um: self.centroid_um(),
            energy_1_pixel: share(pixel_um),
            energy_2_pixels: share(2.0 * pixel_um),
            energy_window: self.energy_um2() / matched.power_um2,
            energy_passed: passed / matched.power_um2,
            mtf_half_nyquist: mtf(half),
            mtf_nyquist: mtf(nyquist),
            mtf_half_nyquist_pixel: seen(half),
            mtf_nyquist_pixel: seen(nyquist),
        }
    }
}
