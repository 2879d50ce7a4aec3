//! What is made of the pillars that were found: pads, places to measure, and what the shots of the writer change.

use super::read::Pattern;
use crate::dose::Beam;
use crate::exposure::snapping_of;
use crate::metrology_sites::{MeasuredLens, MetrologySite};
use crate::pad::PadPillar;
use crate::process::Process;
use metalith_core::Result;
use metalith_gds::extract::{ExtractedElement, Extraction};
use metalith_layout::PillarForm;

/// Shares of the pillars below the widths that are measured on lenses, and of the pads of the dose matrix.
const MEASURED: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
const PADS: [f64; 3] = [0.1, 0.5, 0.9];

/// Pads of some of the pillars that were found.
pub(super) fn pads(pattern: &Pattern) -> Vec<PadPillar> {
    let Pattern::Pillars(found) = pattern else {
        return Vec::new();
    };
    let unit = central(found).site.lattice.unit();
    let form = PillarForm::plain(found.shape).on_grid(unit);
    let mut pads: Vec<PadPillar> = some_of(found, &PADS)
        .into_iter()
        .map(|number| PadPillar::found(form, number))
        .collect();
    pads.dedup_by_key(|pad| pad.cell_name());
    pads
}

/// Numbers of pillars over all elements, counted.
fn histogram(found: &Extraction) -> Vec<u64> {
    let mut counts: Vec<u64> = Vec::new();
    for element in &found.elements {
        let own = element.widths.histogram();
        counts.resize(counts.len().max(own.len()), 0);
        counts.iter_mut().zip(own).for_each(|(all, n)| *all += n);
    }
    counts
}

/// Widths below which these shares of the pillars are, or the most frequent rectangles, each once and in order.
fn some_of(found: &Extraction, shares: &[f64]) -> Vec<u16> {
    let counts = histogram(found);
    let pillars: u64 = counts.iter().skip(1).sum();
    let mut numbers: Vec<u16> = if found.shape.has_width() {
        let below = |share: &f64| {
            let wanted = (share * pillars as f64) as u64;
            let mut sum = 0;
            let is_reached = |n: &u64| {
                sum += n;
                sum > wanted
            };
            counts.iter().skip(1).position(is_reached).map(|k| k as u16 + 1)
        };
        shares.iter().filter_map(below).collect()
    } else {
        let mut frequent: Vec<usize> = (1..counts.len()).filter(|&k| counts[k] > 0).collect();
        frequent.sort_by_key(|&k| std::cmp::Reverse(counts[k]));
        frequent.into_iter().take(shares.len()).map(|k| k as u16).collect()
    };
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

/// The element nearest to the middle of all.
pub(super) fn central(found: &Extraction) -> &ExtractedElement {
    let count = found.elements.len() as f64;
    let middle = [0, 1].map(|axis| {
        let places = found.elements.iter().map(|e| e.site.centre_nm[axis] as f64);
        places.sum::<f64>() / count
    });
    let far = |e: &ExtractedElement| {
        let [x, y] = [0, 1].map(|axis| e.site.centre_nm[axis] as f64 - middle[axis]);
        x.hypot(y)
    };
    let nearest = found.elements.iter().min_by(|a, b| far(a).total_cmp(&far(b)));
    nearest.expect("pillars are in elements")
}

/// What the shots of each beam change of the pillars; nothing where there are none.
pub(super) fn snapping(pattern: &Pattern, process: &Process) -> Result<Vec<(Beam, f64)>> {
    match pattern {
        Pattern::Pillars(found) => snapping_of(found.shape, &histogram(found), process),
        Pattern::Shapes { .. } => snapping_of(process.checks.some_shape(), &[], process),
    }
}

/// Places to measure at, on the element in the middle and the one furthest from it.
pub(super) fn sites(pattern: &Pattern, process: &Process) -> Vec<MetrologySite> {
    let Pattern::Pillars(found) = pattern else {
        return Vec::new();
    };
    let middle = central(found);
    let far = |e: &&ExtractedElement| {
        let [x, y] = [0, 1].map(|axis| e.site.centre_nm[axis] - middle.site.centre_nm[axis]);
        (x as f64).hypot(y as f64) as i64
    };
    let furthest = found.elements.iter().max_by_key(far).filter(|e| far(e) > 0);
    let zones = process.metrology.sites_per_width as usize;
    let mut sites = Vec::new();
    for element in std::iter::once(middle).chain(furthest) {
        let [x, y] = element.site.centre_nm;
        let lens = MeasuredLens {
            file: "layout",
            place: element.site.name.clone(),
            centre_nm: (x, y),
            radius_um: element.widths.circle_um().max(f64::MIN_POSITIVE),
        };
        lens.add_sites(
            &element.widths,
            found.shape,
            &some_of(found, &MEASURED),
            zones,
            &mut sites,
        );
    }
    for site in &mut sites {
        [site.x_um, site.y_um] = in_layout_um(found, [site.x_um, site.y_um]);
        if let (Some(x), Some(y)) = (&mut site.element_x_um, &mut site.element_y_um) {
            [*x, *y] = in_layout_um(found, [*x, *y]);
        }
    }
    sites
}

/// A place or a way along rows and columns of the elements as it is in the layout (um).
fn in_layout_um(found: &Extraction, at_um: [f64; 2]) -> [f64; 2] {
    found.in_layout_nm(at_um.map(|um| um * 1e3)).map(|nm| nm * 1e-3)
}
