//! Two layouts -> their differences, independent of cell names and hierarchy.
//!
//! Pillars on the lattice of an element are compared site by site as width maps; everything else, on every
//! layer, as sorted lists of outlines, and where those differ in how they are cut up, by the area they
//! cover. Nothing is sampled: the answer is exact to the database unit.

mod area;
mod compare;
mod content;
mod missing;
mod pairs;
mod picture;
mod report;
mod sites;
mod tree;

pub use picture::page;
pub use report::{Change, ElementDiff, LayerDiff, LayoutDiff, MissingAt, MissingDiff, TextAt, TreeDiff, text};

use std::io::Read;

use super::work::Allowance;
use content::{Content, Strings, WantedPillars};
use metalith_core::{Error, Named, Progress, Result};
use metalith_gds::extract::{PlaceFit, Scale, discover};
use metalith_gds::{LayerNumber, Layout, Selection};
use metalith_pillars::{ElementSite, PillarShape, UprightRectangles};

/// Options of a comparison.
#[derive(Clone, Copy, Debug)]
pub struct DiffPlan {
    /// Layer that the pillars are on.
    pub pillar_layer: LayerNumber,
    /// Most changes that are listed; all are counted.
    pub listed: usize,
}

impl Default for DiffPlan {
    fn default() -> Self {
        Self {
            pillar_layer: LayerNumber::new(1, 0),
            listed: 1000,
        }
    }
}

/// Compare two layouts.
///
/// # Errors
/// If a layout has no single top cell or references that lead round in a circle, or cannot be read again.
pub fn diff(a: &Layout, b: &Layout, plan: &DiffPlan, progress: &dyn Progress) -> Result<LayoutDiff> {
    let identical = same_bytes(a, b)?;
    let everything = everything();
    // One unit for both: a whole fraction of a nanometre, and whole factors to it.
    let ((num_a, den_a), (num_b, den_b)) = (a.unit_ratio_nm()?, b.unit_ratio_nm()?);
    let den = den_a / gcd(den_a, den_b) * den_b;
    let factors = [num_a * (den / den_a), num_b * (den / den_b)];
    let (mut sites, mut shape) = (Vec::new(), None);
    // The same cells of the same bytes are read once.
    let is_once = identical && a.tops() == b.tops();
    let distinct = if is_once { &[a][..] } else { &[a, b] };
    for layout in distinct {
        match discover(layout, &everything, &[plan.pillar_layer], Scale::of(layout)?, progress).map_err(Error::from) {
            // What stands at an angle is compared as outlines: nothing is turned and rounded for that.
            Ok(found) if found.turn.is_some() => {}
            Ok(found) => {
                shape = Some(match shape {
                    None => found.majority,
                    Some(first) => both(first, found.majority)?,
                });
                // What is not exactly on its site is compared as an outline: half a step of the grid counts here.
                let exact = found.sites.into_iter().zip(&found.fits);
                let exact = exact.filter(|(_, fit)| **fit == PlaceFit::default());
                sites::unite(&mut sites, exact.map(|(site, _)| site).collect());
            }
            // Without elements, all shapes are compared as outlines.
            Err(Error::Invalid { .. }) => {}
            Err(other) => return Err(other),
        }
    }
    ElementSite::widen(&mut sites);
    let total: u64 = sites.iter().map(|s| (s.lattice.sites() as u64).pow(2)).sum();
    let most = Allowance::of([a, b]).sites;
    if total > most {
        return Err(Error::refused(
            "diff/too-many-sites",
            format!("{} elements with {total} lattice sites together", sites.len()),
            format!("up to {most} sites are compared; compare the cells of the elements one by one"),
        ));
    }
    for (k, site) in sites.iter_mut().enumerate() {
        site.name = format!("element {}", k + 1);
    }
    let mut strings = Strings::default();
    let wanted = WantedPillars {
        layer: plan.pillar_layer,
        shape: shape.unwrap_or_default(),
        sites: &sites,
    };
    let reading = ["the first", "the second"].map(|which| format!("reading {which} layout"));
    let [first_read, second_read] = [0, 1].map(|k| Named(progress, &reading[k]));
    let mut first = Content::read(a, factors[0], wanted, &mut strings, &mut [], &first_read)?;
    let mut second = if is_once {
        None
    } else {
        let like = &mut first.elements;
        Some(Content::read(b, factors[1], wanted, &mut strings, like, &second_read)?)
    };
    let strings = strings.sorted(std::iter::once(&mut first).chain(&mut second));
    let second = second.as_ref().unwrap_or(&first);
    let mut report = compare::compare(&first, second, &strings, 1.0 / den as f64, plan, progress)?;
    report.missing = missing::compare([a, b], factors, 1.0 / den as f64, plan.listed)?;
    report.same_geometry &= report.missing.apart == [0, 0];
    report.a = a.path().display().to_string();
    report.b = b.path().display().to_string();
    report.same_bytes = identical;
    report.tree = tree::compare(a, b, plan.listed);
    Ok(report)
}

/// Everything that a layout has. References to cells that it does not have are compared by their names and places.
fn everything() -> Selection {
    Selection {
        without_missing: true,
        ..Selection::default()
    }
}

/// Shape of the pillars of two layouts: the shape of the first, for upright rectangles with the lengths of both.
fn both(first: PillarShape, second: PillarShape) -> Result<PillarShape> {
    let (Some(a), Some(b)) = (first.upright(), second.upright()) else {
        return Ok(first);
    };
    let united = UprightRectangles::of_lengths(a.lengths_nm().chain(b.lengths_nm()));
    let united = united.ok_or_else(|| {
        Error::refused(
            "diff/too-many-edge-lengths",
            format!(
                "upright rectangles with edges of {} to {} nm in steps of {} nm, and of {} to {} nm in steps of {} nm",
                a.shortest_nm,
                a.longest_nm(),
                a.step_nm,
                b.shortest_nm,
                b.longest_nm(),
                b.step_nm
            ),
            format!(
                "compare layouts whose edges have at most {} lengths together, in equal steps",
                UprightRectangles::MOST_LENGTHS
            ),
        )
    })?;
    Ok(united.into())
}

fn gcd(a: i64, b: i64) -> i64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// True if two files are equal, byte by byte.
fn same_bytes(a: &Layout, b: &Layout) -> Result<bool> {
    if a.bytes() != b.bytes() {
        return Ok(false);
    }
    let open = |layout: &Layout| std::fs::File::open(layout.path()).map_err(Error::io("open", layout.path()));
    let (mut one, mut other) = (open(a)?, open(b)?);
    let (mut x, mut y) = (vec![0; 1 << 18], vec![0; 1 << 18]);
    loop {
        let n = fill(&mut one, &mut x).map_err(Error::io("read", a.path()))?;
        let m = fill(&mut other, &mut y).map_err(Error::io("read", b.path()))?;
        if x[..n] != y[..m] {
            return Ok(false);
        }
        if n == 0 {
            return Ok(true);
        }
    }
}

fn fill(file: &mut std::fs::File, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut held = 0;
    while held < buffer.len() {
        match file.read(&mut buffer[held..])? {
            0 => break,
            n => held += n,
        }
    }
    Ok(held)
}
