//! The focus of perfect lenses against the closed forms of Airy: `cargo run --release -p metalith-wave --example airy`
//!
//! Lenses of 100 um with a hyperbolic phase focus green light. Of a round aperture the full width at half maximum (FWHM) is
//! 0.5145 wavelength / NA, and 83.8 % of the light is within the first dark ring. Both hold for small angles: at f/1 the field
//! of a real lens deviates from them.

use std::error::Error;
use std::f64::consts::TAU;

use metalith_pillars::Lattice;
use metalith_wave::psf::AIRY_FWHM;
use metalith_wave::{Accuracy, FoldedPropagator, IdealPsf, PhaseFunction, PlaneWave, Propagator, Psf, Scratch, Window};

const WAVELENGTH_UM: f64 = 0.55;
const RADIUS_UM: f64 = 50.0;
/// Sites of the lens 250 nm apart, as many along each axis as its diameter needs.
const PITCH_NM: u32 = 250;
const SITES: usize = 401;
/// Diameter of the first dark ring in units of the wavelength over the numerical aperture.
const DARK_RING: f64 = 1.22;

fn main() -> Result<(), Box<dyn Error>> {
    println!("lens       NA   FWHM (um)   Airy FWHM (um)   light within the dark ring   Strehl ratio");
    for f_number in [10.0, 5.0, 2.0, 1.0] {
        let focal_um = 2.0 * RADIUS_UM * f_number;
        let lens = PhaseFunction {
            lattice: Lattice::new(PITCH_NM, SITES)?,
            radius_um: RADIUS_UM,
            amplitude: 1.0,
            // The path from the rim to the focus is the longest. The phase of the lens is lower there by as much.
            phase_rad: |x: f64, y: f64| {
                -TAU / WAVELENGTH_UM * ((x * x + y * y + focal_um * focal_um).sqrt() - focal_um)
            },
        };
        let airy_um = WAVELENGTH_UM / (RADIUS_UM / RADIUS_UM.hypot(focal_um));

        // 256 x 256 samples about the focus, four across the half maximum.
        let window = Window::about([0.0, 0.0], 0.125 * airy_um, 256, focal_um);
        let propagator = FoldedPropagator::plan(lens.lattice, RADIUS_UM, WAVELENGTH_UM, window, Accuracy::Accurate)?;
        let field = propagator.field(&lens, &PlaneWave::normal(WAVELENGTH_UM), &mut Scratch::default())?;
        let psf = Psf::of(&field);

        let ideal = IdealPsf::of(&lens, [0.0, 0.0, focal_um], WAVELENGTH_UM, 1.0);
        let focus = psf.focus(&ideal);
        let fwhm_um = focus.fwhm_um[0].ok_or("the window does not hold the focus")?;
        let within = psf.power_in_circle_um2(focus.peak_um, DARK_RING * airy_um) / ideal.power_um2;
        println!(
            "f/{f_number:<3} {:8.4} {fwhm_um:11.4} {:16.4} {within:28.4} {:14.5}",
            WAVELENGTH_UM / airy_um,
            AIRY_FWHM * airy_um,
            focus.strehl
        );
    }
    Ok(())
}
