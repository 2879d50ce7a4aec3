//! One element: as it is drawn, and as it is made.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::OnceLock;

use num_complex::{Complex32, Complex64};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::class_table::ClassTable;
use super::declared::{CompiledTerm, DeclaredQuantity, RowPlaces, compiled};
use super::expression::Input;
use super::pupil::PupilTerms;
use super::shifted_aperture::ShiftedAperture;
use super::stitching::displace;
use super::{ArrivingLight, GeometryChange, NODE_STEP_NM, RectangleClass, SolvedWidths, density, zernike};
use metalith_core::{Error, Result};
use metalith_pillars::{Lattice, PillarMap, PillarShape};
use metalith_wave::Aperture;
use metalith_wave::kernels::cis;

/// Biases by density that differ by less than this share a class (nm). At most 0.05 nm are lost to it, which is
/// 1.5 mrad of phase at the steepest (a turn over 200 nm): the error of a field is below 1e-6 of its power.
pub const BIAS_STEP_NM: f64 = 1.0 / STEPS_PER_NM;

/// A whole number, so that drawn widths are whole steps.
const STEPS_PER_NM: f64 = 10.0;

/// An element as it is drawn in a layout: what every made version of it starts from.
pub struct DrawnElement<'a> {
    pillars: &'a PillarMap,
    aperture_radius_um: f64,
    shape: PillarShape,
    /// Centre of the element on the chip (um).
    centre_um: [f64; 2],
    /// Centre of the opening from the centre of the lattice (um).
    axis_um: [f64; 2],
    /// Area fraction around each site with its range (um), made when first asked for.
    fill: OnceLock<(f64, Vec<f32>)>,
}

impl<'a> DrawnElement<'a> {
    /// The pillars as read from a layout, squares, and the radius of the opening in the metal around them (um).
    pub fn new(pillars: &'a PillarMap, aperture_radius_um: f64) -> Self {
        Self {
            pillars,
            aperture_radius_um,
            shape: PillarShape::default(),
            centre_um: [0.0; 2],
            axis_um: [0.0; 2],
            fill: OnceLock::new(),
        }
    }

    /// This element with its centre at a place on the chip (um), instead of on the chip's axis.
    #[must_use]
    pub fn placed(self, centre_um: [f64; 2]) -> Self {
        Self { centre_um, ..self }
    }

    /// This element with the centre of its opening at a place from the centre of the lattice (um), instead of on it.
    #[must_use]
    pub fn with_axis(self, axis_um: [f64; 2]) -> Self {
        Self { axis_um, ..self }
    }

    /// This element with pillars of another shape, on which the area that they fill depends.
    #[must_use]
    pub fn of_shape(self, shape: PillarShape) -> Self {
        Self { shape, ..self }
    }

    /// The pillars.
    pub fn pillars(&self) -> &'a PillarMap {
        self.pillars
    }

    /// Area fraction around each site within the range of a change, row by row; see [`density::fill`]. The range that is asked for
    /// first is kept.
    pub fn fill(&self, geometry: &GeometryChange) -> Cow<'_, [f32]> {
        let range_um = geometry.density_range_um();
        let made = || density::fill(self.pillars, self.shape, range_um);
        let (kept_um, kept) = self.fill.get_or_init(|| (range_um, made()));
        if *kept_um == range_um {
            Cow::Borrowed(kept)
        } else {
            Cow::Owned(made())
        }
    }

    /// Width added to the pillar at a site, counted row by row, by bias, density and declared terms (nm).
    pub fn bias_nm(&self, site: usize, geometry: &GeometryChange) -> f64 {
        if !geometry.varies_by_site() {
            return geometry.cd_bias_nm;
        }
        let n = self.pillars.lattice.sites();
        let own = self.added_nm(site / n, geometry, &self.fill(geometry), &width_terms(geometry));
        geometry.cd_bias_nm + own[site % n]
    }

    /// Width that density and declared terms add to a row (nm).
    fn added_nm(&self, iy: usize, geometry: &GeometryChange, fill: &[f32], terms: &[CompiledTerm]) -> Vec<f64> {
        let lattice = self.pillars.lattice;
        let n = lattice.sites();
        let fill: Vec<f64> = fill[iy * n..][..n].iter().map(|f| f64::from(*f)).collect();
        let mut added: Vec<f64> = fill.iter().map(|f| geometry.cd_bias_density_nm * f).collect();
        if terms.is_empty() {
            return added;
        }
        let places = RowPlaces::new(lattice, iy, self.aperture_radius_um, self.centre_um);
        let drawn: Vec<f64> = self.pillars.number.row(iy).iter().map(|w| f64::from(*w)).collect();
        let inputs: Vec<Input<'_>> = [Input::Row(&drawn), Input::Row(&fill)]
            .into_iter()
            .chain(places.inputs())
            .collect();
        let mut own = vec![0.0; n];
        for term in terms {
            term.row(&inputs, &mut own);
            added.iter_mut().zip(&own).for_each(|(to, v)| *to += v);
        }
        added
    }

    /// Steps of [`BIAS_STEP_NM`] that density and declared terms add to the width at each site, row by row; nothing if
    /// they add none anywhere.
    pub fn site_steps(&self, geometry: &GeometryChange) -> Option<Vec<i32>> {
        if !geometry.varies_by_site() {
            return None;
        }
        let (terms, fill) = (width_terms(geometry), self.fill(geometry));
        let row = |iy| self.added_nm(iy, geometry, &fill, &terms);
        let steps = |nm: f64| (nm * STEPS_PER_NM).round() as i32;
        let rows = 0..self.pillars.lattice.sites();
        Some(rows.flat_map(row).map(steps).collect())
    }
}

impl DrawnElement<'_> {
    /// Width that density and declared terms add, mean over the pillars and rounded to the next node of the cells, in
    /// steps of [`BIAS_STEP_NM`]: for accounts that know drawn widths but no places.
    pub fn mean_site_steps(&self, geometry: &GeometryChange) -> i32 {
        let Some(steps) = self.site_steps(geometry) else {
            return 0;
        };
        let (mut sum, mut pillars) = (0.0, 0.0);
        for (step, w) in steps.iter().zip(&self.pillars.number) {
            if *w > 0 {
                sum += f64::from(*step);
                pillars += 1.0;
            }
        }
        let nodes = sum / f64::max(pillars, 1.0) / (NODE_STEP_NM * STEPS_PER_NM);
        (nodes.round() * NODE_STEP_NM * STEPS_PER_NM).round() as i32
    }
}

fn width_terms(geometry: &GeometryChange) -> Vec<CompiledTerm> {
    compiled(&geometry.declared, |q| q == DeclaredQuantity::WidthNm)
}

/// Width of a pillar drawn this wide, so many steps of density on top of the common bias (nm).
pub fn realised_nm(drawn_nm: u16, geometry: &GeometryChange, density_steps: i32) -> f64 {
    // Steps first: every pair of width and step that comes to one sum gets the same number, bit by bit.
    (f64::from(drawn_nm) * STEPS_PER_NM + f64::from(density_steps)) / STEPS_PER_NM + geometry.cd_bias_nm
}

/// An element as it was made: which sites transmit alike, and what is common to all wavelengths.
#[derive(Clone, Debug)]
pub struct AsBuiltElement {
    lattice: Lattice,
    radius_um: f64,
    /// Radius of the opening in the metal: the rim of the lens (um).
    rim_um: f64,
    centre_um: [f64; 2],
    geometry: GeometryChange,
    /// Share of the pillars that are missing and counted with their mean.
    missing: f64,
    /// Class of each site, row by row; zero where light is blocked.
    class: Vec<u16>,
    /// Width of each class (nm), of rectangles what their edges are off by, zero without pillar; that of class zero is of no use.
    width_nm: Vec<f64>,
    /// Classes of rectangles, the class of number zero unused; empty for other pillars.
    rectangle: Vec<RectangleClass>,
    /// Sites in each class.
    count: Vec<u32>,
    /// Optical path added over the lens (um); empty for none.
    path_um: Vec<f32>,
    /// Declared terms of the light that leaves each site.
    pupil: PupilTerms,
}

impl AsBuiltElement {
    /// Most memory that a site takes (bytes): class, path, phase and amplitude, and while it is made the steps of its width.
    pub const MOST_BYTES_PER_SITE: usize = 2 + 3 * 4 + 4;

    /// Element after a change of pillars and apertures. Each site has the width of its pillar, biased and by the
    /// density around it; what the shifted aperture covers is blocked. Light through the crescent that opens on the
    /// other side meets no pillar, is not focused, and is left out.
    ///
    /// # Errors
    /// If the widths fall into more classes than can be numbered.
    pub fn new(drawn: &DrawnElement<'_>, geometry: &GeometryChange) -> Result<Self> {
        let lattice = drawn.pillars.lattice;
        let n = lattice.sites();
        let steps = drawn.site_steps(geometry);
        let offset_um = [0, 1].map(|axis| drawn.axis_um[axis] + geometry.aperture_offset_um[axis]);
        let aperture = ShiftedAperture::new(lattice, drawn.aperture_radius_um, offset_um);
        let covered = |site: usize| aperture.as_ref().is_some_and(|a| a.passes(site) == 0.0);
        // Rectangles are told by their number, and both edges are off by the same.
        let rectangles = !drawn.shape.has_width();
        let without = RectangleClass::WITHOUT_PILLAR;
        let mut known: HashMap<(u64, u16), u16> = HashMap::new();
        let (mut class, mut width_nm, mut count) = (vec![0; n * n], vec![0.0], vec![0u32]);
        let mut rectangle = Vec::from_iter(rectangles.then_some(without));
        let mut radius2 = 0;
        for (site, &w) in drawn.pillars.number.iter().enumerate() {
            if w == 0 || covered(site) {
                continue;
            }
            let drawn_nm = if rectangles { 0 } else { w };
            let width = realised_nm(drawn_nm, geometry, steps.as_ref().map_or(0, |s| s[site]));
            let key = (width.to_bits(), w - drawn_nm);
            let next = width_nm.len();
            let own = match known.get(&key) {
                Some(own) => *own,
                None if next <= usize::from(MOST_CLASS) => {
                    known.insert(key, next as u16);
                    width_nm.push(width);
                    let own = RectangleClass {
                        number: w,
                        bias_nm: width,
                    };
                    rectangle.extend(rectangles.then_some(own));
                    count.push(0);
                    next as u16
                }
                None => return Err(too_many()),
            };
            class[site] = own;
            count[usize::from(own)] += 1;
            radius2 = radius2.max(lattice.units2(site % n, site / n));
        }
        let mut path_um = if geometry.wavefront_nm.is_empty() {
            Vec::new()
        } else {
            zernike::map(&geometry.wavefront_nm, lattice, drawn.aperture_radius_um)
        };
        let mut pupil = PupilTerms::new(
            geometry,
            lattice,
            drawn.aperture_radius_um,
            drawn.centre_um,
            &mut path_um,
        );
        if let Some(aperture) = &aperture {
            pupil.pass(|site| aperture.passes(site));
        }
        Ok(Self {
            lattice,
            pupil,
            radius_um: (radius2 as f64).sqrt() * lattice.unit_um(),
            rim_um: drawn.aperture_radius_um,
            centre_um: drawn.centre_um,
            geometry: geometry.clone(),
            missing: geometry.missing_pillars,
            class,
            width_nm,
            rectangle,
            count,
            path_um,
        })
    }

    /// This element with the missing pillars gone from random places instead of counted with their mean.
    #[must_use]
    pub fn with_pillars_removed(mut self, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let bare = self.width_nm.len() as u16;
        self.width_nm.push(0.0);
        if !self.rectangle.is_empty() {
            self.rectangle.push(RectangleClass::WITHOUT_PILLAR);
        }
        self.count.push(0);
        for class in self.class.iter_mut().filter(|c| **c > 0) {
            if rng.random::<f64>() < self.missing {
                *class = bare;
            }
        }
        self.missing = 0.0;
        self
    }

    /// Lattice of the sites.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Centre of the element on the chip (um).
    pub fn centre_um(&self) -> [f64; 2] {
        self.centre_um
    }

    /// Distance of the outermost open site from the element's centre (um).
    pub fn radius_um(&self) -> f64 {
        self.radius_um
    }

    /// Class of each site, row by row; zero where light is blocked.
    pub fn classes(&self) -> &[u16] {
        &self.class
    }

    /// Classes of rectangles, from the first open one on; empty for other pillars.
    pub fn rectangles(&self) -> &[RectangleClass] {
        self.rectangle.get(1..).unwrap_or_default()
    }

    /// Width of each class from the first open one, number 1, on (nm); of rectangles what their edges are off by.
    pub fn widths_nm(&self) -> &[f64] {
        &self.width_nm[1..]
    }

    /// Transmission of each class, from a pillar of some width (nm) and from a site without one: missing pillars mixed
    /// in, and unmodulated light added.
    pub fn table(&self, pillar: impl Fn(f64) -> Complex64, bare: Complex64) -> ClassTable {
        let of = |width: f64| if width > 0.0 { pillar(width) } else { bare };
        let open: Vec<Complex64> = self.widths_nm().iter().map(|w| of(*w)).collect();
        self.table_of(&open, bare, Complex64::ONE)
    }

    /// Transmission of each class from a table by what is drawn: by the nearest width (nm), or by the number of a
    /// rectangle.
    pub fn table_by_number(&self, table: &[Complex64], bare: Complex64) -> ClassTable {
        let at = |k: usize| table.get(k).copied().unwrap_or_default();
        if self.rectangles().is_empty() {
            return self.table(|width| at(width.round() as usize), bare);
        }
        // Missing pillars are in no table that is looked up so.
        let open: Vec<Complex64> = self
            .rectangles()
            .iter()
            .map(|own| at(usize::from(own.number)))
            .collect();
        self.table_of(&open, bare, Complex64::ONE)
    }

    /// Transmission of each class from the values of pillars, in the order of [`AsBuiltElement::widths_nm`]; `unseen`:
    /// the part of unmodulated light in the light of this table.
    ///
    /// # Panics
    /// If there is not one value for each of them.
    pub fn table_of(&self, open: &[Complex64], bare: Complex64, unseen: Complex64) -> ClassTable {
        assert_eq!(open.len() + 1, self.width_nm.len(), "one value for each class");
        let (mut t, mut scattered) = (vec![Complex32::ZERO], 0.0);
        for ((pillar, width), count) in open.iter().zip(&self.width_nm[1..]).zip(&self.count[1..]) {
            // Of rectangles no transmission goes by a width.
            let pillar = if *width > 0.0 && self.rectangle.is_empty() {
                pillar * self.geometry.transmission_factor(*width)
            } else {
                *pillar
            };
            scattered += f64::from(*count) * (pillar - bare).norm_sqr();
            t.push(single(mixed(&self.geometry, self.missing, pillar, bare, unseen)));
        }
        ClassTable::of_widths(t, self.missing * (1.0 - self.missing) * scattered)
    }

    /// A table for each polarisation that was solved for the classes, to the rim of the lens where it differs there.
    pub(crate) fn tables_of(&self, solved: &SolvedWidths) -> Vec<ClassTable> {
        let tables = |solved: &SolvedWidths| -> Vec<ClassTable> {
            let polarisations = solved.pillars.iter().zip(&solved.bare).zip(&solved.unseen);
            polarisations
                .map(|((t, bare), unseen)| self.table_of(t, *bare, *unseen))
                .collect()
        };
        let mut own = tables(solved);
        if let Some(rim) = &solved.rim {
            let pairs = own.iter_mut().zip(tables(rim));
            pairs.for_each(|(table, rim)| table.set_rim(&rim));
        }
        own
    }

    /// The element as an aperture at one wavelength (um), without the wave that arrives.
    pub fn aperture<'a>(&'a self, table: &'a ClassTable, wavelength_um: f64) -> AsBuiltAperture<'a> {
        AsBuiltAperture {
            element: self,
            table,
            wavelength_um,
            sphere: None,
        }
    }

    /// Aperture with the curvature of the wave that arrives, for propagators that know plane waves alone.
    pub fn lit_aperture<'a>(&'a self, table: &'a ClassTable, light: &ArrivingLight) -> AsBuiltAperture<'a> {
        AsBuiltAperture {
            sphere: light.sphere(self.lattice),
            ..self.aperture(table, light.plane.wavelength_um)
        }
    }
}

/// Mean transmission of a site: a pillar, or with the share `missing` none; and unmodulated light, times `unseen`.
pub fn mixed(
    geometry: &GeometryChange,
    missing: f64,
    pillar: Complex64,
    bare: Complex64,
    unseen: Complex64,
) -> Complex64 {
    pillar + (bare - pillar) * missing + geometry.unstructured() * unseen
}

/// Classes are numbered with 16 bits, one of which is kept for sites whose pillar is removed.
const MOST_CLASS: u16 = u16::MAX - 1;

fn too_many() -> Error {
    Error::refused(
        "model/too-many-widths",
        format!("widths as made fall into more than {MOST_CLASS} classes of {BIAS_STEP_NM} nm"),
        "lower `cd_bias_density_nm` of the model, or draw fewer widths",
    )
}

/// A made element at one wavelength, row by row.
pub struct AsBuiltAperture<'a> {
    element: &'a AsBuiltElement,
    table: &'a ClassTable,
    wavelength_um: f64,
    /// Curvature of the wave along an axis; the same for both.
    sphere: Option<[Vec<Complex32>; 2]>,
}

impl Aperture for AsBuiltAperture<'_> {
    fn lattice(&self) -> Lattice {
        self.element.lattice
    }

    fn radius_um(&self) -> f64 {
        self.element.radius_um
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        let n = self.element.lattice.sites();
        let pattern = |iy: usize, row: &mut [Complex32]| {
            let classes = &self.table.classes(&self.element.class)[iy * n..][..n];
            for (to, &class) in row.iter_mut().zip(classes) {
                *to = self.table.t[usize::from(class)];
            }
            if !self.table.to_rim.is_empty() {
                self.towards_rim(iy, classes, row);
            }
        };
        pattern(iy, row);
        let stitching = &self.element.geometry.stitching;
        if !stitching.is_empty() {
            displace(stitching, self.element.lattice, iy, row, pattern);
        }
        if !self.element.path_um.is_empty() {
            for (to, path) in row.iter_mut().zip(&self.element.path_um[iy * n..]) {
                *to *= cis(f64::from(*path) / self.wavelength_um);
            }
        }
        self.element.pupil.multiply(iy, self.wavelength_um, row);
        if let Some([along_x, along_y]) = &self.sphere {
            for (to, along_x) in row.iter_mut().zip(along_x) {
                *to *= along_x * along_y[iy];
            }
        }
    }
}

impl AsBuiltAperture<'_> {
    /// Take what sites of a row transmit in the middle of the lens to their radius. Amplitude and phase of a pillar change
    /// in proportion to its height, but beside resonances.
    fn towards_rim(&self, iy: usize, classes: &[u16], row: &mut [Complex32]) {
        let (lattice, rim2) = (self.element.lattice, self.element.rim_um.powi(2));
        let y2 = lattice.place_um(1, iy).powi(2);
        for ((ix, to), &class) in row.iter_mut().enumerate().zip(classes) {
            let share = (lattice.place_um(0, ix).powi(2) + y2) / rim2;
            let all = self.table.to_rim[usize::from(class)];
            let turns = share * f64::from(all.im) / std::f64::consts::TAU;
            *to *= cis(turns) * (share as f32 * all.re).exp();
        }
    }
}

fn single(t: Complex64) -> Complex32 {
    Complex32::new(t.re as f32, t.im as f32)
}
