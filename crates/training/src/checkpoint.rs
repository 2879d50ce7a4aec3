//! Checkpoint of training, on the disk, from which it goes on.

use std::collections::HashMap;
use std::path::Path;

use metalith_core::file::read_at_most;
use metalith_core::text::hex;
use metalith_core::{AtomicFile, Error, Result};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use sha2::{Digest, Sha256};

use crate::adam::Adam;

/// Weights, and what the next step needs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Checkpoint {
    /// Steps that are done.
    pub step: u64,
    /// Mean over the last hundred steps or so.
    pub loss: f64,
    pub weights: Vec<f32>,
    pub adam: Adam,
}

/// Longest file (bytes).
const LONGEST: u64 = 256 << 20;
const NAMES: [&str; 3] = ["weights", "first", "second"];

impl Checkpoint {
    /// Before the first step.
    pub(crate) fn begin(weights: Vec<f32>) -> Self {
        Self {
            step: 0,
            loss: 0.0,
            adam: Adam::new(weights.len()),
            weights,
        }
    }

    /// Write it, whole or not at all. `origin` is what it is learnt from.
    pub(crate) fn write(&self, path: &Path, origin: &str) -> Result<()> {
        let bytes = [&self.weights, &self.adam.first, &self.adam.second]
            .map(|values| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
        let about = HashMap::from([
            ("origin".to_owned(), origin.to_owned()),
            ("step".to_owned(), self.step.to_string()),
            // All digits, so that the number comes back as it was.
            ("loss".to_owned(), format!("{:?}", self.loss)),
            (
                "sha256".to_owned(),
                digest(&bytes.each_ref().map(Vec::as_slice), origin, self.step),
            ),
        ]);
        let shape = vec![self.weights.len()];
        let views = NAMES.iter().zip(&bytes).map(|(name, bytes)| {
            let view = TensorView::new(Dtype::F32, shape.clone(), bytes).expect("four bytes a number");
            (*name, view)
        });
        let file = safetensors::serialize(views, Some(about))
            .map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))?;
        AtomicFile::write(path, &file)
    }

    /// The state of a file, if there is one.
    ///
    /// # Errors
    /// If it is damaged, or of another origin.
    pub(crate) fn read(path: &Path, origin: &str, weights: usize) -> Result<Option<Self>> {
        if !path.exists() {
            return Ok(None);
        }
        let hint = "remove it to train from the beginning, or give another --out";
        let fault = |what: &str| Error::table(path, None, what, hint);
        let file = read_at_most(path, LONGEST, "a state of learning")?;
        let damaged = || fault("this state of learning is damaged");
        let (_, about) = SafeTensors::read_metadata(&file).map_err(|_| damaged())?;
        let about = about.metadata().clone().ok_or_else(damaged)?;
        if about.get("origin").map(String::as_str) != Some(origin) {
            return Err(fault(
                "this is the state of another training: of other photographs, steps, pieces or another seed",
            ));
        }
        let tensors = SafeTensors::deserialize(&file).map_err(|_| damaged())?;
        let step: u64 = about.get("step").and_then(|s| s.parse().ok()).ok_or_else(damaged)?;
        let loss: f64 = about.get("loss").and_then(|s| s.parse().ok()).ok_or_else(damaged)?;
        let mut parts = Vec::new();
        for name in NAMES {
            let tensor = tensors.tensor(name).map_err(|_| damaged())?;
            if tensor.dtype() != Dtype::F32 || tensor.shape() != [weights] {
                return Err(damaged());
            }
            parts.push(tensor.data());
        }
        if about.get("sha256") != Some(&digest(&parts, origin, step)) {
            return Err(damaged());
        }
        let numbers = |k: usize| parts[k].as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        Ok(Some(Self {
            step,
            loss,
            weights: numbers(0),
            adam: Adam {
                first: numbers(1),
                second: numbers(2),
            },
        }))
    }
}

fn digest(parts: &[&[u8]], origin: &str, step: u64) -> String {
    let mut hasher = Sha256::new();
    parts.iter().for_each(|p| hasher.update(p));
    hasher.update(origin);
    hasher.update(step.to_le_bytes());
    hex(&hasher.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_comes_back_and_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        assert_eq!(Checkpoint::read(&path, "o", 5).unwrap(), None);
        let mut state = Checkpoint::begin(vec![1.0, 2.0, 3.0, -4.0, 0.1]);
        state.step = 7;
        state.loss = 0.1 + 0.2;
        state.adam.second[3] = 5.5;
        state.write(&path, "o").unwrap();
        assert_eq!(Checkpoint::read(&path, "o", 5).unwrap(), Some(state));
        assert_eq!(Checkpoint::read(&path, "p", 5).unwrap_err().id(), "table/malformed");
        let whole = std::fs::read(&path).unwrap();
        for k in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[k] ^= 1;
            std::fs::write(&path, bytes).unwrap();
            // The mean loss and spaces of the header decide nothing.
            if let Ok(Some(found)) = Checkpoint::read(&path, "o", 5) {
                assert!(
                    found.weights == [1.0, 2.0, 3.0, -4.0, 0.1] && found.step == 7,
                    "byte {k}"
                );
            }
        }
    }
}
