//! Shapes on the pillar layer that are not pillars on their lattice.

use std::ops::Index;

use metalith_core::text::count;
use serde::{Serialize, Serializer};

/// Reason why a shape is not a pillar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Why {
    /// A pillar in an element, its centre not on a site. (One of odd width may be half a database
    /// unit off: no place of its edges on the grid is nearer.)
    OffLattice,
    /// An upright rectangle with unequal sides.
    UnequalSides,
    /// Outline that is neither an upright rectangle nor a circle, or not a whole number of nanometres wide.
    OddShape,
    /// A second pillar on a site that has one.
    DuplicateSite,
    /// A pillar whose centre is in no element.
    OutsideElements,
    /// Wider than the pitch: it overlaps its neighbours' sites.
    TooWide,
    /// A circle among squares, or a square among circles.
    OtherShape,
    /// A cross: pillars of this shape are not simulated.
    Cross,
    /// An outline with a hole: pillars of this shape are not simulated.
    Ring,
}

impl Why {
    /// All reasons.
    pub const ALL: [Self; 9] = [
        Self::OffLattice,
        Self::UnequalSides,
        Self::OddShape,
        Self::DuplicateSite,
        Self::OutsideElements,
        Self::TooWide,
        Self::OtherShape,
        Self::Cross,
        Self::Ring,
    ];

    /// Words for the reason.
    pub fn words(self) -> &'static str {
        match self {
            Self::OffLattice => "off the lattice",
            Self::UnequalSides => "sides unequal",
            Self::OddShape => "no outline of a pillar",
            Self::DuplicateSite => "second pillar on its site",
            Self::OutsideElements => "outside every element",
            Self::TooWide => "wider than the pitch",
            Self::OtherShape => "of another shape than the pillars",
            Self::Cross => "a cross",
            Self::Ring => "a ring",
        }
    }
}

/// One shape that is not a pillar.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UnrecognisedShape {
    pub why: Why,
    /// Middle of its bounding box in the layout (nm).
    pub centre_nm: [f64; 2],
    /// Bounding box (nm).
    pub size_nm: [f64; 2],
    /// Place in the file of its element, or of the reference that placed it.
    pub offset: u64,
}

/// Numbers of shapes that are no pillars, by the reason. In JSON an object with a key for each reason that was met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReasonCounts([u64; Why::ALL.len()]);

impl ReasonCounts {
    /// Count one shape.
    pub fn add(&mut self, why: Why) {
        self.0[why as usize] += 1;
    }

    /// Number of all.
    pub fn total(&self) -> u64 {
        self.0.iter().sum()
    }

    /// Reasons that were met, each with its number.
    pub fn met(self) -> impl Iterator<Item = (Why, u64)> {
        Why::ALL.into_iter().zip(self.0).filter(|(_, shapes)| *shapes > 0)
    }

    /// Numbers and reasons in words, the largest number first.
    pub fn words(self) -> String {
        let mut met: Vec<(Why, u64)> = self.met().collect();
        met.sort_by_key(|(_, shapes)| std::cmp::Reverse(*shapes));
        let words = met
            .iter()
            .map(|(why, shapes)| format!("{} {}", count(*shapes), why.words()));
        words.collect::<Vec<_>>().join(", ")
    }
}

impl Index<Why> for ReasonCounts {
    type Output = u64;

    fn index(&self, why: Why) -> &u64 {
        &self.0[why as usize]
    }
}

impl Serialize for ReasonCounts {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_map(self.met())
    }
}

/// Shapes that are not pillars: the first of them, and the number of all.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct UnrecognisedShapes {
    pub listed: Vec<UnrecognisedShape>,
    /// Numbers by the reason.
    pub by_why: ReasonCounts,
    /// Number of those that may be pillars of an element: on its lattice, or no wider than two pitches and not alone.
    #[serde(skip)]
    pub in_elements: u64,
    /// The first of these.
    #[serde(skip)]
    pub first: Option<UnrecognisedShape>,
}

impl UnrecognisedShapes {
    /// Number of all.
    pub fn total(&self) -> u64 {
        self.by_why.total()
    }

    pub(super) fn add(&mut self, oddity: UnrecognisedShape, in_element: bool, most: usize) {
        self.by_why.add(oddity.why);
        if in_element {
            self.in_elements += 1;
            self.first.get_or_insert(oddity);
        }
        if self.listed.len() < most {
            self.listed.push(oddity);
        }
    }
}
