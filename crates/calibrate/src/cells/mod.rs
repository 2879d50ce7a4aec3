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

/// And for those of them that are near narrow resonances, which the stated cell does not correct.
const LEANING_RESONANT: usize = FINE;

/// And for pillars with unequal sides, which only synthetic sets contain.
const ANISOTROPIC: usize = 9;

/// Name of the work on tables, in progress.
pub(crate) const TABLE: &str = "cells as etched";

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
        match self.carried_by(change) {
            None => self.solved(change, self.fine, progress),
            Some((alike, coarse)) => self.cached(change, -(coarse as f64), || {
                let mut carried = self.carried(&[*change], &alike, coarse, progress)?;
                Ok(carried.remove(0))
            }),
        }
    }

    /// Make the tables of changed cells that are not known yet: those that differ in heights alone together, whose pillars have
    /// their modes in common.
    ///
    /// # Errors
    /// As [`RigorousCells::table`].
    pub fn prepare(&self, changes: &[CellChange], progress: &dyn Progress) -> Result<()> {
        let is_open = |change: &&CellChange| {
            self.carried_by(change)
                .is_some_and(|(_, coarse)| self.known(change, -(coarse as f64)).is_none())
        };
        let mut open: Vec<CellChange> = Vec::new();
        for change in changes.iter().filter(is_open) {
            if change.taper_deg == 0.0 && !open.contains(change) {
                open.push(*change);
            }
        }
        while let Some(first) = open.first().copied() {
            let section = |change: &CellChange| (change.index, change.corner_rounding_nm);
            let together: Vec<CellChange> = open.extract_if(.., |c| section(c) == section(&first)).collect();
            if let Some((alike, coarse)) = self.carried_by(&first) {
                let tables = self.carried(&together, &alike, coarse, progress)?;
                for (change, table) in together.iter().zip(tables) {
                    self.cached(change, -(coarse as f64), || Ok(table))?;
                }
            }
        }
        Ok(())
    }

    /// The pillar by which a changed one is corrected, and the orders with which both are solved; none where it is solved in full.
    fn carried_by(&self, change: &CellChange) -> Option<(CellChange, usize)> {
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
        (*change != stated && coarse < self.fine).then_some((alike, coarse))
    }

    /// Changed pillars, solved together with fewer orders, and each corrected by `alike`.
    fn carried(
        &self,
        changes: &[CellChange],
        alike: &CellChange,
        coarse: usize,
        progress: &dyn Progress,
    ) -> Result<Vec<PillarTable>> {
        let stated = self.table(alike, progress)?;
        let before = self.known(alike, coarse as f64);
        let own = before.is_none().then_some(*alike);
        let all: Vec<CellChange> = own.into_iter().chain(changes.iter().copied()).collect();
        let mut solved = self.solve(&all, coarse, progress)?;
        let before = match before {
            Some(before) => before,
            None => self.cached(alike, coarse as f64, || Ok(solved.remove(0)))?,
        };
        let stacks: Vec<CellStack> = changes.iter().map(|change| perturbed(&self.stack, change)).collect();
        let is_leaning = changes.iter().any(|change| change.taper_deg != 0.0);
        let orders = Orders::new(if is_leaning {
            LEANING_RESONANT.min(self.fine)
        } else {
            self.fine
        })?;
        let rows = (0..self.wavelengths_nm.len()).into_par_iter().map(|l| {
            let each = solved
                .iter()
                .map(|after| corrected(&stated.t[l], &before.t[l], &after.t[l]));
            let mut each: Vec<CorrectedTable> = each.collect();
            for k in 0..self.count() {
                progress.check_stopped()?;
                let open: Vec<usize> = (0..each.len()).filter(|&i| each[i].resonant.contains(&k)).collect();
                let pillars: Vec<&CellStack> = open.iter().map(|&i| &stacks[i]).collect();
                for (&i, t) in open.iter().zip(self.solve_entry(&pillars, l, k, orders)?) {
                    each[i].t[k] = t;
                }
            }
            Ok(each.into_iter().map(|own| own.t).collect())
        });
        let mut rows: Vec<Vec<Vec<Complex64>>> = rows.collect::<Result<_>>()?;
        let each = solved.iter().enumerate().map(|(i, after)| {
            let bare = stated.bare.iter().zip(before.bare.iter().zip(&after.bare));
            PillarTable {
                bare: bare.map(|(t, (a, b))| t + b - a).collect(),
                t: rows.iter_mut().map(|row| std::mem::take(&mut row[i])).collect(),
                ..(*stated).clone()
            }
        });
        Ok(each.collect())
    }

    /// A table as this one of a changed cell, by the orders of changed pillars instead of the many of the stated cell: the ratio of both
    /// is that of the stated cell. None where these orders are not fewer.
    ///
    /// # Errors
    /// As [`RigorousCells::table`].
    pub fn with_few_orders(&self, table: &PillarTable, progress: &dyn Progress) -> Result<Option<PillarTable>> {
        if self.coarse >= self.fine {
            return Ok(None);
        }
        let stated = CellChange::default();
        let [many, few] = [self.fine, self.coarse].map(|orders| self.solved(&stated, orders, progress));
        let (many, few) = (many?, few?);
        let mut out = table.clone();
        for (row, (many, few)) in out.t.iter_mut().zip(many.t.iter().zip(&few.t)) {
            for (t, (many, few)) in row.iter_mut().zip(many.iter().zip(few)) {
                *t += few - many;
            }
        }
        Ok(Some(out))
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
        self.cached(change, orders as f64, || {
            let mut solved = self.solve(&[*change], orders, progress)?;
            Ok(solved.remove(0))
        })
    }

    /// A table from the cache, or computed now; `how` is the number of orders, negative where they are few and corrected.
    fn cached(
        &self,
        change: &CellChange,
        how: f64,
        make: impl FnOnce() -> Result<PillarTable>,
    ) -> Result<Arc<PillarTable>> {
        let key = key_of(change, how);
        let made = || {
            if let Some(table) = self.stored(&key) {
                return Ok(Arc::new(table));
            }
            let table = make()?;
            if let Some(path) = self.path(&key) {
                // A cache that cannot be written costs time, not correctness.
                let _ = AtomicFile::write(&path, &table.bytes(cache_file::solver_of(self.stack.shape)));
            }
            Ok(Arc::new(table))
        };
        self.made.get_or_make(key, made)
    }

    /// A table that was made before, by this run or another.
    fn known(&self, change: &CellChange, how: f64) -> Option<Arc<PillarTable>> {
        let key = key_of(change, how);
        let stored = || self.stored(&key).map(Arc::new).ok_or(());
        self.made.get_or_make(key, stored).ok()
    }

    /// Path of a table in the cache folder.
    fn path(&self, key: &[u64; 6]) -> Option<PathBuf> {
        let name = |f: &PathBuf| f.join(format!("{}.cells", self.digest(key, f64::from_bits(key[5]) < 0.0)));
        self.folder.as_ref().map(name)
    }

    /// Table in the cache folder.
    fn stored(&self, key: &[u64; 6]) -> Option<PillarTable> {
        let bytes = fs::read(self.path(key)?).ok()?;
        let solver = cache_file::solver_of(self.stack.shape);
        let (wavelengths, count) = (self.wavelengths_nm.len(), self.count());
        PillarTable::from_bytes(&bytes, solver, wavelengths, count, self.first_nm(), STEP_NM)
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

    /// Tables of changed cells, solved together.
    fn solve(&self, changes: &[CellChange], orders: usize, progress: &dyn Progress) -> Result<Vec<PillarTable>> {
        let orders = Orders::new(orders)?;
        let stacks: Vec<CellStack> = changes.iter().map(|change| perturbed(&self.stack, change)).collect();
        let pillars: Vec<&CellStack> = stacks.iter().collect();
        progress.begin(TABLE, self.wavelengths_nm.len() as u64);
        let rows: Vec<Vec<(Vec<Complex64>, Complex64)>> = self
            .wavelengths_nm
            .par_iter()
            .enumerate()
            .map(|(l, nm)| {
                let bare = |stack: &&CellStack| Ok((Vec::new(), stack.transmission(0.0, nm * 1e-3, orders)?));
                let mut rows = pillars.iter().map(bare).collect::<Result<Vec<_>>>()?;
                for k in 0..self.count() {
                    progress.check_stopped()?;
                    for ((row, _), t) in rows.iter_mut().zip(self.solve_entry(&pillars, l, k, orders)?) {
                        row.push(t);
                    }
                }
                progress.advance(1);
                Ok(rows)
            })
            .collect::<Result<_>>()?;
        let empty = PillarTable {
            first_nm: self.first_nm(),
            step_nm: STEP_NM,
            t: Vec::new(),
            bare: Vec::new(),
        };
        let mut tables = vec![empty; changes.len()];
        for row in rows {
            for (table, (t, bare)) in tables.iter_mut().zip(row) {
                table.t.push(t);
                table.bare.push(bare);
            }
        }
        Ok(tables)
    }

    /// Transmissions of entry `k` of tables of several stacks at wavelength `l`.
    fn solve_entry(&self, stacks: &[&CellStack], l: usize, k: usize, orders: Orders) -> Result<Vec<Complex64>> {
        let um = self.wavelengths_nm[l] * 1e-3;
        // Where tapered walls would meet, the widest possible pillar is used instead.
        let width = |stack: &CellStack| possible_width_nm(stack, self.width_nm(k));
        let pillars: Vec<(&CellStack, f64)> = stacks.iter().map(|stack| (*stack, width(stack))).collect();
        if let Ok(all) = CellStack::transmission_each(&pillars, um, orders) {
            return Ok(all);
        }
        let each = pillars.iter();
        each.map(|(stack, width)| off_cutoff(*width, |width| stack.transmission(width, um, orders)))
            .collect()
    }

    /// The name of a table in the cache, from all of its inputs; one that is carried over from few orders is corrected by those
    /// of stated cells.
    fn digest(&self, key: &[u64; 6], carried: bool) -> String {
        let mut hash = Sha256::new();
        hash.update(env!("CARGO_PKG_VERSION"));
        hash.update(serde_json::to_vec(&self.stack).expect("plain data serialises"));
        if carried {
            hash.update((self.fine as u64).to_le_bytes());
            if f64::from_bits(key[2]) != 0.0 {
                hash.update((LEANING_RESONANT as u64).to_le_bytes());
            }
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

/// Key of a table: the change, and how it is solved.
fn key_of(change: &CellChange, how: f64) -> [u64; 6] {
    [
        change.height_nm,
        change.index,
        change.taper_deg,
        change.corner_rounding_nm,
        change.residual_mask_nm,
        how,
    ]
    .map(f64::to_bits)
}

impl CellSource {
    /// Make the tables of changed cells that are not known yet, together.
    ///
    /// # Errors
    /// As [`RigorousCells::prepare`].
    pub fn prepare(&self, changes: &[CellChange], progress: &dyn Progress) -> Result<()> {
        match self {
            Self::Rigorous(cells) => cells.prepare(changes, progress),
            Self::Model(_) => Ok(()),
        }
    }

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
