//! Transmissions of pillars over width and wavelength.

use metalith_made::lagrange;
use num_complex::Complex64;

/// Transmission over wavelength and width.
#[derive(Clone, Debug)]
pub struct PillarTable {
    pub first_nm: f64,
    pub step_nm: f64,
    /// For each wavelength, the transmissions of all widths.
    pub t: Vec<Vec<Complex64>>,
    /// For each wavelength, that of a site without pillar.
    pub bare: Vec<Complex64>,
}

impl PillarTable {
    /// Transmission of a pillar of any width [nm] at one of the wavelengths, by cubics through the table; beyond
    /// its ends, that of the end.
    pub fn at(&self, wavelength: usize, width_nm: f64) -> Complex64 {
        let row = &self.t[wavelength];
        let x = ((width_nm - self.first_nm) / self.step_nm).clamp(0.0, (row.len() - 1) as f64);
        let i = (x.floor() as usize).clamp(1, row.len() - 3);
        let weights = lagrange(x - i as f64);
        row[i - 1..i + 3].iter().zip(weights).map(|(t, w)| t * w).sum()
    }

    /// As it is kept on disk.
    pub fn bytes(&self) -> Vec<u8> {
        let rows = self.t.iter().zip(&self.bare);
        let numbers = rows.flat_map(|(row, bare)| row.iter().chain([bare]));
        numbers
            .flat_map(|z| [z.re.to_le_bytes(), z.im.to_le_bytes()])
            .flatten()
            .collect()
    }

    /// From what was kept: so many widths from the first on, at so many wavelengths; nothing if it is not that.
    pub fn from_bytes(bytes: &[u8], wavelengths: usize, count: usize, first_nm: f64, step_nm: f64) -> Option<Self> {
        if bytes.len() != wavelengths * (count + 1) * 16 {
            return None;
        }
        let numbers: Vec<f64> = bytes
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
