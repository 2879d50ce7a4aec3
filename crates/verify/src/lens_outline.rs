//! Outline of the pillars of an element: whether a part of a lens may be missing, which no figure of the pillars that are there shows.

use std::f64::consts::PI;

use super::single::whole_aperture;
use metalith_gds::extract::{ExtractedElement, Extraction};
use metalith_pillars::PillarMap;
use metalith_report::sig;

/// Share of the smallest circle about its pillars that a whole lens fills at least: a regular hexagon fills 0.83, half a disc 0.5.
const LEAST_OF_CIRCLE: f64 = 0.8;
/// Share of the smallest rectangle about its pillars that a lens with four straight sides fills at least: half a disc fills 0.79.
const LEAST_OF_RECTANGLE: f64 = 0.9;
/// Share of the convex hull of its pillars that a whole lens fills at least, holes among them filled: a disc of which a quarter is
/// missing fills 0.83.
const LEAST_OF_HULL: f64 = 0.9;

/// Shares that pillars fill of the shapes about them.
struct Shares {
    circle: f64,
    rectangle: f64,
    hull: f64,
}

/// Warnings of elements whose pillars fill neither a disc, nor a hexagon, nor a rectangle, in words.
pub fn outline_warnings(found: &Extraction) -> Vec<String> {
    let warning = |shares: &Shares, name: &str| {
        let percent = |share: f64| sig(100.0 * share.min(1.0), 2);
        format!(
            "warning: the pillars of {name} fill {} % of the smallest circle about them, {} % of the smallest rectangle and {} % of their \
             convex hull: if a part of the lens is missing there, the Strehl ratio does not show it",
            percent(shares.circle),
            percent(shares.rectangle),
            percent(shares.hull),
        )
    };
    let of = |e: &ExtractedElement| {
        let shares = shares_of(&e.widths)?;
        let is_whole = shares.hull >= LEAST_OF_HULL
            && (shares.circle >= LEAST_OF_CIRCLE || shares.rectangle >= LEAST_OF_RECTANGLE);
        (!is_whole).then(|| warning(&shares, &e.site.name))
    };
    found.elements.iter().filter_map(of).collect()
}

/// Shares that the pillars of an element fill, each with the half pitch about it; none without pillars.
fn shares_of(widths: &PillarMap) -> Option<Shares> {
    let lattice = widths.lattice;
    let whole = whole_aperture(widths);
    let mut sites = 0u64;
    let mut ends: Vec<[f64; 2]> = Vec::new();
    for (iy, row) in whole.number.rows().into_iter().enumerate() {
        let mut columns = row.iter().enumerate().filter(|(_, n)| **n > 0).map(|(ix, _)| ix);
        sites += row.iter().filter(|n| **n > 0).count() as u64;
        if let Some(first) = columns.next() {
            let place = |ix: usize| [lattice.place_um(0, ix), lattice.place_um(1, iy)];
            ends.extend([place(first), place(columns.next_back().unwrap_or(first))]);
        }
    }
    let hull = convex_hull(ends);
    if hull.len() < 3 {
        return None;
    }
    let half = 0.5 * lattice.pitch_um();
    let next = |k: usize| hull[(k + 1) % hull.len()];
    let area: f64 = (0..hull.len())
        .map(|k| 0.5 * (hull[k][0] * next(k)[1] - hull[k][1] * next(k)[0]))
        .sum();
    let around: f64 = (0..hull.len()).map(|k| away(hull[k], next(k))).sum();
    let area = area + around * half + PI * half * half;
    let rectangle = (0..hull.len()).map(|k| rectangle_along(&hull, hull[k], next(k), half));
    Some(Shares {
        circle: area / (PI * (smallest_circle(&hull) + half).powi(2)),
        rectangle: area / rectangle.fold(f64::INFINITY, f64::min),
        hull: sites as f64 * lattice.cell_um2() / area,
    })
}

fn away(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Corners of the convex hull, counter-clockwise.
fn convex_hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                let turn = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
                if turn > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

/// Area of the rectangle about a hull along one of its sides, wider by a length all around.
fn rectangle_along(hull: &[[f64; 2]], a: [f64; 2], b: [f64; 2], more: f64) -> f64 {
    let length = away(a, b);
    let [x, y] = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
    let extent = |along: [f64; 2]| {
        let each = hull.iter().map(|p| p[0] * along[0] + p[1] * along[1]);
        each.clone().fold(f64::NEG_INFINITY, f64::max) - each.fold(f64::INFINITY, f64::min) + 2.0 * more
    };
    extent([x, y]) * extent([-y, x])
}

/// Radius of the smallest circle about points: the middle goes towards the farthest of them in ever smaller steps (M. Badoiu and K.
/// L. Clarkson, Proc. SODA, 801 (2003)), to a thousandth.
fn smallest_circle(points: &[[f64; 2]]) -> f64 {
    const STEPS: usize = 1000;
    let farthest = |m: [f64; 2]| {
        points
            .iter()
            .max_by(|a, b| away(m, **a).total_cmp(&away(m, **b)))
            .copied()
    };
    let mut middle = points[0];
    for step in 1..=STEPS {
        let Some(p) = farthest(middle) else { return 0.0 };
        (0..2).for_each(|k| middle[k] += (p[k] - middle[k]) / (step + 1) as f64);
    }
    farthest(middle).map_or(0.0, |p| away(middle, p))
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_pillars::{Lattice, LatticeKind};

    /// The map of the sites of a lattice that a lens takes, by their places (um).
    fn lens(kind: LatticeKind, sites: usize, has: impl Fn(f64, f64) -> bool) -> PillarMap {
        let lattice = Lattice::of_kind(kind, 400, sites).unwrap();
        let mut map = PillarMap::empty(lattice);
        for ((iy, ix), number) in map.number.indexed_iter_mut() {
            let is_site = lattice.has(ix, iy) && has(lattice.place_um(0, ix), lattice.place_um(1, iy));
            *number = u16::from(is_site) * 100;
        }
        map
    }

    fn is_whole(map: &PillarMap) -> bool {
        let shares = shares_of(map).unwrap();
        shares.hull >= LEAST_OF_HULL && (shares.circle >= LEAST_OF_CIRCLE || shares.rectangle >= LEAST_OF_RECTANGLE)
    }

    #[test]
    fn a_part_that_is_missing_shows_in_the_outline() {
        for (kind, sites) in [
            (LatticeKind::Square, 5),
            (LatticeKind::Square, 80),
            (LatticeKind::Hexagonal, 161),
        ] {
            let radius = 0.2
                * if kind == LatticeKind::Square {
                    sites as f64
                } else {
                    0.5 * sites as f64
                };
            let disc = |x: f64, y: f64| x.hypot(y) <= radius;
            assert!(is_whole(&lens(kind, sites, disc)), "{kind} {sites}");
            assert!(is_whole(&lens(kind, sites, |x, y| x.abs().max(y.abs()) < 0.6 * radius)));
            if sites < 10 {
                continue;
            }
            assert!(
                is_whole(&lens(kind, sites, |x, y| disc(x, y) && (x - 3.0).hypot(y) > 2.0)),
                "a hole"
            );
            assert!(!is_whole(&lens(kind, sites, |x, y| disc(x, y) && x >= 0.0)), "half");
            assert!(
                !is_whole(&lens(kind, sites, |x, y| disc(x, y) && (x >= 0.0 || y >= 0.0))),
                "three quarters"
            );
            assert!(
                !is_whole(&lens(kind, sites, |x, y| disc(x, y) && x >= -0.3 * radius)),
                "two thirds"
            );
        }
    }
}
