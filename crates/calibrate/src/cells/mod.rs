//! Transmission of etched pillars of any width at the wavelengths of a set.
//!
//! The stated cell is solved with many orders. A change of the pillar (height, index, walls, corners, mask) is
//! solved with fewer, and corrected by their error on the stated pillar that is closest to the changed one.

mod table;
#[cfg(test)]
mod tests;
mod truncation_correction;

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use num_complex::Complex64;
use rayon::prelude::*;
use sha2::{Digest, Sha256};

pub(crate) use table::PillarTable;

use self::truncation_correction::{CorrectedTable, corrected};
use metalith_cell::cache_file;
use metalith_cell::{CellModel, CellStack};
use metalith_core::text::hex;
use metalith_core::{AtomicFile, Memo, Progress, Result};
use metalith_optics::{CellChange, off_cutoff, perturbed, possible_width_nm};
use metalith_rcwa::{Incidence, Orders, Outline, Side, solve};

/// Orders along an axis for the stated cell: errs by about 0.005 rad.
const FINE: usize = 13;

/// Orders along an axis for a changed pillar.
const COARSE: usize = 9;

/// Number of orders for tapered walls, which take six layers and are close to upright ones.
const LEANING: usize = 7;

/// And for pillars with unequal sides, which only synthetic sets contain.
const ANISOTROPIC: usize = 9;

/// Step of the tabulated widths (nm); resonances are a few nanometres wide.
const STEP_NM: f64 = 2.0;

/// Source of the tables.
pub enum CellSource {
    /// The rigorous cell and its changes.
    Rigorous(Box<RigorousCells>),
    /// A model of lower fidelity, which cannot represent changes of the pillar.
    Model(Box<dyn CellModel + Send>),
}

/// Tables of the rigorous cell at the wavelengths of a set, computed on first use.
pub struct RigorousCells {
    stack: CellStack,
    wavelengths_nm: Vec<f64>,
    widths_nm: (f64, f64),
    fine: usize,
    coarse: usize,
    leaning: usize,
    folder: Option<PathBuf>,
    made: Memo<[u64; 6], Arc<PillarTable>>,
}

impl RigorousCells {
    /// Tables of `stack` for widths within a range. They are cached in `folder`, if one is given.
    pub fn new(stack: CellStack, wavelengths_nm: Vec<f64>, widths_nm: (f64, f64), folder: Option<PathBuf>) -> Self {
        Self {
            stack,
            wavelengths_nm,
            widths_nm,
            fine: FINE,
            coarse: COARSE,
            leaning: LEANING,
            folder,
            made: Memo::default(),
        }
    }

    /// These cells with other orders, and no correction for upright pillars: for synthetic sets, which must not share
    /// the truncation error of the fits. Tapered walls take six layers, and fewer orders.
    #[must_use]
    pub fn with_orders(mut self, fine: usize, leaning: usize) -> Self {
        (self.fine, self.coarse, self.leaning) = (fine, fine, leaning);
        self
    }

    /// The table of the changed cell.
    ///
    /// # Errors
    /// If a pillar is impossible (a foot wider than the pitch), or the user stopped it.
    pub fn table(&self, change: &CellChange, progress: &dyn Progress) -> Result<Arc<PillarTable>> {
        let stated = CellChange::default();
        let (alike, coarse) = if change.taper_deg == 0.0 {
            (stated, self.coarse)
        } else {
            let upright = CellChange {
                taper_deg: 0.0,
                ..*change
            };
            (upright, self.leaning)
        };
        if *change == stated || coarse >= self.fine {
            return self.solved(change, self.fine, progress);
        }
        self.cached(change, -(coarse as f64), || {
            self.carried(change, &alike, coarse, progress)
        })
    }

    /// The changed pillars, solved with fewer orders and corrected by `alike`.
    fn carried(
        &self,
        change: &CellChange,
        alike: &CellChange,
        coarse: usize,
        progress: &dyn Progress,
    ) -> Result<PillarTable> {
        let stated = self.table(alike, progress)?;
        let before = self.solved(alike, coarse, progress)?;
        let after = self.solve(change, coarse, progress)?;
        let stack = perturbed(&self.stack, change);
        let orders = Orders::new(self.fine)?;
        let t = (0..self.wavelengths_nm.len())
            .into_par_iter()
            .map(|l| {
                let CorrectedTable { mut t, resonant } = corrected(&stated.t[l], &before.t[l], &after.t[l]);
                progress.check_stopped()?;
                for k in resonant {
                    t[k] = self.solve_one(&stack, l, k, orders)?;
                }
                Ok(t)
            })
            .collect::<Result<Vec<_>>>()?;
        let bare = stated.bare.iter().zip(before.bare.iter().zip(&after.bare));
        Ok(PillarTable {
            bare: bare.map(|(t, (a, b))| t + b - a).collect(),
            t,
            ..(*stated).clone()
        })
    }

    /// Tables for light polarised along x and along y, of pillars that are `nm` wider along x and narrower
    /// along y than drawn.
    ///
    /// # Errors
    /// As [`RigorousCells::table`].
    pub fn anisotropic(&self, nm: f64, progress: &dyn Progress) -> Result<[PillarTable; 2]> {
        let orders = Orders::new(ANISOTROPIC)?;
        let count = self.count();
        let rows: Vec<Vec<[Complex64; 2]>> = self
            .wavelengths_nm
            .par_iter()
            .map(|wavelength_nm| {
                progress.check_stopped()?;
                (0..count)
                    .map(|k| {
                        let um = wavelength_nm * 1e-3;
                        off_cutoff(self.width_nm(k), |width| {
                            let mut layers = self.stack.layers(width, um)?;
                            for layer in &mut layers.layers {
                                layer.outline = Outline::rectangle(width + nm, width - nm);
                            }
                            let jones = solve(&layers, &Incidence::normal(um, Side::Below), orders)?.transmission;
                            Ok([jones[0][0], jones[1][1]])
                        })
                    })
                    .collect()
            })
            .collect::<Result<_>>()?;
        let stated = self.solved(&CellChange::default(), self.fine, progress)?;
        Ok([0, 1].map(|axis| PillarTable {
            t: rows.iter().map(|row| row.iter().map(|t| t[axis]).collect()).collect(),
            ..(*stated).clone()
        }))
    }

    fn solved(&self, change: &CellChange, orders: usize, progress: &dyn Progress) -> Result<Arc<PillarTable>> {
        self.cached(change, orders as f64, || self.solve(change, orders, progress))
    }

    /// A table from the cache, or computed now; `how` is the number of orders, negative where they are few and corrected.
    fn cached(
        &self,
        change: &CellChange,
        how: f64,
        make: impl FnOnce() -> Result<PillarTable>,
    ) -> Result<Arc<PillarTable>> {
        let key = [
            change.height_nm,
            change.index,
            change.taper_deg,
            change.corner_rounding_nm,
            change.residual_mask_nm,
            how,
        ]
        .map(f64::to_bits);
        self.made
            .get_or_make(key, || Ok(Arc::new(self.read_or_made(&key, make)?)))
    }

    /// Table in the cache folder; one that is not there is made and written.
    fn read_or_made(&self, key: &[u64; 6], make: impl FnOnce() -> Result<PillarTable>) -> Result<PillarTable> {
        let path = self
            .folder
            .as_ref()
            .map(|f| f.join(format!("{}.cells", self.digest(key, f64::from_bits(key[5]) < 0.0))));
        let (wavelengths, count) = (self.wavelengths_nm.len(), self.count());
        let solver = cache_file::solver_of(self.stack.shape);
        let load = |path: &std::path::Path| {
            let bytes = fs::read(path).ok()?;
            PillarTable::from_bytes(&bytes, solver, wavelengths, count, self.first_nm(), STEP_NM)
        };
        if let Some(table) = path.as_deref().and_then(load) {
            return Ok(table);
        }
        let table = make()?;
        if let Some(path) = &path {
            // A cache that cannot be written costs time, not correctness.
            let _ = AtomicFile::write(path, &table.bytes(solver));
        }
        Ok(table)
    }

    fn first_nm(&self) -> f64 {
        (self.widths_nm.0 / STEP_NM).floor() * STEP_NM
    }

    /// Width of entry `k`.
    fn width_nm(&self, k: usize) -> f64 {
        self.first_nm() + k as f64 * STEP_NM
    }

    fn count(&self) -> usize {
        ((self.widths_nm.1 - self.first_nm()) / STEP_NM).ceil() as usize + 1
    }

    fn solve(&self, change: &CellChange, orders: usize, progress: &dyn Progress) -> Result<PillarTable> {
        let orders = Orders::new(orders)?;
        let stack = perturbed(&self.stack, change);
        let count = self.count();
        progress.begin("cells as etched", self.wavelengths_nm.len() as u64);
        let rows: Vec<(Vec<Complex64>, Complex64)> = self
            .wavelengths_nm
            .par_iter()
            .enumerate()
            .map(|(l, nm)| {
                progress.check_stopped()?;
                let row = (0..count)
                    .map(|k| self.solve_one(&stack, l, k, orders))
                    .collect::<Result<Vec<_>>>()?;
                let bare = stack.transmission(0.0, nm * 1e-3, orders)?;
                progress.advance(1);
                Ok((row, bare))
            })
            .collect::<Result<_>>()?;
        let (t, bare) = rows.into_iter().unzip();
        Ok(PillarTable {
            first_nm: self.first_nm(),
            step_nm: STEP_NM,
            t,
            bare,
        })
    }

    /// Transmission of entry `k` at wavelength `l`.
    fn solve_one(&self, stack: &CellStack, l: usize, k: usize, orders: Orders) -> Result<Complex64> {
        // Where tapered walls would meet, the widest possible pillar is used instead.
        off_cutoff(possible_width_nm(stack, self.width_nm(k)), |width| {
            stack.transmission(width, self.wavelengths_nm[l] * 1e-3, orders)
        })
    }

    /// The name of a table in the cache, from all of its inputs; one that is carried over from few orders is corrected by those
    /// of stated cells.
    fn digest(&self, key: &[u64; 6], carried: bool) -> String {
        let mut hash = Sha256::new();
        hash.update(env!("CARGO_PKG_VERSION"));
        hash.update(serde_json::to_vec(&self.stack).expect("plain data serialises"));
        if carried {
            hash.update((self.fine as u64).to_le_bytes());
        }
        let numbers = self
            .wavelengths_nm
            .iter()
            .copied()
            .chain([self.first_nm(), STEP_NM, self.count() as f64]);
        for bits in numbers.map(f64::to_bits).chain(key.iter().copied()) {
            hash.update(bits.to_le_bytes());
        }
        // Materials serialise by content; sampled indices make the name depend on tables of the index too.
        for nm in &self.wavelengths_nm {
            let index = self.stack.film.index(nm * 1e-3).unwrap_or_default();
            hash.update(index.re.to_le_bytes());
            hash.update(index.im.to_le_bytes());
        }
        hex(&hash.finalize()[..16])
    }
}

impl CellSource {
    /// The table of the changed cell at `wavelengths_nm`.
    ///
    /// # Errors
    /// As [`RigorousCells::table`]; for a model, if it does not cover a wavelength.
    pub fn table(
        &self,
        change: &CellChange,
        wavelengths_nm: &[f64],
        widths_nm: (f64, f64),
        progress: &dyn Progress,
    ) -> Result<Arc<PillarTable>> {
        match self {
            Self::Rigorous(cells) => cells.table(change, progress),
            Self::Model(model) => {
                let most = widths_nm.1.ceil() as u16 + 1;
                let first = widths_nm.0.floor().max(1.0);
                let t = wavelengths_nm
                    .iter()
                    .map(|nm| {
                        let row = model.transmissions(nm * 1e-3, most)?;
                        Ok(row[first as usize..].to_vec())
                    })
                    .collect::<Result<Vec<_>>>()?;
                Ok(Arc::new(PillarTable {
                    first_nm: first,
                    step_nm: 1.0,
                    bare: vec![Complex64::new(1.0, 0.0); t.len()],
                    t,
                }))
            }
        }
    }
}
