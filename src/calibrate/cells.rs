//! Transmission of pillars of any width, as etched, at the wavelengths of a set.
//!
//! The stated cell is solved with many orders. How a change of the pillar (height, index, walls, corners,
//! mask) moves it is solved with fewer, before and after, and the difference added: what truncation errs by
//! is common to both.

use std::collections::HashMap;
use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::departure::CellChange;
use crate::cell::rcwa::{Incidence, Orders, Outline, Side, solve};
use crate::cell::{CellModel, CellStack};
use crate::error::{Error, Result};
use crate::file::WholeFile;
use crate::progress::Progress;

/// Orders along an axis for the stated cell: errs by about 0.005 rad.
const FINE: usize = 13;

/// Orders along an axis for what a change of the pillar moves.
const COARSE: usize = 9;

/// The same for leaning walls, which take six layers.
const COARSEST: usize = 7;

/// Widths are tabulated this far apart [nm]; resonances are a few nanometres wide.
const STEP_NM: f64 = 2.0;

/// Transmission over wavelength and width.
#[derive(Clone, Debug)]
pub struct CellTable {
    first_nm: f64,
    step_nm: f64,
    /// For each wavelength, the transmissions of all widths.
    t: Vec<Vec<Complex64>>,
    /// For each wavelength, that of a site without pillar.
    bare: Vec<Complex64>,
}

impl CellTable {
    /// Transmission of a pillar of any width [nm] at one of the wavelengths, by cubics through the table.
    pub fn at(&self, wavelength: usize, width_nm: f64) -> Complex32 {
        let row = &self.t[wavelength];
        let x = ((width_nm - self.first_nm) / self.step_nm).clamp(0.0, (row.len() - 1) as f64);
        let i = (x.floor() as usize).clamp(1, row.len() - 3);
        let u = x - i as f64;
        let [a, b, c, d] = [row[i - 1], row[i], row[i + 1], row[i + 2]];
        // Lagrange through the four neighbours.
        let value = a * (-u * (u - 1.0) * (u - 2.0) / 6.0)
            + b * ((u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0)
            + c * (-(u + 1.0) * u * (u - 2.0) / 2.0)
            + d * ((u + 1.0) * u * (u - 1.0) / 6.0);
        Complex32::new(value.re as f32, value.im as f32)
    }

    /// Transmission of a site without pillar.
    pub fn bare(&self, wavelength: usize) -> Complex32 {
        let value = self.bare[wavelength];
        Complex32::new(value.re as f32, value.im as f32)
    }
}

/// Where tables come from.
pub enum CellSource {
    /// The rigorous cell and its changes.
    Rigorous(Box<RigorousCells>),
    /// A model of fewer virtues; it knows no changes of the pillar.
    Model(Box<dyn CellModel + Send>),
}

/// Tables of the rigorous cell at the wavelengths of a set, made when first asked for.
pub struct RigorousCells {
    stack: CellStack,
    wavelengths_nm: Vec<f64>,
    widths_nm: (f64, f64),
    fine: usize,
    coarse: usize,
    coarsest: usize,
    folder: Option<PathBuf>,
    made: Mutex<HashMap<[u64; 6], Arc<CellTable>>>,
}

impl RigorousCells {
    /// Tables of `stack` for widths within a range. They are kept in `folder` for the next run, if there is one.
    pub fn new(stack: CellStack, wavelengths_nm: Vec<f64>, widths_nm: (f64, f64), folder: Option<PathBuf>) -> Self {
        Self {
            stack,
            wavelengths_nm,
            widths_nm,
            fine: FINE,
            coarse: COARSE,
            coarsest: COARSEST,
            folder,
            made: Mutex::default(),
        }
    }

    /// The same with other orders: for twins that must not share the truncation of the fit.
    pub fn with_orders(mut self, fine: usize, coarse: usize, coarsest: usize) -> Self {
        (self.fine, self.coarse, self.coarsest) = (fine, coarse, coarsest);
        self
    }

    /// The table of the cell with a change; with `exact`, the changed cell itself with all orders.
    ///
    /// # Errors
    /// If a pillar cannot be (a foot wider than the pitch), or the user stopped it.
    pub fn table(&self, change: &CellChange, exact: bool, progress: &dyn Progress) -> Result<Arc<CellTable>> {
        let upright = change.taper_deg == 0.0;
        if *change == CellChange::default() || upright && (exact || self.coarse >= self.fine) {
            return self.solved(change, self.fine, progress);
        }
        let stated = self.solved(&CellChange::default(), self.fine, progress)?;
        let coarse = match (upright, exact) {
            (true, _) | (false, true) => self.coarse.min(COARSE),
            (false, false) => self.coarsest,
        };
        let before = self.solved(&CellChange::default(), coarse, progress)?;
        let after = self.solved(change, coarse, progress)?;
        let mut table = (*stated).clone();
        for (to, (from, new)) in table.t.iter_mut().zip(before.t.iter().zip(&after.t)) {
            for (t, (a, b)) in to.iter_mut().zip(from.iter().zip(new)) {
                *t += b - a;
            }
        }
        for (t, (a, b)) in table.bare.iter_mut().zip(before.bare.iter().zip(&after.bare)) {
            *t += b - a;
        }
        Ok(Arc::new(table))
    }

    /// Tables for light polarised along x and along y, of pillars that are `nm` wider along x and narrower
    /// along y than drawn.
    ///
    /// # Errors
    /// As [`RigorousCells::table`].
    pub fn anisotropic(&self, nm: f64, progress: &dyn Progress) -> Result<[CellTable; 2]> {
        let orders = Orders::new(self.coarse.min(COARSE))?;
        let count = self.count();
        let rows: Vec<Vec<[Complex64; 2]>> = self
            .wavelengths_nm
            .par_iter()
            .map(|wavelength_nm| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                (0..count)
                    .map(|k| {
                        let um = wavelength_nm * 1e-3;
                        let width = self.first_nm() + k as f64 * STEP_NM;
                        off_cutoff(width, |width| {
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
        Ok([0, 1].map(|axis| CellTable {
            t: rows.iter().map(|row| row.iter().map(|t| t[axis]).collect()).collect(),
            ..(*stated).clone()
        }))
    }

    fn solved(&self, change: &CellChange, orders: usize, progress: &dyn Progress) -> Result<Arc<CellTable>> {
        let key = [
            change.height_nm,
            change.index,
            change.taper_deg,
            change.corner_rounding_nm,
            change.residual_mask_nm,
            orders as f64,
        ]
        .map(f64::to_bits);
        let known =
            |made: &Mutex<HashMap<_, _>>| made.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        if let Some(table) = known(&self.made) {
            return Ok(table);
        }
        let path = self
            .folder
            .as_ref()
            .map(|f| f.join(format!("{}.cells", self.digest(&key))));
        let table = match path.as_deref().and_then(|p| self.load(p)) {
            Some(table) => table,
            None => {
                let table = self.solve(change, orders, progress)?;
                if let Some(path) = &path {
                    // A cache that cannot be written costs time, not correctness.
                    let _ = WholeFile::write(path, &bytes(&table));
                }
                table
            }
        };
        let table = Arc::new(table);
        self.made
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(key, Arc::clone(&table));
        Ok(table)
    }

    fn first_nm(&self) -> f64 {
        (self.widths_nm.0 / STEP_NM).floor() * STEP_NM
    }

    fn count(&self) -> usize {
        ((self.widths_nm.1 - self.first_nm()) / STEP_NM).ceil() as usize + 1
    }

    fn solve(&self, change: &CellChange, orders: usize, progress: &dyn Progress) -> Result<CellTable> {
        let orders = Orders::new(orders)?;
        let stack = changed(&self.stack, change);
        let count = self.count();
        progress.begin("cells as etched", self.wavelengths_nm.len() as u64);
        let rows: Vec<(Vec<Complex64>, Complex64)> = self
            .wavelengths_nm
            .par_iter()
            .map(|nm| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let um = nm * 1e-3;
                // Where leaning walls would meet, the widest pillar that has room stands in.
                let room = stack.pitch_nm - 1.0 - (2.0 * stack.taper.tan() * stack.height_nm).max(0.0);
                let row = (0..count)
                    .map(|k| {
                        let width = (self.first_nm() + k as f64 * STEP_NM).min(room);
                        off_cutoff(width, |width| stack.transmission(width, um, orders))
                    })
                    .collect::<Result<Vec<_>>>()?;
                let bare = stack.transmission(0.0, um, orders)?;
                progress.advance(1);
                Ok((row, bare))
            })
            .collect::<Result<_>>()?;
        let (t, bare) = rows.into_iter().unzip();
        Ok(CellTable {
            first_nm: self.first_nm(),
            step_nm: STEP_NM,
            t,
            bare,
        })
    }

    /// Names a table by everything that decides it.
    fn digest(&self, key: &[u64; 6]) -> String {
        let mut hash = Sha256::new();
        hash.update(env!("CARGO_PKG_VERSION"));
        hash.update(serde_json::to_vec(&self.stack).expect("plain data serialises"));
        let numbers = self
            .wavelengths_nm
            .iter()
            .copied()
            .chain([self.first_nm(), STEP_NM, self.count() as f64]);
        for bits in numbers.map(f64::to_bits).chain(key.iter().copied()) {
            hash.update(bits.to_le_bytes());
        }
        // Materials serialise by content; indices are sampled as well, so that a table of the same name differs.
        for nm in &self.wavelengths_nm {
            let index = self.stack.film.index(nm * 1e-3).unwrap_or_default();
            hash.update(index.re.to_le_bytes());
            hash.update(index.im.to_le_bytes());
        }
        hash.finalize().iter().take(16).map(|b| format!("{b:02x}")).collect()
    }

    fn load(&self, path: &std::path::Path) -> Option<CellTable> {
        let bytes = fs::read(path).ok()?;
        let (wavelengths, count) = (self.wavelengths_nm.len(), self.count());
        if bytes.len() != wavelengths * (count + 1) * 16 {
            return None;
        }
        let mut numbers = bytes
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes")));
        let mut next = || Some(Complex64::new(numbers.next()?, numbers.next()?));
        let (mut t, mut bare) = (Vec::new(), Vec::new());
        for _ in 0..wavelengths {
            t.push((0..count).map(|_| next()).collect::<Option<Vec<_>>>()?);
            bare.push(next()?);
        }
        let sound = t
            .iter()
            .flatten()
            .chain(&bare)
            .all(|z| z.re.is_finite() && z.im.is_finite());
        sound.then_some(CellTable {
            first_nm: self.first_nm(),
            step_nm: STEP_NM,
            t,
            bare,
        })
    }
}

/// A mode at its very cutoff has no field to solve for; a pillar that is wider by less than anyone can tell has.
fn off_cutoff<T>(width_nm: f64, solve: impl Fn(f64) -> Result<T>) -> Result<T> {
    solve(width_nm)
        .or_else(|_| solve(width_nm - 3e-4))
        .or_else(|_| solve(width_nm - 1e-3))
}

/// The stack with a change.
pub fn changed(stack: &CellStack, change: &CellChange) -> CellStack {
    CellStack {
        height_nm: stack.height_nm + change.height_nm,
        film: stack.film.shifted(change.index),
        taper: stack.taper + change.taper_deg.to_radians(),
        corner_radius_nm: stack.corner_radius_nm + change.corner_rounding_nm,
        mask_height_nm: stack.mask_height_nm + change.residual_mask_nm,
        ..stack.clone()
    }
}

fn bytes(table: &CellTable) -> Vec<u8> {
    let mut out = Vec::new();
    for (row, bare) in table.t.iter().zip(&table.bare) {
        for z in row.iter().chain([bare]) {
            out.extend_from_slice(&z.re.to_le_bytes());
            out.extend_from_slice(&z.im.to_le_bytes());
        }
    }
    out
}

impl CellSource {
    /// The table at `wavelengths_nm` of the cell with a change.
    ///
    /// # Errors
    /// As [`RigorousCells::table`]; for a model, if it does not cover a wavelength.
    pub fn table(
        &self,
        change: &CellChange,
        wavelengths_nm: &[f64],
        widths_nm: (f64, f64),
        exact: bool,
        progress: &dyn Progress,
    ) -> Result<Arc<CellTable>> {
        match self {
            Self::Rigorous(cells) => cells.table(change, exact, progress),
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
                Ok(Arc::new(CellTable {
                    first_nm: first,
                    step_nm: 1.0,
                    bare: vec![Complex64::new(1.0, 0.0); t.len()],
                    t,
                }))
            }
        }
    }
}
