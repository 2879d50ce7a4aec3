//! Filled areas: the outlines of a HATCH.

use super::Fault;
use super::curves::{Arc, bulged};
use super::pairs::Pair;

/// Outline of one loop as it is read.
#[derive(Default)]
struct Loop {
    /// True for corners with bulges, false for edges of any kind.
    polyline: bool,
    /// Corners and their bulges.
    corners: Vec<([f64; 2], f64)>,
    /// Numbers of each edge by code, behind the kind.
    edges: Vec<(u32, Vec<(i32, f64)>)>,
}

/// Outlines of a filled area in units of the drawing; none if it has lines for a filling, splines, or holes, which one outline
/// cannot have.
pub(super) fn outlines(pairs: &[Pair<'_>], unit: f64) -> Result<Option<Vec<Vec<[f64; 2]>>>, Fault> {
    /// Flag of a loop of corners.
    const POLYLINE: u32 = 2;
    let solid = pairs.iter().find(|p| p.code == 70).map_or(Ok(1.0), Pair::number)? == 1.0;
    let mut loops: Vec<Loop> = Vec::new();
    let begin = pairs.iter().position(|p| p.code == 91).unwrap_or(pairs.len());
    for pair in &pairs[begin..] {
        // Behind the loops.
        if pair.code == 75 {
            break;
        }
        if pair.code == 92 {
            loops.push(Loop {
                polyline: pair.number()? as u32 & POLYLINE != 0,
                ..Loop::default()
            });
            continue;
        }
        let Some(own) = loops.last_mut() else { continue };
        match (own.polyline, pair.code) {
            (true, 10) => own.corners.push(([pair.number()?, 0.0], 0.0)),
            (true, 20 | 42) => {
                if let Some((at, bulge)) = own.corners.last_mut() {
                    *(if pair.code == 20 { &mut at[1] } else { bulge }) = pair.number()?;
                }
            }
            (false, 72) => own.edges.push((pair.number()? as u32, Vec::new())),
            (false, 10 | 20 | 11 | 21 | 40 | 50 | 51 | 73) => {
                if let Some((_, numbers)) = own.edges.last_mut() {
                    numbers.push((pair.code, pair.number()?));
                }
            }
            _ => {}
        }
    }
    let outlines: Option<Vec<_>> = loops.iter().map(|own| own.outline(unit)).collect();
    Ok(outlines.filter(|all| solid && !all.is_empty() && !nested(all)))
}

impl Loop {
    fn outline(&self, unit: f64) -> Option<Vec<[f64; 2]>> {
        let mut out = Vec::new();
        for (k, (at, bulge)) in self.corners.iter().enumerate() {
            let next = self.corners[(k + 1) % self.corners.len()].0;
            out.extend(bulged(*at, next, *bulge, unit));
        }
        for (kind, numbers) in &self.edges {
            let number = |code: i32| numbers.iter().find(|(own, _)| *own == code).map(|(_, v)| *v);
            let place = |code: i32| Some([number(code)?, number(code + 10)?]);
            match kind {
                1 => out.extend([place(10)?, place(11)?]),
                2 => {
                    // Clockwise arcs have the angles of their mirror image.
                    let side = if number(73) == Some(0.0) { -1.0 } else { 1.0 };
                    let [from, to] = [side * number(50)?, side * number(51)?].map(f64::to_radians);
                    out.extend(Arc::of_circle(place(10)?, number(40)?, from, to).corners(unit));
                }
                _ => return None,
            }
        }
        Some(out).filter(|points| points.len() > 2)
    }
}

/// True if the first corner of an outline is inside another, or there are too many to tell.
fn nested(all: &[Vec<[f64; 2]>]) -> bool {
    const MOST: usize = 64;
    let inside = |[x, y]: [f64; 2], outline: &[[f64; 2]]| {
        let sides = outline.iter().zip(outline.iter().cycle().skip(1));
        sides
            .filter(|(a, b)| (a[1] > y) != (b[1] > y) && x < (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) + a[0])
            .count()
            % 2
            == 1
    };
    let others = |k: usize| all.iter().enumerate().filter(move |(other, _)| *other != k);
    all.len() > MOST || (0..all.len()).any(|k| others(k).any(|(_, outline)| inside(all[k][0], outline)))
}
