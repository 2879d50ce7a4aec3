//! The light beside the images, traced as rays, against the field itself.

use metalith_cell::Fidelity;
use metalith_core::Silent;
use metalith_design::array::PillarArray;
use metalith_design::{Design, cell_models};
use metalith_wave::propagation::{LandingGrid, LocalAngularSpectrum, leaving};
use metalith_wave::{Accuracy, FoldedPropagator, Pillars, PlaneWave, Psf, Scratch, Window};

/// Squares of the stray light: 16 pixels of 5.86 um.
const CELL_UM: f64 = 93.76;
/// Distances of the squares from where the image is, along x and along the diagonal: beyond the window of a kernel, which has half
/// an edge of 188 um, up to the neighbouring element's place (squares).
const STEPS: [i32; 5] = [3, 4, 6, 9, 14];
/// Sines along x that light leaves with beyond where it is meant to go, and for each what the light of all these squares may err
/// by together, and root mean square over them in parts of their mean. Along the axis it is 0.015 and 0.051 at most. At 24
/// degrees 0.03 and 0.15: light of a tile that leaves obliquely is bent too little on its way.
const DIRECTIONS: [(f64, f64, f64); 2] = [(0.0, 0.02, 0.1), (0.4, 0.035, 0.2)];
/// Number of blocks, as the stray light of pictures has them.
const BLOCKS: usize = 20;

/// An element of 1 mm that looks ahead, and one that is steered by 15 degrees along y.
#[test]
#[ignore = "second tier: fields of elements of 1 mm, some minutes"]
fn the_stray_light_of_an_element_is_that_of_its_field() {
    let design = Design::read("../../designs/prototype_3x3.toml".as_ref()).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let cells = cell_models(&design, &[Fidelity::Rigorous]).unwrap();
    let focal_um = design.lens.focal_length_um;
    for index in [(0, 0), (0, -1)] {
        let elements = design.elements();
        let k = elements.iter().position(|e| e.index == index).unwrap();
        let widths = array.widths(&array.placed[k]);
        for um in [0.455, 0.53, 0.66] {
            let table = cells[0].transmissions(um, design.cell.pitch_nm.nm() as u16).unwrap();
            let pillars = Pillars::new(widths.as_ref(), &table).unwrap();
            let departure = LocalAngularSpectrum::of(&pillars, um, focal_um, BLOCKS);
            for (beyond, most_of_total, most_of_map) in DIRECTIONS {
                let mut wave = PlaneWave::looked_at(&elements[k].wedge, um);
                wave.sin_x += beyond;
                let grid = LandingGrid {
                    cell_um: CELL_UM,
                    cells: 55,
                    distance_um: focal_um,
                };
                let towards = leaving(&elements[k].wedge, &wave);
                let map = departure.landing([wave.sin_x, wave.sin_y], towards, grid).unwrap();
                let tangent = beyond / (1.0 - beyond * beyond).sqrt();
                let image = (focal_um * tangent / CELL_UM).round() as i32;
                let (mut traced, mut wanted) = (Vec::new(), Vec::new());
                for [dx, dy] in STEPS
                    .iter()
                    .flat_map(|s| [[*s, 0], [-s, 0], [0, *s], [0, -s], [*s, *s], [-s, *s]])
                {
                    let square = [image + dx, dy];
                    let [column, row] = square.map(|d| (27 + d) as usize);
                    traced.push(map.power_um2[[row, column]]);
                    wanted.push(power_of_field(
                        &design,
                        &pillars,
                        &wave,
                        square.map(|d| f64::from(d) * CELL_UM),
                    ));
                }
                let [sum_traced, sum] = [&traced, &wanted].map(|v| v.iter().sum::<f64>());
                let mean = sum / wanted.len() as f64;
                let pairs = traced.iter().zip(&wanted);
                let squares: f64 = pairs.map(|(a, b): (&f64, &f64)| (a - b).powi(2)).sum();
                let rms = (squares / wanted.len() as f64).sqrt() / mean;
                let total = sum_traced / sum - 1.0;
                println!("{index:?} {um} {beyond}: total {total:+.4}, map {rms:.3}");
                assert!(total.abs() < most_of_total, "{index:?} {um} {beyond}: {total}");
                assert!(rms < most_of_map, "{index:?} {um} {beyond}: {rms}");
            }
        }
    }
}

/// Power that the field brings to a square about a place (um^2).
fn power_of_field(design: &Design, pillars: &Pillars<'_>, wave: &PlaneWave, centre_um: [f64; 2]) -> f64 {
    let samples = (CELL_UM / 0.33).round() as usize;
    let window = Window {
        centre_um,
        step_um: CELL_UM / samples as f64,
        samples,
        distance_um: design.lens.focal_length_um,
    };
    let (radius, um) = (design.lens.radius_um(), wave.wavelength_um);
    let fold = FoldedPropagator::plan(design.lattice(), radius, um, window, Accuracy::Accurate).unwrap();
    let psf = Psf::formed(&fold, pillars, wave, &[], &mut Scratch::default()).unwrap();
    psf.values.sum() * window.step_um.powi(2)
}
