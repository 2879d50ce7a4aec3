//! Places on the chip at which widths are to be measured, and crosses to align by.

use metalith_pillars::{LatticeKind, PillarId, PillarMap, PillarShape};
use serde::Serialize;

use super::pad::{DrawnSize, legal_width, standing_for_all, whole_mdeg};
use super::process::Process;
use super::structures::Structure;
use metalith_design::Design;
use metalith_design::array::PillarArray;

/// Neighbours on the sides of a pillar of a square lattice and across its corners, by columns and rows. All neighbours of a
/// site should be nearly as wide: an SEM then measures the right one even when it counts wrong by one.
const AROUND_SQUARE: [[i64; 2]; 4] = [[1, 0], [0, 1], [1, 1], [-1, 1]];
/// Widths between the narrowest and the widest that are looked for on the lenses.
const WIDTHS: usize = 5;
/// Rotations of rectangles that are looked for (degrees): along the axes, where an SEM measures best, and between them.
const ROTATIONS_DEG: [f64; 4] = [0.0, 45.0, 90.0, 135.0];

/// Least and greatest of something, where pillars differ by it.
type Range<T> = Option<(T, T)>;

/// One place to measure a width at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MetrologySite {
    pub id: String,
    /// File that it is in: `pillars` or `tests`.
    pub file: &'static str,
    /// Element or structure.
    pub place: String,
    /// Place on the chip, seen from the pillar side, origin in its middle (um); for test structures from their lower
    /// left corner.
    pub x_um: f64,
    pub y_um: f64,
    /// Place from the middle of the element (um).
    pub element_x_um: Option<f64>,
    pub element_y_um: Option<f64>,
    #[serde(flatten)]
    pub drawn: DrawnSize,
    /// Narrowest and widest of the pillar and its neighbours (nm), where they differ by their width.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub around_nm: Range<u16>,
    /// Least and greatest rotation of the pillar and its neighbours (degrees), where they differ by it; counted on beyond half a
    /// turn and below none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub around_deg: Range<f64>,
    /// Most that an edge of a neighbour differs from that of the pillar by (nm), where they differ by both edges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub around_by_nm: Option<u16>,
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
        let lens = MeasuredLens {
            file: "pillars",
            place: format!("element {}", placed.element.label()),
            centre_nm: placed.element.centre_nm,
            radius_um: design.lens_of(&placed.element).radius_um(),
        };
        lens.add_sites(&array.widths(placed), array.shape, &widths, zones, &mut sites);
    }
    for structure in structures {
        let Some(drawn) = structure.drawn else { continue };
        let (x, y) = structure.bounds.centre();
        sites.push(MetrologySite {
            id: format!("T{:02}", sites.len() + 1),
            file: "tests",
            place: structure.id.clone(),
            x_um: x as f64 * 1e-3,
            y_um: y as f64 * 1e-3,
            element_x_um: None,
            element_y_um: None,
            drawn,
            around_nm: drawn.length_nm.is_none().then_some((drawn.width_nm, drawn.width_nm)),
            around_deg: drawn.rotation_deg.map(|deg| (deg, deg)),
            around_by_nm: (drawn.length_nm.is_some() && drawn.rotation_deg.is_none()).then_some(0),
        });
    }
    sites
}

/// A lens on which sites are looked for.
pub(super) struct MeasuredLens {
    /// File that it is in.
    pub file: &'static str,
    /// Words for the element.
    pub place: String,
    pub centre_nm: (i64, i64),
    pub radius_um: f64,
}

impl MeasuredLens {
    /// Add the best sites for each of these widths or numbers in each of so many rings.
    pub(super) fn add_sites(
        &self,
        map: &PillarMap,
        shape: PillarShape,
        targets: &[u16],
        zones: usize,
        sites: &mut Vec<MetrologySite>,
    ) {
        let (cx, cy) = self.centre_nm;
        for best in best_sites(map, shape, self.radius_um, targets, zones) {
            let (around_nm, around_deg, around_by_nm) = neighbours(shape, &best);
            let (x, y) = (map.lattice.drawn_nm(0, best.ix), map.lattice.drawn_nm(1, best.iy));
            sites.push(MetrologySite {
                id: format!("L{:02}", sites.len() + 1),
                file: self.file,
                place: self.place.clone(),
                x_um: (cx as f64 + x) * 1e-3,
                y_um: (cy as f64 + y) * 1e-3,
                element_x_um: Some(x * 1e-3),
                element_y_um: Some(y * 1e-3),
                drawn: DrawnSize::of(shape, best.number),
                around_nm,
                around_deg,
                around_by_nm,
            });
        }
    }
}

/// Pillars to look for: widths in equal steps inside the range, not its ends, where few pillars are (nm); of
/// rectangles, the numbers of a few rotations or sizes.
fn targets(design: &Design) -> Vec<u16> {
    if let Some(numbers) = standing_for_all(design, &ROTATIONS_DEG) {
        return numbers;
    }
    let (low, high) = design.cell.width_range_nm;
    let step = f64::from(high - low) / (WIDTHS + 1) as f64;
    (1..=WIDTHS)
        .map(|k| legal_width(design, f64::from(low) + step * k as f64))
        .collect()
}

struct BestSite {
    ix: usize,
    iy: usize,
    /// Width (nm), or number of a rectangle.
    number: u16,
    /// Least and greatest of the pillar and its neighbours, from its own: widths or edges (nm), or steps of rotation.
    around: (i32, i32),
}

/// The neighbours of a site in nm, in degrees, or by how much their edges differ.
fn neighbours(shape: PillarShape, site: &BestSite) -> (Range<u16>, Range<f64>, Option<u16>) {
    let (low, high) = site.around;
    if shape.has_width() {
        let width = |from_own: i32| (i32::from(site.number) + from_own) as u16;
        return (Some((width(low), width(high))), None, None);
    }
    match shape.step().filter(|_| shape.has_one_size()) {
        Some(step_deg) => {
            let own_deg = shape.value(PillarId(site.number));
            let deg = |from_own: i32| whole_mdeg(own_deg + f64::from(from_own) * step_deg);
            (None, Some((deg(low), deg(high))), None)
        }
        None => (None, None, Some(high.max(-low) as u16)),
    }
}

/// Distance of a width or number from another: of rotations, the short way round, as the last is next to the first; of
/// upright rectangles, the difference of the edge that differs more.
fn from_own(shape: PillarShape, own: u16, other: u16) -> i32 {
    let apart = i32::from(other) - i32::from(own);
    match shape.last() {
        None => apart,
        Some(PillarId(steps)) if shape.has_one_size() => {
            let (steps, half) = (i32::from(steps), i32::from(steps / 2));
            (apart + half).rem_euclid(steps) - half
        }
        Some(_) => {
            let [own, other] = [own, other].map(|number| shape.edges_nm(PillarId(number)));
            let by = [0, 1].map(|axis| i32::from(other[axis]) - i32::from(own[axis]));
            if by[1].abs() > by[0].abs() { by[1] } else { by[0] }
        }
    }
}

/// Sites to measure: for each width or rotation and each ring of the lens, the site whose neighbours differ least from
/// it; among equals the one nearest the x axis, where a stage finds it by moving along one axis.
fn best_sites(map: &PillarMap, shape: PillarShape, radius_um: f64, targets: &[u16], zones: usize) -> Vec<BestSite> {
    let n = map.lattice.sites();
    let mut best: Vec<Option<(u64, BestSite)>> = (0..targets.len() * zones).map(|_| None).collect();
    for iy in 0..n {
        for ix in 0..n {
            let number = map.number[[iy, ix]];
            let Some(target) = targets.iter().position(|&w| w == number) else {
                continue;
            };
            let Some(around) = around(map, shape, ix, iy) else {
                continue;
            };
            let r_um = map.lattice.place_um(0, ix).hypot(map.lattice.place_um(1, iy));
            let zone = ((r_um / radius_um * zones as f64) as usize).min(zones - 1);
            let difference = u64::from(around.0.unsigned_abs().max(around.1.unsigned_abs()));
            let aside = map.lattice.whole_nm(1, iy).unsigned_abs();
            let score = (difference << 32) | aside;
            let held = &mut best[target * zones + zone];
            if held.as_ref().is_none_or(|(known, _)| score < *known) {
                let site = BestSite { ix, iy, number, around };
                *held = Some((score, site));
            }
        }
    }
    best.into_iter().flatten().map(|(_, site)| site).collect()
}

/// Least and greatest pillar about a site, from its own; none where one is missing.
fn around(map: &PillarMap, shape: PillarShape, ix: usize, iy: usize) -> Option<(i32, i32)> {
    let half = match map.lattice.kind() {
        LatticeKind::Square => &AROUND_SQUARE[..],
        LatticeKind::Hexagonal => map.lattice.neighbours(),
    };
    let own = map.number[[iy, ix]];
    let all = half.iter().flat_map(|[x, y]| [[*x, *y], [-x, -y]]);
    all.into_iter().try_fold((0, 0), |(low, high), [x, y]| {
        let place = [iy.checked_add_signed(y as isize)?, ix.checked_add_signed(x as isize)?];
        let other = *map.number.get(place)?;
        let apart = from_own(shape, own, other);
        (other > 0).then_some((low.min(apart), high.max(apart)))
    })
}

/// One cross.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cross {
    pub set: String,
    /// Name for the writer: P and Q for the global pair, M1 to M4 for those of the chip.
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
