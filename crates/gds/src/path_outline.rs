//! The area that a PATH leaves: a pen of some width drawn along a line.

use super::shape::Point;

/// Straight pieces of each half circle of a round end.
const ROUND: usize = 16;

/// Longest corner of a bend, in half widths: a sharper one is cut off.
const MITRE: f64 = 4.0;

/// Closed outline of a pen `width` wide along `line`, corners rounded to database units. `path_type` is
/// that of the format: 0 flush ends, 1 round, 2 half a width longer, 4 longer by `extensions`.
///
/// The outline of a line that crosses itself crosses itself too.
pub(super) fn outline(line: &[Point], width: i64, path_type: i16, extensions: [i32; 2], out: &mut Vec<Point>) {
    out.clear();
    let mut centre: Vec<[f64; 2]> = Vec::with_capacity(line.len());
    for p in line {
        let next = [p.x as f64, p.y as f64];
        if centre.last() != Some(&next) {
            centre.push(next);
        }
    }
    let half = width.unsigned_abs() as f64 / 2.0;
    // Nothing, or the pen's own shape where its ends reach out.
    let dot = |at: [f64; 2], out: &mut Vec<Point>| {
        // Without a direction ends reach out along x; an end that took all away reaches nowhere.
        let [left, right] = match path_type {
            0 => [0.0; 2],
            4 => extensions.map(|reach| f64::from(reach).max(0.0)),
            _ => [half; 2],
        };
        let corners = [
            [-left, -half],
            [right, -half],
            [right, half],
            [-left, half],
            [-left, -half],
        ];
        out.extend(corners.map(|c| rounded([at[0] + c[0], at[1] + c[1]])));
    };
    if centre.len() < 2 || half == 0.0 {
        return dot(centre[0], out);
    }
    let direction = |a: [f64; 2], b: [f64; 2]| {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy);
        [dx / length, dy / length]
    };
    let last = centre.len() - 1;
    let (start, end) = (
        direction(centre[0], centre[1]),
        direction(centre[last - 1], centre[last]),
    );
    let reach = match path_type {
        2 => [half; 2],
        4 => extensions.map(f64::from),
        _ => [0.0; 2],
    };
    for axis in 0..2 {
        centre[0][axis] -= reach[0] * start[axis];
        centre[last][axis] += reach[1] * end[axis];
    }
    // An extension below zero may take a whole piece of the line away.
    centre.dedup();
    if centre.len() < 2 {
        return dot(centre[0], out);
    }
    let last = centre.len() - 1;
    // One side from start to end, a cap, the other side back, a cap.
    for side in [1.0, -1.0] {
        let along: Vec<[f64; 2]> = if side > 0.0 {
            centre.clone()
        } else {
            centre.iter().rev().copied().collect()
        };
        for k in 0..along.len() {
            let before = (k > 0).then(|| direction(along[k - 1], along[k]));
            let after = (k < last).then(|| direction(along[k], along[k + 1]));
            bend(along[k], before, after, half, out);
        }
        if path_type == 1 {
            let forward = direction(along[last - 1], along[last]);
            let start = forward[0].atan2(-forward[1]);
            for k in 1..ROUND {
                let (sin, cos) = (start - std::f64::consts::PI * k as f64 / ROUND as f64).sin_cos();
                out.push(rounded([along[last][0] + half * cos, along[last][1] + half * sin]));
            }
        }
    }
    let first = out[0];
    out.push(first);
    out.dedup();
}

/// The outline on the left of one vertex of the line.
fn bend(at: [f64; 2], before: Option<[f64; 2]>, after: Option<[f64; 2]>, half: f64, out: &mut Vec<Point>) {
    let left = |d: [f64; 2]| [-d[1] * half, d[0] * half];
    let plus = |o: [f64; 2]| rounded([at[0] + o[0], at[1] + o[1]]);
    match (before.map(left), after.map(left)) {
        (Some(a), Some(b)) => {
            let sum = [a[0] + b[0], a[1] + b[1]];
            let norm = sum[0] * sum[0] + sum[1] * sum[1];
            // The corner is along the sum, at 2 half^2 / |sum|.
            let stretch = 2.0 * half * half / norm.max(f64::MIN_POSITIVE);
            if norm.sqrt() * stretch <= MITRE * half {
                out.push(plus([sum[0] * stretch, sum[1] * stretch]));
            } else {
                out.extend([plus(a), plus(b)]);
            }
        }
        (Some(o), None) | (None, Some(o)) => out.push(plus(o)),
        (None, None) => {}
    }
}

fn rounded(p: [f64; 2]) -> Point {
    Point::new(p[0].round() as i64, p[1].round() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(line: &[(i64, i64)], width: i64, path_type: i16, extensions: [i32; 2]) -> Vec<Point> {
        let line: Vec<Point> = line.iter().map(|&(x, y)| Point::new(x, y)).collect();
        let mut out = Vec::new();
        outline(&line, width, path_type, extensions, &mut out);
        out
    }

    #[test]
    fn straight_lines_are_rectangles() {
        let rect = |points: &[Point]| super::super::shape::rectangle_of(points).unwrap();
        let flush = rect(&drawn(&[(0, 0), (100, 0)], 20, 0, [0; 2]));
        assert_eq!((flush.x0, flush.y0, flush.x1, flush.y1), (0, -10, 100, 10));
        let longer = rect(&drawn(&[(0, 0), (100, 0)], 20, 2, [0; 2]));
        assert_eq!((longer.x0, longer.y0, longer.x1, longer.y1), (-10, -10, 110, 10));
        let uneven = rect(&drawn(&[(0, 100), (0, 0)], 20, 4, [5, 7]));
        assert_eq!((uneven.x0, uneven.y0, uneven.x1, uneven.y1), (-10, -7, 10, 105));
    }

    #[test]
    fn bends_are_mitred() {
        let corner = drawn(&[(0, 0), (100, 0), (100, 100)], 20, 0, [0; 2]);
        assert!(corner.contains(&Point::new(110, -10)) && corner.contains(&Point::new(90, 10)));
        assert_eq!(corner.len(), 7);
    }

    /// Share of a disc that 16 chords a half circle cut off (0.64 %), and the rounding of corners to whole units.
    const CHORDS: f64 = 0.0065;

    /// Area of a round-ended line against the circle's.
    #[test]
    fn round_ends_have_the_area_of_a_disc() {
        let p = drawn(&[(0, 0), (100_000, 0)], 20_000, 1, [0; 2]);
        let twice: i128 = p
            .windows(2)
            .map(|w| i128::from(w[0].x * w[1].y - w[1].x * w[0].y))
            .sum();
        let area = twice.unsigned_abs() as f64 / 2.0;
        let discs = std::f64::consts::PI * 1e8;
        assert!((area - 2e9 - discs).abs() < CHORDS * discs, "{area}");
    }

    #[test]
    fn an_end_that_is_taken_away_leaves_the_rest() {
        let rect = |points: &[Point]| super::super::shape::rectangle_of(points).unwrap();
        let rest = drawn(&[(1000, 1000), (1100, 1000), (1100, 1100)], 20, 4, [-100, 0]);
        let r = rect(&rest);
        assert_eq!((r.x0, r.y0, r.x1, r.y1), (1090, 1000, 1110, 1100));
        let none = drawn(&[(1000, 1000), (1100, 1000)], 20, 4, [-100, 0]);
        assert!(none.iter().all(|p| p.x == 1100), "{none:?}");
    }

    #[test]
    fn a_dot_with_square_ends_is_a_square() {
        let dot = drawn(&[(5, 5)], 10, 2, [0; 2]);
        assert_eq!(super::super::shape::Rect::around(&dot).width(), 10);
        assert_eq!(drawn(&[(5, 5)], 10, 0, [0; 2]).len(), 5);
    }
}
