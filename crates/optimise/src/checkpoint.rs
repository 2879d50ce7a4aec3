//! What is kept of an interrupted optimisation.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::adam::Adam;
use metalith_core::{Error, Result, WholeFile};
use metalith_design::Design;

/// The state of every chain, so that going on gives the same result as never having stopped.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Of the design and its cell: a checkpoint of another is of no use.
    pub digest: String,
    /// Chains of the exchange, if that was begun.
    pub chains: Vec<Chain>,
    /// Adam, if that was begun.
    pub adam: Option<AdamState>,
}

/// One exchange.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chain {
    pub sweep: u32,
    pub turns: Numbers,
    /// Its blocks, if its sweeps are done.
    pub blocks: Option<BlockState>,
}

/// An exchange of blocks between two of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BlockState {
    pub block: u32,
    pub shares: Numbers,
}

/// Numbers kept to the last bit, as the text of a decimal fraction need not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Numbers(Vec<u64>);

impl Numbers {
    pub fn of(values: &[f64]) -> Self {
        Self(values.iter().map(|v| v.to_bits()).collect())
    }

    pub fn values(&self) -> Vec<f64> {
        self.0.iter().map(|&b| f64::from_bits(b)).collect()
    }
}

/// Adam between two steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdamState {
    pub step: u32,
    pub turns: Numbers,
    pub mean: Numbers,
    pub square: Numbers,
}

impl AdamState {
    pub fn of(adam: &Adam) -> Self {
        let (mean, square) = adam.means();
        Self {
            step: adam.step(),
            turns: Numbers::of(adam.turns()),
            mean: Numbers::of(mean),
            square: Numbers::of(square),
        }
    }

    /// Take Adam to this state, if it is of as many rings.
    pub fn resume(&self, adam: Adam) -> Adam {
        let (turns, mean, square) = (self.turns.values(), self.mean.values(), self.square.values());
        let rings = adam.turns().len();
        if [turns.len(), mean.len(), square.len()] != [rings; 3] {
            return adam;
        }
        adam.resume(self.step, turns, mean, square)
    }
}

impl Checkpoint {
    /// The checkpoint of a design before anything is done.
    pub fn begin(design: &Design) -> Self {
        Self {
            digest: digest(design),
            ..Self::default()
        }
    }

    /// The checkpoint in a file if it is one of this design, else a new one.
    ///
    /// # Errors
    /// If the file is there but cannot be read.
    pub fn load(path: &Path, design: &Design) -> Result<Self> {
        let fresh = Self::begin(design);
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(fresh),
            Err(e) => return Err(Error::io("read", path)(e)),
        };
        let kept = serde_json::from_slice::<Self>(&bytes).unwrap_or_else(|_| fresh.clone());
        Ok(if kept.digest == fresh.digest { kept } else { fresh })
    }

    /// Whether anything was done.
    pub fn begun(&self) -> bool {
        self.adam.is_some() || !self.chains.is_empty()
    }

    /// Keep it in a file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        WholeFile::write(path, &serde_json::to_vec(self).expect("plain data serialises"))
    }
}

/// Of all that decides an optimisation.
fn digest(design: &Design) -> String {
    let decisive = (&design.cell, &design.lens, &design.mapping, &design.optimise);
    let bytes = serde_json::to_vec(&decisive).expect("plain data serialises");
    Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect()
}
