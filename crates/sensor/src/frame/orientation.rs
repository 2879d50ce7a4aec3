//! Orientation of frames: cameras and relays mirror and turn what they record.

use ndarray::{Array2, Axis};

/// Changes by which a frame as recorded becomes upright: its rows grow with +y, its columns with +x.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Orientation {
    #[default]
    Upright,
    /// Columns are in the reverse order.
    MirroredX,
    /// Rows are in the reverse order.
    MirroredY,
    /// Both are.
    Turned180,
    /// Rows and columns are exchanged.
    Transposed,
    /// A quarter turn from +x to +y made it upright.
    Turned90,
    /// A quarter turn from +y to +x made it upright.
    Turned270,
    /// Rows and columns are exchanged, both in the reverse order.
    AntiTransposed,
}

impl Orientation {
    /// All of them by the words of files.
    pub const ALL: [(&'static str, Self); 8] = [
        ("upright", Self::Upright),
        ("mirrored_x", Self::MirroredX),
        ("mirrored_y", Self::MirroredY),
        ("turned_180", Self::Turned180),
        ("transposed", Self::Transposed),
        ("turned_90", Self::Turned90),
        ("turned_270", Self::Turned270),
        ("anti_transposed", Self::AntiTransposed),
    ];

    /// The word of files.
    pub fn word(self) -> &'static str {
        Self::ALL
            .iter()
            .find(|(_, own)| *own == self)
            .map_or("", |(word, _)| word)
    }

    /// True if rows become columns.
    pub fn is_transposed(self) -> bool {
        matches!(
            self,
            Self::Transposed | Self::Turned90 | Self::Turned270 | Self::AntiTransposed
        )
    }

    /// The upright frame of one as recorded.
    pub fn upright(self, recorded: &Array2<f32>) -> Array2<f32> {
        let mut view = recorded.view();
        if self.is_transposed() {
            view.swap_axes(0, 1);
        }
        if matches!(
            self,
            Self::MirroredY | Self::Turned180 | Self::Turned270 | Self::AntiTransposed
        ) {
            view.invert_axis(Axis(0));
        }
        if matches!(
            self,
            Self::MirroredX | Self::Turned180 | Self::Turned90 | Self::AntiTransposed
        ) {
            view.invert_axis(Axis(1));
        }
        view.as_standard_layout().into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The eight orientations of a frame of six unlike pixels are unlike, and each has one that takes it back.
    #[test]
    fn orientations_are_the_symmetries_of_the_square() {
        let frame = Array2::from_shape_fn((2, 3), |(y, x)| (3 * y + x) as f32);
        let all = Orientation::ALL.map(|(_, o)| o.upright(&frame));
        for (k, own) in all.iter().enumerate() {
            assert!(!all[..k].contains(own), "{k}");
            let back = Orientation::ALL.into_iter().filter(|(_, o)| o.upright(own) == frame);
            assert_eq!(back.count(), 1, "{k}");
        }
        assert_eq!(Orientation::MirroredX.upright(&frame)[(0, 0)], frame[(0, 2)]);
        assert_eq!(Orientation::MirroredY.upright(&frame)[(0, 0)], frame[(1, 0)]);
        // A quarter turn takes +x to +y: the lowest row becomes the last column.
        assert_eq!(Orientation::Turned90.upright(&frame)[(2, 1)], frame[(0, 2)]);
        assert_eq!(Orientation::MirroredX.word(), "mirrored_x");
    }
}
