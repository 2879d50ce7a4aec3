//! Memory of answers for outlines, for their copies elsewhere.

use super::shape::{Outline, Point, Rect};
use super::transform::Transform;

/// Outlines that are remembered at a time, a power of two: a lens of rectangles has some hundred.
const PLACES: usize = 1 << 12;

/// Places that an outline may have, side by side.
const WAYS: usize = 4;

/// Sets of [`WAYS`] upright boxes that are remembered at a time, a power of two: a lens of these has some hundred sizes.
const BOX_SETS: usize = 1 << 8;

/// Bits of an edge of such a box; longer ones are asked about each time.
const EDGE_BITS: u32 = 31;

/// Outlines with numbers that are remembered: those with higher ones are identified by their corners.
const NUMBERED: usize = 1 << 12;

/// Orientations that an outline may be asked about in.
const ORIENTATIONS: usize = 8;

/// Odd numbers without pattern, which spread outlines that differ by little.
const SPREAD: [u64; 3] = [0x9E37_79B9_7F4A_7C15, 0xC2B2_AE3D_27D4_EB4F, 0x1656_67B1_9E37_79F9];

/// Corners after the first, from the first, x above y; and the orientation that the outline is asked about in.
type Key = ([u64; 3], u8);

/// Answers about closed outlines of four corners that hold wherever these stand: each distinct outline is asked about once, but
/// for those that others have taken the place of. Memory and time are bounded, whatever the outlines are.
///
/// Outlines with numbers are of one layout.
pub struct OutlineMemo<T> {
    places: Vec<Option<(Key, T)>>,
    /// Answers about outlines with numbers, by these and by orientation.
    numbered: Vec<[Option<T>; ORIENTATIONS]>,
}

impl<T> Default for OutlineMemo<T> {
    fn default() -> Self {
        Self {
            places: Vec::new(),
            numbered: Vec::new(),
        }
    }
}

impl<T: Copy> OutlineMemo<T> {
    /// The answer about an outline as a placement turns it, by `ask` if it is not remembered; what is turned by other than quarters
    /// is rounded where it stands, and asked about each time.
    #[inline]
    pub fn placed(&mut self, outline: Outline<'_>, placement: &Transform, ask: impl FnOnce() -> T) -> T {
        match outline.orientation(placement) {
            Some(orientation) => self.of(outline, orientation, ask),
            None => ask(),
        }
    }

    /// The answer about an outline in an orientation, by `ask` if it is not remembered.
    #[inline]
    pub(super) fn of(&mut self, outline: Outline<'_>, orientation: u8, ask: impl FnOnce() -> T) -> T {
        let number = match outline.number {
            Some(number) if (number as usize) < NUMBERED => number as usize,
            _ => return self.by_corners(outline.points, orientation, ask),
        };
        if number >= self.numbered.len() {
            self.numbered.resize(number + 1, [None; ORIENTATIONS]);
        }
        *self.numbered[number][usize::from(orientation) % ORIENTATIONS].get_or_insert_with(ask)
    }

    /// Variant for an outline without a number.
    #[inline]
    fn by_corners(&mut self, points: &[Point], orientation: u8, ask: impl FnOnce() -> T) -> T {
        let Some(key) = key(points, orientation) else {
            return ask();
        };
        if self.places.is_empty() {
            self.places.resize(PLACES, None);
        }
        let start = place(&key);
        let places = &mut self.places[start..start + WAYS];
        let known = |place: &&Option<(Key, T)>| matches!(place, Some((known, _)) if *known == key);
        if let Some(Some((_, answer))) = places.iter().find(known) {
            return *answer;
        }
        let answer = ask();
        let free = places.iter().position(Option::is_none).unwrap_or(0);
        places[free] = Some((key, answer));
        answer
    }
}

/// Answers about upright boxes that hold wherever these stand, by their edges. Memory and time are bounded, whatever the boxes are.
pub struct BoxMemo<T> {
    /// Keys in sets of [`WAYS`], zero where there is none: apart from the answers, so that a set is read at once.
    keys: Vec<u64>,
    answers: Vec<Option<T>>,
}

impl<T> Default for BoxMemo<T> {
    fn default() -> Self {
        Self {
            keys: Vec::new(),
            answers: Vec::new(),
        }
    }
}

impl<T: Copy> BoxMemo<T> {
    /// The answer about a box, by `ask` if it is not remembered.
    #[inline]
    pub fn of(&mut self, r: &Rect, ask: impl FnOnce() -> T) -> T {
        if let Some(answer) = self.get(r) {
            return answer;
        }
        let answer = ask();
        self.remember(r, answer);
        answer
    }

    /// The answer about a box that is remembered.
    #[inline]
    pub fn get(&self, r: &Rect) -> Option<T> {
        let key = Self::key(r)?;
        let start = Self::set(key);
        let set = self.keys.get(start..start + WAYS)?;
        self.answers[start + set.iter().position(|known| *known == key)?]
    }

    /// Remember the answer about a box that none is remembered of.
    pub fn remember(&mut self, r: &Rect, answer: T) {
        let Some(key) = Self::key(r) else { return };
        if self.keys.is_empty() {
            self.keys.resize(BOX_SETS * WAYS, 0);
            self.answers.resize(BOX_SETS * WAYS, None);
        }
        let start = Self::set(key);
        let free = self.keys[start..start + WAYS].iter().position(|known| *known == 0);
        let place = start + free.unwrap_or(0);
        self.keys[place] = key;
        self.answers[place] = Some(answer);
    }

    /// Key from both edges; `None` for long ones and for boxes without area.
    #[inline]
    fn key(r: &Rect) -> Option<u64> {
        let (width, height) = (r.width() as u64, r.height() as u64);
        (width > 0 && (width | height) >> EDGE_BITS == 0).then_some(width << EDGE_BITS | height)
    }

    #[inline]
    fn set(key: u64) -> usize {
        (key.wrapping_mul(SPREAD[0]) >> 32) as usize % BOX_SETS * WAYS
    }
}

/// An outline without its place, if it is closed and has four corners near one another.
#[inline]
fn key(points: &[Point], orientation: u8) -> Option<Key> {
    let &[a, b, c, d, e] = points else { return None };
    if a != e {
        return None;
    }
    let near = |from: i64, to: i64| i32::try_from(to.checked_sub(from)?).ok();
    // In registers: what is written in halves and read as a whole waits for the memory.
    let corner = |p: Point| Some(u64::from(near(a.x, p.x)? as u32) << 32 | u64::from(near(a.y, p.y)? as u32));
    Some(([corner(b)?, corner(c)?, corner(d)?], orientation))
}

/// The first place where a key may be remembered.
#[inline]
fn place((corners, orientation): &Key) -> usize {
    let mixed = corners
        .iter()
        .zip(SPREAD)
        .fold(u64::from(*orientation), |sum, (corner, spread)| {
            (sum ^ corner).wrapping_mul(spread).rotate_left(29)
        });
    (mixed >> 32) as usize % (PLACES / WAYS) * WAYS
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(at: (i64, i64), corners: [(i64, i64); 4]) -> Vec<Point> {
        let moved = |&(x, y): &(i64, i64)| Point::new(at.0 + x, at.1 + y);
        corners.iter().chain(&corners[..1]).map(moved).collect()
    }

    #[test]
    fn an_outline_is_asked_about_once_for_each_orientation_wherever_it_stands() {
        let mut memo = OutlineMemo::default();
        let rhombus = |at| outline(at, [(0, 0), (50, 10), (60, 90), (10, 80)]);
        assert_eq!(memo.of(Outline::new(&rhombus((0, 0))), 0, || 1), 1);
        assert_eq!(memo.of(Outline::new(&rhombus((-7_000_000, 350))), 0, || 2), 1);
        assert_eq!(memo.of(Outline::new(&rhombus((0, 0))), 3, || 3), 3);
        let other = outline((0, 0), [(0, 0), (50, 10), (60, 90), (10, 81)]);
        assert_eq!(memo.of(Outline::new(&other), 0, || 4), 4);
    }

    #[test]
    fn boxes_are_asked_about_once_for_each_pair_of_edges_and_long_ones_each_time() {
        let mut memo = BoxMemo::default();
        let of_edges = |x: i64, width: i64, height: i64| Rect {
            x0: x,
            y0: -x,
            x1: x + width,
            y1: height - x,
        };
        let sizes = [(50, 90), (90, 50), (50, 91), (51, 90)];
        for (answer, (width, height)) in sizes.into_iter().enumerate() {
            assert_eq!(memo.of(&of_edges(7, width, height), || answer), answer);
        }
        for (answer, (width, height)) in sizes.into_iter().enumerate() {
            assert_eq!(memo.of(&of_edges(-900, width, height), || usize::MAX), answer);
        }
        for (width, height) in [(1 << 40, 90), (90, 1 << 31), (0, 90)] {
            assert_eq!(memo.of(&of_edges(0, width, height), || 1), 1);
            assert_eq!(memo.of(&of_edges(0, width, height), || 2), 2);
        }
        // More sizes than places.
        for round in 0..2 {
            for k in 1..4 * (BOX_SETS * WAYS) as i64 {
                assert_eq!(memo.of(&of_edges(0, k, 7), || k as usize), k as usize, "round {round}");
            }
        }
    }

    #[test]
    fn what_is_no_outline_of_four_corners_is_not_remembered() {
        let mut memo = OutlineMemo::default();
        let open = &outline((0, 0), [(0, 0), (9, 0), (9, 9), (0, 9)])[..4];
        let far = outline((0, 0), [(i64::MIN, 0), (9, 0), (i64::MAX, 9), (0, 9)]);
        for points in [open, &far, &[]] {
            assert_eq!(memo.of(Outline::new(points), 0, || 1), 1);
            assert_eq!(memo.of(Outline::new(points), 0, || 2), 2);
        }
    }

    #[test]
    fn more_outlines_than_places_are_each_told_from_the_others() {
        let mut memo = OutlineMemo::default();
        for round in 0..2 {
            for k in 0..3 * PLACES as i64 {
                let own = outline((k, -k), [(0, 0), (k + 1, 0), (k + 1, 9), (0, 9)]);
                assert_eq!(memo.of(Outline::new(&own), 0, || k), k, "round {round}");
            }
        }
    }

    #[test]
    fn outlines_with_numbers_are_told_by_these_and_by_their_orientation() {
        let mut memo = OutlineMemo::default();
        let points = outline((0, 0), [(0, 0), (50, 10), (60, 90), (10, 80)]);
        let numbered = |number| Outline::new(&points).numbered(number);
        let far = NUMBERED as u32 + 7;
        for number in [5, 0, NUMBERED as u32 - 1] {
            for orientation in 0..8 {
                let answer = u32::from(orientation) + 8 * number;
                assert_eq!(memo.of(numbered(number), orientation, || answer), answer);
                assert_eq!(memo.of(numbered(number), orientation, || far), answer);
            }
        }
        // Beyond what is remembered by number, corners tell.
        assert_eq!(memo.of(numbered(far), 0, || far), far);
        assert_eq!(memo.of(numbered(far + 1), 0, || 0), far);
        assert!(memo.numbered.len() <= NUMBERED);
    }
}
