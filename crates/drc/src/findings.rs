//! Findings of a rule: markers up to a limit, counts without one.

use metalith_core::text::hex;
use std::collections::HashMap;

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::input::CheckInput;
use super::waiver::Waiver;
use metalith_gds::{Point, Rect, Transform};

/// One place where a rule does not hold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Marker {
    /// Outline in the layout (nm); empty for findings without a position, such as a name.
    pub outline_nm: Vec<[f64; 2]>,
    /// Description of the violation, with numbers.
    pub words: String,
    /// Hash of rule and position, the same in every run and for every hierarchy: waivers refer to it.
    pub hash: String,
    /// True if a waiver covers it.
    pub waived: bool,
}

/// Collects the findings of one rule.
pub(super) struct Findings {
    rule: String,
    unit_nm: f64,
    most: usize,
    waivers: Vec<Waiver>,
    /// Numbers of them in that list by hash: the first of equal ones.
    by_hash: HashMap<String, usize>,
    /// Places covered by each of those waivers.
    pub matched: Vec<u64>,
    pub total: u64,
    pub waived: u64,
    pub markers: Vec<Marker>,
    /// Values that are reported whether or not they are within limits.
    pub facts: Vec<(String, f64)>,
}

impl Findings {
    pub(crate) fn new(rule: &str, unit_nm: f64, input: &CheckInput<'_>) -> Self {
        let waivers = input.waivers.map_or_else(Vec::new, |w| w.valid(rule, input.today));
        let mut by_hash = HashMap::new();
        for (k, waiver) in waivers.iter().enumerate() {
            by_hash.entry(waiver.hash.clone()).or_insert(k);
        }
        Self {
            by_hash,
            rule: rule.to_owned(),
            unit_nm,
            most: input.markers,
            matched: vec![0; waivers.len()],
            waivers,
            total: 0,
            waived: 0,
            markers: Vec::new(),
            facts: Vec::new(),
        }
    }

    /// A place of the layout, in database units.
    pub(crate) fn at(&mut self, points: &[Point], words: impl FnOnce() -> String) {
        self.total += 1;
        if self.markers.len() >= self.most && self.waivers.is_empty() {
            return;
        }
        let outline: Vec<[f64; 2]> = points
            .iter()
            .map(|p| [p.x as f64 * self.unit_nm, p.y as f64 * self.unit_nm])
            .collect();
        let hash = hash(&self.rule, &canonical(points), self.unit_nm);
        self.keep(outline, hash, words);
    }

    /// A rectangle of the layout, in database units.
    pub(crate) fn rect(&mut self, r: &Rect, words: impl FnOnce() -> String) {
        let corner = |x, y| Point::new(x, y);
        let ring = [
            corner(r.x0, r.y0),
            corner(r.x1, r.y0),
            corner(r.x1, r.y1),
            corner(r.x0, r.y1),
        ];
        self.at(&ring, words);
    }

    /// Records the same place in every copy of a cell.
    pub(crate) fn copies(&mut self, points: &[Point], placements: &[Transform], words: impl Fn() -> String) {
        for (k, placement) in placements.iter().enumerate() {
            if self.markers.len() >= self.most && self.waivers.is_empty() {
                self.total += (placements.len() - k) as u64;
                return;
            }
            let placed: Vec<Point> = points.iter().map(|&p| placement.apply(p)).collect();
            self.at(&placed, &words);
        }
    }

    /// Something that has no place; `subject` identifies it.
    pub(crate) fn plain(&mut self, subject: &str, words: impl FnOnce() -> String) {
        self.total += 1;
        let hash = digest(&format!("{}\n{subject}", self.rule));
        self.keep(Vec::new(), hash, words);
    }

    fn keep(&mut self, outline_nm: Vec<[f64; 2]>, hash: String, words: impl FnOnce() -> String) {
        let waiver = self.by_hash.get(&hash).copied();
        if let Some(k) = waiver {
            self.matched[k] += 1;
            self.waived += 1;
        }
        if self.markers.len() < self.most {
            self.markers.push(Marker {
                outline_nm,
                words: words(),
                hash,
                waived: waiver.is_some(),
            });
        }
    }

    /// Indices of the waivers that were tried, in the order of the file, with the number of findings that each covered.
    pub(crate) fn tried(&self) -> impl Iterator<Item = (usize, u64)> + '_ {
        self.waivers.iter().map(|w| w.index).zip(self.matched.iter().copied())
    }
}

/// The outline from its smallest point, in the direction that comes first: one for all ways to draw it.
fn canonical(points: &[Point]) -> Vec<Point> {
    let mut ring = points.to_vec();
    if ring.len() > 1 && ring.first() == ring.last() {
        ring.pop();
    }
    let from_smallest = |ring: &[Point]| {
        let start = (0..ring.len()).min_by_key(|&k| ring[k]).unwrap_or(0);
        let mut turned = ring.to_vec();
        turned.rotate_left(start);
        turned
    };
    let forward = from_smallest(&ring);
    ring.reverse();
    forward.min(from_smallest(&ring))
}

/// Places count in picometres, so that the database unit does not matter.
fn hash(rule: &str, ring: &[Point], unit_nm: f64) -> String {
    let pm = |v: i64| (v as f64 * unit_nm * 1e3).round() as i128;
    let mut text = format!("{rule}\n");
    for p in ring {
        text.push_str(&format!("{},{};", pm(p.x), pm(p.y)));
    }
    digest(&text)
}

fn digest(text: &str) -> String {
    hex(&Sha256::digest(text)[..8])
}
