//! Tables of upright rectangles, which are of many sizes.
//!
//! A bias makes a pillar of 100 x 120 nm one that is drawn as 110 x 130 nm: pillars whose edges differ by the same are
//! on one line, on which they are identified by the shorter edge. Lines are solved every few nanometres, and between
//! two nodes where rational functions through more and through fewer nodes do not agree. A pillar that is exchanged
//! with its mirror image about the diagonal exchanges x and y: one of them is solved.

use std::collections::BTreeMap;

use num_complex::Complex64;
use rayon::prelude::*;

use super::widths::complex;
use crate::rational_interpolation::{around, rational};
use metalith_core::{Progress, Result};
use metalith_pillars::UprightRectangles;

/// Largest distance of the nodes that are solved at first (nm).
const STEP_NM: f64 = 5.0;

/// Rest of a line between sizes (nm) that is solved with them: nodes there tell the pillars on both sides more than nodes of either alone would.
const REST_NM: f64 = 2.0 * STEP_NM;

/// Difference of transmissions by one node more and one fewer above which the place between two nodes is solved too.
/// The residual is smaller by as much as the node shows: some thousandths beside a resonance, a millionth elsewhere.
const APART: f64 = 5e-3;

/// Nodes nearer than this are near enough for any resonance that an element of many sizes sees (nm).
const FINEST_NM: f64 = 0.25;

/// Transmissions of light along the longer edge and along the shorter one.
pub(super) type Along = [Complex64; 2];

/// A part of a line.
#[derive(Clone, Debug, PartialEq)]
struct Span {
    /// Length by which the longer edge is longer (nm).
    longer_nm: u16,
    /// Shorter edges as fabricated (nm), each from the least to the most, that are asked for: rising.
    wanted: Vec<[f64; 2]>,
    /// Shorter edges that are solved at first (nm), rising.
    nodes_nm: Vec<f64>,
}

impl Span {
    fn low(&self) -> f64 {
        self.wanted[0][0]
    }

    fn high(&self) -> f64 {
        self.wanted.iter().fold(self.low(), |high, w| high.max(w[1]))
    }
}

/// The pillars that tables are made for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sizes {
    pillars: UprightRectangles,
    /// Spans by the length by which the longer edge is longer, then by the shorter one.
    spans: Vec<Span>,
}

/// Shorter edge as drawn (nm), and what the longer one is longer by; whether it is along y.
fn told(edges_nm: [u16; 2]) -> (u16, u16, bool) {
    let [x, y] = edges_nm;
    (x.min(y), x.abs_diff(y), y > x)
}

impl Sizes {
    /// Pillars with these numbers, whose edges are off by the least to the most (nm).
    pub(crate) fn new(pillars: UprightRectangles, numbers: &[u16], [least, most]: [f64; 2]) -> Self {
        let mut lines: BTreeMap<u16, Vec<u16>> = BTreeMap::new();
        for number in numbers {
            let (short, longer, _) = told(pillars.edges_nm(*number));
            lines.entry(longer).or_default().push(short);
        }
        let mut spans: Vec<Span> = Vec::new();
        for (longer_nm, mut shorts) in lines {
            shorts.sort_unstable();
            shorts.dedup();
            for short in shorts.into_iter().map(f64::from) {
                let wanted = [short + least, short + most];
                match spans.last_mut() {
                    Some(s) if s.longer_nm == longer_nm && most > least && wanted[0] - s.high() <= REST_NM => {
                        s.wanted.push(wanted);
                    }
                    _ => spans.push(Span {
                        longer_nm,
                        wanted: vec![wanted],
                        nodes_nm: Vec::new(),
                    }),
                }
            }
        }
        // Pillars as drawn are nodes.
        let drawn = f64::from(pillars.step_nm.max(1));
        let step = drawn / (drawn / STEP_NM).ceil();
        for span in &mut spans {
            let (low, high) = (span.low(), span.high());
            let place = |edge: f64| (edge - f64::from(pillars.shortest_nm)) / step;
            let inside = (place(low).ceil() as i64..=place(high).floor() as i64)
                .map(|k| f64::from(pillars.shortest_nm) + k as f64 * step)
                .filter(|edge| *edge > low && *edge < high);
            span.nodes_nm = std::iter::once(low).chain(inside).collect();
            if high > low {
                span.nodes_nm.push(high);
            }
        }
        Self { pillars, spans }
    }

    /// Pillars of the table.
    pub(crate) fn pillars(&self) -> UprightRectangles {
        self.pillars
    }

    /// Number of pillars that are solved at first, in each stack.
    pub(crate) fn first(&self) -> usize {
        self.spans.iter().map(|span| span.nodes_nm.len()).sum()
    }

    /// Words for the pillar of a number whose edges are off by `bias_nm`.
    pub(crate) fn words(&self, number: u16, bias_nm: f64) -> String {
        let [x, y] = self.pillars.edges_nm(number);
        format!("pillar of {x} x {y} nm whose edges are off by {bias_nm} nm")
    }

    /// Tables of one wavelength of all stacks, whose pillars with these edges (nm) are solved by `solve`.
    ///
    /// # Errors
    /// Those of `solve`; also if the user stopped it.
    pub(crate) fn solve(
        &self,
        solve: &(dyn Fn([f64; 2]) -> Result<Vec<Along>> + Sync),
        progress: &dyn Progress,
    ) -> Result<SizeTables> {
        let mut curves = vec![Curve::default(); self.spans.len()];
        let mut places: Vec<(usize, f64)> = Vec::new();
        for (k, span) in self.spans.iter().enumerate() {
            places.extend(span.nodes_nm.iter().map(|short| (k, *short)));
        }
        while !places.is_empty() {
            let solved = places.par_iter().map(|(k, short)| {
                progress.check_stopped()?;
                let t = solve([short + f64::from(self.spans[*k].longer_nm), *short])?;
                progress.advance(1);
                Ok(t)
            });
            let solved: Vec<Vec<Along>> = solved.collect::<Result<_>>()?;
            for ((k, short), t) in places.iter().zip(solved) {
                curves[*k].insert(*short, t);
            }
            let pairs = self.spans.par_iter().zip(&curves).enumerate();
            let doubtful = pairs.flat_map_iter(|(k, (span, curve))| {
                let between = curve.doubtful(&span.wanted);
                between.into_iter().map(move |short| (k, short))
            });
            places = doubtful.collect();
            if !places.is_empty() {
                progress.begin("solving upright rectangles beside resonances", places.len() as u64);
            }
        }
        Ok(SizeTables { curves })
    }

    /// Transmissions along x and along y, in all stacks, of the pillar of a number whose edges are off by `bias_nm`; none if it is on no line that
    /// was solved.
    pub(crate) fn of_stacks<'a>(
        &self,
        tables: &'a SizeTables,
        number: u16,
        bias_nm: f64,
    ) -> Option<[impl Iterator<Item = Complex64> + 'a; 2]> {
        // Rounding of sums at the ends.
        const SLACK: f64 = 1e-6;
        let (short, longer, is_turned) = told(self.pillars.edges_nm(number));
        let short = f64::from(short) + bias_nm;
        let is_there = |span: &Span| {
            let [low, high] = [span.low() - SLACK, span.high() + SLACK];
            span.longer_nm == longer && (low..=high).contains(&short)
        };
        let curve = &tables.curves[self.spans.iter().position(is_there)?];
        let (x, y) = if is_turned { (1, 0) } else { (0, 1) };
        Some([x, y].map(|axis| curve.of_stacks(axis, short)))
    }
}

/// Transmission of one part of a line.
#[derive(Clone, Debug, Default, PartialEq)]
struct Curve {
    /// Shorter edges (nm), rising.
    nodes_nm: Vec<f64>,
    /// Transmissions by node and stack.
    t: Vec<Vec<Along>>,
}

impl Curve {
    fn insert(&mut self, short_nm: f64, t: Vec<Along>) {
        let place = self.nodes_nm.partition_point(|node| *node < short_nm);
        self.nodes_nm.insert(place, short_nm);
        self.t.insert(place, t);
    }

    fn of_stacks(&self, axis: usize, short_nm: f64) -> impl Iterator<Item = Complex64> + '_ {
        let near = around(&self.nodes_nm, short_nm);
        let stacks = self.t[0].len();
        (0..stacks).map(move |stack| {
            let values: Vec<Complex64> = self.t[near.clone()].iter().map(|t| t[stack][axis]).collect();
            rational(&self.nodes_nm[near.clone()], &values, short_nm)
        })
    }

    /// Middles between nodes, of places that are asked for, where what is there is not known.
    fn doubtful(&self, wanted: &[[f64; 2]]) -> Vec<f64> {
        let pairs = self.nodes_nm.windows(2).filter(|pair| {
            let is_wanted = wanted.iter().any(|[low, high]| *low < pair[1] && *high > pair[0]);
            is_wanted && pair[1] - pair[0] > FINEST_NM
        });
        let doubtful = pairs.filter(|pair| {
            let quarters = [0.25, 0.5, 0.75].map(|share| pair[0] + share * (pair[1] - pair[0]));
            quarters.iter().any(|short| self.is_doubtful(*short))
        });
        doubtful.map(|pair| 0.5 * (pair[0] + pair[1])).collect()
    }

    /// True if leaving out the farthest node makes a difference that counts.
    fn is_doubtful(&self, short_nm: f64) -> bool {
        let all = around(&self.nodes_nm, short_nm);
        let [first, last] = [all.start, all.end - 1].map(|k| (self.nodes_nm[k] - short_nm).abs());
        let fewer = if first > last {
            all.start + 1..all.end
        } else {
            all.start..all.end - 1
        };
        (0..self.t[0].len()).any(|stack| {
            (0..2).any(|axis| {
                let [more, fewer] = [&all, &fewer].map(|nodes| {
                    let values: Vec<Complex64> = self.t[nodes.clone()].iter().map(|t| t[stack][axis]).collect();
                    rational(&self.nodes_nm[nodes.clone()], &values, short_nm)
                });
                let apart = (more - fewer).norm();
                apart > APART || apart.is_nan()
            })
        })
    }
}

/// Transmissions of all sizes at one wavelength.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SizeTables {
    /// Curves in the order of the spans.
    curves: Vec<Curve>,
}

impl SizeTables {
    /// Numbers that a file stores.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        self.curves.iter().flat_map(|curve| {
            let count = std::iter::once(curve.nodes_nm.len() as f64);
            let t = curve.t.iter().flatten().flatten().flat_map(|z| [z.re, z.im]);
            count.chain(curve.nodes_nm.iter().copied()).chain(t)
        })
    }

    /// One wavelength from the front of the numbers of a file.
    pub(crate) fn take(rest: &mut &[f64], sizes: &Sizes, stacks: usize) -> Option<Self> {
        let mut curve = || {
            let (count, after) = rest.split_first()?;
            let (nodes, after) = after.split_at_checked(*count as usize)?;
            let (t, after) = after.split_at_checked(nodes.len().checked_mul(4 * stacks)?)?;
            *rest = after;
            let of_stack: Vec<Along> = complex(t).collect::<Vec<_>>().as_chunks().0.to_vec();
            (!nodes.is_empty()).then(|| Curve {
                nodes_nm: nodes.to_vec(),
                t: of_stack.chunks_exact(stacks).map(<[Along]>::to_vec).collect(),
            })
        };
        let curves = sizes.spans.iter().map(|_| curve()).collect::<Option<_>>()?;
        Some(Self { curves })
    }
}
