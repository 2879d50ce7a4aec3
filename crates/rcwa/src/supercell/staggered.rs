//! The permittivity of a layer of unlike circles on staggered rows between the plane waves of their supercell.
//!
//! As for one circle (see `permittivity::normal`): D = [C]^-1 [C S] [C]^-1 E. Coefficients are sums over the sites, and no longer real;
//! those of C are alike after both waves change sign and place, so that the rule stands as it is.

use std::collections::HashMap;
use std::f64::consts::TAU;

use faer::Mat;
use faer::linalg::solvers::Solve;
use num_complex::Complex64;

use super::SiteLayer;
use super::placed::Placed;
use super::waves::Waves;
use crate::permittivity::{Permittivity, PillarTensor, disc_moments};

/// Coefficients of the pillars, of f cos and f sin of twice the angle of the normal in them, and of f f, at a difference of two waves.
type Moments = [Complex64; 4];

/// The permittivity matrices of a layer.
pub(super) fn permittivity(
    layer: &SiteLayer,
    pitch_nm: f64,
    row: f64,
    placed: &Placed,
    waves: &Waves,
) -> Permittivity<Complex64> {
    let list = &waves.of[0];
    let count = list.len();
    let mut known: HashMap<[i32; 2], Moments> = HashMap::new();
    let moments = Mat::from_fn(count, count, |i, j| {
        let wave = [0, 1].map(|axis| list[i][axis] - list[j][axis]);
        *known
            .entry(wave)
            .or_insert_with(|| coefficients(layer, pitch_nm, row, placed, wave))
    });
    let [inside, outside] = [layer.inside, layer.outside].map(|index| index * index);
    let matrix_of = |tensor: PillarTensor| {
        Mat::from_fn(2 * count, 2 * count, |i, j| {
            let [pillar, cosine, sine, square] = moments[(i % count, j % count)];
            let uniform = if i == j { tensor.uniform } else { Complex64::ZERO };
            let alike = uniform + tensor.mean * pillar + tensor.square * square;
            match (i < count, j < count) {
                (true, true) => alike + tensor.part * cosine,
                (false, false) => alike - tensor.part * cosine,
                _ => tensor.part * sine,
            }
        })
    };
    let stretched = matrix_of(PillarTensor::stretch(inside, outside)).partial_piv_lu();
    let mut half = matrix_of(PillarTensor::energy(inside, outside));
    stretched.solve_in_place(&mut half);
    let mut turned = half.transpose().to_owned();
    stretched.solve_transpose_in_place(&mut turned);
    let block = |rows: usize, columns: usize| {
        let part = turned.submatrix(columns * count, rows * count, count, count);
        part.transpose().to_owned()
    };
    Permittivity {
        transverse: [block(0, 0), block(1, 1)],
        cross: Some([block(0, 1), block(1, 0)]),
        z: Mat::from_fn(count, count, |i, j| {
            let uniform = if i == j { outside } else { Complex64::ZERO };
            uniform + (inside - outside) * moments[(i, j)][0]
        }),
    }
}

fn coefficients(layer: &SiteLayer, pitch_nm: f64, row: f64, placed: &Placed, wave: [i32; 2]) -> Moments {
    let sites = placed.lattice.len() as f64;
    let vector = placed.vector(wave);
    let mut sums = [Complex64::ZERO; 4];
    for (site, outline) in layer.outlines.iter().enumerate().filter(|(_, o)| !o.is_empty()) {
        let [x, y] = placed.lattice.site(site).map(|step| step as f64);
        let turns = (f64::from(wave[0]) * x + f64::from(wave[1]) * y) / sites;
        let there = Complex64::cis(-TAU * turns) / sites;
        let own = disc_moments(outline.extent_nm()[0] / pitch_nm, row, vector);
        sums.iter_mut().zip(own).for_each(|(sum, own)| *sum += there * own);
    }
    sums
}
