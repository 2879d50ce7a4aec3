//! Kernels and stray light that are kept on the disk between runs, by the digests of all that they follow from.
//!
//! The content of a kept file ([`metalith_cell::cache_file`]) is JSON of what is small, its length before it (u32), and the
//! numbers (f32), all little-endian.

use std::io::Read;
use std::path::Path;

use metalith_cell::cache_file::{self, CacheFileWriter};
use metalith_core::{Error, Result};
use metalith_design::array::Symmetry;
use serde::{Deserialize, Serialize};

use crate::kernels::{BankSpec, DistinctKernels, KernelBank, MOST_BYTES};
use crate::layout::PillarCount;
use crate::stray_light::{LightShares, SCENE_CELLS, StrayLight};

const BANK_MAGIC: [u8; 8] = *b"MLKERN\0\x03";
const STRAY_LIGHT_MAGIC: [u8; 8] = *b"MLVEIL\0\x06";
const PILLARS_MAGIC: [u8; 8] = *b"MLPILL\0\x01";
/// Longest kept file (bytes): the numbers, and some megabytes for what is said of them, a few bytes for each place and element.
const LONGEST: u64 = MOST_BYTES + (64 << 20);

#[derive(Serialize, Deserialize)]
struct BankHead {
    spec: BankSpec,
    channel_um: Vec<f64>,
    bases: usize,
    /// Distinct element, and the place of the symmetry in the list of all.
    elements: Vec<(usize, usize)>,
    distinct: Vec<DistinctHead>,
}

#[derive(Serialize, Deserialize)]
struct DistinctHead {
    nodes: Vec<(usize, usize)>,
    /// Numbers of its kernels.
    values: usize,
    /// Numbers of its shares in windows.
    shares: usize,
}

#[derive(Serialize, Deserialize)]
struct StrayLightHead {
    cells: [usize; 2],
    channels: usize,
    bases: usize,
    budget: Vec<LightShares>,
}

fn place(turn: Symmetry) -> usize {
    Symmetry::ALL.iter().position(|s| *s == turn).expect("all are there")
}

pub(crate) fn file_of(folder: &Path, kind: &str, inputs: &[u8]) -> std::path::PathBuf {
    folder.join(format!("{kind}-{}.bin", cache_file::name_of(inputs)))
}

/// Numbers that are written or read at once: a bank of half a gigabyte is held once, not beside the bytes of its file.
const PIECE: usize = 1 << 14;

/// Write a kept file: what is small, and the numbers.
///
/// # Errors
/// If it cannot be written.
pub(crate) fn write(
    file: &Path,
    magic: [u8; 8],
    inputs: &[u8],
    head: &impl Serialize,
    numbers: &[&[f32]],
) -> Result<()> {
    let head = serde_json::to_vec(head)
        .map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))?;
    let mut kept = CacheFileWriter::create(file, magic, inputs)?;
    kept.add(&(head.len() as u32).to_le_bytes())?;
    kept.add(&head)?;
    let mut bytes = Vec::with_capacity(4 * PIECE);
    for piece in numbers.iter().flat_map(|n| n.chunks(PIECE)) {
        bytes.clear();
        bytes.extend(piece.iter().flat_map(|value| value.to_le_bytes()));
        kept.add(&bytes)?;
    }
    kept.finish()
}

/// Content of a kept file that is read from its beginning.
pub(crate) struct Content<'a> {
    from: &'a mut dyn Read,
    /// Bytes that are left: no length in the content is taken for more.
    left: u64,
}

impl Content<'_> {
    fn bytes(&mut self, length: u64) -> Option<Vec<u8>> {
        self.left = self.left.checked_sub(length)?;
        let mut bytes = vec![0; length as usize];
        self.from.read_exact(&mut bytes).ok()?;
        Some(bytes)
    }

    pub(crate) fn head<H: for<'de> Deserialize<'de>>(&mut self) -> Option<H> {
        let length = self.bytes(4)?.try_into().ok()?;
        let head = self.bytes(u32::from_le_bytes(length).into())?;
        serde_json::from_slice(&head).ok()
    }

    pub(crate) fn numbers(&mut self, count: usize) -> Option<Vec<f32>> {
        let bytes = u64::try_from(count).ok()?.checked_mul(4)?;
        self.left = self.left.checked_sub(bytes)?;
        let mut numbers = Vec::with_capacity(count);
        let mut piece = vec![0; 4 * PIECE.min(count)];
        while numbers.len() < count {
            let bytes = &mut piece[..4 * PIECE.min(count - numbers.len())];
            self.from.read_exact(bytes).ok()?;
            numbers.extend(bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)));
        }
        Some(numbers)
    }

    fn is_read(&self) -> bool {
        self.left == 0
    }
}

/// Result of decoding the content of a cached file, which must be read to its end; `None` if there is none that can be
/// used.
pub(crate) fn read<T>(
    file: &Path,
    magic: [u8; 8],
    inputs: &[u8],
    decode: impl FnOnce(&mut Content<'_>) -> Option<T>,
) -> Option<T> {
    cache_file::read_by(file, magic, inputs, LONGEST, |from, left| {
        let mut content = Content { from, left };
        let found = decode(&mut content)?;
        content.is_read().then_some(found)
    })
    .ok()?
}

/// The bank that was kept for these inputs in a folder; none if there is none that can be used.
pub(crate) fn cached_bank(folder: &Path, inputs: &[u8]) -> Option<KernelBank> {
    read(&file_of(folder, "kernels", inputs), BANK_MAGIC, inputs, |content| {
        let head: BankHead = content.head()?;
        let turn = |(of, place): &(usize, usize)| Some((*of, *Symmetry::ALL.get(*place)?));
        let mut distinct = Vec::new();
        for one in &head.distinct {
            distinct.push(DistinctKernels {
                nodes: one.nodes.iter().map(turn).collect::<Option<_>>()?,
                values: content.numbers(one.values)?,
                in_window: content.numbers(one.shares)?,
            });
        }
        Some(KernelBank {
            spec: head.spec,
            channel_um: head.channel_um,
            bases: head.bases,
            elements: head.elements.iter().map(turn).collect::<Option<_>>()?,
            distinct,
        })
    })
}

/// Keep a bank.
///
/// # Errors
/// If it cannot be written.
pub(crate) fn cache_bank(folder: &Path, inputs: &[u8], bank: &KernelBank) -> Result<()> {
    let pairs = |all: &[(usize, Symmetry)]| all.iter().map(|(of, turn)| (*of, place(*turn))).collect::<Vec<_>>();
    let head = BankHead {
        spec: bank.spec,
        channel_um: bank.channel_um.clone(),
        bases: bank.bases,
        elements: pairs(&bank.elements),
        distinct: bank
            .distinct
            .iter()
            .map(|d| DistinctHead {
                nodes: pairs(&d.nodes),
                values: d.values.len(),
                shares: d.in_window.len(),
            })
            .collect(),
    };
    let numbers: Vec<&[f32]> = bank
        .distinct
        .iter()
        .flat_map(|d| [&d.values[..], &d.in_window[..]])
        .collect();
    write(&file_of(folder, "kernels", inputs), BANK_MAGIC, inputs, &head, &numbers)
}

/// The stray light that was kept for these inputs in a folder; none if there is none that can be used.
pub(crate) fn cached_stray_light(folder: &Path, inputs: &[u8]) -> Option<StrayLight> {
    read(&file_of(folder, "veil", inputs), STRAY_LIGHT_MAGIC, inputs, |content| {
        let head: StrayLightHead = content.head()?;
        let sizes = [head.cells[0], head.cells[1], head.channels, head.bases];
        let size = sizes.iter().try_fold(SCENE_CELLS.pow(2), |n, m| n.checked_mul(*m))?;
        Some(StrayLight {
            cells: head.cells,
            channels: head.channels,
            bases: head.bases,
            budget: head.budget,
            values: content.numbers(size)?,
        })
    })
}

/// Keep a stray light.
///
/// # Errors
/// If it cannot be written.
pub(crate) fn cache_stray_light(folder: &Path, inputs: &[u8], stray_light: &StrayLight) -> Result<()> {
    let head = StrayLightHead {
        cells: stray_light.cells,
        channels: stray_light.channels,
        bases: stray_light.bases,
        budget: stray_light.budget.clone(),
    };
    write(
        &file_of(folder, "veil", inputs),
        STRAY_LIGHT_MAGIC,
        inputs,
        &head,
        &[&stray_light.values],
    )
}

/// Count of the pillars of a design that a layout has; `None` if it is not cached.
pub(crate) fn cached_pillars(folder: &Path, inputs: &[u8]) -> Option<PillarCount> {
    read(&file_of(folder, "pillars", inputs), PILLARS_MAGIC, inputs, |content| {
        content.head()
    })
}

/// Keep such a count.
///
/// # Errors
/// If it cannot be written.
pub(crate) fn cache_pillars(folder: &Path, inputs: &[u8], pillars: &PillarCount) -> Result<()> {
    write(&file_of(folder, "pillars", inputs), PILLARS_MAGIC, inputs, pillars, &[])
}

#[cfg(test)]
mod tests {
    use super::*;
    use sha2::{Digest, Sha256};

    fn bank() -> KernelBank {
        let spec = BankSpec {
            pixel_um: 2.0,
            window: 4,
            nodes: 1,
            reach_um: 26.0,
            accurate: false,
        };
        let turned = *Symmetry::ALL.last().expect("there are some");
        // More numbers than are written at once.
        let kernels = |first: usize, values: usize| DistinctKernels {
            nodes: vec![(0, turned)],
            values: (first..first + values).map(|i| i as f32 * 0.37).collect(),
            in_window: vec![0.5, first as f32],
        };
        KernelBank {
            spec,
            channel_um: vec![0.45, 0.55],
            bases: 3,
            elements: vec![(0, Symmetry::IDENTITY), (1, turned)],
            distinct: vec![kernels(0, 2 * PIECE + 17), kernels(3, 5)],
        }
    }

    #[test]
    fn what_is_kept_comes_back_and_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let bank = bank();
        assert!(cached_bank(folder.path(), b"inputs").is_none());
        cache_bank(folder.path(), b"inputs", &bank).unwrap();
        let back = cached_bank(folder.path(), b"inputs").unwrap();
        assert_eq!(
            (back.spec, &back.channel_um, back.bases),
            (bank.spec, &bank.channel_um, 3)
        );
        assert_eq!(back.elements, bank.elements);
        for (one, own) in back.distinct.iter().zip(&bank.distinct) {
            assert!(one.nodes == own.nodes && one.values == own.values && one.in_window == own.in_window);
        }
        // The bytes of the format, as they were before they were written piece by piece.
        let file = file_of(folder.path(), "kernels", b"inputs");
        let bytes = std::fs::read(&file).unwrap();
        let (body, digest) = bytes.split_at(bytes.len() - 32);
        assert_eq!(Sha256::digest(body).as_slice(), digest);
        let last: Vec<u8> = [0.5f32, 3.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert!(body.starts_with(&BANK_MAGIC) && body.ends_with(&last));
        let mut damaged = bytes.clone();
        damaged[bytes.len() / 2] ^= 1;
        std::fs::write(&file, damaged).unwrap();
        assert!(cached_bank(folder.path(), b"inputs").is_none());

        let sensor = metalith_sensor::Camera::three_bands(5.86).sensor;
        let mut stray_light = StrayLight::none(&sensor, 1, 1);
        stray_light
            .values
            .iter_mut()
            .enumerate()
            .for_each(|(i, v)| *v = i as f32);
        cache_stray_light(folder.path(), b"inputs", &stray_light).unwrap();
        let back = cached_stray_light(folder.path(), b"inputs").unwrap();
        assert!(back.values == stray_light.values && back.cells == stray_light.cells);
        // A head that speaks of more numbers than there are.
        stray_light.values.pop();
        cache_stray_light(folder.path(), b"inputs", &stray_light).unwrap();
        assert!(cached_stray_light(folder.path(), b"inputs").is_none());

        let pillars = PillarCount {
            pillars: 7,
            why: "3 off the lattice".into(),
            ..PillarCount::default()
        };
        cache_pillars(folder.path(), b"inputs", &pillars).unwrap();
        assert_eq!(cached_pillars(folder.path(), b"inputs"), Some(pillars));
        assert_eq!(cached_pillars(folder.path(), b"others"), None);
    }
}
