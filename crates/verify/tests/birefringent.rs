//! Light along x and along y behind upright rectangles, from a design to its figures.

use metalith_cell::{
    Analyser, CellModel, CellResponse, Fidelity, Illumination, JonesTables, LinearTables, PillarLibrary, Polarisation,
    PolarisationAxis, PolarisedLight, PolarisedTables,
};
use metalith_core::{Progress, Result, Silent};
use metalith_design::{Design, PillarArray, cell_models};
use metalith_layout::read_pillars;
use metalith_testing::design;
use metalith_testing::layouts::written;
use metalith_verify::{Lighting, SimulationCase, SimulationCases, SinglePsf, Verification, single_psfs, verify};
use metalith_wave::Accuracy;
use num_complex::Complex64;

/// Tolerance as a share of the largest sample: tables and fields are in single precision.
const ROUNDING: f64 = 1e-5;

const WAVELENGTH_UM: f64 = 0.532;

/// The shipped lens with its layout.
fn lens() -> (Design, PillarArray, tempfile::TempDir) {
    written(Design::read(&design("birefringent_532")).unwrap())
}

/// Pillars that have the phases of a library and pass everything.
struct IdealRetarders(PillarLibrary);

impl IdealRetarders {
    fn table(&self, axis: PolarisationAxis, last: u16) -> Vec<Complex64> {
        let of = |number: u16| match self.0.turns(number, axis) {
            Some(turns) => Complex64::cis(std::f64::consts::TAU * turns),
            None => Complex64::ZERO,
        };
        (0..=last).map(of).collect()
    }
}

impl CellModel for IdealRetarders {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn response(&self, _light: &Illumination<'_>, last: u16, _progress: &dyn Progress) -> Result<CellResponse> {
        let tables = PolarisedTables::Axes(LinearTables {
            focused: PolarisationAxis::X,
            along: PolarisationAxis::ALL.map(|axis| self.table(axis, last)),
        });
        Ok(CellResponse::Jones(JonesTables::Polarised(tables)))
    }

    fn full_transmission(&self, _wavelength_um: f64) -> Result<f64> {
        Ok(1.0)
    }
}

type Lens = (Design, PillarArray, tempfile::TempDir);

fn image((design, _, folder): &Lens, arriving: Polarisation, analyser: Option<Analyser>) -> SinglePsf {
    let found = read_pillars(design, &folder.path().join("lens.gds"), &Silent).unwrap();
    let cell = IdealRetarders(PillarLibrary::clone(design.mapping.pillar_library.as_ref().unwrap()));
    let light = Lighting {
        wavelengths_um: vec![WAVELENGTH_UM],
        incidence_sin: [0.0; 2],
        oblique_cells: false,
        distance_um: design.lens.focal_length_um,
        at_um: [0.0; 2],
        samples: 96,
        pixel_um: 1.4,
        polarised: PolarisedLight {
            arriving: Some(arriving),
            analyser,
        },
        aperture_radius_um: None,
        accuracy: Accuracy::Accurate,
        through_focus: None,
    };
    let case = SimulationCase::from(&cell as &dyn CellModel);
    single_psfs(&found, case, &light, &Silent).unwrap().remove(0)
}

/// Light along each axis is focused where its phase says, by as much of it as the library follows that phase; the rest of linear and
/// of unpolarised light is the sum of both, and an analyser takes one of them away.
#[test]
fn each_polarisation_is_focused_to_its_own_side() {
    /// A spot 8 um beside the axis of a lens with its sensor at 120 um: the phase that is perfect for it has 0.984 there. And the phase
    /// error of this lens's own pillars, beside that of all pairs of phases.
    const BESIDE_AXIS: f64 = 0.984;
    const OF_LENS: f64 = 0.01;
    /// Samples are a pitch apart (um).
    const SAMPLED: f64 = 0.35;
    let lens = lens();
    let library = lens.0.mapping.pillar_library.as_ref().unwrap();
    let errors = library.errors();
    let [x, y] = [0.0, 90.0].map(|deg| image(&lens, Polarisation::Linear(deg), None));
    for (found, side, axis) in [(&x, 8.0, 0), (&y, -8.0, 1)] {
        let peak = found.metrics.peak_um;
        assert!((peak[0] - side).abs() < SAMPLED && peak[1].abs() < SAMPLED, "{peak:?}");
        // Errors of a phase are squared twice: as a variance, and about its mean.
        let wanted = BESIDE_AXIS * (-errors.phase[axis].rms_rad.powi(2)).exp();
        assert!(
            (found.metrics.strehl - wanted).abs() < OF_LENS,
            "{} {wanted}",
            found.metrics.strehl
        );
    }
    let values = |psf: &SinglePsf| psf.psf.values.mapv(f64::from);
    let (along_x, along_y) = (values(&x), values(&y));
    let largest = along_x.iter().copied().fold(0.0, f64::max);
    let same = |found: &SinglePsf, wanted: &ndarray::Array2<f64>, what: &str| {
        let off = (values(found) - wanted).iter().map(|d| d.abs()).fold(0.0, f64::max);
        assert!(off < ROUNDING * largest, "{what}: {off} of {largest}");
    };
    let mean = 0.5 * (&along_x + &along_y);
    same(&image(&lens, Polarisation::Unpolarised, None), &mean, "unpolarised");
    same(&image(&lens, Polarisation::Linear(45.0), None), &mean, "45 degrees");
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let wanted = cos.powi(2) * &along_x + sin.powi(2) * &along_y;
    same(&image(&lens, Polarisation::Linear(30.0), None), &wanted, "30 degrees");
    let along = |light| image(&lens, light, Some(Analyser::Linear(0.0)));
    same(
        &along(Polarisation::Linear(45.0)),
        &(0.5 * &along_x),
        "45 degrees behind x",
    );
    same(
        &along(Polarisation::Unpolarised),
        &(0.5 * &along_x),
        "unpolarised behind x",
    );
    // Crossed analysers have all of the light between them, though each lets both polarisations interfere.
    let [one, other] = [20.0, -70.0].map(|deg| {
        let analyser = Some(Analyser::Linear(deg));
        image(&lens, Polarisation::Linear(45.0), analyser)
    });
    same(&one, &(&mean - values(&other)), "crossed analysers");
}

fn judged((design, array, folder): &Lens, polarisation: Option<Polarisation>) -> Verification {
    let mut design = design.clone();
    design.verify.polarisation = polarisation;
    let cell = cell_models(&design, &[Fidelity::Rigorous]).unwrap().remove(0);
    let cases = SimulationCases::judged_by(cell.as_ref());
    let path = folder.path().join("lens.gds");
    verify(&design, array, &path, &cases, Accuracy::Accurate, &Silent).unwrap()
}

/// Results by the rigorous cell and the limits of the design: light along y is judged by its own phase, and both are
/// mirror images.
#[test]
fn each_polarisation_is_judged_by_its_own_phase() {
    /// Tolerance for two pillars that are as near: the library takes one.
    const MIRRORED: f64 = 0.01;
    /// Tolerance of what cells pass of the phases that are asked for, of all pairs and of this lens.
    const FOLLOWS: f64 = 0.03;
    let lens = lens();
    let [x, y] = [None, Some(Polarisation::Linear(90.0))].map(|light| judged(&lens, light));
    let first = lens.0.mapping.pillar_library.as_ref().unwrap().errors().first;
    for (found, axis) in [(&x, 0), (&y, 1)] {
        let failed: Vec<_> = found.checks.iter().filter(|check| !check.passed()).collect();
        assert!(failed.is_empty(), "{failed:?}");
        let one = &found.distinct[0];
        assert!(
            (one.orders[0].first - first[axis]).abs() < FOLLOWS,
            "{:?}",
            one.orders[0]
        );
        assert!(one.orders[0].diverging.is_none() && one.orders[0].unconverted.is_none());
        let spot = &one.spots[0];
        let ratio = spot.judged().metrics.strehl / spot.designed.metrics.strehl;
        assert!((ratio - first[axis]).abs() < FOLLOWS, "{ratio} {first:?}");
    }
    let strehl = |found: &Verification| found.distinct[0].spots[0].judged().metrics.strehl;
    assert!(
        (strehl(&x) - strehl(&y)).abs() < MIRRORED,
        "{} {}",
        strehl(&x),
        strehl(&y)
    );
    let errors = |found: &Verification| found.distinct[0].phase;
    for (a, b) in [
        (errors(&x).rounding, errors(&y).rounding),
        (errors(&x).mapping, errors(&y).mapping),
    ] {
        assert!((a.rms_rad - b.rms_rad).abs() < MIRRORED, "{a:?} {b:?}");
        // Of a library of the same cell, what is rounded is what the cell has.
        assert!((errors(&x).rounding.rms_rad - a.rms_rad).abs() < MIRRORED, "{a:?}");
    }
    let unpolarised = judged(&lens, Some(Polarisation::Unpolarised));
    let half = unpolarised.distinct[0].orders[0].first / x.distinct[0].orders[0].first;
    assert!((half - 0.5).abs() < ROUNDING, "{half}");
}
