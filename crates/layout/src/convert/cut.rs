//! Outlines of more corners than a format has, cut along lines into several.

use std::cmp::Ordering;

/// Halvings of an outline; each halves the corners between the cuts.
const MOST_DEPTH: u32 = 40;

/// Parts of an outline (not closed) of at most `most` corners each, which together cover the same area. Where a slanted
/// edge crosses a cut, its place is rounded to the grid. None if cutting does not end.
pub(super) fn cut(outline: &[[i64; 2]], most: usize) -> Option<Vec<Vec<[i64; 2]>>> {
    let mut done = Vec::new();
    let mut open = vec![(outline.to_vec(), 0)];
    while let Some((part, depth)) = open.pop() {
        let part = plain(part);
        if part.len() < 3 {
            continue;
        }
        if part.len() <= most {
            done.push(part);
        } else if depth == MOST_DEPTH {
            return None;
        } else {
            open.extend(halves(&part)?.into_iter().map(|half| (half, depth + 1)));
        }
    }
    Some(done)
}

/// An outline without corners that it would be the same without.
fn plain(outline: Vec<[i64; 2]>) -> Vec<[i64; 2]> {
    let turns = |a: [i64; 2], b: [i64; 2], c: [i64; 2]| {
        let ([ax, ay], [bx, by]) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
        i128::from(ax) * i128::from(by) != i128::from(ay) * i128::from(bx)
    };
    let mut kept: Vec<[i64; 2]> = Vec::with_capacity(outline.len());
    for corner in outline {
        while let [.., a, b] = kept[..]
            && !turns(a, b, corner)
        {
            kept.pop();
        }
        if kept.last() != Some(&corner) {
            kept.push(corner);
        }
    }
    while let [a, .., b, c] = kept[..]
        && (c == a || !turns(b, c, a))
    {
        kept.pop();
    }
    kept
}

/// An outline cut along an upright or level line through the median of its corners, across its longer extent.
fn halves(outline: &[[i64; 2]]) -> Option<Vec<Vec<[i64; 2]>>> {
    let line = |axis: usize| {
        let mut values: Vec<i64> = outline.iter().map(|p| p[axis]).collect();
        values.sort_unstable();
        let (first, last) = (values[0], values[values.len() - 1]);
        // Between the ends, so that both sides have an area.
        let middle = values[values.len() / 2];
        let middle = if first < middle && middle < last {
            middle
        } else {
            first + (last - first) / 2
        };
        (middle > first).then_some((last - first, middle))
    };
    let lines = [line(0), line(1)];
    let axis = usize::from(lines[1].map(|l| l.0) > lines[0].map(|l| l.0));
    Some(cut_at(outline, axis, lines[axis]?.1))
}

/// Edge that crosses the line of a cut, from its corner below the line to the one on it or above.
struct Crossing {
    below: [i64; 2],
    above: [i64; 2],
    axis: usize,
    place: i64,
}

impl Crossing {
    /// Length along the axis, way across it, and place across it times the length.
    fn parts(&self) -> [i128; 3] {
        let (axis, across) = (self.axis, 1 - self.axis);
        let length = i128::from(self.above[axis] - self.below[axis]);
        let way = i128::from(self.above[across] - self.below[across]);
        let place = i128::from(self.below[across]) * length + i128::from(self.place - self.below[axis]) * way;
        [length, way, place]
    }

    fn point(&self) -> [i64; 2] {
        let [length, _, place] = self.parts();
        let across = (2 * place + length).div_euclid(2 * length) as i64;
        if self.axis == 0 {
            [self.place, across]
        } else {
            [across, self.place]
        }
    }

    /// Order just below the line, where no corner is.
    fn order(&self, other: &Self) -> Ordering {
        let ([la, wa, pa], [lb, wb, pb]) = (self.parts(), other.parts());
        (pa * lb).cmp(&(pb * la)).then((wb * la).cmp(&(wa * lb)))
    }
}

/// An outline cut where the coordinate along `axis` is `place`; corners on the line are above it. What is inside is what
/// is inside an odd number of times.
fn cut_at(outline: &[[i64; 2]], axis: usize, place: i64) -> Vec<Vec<[i64; 2]>> {
    let count = outline.len();
    let is_above = |p: [i64; 2]| p[axis] >= place;
    let Some(start) = (0..count).find(|&k| is_above(outline[k]) != is_above(outline[(k + 1) % count])) else {
        return vec![outline.to_vec()];
    };
    // From behind a crossing on, so that chains between crossings are whole.
    let corners: Vec<[i64; 2]> = (1..=count).map(|k| outline[(start + k) % count]).collect();
    let before = |k: usize| corners[(k + count - 1) % count];
    let starts: Vec<usize> = (0..count)
        .filter(|&k| is_above(corners[k]) != is_above(before(k)))
        .collect();
    let crossings: Vec<Crossing> = starts
        .iter()
        .map(|&k| {
            let (mut below, mut above) = (before(k), corners[k]);
            if is_above(below) {
                std::mem::swap(&mut below, &mut above);
            }
            Crossing {
                below,
                above,
                axis,
                place,
            }
        })
        .collect();
    let n = crossings.len();
    let chain = |k: usize| &corners[starts[k]..starts.get(k + 1).copied().unwrap_or(count)];
    // Along the line, the inside is between the first crossing and the second, the third and the fourth.
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| crossings[a].order(&crossings[b]));
    let mut partner = vec![0; n];
    for pair in order.chunks_exact(2) {
        (partner[pair[0]], partner[pair[1]]) = (pair[1], pair[0]);
    }
    let mut parts = Vec::new();
    for side in [false, true] {
        let mut used = vec![false; n];
        for first in 0..n {
            let (mut part, mut at) = (Vec::new(), first);
            while !used[at] {
                part.push(crossings[at].point());
                // The chain of this side begins at the crossing or ends there.
                let end = if is_above(chain(at)[0]) == side {
                    part.extend(chain(at));
                    (at + 1) % n
                } else {
                    let chain_before = (at + n - 1) % n;
                    part.extend(chain(chain_before).iter().rev());
                    chain_before
                };
                part.push(crossings[end].point());
                (used[at], used[end]) = (true, true);
                at = partner[end];
            }
            if !part.is_empty() {
                parts.push(part);
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twice_area(ring: &[[i64; 2]]) -> i64 {
        let next = |k: usize| ring[(k + 1) % ring.len()];
        let cross = |(k, p): (usize, &[i64; 2])| p[0] * next(k)[1] - p[1] * next(k)[0];
        ring.iter().enumerate().map(cross).sum::<i64>().abs()
    }

    /// A comb whose teeth the first cut crosses, and a staircase with corners on every line.
    #[test]
    fn parts_cover_the_outline() {
        let mut comb = vec![[0, -10], [0, 0]];
        for k in 0..500 {
            comb.extend([[20 * k, 0], [20 * k, 4000], [20 * k + 10, 4000], [20 * k + 10, 0]]);
        }
        comb.push([9990, -10]);
        let mut stairs = vec![[2000, 0], [0, 0]];
        for k in 0..1000 {
            stairs.extend([[2 * k, k + 1], [2 * k + 2, k + 1]]);
        }
        for outline in [comb, stairs] {
            for most in [1000, 100, 8] {
                let parts = cut(&outline, most).unwrap();
                assert!(parts.len() > 1 && parts.iter().all(|p| (3..=most).contains(&p.len())));
                assert_eq!(parts.iter().map(|p| twice_area(p)).sum::<i64>(), twice_area(&outline));
            }
        }
        assert!(cut(&vec![[0, 0]; 10_000], 100).unwrap().is_empty());
    }

    /// A circle of many corners: slanted edges are rounded where they are cut.
    #[test]
    fn rounding_stays_below_half_a_step() {
        let corner = |k: i32| {
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 9000.0).sin_cos();
            [(1e8 * cos).round() as i64, (1e8 * sin).round() as i64]
        };
        let circle: Vec<[i64; 2]> = (0..9000).map(corner).collect();
        let parts = cut(&circle, 8190).unwrap();
        assert_eq!(parts.len(), 2);
        let cut_area: i64 = parts.iter().map(|p| twice_area(p)).sum();
        assert!((cut_area - twice_area(&circle)).abs() <= 2 * 70_000);
    }
}
