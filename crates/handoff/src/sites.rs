//! Places on the chip at which widths are to be measured, and crosses to align by.

use metalith_core::part;
use serde::Serialize;

use super::process::Process;
use super::structures::Structure;
use metalith_design::Design;
use metalith_design::array::PillarArray;

/// Pillars on each side of a site whose widths should be nearly equal: an SEM then measures the right one even
/// when it counts wrong by one.
const NEIGHBOURS: usize = 1;
/// Widths between the narrowest and the widest that are looked for on the lenses.
const WIDTHS: usize = 5;

/// One place to measure a width at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MetrologySite {
    pub id: String,
    /// Which file it is in: `pillars` or `tests`.
    pub file: &'static str,
    /// Element or structure.
    pub place: String,
    /// On the chip, seen from the pillar side, origin in its middle (um); for test structures from their
    /// lower left corner.
    pub x_um: f64,
    pub y_um: f64,
    /// From the middle of the element (um).
    pub element_x_um: Option<f64>,
    pub element_y_um: Option<f64>,
    pub width_nm: u16,
    /// Narrowest and widest of the pillar and its neighbours (nm).
    pub around_nm: (u16, u16),
}

/// Places on the first and the last element of the array, and one on each structure that has a width.
pub(super) fn sites(
    design: &Design,
    process: &Process,
    array: &PillarArray,
    structures: &[Structure],
) -> Vec<MetrologySite> {
    let zones = process.metrology.sites_per_width as usize;
    let mut sites = Vec::new();
    let widths = targets(design);
    // The element in the middle, and the one furthest from it.
    let furthest = array.placed.iter().max_by_key(|p| p.element.distance_nm2());
    let mut chosen: Vec<_> = std::iter::once(array.central()).chain(furthest).collect();
    chosen.dedup_by_key(|p| p.element.index);
    for placed in chosen {
        let map = array.widths(placed);
        let (cx, cy) = placed.element.centre_nm;
        for best in best_sites(&map, design.lens.radius_um(), &widths, zones) {
            let (x, y) = (map.lattice.coordinate_nm(best.ix), map.lattice.coordinate_nm(best.iy));
            sites.push(MetrologySite {
                id: format!("L{:02}", sites.len() + 1),
                file: "pillars",
                place: format!("element {}", placed.element.label()),
                x_um: (cx + x) as f64 * 1e-3,
                y_um: (cy + y) as f64 * 1e-3,
                element_x_um: Some(x as f64 * 1e-3),
                element_y_um: Some(y as f64 * 1e-3),
                width_nm: best.width_nm,
                around_nm: best.around_nm,
            });
        }
    }
    for structure in structures {
        let Some(width) = structure.width_nm else { continue };
        let (x, y) = structure.bounds.centre();
        sites.push(MetrologySite {
            id: format!("T{:02}", sites.len() + 1),
            file: "tests",
            place: structure.id.clone(),
            x_um: x as f64 * 1e-3,
            y_um: y as f64 * 1e-3,
            element_x_um: None,
            element_y_um: None,
            width_nm: width as u16,
            around_nm: (width as u16, width as u16),
        });
    }
    sites
}

/// Widths to look for: equal steps inside the range, not its ends, where few pillars are (nm).
fn targets(design: &Design) -> Vec<u16> {
    let (low, high) = design.cell.width_range_nm;
    let step = f64::from(high - low) / (WIDTHS + 1) as f64;
    (1..=WIDTHS)
        .map(|k| super::matrix::legal_width(design, f64::from(low) + step * k as f64) as u16)
        .collect()
}

struct BestSite {
    ix: usize,
    iy: usize,
    width_nm: u16,
    around_nm: (u16, u16),
}

/// For each width and each ring of the lens the site whose neighbours differ least from it; among equals
/// the one nearest the x axis, where a stage finds it by moving along one axis.
fn best_sites(map: &metalith_core::WidthMap, radius_um: f64, widths: &[u16], zones: usize) -> Vec<BestSite> {
    let n = map.lattice.sites();
    let mut best: Vec<Option<(u64, BestSite)>> = (0..widths.len() * zones).map(|_| None).collect();
    for iy in NEIGHBOURS..n.saturating_sub(NEIGHBOURS) {
        for ix in NEIGHBOURS..n.saturating_sub(NEIGHBOURS) {
            let width_nm = map.width_nm[[iy, ix]];
            let Some(target) = widths.iter().position(|&w| w == width_nm) else {
                continue;
            };
            let Some(around_nm) = around(map, ix, iy) else { continue };
            let r_um = map.lattice.coordinate_um(ix).hypot(map.lattice.coordinate_um(iy));
            let zone = ((r_um / radius_um * zones as f64) as usize).min(zones - 1);
            let difference = u64::from((width_nm - around_nm.0).max(around_nm.1 - width_nm));
            let aside = map.lattice.half_index(iy).unsigned_abs();
            let score = (difference << 32) | aside;
            let held = &mut best[target * zones + zone];
            if held.as_ref().is_none_or(|(known, _)| score < *known) {
                *held = Some((
                    score,
                    BestSite {
                        ix,
                        iy,
                        width_nm,
                        around_nm,
                    },
                ));
            }
        }
    }
    best.into_iter().flatten().map(|(_, site)| site).collect()
}

/// Narrowest and widest pillar in the square about a site; none where one is missing.
fn around(map: &metalith_core::WidthMap, ix: usize, iy: usize) -> Option<(u16, u16)> {
    let part = part(
        map.width_nm.view(),
        iy - NEIGHBOURS..iy + NEIGHBOURS + 1,
        ix - NEIGHBOURS..ix + NEIGHBOURS + 1,
    );
    let low = *part.iter().min()?;
    (low > 0).then(|| (low, *part.iter().max().expect("nine pillars")))
}

/// One cross.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cross {
    pub set: String,
    /// Its name for the writer: P and Q for the global pair, M1 to M4 for those of the chip.
    pub role: String,
    pub x_um: f64,
    pub y_um: f64,
    pub length_um: f64,
    pub width_um: f64,
}

/// All crosses, with the names that the writer gives to those it can use.
pub(super) fn crosses(design: &Design) -> Vec<Cross> {
    let mut crosses = Vec::new();
    for (k, set) in design.layout.marks.iter().enumerate() {
        for &(x, y) in &set.centres_nm {
            // The lowest left and lowest right of the first set turn and scale the wafer; the four of the
            // second place each chip, clockwise from the upper left.
            let lowest = set.centres_nm.iter().map(|c| c.1).min() == Some(y);
            let role = match (k, x < 0, y > 0) {
                (0, true, _) if lowest => "P",
                (0, false, _) if lowest => "Q",
                (1, true, true) => "M1",
                (1, false, true) => "M2",
                (1, false, false) => "M3",
                (1, true, false) => "M4",
                _ => "",
            };
            crosses.push(Cross {
                set: set.name.clone(),
                role: role.into(),
                x_um: x as f64 * 1e-3,
                y_um: y as f64 * 1e-3,
                length_um: set.length_nm as f64 * 1e-3,
                width_um: set.width_nm as f64 * 1e-3,
            });
        }
    }
    crosses
}
