//! Transmission of etched pillars of any width at the wavelengths of a set.
//!
//! The stated cell is solved with many orders. A change of the pillar (height, index, walls, corners, mask) is
//! solved with fewer, and corrected by their error on the stated pillar that is closest to the changed one.

mod carry;
mod table;

use std::collections::HashMap;
use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use num_complex::Complex64;
use rayon::prelude::*;
use sha2::{Digest, Sha256};

pub use table::PillarTable;

use self::carry::{Carried, carried_over};
use metalith_cell::kept;
use metalith_cell::{CellModel, CellStack};
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result, WholeFile};
use metalith_made::{CellChange, off_cutoff, perturbed, possible_width_nm};
use metalith_rcwa::{Incidence, Orders, Outline, Side, solve};

/// Orders along an axis for the stated cell: errs by about 0.005 rad.
const FINE: usize = 13;

/// Orders along an axis for a changed pillar.
const COARSE: usize = 9;

/// The same for tapered walls, which take six layers and are close to upright ones.
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
    made: Mutex<HashMap<[u64; 6], Arc<PillarTable>>>,
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
            made: Mutex::default(),
        }
    }

    /// The same with other orders, and no correction for upright pillars: for synthetic sets, which must not share the
    /// truncation error of the fits. Tapered walls take six layers, and fewer orders.
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
        self.kept(change, -(coarse as f64), || {
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
                let Carried { mut t, resonant } = carried_over(&stated.t[l], &before.t[l], &after.t[l]);
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
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
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
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
        self.kept(change, orders as f64, || self.solve(change, orders, progress))
    }

    /// A table from the cache, or computed now; `how` is the number of orders, negative where they are few and corrected.
    fn kept(
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
        let known =
            |made: &Mutex<HashMap<_, _>>| made.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        if let Some(table) = known(&self.made) {
            return Ok(table);
        }
        let path = self
            .folder
            .as_ref()
            .map(|f| f.join(format!("{}.cells", self.digest(&key, how < 0.0))));
        let (wavelengths, count) = (self.wavelengths_nm.len(), self.count());
        let solver = kept::solver_of(self.stack.shape);
        let load = |path: &std::path::Path| {
            let bytes = fs::read(path).ok()?;
            PillarTable::from_bytes(&bytes, solver, wavelengths, count, self.first_nm(), STEP_NM)
        };
        let table = match path.as_deref().and_then(load) {
            Some(table) => table,
            None => {
                let table = make()?;
                if let Some(path) = &path {
                    // A cache that cannot be written costs time, not correctness.
                    let _ = WholeFile::write(path, &table.bytes(solver));
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
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
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

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_cell::Material;
    use metalith_core::Silent;

    /// Root mean square error of t over widths and three wavelengths, with resonances: the truncation error of the
    /// stated cell itself.
    const TOLERANCE: f64 = 0.005;

    fn made_up(n: f64) -> CellStack {
        let constant = |n| Material::constant(n, 0.0).unwrap();
        CellStack {
            lattice: metalith_rcwa::CellLattice::Square,
            pitch_nm: 350.0,
            height_nm: 700.0,
            shape: metalith_core::PillarShape::Square,
            under: Vec::new(),
            film: constant(n),
            substrate: constant(1.46),
            ambient: constant(1.0),
            taper: 0.0,
            corner_radius_nm: 0.0,
            mask_height_nm: 0.0,
            mask: constant(1.7),
        }
    }

    /// Leaning walls are solved with few orders and corrected by upright ones, which may be of more or fewer.
    #[test]
    fn tables_that_are_corrected_by_others_are_kept_apart() {
        let folder = tempfile::tempdir().unwrap();
        let table = |fine| {
            let kept = Some(folder.path().to_owned());
            let cells = RigorousCells::new(made_up(2.02), vec![660.0], (118.0, 122.0), kept).with_orders(fine, 5);
            let leaning = CellChange {
                taper_deg: 1.0,
                ..CellChange::default()
            };
            cells.table(&leaning, &Silent).unwrap().t.clone()
        };
        let first = table(7);
        assert_ne!(table(11), first);
        assert_eq!(table(7), first);
    }

    #[test]
    fn a_change_solved_with_few_orders_is_that_with_many() {
        let cells = RigorousCells::new(made_up(2.02), vec![460.0, 531.0, 660.0], (100.0, 240.0), None);
        let stated = CellChange::default();
        for change in [
            CellChange {
                taper_deg: 0.6,
                ..stated
            },
            CellChange {
                taper_deg: -1.0,
                ..stated
            },
            CellChange {
                corner_rounding_nm: 25.0,
                ..stated
            },
            CellChange { index: 0.02, ..stated },
            CellChange {
                height_nm: -24.0,
                ..stated
            },
            CellChange {
                height_nm: 10.0,
                ..stated
            },
            CellChange {
                residual_mask_nm: 15.0,
                ..stated
            },
        ] {
            let made = cells.table(&change, &Silent).unwrap();
            let truth = cells.solved(&change, FINE, &Silent).unwrap();
            let pairs = made.t.iter().flatten().zip(truth.t.iter().flatten());
            let squares: Vec<f64> = pairs.map(|(a, b)| (a - b).norm_sqr()).collect();
            let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
            assert!(rms < TOLERANCE, "{change:?}: {rms}");
        }
    }

    /// What few orders do to transmission as a smooth function of width, in the mean of the spectrum of an LED: coefficients of
    /// the polynomials that intervals count with, root mean square over LEDs and polynomials, of amplitude and of phase.
    fn smooth_error(cells: &RigorousCells, few: usize, many: usize, leds: &[Vec<f64>]) -> [f64; 2] {
        use crate::forward_model::TRANSMISSION_TERMS;
        use metalith_made::legendre;
        use nalgebra::{DMatrix, DVector};
        let tables = [few, many].map(|orders| cells.solved(&CellChange::default(), orders, &Silent).unwrap());
        let count = tables[0].t[0].len();
        let basis = |k: usize, at: usize| match k {
            0 => 1.0,
            k => {
                let mut one = [0.0; TRANSMISSION_TERMS];
                one[k - 1] = 1.0;
                legendre(&one, 2.0 * at as f64 / (count - 1) as f64 - 1.0)
            }
        };
        let (mut amplitudes, mut phases) = (0.0, 0.0);
        let mut first = 0;
        for weights in leds {
            let size = TRANSMISSION_TERMS + 1;
            let mut form = DMatrix::<f64>::zeros(size, size);
            let (mut re, mut im) = (DVector::<f64>::zeros(size), DVector::<f64>::zeros(size));
            for (l, weight) in weights.iter().enumerate() {
                for at in 0..count {
                    let [a, b] = [0, 1].map(|k| tables[k].t[first + l][at]);
                    // The logarithm of what hardly transmits tells of nothing that is seen.
                    let (ratio, weight) = ((a / b).ln(), weight * b.norm_sqr());
                    for i in 0..size {
                        re[i] += weight * basis(i, at) * ratio.re;
                        im[i] += weight * basis(i, at) * ratio.im;
                        for j in 0..size {
                            form[(i, j)] += weight * basis(i, at) * basis(j, at);
                        }
                    }
                }
            }
            let inverse = form.try_inverse().unwrap();
            let sum = |x: DVector<f64>| -> f64 { x.iter().skip(1).map(|c| c * c).sum() };
            amplitudes += sum(&inverse * re);
            phases += sum(&inverse * im);
            first += weights.len();
        }
        let n = (TRANSMISSION_TERMS * leds.len()) as f64;
        [(amplitudes / n).sqrt(), (phases / n).sqrt()]
    }

    /// The error of a cell that intervals count with is that of its truncation: of the orders of fits against many more, and of
    /// those of fits against those of synthetic sets, which intervals are judged by.
    #[test]
    #[ignore = "second tier: a minute of CPU time, in scripts/slow_tests.sh"]
    fn the_error_of_a_cell_in_intervals_is_that_of_its_truncation() {
        use crate::fit::ModelError;
        /// Relative: the constants are rounded, and other films have other resonances.
        const TOLERANCE: f64 = 1.2;
        /// Orders that stand for all.
        const MANY: usize = 17;
        /// Wavelengths of an LED, over 1.5 standard deviations of its spectrum on each side.
        const SAMPLES: usize = 7;
        let film = Material::read_csv(std::path::Path::new("../../golden/measured/film_nk.csv")).unwrap();
        let stack = CellStack {
            film,
            ..CellStack::paper(350.0, 700.0).unwrap()
        };
        let mut wavelengths = Vec::new();
        let leds = [(455.0, 18.0), (530.0, 33.0), (660.0, 20.0)].map(|(centre, fwhm)| {
            let of = |k: usize| 3.0 * k as f64 / (SAMPLES - 1) as f64 - 1.5;
            wavelengths.extend((0..SAMPLES).map(|k| centre + of(k) * fwhm / 2.3548));
            (0..SAMPLES).map(|k| (-0.5 * of(k).powi(2)).exp()).collect::<Vec<f64>>()
        });
        let cells = RigorousCells::new(stack, wavelengths, (100.0, 300.0), None);
        for (few, many) in [(FINE, MANY), (FINE, crate::validate::synthetic::ORDERS)] {
            let [amplitude, phase] = smooth_error(&cells, few, many, &leds);
            println!("{few} orders against {many}: amplitude {amplitude:.5}, phase {phase:.5} rad");
            let ModelError {
                amplitude: a,
                phase_rad,
                ..
            } = ModelError::MEASURED;
            assert!(amplitude < TOLERANCE * a && phase < TOLERANCE * phase_rad);
            // Of more orders the error is that which intervals count with, and not a part of it.
            if many == MANY {
                assert!(amplitude > a / TOLERANCE && phase > phase_rad / TOLERANCE);
            }
        }
    }
}
