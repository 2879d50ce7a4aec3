//! Sites of a lattice in the order of rings: neighbours on a ring have widths that are alike, and so have rings.

/// Sectors of the full circle.
pub(super) const SECTORS: usize = 36;

/// Directions of the borders of the sectors up to a quarter turn, in parts of a million: whole numbers, so that each
/// site is in one sector on every machine.
const BORDERS: [(i64, i64); 9] = [
    (1_000_000, 0),
    (984_808, 173_648),
    (939_693, 342_020),
    (866_025, 500_000),
    (766_044, 642_788),
    (642_788, 766_044),
    (500_000, 866_025),
    (342_020, 939_693),
    (173_648, 984_808),
];

fn border(k: usize) -> (i64, i64) {
    let (x, y) = BORDERS[k % 9];
    match k / 9 % 4 {
        0 => (x, y),
        1 => (-y, x),
        2 => (-x, -y),
        _ => (y, -x),
    }
}

/// Number of rings, from the middle, that hold all sites with something on them: `extents` has for each row the first
/// and the last such column.
pub(super) fn rings_of(n: usize, extents: impl Iterator<Item = Option<(usize, usize)>>) -> i64 {
    let half = |i: usize| 2 * i as i64 - (n as i64 - 1);
    let farthest = |(iy, (first, last)): (usize, (usize, usize))| {
        let x = half(first).abs().max(half(last).abs());
        x * x + half(iy) * half(iy)
    };
    let rows = extents.enumerate().filter_map(|(iy, extent)| Some((iy, extent?)));
    rows.map(farthest)
        .max()
        .map_or(0, |square| ceil_root(square + 1, 0) / 2 + 1)
}

/// Call `with` with column and row of every site of a lattice of `n` x `n` in a sector, on the first `rings` rings from
/// the middle, counter-clockwise on each. Rings are one pitch wide.
pub(super) fn walk(n: usize, sector: usize, rings: i64, mut with: impl FnMut(usize, usize)) {
    let last = n as i64 - 1;
    let (from, to) = (border(sector), border(sector + 1));
    // Along the coordinate that changes faster on the ring: rows where the direction is level, columns where upright.
    let level = (from.0 + to.0).abs() >= (from.1 + to.1).abs();
    let (walked, other) = if level {
        ((from.1, to.1), from.0 + to.0)
    } else {
        ((from.0, to.0), from.1 + to.1)
    };
    let inside = |x: i64, y: i64| {
        let left_of = |(bx, by): (i64, i64)| bx * y - by * x;
        (left_of(from) >= 0 && left_of(to) < 0) || (sector == 0 && x == 0 && y == 0)
    };
    let forward = walked.1 > walked.0;
    let (mut near_root, mut far_root) = (0, 0);
    for ring in 0..rings {
        // In half pitches, as all coordinates here.
        let (inner, outer) = (2 * ring, 2 * ring + 2);
        let reach = |border: i64, radius: i64| border * radius / 1_000_000;
        let ends = [walked.0, walked.1].map(|b| [reach(b, inner), reach(b, outer)]);
        let low = ends.iter().flatten().min().map_or(0, |v| v - 2).max(-last);
        let high = ends.iter().flatten().max().map_or(0, |v| v + 2).min(last);
        let first = low + (low - last).rem_euclid(2);
        let steps = (high - first).div_euclid(2) + 1;
        for k in 0..steps.max(0) {
            let a = first + 2 * if forward { k } else { steps - 1 - k };
            let (near, far) = (inner * inner - a * a, outer * outer - a * a);
            if far <= 0 {
                continue;
            }
            // From the root of `near` to below that of `far`, in the steps of the lattice.
            near_root = ceil_root(near, near_root);
            far_root = ceil_root(far, far_root);
            let mut b = near_root + ((near_root ^ last) & 1);
            while b < far_root.min(last + 1) {
                let signed = if other < 0 { -b } else { b };
                let (x, y) = if level { (signed, a) } else { (a, signed) };
                if inside(x, y) {
                    with(((x + last) / 2) as usize, ((y + last) / 2) as usize);
                }
                b += 2;
            }
        }
    }
}

/// The smallest whole number whose square is not less, sought from a number near it.
fn ceil_root(square: i64, guess: i64) -> i64 {
    if square <= 0 {
        return 0;
    }
    let mut root = guess;
    // Far off, where a ring begins; a step or two from row to row.
    if (root * root - square).abs() > 8 * (root + 1) {
        root = (square as f64).sqrt() as i64;
    }
    while root * root < square {
        root += 1;
    }
    while (root - 1) * (root - 1) >= square {
        root -= 1;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every site of a lattice, even or odd, is met once; radii grow from ring to ring.
    #[test]
    fn every_site_is_met_once() {
        for n in [1, 2, 3, 10, 31, 64] {
            let rings = rings_of(n, (0..n).map(|_| Some((0, n - 1))));
            let mut met = vec![0; n * n];
            for sector in 0..SECTORS {
                let mut before = 0;
                walk(n, sector, rings, |ix, iy| {
                    met[iy * n + ix] += 1;
                    let half = |i: usize| 2 * i as i64 - (n as i64 - 1);
                    let ring = ceil_root(half(ix).pow(2) + half(iy).pow(2) + 1, 0) - 1;
                    assert!(ring / 2 >= before, "rings from the middle outwards");
                    before = ring / 2;
                });
            }
            assert!(met.iter().all(|&m| m == 1), "{n}");
        }
    }

    #[test]
    fn roots() {
        for square in 1..2000 {
            let root = ceil_root(square, 17);
            assert!(root * root >= square && (root - 1) * (root - 1) < square);
        }
    }
}
