//! The cross-section of a pillar as it is drawn.

use std::fmt;

use serde::Serialize;

/// The form of all pillars of a layout. One number says how large a pillar is: its width.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PillarShape {
    /// An upright square; its width is its edge.
    #[default]
    Square,
    /// A circle; its width is its diameter.
    Circle,
}

impl PillarShape {
    /// Name and value of each, as design files and options have them.
    pub const CHOICES: [(&'static str, Self); 2] = [("square", Self::Square), ("circle", Self::Circle)];

    /// Whether it is the square: what designs had before there were others, and what is then left out of keys and digests.
    pub fn is_square(&self) -> bool {
        *self == Self::Square
    }

    /// Area of a pillar over that of the square of its width.
    pub fn area_share(self) -> f64 {
        match self {
            Self::Square => 1.0,
            Self::Circle => std::f64::consts::FRAC_PI_4,
        }
    }

    /// Distance of two pillars of these widths whose centres are (dx, dy) apart, all in one unit; negative where they overlap.
    pub fn gap(self, widths: [f64; 2], [dx, dy]: [f64; 2]) -> f64 {
        let reach = 0.5 * (widths[0] + widths[1]);
        match self {
            Self::Circle => dx.hypot(dy) - reach,
            Self::Square => {
                let (x, y) = (dx.abs() - reach, dy.abs() - reach);
                if x > 0.0 && y > 0.0 { x.hypot(y) } else { x.max(y) }
            }
        }
    }

    /// What several of it are called.
    pub fn plural(self) -> &'static str {
        match self {
            Self::Square => "squares",
            Self::Circle => "circles",
        }
    }
}

impl fmt::Display for PillarShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Square => "square",
            Self::Circle => "circle",
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
}
