//! Colour filters over the pixels of a sensor, and the pixels of one colour.

use ndarray::Array2;
use serde::Serialize;

/// A colour of a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    Red,
    Green,
    Blue,
}

impl Colour {
    /// Colours by their names.
    pub const CHOICES: [(&'static str, Self); 3] = [("red", Self::Red), ("green", Self::Green), ("blue", Self::Blue)];

    /// Name of the channel of this colour in a camera file.
    pub fn name(self) -> &'static str {
        Self::CHOICES[self as usize].0
    }
}

/// Colour filter of a sensor: the colours of the pixels (0, 0), (0, 1), (1, 0) and (1, 1) by row and column, repeated over the
/// sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ColourFilter {
    /// Every pixel counts all channels; a sensor without a filter has one.
    None,
    Rggb,
    Bggr,
    Grbg,
    Gbrg,
}

impl ColourFilter {
    /// The four orientations of the Bayer filter, by their names.
    pub const BAYER: [(&'static str, Self); 4] = [
        ("rggb", Self::Rggb),
        ("bggr", Self::Bggr),
        ("grbg", Self::Grbg),
        ("gbrg", Self::Gbrg),
    ];

    /// Colour of the pixel of a row and column; `None` for a sensor without a filter.
    pub fn colour_at(self, row: usize, column: usize) -> Option<Colour> {
        use Colour::{Blue, Green, Red};
        let square = match self {
            Self::None => return None,
            Self::Rggb => [Red, Green, Green, Blue],
            Self::Bggr => [Blue, Green, Green, Red],
            Self::Grbg => [Green, Red, Blue, Green],
            Self::Gbrg => [Green, Blue, Red, Green],
        };
        Some(square[2 * (row % 2) + column % 2])
    }

    /// Names of the channels that a sensor with this filter has; nothing without a filter, where any name will do.
    pub fn channels(self) -> Option<[&'static str; 3]> {
        (self != Self::None).then_some(Colour::CHOICES.map(|(name, _)| name))
    }

    /// Pixels of a colour; `None` if all pixels see it, for the sensor has no filter or the colour is not said.
    pub fn pixels_of(self, colour: Option<Colour>) -> Option<ColourPixels> {
        let colour = colour.filter(|_| self != Self::None)?;
        Some(ColourPixels { filter: self, colour })
    }
}

/// Pixels of one colour of a filter: these are used as they are, the others are masked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColourPixels {
    filter: ColourFilter,
    colour: Colour,
}

impl ColourPixels {
    /// True if the pixel of a row and column has the colour.
    pub fn has(self, (row, column): (usize, usize)) -> bool {
        self.filter.colour_at(row, column) == Some(self.colour)
    }

    /// The frame with every pixel of other colours replaced by the mean of its neighbours of this one: for pictures and for a
    /// first look at where the window is. Nothing is fitted to these.
    pub fn filled(self, dn: &Array2<f32>) -> Array2<f32> {
        let (rows, cols) = dn.dim();
        Array2::from_shape_fn(dn.dim(), |(y, x)| {
            if self.has((y, x)) {
                return dn[(y, x)];
            }
            let near = (y.saturating_sub(1)..(y + 2).min(rows))
                .flat_map(|ny| (x.saturating_sub(1)..(x + 2).min(cols)).map(move |nx| (ny, nx)))
                .filter(|at| self.has(*at));
            let (sum, count) = near.fold((0.0, 0.0), |(sum, count), at| (sum + dn[at], count + 1.0));
            sum / f32::max(count, 1.0)
        })
    }
}
