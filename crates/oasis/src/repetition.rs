//! Copies of one element.

use crate::number::{put_step, put_unsigned};

/// Places of the copies of an element, from the first.
#[derive(Clone, Debug, PartialEq)]
pub enum Repetition {
    /// `count[0]` x `count[1]` copies, `step[0]` and `step[1]` apart (grid steps). The first count is at least 2.
    Grid { count: [u64; 2], step: [[i64; 2]; 2] },
    /// One more copy for each of `places`, which are multiples of `grid` from the first copy.
    List { grid: i64, places: Vec<[i32; 2]> },
}

impl Repetition {
    /// Number of copies, the first included; at most `u64::MAX`.
    pub fn copies(&self) -> u64 {
        match self {
            Self::Grid { count, .. } => count[0].saturating_mul(count[1]),
            Self::List { places, .. } => places.len() as u64 + 1,
        }
    }

    /// Call `with` with the place of each copy from the first.
    ///
    /// # Errors
    /// The first error of `with` ends it.
    #[inline]
    pub fn each<E>(&self, mut with: impl FnMut([i64; 2]) -> Result<(), E>) -> Result<(), E> {
        match self {
            Self::Grid { count, step } => {
                for row in 0..count[1] as i64 {
                    for column in 0..count[0] as i64 {
                        with(std::array::from_fn(|axis| column * step[0][axis] + row * step[1][axis]))?;
                    }
                }
            }
            Self::List { grid, places } => {
                with([0, 0])?;
                for place in places {
                    with(place.map(|v| grid * i64::from(v)))?;
                }
            }
        }
        Ok(())
    }

    /// Left, bottom, right, top of all places from the first; clamped far outside of any limit.
    pub fn bounds(&self) -> [i64; 4] {
        let mut bounds = [0i64; 4];
        let mut include = |place: [i64; 2]| {
            for axis in 0..2 {
                bounds[axis] = bounds[axis].min(place[axis]);
                bounds[axis + 2] = bounds[axis + 2].max(place[axis]);
            }
        };
        match self {
            Self::Grid { count, step } => {
                let reach = |k: usize, axis: usize| {
                    let last = i64::try_from(count[k].saturating_sub(1)).unwrap_or(i64::MAX);
                    last.saturating_mul(step[k][axis]).clamp(-FARTHEST, FARTHEST)
                };
                for (a, b) in [(1, 0), (0, 1), (1, 1)] {
                    include(std::array::from_fn(|axis| a * reach(0, axis) + b * reach(1, axis)));
                }
            }
            Self::List { grid, places } => {
                for place in places {
                    include(place.map(|v| grid.saturating_mul(i64::from(v)).clamp(-FARTHEST, FARTHEST)));
                }
            }
        }
        bounds
    }

    /// Append the repetition in the shortest of the types that fit it.
    pub(crate) fn put(&self, out: &mut Vec<u8>) {
        match self {
            Self::Grid { count, step } => put_grid(out, *count, *step),
            Self::List { grid, places } => put_list(out, *grid, places),
        }
    }
}

/// Sums of two clamped reaches are clamped to this; no limit of coordinates comes near.
const FARTHEST: i64 = 1 << 60;

fn put_grid(out: &mut Vec<u8>, count: [u64; 2], step: [[i64; 2]; 2]) {
    let along_x = |s: [i64; 2]| s[1] == 0 && s[0] >= 0;
    let along_y = |s: [i64; 2]| s[0] == 0 && s[1] >= 0;
    let unsigned = |out: &mut Vec<u8>, v: i64| put_unsigned(out, v.unsigned_abs());
    let dimension = |out: &mut Vec<u8>, k: usize| put_unsigned(out, count[k] - 2);
    if count[1] == 1 {
        if along_x(step[0]) {
            out.push(2);
            dimension(out, 0);
            unsigned(out, step[0][0]);
        } else if along_y(step[0]) {
            out.push(3);
            dimension(out, 0);
            unsigned(out, step[0][1]);
        } else {
            out.push(9);
            dimension(out, 0);
            put_step(out, step[0][0], step[0][1]);
        }
    } else if along_x(step[0]) && along_y(step[1]) {
        out.push(1);
        dimension(out, 0);
        dimension(out, 1);
        unsigned(out, step[0][0]);
        unsigned(out, step[1][1]);
    } else {
        out.push(8);
        dimension(out, 0);
        dimension(out, 1);
        put_step(out, step[0][0], step[0][1]);
        put_step(out, step[1][0], step[1][1]);
    }
}

fn put_list(out: &mut Vec<u8>, grid: i64, places: &[[i32; 2]]) {
    let mut before = [0; 2];
    let along = |axis: usize| {
        let mut last = 0;
        places.iter().all(|p| {
            let grows = p[1 - axis] == 0 && p[axis] >= last;
            last = p[axis];
            grows
        })
    };
    let with_grid = u8::from(grid != 1);
    let kind = if along(0) {
        4
    } else if along(1) {
        6
    } else {
        10
    };
    out.push(kind + with_grid);
    put_unsigned(out, places.len() as u64 - 1);
    if with_grid == 1 {
        put_unsigned(out, grid.unsigned_abs());
    }
    for place in places {
        let step: [i64; 2] = std::array::from_fn(|axis| i64::from(place[axis]) - i64::from(before[axis]));
        match kind {
            4 => put_unsigned(out, step[0].unsigned_abs()),
            6 => put_unsigned(out, step[1].unsigned_abs()),
            _ => put_step(out, step[0], step[1]),
        }
        before = *place;
    }
}
