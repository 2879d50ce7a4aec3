//! Optics of one element: the fields of its light, whether it is simulated as drawn or as fabricated.

use std::sync::Arc;

use num_complex::Complex64;

use super::IncoherentFields;
use metalith_cell::{CellResponse, Illumination};
use metalith_core::{Progress, Result};

/// Place of an element, and its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Radius of the circle that light passes as drawn (um).
    pub radius_um: f64,
    /// Radius of the opening in the metal (um).
    pub aperture_radius_um: f64,
    /// Centre on the chip (um).
    pub centre_um: [f64; 2],
}

/// An element whose light is asked for.
pub trait ElementOptics: Sync {
    /// Fields in a light.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    fn in_light(&self, light: &Illumination<'_>, progress: &dyn Progress) -> Result<IncoherentFields<'_>>;

    /// Mean response over the element of its pillars of these widths (nm) or numbers to light along the normal.
    ///
    /// # Errors
    /// As [`ElementOptics::in_light`].
    fn response(&self, light: &Illumination<'_>, numbers: &[u16], progress: &dyn Progress)
    -> Result<Arc<CellResponse>>;

    /// Transmission of its sites along the normal of the light that has the phase of the design, whatever light is
    /// simulated; with equal neighbours.
    ///
    /// # Errors
    /// As [`ElementOptics::in_light`].
    fn focused(&self, wavelength_um: f64, progress: &dyn Progress) -> Result<FocusedSites<'_>>;
}

/// Transmissions of focused light by site.
pub struct FocusedSites<'e> {
    pub table: Vec<Complex64>,
    /// Place in the table for each site, row by row; the width (nm) or number of its pillar if there are none.
    pub classes: Option<&'e [u16]>,
}

impl FocusedSites<'_> {
    /// Place in the table of a site, counted row by row, with a pillar of a width (nm) or number.
    pub fn class(&self, site: usize, number: u16) -> usize {
        self.classes.map_or(number, |classes| classes[site]).into()
    }
}
