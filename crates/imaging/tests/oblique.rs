//! Elements whose cells are solved along the directions of arrival, against cells that are solved for each direction.

mod one_wavelength;

use metalith_cell::Illumination;
use metalith_core::Silent;
use metalith_design::{Design, cell_models};
use metalith_imaging::ChipInLight;
use metalith_layout::read_pillars;
use metalith_optics::{Placement, SimulationCase};
use metalith_wave::{Accuracy, Scratch, Window};

use one_wavelength::camera;

/// Wavelength at which light from the side meets orders of the lattice (nm).
const NM: f64 = 530.0;

/// Light of an image at directions between those that are solved, in both planes and between these.
#[test]
fn light_between_solved_directions_meets_the_cells_of_its_own() {
    /// Light of the image, relative to that with cells of its own direction: orders of the lattice begin between two solved
    /// directions (0.092 at 30 degrees).
    const BETWEEN: f64 = 0.12;
    /// Light with cells along the normal, relative to the same, at 40 degrees in the plane between both solved ones (4.25).
    const ALONG_THE_NORMAL: f64 = 4.0;
    let text = metalith_testing::accepting(&metalith_testing::changed(
        "mini_3x3",
        &[
            ("elements = [3, 3]", "elements = [1, 1]"),
            (
                "[verify]\n",
                "[verify]\nincidence = \"oblique\"\nfidelity = \"rigorous\"\n",
            ),
        ],
    ));
    let design = Design::parse(&metalith_testing::design("mini_3x3"), &text).unwrap();
    let (design, _, folder) = metalith_testing::layouts::written(design);
    let extraction = read_pillars(&design, &folder.path().join("lens.gds"), &Silent).unwrap();
    let cell = cell_models(&design, &[design.verify.fidelity]).unwrap().remove(0);
    let case = SimulationCase::from(cell.as_ref());
    let chip = ChipInLight::new(&design, &extraction, case, &camera(NM), f64::INFINITY, &Silent).unwrap();
    let light = chip.in_light(0, &[0], &Silent).unwrap();
    let um = chip.sampling.wavelengths_nm[0] * 1e-3;
    let optics = case.optics(design.cell.lattice, design.cell.most());
    let placement = Placement {
        radius_um: design.lens.radius_um(),
        aperture_radius_um: design.aperture_radius_of_um(&design.elements()[0]),
        centre_um: [0.0; 2],
    };
    let own = optics.element(&extraction.elements[0].widths, &placement).unwrap();
    for (sine, azimuth_deg) in [(0.0f64, 0.0f64), (0.2, 10.0), (0.5, 0.0), (0.64, 20.0), (0.64, 45.0)] {
        let azimuth = azimuth_deg.to_radians();
        let sines = [sine * azimuth.cos(), sine * azimuth.sin()];
        let view = chip.elements[0];
        let landing = view.landing_um(sines, um).unwrap();
        let window = Window::about(landing, 0.5, 64, view.distance_um(landing));
        let energy = |fields: &metalith_optics::IncoherentFields<'_>| {
            let psf = fields
                .psf(window, Accuracy::Accurate, &[], &mut Scratch::default())
                .unwrap();
            psf.values.iter().sum::<f64>()
        };
        let wanted = Illumination::from_direction(um, sines).in_band().oblique();
        let ratio = energy(&light.lit(0, sines)) / energy(&own.in_light(&wanted, &Silent).unwrap());
        let normal = Illumination::from_direction(um, sines).in_band();
        let before =
            energy(&own.in_light(&normal, &Silent).unwrap()) / energy(&own.in_light(&wanted, &Silent).unwrap());
        println!("{NM} nm, sine {sine}, azimuth {azimuth_deg}: {ratio:.3}, along the normal {before:.3}");
        assert!(
            (sine, azimuth_deg) != (0.64, 20.0) || before > ALONG_THE_NORMAL,
            "{before}"
        );
        assert!((ratio - 1.0).abs() < BETWEEN, "{sine} {azimuth_deg}: {ratio}");
    }
}
