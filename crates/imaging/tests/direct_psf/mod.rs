//! Images by direct sums over all pillars.

use metalith_design::Design;
use metalith_wave::{Direct, Pillars, PlaneWave, Propagator, Psf, Scratch, Window};

/// Image of a point that is seen under these sines, at a wavelength (um).
pub(crate) fn direct_psf(design: &Design, pillars: &Pillars<'_>, um: f64, sines: [f64; 2], window: Window) -> Psf {
    let direct = Direct::plan(design.lattice(), um, window).unwrap();
    let wave = PlaneWave {
        wavelength_um: um,
        sin_x: sines[0],
        sin_y: sines[1],
    };
    let scratch = &mut Scratch::default();
    Psf::formed(&direct as &dyn Propagator, pillars, &wave, &[], scratch).unwrap()
}
