//! Kernels and veils that are kept on the disk between runs, by the digests of all that they follow from.
//!
//! The content of a kept file ([`metalith_cell::kept`]) is JSON of what is small, its length before it (u32), and the
//! numbers (f32), all little-endian.

use std::path::Path;

use metalith_cell::kept;
use metalith_core::{Error, Result};
use metalith_design::array::Symmetry;
use serde::{Deserialize, Serialize};

use crate::kernels::{BankSpec, DistinctKernels, KernelBank};
use crate::veil::{LightShares, Veil};

const BANK_MAGIC: [u8; 8] = *b"MLKERN\0\x02";
const VEIL_MAGIC: [u8; 8] = *b"MLVEIL\0\x04";
/// Longest kept file (bytes).
const LONGEST: u64 = 4 << 30;

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
struct VeilHead {
    cells: [usize; 2],
    channels: usize,
    bases: usize,
    budget: Vec<LightShares>,
}

fn place(turn: Symmetry) -> usize {
    Symmetry::ALL.iter().position(|s| *s == turn).expect("all are there")
}

fn file_of(folder: &Path, kind: &str, inputs: &[u8]) -> std::path::PathBuf {
    folder.join(format!("{kind}-{}.bin", kept::name_of(inputs)))
}

fn write(file: &Path, magic: [u8; 8], inputs: &[u8], head: &impl Serialize, numbers: &[&[f32]]) -> Result<()> {
    let head = serde_json::to_vec(head).map_err(|e| Error::invalid(e.to_string(), "report this"))?;
    let mut content = Vec::with_capacity(4 + head.len() + 4 * numbers.iter().map(|n| n.len()).sum::<usize>());
    content.extend((head.len() as u32).to_le_bytes());
    content.extend(head);
    for value in numbers.iter().flat_map(|n| n.iter()) {
        content.extend(value.to_le_bytes());
    }
    kept::write(file, magic, inputs, &content)
}

fn read<H: for<'de> Deserialize<'de>>(file: &Path, magic: [u8; 8], inputs: &[u8]) -> Option<(H, Vec<f32>)> {
    let content = kept::read(file, magic, inputs, LONGEST).ok()??;
    let (length, rest) = content.split_first_chunk()?;
    let (head, numbers) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    let head = serde_json::from_slice(head).ok()?;
    let numbers = numbers.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b));
    Some((head, numbers.collect()))
}

/// The bank that was kept for these inputs in a folder; none if there is none that can be used.
pub fn kept_bank(folder: &Path, inputs: &[u8]) -> Option<KernelBank> {
    let (head, numbers): (BankHead, _) = read(&file_of(folder, "kernels", inputs), BANK_MAGIC, inputs)?;
    let turn = |(of, place): &(usize, usize)| Some((*of, *Symmetry::ALL.get(*place)?));
    let mut rest = &numbers[..];
    let mut distinct = Vec::new();
    for one in &head.distinct {
        let (own, later) = rest.split_at_checked(one.values)?;
        let (in_window, later) = later.split_at_checked(one.shares)?;
        rest = later;
        distinct.push(DistinctKernels {
            nodes: one.nodes.iter().map(turn).collect::<Option<_>>()?,
            values: own.to_vec(),
            in_window: in_window.to_vec(),
        });
    }
    Some(KernelBank {
        spec: head.spec,
        channel_um: head.channel_um,
        bases: head.bases,
        elements: head.elements.iter().map(turn).collect::<Option<_>>()?,
        distinct,
    })
}

/// Keep a bank.
///
/// # Errors
/// If it cannot be written.
pub fn keep_bank(folder: &Path, inputs: &[u8], bank: &KernelBank) -> Result<()> {
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

/// The veil that was kept for these inputs in a folder; none if there is none that can be used.
pub fn kept_veil(folder: &Path, inputs: &[u8]) -> Option<Veil> {
    let (head, values): (VeilHead, Vec<f32>) = read(&file_of(folder, "veil", inputs), VEIL_MAGIC, inputs)?;
    let size = crate::veil::SCENE_CELLS.pow(2) * head.cells[0] * head.cells[1] * head.channels * head.bases;
    (values.len() == size).then_some(Veil {
        cells: head.cells,
        channels: head.channels,
        bases: head.bases,
        budget: head.budget,
        values,
    })
}

/// Keep a veil.
///
/// # Errors
/// If it cannot be written.
pub fn keep_veil(folder: &Path, inputs: &[u8], veil: &Veil) -> Result<()> {
    let head = VeilHead {
        cells: veil.cells,
        channels: veil.channels,
        bases: veil.bases,
        budget: veil.budget.clone(),
    };
    write(
        &file_of(folder, "veil", inputs),
        VEIL_MAGIC,
        inputs,
        &head,
        &[&veil.values],
    )
}
