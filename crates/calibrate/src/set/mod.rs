//! A measured set: what was written, what the bench recorded, and what the lab believes of both.

mod frame;
mod index;
pub mod read;
mod sem;

use std::path::PathBuf;

use ndarray::Array2;

pub use frame::{Bayer, Channel};
pub(crate) use frame::{expected, saturated};
pub use index::{ElementIndex, LedIndex, MeasurementIndex, PerElement, PerLed, PerMeasurement};
pub use sem::{COLUMNS as SEM_COLUMNS, SemSite};

use metalith_cell::CellStack;
use metalith_pillars::PillarMap;

/// A mean of frames this near to saturation contains clipped frames.
pub const SATURATED: f64 = 0.97;

/// One bench session, read and checked.
#[derive(Clone, Debug)]
pub struct MeasuredSet {
    /// Where `measurement.toml` is.
    pub path: PathBuf,
    /// One line for people.
    pub title: String,
    /// The layout that was written.
    pub layout: PathBuf,
    pub stack: Stack,
    /// Full angle of the uniform disc that the source is (rad).
    pub divergence_rad: f64,
    pub camera: RelayCamera,
    pub leds: PerLed<Led>,
    pub elements: PerElement<MeasuredElement>,
    pub measurements: PerMeasurement<Measurement>,
    /// Where a boundary of write fields runs across x and across y, from the middle of every lens (um), if the lab says so.
    pub field_boundary_um: Option<[f64; 2]>,
    /// Widths seen from above; empty where none were taken.
    pub sem: Vec<SemSite>,
    /// Standard deviation of the offset common to all widths of the SEM (nm).
    pub sem_offset_sigma_nm: f64,
}

impl MeasuredSet {
    /// The element and the lattice site of a width by SEM; none if it is on no lattice.
    pub fn site_of(&self, site: &SemSite) -> Option<(ElementIndex, usize)> {
        let (index, element) = self.elements.iter_enumerated().find(|(_, e)| e.index == site.element)?;
        Some((index, element.site_at(site.at_um)?))
    }

    /// Pixels of a measurement that its colour can be seen by: those of its filter, where the sensor has filters.
    pub fn seeing_pixels(&self, measurement: MeasurementIndex) -> usize {
        let (camera, channel) = (&self.camera, self.leds[self.measurements[measurement].led].channel);
        let all = camera.rows * camera.cols;
        camera.bayer.zip(channel).map_or(all, |(bayer, channel)| {
            let pixels = (0..camera.rows).flat_map(|y| (0..camera.cols).map(move |x| (y, x)));
            pixels.filter(|at| bayer.has(*at, channel)).count()
        })
    }

    /// Whether two sessions have one plan: all is equal but light levels, noise and frames.
    pub fn same_plan(&self, other: &Self) -> bool {
        let camera = |c: &RelayCamera| (c.pixel_um, c.rows, c.cols, c.relay_blur_um);
        let measurements = |set: &Self| -> Vec<_> {
            let of = |c: &Measurement| (c.element, c.led, c.aoi_rad, c.distance_um, c.window_centre_um);
            set.measurements.iter().map(of).collect()
        };
        let elements = |set: &Self| -> Vec<_> {
            set.elements
                .iter()
                .map(|e| (e.index, e.centre_um, e.aperture_diameter_um, e.pillars.clone()))
                .collect()
        };
        self.stack == other.stack
            && self.divergence_rad == other.divergence_rad
            && camera(&self.camera) == camera(&other.camera)
            && self.leds == other.leds
            && self.field_boundary_um == other.field_boundary_um
            && measurements(self) == measurements(other)
            && elements(self) == elements(other)
    }
}

/// The cell and the lens as the lab believes them.
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    pub cell: CellStack,
    pub lens_diameter_um: f64,
    pub focal_length_um: f64,
}

impl Stack {
    /// Whether it is the cell of the published polynomials, whatever its film was measured to be.
    pub fn is_of_the_paper(&self) -> bool {
        self.cell.is_of_the_paper()
    }
}

/// The camera behind its relay, in units of the sensor plane.
#[derive(Clone, Copy, Debug)]
pub struct RelayCamera {
    pub pixel_um: f64,
    pub rows: usize,
    pub cols: usize,
    pub black_level_dn: f64,
    pub gain_e_per_dn: f64,
    pub read_noise_dn: f64,
    pub saturation_dn: f64,
    /// Standard deviation of where a window is, along each axis (pixels).
    pub registration_sigma_px: f64,
    /// Relative standard deviation of the DN scale of each LED.
    pub flux_sigma: f64,
    /// Standard deviation of the relay's own Gaussian blur (um).
    pub relay_blur_um: f64,
    /// Filters over the pixels; none for a sensor that sees all colours alike.
    pub bayer: Option<Bayer>,
}

impl RelayCamera {
    /// Mean of a pixel from which on it was clipped in some of its frames (DN).
    pub fn full_dn(&self) -> f64 {
        SATURATED * self.saturation_dn
    }

    /// Variance of a pixel as recorded (DN^2) in the mean of so many frames: shot noise of this signal above the black level (DN),
    /// and read noise.
    pub fn variance_dn2(&self, signal_dn: f64, frames: u32) -> f64 {
        let shot = signal_dn.max(0.0) / self.gain_e_per_dn;
        (shot + self.read_noise_dn.powi(2)) / f64::from(frames)
    }

    /// Electrons that the mean of so many frames rests on where it shows this signal above black (DN): those of the light, and as
    /// many as would scatter like the read noise.
    pub fn electrons(&self, signal_dn: f64, frames: u32) -> f64 {
        self.gain_e_per_dn.powi(2) * f64::from(frames).powi(2) * self.variance_dn2(signal_dn, frames)
    }
}

/// A Gaussian spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Led {
    pub centre_nm: f64,
    pub fwhm_nm: f64,
    /// Filter whose pixels record it, where the sensor has filters.
    pub channel: Option<Channel>,
}

impl Led {
    /// Standard deviation (nm).
    pub fn sigma_nm(&self) -> f64 {
        self.fwhm_nm / (8.0 * 2f64.ln()).sqrt()
    }

    /// The name it goes by: its stated centre in whole nanometres.
    pub fn name(&self) -> String {
        format!("{:.0}", self.centre_nm)
    }
}

/// A lens of the chip.
#[derive(Clone, Debug)]
pub struct MeasuredElement {
    pub index: [i64; 2],
    pub centre_um: [f64; 2],
    pub aperture_diameter_um: f64,
    /// Pillars as the layout has them.
    pub pillars: PillarMap,
}

impl MeasuredElement {
    /// The lattice site nearest to a place from the middle (um), row by row; none beyond the lattice.
    pub fn site_at(&self, at_um: [f64; 2]) -> Option<usize> {
        let lattice = self.pillars.lattice;
        lattice.site_at(at_um).map(|[ix, iy]| iy * lattice.sites() + ix)
    }
}

/// A window of the camera's mean frame.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// File name without folder and ending.
    pub name: String,
    pub element: ElementIndex,
    pub led: LedIndex,
    /// Angle of incidence in air along x and y (rad).
    pub aoi_rad: [f64; 2],
    /// From the pillar tops to the sensor (um).
    pub distance_um: f64,
    /// Middle of the window from the element's axis (um).
    pub window_centre_um: [f64; 2],
    /// DN for |E|^2 / |E_inc|^2 = 1.
    pub scale_dn: f64,
    pub frames: u32,
    /// Raw DN. Shape `[rows, cols]`, row index along +y, column index along +x.
    pub dn: Array2<f32>,
    /// Variance of each pixel (DN^2), infinite where it tells nothing; none where `frames`, gain and read noise say it.
    pub noise: Option<Array2<f32>>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;
    use metalith_gds::extract::GdsPillars;

    /// Sessions of one plan share simulations: whatever these depend on is compared.
    #[test]
    fn one_plan_has_one_place_of_elements_and_of_write_fields() {
        let folder = tempfile::tempdir().unwrap();
        metalith_testing::session::small_set(folder.path());
        let read = || MeasuredSet::read(folder.path(), &GdsPillars, &Silent).unwrap();
        let (set, mut brighter, mut stitched, mut moved) = (read(), read(), read(), read());
        brighter.measurements.iter_mut().for_each(|c| c.scale_dn *= 2.0);
        assert!(set.same_plan(&brighter));
        stitched.field_boundary_um = Some([0.0, 3.0]);
        assert!(!set.same_plan(&stitched));
        moved.elements.iter_mut().for_each(|e| e.centre_um[0] += 100.0);
        assert!(!set.same_plan(&moved));
    }
}
