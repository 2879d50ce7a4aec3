//! The cross-section of a pillar as it is drawn.

use std::fmt;

use serde::Serialize;

use crate::circle::circle_corners;
use crate::rectangle::{Rectangles, RotatedRectangles, UprightRectangles};

/// The form of all pillars of a layout. One number tells a pillar from others of its form: its width, or of rectangles a number that
/// stands for a rotation or for a size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PillarShape {
    /// An upright square; its width is its edge.
    #[default]
    Square,
    /// A circle; its width is its diameter.
    Circle,
    /// A rectangle; its number is that of its rotation or of its size: see [`Rectangles`].
    Rectangle(Rectangles),
}

impl PillarShape {
    /// Name and value of each that differs by its width alone, as design files and options have them.
    pub const CHOICES: [(&'static str, Self); 2] = [("square", Self::Square), ("circle", Self::Circle)];

    /// True if it is the square, which is left out of keys and digests: the default of designs.
    pub fn is_square(&self) -> bool {
        *self == Self::Square
    }

    /// Area of a pillar over that of the square of its width.
    pub fn area_share(self) -> f64 {
        match self {
            Self::Square => 1.0,
            Self::Circle => std::f64::consts::FRAC_PI_4,
            Self::Rectangle(_) => 1.0,
        }
    }

    /// Area of the square of its width, or of the rectangle (nm^2): times [`PillarShape::area_share`] that of the pillar.
    pub fn box_nm2(self, number: u16) -> u64 {
        match self {
            Self::Square | Self::Circle => u64::from(number) * u64::from(number),
            Self::Rectangle(pillars) => {
                let [x, y] = pillars.edges_nm(number).map(u64::from);
                x * y
            }
        }
    }

    /// Both edges of a pillar as drawn (nm), of a rectangle before it is rotated; of a square or a circle the width twice.
    pub fn edges_nm(self, number: u16) -> [f64; 2] {
        match self {
            Self::Square | Self::Circle => [f64::from(number); 2],
            Self::Rectangle(Rectangles::Rotated(pillars)) => [pillars.width_nm, pillars.length_nm].map(f64::from),
            Self::Rectangle(Rectangles::Upright(pillars)) => pillars.edges_nm(number).map(f64::from),
        }
    }

    /// Area of a pillar (nm^2).
    pub fn area_nm2(self, number: u16) -> f64 {
        self.box_nm2(number) as f64 * self.area_share()
    }

    /// The rectangles, if it is one.
    pub fn rectangles(self) -> Option<Rectangles> {
        match self {
            Self::Rectangle(pillars) => Some(pillars),
            Self::Square | Self::Circle => None,
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

    /// Corners of a pillar about its middle (nm), counter-clockwise, the first not repeated; a circle's chords are at most
    /// `chord_error_nm` from it.
    pub fn corners(self, number: u16, chord_error_nm: f64) -> Vec<(i64, i64)> {
        let h = i64::from(number) / 2;
        match self {
            Self::Square => vec![(-h, -h), (h, -h), (h, h), (-h, h)],
            Self::Circle => circle_corners(number.into(), chord_error_nm),
            Self::Rectangle(pillars) => pillars.corners(number).to_vec(),
        }
    }

    /// Reach of a pillar from its middle along x and y (nm), if its width is even.
    pub fn reach(self, number: u16) -> (i64, i64) {
        match self {
            Self::Square | Self::Circle => (i64::from(number) / 2, i64::from(number) / 2),
            Self::Rectangle(pillars) => pillars.reach(number),
        }
    }

    /// Width (nm) that no pillar up to a number has more than, in any direction of rectangles.
    pub fn widest_nm(self, number: u16) -> f64 {
        match self {
            Self::Square | Self::Circle => f64::from(number),
            Self::Rectangle(pillars) => pillars.longest_diagonal_nm(number),
        }
    }

    /// Words for a pillar with this number.
    pub fn words(self, number: u16) -> String {
        match self {
            Self::Square | Self::Circle => format!("{number} nm wide"),
            Self::Rectangle(pillars) => pillars.words(number),
        }
    }

    /// Distance of two pillars of these widths or numbers whose centres are (dx, dy) apart, all in one unit, of rectangles nm;
    /// negative where they overlap.
    pub fn gap(self, widths: [f64; 2], [dx, dy]: [f64; 2]) -> f64 {
        let reach = 0.5 * (widths[0] + widths[1]);
        match self {
            Self::Circle => dx.hypot(dy) - reach,
            Self::Square => {
                let (x, y) = (dx.abs() - reach, dy.abs() - reach);
                if x > 0.0 && y > 0.0 { x.hypot(y) } else { x.max(y) }
            }
            Self::Rectangle(pillars) => pillars.gap(widths.map(|number| number as u16), [dx, dy]),
        }
    }

    /// Distance (nm) that no two pillars up to a number have less than, whose centres are (dx, dy) apart (nm).
    pub fn least_gap(self, number: u16, apart: [f64; 2]) -> f64 {
        match (self, self.upright()) {
            (_, Some(pillars)) => Self::Square.gap([f64::from(pillars.longest_nm()); 2], apart),
            // Rotated ones stay within circles.
            (Self::Rectangle(_), None) => Self::Circle.gap([self.widest_nm(number); 2], apart),
            _ => self.gap([f64::from(number); 2], apart),
        }
    }

    /// Plural of the name of the shape.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Square => "squares",
            Self::Circle => "circles",
            Self::Rectangle(_) => "rectangles",
        }
    }
}

impl fmt::Display for PillarShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Square => "square",
            Self::Circle => "circle",
            Self::Rectangle(_) => "rectangle",
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
            let gap = shape.gap([180.0, 220.0], apart);
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
                let least = shape.least_gap(count, apart);
                let all = (1..=count).flat_map(|a| (1..=count).map(move |b| [a, b]));
                let found = all.map(|pair| shape.gap(pair.map(f64::from), apart));
                let found = found.fold(f64::INFINITY, f64::min);
                assert!(found >= least - ROUNDING, "{shape} {apart:?}: {found} < {least}");
            }
        }
        // Their sides face one another.
        let upright = PillarShape::Rectangle(upright.into());
        assert_eq!(upright.least_gap(1, [350.0, 0.0]), 150.0);
    }
}
