//! The permittivity of a layer of unlike pillars between the plane waves of their supercell.
//!
//! As for one pillar (see `layer`): the inverse rule along the component, the Laurent rule across. Along x
//! the plane is cut across y into strips in which every pillar of a line has one width or none. In a
//! strip the 1-D problem of the whole line is inverted; its matrix lives there and nowhere else, so that it is
//! multiplied by the coefficients of the strip. Along y alike.

use std::f64::consts::{PI, TAU};

use faer::Mat;
use num_complex::Complex64;

use super::SiteLayer;
use super::sites::{Lines, SiteLattice};
use super::waves::{Waves, entry};
use crate::basis::Space;
use crate::permittivity::{Permittivity, invert};

/// Edges nearer than this are one (pitches): a strip so thin has no weight beside the rounding of the rest.
const SAME_EDGE: f64 = 1e-12;

/// A strip of constant cross-section along a line of pillars, on both sides of the line's middle (pitches).
struct Strip {
    from: f64,
    to: f64,
    /// Half-width of each pillar of the line; 0 where there is none.
    half_widths: Vec<f64>,
}

/// The permittivity matrices of a layer.
pub(super) fn permittivity(
    layer: &SiteLayer,
    pitch_nm: f64,
    lattice: &SiteLattice,
    waves: &Waves,
) -> Permittivity<Complex64> {
    Permittivity {
        transverse: [0, 1].map(|axis| along(layer, pitch_nm, lattice, waves, axis)),
        cross: None,
        z: laurent(layer, pitch_nm, lattice, waves),
    }
}

/// Matrix for the component along an axis: the inverse rule along it.
fn along(layer: &SiteLayer, pitch_nm: f64, lattice: &SiteLattice, waves: &Waves, axis: usize) -> Mat<Complex64> {
    let (list, space) = (&waves.of[axis], waves.spaces[axis]);
    let (inside, outside) = (layer.inside * layer.inside, layer.outside * layer.outside);
    let lines = lattice.lines(axis);
    let sites = lattice.len() as f64;
    // Only functions of y come in spaces.
    let (space_along, space_across) = if axis == 0 {
        (Space::Full, space)
    } else {
        (space, Space::Full)
    };
    let orders: Vec<i32> = list.iter().map(|wave| wave[axis] / lines.lines as i32).collect();
    let (first, last) = (least(&orders), most(&orders));
    let places: Vec<usize> = orders.iter().map(|m| (m - first) as usize).collect();
    let across: Vec<i32> = list.iter().map(|wave| wave[1 - axis]).collect();
    let widest = 2 * most(&across).max(-least(&across));

    let mut matrix = Mat::<Complex64>::zeros(list.len(), list.len());
    for line in 0..lines.lines {
        for strip in strips(layer, pitch_nm, lattice, &lines, line) {
            let inverse = inverse_rule(&strip, inside, outside, first, last, space_along);
            let coefficients: Vec<Complex64> = (-widest..=widest)
                .map(|d| {
                    let k = f64::from(d) / sites;
                    Complex64::cis(-TAU * k * line as f64) * (band(k, strip.from, strip.to) / lines.lines as f64)
                })
                .collect();
            let of = |d: i32| coefficients[(d + widest) as usize];
            for j in 0..list.len() {
                let column = inverse.col_as_slice(places[j]);
                for (i, value) in matrix.col_as_slice_mut(j).iter_mut().enumerate() {
                    *value += column[places[i]] * entry(space_across, across[i], across[j], of);
                }
            }
        }
    }
    for i in 0..list.len() {
        matrix[(i, i)] += outside;
    }
    matrix
}

/// Strips of a line, from its middle to half a pitch, without those that hold nothing.
fn strips(layer: &SiteLayer, pitch_nm: f64, lattice: &SiteLattice, lines: &Lines, line: usize) -> Vec<Strip> {
    let bands: Vec<_> = (0..lines.period)
        .map(|step| {
            let [x, y] = lines.site(line, step);
            layer.outlines[lattice.index(x, y)].bands(lines.axis)
        })
        .collect();
    let mut edges: Vec<f64> = bands.iter().flatten().map(|b| b.to / pitch_nm).collect();
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|a, b| *a - *b < SAME_EDGE);
    let mut from = 0.0;
    let mut strips = Vec::new();
    for to in edges {
        if to - from < SAME_EDGE {
            continue;
        }
        let middle = 0.5 * (from + to) * pitch_nm;
        let half_widths = bands
            .iter()
            .map(|bands| {
                let here = bands.iter().find(|b| b.from <= middle && middle < b.to);
                here.map_or(0.0, |b| b.half_width / pitch_nm)
            })
            .collect();
        strips.push(Strip { from, to, half_widths });
        from = to;
    }
    strips
}

/// 1 / (Toeplitz matrix of 1 / permittivity) of a strip between the orders `first..=last` along it, less the
/// permittivity outside.
fn inverse_rule(
    strip: &Strip,
    inside: Complex64,
    outside: Complex64,
    first: i32,
    last: i32,
    space: Space,
) -> Mat<Complex64> {
    let period = strip.half_widths.len() as f64;
    let contrast = inside.inv() - outside.inv();
    let widest = 2 * last.max(-first);
    let coefficients: Vec<Complex64> = (-widest..=widest)
        .map(|d| {
            let k = f64::from(d) / period;
            let pillars = strip.half_widths.iter().enumerate();
            let sum: Complex64 = pillars
                .map(|(step, &half)| Complex64::cis(-TAU * k * step as f64) * band(k, 0.0, half))
                .sum();
            let uniform = if d == 0 { outside.inv() } else { Complex64::ZERO };
            uniform + contrast * sum / period
        })
        .collect();
    let n = (last - first + 1) as usize;
    let toeplitz = Mat::from_fn(n, n, |i, j| {
        entry(space, first + i as i32, first + j as i32, |d| {
            coefficients[(d + widest) as usize]
        })
    });
    let mut inverse = invert(toeplitz);
    (0..n).for_each(|i| inverse[(i, i)] -= outside);
    inverse
}

/// Matrix for Ez: the Laurent rule along both axes.
fn laurent(layer: &SiteLayer, pitch_nm: f64, lattice: &SiteLattice, waves: &Waves) -> Mat<Complex64> {
    let (list, space) = (&waves.of[2], waves.spaces[2]);
    let sites = lattice.len() as f64;
    let outside = layer.outside * layer.outside;
    let contrast = (layer.inside * layer.inside - outside) / sites;
    let highest = |axis: usize| list.iter().map(|wave| wave[axis].abs()).max().unwrap_or(0);
    let (reach_x, reach_y) = (2 * highest(0), 2 * highest(1));
    let width = (2 * reach_y + 1) as usize;
    let mut table = vec![None; (2 * reach_x + 1) as usize * width];
    let bands: Vec<_> = layer.outlines.iter().map(|o| o.bands(0)).collect();
    let coefficient = |x: i32, y: i32| -> Complex64 {
        let k = [x, y].map(|d| f64::from(d) / sites);
        let pillars = bands.iter().enumerate().map(|(index, bands)| {
            let [a, b] = lattice.site(index).map(|v| v as f64);
            let shape: f64 = bands
                .iter()
                .map(|s| {
                    let [half, from, to] = [s.half_width, s.from, s.to].map(|v| v / pitch_nm);
                    band(k[0], 0.0, half) * band(k[1], from, to)
                })
                .sum();
            Complex64::cis(-TAU * (k[0] * a + k[1] * b)) * shape
        });
        pillars.sum::<Complex64>() * contrast
    };
    let mut matrix = Mat::<Complex64>::zeros(list.len(), list.len());
    for j in 0..list.len() {
        for i in 0..list.len() {
            let dx = list[i][0] - list[j][0];
            let mut of = |dy: i32| {
                let cell = &mut table[(dx + reach_x) as usize * width + (dy + reach_y) as usize];
                *cell.get_or_insert_with(|| coefficient(dx, dy))
            };
            let (to, from) = (list[i][1], list[j][1]);
            let near = of(to - from);
            let far = if space == Space::Full { near } else { of(to + from) };
            matrix[(i, j)] = entry(space, to, from, |d| if d == to - from { near } else { far });
        }
        matrix[(j, j)] += outside;
    }
    matrix
}

/// Integral of exp(-2 pi i k t) over from < |t| < to.
fn band(k: f64, from: f64, to: f64) -> f64 {
    if k == 0.0 {
        2.0 * (to - from)
    } else {
        ((TAU * k * to).sin() - (TAU * k * from).sin()) / (PI * k)
    }
}

fn least(values: &[i32]) -> i32 {
    values.iter().copied().min().unwrap_or(0)
}

fn most(values: &[i32]) -> i32 {
    values.iter().copied().max().unwrap_or(0)
}
