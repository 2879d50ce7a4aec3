//! Declared terms of the light that leaves each site: path, phase, amplitude.

use num_complex::Complex32;

use super::GeometryChange;
use super::declared::{CompiledTerm, DeclaredQuantity, RowPlaces, compiled};
use super::expression::Input;
use metalith_pillars::Lattice;
use metalith_wave::kernels::cis;

/// The terms of an element. What is the same at all wavelengths is evaluated once.
#[derive(Clone, Debug)]
pub(crate) struct PupilTerms {
    lattice: Lattice,
    radius_um: f64,
    centre_um: [f64; 2],
    /// Phase in turns and relative change of amplitude of each site; empty for none.
    turns: Vec<f32>,
    amplitude: Vec<f32>,
    /// Terms that differ from one wavelength to another.
    by_wavelength: Vec<CompiledTerm>,
}

impl PupilTerms {
    /// The terms of a geometry for an element on this lattice. Paths that are the same at all wavelengths are added
    /// to `path_um` (um, row by row; empty for none).
    pub(crate) fn new(
        geometry: &GeometryChange,
        lattice: Lattice,
        radius_um: f64,
        centre_um: [f64; 2],
        path_um: &mut Vec<f32>,
    ) -> Self {
        let terms = compiled(&geometry.declared, DeclaredQuantity::is_pupil);
        let (by_wavelength, fixed) = terms.into_iter().partition(CompiledTerm::depends_on_wavelength);
        let mut out = Self {
            lattice,
            radius_um,
            centre_um,
            turns: Vec::new(),
            amplitude: Vec::new(),
            by_wavelength,
        };
        let n = lattice.sites();
        let mut row = vec![0.0; n];
        let fixed: Vec<CompiledTerm> = fixed;
        for term in &fixed {
            let (to, unit) = match term.quantity {
                // The expression gives nm.
                DeclaredQuantity::OpdNm => (&mut *path_um, 1e-3),
                DeclaredQuantity::PhaseRad => (&mut out.turns, 1.0 / std::f64::consts::TAU),
                _ => (&mut out.amplitude, 1.0),
            };
            to.resize(n * n, 0.0);
            for (iy, line) in to.chunks_exact_mut(n).enumerate() {
                // No row of the terms uses the wavelength.
                evaluate(term, &RowPlaces::new(lattice, iy, radius_um, centre_um), 0.0, &mut row);
                line.iter_mut().zip(&row).for_each(|(to, v)| *to += (v * unit) as f32);
            }
        }
        out
    }

    /// Let a share of the amplitude of each site pass, beside all terms.
    pub(crate) fn pass(&mut self, share: impl Fn(usize) -> f64) {
        let n = self.lattice.sites();
        self.amplitude.resize(n * n, 0.0);
        for (site, change) in self.amplitude.iter_mut().enumerate() {
            *change = ((1.0 + f64::from(*change)) * share(site) - 1.0) as f32;
        }
    }

    /// Apply the terms to a row of the light that leaves the sites, at a wavelength (um). Paths that are the same at
    /// all wavelengths are not among them.
    pub(crate) fn multiply(&self, iy: usize, wavelength_um: f64, row: &mut [Complex32]) {
        let n = self.lattice.sites();
        if !self.turns.is_empty() {
            for (to, turns) in row.iter_mut().zip(&self.turns[iy * n..]) {
                *to *= cis(f64::from(*turns));
            }
        }
        if !self.amplitude.is_empty() {
            for (to, more) in row.iter_mut().zip(&self.amplitude[iy * n..]) {
                *to *= 1.0 + more;
            }
        }
        if self.by_wavelength.is_empty() {
            return;
        }
        let places = RowPlaces::new(self.lattice, iy, self.radius_um, self.centre_um);
        let mut values = vec![0.0; n];
        for term in &self.by_wavelength {
            evaluate(term, &places, wavelength_um * 1e3, &mut values);
            for (to, v) in row.iter_mut().zip(&values) {
                *to *= match term.quantity {
                    DeclaredQuantity::OpdNm => cis(v * 1e-3 / wavelength_um),
                    DeclaredQuantity::PhaseRad => cis(v / std::f64::consts::TAU),
                    _ => Complex32::new(1.0 + *v as f32, 0.0),
                };
            }
        }
    }
}

fn evaluate(term: &CompiledTerm, places: &RowPlaces, wavelength_nm: f64, out: &mut [f64]) {
    let inputs: Vec<Input<'_>> = places
        .inputs()
        .into_iter()
        .chain([Input::Scalar(wavelength_nm)])
        .collect();
    term.row(&inputs, out);
}
