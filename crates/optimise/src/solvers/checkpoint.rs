//! Checkpoint of an interrupted optimisation.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::rings::sites::Rings;
use crate::solvers::adam::Adam;
use metalith_cell::{Fidelity, cache_file};
use metalith_core::text::hex;
use metalith_core::{Error, Result};
use metalith_design::Design;
use metalith_design::array::PillarRule;

/// Magic number of the file.
const MAGIC: [u8; 8] = *b"MLOPTI\0\x01";

/// Raised whenever the optimiser goes another way from the same state.
const OPTIMISER: u32 = 1;

/// Longest checkpoint that is read (bytes): the largest lens has a million rings of 20 digits, for each chain.
const LONGEST: u64 = 1 << 30;

/// The state of every chain, so that going on gives the same result as never having stopped.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Digest of the design and its cell: a checkpoint of another is of no use.
    pub digest: String,
    /// Chains of the exchange, if that was begun.
    pub chains: Vec<Chain>,
    /// Adam, if that was begun.
    pub adam: Option<AdamState>,
    /// Version of the solver of the cells: an input of the file.
    #[serde(skip)]
    pub solver: u32,
}

/// One exchange.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chain {
    pub sweep: u32,
    pub waves: ExactNumbers,
    /// Blocks, if its sweeps are done.
    pub blocks: Option<BlockState>,
}

/// An exchange of blocks between two of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BlockState {
    pub block: u32,
    pub shares: ExactNumbers,
}

/// Numbers kept to the last bit, as the text of a decimal fraction need not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ExactNumbers(Vec<u64>);

impl ExactNumbers {
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
    pub waves: ExactNumbers,
    pub mean: ExactNumbers,
    pub square: ExactNumbers,
}

impl AdamState {
    pub fn of(adam: &Adam) -> Self {
        let (mean, square) = adam.means();
        Self {
            step: adam.step(),
            waves: ExactNumbers::of(adam.waves()),
            mean: ExactNumbers::of(mean),
            square: ExactNumbers::of(square),
        }
    }

    /// Take Adam to this state, if it is of as many rings.
    pub fn resume(&self, adam: Adam) -> Adam {
        let (waves, mean, square) = (self.waves.values(), self.mean.values(), self.square.values());
        let rings = adam.waves().len();
        if [waves.len(), mean.len(), square.len()] != [rings; 3] {
            return adam;
        }
        adam.resume(self.step, waves, mean, square)
    }
}

impl Checkpoint {
    /// The checkpoint of a design before anything is done.
    pub fn begin(design: &Design) -> Self {
        Self {
            digest: digest(design),
            solver: cache_file::solver_of(design.cell.shape),
            ..Self::default()
        }
    }

    /// The checkpoint in a file if it is whole and one of this design and this optimiser, else a new one.
    ///
    /// # Errors
    /// If the file is there but cannot be read.
    pub fn load(path: &Path, design: &Design) -> Result<Self> {
        let fresh = Self::begin(design);
        if let Err(error) = std::fs::metadata(path)
            && error.kind() != std::io::ErrorKind::NotFound
        {
            return Err(Error::io("read", path)(error));
        }
        // One that cannot be used costs time, and the next save replaces it.
        let Ok(Some(content)) = cache_file::read(path, MAGIC, &fresh.inputs(), LONGEST) else {
            return Ok(fresh);
        };
        let rings = Rings::new(design.lattice(), design.lens.diameter_nm)?.len();
        let read = serde_json::from_slice::<Self>(&content).ok();
        Ok(read
            .filter(|kept| kept.digest == fresh.digest && kept.is_of(rings))
            .map(|kept| Self {
                solver: fresh.solver,
                ..kept
            })
            .unwrap_or(fresh))
    }

    /// Bytes of the inputs that it was made from.
    fn inputs(&self) -> Vec<u8> {
        let mut bytes = OPTIMISER.to_le_bytes().to_vec();
        bytes.extend(self.solver.to_le_bytes());
        bytes.extend(self.digest.as_bytes());
        bytes
    }

    /// True if every chain and Adam have a finite number for each of so many rings.
    fn is_of(&self, rings: usize) -> bool {
        let fits = |numbers: &ExactNumbers| numbers.0.len() == rings && numbers.values().iter().all(|v| v.is_finite());
        let adam = self.adam.iter().flat_map(|a| [&a.waves, &a.mean, &a.square]);
        self.chains.iter().map(|chain| &chain.waves).chain(adam).all(fits)
    }

    /// True if anything was done.
    pub fn begun(&self) -> bool {
        self.adam.is_some() || !self.chains.is_empty()
    }

    /// Keep it in a file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let content = serde_json::to_vec(self).expect("plain data serialises");
        cache_file::write(path, MAGIC, &self.inputs(), &content)
    }
}

/// Digest of all that decides an optimisation.
fn digest(design: &Design) -> String {
    // What tables of materials say, as far as they can be read: the work itself says where not.
    let stack = design.cell_stack().ok();
    let band_um = stack.as_ref().map(|stack| design.band_of(stack));
    let decisive = (
        &design.cell,
        &design.lens,
        &design.mapping,
        &design.optimise,
        stack,
        band_um,
    );
    let mut bytes = serde_json::to_vec(&decisive).expect("plain data serialises");
    if design.optimise.fidelity == Fidelity::Neighbours {
        // Their tables are at these wavelengths, for the widths of all mappings that elements have.
        let tables = (&design.verify.wavelengths_um, PillarRule::all(design).len());
        bytes.extend(serde_json::to_vec(&tables).expect("plain data serialises"));
    }
    hex(&Sha256::digest(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of another length, or with numbers that are none, would be a panic at every start.
    #[test]
    fn a_checkpoint_that_does_not_fit_is_not_taken() {
        let folder = tempfile::tempdir().unwrap();
        let kept = folder.path().join("checkpoint");
        let design = Design::read(&metalith_testing::design("mini_3x3")).unwrap();
        let rings = Rings::new(design.lattice(), design.lens.diameter_nm).unwrap().len();
        let with = |waves: &[f64]| {
            let chain = Chain {
                sweep: 1,
                waves: ExactNumbers::of(waves),
                blocks: None,
            };
            let checkpoint = Checkpoint {
                chains: vec![chain],
                ..Checkpoint::begin(&design)
            };
            checkpoint.save(&kept).unwrap();
            Checkpoint::load(&kept, &design).unwrap().begun()
        };
        assert!(with(&vec![0.5; rings]));
        assert!(!with(&vec![0.5; rings - 1]) && !with(&vec![0.5; rings + 1]) && !with(&[]));
        assert!(!with(&vec![f64::NAN; rings]));
        // Tables of unlike neighbours at other wavelengths are another merit; for others they decide nothing.
        let mut changed = design.clone();
        changed.verify.wavelengths_um.push(0.7);
        assert_eq!(digest(&design), digest(&changed));
        let unlike = [design.clone(), changed].map(|mut design| {
            design.optimise.fidelity = Fidelity::Neighbours;
            digest(&design)
        });
        assert_ne!(unlike[0], unlike[1]);
        // What an earlier release kept.
        std::fs::write(&kept, serde_json::to_vec(&Checkpoint::begin(&design)).unwrap()).unwrap();
        assert!(!Checkpoint::load(&kept, &design).unwrap().begun());
    }
}
