//! Errors of simulating light, as causes that a caller can match on.

use metalith_pillars::Lattice;

use crate::propagation::LandingGrid;
use crate::{PlaneWave, Window};

/// Result of every fallible operation of this crate.
pub type Result<T, E = WaveError> = std::result::Result<T, E>;

/// Error of a simulation. The text says what and where; [`WaveError::hint`] says what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WaveError {
    /// A window without a size, place or distance.
    #[error(
        "no field can be computed at {wavelength_um} um on {0} x {0} samples of {1} um about {2:?} um, {3} um away",
        window.samples, window.step_um, window.centre_um, window.distance_um
    )]
    Window { wavelength_um: f64, window: Window },

    /// A fade that does not end after it begins, or a period that no memory holds.
    #[error("the fade goes from {full_um} to {zero_um} um, with {} x {} bins", bins[0], bins[1])]
    Fade {
        bins: [usize; 2],
        full_um: f64,
        zero_um: f64,
    },

    /// A wave of another wavelength than the propagator's, or one that does not propagate.
    #[error(
        "a wave of {} um with sines {}, {} meets a propagator planned for {planned_um} um",
        wave.wavelength_um, wave.sin_x, wave.sin_y
    )]
    Wave { wave: PlaneWave, planned_um: f64 },

    /// An aperture on another lattice than the propagator's.
    #[error("the aperture is on {given:?}, and the propagator is planned for {planned:?}")]
    Lattice { given: Lattice, planned: Lattice },

    /// A band of wavelengths without light.
    #[error(
        "no PSF of a band can be computed from {samples} wavelengths and {parts} parts: one of them must have a weight"
    )]
    Band { samples: usize, parts: usize },

    /// An array of another shape than it must have, or with rows that are not contiguous.
    #[error("{what} of shape {given:?} where {wanted:?} is needed")]
    Shape {
        what: &'static str,
        given: [usize; 2],
        wanted: [usize; 2],
    },

    /// Another number of values than there are places for them.
    #[error("{given} {what} are given, and {needed} are needed")]
    Count {
        what: &'static str,
        given: usize,
        needed: usize,
    },

    /// A pillar wider than the table of what pillars transmit.
    #[error("a pillar is {width_nm} nm wide, the table of the cell ends at {last_nm} nm")]
    Width { width_nm: usize, last_nm: usize },

    /// Rings without a radius or an area, or a wavelength or distance that is not positive.
    #[error("the rings have {radii} radii and {areas} areas")]
    Rings { radii: usize, areas: usize },

    /// A field angle from which no light arrives.
    #[error(
        "no light arrives at ({}, {}) degrees from the viewing direction of an element, sines {}, {}",
        degrees(field_rad[0]), degrees(field_rad[1]), looks_at[0] + 0.0, looks_at[1] + 0.0
    )]
    Incidence { field_rad: [f64; 2], looks_at: [f64; 2] },

    /// A direction behind the element that never meets the sensor.
    #[error("light that leaves an element with sines {}, {} does not reach the sensor", sines[0] + 0.0, sines[1] + 0.0)]
    MissesSensor { sines: [f64; 2] },

    /// Pixels that reach beyond the window that the PSF is known on.
    #[error("{pixels} pixels of {pixel_um} um about {centre_um:?} um do not fit into the window")]
    Pixels {
        pixels: usize,
        pixel_um: f64,
        centre_um: [f64; 2],
    },

    /// Two PSFs on windows of different samples.
    #[error("PSFs on windows of different samples cannot be compared")]
    Samples,

    /// A map of the sensor's plane without a size, or too large for memory.
    #[error("a map of {0} x {0} squares of {1} um at {2} um", grid.cells, grid.cell_um, grid.distance_um)]
    Map { grid: LandingGrid, most: usize },
}

/// An angle as people gave it: without what the way to radians and back left in its last digits, zero without a sign.
fn degrees(rad: f64) -> f64 {
    (rad.to_degrees() * 1e9).round() / 1e9 + 0.0
}

impl WaveError {
    /// Identity of the error, `subject/cause`: the text may change, the identity stays.
    pub fn id(&self) -> &'static str {
        match self {
            Self::Window { .. } => "wave/window-out-of-range",
            Self::Fade { .. } => "wave/fade-out-of-range",
            Self::Wave { .. } => "wave/wavelength-not-planned",
            Self::Lattice { .. } => "wave/lattice-differs",
            Self::Band { .. } => "wave/band-without-weight",
            Self::Shape { .. } => "wave/shape-differs",
            Self::Count { .. } => "wave/count-differs",
            Self::Width { .. } => "wave/width-beyond-table",
            Self::Rings { .. } => "wave/rings-out-of-range",
            Self::Incidence { .. } => "wave/no-incident-light",
            Self::MissesSensor { .. } => "wave/misses-sensor",
            Self::Pixels { .. } => "wave/pixels-outside-window",
            Self::Samples => "wave/samples-differ",
            Self::Map { .. } => "wave/map-out-of-range",
        }
    }

    /// Remedy for the error.
    pub fn hint(&self) -> String {
        match self {
            Self::Window { .. } => {
                "use a positive wavelength, step and distance, a finite place, and 1 to 8192 samples".into()
            }
            Self::Fade { .. } => "make the lens or the window smaller, or the fade wider".into(),
            Self::Wave { .. } => "plan one propagator a wavelength, and keep the sine of the angle below one".into(),
            Self::Lattice { .. } => "plan one propagator a lattice".into(),
            Self::Band { .. } => {
                "give at least one wavelength, and parts with finite weights, one of them positive".into()
            }
            Self::Shape { .. } => "give a contiguous array of that shape".into(),
            Self::Count { .. } => "give one transmission a ring, and one value a point".into(),
            Self::Width { .. } => "make the table up to the widest pillar of the layout".into(),
            Self::Rings { .. } => {
                "give one positive, finite area for each radius, and a positive wavelength and distance".into()
            }
            Self::Incidence { .. } => {
                "keep field angles smaller: light arrives at less than 90 degrees from the chip's normal".into()
            }
            Self::MissesSensor { .. } => "keep wedge and field angle smaller at the longest wavelength".into(),
            Self::Pixels { .. } => "use fewer pixels, or form the PSF on a larger window".into(),
            Self::Samples => "form both on the same number of samples and with the same step".into(),
            Self::Map { most, .. } => format!("use positive lengths and at most {most} squares"),
        }
    }
}

impl From<WaveError> for metalith_core::Error {
    fn from(error: WaveError) -> Self {
        Self::refused(error.id(), error.to_string(), error.hint())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_become_text_with_a_remedy_at_the_border() {
        let error = WaveError::Width {
            width_nm: 300,
            last_nm: 288,
        };
        let at_border = metalith_core::Error::from(error);
        assert_eq!(at_border.id(), "wave/width-beyond-table");
        insta::assert_snapshot!(at_border, @"
            a pillar is 300 nm wide, the table of the cell ends at 288 nm
              help: make the table up to the widest pillar of the layout
            ");
    }

    #[test]
    fn angles_are_told_in_the_degrees_that_were_given() {
        let error = WaveError::Incidence {
            field_rad: [95.3_f64, -0.0].map(f64::to_radians),
            looks_at: [-0.0, 0.25],
        };
        insta::assert_snapshot!(error, @"no light arrives at (95.3, 0) degrees from the viewing direction of an element, sines 0, 0.25");
    }
}
