//! The last stage of a camera: a network that makes one picture of several that were restored from a frame by classical means.
//!
//! It is smaller than the denoiser, and the same for all cameras but for the number of pictures that it sees. What it learns of, the
//! errors of a camera's own pictures, is of that camera alone: the file of its weights says which.

use std::path::Path;

use metalith_core::Result;
use ndarray::Array3;
use serde::{Deserialize, Serialize};

use crate::network::{COLOURS, Network, Plan, Size};
use crate::network_input::{SIDE, corrected, cut, mirrored, piled, refitted, seen};
use crate::weights::read_described;

/// Key under which files of weights say what they were trained for.
pub const STAGE: &str = "stage";
/// Most pictures of a frame.
const MOST: usize = 64;
/// Most fits to the frame.
pub const MOST_REFITS: usize = 4;

/// Provenance of a last stage: what it was trained for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Kind of pictures, a word.
    pub kind: String,
    /// Digest of all that decides the frames but the scene and the noise.
    pub camera: String,
    /// Pictures of a frame.
    pub pictures: usize,
    /// Digest of what the camera's layout does to light: materials, cell, band. None for cameras without one, and in weights that
    /// were trained before it was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub optics: Option<String>,
    /// Number of times that the picture is fitted to the frame again, each between two passes of the network.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub refits: usize,
}

fn is_zero(n: &usize) -> bool {
    *n == 0
}

/// Fit of pictures to one frame, in sRGB values `[row, column, colour]`.
pub trait PictureFit: Sync {
    /// The picture near another that explains the frame.
    fn fitted(&self, picture: &Array3<f32>) -> Array3<f32>;

    /// Gradient over a picture from that over the fitted one.
    fn adjoint(&self, picture: &Array3<f32>, fitted: &Array3<f32>, gradient: &Array3<f32>) -> Array3<f32>;
}

/// Provenance of a last stage and its weights, from a file that `metalith train --stage` wrote.
///
/// # Errors
/// If the file cannot be read, is damaged, or is of a denoiser.
pub fn read_stage(path: &Path) -> Result<(Provenance, Vec<f32>)> {
    read_described(path, |training| {
        let provenance = Provenance::deserialize(training.get(STAGE)?).ok()?;
        let size = Size::post_processor(provenance.pictures);
        let known = (1..=MOST).contains(&provenance.pictures) && provenance.refits <= MOST_REFITS;
        known.then_some((provenance, size))
    })
}

/// A network that was trained for one camera and one kind of pictures.
#[derive(Clone, Debug)]
pub struct PostProcessor {
    network: Network,
    provenance: Provenance,
}

impl PostProcessor {
    /// Post-processor with the weights of a file that `metalith train --stage` wrote.
    ///
    /// # Errors
    /// If the file cannot be read, is damaged, or is of a denoiser.
    pub fn read(path: &Path) -> Result<Self> {
        let (provenance, weights) = read_stage(path)?;
        let plan = Plan::new(Size::post_processor(provenance.pictures));
        Ok(Self::of_network(Network::new(&plan, &weights), provenance))
    }

    /// Post-processor of a network in memory.
    pub fn of_network(network: Network, provenance: Provenance) -> Self {
        Self { network, provenance }
    }

    /// Provenance: what it was trained for.
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }

    /// The picture that is expected of a scene, `[row, column, colour]` in sRGB values, from pictures of one frame of it in the
    /// order in which it was trained by them.
    ///
    /// # Errors
    /// If there are more or fewer of them, or they differ in size.
    pub fn finish(&self, pictures: &[Array3<f32>]) -> Result<Array3<f32>> {
        Ok(self.corrected(&self.pile(pictures)?))
    }

    /// Variant of [`PostProcessor::finish`] for a network that was trained through fits to the frame. The first two pictures are the one
    /// that is corrected and the one that explains the frame.
    ///
    /// # Errors
    /// As [`PostProcessor::finish`].
    pub fn finish_fitted(&self, pictures: &[Array3<f32>], fit: &dyn PictureFit) -> Result<Array3<f32>> {
        Ok(self.corrected_fitted(self.pile(pictures)?, fit))
    }

    fn pile(&self, pictures: &[Array3<f32>]) -> Result<Array3<f32>> {
        if pictures.len() != self.provenance.pictures {
            return Err(metalith_core::Error::refused(
                "stage/picture-count-differs",
                format!(
                    "the network was trained with {1} pictures of a frame, and {0} are given",
                    pictures.len(),
                    self.provenance.pictures
                ),
                "give the weights that were trained for this camera",
            ));
        }
        piled(pictures, pictures[0].dim())
    }

    /// Corrected picture from pictures behind one another, by all passes and the fits between them.
    pub fn corrected_fitted(&self, mut pile: Array3<f32>, fit: &dyn PictureFit) -> Array3<f32> {
        let mut found = self.corrected(&pile);
        for _ in 0..self.provenance.refits {
            pile = refitted(&pile, &found, &fit.fitted(&found));
            found = self.corrected(&pile);
        }
        found
    }

    /// Corrected picture from pictures behind one another.
    pub fn corrected(&self, pile: &Array3<f32>) -> Array3<f32> {
        let (rows, columns, _) = pile.dim();
        let whole = |n: usize| n.next_multiple_of(SIDE).max(SIDE);
        let pile = mirrored(pile, whole(rows), whole(columns));
        let input = seen(&pile, [0; 2], [rows, columns]);
        let first = cut(&pile, [0; 2], [pile.dim().0, pile.dim().1, COLOURS]);
        let found = corrected(&self.network, input, first);
        cut(&found, [0; 2], [rows, columns, COLOURS])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights of before say nothing of what a layout does to light; what they say is read, and written as it was.
    #[test]
    fn weights_of_before_can_be_read() {
        let text = r#"{"kind":"blending","camera":"a1","pictures":10}"#;
        let provenance: Provenance = serde_json::from_str(text).unwrap();
        assert_eq!(provenance.optics, None);
        assert_eq!(serde_json::to_string(&provenance).unwrap(), text);
    }
}
