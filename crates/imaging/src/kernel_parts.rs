//! Parts of a bank of kernels that are kept on the disk while the others are still simulated.
//!
//! Each part is a file of the cache with the inputs of the bank: the kernels of some nodes. They are removed when the whole bank
//! is kept.

use std::path::{Path, PathBuf};

use metalith_core::{Progress, Result};
use serde::{Deserialize, Serialize};

use crate::cache_file::{file_of, read, write};
use crate::kernel_cache::KernelCache;
use crate::kernels::{BankSpec, NodeKernels};

const PART_MAGIC: [u8; 8] = *b"MLKPRT\0\x02";
/// Kind of the files, which begins their names.
const KIND: &str = "kernels-part";

/// Node of a bank: distinct element, and unique node of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct NodeId {
    pub(crate) element: usize,
    pub(crate) node: usize,
}

/// Place of the parts of a bank, if there is one.
pub(crate) struct KernelParts<'a> {
    bank: Option<PlannedBank<'a>>,
}

/// Bank whose parts are kept.
struct PlannedBank<'a> {
    cache: &'a KernelCache,
    inputs: &'a [u8],
    camera: &'a str,
}

#[derive(Serialize, Deserialize)]
struct PartHead {
    spec: BankSpec,
    nodes: Vec<NodeId>,
    /// Numbers of the kernels of a node, and of its shares in windows.
    sizes: [usize; 2],
}

impl<'a> KernelParts<'a> {
    /// Parts of the bank for a camera, by its inputs.
    pub(crate) fn of(cache: &'a KernelCache, inputs: &'a [u8], camera: &'a str) -> Self {
        Self {
            bank: Some(PlannedBank { cache, inputs, camera }).filter(|bank| bank.cache.folder.is_some()),
        }
    }

    /// No parts: nothing is stored.
    pub(crate) fn none() -> Self {
        Self { bank: None }
    }

    /// Name of the camera whose kernels are stored; none if they are not.
    pub(crate) fn camera(&self) -> Option<&str> {
        self.bank.as_ref().map(|bank| bank.camera)
    }

    /// Kernels of all parts that can be used.
    pub(crate) fn read(&self, spec: &BankSpec) -> Vec<(NodeId, NodeKernels)> {
        let Some(bank) = &self.bank else { return Vec::new() };
        let parts = self.files().into_iter().filter_map(|file| {
            read(&file, PART_MAGIC, bank.inputs, |content| {
                let head: PartHead = content.head()?;
                let [values, in_window] = head.sizes;
                let mut nodes = Vec::new();
                for id in head.nodes {
                    let kernels = NodeKernels {
                        values: content.numbers(values)?,
                        in_window: content.numbers(in_window)?,
                    };
                    nodes.push((id, kernels));
                }
                Some((head.spec, nodes))
            })
        });
        parts
            .filter(|(of, _)| of == spec)
            .flat_map(|(_, nodes)| nodes)
            .collect()
    }

    /// Store the kernels of some nodes as one more part.
    ///
    /// # Errors
    /// If they cannot be stored in a folder that was asked for.
    pub(crate) fn store(
        &self,
        spec: &BankSpec,
        nodes: &[(NodeId, &NodeKernels)],
        progress: &dyn Progress,
    ) -> Result<()> {
        let (Some(bank), Some((first, kernels))) = (&self.bank, nodes.first()) else {
            return Ok(());
        };
        let head = PartHead {
            spec: *spec,
            nodes: nodes.iter().map(|(id, _)| *id).collect(),
            sizes: [kernels.values.len(), kernels.in_window.len()],
        };
        let numbers: Vec<&[f32]> = nodes
            .iter()
            .flat_map(|(_, kernels)| [&kernels.values[..], &kernels.in_window[..]])
            .collect();
        // Nodes are found once, so that the first one of a part names it.
        let name = |folder: &Path| {
            let whole = file_of(folder, KIND, bank.inputs);
            whole.with_extension(format!("{}-{}.bin", first.element, first.node))
        };
        let write = |folder: &Path| write(&name(folder), PART_MAGIC, bank.inputs, &head, &numbers);
        bank.cache.keep("the kernels found so far are", write, progress)
    }

    /// Remove all parts: the whole bank is kept.
    pub(crate) fn remove(&self) {
        for file in self.files() {
            // One that stays takes space and does no harm.
            let _ = std::fs::remove_file(file);
        }
    }

    /// The files of all parts that are there.
    fn files(&self) -> Vec<PathBuf> {
        let Some((bank, folder)) = self.bank.as_ref().and_then(|b| Some((b, b.cache.folder.as_deref()?))) else {
            return Vec::new();
        };
        let whole = file_of(folder, KIND, bank.inputs);
        let begin = format!("{}.", whole.file_stem().unwrap_or_default().to_string_lossy());
        let is_part = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with(&begin) && name.ends_with(".bin")
        };
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
            .into_iter()
            .flatten()
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(is_part)
            .collect();
        files.sort();
        files
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use metalith_core::Silent;
    use metalith_design::{Design, cell_models};
    use metalith_layout::read_pillars;
    use metalith_optics::SimulationCase;
    use metalith_sensor::{Camera, Channel, Response};

    use super::*;
    use crate::chip::ChipInLight;
    use crate::kernels::KernelBank;
    use crate::spectra::rgb_basis;

    /// Counts steps, and wants to stop after some.
    struct Steps {
        done: AtomicU64,
        most: u64,
    }

    impl Steps {
        fn at_most(most: u64) -> Self {
            Self {
                done: AtomicU64::new(0),
                most,
            }
        }
    }

    impl Progress for Steps {
        fn begin(&self, _what: &str, _steps: u64) {
            self.done.store(0, Ordering::Relaxed);
        }

        fn advance(&self, steps: u64) {
            self.done.fetch_add(steps, Ordering::Relaxed);
        }

        fn stopped(&self) -> bool {
            self.done.load(Ordering::Relaxed) >= self.most
        }
    }

    /// A bank that was interrupted once has the numbers of one that was not, and what was found is not found again.
    #[test]
    fn an_interrupted_bank_goes_on_with_the_same_numbers() {
        let design = Design::read("../../designs/mini_3x3.toml".as_ref()).unwrap();
        let (design, _, layout) = metalith_testing::layouts::written(design);
        let extraction = read_pillars(&design, &layout.path().join("lens.gds"), &Silent).unwrap();
        let cells = cell_models(&design, &[design.verify.fidelity]).unwrap();
        let mut camera = Camera::three_bands(2.0);
        camera.channels = vec![Channel {
            name: "green".into(),
            response: Response::Band {
                band_nm: [530.0, 540.0],
                efficiency: 1.0,
            },
        }];
        let case = SimulationCase::from(cells[0].as_ref());
        let chip = ChipInLight::new(&design, &extraction, case, &camera, f64::INFINITY, &Silent).unwrap();
        let spec = BankSpec {
            pixel_um: 2.0,
            window: 8,
            nodes: 5,
            reach_um: 20.0,
            accurate: false,
        };
        let whole = KernelBank::build(&chip, rgb_basis(), spec, &Silent).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let cache = KernelCache::made(folder.path());
        let parts = KernelParts::of(&cache, b"inputs", "camera");
        let build = |steps: &Steps| KernelBank::build_in_parts(&chip, rgb_basis(), spec, &parts, steps);
        let all = Steps::at_most(u64::MAX);
        KernelBank::build_in_parts(&chip, rgb_basis(), spec, &KernelParts::none(), &all).unwrap();
        let all = all.done.into_inner();
        assert_eq!(build(&Steps::at_most(all / 2)).unwrap_err().id(), "run/interrupted");
        let found = parts.read(&spec).len() as u64;
        assert!(found > 0 && parts.files().len() == 1, "{found}");
        // Parts are of one bank and one specification.
        assert!(KernelParts::of(&cache, b"others", "camera").read(&spec).is_empty());
        assert!(parts.read(&BankSpec { nodes: 7, ..spec }).is_empty());
        let rest = Steps::at_most(u64::MAX);
        let again = build(&rest).unwrap();
        let wavelengths = chip.sampling.wavelengths_nm.len() as u64;
        assert_eq!(rest.done.into_inner(), all - found * wavelengths);
        for (one, own) in again.distinct.iter().zip(&whole.distinct) {
            assert!(one.nodes == own.nodes && one.values == own.values && one.in_window == own.in_window);
        }
        // A damaged part is of no use and does no harm.
        let part = &parts.files()[0];
        let mut bytes = std::fs::read(part).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        std::fs::write(part, bytes).unwrap();
        assert!(parts.read(&spec).is_empty());
        parts.remove();
        assert!(parts.files().is_empty());
    }
}
