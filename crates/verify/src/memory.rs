//! Memory that a simulation takes, estimated before any work is spent on it.

use std::path::Path;

use metalith_core::Result;
use metalith_design::{Design, Element, LensSpec};
use metalith_gds::extract::{Holding, fits_folded, held_bytes};
use metalith_report::counted;
use metalith_wave::{Accuracy, FoldedPropagator, Window};

use super::{optics, polychromatic};

/// Bytes of each site of every element: its width as read.
const READ_BYTES: f64 = 2.0;
/// Bytes of each site of the elements that are not copies: its width as designed.
const DESIGNED_BYTES: f64 = 2.0;
/// Bytes of each site of the element that is being simulated: its width, single-precision fields of the propagation
/// on all threads, and what its sites transmit in two polarisations. From the peaks of 3 x 3 lenses of 1 mm, 568 to 607 MB.
const SIMULATED_BYTES: f64 = 50.0;
/// Memory of a run whatever its size (MB).
const BASE_MB: f64 = 60.0;
/// Memory of a thread other than spectra, as a share of all of them: rows of the window, columns for the contrast,
/// transforms.
const BESIDE_SPECTRA: f64 = 0.1;
/// Parts that a field is formed in at most: all rows of the element are transformed once for each.
const MOST_PARTS: usize = 32;

/// Way in which a layout of a design is simulated within a given memory.
#[derive(Clone, Debug, PartialEq)]
pub enum Simulation {
    /// All elements held in full: [`verify`](super::verify).
    Whole,
    /// [`verify_in_parts`](super::verify_in_parts).
    InParts {
        /// Spectra that a thread may hold at a time (bytes).
        part_bytes: usize,
        /// Parts that the largest field is formed in.
        parts: usize,
        /// Memory that is taken in all, about (MB).
        needed_mb: f64,
    },
    /// Not in full, and why; its pillars can be compared with the design, and zones sampled: [`verify_sampled`](super::verify_sampled).
    Not(String),
}

impl Simulation {
    /// Choose for a design whose layout is at `path`, with all threads of this program. `by_site` says that the case
    /// that judges knows a chip as fabricated, or dissimilar neighbours, and needs elements that are held in full.
    ///
    /// # Errors
    /// If the pillars of the elements are more than can be held to be compared, or the camera of the design cannot be used.
    pub fn choose(design: &Design, path: &Path, accuracy: Accuracy, by_site: bool, memory_mb: f64) -> Result<Self> {
        let whole_mb = whole_mb(design);
        if whole_mb <= memory_mb && super::fits(design, path).is_ok() {
            return Ok(Self::Whole);
        }
        let (elements, holdings) = (design.sites(), holdings(design));
        fits_folded(path, &elements, &holdings)?;
        if by_site {
            return Ok(Self::Not(format!(
                "judged as made, or among unlike neighbours, that takes about {whole_mb:.0} MB of memory, and --memory-mb \
                 allows {memory_mb:.0}; --fidelity rigorous is simulated in parts"
            )));
        }
        let spectra = largest_spectra_bytes(design, accuracy)? as f64;
        let threads = rayon::current_num_threads() as f64;
        let held = BASE_MB * 1e6 + held_bytes(&elements, &holdings) as f64;
        let needed = |part: f64| 1e-6 * (held + threads * (part + BESIDE_SPECTRA * spectra));
        let least_mb = needed(spectra / MOST_PARTS as f64);
        if least_mb > memory_mb {
            return Ok(Self::Not(format!(
                "in parts that takes about {least_mb:.0} MB of memory on {}, {:.0} MB of it for the pillars alone, and \
                 --memory-mb allows {memory_mb:.0}",
                counted(rayon::current_num_threads(), "thread"),
                1e-6 * held
            )));
        }
        let part = (1e6 * (memory_mb - needed(0.0)) / threads).min(spectra);
        Ok(Self::InParts {
            part_bytes: part as usize,
            parts: (spectra / part).ceil() as usize,
            needed_mb: needed(part),
        })
    }
}

/// Memory that reading a layout of a design back and simulating it takes, about (MB); the elements are taken to be held
/// in full. No element of a design is taken for a copy of more than one in four others.
fn whole_mb(design: &Design) -> f64 {
    let sites = (design.lattice().sites() as f64).powi(2);
    let elements = design.elements().len() as f64;
    let distinct = 1.0 + (elements - 1.0) / 4.0;
    BASE_MB + 1e-6 * sites * (READ_BYTES * elements + DESIGNED_BYTES * distinct + SIMULATED_BYTES)
}

/// Memory of elements that are read folded: of round lenses and nothing else on a square lattice, an eighth; rectangles
/// are not symmetric.
fn holdings(design: &Design) -> Vec<Holding> {
    let held = |element: &Element| {
        let lens = design.lens_of(element);
        let turned = !design.cell.shape.keeps(true, 1);
        let round = !turned && lens.outline.is_none() && !lens.terms.iter().any(|term| term.is_of(element.index));
        match (element.wedge.sin_x, element.wedge.sin_y) {
            (0.0, 0.0) if round && design.cell.lattice.is_square() => Holding::Eighth,
            _ => Holding::Whole,
        }
    };
    design.elements().iter().map(held).collect()
}

/// The most that the spectra of a field of the design take (bytes).
fn largest_spectra_bytes(design: &Design, accuracy: Accuracy) -> Result<usize> {
    let lattice = design.lattice();
    let bytes = |lens: &LensSpec, wavelength_um, landing, accuracy| -> Result<usize> {
        let pitches = (lattice.pitch_um(), design.verify.window_samples);
        let aperture = (lens.radius_um(), lens.focal_length_um);
        let window = Window::of_psf(landing, pitches, aperture, wavelength_um);
        let fold = FoldedPropagator::plan(lattice, lens.radius_um(), wavelength_um, window, accuracy)?;
        Ok(fold.spectra_bytes())
    };
    let white = polychromatic::wavelengths_um(design)?;
    let mut most = 0;
    for element in design.elements() {
        let lens = design.lens_of(&element);
        for &wavelength_um in &design.verify.wavelengths_um {
            for field in &design.verify.field_angles {
                let landing = optics::landing(&element, wavelength_um, *field, lens.focal_length_um)?;
                most = most.max(bytes(lens, wavelength_um, landing, accuracy)?);
            }
        }
        // The shorter the wavelength, the more frequencies.
        if let Some(shortest) = white.iter().copied().reduce(f64::min) {
            let landing = polychromatic::landing_um(&element, shortest, lens.focal_length_um)?;
            most = most.max(bytes(lens, shortest, landing, Accuracy::Fast)?);
        }
    }
    Ok(most)
}
