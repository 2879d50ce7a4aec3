//! Two contents side by side.

use std::collections::BTreeMap;

use super::DiffPlan;
use super::area::{MOST_SIDES, Sides};
use super::content::{Content, Outlines, Ring, TextCopy};
use super::pairs::{self, Counted, Held};
use super::report::{Change, ChangeMap, ElementDiff, LayerDiff, LayoutDiff, MissingDiff, TextAt, TreeDiff};
use metalith_core::text::printable_bytes;
use metalith_core::{Progress, Result};
use metalith_gds::extract::{ExtractedElement, StoredPillars};
use metalith_gds::{LayerNumber, Point, Rect};
use metalith_pillars::{EighthMap, PillarId, PillarRows, PillarShape};
use rayon::prelude::*;

/// Tiles along the longer side of the map of changes.
const TILES: usize = 128;

/// Everything that differs; `strings` are those that texts name by number, `unit_nm` is the common unit.
///
/// # Errors
/// If the user stopped it.
pub(super) fn compare(
    a: &Content,
    b: &Content,
    strings: &[Box<[u8]>],
    unit_nm: f64,
    plan: &DiffPlan,
    progress: &dyn Progress,
) -> Result<LayoutDiff> {
    let mut changes = Changes {
        plan: *plan,
        total: 0,
        listed: Vec::new(),
        examples: BTreeMap::new(),
        map: map_over(a, b, unit_nm),
        held: Some(Vec::new()),
    };
    let mut elements: Vec<ElementDiff> = Vec::new();
    // Eighths are compared first, then the rows that differ.
    let sites: u64 = a.elements.iter().map(|e| (e.site.lattice.sites() as u64).pow(2)).sum();
    progress.begin("comparing pillars", 2 * sites);
    for (number, (own, other)) in a.elements.iter().zip(&b.elements).enumerate() {
        elements.push(element((own, other), a.shape, number, &mut changes, progress)?);
    }
    let mut numbers: Vec<LayerNumber> = a.counts.keys().chain(b.counts.keys()).copied().collect();
    numbers.sort_unstable();
    numbers.dedup();
    let nothing = Outlines::default();
    let mut layers: Vec<LayerDiff> = numbers
        .into_iter()
        .map(|number| {
            let outlines = |c: &'_ Content| c.outlines.contains_key(&number);
            let of_a = if outlines(a) { &a.outlines[&number] } else { &nothing };
            let of_b = if outlines(b) { &b.outlines[&number] } else { &nothing };
            let count = |c: &Content| c.counts.get(&number).copied().unwrap_or(0);
            layer(number, [count(a), count(b)], of_a, of_b, unit_nm, &mut changes)
        })
        .collect();
    let (texts_a, texts_b) = apart(&a.texts, &b.texts);
    let texts_apart = [texts_a.len() as u64, texts_b.len() as u64];
    let texts = |list: Vec<&TextCopy>| -> Vec<TextAt> {
        let at = |p: Point| [p.x as f64 * unit_nm, p.y as f64 * unit_nm];
        let text = |t: &TextCopy| TextAt {
            layer: t.layer,
            string: shortened(&strings[t.string as usize]),
            at_nm: at(t.at),
        };
        list.into_iter().take(plan.listed).map(text).collect()
    };
    let (texts_only_in_a, texts_only_in_b) = (texts(texts_a), texts(texts_b));
    let same = |l: &LayerDiff| l.same_area || l.only_in_a + l.only_in_b == 0;
    let same_geometry = elements.iter().all(|e| e.changed() == 0) && layers.iter().all(same) && texts_apart == [0, 0];
    changes.finish(&mut elements, &mut layers);
    Ok(LayoutDiff {
        a: String::new(),
        b: String::new(),
        same_bytes: false,
        same_geometry,
        tree: TreeDiff::default(),
        pillar_layer: plan.pillar_layer,
        elements,
        layers,
        texts_apart,
        texts_only_in_a,
        texts_only_in_b,
        missing: MissingDiff::default(),
        changes: changes.total,
        listed: changes.listed,
        examples: changes.examples.into_values().collect(),
        map: changes.map,
    })
}

struct Changes {
    plan: DiffPlan,
    total: u64,
    listed: Vec<Change>,
    /// The first change in each tile of the map.
    examples: BTreeMap<usize, Change>,
    map: ChangeMap,
    /// Changes that may yet be found to be of one shape; none if there are more than are held.
    held: Option<Vec<Held>>,
}

/// Distance within which shapes off every lattice may be one (nm).
const REACH_NM: f64 = 400.0;

impl Changes {
    fn add(&mut self, change: Change, counted: Counted) {
        match &mut self.held {
            Some(held) if held.len() < pairs::MOST_HELD => held.push(Held { change, counted }),
            held => {
                let held = held.take();
                held.into_iter().flatten().for_each(|held| self.count(held.change));
                self.count(change);
            }
        }
    }

    /// Count the changes that are held, two of one shape as one.
    fn finish(&mut self, elements: &mut [ElementDiff], layers: &mut [LayerDiff]) {
        let held = self.held.take().unwrap_or_default();
        let reach = elements
            .iter()
            .map(|e| e.pitch_nm.nm())
            .reduce(f64::max)
            .unwrap_or(REACH_NM);
        let mut partner = vec![usize::MAX; held.len()];
        for [a, b] in pairs::pairs(&held, reach) {
            (partner[a], partner[b]) = (b, a);
            let first = [a, b].into_iter().find_map(|k| match held[k].counted {
                Counted::Element(e) => Some(e),
                _ => None,
            });
            for (which, k) in [a, b].into_iter().enumerate() {
                let on_layer = layers.iter_mut().find(|l| l.layer == held[k].change.layer);
                match (held[k].counted, on_layer) {
                    (Counted::Element(e), _) if which == 0 => elements[e].removed -= 1,
                    (Counted::Element(e), _) => elements[e].added -= 1,
                    (_, Some(l)) => {
                        *(if which == 0 { &mut l.only_in_a } else { &mut l.only_in_b }) -= 1;
                        l.moved += u64::from(which == 0 && first.is_none());
                    }
                    _ => {}
                }
            }
            if let Some(e) = first {
                elements[e].moved += 1;
                let [dx, dy] = pairs::joined(&held[a].change, &held[b].change)
                    .moved_nm
                    .unwrap_or_default();
                let largest = &mut elements[e].largest_move_nm;
                *largest = largest.max(dx.abs()).max(dy.abs());
            }
        }
        for (k, own) in held.iter().enumerate() {
            match held.get(partner[k]) {
                None => self.count(own.change.clone()),
                // The second of a pair is counted with the first.
                Some(_) if partner[k] < k => {}
                Some(other) if pairs::side(&own.change) == Some(0) => {
                    self.count(pairs::joined(&own.change, &other.change));
                }
                Some(other) => self.count(pairs::joined(&other.change, &own.change)),
            }
        }
    }

    fn count(&mut self, change: Change) {
        let bounds_nm = change.bounds_nm;
        self.total += 1;
        let map = &mut self.map;
        if map.counts.is_empty() {
            map.counts = vec![0; map.columns * map.rows];
        }
        let [x0, y0, x1, y1] = map.bounds_nm;
        let tile = |low: f64, high: f64, from: f64, to: f64, n: usize| {
            let share = ((low + high) / 2.0 - from) / (to - from).max(f64::MIN_POSITIVE);
            ((share * n as f64) as usize).min(n - 1)
        };
        let column = tile(bounds_nm[0], bounds_nm[2], x0, x1, map.columns);
        let row = tile(bounds_nm[1], bounds_nm[3], y0, y1, map.rows);
        let tile = row * map.columns + column;
        if map.counts[tile] == 0 {
            self.examples.insert(tile, change.clone());
        }
        map.counts[tile] += 1;
        if self.listed.len() < self.plan.listed {
            self.listed.push(change);
        }
    }
}

/// Tiles over everything that either layout holds.
fn map_over(a: &Content, b: &Content, unit_nm: f64) -> ChangeMap {
    let mut all = Rect::EMPTY;
    for content in [a, b] {
        for outlines in content.outlines.values() {
            for r in &outlines.rects {
                let [x0, y0, x1, y1] = r.map(i64::from);
                all.unite(&Rect { x0, y0, x1, y1 });
            }
            outlines.rings.iter().for_each(|ring| all.unite(&Rect::around(ring)));
        }
    }
    let mut bounds = if all.is_empty() {
        [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY]
    } else {
        [all.x0, all.y0, all.x1, all.y1].map(|v| v as f64 * unit_nm)
    };
    for e in &a.elements {
        let half = e.site.lattice.place_nm(0, 0).abs() + e.site.lattice.pitch_nm().nm();
        for axis in 0..2 {
            let centre = e.site.centre_nm[axis] as f64;
            bounds[axis] = bounds[axis].min(centre - half);
            bounds[axis + 2] = bounds[axis + 2].max(centre + half);
        }
    }
    if !bounds.iter().all(|v| v.is_finite()) {
        bounds = [0.0, 0.0, 1.0, 1.0];
    }
    let (width, height) = ((bounds[2] - bounds[0]).max(1.0), (bounds[3] - bounds[1]).max(1.0));
    let tile = width.max(height) / TILES as f64;
    let tiles = |length: f64| ((length / tile).ceil() as usize).clamp(1, TILES);
    ChangeMap {
        bounds_nm: bounds,
        columns: tiles(width),
        rows: tiles(height),
        counts: Vec::new(),
    }
}

/// True if edges along x and y are exchanged.
fn is_quarter_turn([a, b]: [u16; 2], to: [u16; 2]) -> bool {
    a != b && to == [b, a]
}

/// Size by which pillars are ordered: by area, of equal areas by the longer edge.
fn size([x, y]: [u16; 2]) -> (u32, u16) {
    (u32::from(x) * u32::from(y), x.max(y))
}

fn element(
    (a, b): (&ExtractedElement<StoredPillars>, &ExtractedElement<StoredPillars>),
    shape: PillarShape,
    number: usize,
    changes: &mut Changes,
    progress: &dyn Progress,
) -> Result<ElementDiff> {
    let rotated = shape.has_one_size();
    let edges = |number: u16| shape.edges_nm(PillarId(number));
    let lattice = a.site.lattice;
    let mut diff = ElementDiff {
        name: a.site.name.clone(),
        centre_nm: a.site.centre_nm,
        sites: lattice.sites(),
        pitch_nm: lattice.pitch_nm(),
        pillars: [a.widths.pillars(), b.widths.pillars()],
        added: 0,
        removed: 0,
        widened: 0,
        narrowed: 0,
        rotated: 0,
        moved: 0,
        largest_move_nm: 0.0,
        largest_change_nm: 0,
        rms_change_nm: 0.0,
    };
    let mut squares = 0u64;
    let layer = changes.plan.pillar_layer;
    let (n, [mut room, mut other_room]) = (lattice.sites(), [Vec::new(), Vec::new()]);
    let mut site = |row: usize, column: usize, from: u16, to: u16| {
        if from == to {
            return;
        }
        let (count, what) = match (from, to) {
            (0, _) => (&mut diff.added, "added"),
            (_, 0) => (&mut diff.removed, "removed"),
            _ if rotated || is_quarter_turn(edges(from), edges(to)) => (&mut diff.rotated, "rotated"),
            _ if size(edges(to)) > size(edges(from)) => (&mut diff.widened, "widened"),
            _ => (&mut diff.narrowed, "narrowed"),
        };
        *count += 1;
        if from != 0 && to != 0 && !rotated {
            let [a, b] = [edges(from), edges(to)];
            let change = a[0].abs_diff(b[0]).max(a[1].abs_diff(b[1]));
            diff.largest_change_nm = diff.largest_change_nm.max(change);
            squares += u64::from(change) * u64::from(change);
        }
        let x = a.site.centre_nm[0] as f64 + lattice.drawn_nm(0, column);
        let y = a.site.centre_nm[1] as f64 + lattice.drawn_nm(1, row);
        let half = shape.widest_nm(PillarId(from.max(to))) / 2.0;
        let widths = shape.has_width().then_some([from, to]);
        let change = Change {
            what,
            layer,
            bounds_nm: [x - half, y - half, x + half, y + half],
            width_nm: widths,
            moved_nm: None,
            size_nm: None,
        };
        // The box around a rotated rectangle is not its own.
        let counted = if shape.has_width() {
            Counted::Element(number)
        } else {
            Counted::Alone
        };
        changes.add(change, counted);
    };
    // Rows that are the same in both eighths hold no change.
    let apart = match (&a.widths, &b.widths) {
        (StoredPillars::Eighth(a), StoredPillars::Eighth(b)) => Some((a, rows_apart(a, b, progress)?)),
        _ => None,
    };
    for row in 0..n {
        progress.advance(n as u64);
        if apart.as_ref().is_some_and(|(a, apart)| !apart[a.distance(row)]) {
            continue;
        }
        progress.check_stopped()?;
        let from = a.widths.row(row, 0..n, &mut room);
        let to = b.widths.row(row, 0..n, &mut other_room);
        for (column, (&from, &to)) in from.iter().zip(to).enumerate() {
            site(row, column, from, to);
        }
    }
    let both = diff.pillars[0] - diff.removed;
    diff.rms_change_nm = (squares as f64 / both.max(1) as f64).sqrt();
    Ok(diff)
}

/// Rows of two eighths on one lattice, by their distance from the middle in sites, in which a site is not the same in both.
///
/// # Errors
/// If the user stopped it.
fn rows_apart(a: &EighthMap, b: &EighthMap, progress: &dyn Progress) -> Result<Vec<bool>> {
    let n = a.lattice().sites();
    let none = || vec![false; n.div_ceil(2)];
    let row_of = |(mut apart, mut rooms): (Vec<bool>, [Vec<u16>; 2]), iy: usize| {
        if progress.stopped() {
            return (apart, rooms);
        }
        let [own, other] = &mut rooms;
        let row = a.distance(iy);
        let sites = a.to_diagonal(iy, own).iter().zip(b.to_diagonal(iy, other));
        for (column, _) in sites.enumerate().filter(|(_, (from, to))| from != to) {
            (apart[row], apart[column]) = (true, true);
        }
        progress.advance(8 * row as u64);
        (apart, rooms)
    };
    let either = |mut a: Vec<bool>, b: Vec<bool>| {
        a.iter_mut().zip(b).for_each(|(to, from)| *to |= from);
        a
    };
    let rows = (n / 2..n).into_par_iter();
    let parts = rows.fold(|| (none(), Default::default()), row_of);
    let apart = parts.map(|(apart, _)| apart).reduce(none, either);
    progress.check_stopped()?;
    Ok(apart)
}

fn layer(
    number: LayerNumber,
    shapes: [u64; 2],
    a: &Outlines,
    b: &Outlines,
    unit_nm: f64,
    changes: &mut Changes,
) -> LayerDiff {
    let (rects_a, rects_b) = apart(&a.rects, &b.rects);
    let (rings_a, rings_b) = apart(&a.rings, &b.rings);
    let (only_in_a, only_in_b) = (rects_a.len() + rings_a.len(), rects_b.len() + rings_b.len());
    let mut diff = LayerDiff {
        layer: number,
        shapes,
        only_in_a: only_in_a as u64,
        only_in_b: only_in_b as u64,
        moved: 0,
        same_area: false,
    };
    if only_in_a + only_in_b == 0 {
        diff.same_area = true;
        return diff;
    }
    let sets = [(&rects_a, &rings_a, 1), (&rects_b, &rings_b, -1)];
    let count = |rects: &[&[i32; 4]], rings: &[&Ring]| 4 * rects.len() + rings.iter().map(|r| r.len()).sum::<usize>();
    if sets.iter().map(|(rects, rings, _)| count(rects, rings)).sum::<usize>() <= MOST_SIDES {
        let mut sides = Sides::default();
        for (rects, rings, sign) in sets {
            rects.iter().for_each(|r| sides.add(&corners(r), sign));
            rings.iter().for_each(|ring| sides.add(ring, sign));
        }
        diff.same_area = sides.cancel();
    }
    if !diff.same_area {
        for (what, rects, rings) in [("only in a", rects_a, rings_a), ("only in b", rects_b, rings_b)] {
            let boxes = rects.iter().map(|r| r.map(|v| f64::from(v) * unit_nm));
            let around = |ring: &&Ring| {
                let r = Rect::around(ring);
                [r.x0, r.y0, r.x1, r.y1].map(|v| v as f64 * unit_nm)
            };
            for bounds in boxes.chain(rings.iter().map(around)) {
                let change = Change {
                    what,
                    layer: number,
                    bounds_nm: bounds,
                    width_nm: None,
                    moved_nm: None,
                    size_nm: None,
                };
                changes.add(change, Counted::Outline);
            }
        }
    }
    diff
}

/// Bytes of a text that a report shows.
const LONGEST_TEXT: usize = 512;

fn shortened(bytes: &[u8]) -> String {
    let text = printable_bytes(&bytes[..bytes.len().min(LONGEST_TEXT)]);
    let cut = if bytes.len() > LONGEST_TEXT { "..." } else { "" };
    format!("{text}{cut}")
}

fn corners(r: &[i32; 4]) -> [Point; 4] {
    let [x0, y0, x1, y1] = r.map(i64::from);
    [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| Point::new(x, y))
}

/// Difference of two sorted lists as multisets.
pub(super) fn apart<'a, T: Ord>(a: &'a [T], b: &'a [T]) -> (Vec<&'a T>, Vec<&'a T>) {
    let (mut only_a, mut only_b) = (Vec::new(), Vec::new());
    let (mut i, mut j) = (0, 0);
    while i < a.len() && j < b.len() {
        match a[i].cmp(&b[j]) {
            std::cmp::Ordering::Equal => (i, j) = (i + 1, j + 1),
            std::cmp::Ordering::Less => {
                only_a.push(&a[i]);
                i += 1;
            }
            std::cmp::Ordering::Greater => {
                only_b.push(&b[j]);
                j += 1;
            }
        }
    }
    only_a.extend(&a[i..]);
    only_b.extend(&b[j..]);
    (only_a, only_b)
}
