//! Transmissions of pillars over width and wavelength.

use metalith_cell::cache_file;
use metalith_optics::lagrange;
use num_complex::Complex64;

/// Version of the cached file.
const MAGIC: [u8; 8] = *b"MLETCH\0\x01";

/// Transmission over wavelength and width.
#[derive(Clone, Debug)]
pub struct PillarTable {
    pub first_nm: f64,
    pub step_nm: f64,
    /// Transmissions of all widths, for each wavelength.
    pub t: Vec<Vec<Complex64>>,
    /// Transmission of a site without a pillar, for each wavelength.
    pub bare: Vec<Complex64>,
}

impl PillarTable {
    /// Transmission of a pillar of any width (nm) at one of the wavelengths, by cubic interpolation; beyond the ends
    /// of the table, the value at the end.
    pub fn at(&self, wavelength: usize, width_nm: f64) -> Complex64 {
        let row = &self.t[wavelength];
        let x = ((width_nm - self.first_nm) / self.step_nm).clamp(0.0, (row.len() - 1) as f64);
        let i = (x.floor() as usize).clamp(1, row.len() - 3);
        let weights = lagrange(x - i as f64);
        row[i - 1..i + 3].iter().zip(weights).map(|(t, w)| t * w).sum()
    }

    /// Every second width of it.
    pub fn thinned(&self) -> Self {
        Self {
            step_nm: 2.0 * self.step_nm,
            t: self
                .t
                .iter()
                .map(|row| row.iter().step_by(2).copied().collect())
                .collect(),
            ..self.clone()
        }
    }

    /// The bytes of the cached file: the inputs, the version of the solver that made it, and a checksum.
    pub fn bytes(&self, solver: u32) -> Vec<u8> {
        let count = self.t.first().map_or(0, Vec::len);
        let inputs = inputs(solver, self.t.len(), count, self.first_nm, self.step_nm);
        let rows = self.t.iter().zip(&self.bare);
        let numbers = rows.flat_map(|(row, bare)| row.iter().chain([bare]));
        let content: Vec<u8> = numbers
            .flat_map(|z| [z.re.to_le_bytes(), z.im.to_le_bytes()])
            .flatten()
            .collect();
        cache_file::seal(MAGIC, &inputs, &content)
    }

    /// Table from the cached bytes, if they hold this number of widths and wavelengths; else `None`.
    pub fn from_bytes(
        bytes: &[u8],
        solver: u32,
        wavelengths: usize,
        count: usize,
        first_nm: f64,
        step_nm: f64,
    ) -> Option<Self> {
        let inputs = inputs(solver, wavelengths, count, first_nm, step_nm);
        let content = cache_file::open(bytes, MAGIC, &inputs).ok()?;
        if content.len() != wavelengths * (count + 1) * 16 {
            return None;
        }
        let numbers: Vec<f64> = content
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")))
            .collect();
        if numbers.iter().any(|n| !n.is_finite()) {
            return None;
        }
        let mut rows = numbers.chunks_exact(2).map(|z| Complex64::new(z[0], z[1]));
        let (mut t, mut bare) = (Vec::new(), Vec::new());
        for _ in 0..wavelengths {
            t.push(rows.by_ref().take(count).collect());
            bare.push(rows.next()?);
        }
        Some(Self {
            first_nm,
            step_nm,
            t,
            bare,
        })
    }
}

/// Inputs of a cached table; the cell itself is in the name of its file.
fn inputs(solver: u32, wavelengths: usize, count: usize, first_nm: f64, step_nm: f64) -> Vec<u8> {
    let mut bytes = solver.to_le_bytes().to_vec();
    for number in [wavelengths as u64, count as u64, first_nm.to_bits(), step_nm.to_bits()] {
        bytes.extend(number.to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> PillarTable {
        let value = |l: usize, k: usize| Complex64::new(l as f64 + 0.25, 0.5 * k as f64);
        PillarTable {
            first_nm: 100.0,
            step_nm: 2.0,
            t: (0..3).map(|l| (0..400).map(|k| value(l, k)).collect()).collect(),
            bare: (0..3).map(|l| value(l, 0)).collect(),
        }
    }

    #[test]
    fn a_kept_table_comes_back() {
        let table = table();
        let back =
            PillarTable::from_bytes(&table.bytes(cache_file::SOLVER), cache_file::SOLVER, 3, 400, 100.0, 2.0).unwrap();
        assert_eq!((back.t, back.bare), (table.t, table.bare));
    }

    /// A page of zeros, which is finite numbers all the same, and a table of other widths.
    #[test]
    fn a_damaged_table_is_made_again() {
        let bytes = table().bytes(cache_file::SOLVER);
        for page in (0..bytes.len()).step_by(4096) {
            let mut damaged = bytes.clone();
            damaged[page..(page + 4096).min(bytes.len())].fill(0);
            assert!(PillarTable::from_bytes(&damaged, cache_file::SOLVER, 3, 400, 100.0, 2.0).is_none());
        }
        assert!(PillarTable::from_bytes(&bytes, cache_file::SOLVER, 3, 400, 102.0, 2.0).is_none());
        assert!(PillarTable::from_bytes(&bytes, cache_file::SOLVER, 2, 400, 100.0, 2.0).is_none());
        assert!(PillarTable::from_bytes(&bytes, cache_file::SOLVER + 1, 3, 400, 100.0, 2.0).is_none());
        assert!(PillarTable::from_bytes(&bytes[..bytes.len() - 1], cache_file::SOLVER, 3, 400, 100.0, 2.0).is_none());
    }
}
