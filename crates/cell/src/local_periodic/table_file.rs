//! Tables of cells in the cache.
//!
//! The content of the file ([`cache_file`]) is, little-endian: the number of columns (u32); for each its width (nm)
//! (u16), the wavelengths solved for it (u32), its error at one held out (f64), its kind (u8), its number of samples (u32) and for each
//! sample wavelength (um), Re t, Im t (f64); of rational functions (kind 1, not 0) also Re and Im of its weight. Its inputs are JSON.

use std::path::Path;

use num_complex::Complex64;

use super::barycentric::Barycentric;
use super::column::{Between, Column};
use super::width_spectrum::WidthSpectrum;
use crate::cache_file;
use metalith_core::Result;

const MAGIC: [u8; 8] = *b"MLCELL\0\x02";

/// Longest file that is read (bytes): ten times the library of the shipped designs at a tenth of its
/// tolerance.
const LONGEST: u64 = 256 << 20;

/// Name of the file for these inputs.
pub(super) fn file_name(inputs: &[u8]) -> String {
    format!("cell-{}.bin", cache_file::name_of(inputs))
}

pub(super) fn write(file: &Path, inputs: &[u8], widths: &[u16], columns: &[Column]) -> Result<()> {
    let mut bytes = Vec::new();
    bytes.extend((columns.len() as u32).to_le_bytes());
    for (width, column) in widths.iter().zip(columns) {
        bytes.extend(width.to_le_bytes());
        bytes.extend(column.solved.to_le_bytes());
        bytes.extend(column.held_out.to_le_bytes());
        let (kind, samples): (u8, Vec<Vec<f64>>) = match &column.between {
            Between::Cubic(spectrum) => {
                let samples = spectrum.wavelengths_um.iter().zip(&spectrum.t);
                (0, samples.map(|(um, t)| vec![*um, t.re, t.im]).collect())
            }
            Between::Rational(function) => {
                let samples = function.nodes.iter().zip(&function.values).zip(&function.weights);
                let numbers = samples.map(|((um, t), w)| vec![*um, t.re, t.im, w.re, w.im]);
                (1, numbers.collect())
            }
        };
        bytes.push(kind);
        bytes.extend((samples.len() as u32).to_le_bytes());
        bytes.extend(samples.concat().iter().flat_map(|value| value.to_le_bytes()));
    }
    cache_file::write(file, MAGIC, inputs, &bytes)
}

/// The columns kept in a file; none if there is no such file, a reason if it cannot be trusted.
pub(super) fn read(file: &Path, inputs: &[u8], widths: &[u16]) -> std::result::Result<Option<Vec<Column>>, String> {
    let Some(content) = cache_file::read(file, MAGIC, inputs, LONGEST)? else {
        return Ok(None);
    };
    let columns = Reader(&content).columns(widths);
    columns.map(Some).ok_or_else(|| "it holds other columns".into())
}

/// Bytes that have not been read yet.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(count)?;
        self.0 = tail;
        Some(head)
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    fn f64(&mut self) -> Option<f64> {
        let value = f64::from_le_bytes(self.take(8)?.try_into().ok()?);
        value.is_finite().then_some(value)
    }

    fn columns(&mut self, widths: &[u16]) -> Option<Vec<Column>> {
        if self.u32()? as usize != widths.len() {
            return None;
        }
        let columns = widths
            .iter()
            .map(|width| {
                if self.take(2)? != width.to_le_bytes() {
                    return None;
                }
                let (solved, held_out) = (self.u32()?, self.f64()?);
                let between = self.between()?;
                Some(Column {
                    between,
                    solved,
                    held_out,
                })
            })
            .collect::<Option<Vec<_>>>()?;
        self.0.is_empty().then_some(columns)
    }

    fn between(&mut self) -> Option<Between> {
        let is_rational = match self.take(1)? {
            [0] => false,
            [1] => true,
            _ => return None,
        };
        let samples = self.u32()? as usize;
        let numbers = if is_rational { 5 } else { 3 };
        // Before memory is set aside, the samples must be there.
        if samples == 0 || self.0.len() / (8 * numbers) < samples {
            return None;
        }
        let (mut wavelengths_um, mut t, mut weights) =
            (Vec::with_capacity(samples), Vec::with_capacity(samples), Vec::new());
        for _ in 0..samples {
            wavelengths_um.push(self.f64()?);
            t.push(Complex64::new(self.f64()?, self.f64()?));
            if is_rational {
                weights.push(Complex64::new(self.f64()?, self.f64()?));
            }
        }
        if is_rational {
            return Some(Between::Rational(Barycentric {
                nodes: wavelengths_um,
                values: t,
                weights,
            }));
        }
        let rises = wavelengths_um.is_sorted_by(|a, b| a < b);
        rises.then_some(Between::Cubic(WidthSpectrum { wavelengths_um, t }))
    }
}
