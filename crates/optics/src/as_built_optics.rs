//! Pillars as fabricated, of a chip with a perturbation.

use std::sync::Arc;

use num_complex::{Complex32, Complex64};

use super::{AsBuiltChip, AsBuiltElement, DrawnElement, ElementOptics, FocusedSites, IncoherentFields};
use metalith_cell::{CellResponse, Illumination};
use metalith_core::{Progress, Result};

/// An element as fabricated.
pub(crate) struct AsBuiltOptics<'e> {
    pub chip: &'e AsBuiltChip,
    pub drawn: DrawnElement<'e>,
    pub element: AsBuiltElement,
}

impl ElementOptics for AsBuiltOptics<'_> {
    fn in_light(&self, light: &Illumination<'_>, progress: &dyn Progress) -> Result<IncoherentFields<'_>> {
        self.chip.view(&self.element, light, progress)
    }

    fn response(
        &self,
        light: &Illumination<'_>,
        numbers: &[u16],
        progress: &dyn Progress,
    ) -> Result<Arc<CellResponse>> {
        let steps = self.drawn.mean_site_steps(&self.chip.perturbation().geometry);
        let response = self.chip.pillars(numbers, steps, light.wavelength_um, progress)?;
        Ok(Arc::new(response))
    }

    fn focused(&self, wavelength_um: f64, progress: &dyn Progress) -> Result<FocusedSites<'_>> {
        let light = Illumination::normal(wavelength_um);
        let tables = self
            .element
            .tables_of(&self.chip.solve(&self.element, &light, progress)?);
        let own = tables.first().expect("light that is focused passes");
        let double = |t: &Complex32| Complex64::new(f64::from(t.re), f64::from(t.im));
        Ok(FocusedSites {
            table: own.t.iter().map(double).collect(),
            classes: Some(self.element.classes()),
        })
    }
}
