//! A measured set: what was written, what the bench recorded, and what the lab believes of both.

mod index;
pub mod read;
mod sem;

use std::path::PathBuf;

use ndarray::Array2;

pub use index::{ElementIndex, LedIndex, MeasurementIndex, PerElement, PerLed, PerMeasurement};
pub use sem::{COLUMNS as SEM_COLUMNS, SemSite};

use metalith_cell::CellStack;
use metalith_pillars::PillarMap;
use metalith_sensor::{Colour, RelayCamera};

/// One bench session, read and checked.
#[derive(Clone, Debug)]
pub struct MeasuredSet {
    /// Path of `measurement.toml`.
    pub path: PathBuf,
    /// One line for people.
    pub title: String,
    /// The layout that was written.
    pub layout: PathBuf,
    pub stack: Stack,
    /// Full angle of the uniform disc that the source is (rad).
    pub divergence_rad: f64,
    pub camera: RelayCamera,
    pub leds: PerLed<BenchLed>,
    pub elements: PerElement<MeasuredElement>,
    pub measurements: PerMeasurement<Measurement>,
    /// True if `scale_dn` of each measurement is fitted: it is a nuisance of each.
    pub free_scale: bool,
    /// Place of a boundary of write fields across x and across y, from the middle of every lens (um), if it is stated.
    pub field_boundary_um: Option<[f64; 2]>,
    /// Widths seen from above; empty where none were taken.
    pub sem: Vec<SemSite>,
    /// Standard deviation of the offset common to all widths of the SEM (nm).
    pub sem_offset_sigma_nm: f64,
}

impl MeasuredSet {
    /// The description of the set and its layout: what no result replaces.
    pub fn inputs(&self) -> [PathBuf; 2] {
        [self.path.clone(), self.layout.clone()]
    }

    /// The element and the lattice site of a width by SEM; none if it is on no lattice.
    pub fn site_of(&self, site: &SemSite) -> Option<(ElementIndex, usize)> {
        let (index, element) = self.elements.iter_enumerated().find(|(_, e)| e.index == site.element)?;
        Some((index, element.site_at(site.at_um)?))
    }

    /// Pixels of a measurement that its colour can be seen by: those of its filter, where the sensor has filters.
    pub fn seeing_pixels(&self, measurement: MeasurementIndex) -> usize {
        let (camera, channel) = (&self.camera, self.leds[self.measurements[measurement].led].channel);
        let all = camera.rows * camera.cols;
        camera.filter.pixels_of(channel).map_or(all, |of_colour| {
            let pixels = (0..camera.rows).flat_map(|y| (0..camera.cols).map(move |x| (y, x)));
            pixels.filter(|at| of_colour.has(*at)).count()
        })
    }

    /// True if two sessions have one plan: all is equal but light levels, noise and frames.
    pub fn same_plan(&self, other: &Self) -> bool {
        let camera = |c: &RelayCamera| (c.pixel_um, c.rows, c.cols, c.relay_blur_um);
        let measurements = |set: &Self| -> Vec<_> {
            let of = |c: &Measurement| (c.element, c.led, c.aoi_rad, c.distance_um, c.window_centre_um);
            set.measurements.iter().map(of).collect()
        };
        let elements = |set: &Self| -> Vec<_> {
            set.elements
                .iter()
                .map(|e| {
                    (
                        e.index,
                        e.centre_um,
                        e.aperture_diameter_um,
                        e.axis_um,
                        e.pillars.clone(),
                    )
                })
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
    /// Diameter of the lenses (nm).
    pub fn diameter_nm(&self) -> u32 {
        (self.lens_diameter_um * 1e3).round() as u32
    }

    /// True if it is the cell of the published polynomials, whatever its film was measured to be.
    pub fn is_of_the_paper(&self) -> bool {
        self.cell.is_of_the_paper()
    }
}

/// A light-emitting diode of the bench, with a Gaussian spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BenchLed {
    pub centre_nm: f64,
    pub fwhm_nm: f64,
    /// Filter whose pixels record it, where the sensor has filters.
    pub channel: Option<Colour>,
}

impl BenchLed {
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
    /// Centre of the element from the centre of the lattice of its pillars (um): zero, but where the layout has neither a site
    /// nor the middle of four sites at the centre.
    pub axis_um: [f64; 2],
    /// Pillars as the layout has them.
    pub pillars: PillarMap,
}

impl MeasuredElement {
    /// The lattice site nearest to a place from the middle (um), row by row; none beyond the lattice.
    pub fn site_at(&self, at_um: [f64; 2]) -> Option<usize> {
        let lattice = self.pillars.lattice;
        let at_um = [0, 1].map(|axis| at_um[axis] + self.axis_um[axis]);
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
    /// Distance from the pillar tops to the sensor (um).
    pub distance_um: f64,
    /// Middle of the window from the centre of the element's lattice (um).
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
    use metalith_gds::extract::PillarsAt;

    /// Sessions of one plan share simulations: whatever these depend on is compared.
    #[test]
    fn one_plan_has_one_place_of_elements_and_of_write_fields() {
        let folder = tempfile::tempdir().unwrap();
        metalith_testing::session::small_set(folder.path());
        let read = || MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
        let (set, mut brighter, mut stitched, mut moved) = (read(), read(), read(), read());
        brighter.measurements.iter_mut().for_each(|c| c.scale_dn *= 2.0);
        assert!(set.same_plan(&brighter));
        stitched.field_boundary_um = Some([0.0, 3.0]);
        assert!(!set.same_plan(&stitched));
        moved.elements.iter_mut().for_each(|e| e.centre_um[0] += 100.0);
        assert!(!set.same_plan(&moved));
    }

    /// A lens whose axis is on a pillar, one whose axis is at no such place, and a wrong pitch.
    #[test]
    fn the_lattice_is_taken_from_the_layout() {
        let folder = tempfile::tempdir().unwrap();
        let path = metalith_testing::session::small_set(folder.path());
        let text = std::fs::read_to_string(&path).unwrap();
        let read = |text: String| {
            std::fs::write(&path, text).unwrap();
            MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent)
        };
        let usual = read(text.clone()).unwrap().elements[ElementIndex::from(0)].clone();
        let first = "centre_um = [0.0, 0.0]";
        let moved = |x: f64, y: f64| {
            let set = read(text.replacen(first, &format!("centre_um = [{x:?}, {y:?}]"), 1)).unwrap();
            let window = set.measurements[MeasurementIndex::from(0)].window_centre_um;
            (set.elements[ElementIndex::from(0)].clone(), window)
        };
        let sites = usual.pillars.lattice.sites();
        let (on_a_pillar, window) = moved(0.175, -0.175);
        assert_eq!(
            (on_a_pillar.pillars.lattice.sites(), on_a_pillar.axis_um),
            (sites + 1, [0.0; 2])
        );
        assert_eq!(window, [0.0; 2]);
        // As many but those beyond the lattice, which has as many places and is moved by half a pitch.
        assert!(on_a_pillar.pillars.pillars() as f64 > 0.99 * usual.pillars.pillars() as f64);
        let (beside, window) = moved(0.1, 0.0);
        assert_eq!(beside.pillars.pillars(), usual.pillars.pillars());
        let width = |e: &MeasuredElement, at| e.pillars.number.as_slice().unwrap()[e.site_at(at).unwrap()];
        assert_eq!(width(&beside, [2.625, 0.175]), width(&usual, [2.725, 0.175]));
        for (axis, off) in [0.1, 0.0].into_iter().enumerate() {
            assert!((beside.axis_um[axis] - off).abs() < 1e-9 && (window[axis] - off).abs() < 1e-9);
        }
        let error = read(text.replace("pitch_nm = 350", "pitch_nm = 360"))
            .unwrap_err()
            .to_string();
        for part in ["no pillars of element [0, 0]", "square of 350 nm"] {
            assert!(error.contains(part), "{part} is not in:\n{error}");
        }
    }
}
