//! An element in light from many directions, whose fields behind it do not depend on the direction.

use metalith_core::Result;
use metalith_wave::propagation::{ApertureSpectrum, Direction, SharedSpectrumPlan};
use metalith_wave::{Accuracy, PlaneWave, Psf, Scratch, Window};

use super::IncoherentFields;

/// Fields of an element by one spectrum each for all directions that light comes from.
pub struct SharedFields<'e> {
    fields: IncoherentFields<'e>,
    plan: SharedSpectrumPlan,
    spectra: Vec<ApertureSpectrum>,
}

impl<'e> SharedFields<'e> {
    /// Fields that are the same in light from all of these directions, each with the window that it is wanted in at the
    /// stated distance of the sensor.
    ///
    /// # Errors
    /// As [`SharedSpectrumPlan::new`].
    pub fn new(fields: IncoherentFields<'e>, accuracy: Accuracy, directions: &[(PlaneWave, Window)]) -> Result<Self> {
        let directions: Vec<Direction> = directions.iter().map(|(wave, w)| fields.direction(*wave, *w)).collect();
        let plan = SharedSpectrumPlan::new(
            fields.lattice,
            fields.radius_um,
            fields.light.plane.wavelength_um,
            accuracy,
            &directions,
        )?;
        let of = |field: &super::Field<'_>| Ok(plan.spectrum(field.aperture(&fields.light)?.as_ref())?);
        let spectra = fields.fields.iter().map(of).collect::<Result<_>>()?;
        Ok(Self { fields, plan, spectra })
    }

    /// The PSF in one of these directions, as [`IncoherentFields::psf`] without transfers.
    ///
    /// # Errors
    /// As [`SharedSpectrumPlan::field`].
    pub fn psf(&self, wave: PlaneWave, stated: Window, scratch: &mut Scratch) -> Result<Psf> {
        let direction = self.fields.direction(wave, stated);
        let of = |(field, spectrum): (&super::Field<'_>, &ApertureSpectrum)| {
            let mut psf = Psf::of(&self.plan.field(spectrum, &direction, scratch)?);
            self.fields.add_scattered(field, &mut psf);
            Ok(psf)
        };
        let psfs = self.fields.fields.iter().zip(&self.spectra).map(of);
        let psf = self.fields.together(psfs.collect::<Result<_>>()?);
        Ok(Psf { window: stated, ..psf })
    }
}
