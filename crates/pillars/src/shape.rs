//! The kind of all pillars of a layout: one enum over the kinds that there are.

use std::fmt;

use serde::Serialize;

use crate::circle::Circle;
use crate::kind::{OutlineForm, PillarId, PillarKind, PolarisationBasis, Quantity};
use crate::mixed::SquaresAndCircles;
use crate::rectangle::{Rectangles, RotatedRectangles, UprightRectangles};
use crate::square::Square;

/// The kind of all pillars of a layout. A number distinguishes a pillar from the others: [`PillarId`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PillarShape {
    /// An upright square; its width is its edge.
    #[default]
    Square,
    /// A circle; its width is its diameter.
    Circle,
    /// A rectangle; its number stands for its rotation or for its size: see [`Rectangles`].
    Rectangle(Rectangles),
    /// Squares and circles in one lens: see [`SquaresAndCircles`]. No design has them.
    Mixed,
}

/// Methods that ask the kind, each by one match, so that calls in loops can be inlined.
macro_rules! of_kind {
    ($($name:ident($($argument:ident: $type:ty),*) -> $answer:ty;)*) => {$(
        #[doc = concat!("Asks the kind for [`PillarKind::", stringify!($name), "`].")]
        #[inline]
        pub fn $name(self, $($argument: $type),*) -> $answer {
            match self {
                Self::Square => Square.$name($($argument),*),
                Self::Circle => Circle.$name($($argument),*),
                Self::Mixed => SquaresAndCircles.$name($($argument),*),
                Self::Rectangle(Rectangles::Rotated(kind)) => PillarKind::$name(&kind, $($argument),*),
                Self::Rectangle(Rectangles::Upright(kind)) => PillarKind::$name(&kind, $($argument),*),
            }
        }
    )*};
}

impl PillarShape {
    of_kind! {
        plural() -> &'static str;
        design_name() -> &'static str;
        description() -> String;
        outline() -> OutlineForm;
        basis() -> Option<PolarisationBasis>;
        has_width() -> bool;
        has_one_size() -> bool;
        last() -> Option<PillarId>;
        edge_range_nm() -> Option<(u16, u16)>;
        edges_nm(id: PillarId) -> [u16; 2];
        axis_edges_nm(id: PillarId) -> Vec<u16>;
        biased_edges_nm(id: PillarId, bias_nm: f64) -> [f64; 2];
        corners(id: PillarId, chord_error_nm: f64) -> Vec<(i64, i64)>;
        four_corners(id: PillarId) -> Option<[(i64, i64); 4]>;
        reach(id: PillarId) -> (i64, i64);
        half_nm(id: PillarId) -> [f64; 2];
        area_share() -> f64;
        box_nm2(id: PillarId) -> u64;
        area_nm2(id: PillarId) -> f64;
        widest_nm(last: PillarId) -> f64;
        gap(pair: [PillarId; 2], apart: [f64; 2]) -> f64;
        least_gap(last: PillarId, apart: [f64; 2]) -> f64;
        keeps(mirrored: bool, quarter_turns: u8) -> bool;
        recognised(corners: &[[f64; 2]; 4], slack_nm: f64) -> Option<PillarId>;
        words(id: PillarId) -> String;
        cell_name(id: PillarId) -> String;
        quantity() -> Quantity;
        value(id: PillarId) -> f64;
        step() -> Option<f64>;
        solver_revision() -> u32;
    }

    /// Name and value of each kind that differs by its width alone, as design files and options have them.
    pub const CHOICES: [(&'static str, Self); 2] = [("square", Self::Square), ("circle", Self::Circle)];

    /// True if it is the square, which is left out of keys and digests: the default of designs.
    pub fn is_square(&self) -> bool {
        *self == Self::Square
    }

    /// The shape of one pillar and its number among pillars of that shape alone.
    pub fn of_pillar(self, id: PillarId) -> (Self, PillarId) {
        match (self, SquaresAndCircles::width(id)) {
            (Self::Mixed, (true, width)) => (Self::Circle, width),
            (Self::Mixed, (false, width)) => (Self::Square, width),
            _ => (self, id),
        }
    }

    /// The rectangles, if they are those that differ by their rotation.
    pub fn rotated(self) -> Option<RotatedRectangles> {
        match self {
            Self::Rectangle(Rectangles::Rotated(pillars)) => Some(pillars),
            _ => None,
        }
    }

    /// The rectangles, if they are those that differ by their size.
    pub fn upright(self) -> Option<UprightRectangles> {
        match self {
            Self::Rectangle(Rectangles::Upright(pillars)) => Some(pillars),
            _ => None,
        }
    }
}

impl<R: Into<Rectangles>> From<R> for PillarShape {
    fn from(pillars: R) -> Self {
        Self::Rectangle(pillars.into())
    }
}

impl fmt::Display for PillarShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Square => Square.name(),
            Self::Circle => Circle.name(),
            Self::Mixed => SquaresAndCircles.name(),
            Self::Rectangle(Rectangles::Rotated(kind)) => kind.name(),
            Self::Rectangle(Rectangles::Upright(kind)) => kind.name(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a few operations on lengths of hundreds.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn gaps_of_both_shapes() {
        for (shape, apart, want) in [
            (PillarShape::Square, [350.0, 0.0], 150.0),
            (PillarShape::Square, [350.0, 350.0], 150.0 * std::f64::consts::SQRT_2),
            (PillarShape::Square, [150.0, 20.0], -50.0),
            (PillarShape::Circle, [350.0, 0.0], 150.0),
            (PillarShape::Circle, [300.0, -400.0], 300.0),
            (PillarShape::Circle, [0.0, 150.0], -50.0),
        ] {
            let gap = shape.gap([180, 220].map(PillarId), apart);
            assert!((gap - want).abs() < ROUNDING, "{shape} {apart:?}: {gap}");
        }
    }

    #[test]
    fn no_two_pillars_are_nearer_than_the_least_gap() {
        let upright = UprightRectangles::of_lengths([80, 100, 140, 200].into_iter()).unwrap();
        let rotated = RotatedRectangles {
            width_nm: 60,
            length_nm: 220,
            steps: 12,
        };
        for (shape, count) in [
            (PillarShape::Square, 220),
            (PillarShape::Circle, 220),
            (PillarShape::Rectangle(upright.into()), upright.count()),
            (PillarShape::Rectangle(rotated.into()), 12),
        ] {
            for apart in [
                [350.0, 0.0],
                [0.0, 350.0],
                [350.0, -350.0],
                [175.0, 303.1],
                [100.0, 0.0],
            ] {
                let least = shape.least_gap(PillarId(count), apart);
                let all = (1..=count).flat_map(|a| (1..=count).map(move |b| [a, b]));
                let found = all.map(|pair| shape.gap(pair.map(PillarId), apart));
                let found = found.fold(f64::INFINITY, f64::min);
                assert!(found >= least - ROUNDING, "{shape} {apart:?}: {found} < {least}");
            }
        }
        // Their sides face one another.
        let upright = PillarShape::Rectangle(upright.into());
        assert_eq!(upright.least_gap(PillarId(1), [350.0, 0.0]), 150.0);
    }
}
