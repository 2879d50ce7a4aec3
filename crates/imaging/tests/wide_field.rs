//! Kernels far from the axis of an element, against direct sums over all pillars.

mod direct_psf;
mod one_wavelength;

use metalith_cell::{Fidelity, Illumination};
use metalith_core::Silent;
use metalith_design::{Design, cell_models};
use metalith_imaging::scene::SceneImage;
use metalith_imaging::{BankSpec, ChipInLight, KernelBank};
use metalith_layout::read_pillars;
use metalith_optics::SimulationCase;
use metalith_wave::{Pillars, Window};
use ndarray::Array3;

use direct_psf::direct_psf;
use one_wavelength::camera;

const NM: f64 = 550.0;
/// Samples of the direct sum along each axis of a quarter of a pixel.
const FINER: usize = 2;

/// Errors of kernels at the end of a field along x and in its corner: the angle of the chief ray (degrees), the worst error of the
/// share of light in a pixel over the largest share, and the share of light in the window.
fn errors(diameter_um: u32, focal_um: u32, reach_deg: f64, pixels: usize) -> Vec<(f64, f64, f64)> {
    let changed = metalith_testing::changed(
        "mini_3x3",
        &[
            ("elements = [3, 3]", "elements = [1, 1]"),
            ("diameter_um = 60", &format!("diameter_um = {diameter_um}")),
            ("focal_length_um = 144", &format!("focal_length_um = {focal_um}")),
            ("spacing_um = 150", &format!("spacing_um = {}", diameter_um + 60)),
        ],
    );
    let design = Design::parse(
        &metalith_testing::design("mini_3x3"),
        &metalith_testing::accepting(&changed),
    )
    .unwrap();
    let (design, _, folder) = metalith_testing::layouts::written(design);
    let extraction = read_pillars(&design, &folder.path().join("lens.gds"), &Silent).unwrap();
    let cell = cell_models(&design, &[Fidelity::Published]).unwrap().remove(0);
    let case = SimulationCase::from(cell.as_ref());
    let chip = ChipInLight::new(&design, &extraction, case, &camera(NM), f64::INFINITY, &Silent).unwrap();
    let reach_um = f64::from(focal_um) * reach_deg.to_radians().tan();
    let spec = BankSpec {
        pixel_um: 1.5,
        window: pixels,
        nodes: 3,
        reach_um,
        accurate: true,
    };
    let scene = SceneImage::of_rgb("white", &Array3::from_elem((20, 20, 3), 1.0), 16.0, f64::INFINITY);
    let bank = KernelBank::build(&chip, &scene.basis, spec, &Silent).unwrap();
    let index = (chip.sampling.wavelengths_nm.iter().position(|w| *w == NM)).unwrap();
    let um = NM * 1e-3;
    let light = Illumination::normal(um).in_band();
    let table = cell
        .response(&light, design.cell.most(), &Silent)
        .unwrap()
        .focused()
        .unwrap();
    let pillars = Pillars::new(&extraction.elements[0].widths, &table).unwrap();
    let view = chip.distinct[0].view;
    // Along x, and in the corner of the field.
    [[1, 2], [0, 0]]
        .into_iter()
        .map(|node: [usize; 2]| {
            let place = [spec.node_um(node[1]), spec.node_um(node[0])];
            let sines = view.sines_of_landing(place, um);
            let step_um = 0.25 * spec.pixel_um / FINER as f64;
            let window = Window {
                centre_um: place,
                step_um,
                samples: 4 * FINER * pixels,
                distance_um: f64::from(focal_um),
            };
            let psf = direct_psf(&design, &pillars, um, sines, window);
            let unit = step_um * step_um / chip.arriving_um2(0, index);
            // The kernel of white: the sum over its spectra. Its pixels are at every half of one; those of even places are within
            // whole pixels of the window that begins a quarter of a pixel later.
            let mut kernel = vec![0.0; spec.side() * spec.side()];
            for basis in 0..bank.bases {
                let turned = bank.kernel(0, node, 0, basis);
                (kernel.iter_mut().zip(turned.turned().iter())).for_each(|(sum, v)| *sum += f64::from(*v));
            }
            // Middle of value i: (i - window + 1/2) / 2 pixels. A pixel about it begins at quarter 2 i - 1.
            let (mut worst, mut most) = (0.0f64, 0.0f64);
            for (i, k) in (1..spec.side() - 1).flat_map(|i| (1..spec.side() - 1).map(move |k| (i, k))) {
                let [y, x] = [i, k].map(|i| (2 * i - 1) * FINER);
                let pixel = metalith_core::part(psf.values.view(), y..y + 4 * FINER, x..x + 4 * FINER);
                let wanted = unit * pixel.sum();
                worst = worst.max((kernel[i * spec.side() + k] - wanted).abs());
                most = most.max(wanted);
            }
            let angle = view.sines_of_landing(place, um).map(|s| s.powi(2)).iter().sum::<f64>();
            (angle.sqrt().asin().to_degrees(), worst / most, psf.values.sum() * unit)
        })
        .collect()
}

/// Kernels at 41 to 64 degrees, along x and in the corners of these fields, are direct sums.
#[test]
fn kernels_far_from_the_axis_are_direct_sums() {
    /// Pixels of which 64 samples are summed, against quarters of pixels by their middles: at 30 degrees too 4e-3 of the largest.
    const PIXELS: f64 = 6e-3;
    /// The same, and kernels of a third of the light that have no peak.
    const STEEP: f64 = 4e-2;
    for reach_deg in [41.0, 55.0] {
        for (deg, error, share) in errors(12, 30, reach_deg, 16) {
            println!("{deg:.1} degrees: {error:.2e} of the peak, {share:.4} of the light");
            assert!(error < if deg <= 55.5 { PIXELS } else { STEEP }, "{deg}: {error}");
        }
    }
}
