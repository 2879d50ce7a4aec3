//! The light that a cell or an element is asked about.

use crate::PolarisedLight;

/// The light that answers are for: a plane wave, and how closely it is looked at.
#[derive(Clone, Copy)]
pub struct Illumination<'a> {
    pub wavelength_um: f64,
    /// Direction sines of the light that arrives, in air along x and y.
    pub sines: [f64; 2],
    /// The direction that cells are solved for.
    pub incidence: Incidence,
    /// The direction that an element looks in, by wavelength (um): coupled models, which have tables of one direction, are solved
    /// for it. None stands for the direction of the light that arrives, at all wavelengths.
    pub viewing: Option<&'a (dyn Fn(f64) -> [f64; 2] + Sync)>,
    /// Polarisation of source and analyser, which counts where pillars distinguish polarisations.
    pub polarised: PolarisedLight,
    pub spectral: Spectral,
}

/// The direction that cells of equal pillars are solved for, whatever direction light arrives from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Incidence {
    /// Along the normal, for all polarisations alike.
    #[default]
    Normal,
    /// The direction that light arrives from, for s and p.
    Oblique,
}

/// Spectral resolution: how finely resonances are resolved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Spectral {
    /// A wavelength that figures are reported for.
    #[default]
    Exact,
    /// Wavelength of many that a band is averaged over, where a resonance that is off its place by a fraction of a
    /// nanometre does not show: a model may solve it more coarsely.
    InBand,
}

impl Spectral {
    /// The first of two values for a single wavelength, the second for one of a band.
    pub fn choose<T>(self, exact: T, in_band: T) -> T {
        match self {
            Self::Exact => exact,
            Self::InBand => in_band,
        }
    }
}

impl Illumination<'_> {
    /// Light along the normal at a single wavelength (um).
    pub fn normal(wavelength_um: f64) -> Self {
        Self::from_direction(wavelength_um, [0.0; 2])
    }

    /// Light from a direction at a single wavelength (um), on cells that are solved along the normal.
    pub fn from_direction(wavelength_um: f64, sines: [f64; 2]) -> Self {
        Self {
            wavelength_um,
            sines,
            incidence: Incidence::Normal,
            viewing: None,
            polarised: PolarisedLight::default(),
            spectral: Spectral::Exact,
        }
    }

    /// This light at one of many wavelengths of a band.
    #[must_use]
    pub fn in_band(self) -> Self {
        Self {
            spectral: Spectral::InBand,
            ..self
        }
    }

    /// This light on cells that are solved for its direction.
    #[must_use]
    pub fn oblique(self) -> Self {
        Self {
            incidence: Incidence::Oblique,
            ..self
        }
    }

    /// The direction that coupled models are solved for at a wavelength (um).
    pub fn coupled_sines(&self, wavelength_um: f64) -> [f64; 2] {
        self.viewing.map_or(self.sines, |sines| sines(wavelength_um))
    }

    /// The direction that cells of equal pillars are solved for.
    pub fn cell_sines(&self) -> [f64; 2] {
        match self.incidence {
            Incidence::Normal => [0.0; 2],
            Incidence::Oblique => self.sines,
        }
    }
}
