//! Transmission of pillars of any realised width, solved where they are needed.

use std::collections::{BTreeSet, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use num_complex::Complex64;
use rayon::prelude::*;

use super::CellChange;
use super::cell_bank::CellBank;
use super::etched_stack::{off_cutoff, perturbed, possible_width_nm, to_middle_tops};
use metalith_cell::{
    BAND_ORDERS, CellStack, Illumination, OBLIQUE_BAND_ORDERS, OBLIQUE_ORDERS, ORDERS, POLARISATION_SHARE, dark,
};
use metalith_core::{Error, Progress, Result};
use metalith_rcwa::Orders;

/// Distance of the widths at which cells are solved (nm). Widths between them are interpolated by a cubic through
/// four neighbours, or solved themselves where that is not good enough: near resonances and cutoffs.
pub const NODE_STEP_NM: f64 = 0.5;

/// Distance of a node from the cubic through its four neighbours above which transmission is not smooth: a guided-mode
/// resonance or a cutoff is near, and widths next to the node are solved individually. Between other nodes a cubic errs
/// by about a sixteenth of it.
const ROUGH: f64 = 0.01;

/// A width this near to a node is that node [steps].
const ON_NODE: f64 = 1e-6;

/// Transmissions from s into s, p into p, s into p and p into s; for light along the normal, four equal ones.
type Polarised = [Complex64; 4];

/// Quantity of a cell that is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Solve {
    /// A site without pillar.
    Bare,
    /// The pillar of a node.
    Node(i64),
    /// A pillar of this width (nm), bit by bit.
    Width(u64),
}

/// Wavelength and direction, bit by bit, and orders along an axis.
type WaveKey = [u64; 4];

/// Cells of one stack by realised width. What was solved is kept for as long as this lives.
pub struct RealisedCells {
    stack: CellStack,
    /// Nodes are at this width and whole steps from it (nm): drawn widths are whole nanometres, so that pillars
    /// under a bias common to all are solved exactly at their width.
    offset_nm: f64,
    known: Mutex<HashMap<(WaveKey, Solve), Polarised>>,
    /// Bank from which transmissions are taken instead of being solved.
    bank: Option<(Arc<CellBank>, CellChange)>,
    /// The cells at the rim of a lens, where they differ from these in its middle, and how much higher they are (nm).
    rim: Option<(Box<Self>, f64)>,
}

/// Transmission of sites of some widths: one table for light along the normal; else one for each polarisation that is
/// kept (s, p), and one for each that is turned into the other where the direction is in no plane of symmetry of the
/// cell. See [`super::IncoherentFields::weight`].
pub struct SolvedWidths {
    /// Transmissions in the order of the widths that were asked for.
    pub pillars: Vec<Vec<Complex64>>,
    /// Transmission of a site without pillar, for each table.
    pub bare: Vec<Complex64>,
    /// Amplitude of light that passes a site unmodulated in the light of each table.
    pub unseen: Vec<Complex64>,
    /// Share of the light that arrives of which the light of each table is a part. What leaves by different tables does
    /// not interfere.
    pub share: f64,
    /// Transmissions at the rim of a lens, to the tops of the pillars in its middle; `None` where they are equal.
    pub rim: Option<Box<Self>>,
}

impl SolvedWidths {
    /// Share of unpolarised light that arrives for each of so many tables: one table is for both polarisations.
    pub fn share_of(tables: usize) -> f64 {
        if tables == 1 { 1.0 } else { POLARISATION_SHARE }
    }
}

/// Place of a width among the nodes.
#[derive(Clone, Copy)]
enum Among {
    On(i64),
    /// Between this node and the next, by this share.
    Between(i64, f64),
}

fn among(width_nm: f64, offset_nm: f64) -> Among {
    let x = (width_nm - offset_nm) / NODE_STEP_NM;
    if (x - x.round()).abs() < ON_NODE {
        return Among::On(x.round() as i64);
    }
    Among::Between(x.floor() as i64, x - x.floor())
}

/// Weights of the values at -1, 0, 1, 2 in the cubic through them, at `u` between 0 and 1.
pub fn lagrange(u: f64) -> [f64; 4] {
    [
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    ]
}

impl RealisedCells {
    /// Cells of a stack as etched; `bias_nm` is what drawn widths are off by at the least.
    pub fn new(stack: CellStack, bias_nm: f64) -> Self {
        Self {
            stack,
            offset_nm: bias_nm - bias_nm.floor(),
            known: Mutex::default(),
            bank: None,
            rim: None,
        }
    }

    /// Cells of a stated stack with a change, in the middle of a lens and at its rim; `bias_nm` as for [`Self::new`].
    pub fn changed(stated: &CellStack, change: &CellChange, bias_nm: f64) -> Self {
        let of = |change: &CellChange| Self::new(perturbed(stated, change), bias_nm);
        let rim = change
            .at_the_rim()
            .map(|rim| (Box::new(of(&rim)), change.rim_height_nm));
        Self {
            rim,
            ..of(&change.in_the_middle())
        }
    }

    /// Cells of a changed pillar, all taken from a bank: light off the normal has no answer, nor has what is outside
    /// of the bank.
    pub fn of_bank(bank: &Arc<CellBank>, change: &CellChange) -> Self {
        let rim = change.at_the_rim();
        Self {
            bank: Some((Arc::clone(bank), change.in_the_middle())),
            rim: rim.map(|rim| (Box::new(Self::of_bank(bank, &rim)), change.rim_height_nm)),
            ..Self::new(perturbed(bank.stated(), change), 0.0)
        }
    }

    /// Error that a bank has no answer.
    pub(super) fn along_normal_alone() -> Error {
        Error::refused(
            "study/oblique-unsupported",
            "the tables of cells are for normal incidence",
            "leave out `incidence = \"oblique\"`",
        )
    }

    /// The stack.
    pub fn stack(&self) -> &CellStack {
        &self.stack
    }

    /// Transmission of pillars of these widths (nm), zero-order, as [`metalith_cell::PointwiseCell`] has it, along the normal or in
    /// oblique light. Widths that no pillar can have are those of the nearest that can be.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn solve(&self, widths_nm: &[f64], light: &Illumination<'_>, progress: &dyn Progress) -> Result<SolvedWidths> {
        let (wavelength_um, sines) = (light.wavelength_um, light.cell_sines());
        let orders = if sines == [0.0; 2] {
            light.spectral.choose(ORDERS, BAND_ORDERS)
        } else {
            light.spectral.choose(OBLIQUE_ORDERS, OBLIQUE_BAND_ORDERS)
        };
        let (mut solved, columns) = self.solve_columns(orders, widths_nm, wavelength_um, sines, None, progress)?;
        if let Some((cells, higher_nm)) = &self.rim {
            let asked = Some(columns.as_slice());
            let (mut rim, _) = cells.solve_columns(orders, widths_nm, wavelength_um, sines, asked, progress)?;
            let phase = to_middle_tops(&self.stack, *higher_nm, wavelength_um)?;
            let all = rim.pillars.iter_mut().flatten().chain(&mut rim.bare);
            all.for_each(|t| *t *= phase);
            solved.rim = Some(Box::new(rim));
        }
        Ok(solved)
    }

    /// Transmissions, and which of the four polarisations they are of: those in `asked`, or all that are not dark.
    fn solve_columns(
        &self,
        orders: usize,
        widths_nm: &[f64],
        wavelength_um: f64,
        sines: [f64; 2],
        asked: Option<&[usize]>,
        progress: &dyn Progress,
    ) -> Result<(SolvedWidths, Vec<usize>)> {
        if let Some((bank, change)) = &self.bank {
            if sines != [0.0; 2] {
                return Err(Self::along_normal_alone());
            }
            return Ok((bank.transmissions(change, orders, widths_nm, wavelength_um)?, vec![0]));
        }
        let [um, x, y] = [wavelength_um, sines[0], sines[1]].map(f64::to_bits);
        let place = [um, x, y, orders as u64];
        let places: Vec<Among> = widths_nm.iter().map(|w| among(*w, self.offset_nm)).collect();
        // A width between nodes takes four of them, and two more to tell whether that is enough.
        let nodes = places.iter().flat_map(|a| match *a {
            Among::On(node) => node..=node,
            Among::Between(node, _) => node - 2..=node + 3,
        });
        let wanted: BTreeSet<Solve> = nodes.map(Solve::Node).chain([Solve::Bare]).collect();
        self.solve_all(place, wanted, progress)?;
        let rough: BTreeSet<Solve> = {
            let known = self.known();
            let at = |node: i64| known[&(place, Solve::Node(node))];
            let pairs = widths_nm.iter().zip(&places);
            pairs
                .filter(|(_, a)| matches!(**a, Among::Between(node, _) if rough(node, &at) || rough(node + 1, &at)))
                .map(|(w, _)| Solve::Width(w.to_bits()))
                .collect()
        };
        self.solve_all(place, rough, progress)?;
        let known = self.known();
        let at = |node: i64, p: usize| known[&(place, Solve::Node(node))][p];
        let value = |width: f64, a: Among, p: usize| match (known.get(&(place, Solve::Width(width.to_bits()))), a) {
            (Some(t), _) => t[p],
            (None, Among::On(node)) => at(node, p),
            (None, Among::Between(node, u)) => (-1..).zip(lagrange(u)).map(|(k, w)| at(node + k, p) * w).sum(),
        };
        let of = |p: usize| -> Vec<Complex64> {
            let pairs = widths_nm.iter().zip(&places);
            pairs.map(|(w, a)| value(*w, *a, p)).collect()
        };
        let polarisations = if sines == [0.0; 2] { 0..1 } else { 0..4 };
        let (columns, pillars) = polarisations
            .map(|p| (p, of(p)))
            .filter(|(p, t)| asked.map_or_else(|| *p < 2 || !dark(t), |asked| asked.contains(p)))
            .unzip::<_, _, Vec<_>, Vec<_>>();
        let solved = SolvedWidths {
            unseen: vec![Complex64::ONE; columns.len()],
            share: SolvedWidths::share_of(columns.len()),
            pillars,
            bare: columns.iter().map(|&p| known[&(place, Solve::Bare)][p]).collect(),
            rim: None,
        };
        Ok((solved, columns))
    }

    fn known(&self) -> MutexGuard<'_, HashMap<(WaveKey, Solve), Polarised>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Solve what is not known yet.
    fn solve_all(&self, place: WaveKey, wanted: BTreeSet<Solve>, progress: &dyn Progress) -> Result<()> {
        let missing: Vec<Solve> = {
            let known = self.known();
            wanted
                .into_iter()
                .filter(|w| !known.contains_key(&(place, *w)))
                .collect()
        };
        let solved = missing
            .into_par_iter()
            .map(|what| {
                progress.check_stopped()?;
                Ok(((place, what), self.solve_one(place, what)?))
            })
            .collect::<Result<Vec<_>>>()?;
        self.known().extend(solved);
        Ok(())
    }

    fn solve_one(&self, place: WaveKey, what: Solve) -> Result<Polarised> {
        let [wavelength_um, x, y] = [place[0], place[1], place[2]].map(f64::from_bits);
        let (sines, orders) = ([x, y], Orders::new(place[3] as usize)?);
        let width = match what {
            Solve::Bare => 0.0,
            Solve::Node(k) => possible_width_nm(&self.stack, self.offset_nm + k as f64 * NODE_STEP_NM),
            Solve::Width(bits) => possible_width_nm(&self.stack, f64::from_bits(bits)),
        };
        if sines == [0.0; 2] {
            let t = off_cutoff(width, |w| self.stack.transmission(w, wavelength_um, orders))?;
            return Ok([t; 4]);
        }
        let polarised = |w| {
            let [[ss, sp], [ps, pp]] = self.stack.oblique(w, wavelength_um, sines, orders)?;
            Ok([ss, pp, sp, ps])
        };
        off_cutoff(width, polarised)
    }
}

/// True if a node is off the cubic through its four neighbours, for any polarisation.
fn rough(node: i64, at: &impl Fn(i64) -> Polarised) -> bool {
    let [a, b, c, d, e] = [-2, -1, 0, 1, 2].map(|k| at(node + k));
    (0..4).any(|p| ((b[p] + d[p]) * (2.0 / 3.0) - (a[p] + e[p]) / 6.0 - c[p]).norm() > ROUGH)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;

    /// Rms error of transmissions of modulus one or so between the nodes, over widths and colours.
    const RMS: f64 = 2e-3;

    /// And the worst of it: a resonance that passes within one step and touches no node.
    const WORST: f64 = 0.03;

    #[test]
    fn widths_between_the_nodes_are_those_solved_exactly() {
        let stack = CellStack::paper(350.0, 700.0).unwrap();
        let orders = Orders::new(ORDERS).unwrap();
        let cells = RealisedCells::new(stack.clone(), -9.25);
        let (mut squares, mut worst, mut count) = (0.0, 0.0_f64, 0.0);
        for um in [0.455, 0.53, 0.66] {
            // Halfway between nodes, where a cubic errs most.
            let widths: Vec<f64> = (0..67).map(|k| 100.0 + 3.0 * f64::from(k)).collect();
            let solved = cells.solve(&widths, &Illumination::normal(um), &Silent).unwrap();
            for (w, t) in widths.iter().zip(&solved.pillars[0]) {
                let error = (stack.transmission(*w, um, orders).unwrap() - t).norm();
                squares += error * error;
                worst = worst.max(error);
                count += 1.0;
            }
        }
        let rms = f64::sqrt(squares / count);
        let solved = cells.known().keys().filter(|k| matches!(k.1, Solve::Width(_))).count();
        println!("rms {rms}, worst {worst}, {solved} of {count} solved themselves");
        assert!(rms < RMS && worst < WORST, "rms {rms}, worst {worst}");
    }

    #[test]
    fn widths_on_the_nodes_are_solved_and_nothing_else_is() {
        let stack = CellStack::paper(350.0, 700.0).unwrap();
        let orders = Orders::new(ORDERS).unwrap();
        let cells = RealisedCells::new(stack.clone(), -9.3);
        let widths = [150.0 - 9.3, 152.0 - 9.3];
        let solved = cells.solve(&widths, &Illumination::normal(0.53), &Silent).unwrap();
        // Widths agree to rounding, and a transmission's slope is below one a nanometre.
        const ROUNDING: f64 = 1e-12;
        for (w, t) in widths.iter().zip(&solved.pillars[0]) {
            assert!((stack.transmission(*w, 0.53, orders).unwrap() - t).norm() < ROUNDING);
        }
        // Two pillars and a bare site.
        assert_eq!(cells.known().len(), 3);
        assert_eq!(solved.bare[0], stack.transmission(0.0, 0.53, orders).unwrap());
    }
}
