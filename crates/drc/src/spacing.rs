//! Distances between shapes: gaps, overlaps, and the same shape twice.

use super::body::Body;
use super::context::Context;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::pairs::{near, place};
use super::rule::{NO_DESIGN, NotRun, Rule, RuleOutcome, from_design};
use super::tolerance::ROUNDING_NM;
use metalith_core::document::{Limits, Section};
use metalith_design::Design;
use metalith_gds::LayerNumber;
use metalith_pillars::{Lattice, LatticeKind, PillarId, PillarRows};
use metalith_rcwa::CellLattice;

#[derive(Clone, Copy, PartialEq)]
enum Distance {
    Gap {
        /// Least distance (nm); none for that of pillars of the design where they are widest.
        nm: Option<f64>,
        /// Height of the pillars (nm), where the least distance is a part of it.
        height_nm: Option<f64>,
    },
    NoOverlap,
    NoDuplicate,
}

struct SpacingRule {
    layer: LayerNumber,
    want: Distance,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    let want = match check {
        "gap_min" => Distance::Gap {
            nm: (!from_design(s)).then(|| s.float("nm", Limits::new(0.0..=1e6, "nm"))),
            height_nm: None,
        },
        "gap_aspect_max" => Distance::Gap {
            nm: Some(context.height_nm / s.float("ratio", Limits::new(0.01..=1000.0, ""))),
            height_nm: Some(context.height_nm),
        },
        "overlap" => Distance::NoOverlap,
        "duplicate" => Distance::NoDuplicate,
        _ => return None,
    };
    Some(Box::new(SpacingRule {
        layer: context.layer(s, "layer"),
        want,
    }))
}

impl Rule for SpacingRule {
    fn words(&self) -> String {
        match self.want {
            Distance::Gap { nm: None, .. } => "gaps as wide as the design has at least, in any direction".into(),
            Distance::Gap {
                nm: Some(nm),
                height_nm,
            } => match height_nm {
                None => format!("gaps of at least {nm} nm, in any direction"),
                Some(h) => format!("gaps at most {:.4} times as deep as wide", h / nm),
            },
            Distance::NoOverlap => "no two shapes share area".into(),
            Distance::NoDuplicate => "no shape is there twice".into(),
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        let least_nm = match self.want {
            Distance::Gap { nm, .. } => {
                let least_nm = nm.or_else(|| flat.design.map(least_gap_nm));
                least_nm.ok_or_else(|| NotRun::Skipped(NO_DESIGN.into()))?
            }
            Distance::NoOverlap | Distance::NoDuplicate => 0.0,
        };
        let limit = flat.units(least_nm) - ROUNDING_NM;
        if self.layer == flat.pillars {
            let judged = match self.want {
                Distance::Gap { height_nm, .. } => on_lattices(flat, least_nm, |a, b, gap| {
                    report_gap(flat, a, b, gap, height_nm, found);
                }),
                Distance::NoOverlap => on_lattices(flat, least_nm, |a, b, _| report_overlap(a, b, found)),
                // No site holds two pillars.
                Distance::NoDuplicate => Ok(()),
            };
            judged.map_err(NotRun::Failed)?;
        }
        let judged = near(flat, self.layer, limit.ceil() as i64, |a, b| match self.want {
            Distance::Gap { height_nm, .. } => {
                let gap = a.gap(&b);
                if gap < limit && !a.overlaps(&b) {
                    report_gap(flat, &a, &b, gap, height_nm, found);
                }
            }
            Distance::NoOverlap => {
                if !a.equals(&b) && a.overlaps(&b) {
                    report_overlap(&a, &b, found);
                }
            }
            Distance::NoDuplicate => {
                if a.equals(&b) {
                    found.at(&a.ring(), || "the same shape twice".into());
                }
            }
        });
        Ok(judged?)
    }
}

/// Distance of the nearest two pillars of a design if both are as wide as they may be (nm).
fn least_gap_nm(design: &Design) -> f64 {
    let cell = &design.cell;
    let nearest_nm =
        CellLattice::drawn(cell.lattice, cell.pitch_nm, cell.database_unit).nearest_nm(f64::from(cell.pitch_nm));
    let (_, widest) = cell.width_range_nm;
    cell.shape.least_gap(PillarId(widest), [nearest_nm, 0.0]).max(0.0)
}

fn report_overlap(a: &Body<'_>, b: &Body<'_>, found: &mut Findings) {
    found.rect(&place(&a.bounds(), &b.bounds()), || "two shapes share area".into());
}

fn report_gap(
    flat: &FlatLayout<'_>,
    a: &Body<'_>,
    b: &Body<'_>,
    gap: f64,
    height_nm: Option<f64>,
    found: &mut Findings,
) {
    let nm = gap * flat.unit_nm;
    found.rect(&place(&a.bounds(), &b.bounds()), || match height_nm {
        None => format!("a gap of {nm:.2} nm"),
        Some(h) => format!("a gap of {nm:.2} nm and {h} nm deep, 1 : {:.2}", h / nm),
    });
}

/// Steps up and right to the neighbours on a square lattice, along the axes and diagonals: of pillars that are at most a pitch
/// wide, farther ones are at least a pitch apart.
const SQUARE: &[(usize, isize)] = &[(0, 1), (1, 0), (1, 1), (1, -1)];

/// Steps to half of the six neighbours on a hexagonal lattice, in its grid. Farther ones are the root of three of a
/// pitch away.
const HEXAGONAL: &[(usize, isize)] = &[(0, 2), (1, 1), (1, -1)];

/// Steps up and right to half of the nearest neighbours on a lattice: of two neighbours each pair is met once.
pub(super) fn neighbours(lattice: &Lattice) -> &'static [(usize, isize)] {
    match lattice.kind() {
        LatticeKind::Square => SQUARE,
        LatticeKind::Hexagonal => HEXAGONAL,
    }
}

/// Share of the pitch below which gaps to farther ones than these are not.
const HEXAGONAL_REACH: f64 = 0.73;

/// Pairs of widths or numbers that are remembered for each step to a neighbour: of 1024 that there are, which rectangles of 32 lengths
/// have.
const MOST_PAIRS: usize = 1 << 20;

/// Pairs of widths or numbers whose verdict is known: whether they are too near one another, a step apart. A lens has
/// millions of pairs of some hundred widths.
struct KnownPairs {
    /// Number of entries of one first width or number; zero, and nothing remembered, if they are too many.
    row: usize,
    near: Vec<Option<bool>>,
}

impl KnownPairs {
    /// Pairs of widths or numbers below this one.
    fn below(row: usize) -> Self {
        let pairs = if row <= MOST_PAIRS / row.max(1) { row * row } else { 0 };
        Self {
            row,
            near: vec![None; pairs],
        }
    }

    /// The answer about a pair, by `ask` if it is not remembered.
    #[inline]
    fn are_near(&mut self, [own, other]: [u16; 2], ask: impl FnOnce() -> bool) -> bool {
        match self.near.get_mut(usize::from(own) * self.row + usize::from(other)) {
            Some(known) => *known.get_or_insert_with(ask),
            None => ask(),
        }
    }
}

/// Hand pairs of pillars on one lattice that are less than this apart (nm) to `report`, with their gap in database units; below
/// zero where they overlap.
fn on_lattices(
    flat: &FlatLayout<'_>,
    nm: f64,
    mut report: impl FnMut(&Body<'_>, &Body<'_>, f64),
) -> Result<(), String> {
    for (k, e) in flat.elements.iter().enumerate() {
        let pitch = f64::from(e.site.lattice.pitch_nm());
        let lattice = e.site.lattice;
        let neighbours = neighbours(&lattice);
        let reach = match lattice.kind() {
            LatticeKind::Square => pitch,
            LatticeKind::Hexagonal => HEXAGONAL_REACH * pitch,
        };
        if nm > reach {
            return Err(format!(
                "a gap of {nm} nm is beyond {} of {reach} nm of {}",
                if lattice.is_square() {
                    "the pitch"
                } else {
                    "0.73 pitches"
                },
                e.site.name
            ));
        }
        let steps = lattice.steps_nm();
        let apart = |up: usize, right: isize| [steps[0] * right as f64, steps[1] * up as f64];
        let widths = e.widths.histogram().len();
        let widest = widths.saturating_sub(1) as u16;
        let least = neighbours
            .iter()
            .map(|&(up, right)| flat.shape.least_gap(PillarId(widest), apart(up, right)));
        if least.fold(f64::INFINITY, f64::min) >= nm {
            continue;
        }
        let n = e.site.lattice.sites();
        let mut known: Vec<KnownPairs> = neighbours.iter().map(|_| KnownPairs::below(widths)).collect();
        // This row and the one above it.
        let mut room = Vec::new();
        let mut lines = [Vec::new(), e.widths.row(0, 0..n, &mut room).to_vec()];
        for row in 0..n {
            lines.swap(0, 1);
            lines[1].clear();
            if row + 1 < n {
                lines[1].extend_from_slice(e.widths.row(row + 1, 0..n, &mut room));
            }
            for (column, &own) in lines[0].iter().enumerate().filter(|(_, w)| **w != 0) {
                for (&(up, right), known) in neighbours.iter().zip(&mut known) {
                    let Some(c) = column.checked_add_signed(right) else {
                        continue;
                    };
                    let Some(&other) = lines[up].get(c) else { continue };
                    let gap = || flat.shape.gap([own, other].map(PillarId), apart(up, right));
                    if other != 0 && known.are_near([own, other], || gap() < nm - ROUNDING_NM) {
                        let gap = gap();
                        let (a, b) = (flat.body(k, row, column), flat.body(k, row + up, c));
                        report(&a, &b, gap / flat.unit_nm);
                    }
                }
            }
        }
    }
    Ok(())
}
