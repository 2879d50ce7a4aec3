//! Colour filters over the pixels of a sensor: the pixels of one colour are used as they are, the others are masked.

use ndarray::Array2;

/// A colour of a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    Red,
    Green,
    Blue,
}

impl Channel {
    /// Channels by their names.
    pub const CHOICES: [(&'static str, Self); 3] = [("red", Self::Red), ("green", Self::Green), ("blue", Self::Blue)];
}

/// Filters of the pixels (0, 0), (0, 1), (1, 0) and (1, 1) by row and column, repeated over the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bayer(pub [Channel; 4]);

impl Bayer {
    /// The four ways in which the square of filters can lie, by their names.
    pub const CHOICES: [(&'static str, Self); 4] = [
        (
            "rggb",
            Self([Channel::Red, Channel::Green, Channel::Green, Channel::Blue]),
        ),
        (
            "bggr",
            Self([Channel::Blue, Channel::Green, Channel::Green, Channel::Red]),
        ),
        (
            "grbg",
            Self([Channel::Green, Channel::Red, Channel::Blue, Channel::Green]),
        ),
        (
            "gbrg",
            Self([Channel::Green, Channel::Blue, Channel::Red, Channel::Green]),
        ),
    ];

    /// True if the pixel of a row and column has a filter.
    pub fn has(self, (row, col): (usize, usize), channel: Channel) -> bool {
        self.0[2 * (row % 2) + col % 2] == channel
    }

    /// The frame with every pixel of other filters replaced by the mean of its neighbours of this one: for pictures and for a
    /// first look at where the window is. Nothing is fitted to these.
    pub fn filled(self, dn: &Array2<f32>, channel: Channel) -> Array2<f32> {
        let (rows, cols) = dn.dim();
        Array2::from_shape_fn(dn.dim(), |(y, x)| {
            if self.has((y, x), channel) {
                return dn[(y, x)];
            }
            let near = (y.saturating_sub(1)..(y + 2).min(rows))
                .flat_map(|ny| (x.saturating_sub(1)..(x + 2).min(cols)).map(move |nx| (ny, nx)))
                .filter(|at| self.has(*at, channel));
            let (sum, count) = near.fold((0.0, 0.0), |(sum, count), at| (sum + dn[at], count + 1.0));
            sum / f32::max(count, 1.0)
        })
    }
}
