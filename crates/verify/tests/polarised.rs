//! Source and detector of light at rotated rectangles, from a design to its figures.

use metalith_cell::{
    Analyser, CellModel, CellResponse, CircularTables, Fidelity, Handedness, Illumination, JonesTables, Polarisation,
    PolarisedLight, PolarisedTables,
};
use metalith_core::{Progress, Result, Silent};
use metalith_design::{Design, PillarArray, cell_models};
use metalith_layout::read_pillars;
use metalith_pillars::RotatedRectangles;
use metalith_testing::layouts::written;
use metalith_testing::{changed, design};
use metalith_verify::{Lighting, SimulationCase, SimulationCases, SinglePsf, Verification, single_psfs, verify};
use metalith_wave::{Accuracy, Psf};
use num_complex::Complex64;

/// Tolerance as a share of the largest sample: tables and fields are in single precision.
const ROUNDING: f64 = 1e-5;

/// A quarter as large as the shipped one, so that it is simulated at once.
fn lens() -> (Design, PillarArray, tempfile::TempDir) {
    let smaller = [
        ("diameter_um = 80", "diameter_um = 20"),
        ("focal_length_um = 80", "focal_length_um = 20"),
    ];
    let text = changed("geometric_phase_532", &smaller);
    written(Design::parse(&design("geometric_phase_532"), &text).unwrap())
}

/// Half-wave plates that nothing but their rotation distinguishes.
struct IdealPlates(RotatedRectangles);

impl IdealPlates {
    fn table(&self, of: impl Fn(f64) -> Complex64) -> Vec<Complex64> {
        let at = |number: u16| of(self.0.drawn_rotation(number));
        std::iter::once(Complex64::ZERO)
            .chain((1..=self.0.steps).map(at))
            .collect()
    }
}

impl CellModel for IdealPlates {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn response(&self, _light: &Illumination<'_>, _last: u16, _progress: &dyn Progress) -> Result<CellResponse> {
        let none = || self.table(|_| Complex64::ZERO);
        let tables = PolarisedTables::Hands(CircularTables {
            focused: Handedness::Left,
            converted: [2.0, -2.0].map(|k| self.table(|rotation| Complex64::cis(k * rotation))),
            unconverted: [none(), none()],
            rotation: None,
        });
        Ok(CellResponse::Jones(JonesTables::Polarised(tables)))
    }

    fn full_transmission(&self, _wavelength_um: f64) -> Result<f64> {
        Ok(1.0)
    }
}

fn of_ideal_plates(arriving: Polarisation, analyser: Option<Analyser>) -> SinglePsf {
    let (design, _, folder) = lens();
    let found = read_pillars(&design, &folder.path().join("lens.gds"), &Silent).unwrap();
    let plates = IdealPlates(design.cell.shape.rotated().unwrap());
    let light = Lighting {
        wavelengths_um: vec![0.532],
        incidence_sin: [0.0; 2],
        oblique_cells: false,
        distance_um: design.lens.focal_length_um,
        at_um: [0.0; 2],
        samples: 64,
        pixel_um: 1.4,
        polarised: PolarisedLight {
            arriving: Some(arriving),
            analyser,
        },
        aperture_radius_um: None,
        accuracy: Accuracy::Accurate,
        through_focus: None,
    };
    single_psfs(&found, SimulationCase::from(&plates as &dyn CellModel), &light, &Silent)
        .unwrap()
        .remove(0)
}

fn largest(psf: &Psf) -> f64 {
    psf.values.iter().copied().fold(0.0, f64::max)
}

/// The largest difference of a PSF from the mean of two, over the largest sample.
fn from_mean(of: &Psf, [a, b]: [&Psf; 2]) -> f64 {
    let pairs = of.values.iter().zip(a.values.iter().zip(&b.values));
    let off = pairs.map(|(v, (a, b))| (v - 0.5 * (a + b)).abs()).fold(0.0, f64::max);
    off / largest(of)
}

const LEFT: Polarisation = Polarisation::Circular(Handedness::Left);
const RIGHT: Polarisation = Polarisation::Circular(Handedness::Right);

/// Light of both hands: half of it is focused, half diverges and is spread over the whole sensor; the analyser passes the first half.
#[test]
fn half_of_linear_and_of_unpolarised_light_is_focused_by_ideal_plates() {
    /// Shares of energy and contrast, of what diverges into the pixel and of the steps of the rotation.
    const SHARE: f64 = 0.01;
    let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < SHARE, "{found} {wanted}");
    const CIRCULAR: Option<Analyser> = Some(Analyser::Circular);
    let [left, right] = [LEFT, RIGHT].map(|light| of_ideal_plates(light, None));
    assert!(
        left.metrics.strehl > 0.95 && right.metrics.strehl < SHARE,
        "{left:?} {right:?}"
    );
    for light in [
        Polarisation::Linear(0.0),
        Polarisation::Linear(90.0),
        Polarisation::Linear(33.0),
        Polarisation::Unpolarised,
    ] {
        let [all, passed] = [None, CIRCULAR].map(|analyser| of_ideal_plates(light, analyser));
        // Nothing that is not converted interferes with what is.
        assert!(from_mean(&all.psf, [&left.psf, &right.psf]) < ROUNDING, "{light}");
        near(all.metrics.strehl / left.metrics.strehl, 0.5);
        near(all.metrics.energy_1_pixel / left.metrics.energy_1_pixel, 0.5);
        near(all.metrics.energy_passed, left.metrics.energy_passed);
        // What diverges is a veil without contrast.
        near(all.metrics.mtf_half_nyquist[0] / left.metrics.mtf_half_nyquist[0], 0.5);
        near(passed.metrics.energy_passed, 0.5 * left.metrics.energy_passed);
        near(
            passed.metrics.mtf_half_nyquist[0] / left.metrics.mtf_half_nyquist[0],
            1.0,
        );
        near(passed.metrics.strehl / left.metrics.strehl, 0.5);
    }
    assert_eq!(of_ideal_plates(RIGHT, CIRCULAR).metrics.energy_passed, 0.0);
    assert_eq!(of_ideal_plates(LEFT, CIRCULAR).psf.values, left.psf.values);
    // Two linear analysers that are crossed have all of the light between them, and of one hand each has the same half.
    for light in [LEFT, Polarisation::Linear(20.0)] {
        let whole = of_ideal_plates(light, None);
        let [along, across] = [50.0, -40.0].map(|deg| of_ideal_plates(light, Some(Analyser::Linear(deg))));
        let sum = along.psf.values.iter().zip(&across.psf.values).map(|(a, b)| a + b);
        let off = sum
            .zip(&whole.psf.values)
            .map(|(s, w)| (s - w).abs())
            .fold(0.0, f64::max);
        assert!(off < ROUNDING * largest(&whole.psf), "{light}: {off}");
        near(
            along.metrics.strehl / left.metrics.strehl,
            0.5 * if light == LEFT { 1.0 } else { 0.5 },
        );
    }
}

fn judged(
    lens: &(Design, PillarArray, tempfile::TempDir),
    cell: &dyn CellModel,
    light: Option<Polarisation>,
    analyser: Option<Analyser>,
) -> Verification {
    let (mut design, array, folder) = (lens.0.clone(), &lens.1, &lens.2);
    design.verify.polarisation = light;
    design.verify.analyser = analyser;
    let path = folder.path().join("lens.gds");
    verify(
        &design,
        array,
        &path,
        &SimulationCases::judged_by(cell),
        Accuracy::Accurate,
        &Silent,
    )
    .unwrap()
}

/// Results by the rigorous cell, in all figures that are energies: of one wavelength, of white light, and of where
/// light goes.
#[test]
fn unpolarised_light_is_the_mean_of_both_hands_and_of_both_axes() {
    let lens = lens();
    let cell = cell_models(&lens.0, &[Fidelity::Rigorous]).unwrap().remove(0);
    for analyser in [None, Some(Analyser::Circular), Some(Analyser::Linear(25.0))] {
        let of = |light| judged(&lens, cell.as_ref(), light, analyser);
        let figures = |found: &Verification| -> Vec<f64> {
            let one = &found.distinct[0];
            let spot = one.spots[0].judged().metrics;
            let white = one.white.iter().map(|c| c.energy_passed);
            [spot.energy_window, spot.energy_passed]
                .into_iter()
                .chain(white)
                .collect()
        };
        let image = |found: &Verification| found.distinct[0].spots[0].images().unwrap().extracted.mapv(f64::from);
        let mean = of(Some(Polarisation::Unpolarised));
        let peak = image(&mean).iter().copied().fold(0.0, f64::max);
        assert!(figures(&mean).len() > 2, "white light is among them");
        let axes = [Polarisation::Linear(0.0), Polarisation::Linear(90.0)];
        for pair in [[None, Some(RIGHT)], axes.map(Some)] {
            let [a, b] = pair.map(of);
            let off = &image(&mean) - &(0.5 * (image(&a) + image(&b)));
            let off = off.iter().map(|d| d.abs()).fold(0.0, f64::max);
            assert!(off < ROUNDING * peak, "{pair:?}: {off} of {peak}");
            for (found, (a, b)) in figures(&mean).into_iter().zip(figures(&a).into_iter().zip(figures(&b))) {
                assert!((found - 0.5 * (a + b)).abs() < ROUNDING, "{pair:?}: {found} {a} {b}");
            }
            // Of one hand alone, and what is not converted interferes along the axes.
            assert!(
                (&image(&a) - &image(&b))
                    .iter()
                    .any(|d| d.abs() > 10.0 * ROUNDING * peak),
                "{pair:?}"
            );
        }
        let [own, mean] = [of(None), mean].map(|found| found.distinct[0].orders[0].clone());
        assert!((mean.first - 0.5 * own.first).abs() < ROUNDING && own.diverging.is_none());
        let circular = analyser == Some(Analyser::Circular);
        assert_eq!(mean.diverging.is_some(), !circular);
        assert!(mean.unconverted.is_some() && own.unconverted.is_some() != circular);
        let all = mean.transmitted + mean.diverging.unwrap_or(0.0) + mean.unconverted.unwrap_or(0.0);
        let passed = figures(&of(Some(Polarisation::Unpolarised)))[1];
        // The pillars of the element are not spread evenly over the phase.
        const OF_ELEMENT: f64 = 0.01;
        assert!((all - passed).abs() < OF_ELEMENT, "{all} {passed}");
    }
}
