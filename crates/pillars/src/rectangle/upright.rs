//! Rectangular pillars with edges along x and y, which differ by their size.

use serde::Serialize;

use crate::kind::{OutlineForm, PillarId, PillarKind, PolarisationBasis, Quantity, gap_of_boxes};

/// Upright rectangular pillars on a layout. Edges along x and along y are each one of a row of lengths in equal steps. What tells one
/// pillar from another is its number, from 1 on: first by the edge along x, then by that along y.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct UprightRectangles {
    /// The shortest edge (nm), even.
    pub shortest_nm: u16,
    /// Step from one length to the next (nm), even.
    pub step_nm: u16,
    /// Number of lengths that an edge may have, at most [`UprightRectangles::MOST_LENGTHS`].
    pub lengths: u16,
}

impl UprightRectangles {
    /// Lengths of an edge at most: 4096 pillars, which a layout may have a cell for each of.
    pub const MOST_LENGTHS: u16 = 64;

    /// Number of lengths that count: at least one, and no more than numbers have room for.
    fn counted(self) -> u16 {
        self.lengths.clamp(1, Self::MOST_LENGTHS)
    }

    /// Number of pillars; the last of their numbers.
    pub fn count(self) -> u16 {
        self.counted().pow(2)
    }

    /// The longest edge (nm).
    pub fn longest_nm(self) -> u16 {
        self.edge_nm(self.counted() - 1)
    }

    /// Pillars whose edges may have all the lengths that occur (nm), which are those of two layouts or of what was found in one; none if these are
    /// too many in equal steps, or odd, so that no pillar would be centred on the grid of 1 nm.
    pub fn of_lengths(lengths_nm: impl Iterator<Item = u16> + Clone) -> Option<Self> {
        let (shortest, longest) = (lengths_nm.clone().min()?, lengths_nm.clone().max()?);
        let step_nm = lengths_nm.fold(0, |step, nm| common_divisor(step, nm - shortest));
        let steps = (longest - shortest) / step_nm.max(1);
        let even = shortest.is_multiple_of(2) && step_nm.is_multiple_of(2);
        (even && shortest > 0 && steps < Self::MOST_LENGTHS).then_some(Self {
            shortest_nm: shortest,
            step_nm: step_nm.max(2),
            lengths: steps + 1,
        })
    }

    /// The lengths that an edge may have (nm), rising.
    pub fn lengths_nm(self) -> impl Iterator<Item = u16> + Clone {
        (0..self.counted()).map(move |k| self.edge_nm(k))
    }

    fn edge_nm(self, k: u16) -> u16 {
        self.shortest_nm.saturating_add(self.step_nm.saturating_mul(k))
    }

    /// Edges of a pillar along x and along y (nm).
    pub fn edges_nm(self, number: u16) -> [u16; 2] {
        let (k, lengths) = (number.saturating_sub(1), self.counted());
        [self.edge_nm(k % lengths), self.edge_nm(k / lengths)]
    }

    /// The number of the pillar with these edges along x and along y (nm), if there is one.
    pub fn number(self, edges_nm: [u16; 2]) -> Option<u16> {
        let place = |nm: u16| {
            let beyond = nm.checked_sub(self.shortest_nm)?;
            let k = beyond / self.step_nm.max(1);
            (beyond.is_multiple_of(self.step_nm.max(1)) && k < self.counted()).then_some(k)
        };
        let [x, y] = [place(edges_nm[0])?, place(edges_nm[1])?];
        Some(1 + x + self.counted() * y)
    }

    /// Corners of a pillar about its middle (nm), counter-clockwise.
    pub fn on_grid(self, number: u16) -> [(i64, i64); 4] {
        let [x, y] = self.edges_nm(number).map(|nm| i64::from(nm) / 2);
        [(-x, -y), (x, -y), (x, y), (-x, y)]
    }

    /// The longest diagonal of the pillars up to a number (nm).
    pub fn longest_diagonal_nm(self, number: u16) -> f64 {
        let [x, y] = self.edges_nm(number);
        // Beyond the first row of numbers all edges along x occur.
        let x = if number > self.counted() { self.longest_nm() } else { x };
        f64::from(x).hypot(f64::from(y))
    }
}

impl PillarKind for UprightRectangles {
    fn name(&self) -> &'static str {
        "rectangle"
    }

    fn plural(&self) -> &'static str {
        "rectangles"
    }

    fn design_name(&self) -> &'static str {
        "upright_rectangle"
    }

    fn description(&self) -> String {
        format!(
            "upright rectangles with edges of {} to {} nm in steps of {} nm",
            self.shortest_nm,
            self.longest_nm(),
            self.step_nm
        )
    }

    #[inline]
    fn outline(&self) -> OutlineForm {
        OutlineForm::Polygon
    }

    fn basis(&self) -> Option<PolarisationBasis> {
        Some(PolarisationBasis::Linear)
    }

    #[inline]
    fn has_width(&self) -> bool {
        false
    }

    fn last(&self) -> Option<PillarId> {
        Some(PillarId(self.count()))
    }

    fn edge_range_nm(&self) -> Option<(u16, u16)> {
        Some((self.shortest_nm, self.longest_nm()))
    }

    #[inline]
    fn edges_nm(&self, PillarId(number): PillarId) -> [u16; 2] {
        (*self).edges_nm(number)
    }

    fn axis_edges_nm(&self, PillarId(number): PillarId) -> Vec<u16> {
        (*self).edges_nm(number).to_vec()
    }

    fn four_corners(&self, PillarId(number): PillarId) -> Option<[(i64, i64); 4]> {
        Some(self.on_grid(number))
    }

    fn widest_nm(&self, PillarId(last): PillarId) -> f64 {
        self.longest_diagonal_nm(last)
    }

    fn least_gap(&self, _last: PillarId, apart: [f64; 2]) -> f64 {
        gap_of_boxes([[f64::from(self.longest_nm()); 2]; 2], apart)
    }

    fn keeps(&self, _mirrored: bool, quarter_turns: u8) -> bool {
        quarter_turns.is_multiple_of(2)
    }

    fn recognised(&self, corners: &[[f64; 2]; 4], slack_nm: f64) -> Option<PillarId> {
        let extent = |axis: usize| {
            let reach = corners.iter().map(|c| c[axis]);
            reach.clone().fold(f64::NEG_INFINITY, f64::max) - reach.fold(f64::INFINITY, f64::min)
        };
        let step = f64::from(self.step_nm.max(1));
        let nearest = |nm: f64| -> Option<u16> {
            let k = ((nm - f64::from(self.shortest_nm)) / step).round();
            (k >= 0.0 && k < f64::from(self.counted())).then(|| self.edge_nm(k as u16))
        };
        let number = self.number([nearest(extent(0))?, nearest(extent(1))?])?;
        let drawn = self.on_grid(number).map(|(x, y)| [x as f64, y as f64]);
        let near = |p: &[f64; 2], q: &[f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]) <= slack_nm;
        let each_has_one = drawn.iter().all(|q| corners.iter().any(|p| near(p, q)));
        each_has_one.then_some(PillarId(number))
    }

    fn words(&self, PillarId(number): PillarId) -> String {
        let [x, y] = (*self).edges_nm(number);
        format!("{x} x {y} nm")
    }

    fn cell_name(&self, PillarId(number): PillarId) -> String {
        let [x, y] = (*self).edges_nm(number);
        format!("W{x}X{y}")
    }

    fn quantity(&self) -> Quantity {
        Quantity {
            word: "size",
            title: "Width along x",
            label: "width along x",
            unit: "nm",
        }
    }

    fn step(&self) -> Option<f64> {
        Some(f64::from(self.step_nm))
    }

    fn solver_revision(&self) -> u32 {
        1
    }
}

/// The greatest common divisor of two lengths; that of one and of nothing is the one.
fn common_divisor(a: u16, b: u16) -> u16 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PILLARS: UprightRectangles = UprightRectangles {
        shortest_nm: 80,
        step_nm: 20,
        lengths: 11,
    };

    #[test]
    fn numbers_stand_for_edges_along_x_and_then_along_y() {
        assert_eq!((PILLARS.count(), PILLARS.longest_nm()), (121, 280));
        assert_eq!(PILLARS.edges_nm(1), [80, 80]);
        assert_eq!(PILLARS.edges_nm(11), [280, 80]);
        assert_eq!(PILLARS.edges_nm(12), [80, 100]);
        assert_eq!(PILLARS.edges_nm(121), [280, 280]);
        for number in 1..=121 {
            assert_eq!(PILLARS.number(PILLARS.edges_nm(number)), Some(number));
        }
        for edges in [[60, 80], [90, 80], [80, 300], [80, 81]] {
            assert_eq!(PILLARS.number(edges), None, "{edges:?}");
        }
        assert_eq!(PILLARS.on_grid(12), [(-40, -50), (40, -50), (40, 50), (-40, 50)]);
    }

    #[test]
    fn lengths_are_united_in_their_common_steps() {
        let of = |lengths: &[u16]| UprightRectangles::of_lengths(lengths.iter().copied());
        assert_eq!(of(&[280, 80, 100, 240]), Some(PILLARS));
        assert_eq!(of(&[120]).map(|p| (p.count(), p.edges_nm(1))), Some((1, [120, 120])));
        let wider = UprightRectangles { lengths: 13, ..PILLARS };
        let both = UprightRectangles::of_lengths(PILLARS.lengths_nm().chain(wider.lengths_nm()));
        assert_eq!(both, Some(wider));
        for none in [&[][..], &[101, 121], &[100, 103], &[80, 82, 280], &[0, 80]] {
            assert_eq!(of(none), None, "{none:?}");
        }
        let extreme = UprightRectangles {
            shortest_nm: u16::MAX,
            step_nm: u16::MAX,
            lengths: u16::MAX,
        };
        assert_eq!((extreme.count(), extreme.edges_nm(u16::MAX)), (4096, [u16::MAX; 2]));
        assert_eq!(extreme.number([u16::MAX; 2]), Some(1));
    }

    #[test]
    fn outlines_are_recognised_in_any_order_and_others_are_not() {
        for number in [1, 5, 60, 121] {
            let mut corners = PILLARS.on_grid(number).map(|(x, y)| [x as f64, y as f64]);
            for _ in 0..4 {
                corners.rotate_left(1);
                assert_eq!(PILLARS.recognised(&corners, 1.5), Some(PillarId(number)));
                let mut back = corners;
                back.reverse();
                assert_eq!(PILLARS.recognised(&back, 1.5), Some(PillarId(number)));
            }
            corners[0][0] += 3.0;
            assert_eq!(PILLARS.recognised(&corners, 1.5), None);
        }
        // One that stands on a corner, and one between two sizes.
        let tilted = [[0.0, -50.0], [50.0, 0.0], [0.0, 50.0], [-50.0, 0.0]];
        let between = [[-45.0, -40.0], [45.0, -40.0], [45.0, 40.0], [-45.0, 40.0]];
        assert_eq!(PILLARS.recognised(&tilted, 1.5), None);
        assert_eq!(PILLARS.recognised(&between, 1.5), None);
    }

    #[test]
    fn gaps_beside_one_another_between_corners_and_where_pillars_overlap() {
        // Rounding of a few operations on lengths of hundreds.
        const ROUNDING: f64 = 1e-12;
        let [wide, tall] = [PILLARS.number([280, 80]).unwrap(), PILLARS.number([80, 280]).unwrap()];
        for (numbers, apart, want) in [
            ([wide, wide], [350.0, 0.0], 70.0),
            ([wide, wide], [0.0, -350.0], 270.0),
            ([wide, tall], [350.0, 0.0], 170.0),
            ([wide, tall], [210.0, 220.0], 50.0),
            ([tall, tall], [40.0, 0.0], -40.0),
        ] {
            let gap = PILLARS.gap(numbers.map(PillarId), apart);
            assert!((gap - want).abs() < ROUNDING, "{numbers:?} {apart:?}: {gap}");
        }
        assert_eq!(PILLARS.longest_diagonal_nm(11), 280f64.hypot(80.0));
        assert_eq!(PILLARS.longest_diagonal_nm(12), 280f64.hypot(100.0));
    }
}
