//! A band of wavelengths from one direction: a few wavelengths that move with the chief ray, against every nanometre.

use std::f64::consts::TAU;

use metalith_core::Wedge;
use metalith_pillars::Lattice;
use metalith_wave::propagation::{Otf, landing_um};
use metalith_wave::psf::{BandPart, BandSample, band_otf, polychromatic};
use metalith_wave::{Accuracy, Aperture, FoldedPropagator, PhaseFunction, PlaneWave, Psf, Scratch, Window};

const RADIUS_UM: f64 = 60.0;
const FOCAL_UM: f64 = 300.0;
const BAND_NM: [f64; 2] = [500.0, 600.0];
const LP_MM: [f64; 3] = [20.0, 42.7, 85.3];
const SAMPLES: usize = 160;

fn wedge() -> Wedge {
    Wedge {
        wavelength_um: 0.55,
        sin_x: 15.0_f64.to_radians().sin(),
        sin_y: 6.0_f64.to_radians().sin(),
    }
}

/// Wave from the viewing direction of the element at the wavelength of its wedge.
fn wave(nm: f64) -> PlaneWave {
    let (sin_x, sin_y) = wedge().looks_at(wedge().wavelength_um);
    PlaneWave {
        wavelength_um: nm * 1e-3,
        sin_x,
        sin_y,
    }
}

/// A lens and a wedge for 550 nm, whose phase is the same at all wavelengths: its focus moves by 20 % over the band.
fn lens() -> impl Aperture {
    let wedge = wedge();
    PhaseFunction {
        lattice: Lattice::covering(120_000, 350).unwrap(),
        radius_um: RADIUS_UM,
        amplitude: 1.0,
        phase_rad: move |x: f64, y: f64| {
            let path = (x * x + y * y + FOCAL_UM * FOCAL_UM).sqrt() - FOCAL_UM;
            TAU / 0.55 * (x * wedge.sin_x + y * wedge.sin_y - path)
        },
    }
}

fn psf(nm: f64, centre_um: [f64; 2], samples: usize, accuracy: Accuracy) -> Psf {
    let lens = lens();
    let window = Window::about(centre_um, 0.35, samples, FOCAL_UM);
    let fold = FoldedPropagator::plan(lens.lattice(), RADIUS_UM, nm * 1e-3, window, accuracy).unwrap();
    Psf::formed(&fold, &lens, &wave(nm), &LP_MM, &mut Scratch::default()).unwrap()
}

/// Illuminant and efficiency in one: it rises over the band.
fn weight(nm: f64) -> f64 {
    1.0 + 0.01 * (nm - BAND_NM[0])
}

fn landing(nm: f64) -> [f64; 2] {
    landing_um(&wedge(), &wave(nm), FOCAL_UM).unwrap()
}

/// Samples at so many intervals of the band, and its parts of 1 nm.
fn band(intervals: usize) -> (Vec<BandSample>, Vec<BandPart>) {
    let [low, high] = BAND_NM;
    let width = (high - low) / intervals as f64;
    let samples = (0..=intervals).map(|i| {
        let nm = low + width * i as f64;
        BandSample {
            landing_um: landing(nm),
            psf: psf(nm, landing(nm), SAMPLES, Accuracy::Fast),
        }
    });
    let parts = (0..(high - low) as usize).map(|i| {
        let from = low + i as f64;
        BandPart {
            weight: weight(from + 0.5),
            landing_um: [landing(from), landing(from + 1.0)],
            place: (from + 0.5 - low) / width,
        }
    });
    (samples.collect(), parts.collect())
}

/// Every nanometre on one window: no account of chief rays. Values of the sum and the transfer of all light.
fn brute_force(centre_um: [f64; 2], samples: usize) -> Psf {
    let all: Vec<(f64, Psf)> = (0..100)
        .map(|i| BAND_NM[0] + 0.5 + f64::from(i))
        .map(|nm| (weight(nm), psf(nm, centre_um, samples, Accuracy::Accurate)))
        .collect();
    let total: f64 = all.iter().map(|(w, _)| w).sum();
    let mut sum = all[0].1.clone();
    sum.values.fill(0.0);
    let mut otf = Otf {
        power_um2: 0.0,
        transform_um2: [0, 1].map(|_| vec![num_complex::Complex64::ZERO; LP_MM.len()]),
        lp_mm: LP_MM.to_vec(),
    };
    for (w, psf) in &all {
        let w = w / total;
        sum.values += &(&psf.values * w);
        let own = psf.otf.as_ref().unwrap();
        otf.power_um2 += w * own.power_um2;
        for axis in 0..2 {
            for (to, from) in otf.transform_um2[axis].iter_mut().zip(&own.transform_um2[axis]) {
                *to += from * w;
            }
        }
    }
    sum.otf = Some(otf);
    sum
}

#[test]
fn eight_intervals_and_their_chief_rays_are_every_nanometre() {
    /// Tolerances of contrast, for intervals of 12.5 nm over which the focus moves by 2 %, and for twice as many.
    const CONTRAST: [f64; 2] = [0.005, 0.0015];
    /// Tolerance of the share of all light in a square of two pixels.
    const ENERGY: f64 = 0.002;
    let exact = brute_force([0.0; 2], 320);
    let exact_otf = exact.otf.as_ref().unwrap();
    for (intervals, most) in [(8, CONTRAST[0]), (16, CONTRAST[1])] {
        let (samples, parts) = band(intervals);
        let found = polychromatic(&samples, &parts).unwrap();
        let otf = found.psf.otf.as_ref().unwrap();
        assert!((otf.power_um2 / exact_otf.power_um2 - 1.0).abs() < 1e-6);
        let alone = band_otf(&samples, &parts).unwrap().unwrap();
        for (j, lp_mm) in LP_MM.iter().enumerate() {
            for axis in 0..2 {
                let [got, want] = [otf, exact_otf].map(|o| o.contrast(j)[axis]);
                println!("{intervals} intervals, {lp_mm} lp/mm, axis {axis}: {got}, brute force {want}");
                assert!((got - want).abs() < most, "{intervals}: {got}, not {want}");
                assert!((alone.contrast(j)[axis] - got).abs() < 1e-9);
            }
        }
        let (_, at) = exact.peak();
        let share = |psf: &Psf| psf.energy_in_square_um2(at, 11.72) / exact_otf.power_um2;
        println!("energy {} {}", share(&found.psf), share(&exact));
        assert!((share(&found.psf) - share(&exact)).abs() < ENERGY);
        // The band is named where brute force has it: the chief ray of the wavelengths in the middle of the light.
        let middle = landing(550.0 + 6.2);
        assert!(
            (found.landing_um[1][0] - middle[0]).abs() < 1.0,
            "{:?} {middle:?}",
            found.landing_um
        );
    }
}
