//! Interface of a kind of pillar for the rest of the program: one trait, one file for each kind.

use serde::Serialize;

/// The number that stands for a pillar among those of its kind; zero stands for no pillar. What it means is the matter of the
/// kind: a width (nm), the number of a rotation, the number of a pair of edges.
///
/// Maps and rows hold plain `u16`: they are compared, counted and handed to NumPy as slices of numbers, and a number is its own
/// index into tables. A kind is asked by [`PillarId`], so that no width is taken for a number of another meaning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(transparent)]
pub struct PillarId(pub u16);

impl PillarId {
    /// The absence of a pillar.
    pub const NONE: Self = Self(0);
}

impl From<u16> for PillarId {
    fn from(number: u16) -> Self {
        Self(number)
    }
}

/// Outline of a pillar, as formats, rules and drawings take it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutlineForm {
    /// An upright square: both formats have a short record for it.
    Square,
    /// A circle, written as a polygon near it.
    Circle,
    /// A polygon without curves, recognised by its corners where it is placed.
    Polygon,
    /// A square or a circle, as the number of the pillar says.
    Mixed,
}

/// Polarisations that pillars give a separate phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolarisationBasis {
    /// Circular ones: the phase is geometric, twice the rotation of the pillar.
    Circular,
    /// Linear ones along x and along y: each edge of the pillar sets the phase of one.
    Linear,
}

/// Quantity by which pillars of a kind differ, as reports show it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// Word in a sentence: what a pillar of a kind has that another has not.
    pub word: &'static str,
    /// Title of a figure of [`PillarKind::value`].
    pub title: &'static str,
    /// Label of its axis.
    pub label: &'static str,
    /// Unit of its axis.
    pub unit: &'static str,
}

/// A kind of pillar: cross-sections that differ by one number.
///
/// Answers that stand here are those of upright boxes, of which the number is the width; a kind has its own where it differs.
pub trait PillarKind {
    /// The word for one pillar.
    fn name(&self) -> &'static str;

    /// The word for several pillars.
    fn plural(&self) -> &'static str;

    /// Value of the key `shape` in design files.
    fn design_name(&self) -> &'static str {
        self.name()
    }

    /// Name of all pillars with their sizes, in words.
    fn description(&self) -> String {
        self.plural().to_owned()
    }

    /// Outline, as formats, rules and drawings take it.
    fn outline(&self) -> OutlineForm;

    /// Polarisations that have their own phase; none if all light has one phase.
    fn basis(&self) -> Option<PolarisationBasis> {
        None
    }

    /// True if the number of a pillar is its width (nm).
    #[inline]
    fn has_width(&self) -> bool {
        true
    }

    /// True if all pillars have one size and differ by their rotation.
    fn has_one_size(&self) -> bool {
        false
    }

    /// The last number; none where the lattice alone bounds it.
    fn last(&self) -> Option<PillarId> {
        None
    }

    /// Shortest and longest edge of all pillars (nm); none where the lattice alone bounds them.
    fn edge_range_nm(&self) -> Option<(u16, u16)> {
        None
    }

    /// Both edges of a pillar as drawn (nm), before a rotation; the width twice where there is one.
    #[inline]
    fn edges_nm(&self, PillarId(width): PillarId) -> [u16; 2] {
        [width; 2]
    }

    /// Lengths that a writer fills along x and y with whole steps of its beam (nm), each once; empty if no edge is along an axis.
    fn axis_edges_nm(&self, PillarId(width): PillarId) -> Vec<u16> {
        vec![width]
    }

    /// Both edges of a pillar that a process widens by a bias (nm).
    fn biased_edges_nm(&self, id: PillarId, bias_nm: f64) -> [f64; 2] {
        self.edges_nm(id).map(|edge| f64::from(edge) + bias_nm)
    }

    /// Corners of a pillar about its middle (nm), counter-clockwise, the first not repeated; chords of a curve are at most
    /// `chord_error_nm` from it.
    fn corners(&self, id: PillarId, _chord_error_nm: f64) -> Vec<(i64, i64)> {
        self.four_corners(id).map_or_else(Vec::new, Vec::from)
    }

    /// [`PillarKind::corners`] of a polygon of four, without an allocation: rules ask for those of millions of pillars.
    fn four_corners(&self, _id: PillarId) -> Option<[(i64, i64); 4]> {
        None
    }

    /// Reach of the corners from the middle along x and y (nm), of an odd width rounded down.
    fn reach(&self, id: PillarId) -> (i64, i64) {
        let [x, y] = self.edges_nm(id).map(|edge| i64::from(edge) / 2);
        (x, y)
    }

    /// Half of what a pillar takes along x and y (nm).
    #[inline]
    fn half_nm(&self, id: PillarId) -> [f64; 2] {
        self.edges_nm(id).map(|edge| f64::from(edge) / 2.0)
    }

    /// Area of a pillar over the product of its edges.
    fn area_share(&self) -> f64 {
        1.0
    }

    /// Product of both edges of a pillar (nm^2).
    #[inline]
    fn box_nm2(&self, id: PillarId) -> u64 {
        let [x, y] = self.edges_nm(id).map(u64::from);
        x * y
    }

    /// Area of a pillar (nm^2).
    #[inline]
    fn area_nm2(&self, id: PillarId) -> f64 {
        self.box_nm2(id) as f64 * self.area_share()
    }

    /// Width (nm) that no pillar up to a number exceeds in any direction.
    fn widest_nm(&self, PillarId(last): PillarId) -> f64 {
        f64::from(last)
    }

    /// Distance of two pillars whose centres are (dx, dy) apart (nm); negative where they overlap.
    #[inline]
    fn gap(&self, pair: [PillarId; 2], apart: [f64; 2]) -> f64 {
        let [a, b] = pair.map(|id| self.edges_nm(id).map(f64::from));
        gap_of_boxes([a, b], apart)
    }

    /// Lower bound of the distance of any two pillars up to a number whose centres are (dx, dy) apart (nm).
    fn least_gap(&self, last: PillarId, apart: [f64; 2]) -> f64 {
        self.gap([last; 2], apart)
    }

    /// True if every pillar is the same after a mirror about the x axis, if there is one, and then so many quarter turns about
    /// its middle.
    fn keeps(&self, _mirrored: bool, _quarter_turns: u8) -> bool {
        true
    }

    /// Pillar with these corners (nm, from its middle, in any order). Each of them is within `slack_nm` of a corner of that pillar, or
    /// their root mean square is. Kinds that are recognised by their bounding box have none.
    fn recognised(&self, _corners: &[[f64; 2]; 4], _slack_nm: f64) -> Option<PillarId> {
        None
    }

    /// Size or rotation of a pillar in words.
    fn words(&self, PillarId(width): PillarId) -> String {
        format!("{width} nm wide")
    }

    /// Name of the cell of a pillar in a layout.
    fn cell_name(&self, PillarId(width): PillarId) -> String {
        format!("W{width}")
    }

    /// Quantity by which pillars differ.
    fn quantity(&self) -> Quantity {
        Quantity {
            word: "width",
            title: "Width",
            label: "width",
            unit: "nm",
        }
    }

    /// The quantity of a pillar, in the unit of its axis.
    fn value(&self, id: PillarId) -> f64 {
        f64::from(self.edges_nm(id)[0])
    }

    /// Difference of the quantity of neighbouring numbers; none where the design says it.
    fn step(&self) -> Option<f64> {
        None
    }

    /// Number of times that the solver has changed its answers for this kind alone; each makes its cached results invalid.
    fn solver_revision(&self) -> u32 {
        0
    }
}

/// Distance of two upright boxes with these edges whose centres are (dx, dy) apart, all in one unit; negative where they overlap.
#[inline]
pub(crate) fn gap_of_boxes([a, b]: [[f64; 2]; 2], [dx, dy]: [f64; 2]) -> f64 {
    let reach = |axis: usize| 0.5 * (a[axis] + b[axis]);
    let (x, y) = (dx.abs() - reach(0), dy.abs() - reach(1));
    if x > 0.0 && y > 0.0 { x.hypot(y) } else { x.max(y) }
}
