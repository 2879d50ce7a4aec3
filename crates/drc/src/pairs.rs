//! Pairs of shapes that are near one another: a sweep over bounding boxes from below.

use std::collections::BTreeSet;
use std::ops::Range;

use super::body::Body;
use super::flat_layout::{FlatLayout, LooseShapes};
use super::work::{Stop, Work};
use metalith_gds::{LayerNumber, Rect};
use metalith_pillars::PillarRows;

/// The rectangle between two shapes, or where they overlap: where to look.
pub(super) fn place(a: &Rect, b: &Rect) -> Rect {
    let along = |a0: i64, a1: i64, b0: i64, b1: i64| {
        let (low, high) = (a0.max(b0), a1.min(b1));
        (low.min(high), low.max(high))
    };
    let (x0, x1) = along(a.x0, a.x1, b.x0, b.x1);
    let (y0, y1) = along(a.y0, a.y1, b.y0, b.y1);
    Rect { x0, y0, x1, y1 }
}

/// Hand every pair on a layer whose bounding boxes are at most `reach` apart to `f`: pairs of loose shapes, of loose shapes
/// with pillars on lattices, and of pillars of different elements. Pairs of pillars on one lattice are not among them.
///
/// # Errors
/// If the work is out of proportion to the layout, or the user stopped it.
pub(super) fn near<'s>(
    flat: &'s FlatLayout<'_>,
    layer: LayerNumber,
    reach: i64,
    mut f: impl FnMut(Body<'s>, Body<'s>),
) -> Result<(), Stop> {
    if let Some(loose) = flat.loose(layer) {
        near_loose(flat, loose, layer, reach, &mut f)?;
    }
    if layer == flat.pillars {
        near_elements(flat, reach, &mut f)?;
    }
    Ok(())
}

/// Pairs of [`near`] with loose shapes.
fn near_loose<'s>(
    flat: &'s FlatLayout<'_>,
    loose: &'s LooseShapes,
    layer: LayerNumber,
    reach: i64,
    f: &mut impl FnMut(Body<'s>, Body<'s>),
) -> Result<(), Stop> {
    let body = |k: usize| loose.body(k);
    let bounds: Vec<[i32; 4]> = if loose.polygons.is_empty() {
        Vec::new()
    } else {
        // Places of polygons were checked when they were kept: a bounding box has the range of its vertices.
        loose
            .bounds()
            .map(|r| [r.x0, r.y0, r.x1, r.y1].map(|v| v as i32))
            .collect()
    };
    let boxes = if bounds.is_empty() { &loose.rects } else { &bounds };
    let effort = |a: usize, b: usize| body(a).effort(&body(b));
    sweep(boxes, reach, effort, flat.work, |a, b| f(body(a), body(b)))?;
    if layer != flat.pillars {
        return Ok(());
    }
    for (k, b) in boxes.iter().enumerate() {
        let [x0, y0, x1, y1] = b.map(i64::from);
        let around = Rect { x0, y0, x1, y1 };
        for element in 0..flat.elements.len() {
            pillars_near(flat, element, &around, reach, |pillar| {
                flat.work.spend(body(k).effort(&pillar))?;
                f(body(k), pillar);
                Ok(())
            })?;
        }
    }
    Ok(())
}

/// Pairs of [`near`] of pillars of two elements, which stand on the rims of lenses that are near one another.
fn near_elements<'s>(flat: &'s FlatLayout<'_>, reach: i64, f: &mut impl FnMut(Body<'s>, Body<'s>)) -> Result<(), Stop> {
    let around: Vec<Rect> = (0..flat.elements.len()).map(|k| around_element(flat, k)).collect();
    // Elements beyond what numbers of the format reach are compared though they may be far from one another.
    let limited = |v: i64| v.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
    let boxes: Vec<[i32; 4]> = around.iter().map(|r| [r.x0, r.y0, r.x1, r.y1].map(limited)).collect();
    let mut pairs = Vec::new();
    sweep(&boxes, reach, |_, _| 1, flat.work, |a, b| pairs.push((a, b)))?;
    for (a, b) in pairs {
        pillars_near(flat, a, &around[b], reach, |pillar| {
            pillars_near(flat, b, &pillar.bounds(), reach, |other| {
                flat.work.spend(pillar.effort(&other))?;
                f(pillar, other);
                Ok(())
            })
        })?;
    }
    Ok(())
}

/// The box around all sites that are of an element and pillars on them, which are at most a pitch wide (database units).
fn around_element(flat: &FlatLayout<'_>, element: usize) -> Rect {
    let site = &flat.elements[element].site;
    let half = f64::from(site.lattice.pitch_nm()) / 2.0;
    let [[x0, x1], [y0, y1]] = site.ends_nm().map(|ends| ends.map(|nm| nm as f64));
    Rect {
        x0: flat.units(x0 - half).floor() as i64,
        y0: flat.units(y0 - half).floor() as i64,
        x1: flat.units(x1 + half).ceil() as i64,
        y1: flat.units(y1 + half).ceil() as i64,
    }
}

/// Hand every pillar of an element whose bounding box is at most `reach` from a rectangle to `f`.
fn pillars_near(
    flat: &FlatLayout<'_>,
    element: usize,
    to: &Rect,
    reach: i64,
    mut f: impl FnMut(Body<'static>) -> Result<(), Stop>,
) -> Result<(), Stop> {
    let grown = Rect {
        x0: to.x0 - reach,
        y0: to.y0 - reach,
        x1: to.x1 + reach,
        y1: to.y1 + reach,
    };
    let (rows, columns) = sites_in(flat, element, &grown);
    let sites = (rows.end - rows.start).max(0) as u64 * (columns.end - columns.start).max(0) as u64;
    flat.work.spend(1 + sites)?;
    pillars_in(flat, element, rows, columns, grown).try_for_each(&mut f)
}

/// Rows and columns of the lattice of an element whose pillars could touch a rectangle.
fn sites_in(flat: &FlatLayout<'_>, element: usize, r: &Rect) -> (Range<i64>, Range<i64>) {
    let site = &flat.elements[element].site;
    let (sites, pitch) = (site.lattice.sites() as i64, f64::from(site.lattice.pitch_nm()));
    let range = |axis: usize, low: i64, high: i64| {
        // Widths are at most a pitch: sites within half a pitch of the rectangle.
        let first = site.lattice.place_nm(axis, 0) + site.centre_nm[axis] as f64;
        let step = site.lattice.steps_nm()[axis];
        let index = |v: i64, half: f64| (v as f64 * flat.unit_nm + half - first) / step;
        let from = index(low, -pitch / 2.0).floor().max(0.0) as i64;
        let to = index(high, pitch / 2.0).ceil().min((sites - 1) as f64) as i64;
        from..to + 1
    };
    let columns = range(0, r.x0, r.x1);
    let rows = range(1, r.y0, r.y1);
    (rows, columns)
}

/// Pillars of those sites that touch the rectangle.
fn pillars_in<'s>(
    flat: &'s FlatLayout<'_>,
    element: usize,
    rows: Range<i64>,
    columns: Range<i64>,
    r: Rect,
) -> impl Iterator<Item = Body<'static>> + 's {
    rows.flat_map(move |row| columns.clone().map(move |column| (row as usize, column as usize)))
        .filter(move |&(row, column)| flat.elements[element].widths.number(column, row) != 0)
        .map(move |(row, column)| flat.body(element, row, column))
        .filter(move |body| {
            let p = body.bounds();
            p.x0 <= r.x1 && r.x0 <= p.x1 && p.y0 <= r.y1 && r.y0 <= p.y1
        })
}

/// Pairs of boxes at most `reach` apart along x and along y. Boxes are taken from the lowest; those that
/// still reach up are kept by their left edge in classes of width, so that a search spans little more than
/// the box itself. Every candidate of a search counts as work, near or not.
fn sweep(
    boxes: &[[i32; 4]],
    reach: i64,
    effort: impl Fn(usize, usize) -> u64,
    work: &Work<'_>,
    mut f: impl FnMut(usize, usize),
) -> Result<(), Stop> {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    order.sort_unstable_by_key(|&k| (boxes[k as usize][1], k));
    let mut classes: Vec<BTreeSet<(i32, u32)>> = vec![BTreeSet::new(); 33];
    let mut gone: Vec<(i32, u32)> = Vec::new();
    for &k in &order {
        let [x0, y0, x1, _] = boxes[k as usize].map(i64::from);
        for (class, open) in classes.iter_mut().enumerate().filter(|(_, open)| !open.is_empty()) {
            let limit = |v: i64| v.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
            let from = limit(x0 - reach - (1 << class));
            let to = limit(x1 + reach);
            for &(other_x0, other) in open.range((from, 0)..=(to, u32::MAX)) {
                work.spend(1)?;
                let [_, _, other_x1, other_y1] = boxes[other as usize].map(i64::from);
                if other_y1 + reach < y0 {
                    gone.push((other_x0, other));
                } else if other_x1 + reach >= x0 {
                    work.spend(effort(other as usize, k as usize))?;
                    f(other as usize, k as usize);
                }
            }
            for entry in gone.drain(..) {
                open.remove(&entry);
            }
        }
        let width = (x1 - x0).max(1) as u64;
        let class = width.next_power_of_two().trailing_zeros() as usize;
        classes[class].insert((x0 as i32, k));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::super::body::between;
    use super::super::work::Allowance;
    use super::*;

    /// Against all pairs, for boxes of many sizes.
    #[test]
    fn sweep_finds_what_comparing_all_finds() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        for reach in [0, 5, 60] {
            let boxes: Vec<[i32; 4]> = (0..400)
                .map(|_| {
                    let (x, y) = (rng.random_range(-900..900), rng.random_range(-900..900));
                    let size = 1 << rng.random_range(0..10);
                    [x, y, x + rng.random_range(1..=size), y + rng.random_range(1..=size)]
                })
                .collect();
            let mut found = Vec::new();
            let work = Work::new(&Allowance::of([]), &metalith_core::Silent);
            sweep(&boxes, reach, |_, _| 1, &work, |a, b| found.push((a.min(b), a.max(b)))).unwrap();
            found.sort_unstable();
            let near = |a: [i32; 4], b: [i32; 4]| {
                let rect = |r: [i32; 4]| {
                    let [x0, y0, x1, y1] = r.map(i64::from);
                    Rect { x0, y0, x1, y1 }
                };
                let (dx, dy) = between(&rect(a), &rect(b));
                dx <= reach && dy <= reach
            };
            let mut expected = Vec::new();
            for a in 0..boxes.len() {
                expected.extend(
                    (a + 1..boxes.len())
                        .filter(|&b| near(boxes[a], boxes[b]))
                        .map(|b| (a, b)),
                );
            }
            assert_eq!(found, expected);
            assert!(expected.len() > 50);
        }
    }
}
