//! Shapes on the pillar layer that are not pillars on their lattice.

use serde::Serialize;

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
    /// All reasons, in the order of [`UnrecognisedShapes::by_why`].
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

/// Shapes that are not pillars: the first of them, and the number of all.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct UnrecognisedShapes {
    pub listed: Vec<UnrecognisedShape>,
    /// Number for each of [`Why::ALL`].
    pub by_why: [u64; 9],
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
        self.by_why.iter().sum()
    }

    /// Reasons with the number of shapes of each, the largest first.
    pub(super) fn reasons(&self) -> String {
        let mut found: Vec<(u64, Why)> = self.by_why.into_iter().zip(Why::ALL).filter(|(n, _)| *n > 0).collect();
        found.sort_by_key(|(n, _)| std::cmp::Reverse(*n));
        let words = found.iter().map(|(n, why)| format!("{n} {}", why.words()));
        words.collect::<Vec<_>>().join(", ")
    }

    pub(super) fn add(&mut self, oddity: UnrecognisedShape, in_element: bool, most: usize) {
        self.by_why[oddity.why as usize] += 1;
        if in_element {
            self.in_elements += 1;
            self.first.get_or_insert(oddity);
        }
        if self.listed.len() < most {
            self.listed.push(oddity);
        }
    }
}
