//! A bench in the computer, with the numbers of every effect to set.

use std::sync::Arc;

use super::bench::{Bench, IlluminatedChip};
use super::cells::{CellSource, PillarTable};
use super::effects::Effect;
use super::optics::PixelGrid;
use super::search_work::SearchWork;
use super::statistics::{Coarser, Slot};
use metalith_core::{Progress, Result};
use metalith_optics::{CellChange, Perturbation, to_middle_tops};

/// Widths that a bias may add or take (nm); cells are tabulated so far beyond the layout.
pub const WIDTH_ROOM_NM: f64 = 36.0;

/// Most chips that are sent along one path at once, for which one transfer function is worked out; of large lenses fewer, by
/// memory.
const TOGETHER: usize = 16;

/// Shares of the difference to coarser samples that are left, as one standard deviation: an error that falls with the cube of the
/// number of orders, of 13 beside 9; with the fourth power of the step of cubic interpolation; and of a spectrum, at least with
/// the square.
const OF_ORDERS: f64 = 0.5;
const OF_WIDTHS: f64 = 1.0 / 15.0;
const OF_WAVELENGTHS: f64 = 1.0 / 3.0;

/// Distance by which the places of declared kernels are moved, and the share of the change: an edge may be anywhere between two.
const HALF_A_PLACE: f64 = 0.5;
const OF_PLACES: f64 = 0.5;

/// A bench, its cells and the effects that are tried on it.
pub struct Simulator<'a> {
    pub bench: Bench<'a>,
    pub cells: CellSource,
    pub effects: Vec<Box<dyn Effect>>,
    pub slots: Vec<Slot>,
    /// Draw the pillars that are missing from this seed, instead of counting with their mean.
    pub scatter: Option<u64>,
    /// Number of simulations of the search that this is part of.
    pub work: SearchWork,
    wavelengths_nm: Vec<f64>,
    widths_nm: (f64, f64),
}

impl<'a> Simulator<'a> {
    /// Everything that is needed to predict a set.
    pub fn new(bench: Bench<'a>, cells: CellSource, effects: Vec<Box<dyn Effect>>) -> Self {
        let slots = effects
            .iter()
            .enumerate()
            .flat_map(|(effect, e)| {
                let parameters = e.parameters().into_iter().enumerate();
                parameters.map(move |(index, parameter)| Slot {
                    effect,
                    index,
                    parameter,
                })
            })
            .collect();
        let (low, high) = bench.widths_nm();
        Self {
            wavelengths_nm: bench.wavelengths_nm(),
            widths_nm: (low - WIDTH_ROOM_NM, high + WIDTH_ROOM_NM),
            bench,
            cells,
            effects,
            slots,
            scatter: None,
            work: SearchWork::default(),
        }
    }

    /// The numbers of an effect among all.
    pub fn slots_of(&self, effect: usize) -> Vec<usize> {
        (0..self.slots.len())
            .filter(|&s| self.slots[s].effect == effect)
            .collect()
    }

    /// Meaning of the numbers together.
    pub fn perturbation(&self, theta: &[f64]) -> Perturbation {
        let mut perturbation = Perturbation::default();
        for (e, effect) in self.effects.iter().enumerate() {
            let own: Vec<f64> = self.slots_of(e).into_iter().map(|s| theta[s]).collect();
            effect.apply(&own, &mut perturbation);
        }
        perturbation
    }

    /// Predicted frame of each measurement under each of `perturbations`; those that differ in lamps and camera alone
    /// share their light.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn expose(&self, perturbations: &[Perturbation], progress: &dyn Progress) -> Result<Vec<Vec<PixelGrid>>> {
        self.expose_with(perturbations, self.scatter, progress)
    }

    /// The same of one perturbation, the places of missing pillars drawn from a seed.
    ///
    /// # Errors
    /// As [`Simulator::expose`].
    pub fn expose_drawn(
        &self,
        perturbation: &Perturbation,
        seed: u64,
        progress: &dyn Progress,
    ) -> Result<Vec<PixelGrid>> {
        let perturbations = std::slice::from_ref(perturbation);
        Ok(self.expose_with(perturbations, Some(seed), progress)?.remove(0))
    }

    fn expose_with(
        &self,
        perturbations: &[Perturbation],
        scatter: Option<u64>,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<PixelGrid>>> {
        self.work.count(perturbations);
        let mut out: Vec<Option<Vec<PixelGrid>>> = perturbations.iter().map(|_| None).collect();
        let mut steps: Vec<Vec<usize>> = Vec::new();
        for (i, d) in perturbations.iter().enumerate() {
            let same = |j: &usize| {
                let o = &perturbations[*j];
                (&o.geometry, &o.cell, &o.path) == (&d.geometry, &d.cell, &d.path)
            };
            match steps.iter_mut().find(|s| same(&s[0])) {
                Some(step) => step.push(i),
                None => steps.push(vec![i]),
            }
        }
        // Cells first: they bring their own progress.
        let changes = steps.iter().map(|step| &perturbations[step[0]].cell);
        let changes = changes.flat_map(|change| [Some(change.in_the_middle()), change.at_the_rim()]);
        self.cells.prepare(&changes.flatten().collect::<Vec<_>>(), progress)?;
        let mut work = Vec::new();
        for step in steps {
            let change = &perturbations[step[0]].cell;
            let table = |change: &CellChange| self.cells.table(change, &self.wavelengths_nm, self.widths_nm, progress);
            let cells = table(&change.in_the_middle())?;
            // Models of lower fidelity know no heights.
            let rim = match change.at_the_rim() {
                Some(rim) if matches!(self.cells, CellSource::Rigorous(_)) => {
                    Some(self.at_middle_tops((*table(&rim)?).clone(), change.rim_height_nm)?)
                }
                _ => None,
            };
            work.push((step, cells, rim));
        }
        progress.begin("measurements as they should be", work.len() as u64);
        let most = TOGETHER.min(self.bench.chips_at_once());
        while !work.is_empty() {
            // Those on one path go together, as many as memory likes.
            let path = &perturbations[work[0].0[0]].path;
            let mut together = Vec::new();
            work = work
                .into_iter()
                .filter_map(|own| {
                    if together.len() < most && perturbations[own.0[0]].path == *path {
                        together.push(own);
                        return None;
                    }
                    Some(own)
                })
                .collect();
            let chips: Vec<IlluminatedChip<'_>> = together
                .iter()
                .map(|(step, cells, rim)| IlluminatedChip {
                    cells: Arc::clone(cells),
                    rim: rim.clone(),
                    geometry: &perturbations[step[0]].geometry,
                    lights: step.iter().map(|&i| &perturbations[i].light).collect(),
                    every: 1,
                    scatter,
                })
                .collect();
            let intensities = self.bench.intensities(&chips, path, progress)?;
            for ((step, ..), of_lights) in together.iter().zip(&intensities) {
                for (&i, planes) in step.iter().zip(of_lights) {
                    out[i] = Some(self.bench.grids(planes, &perturbations[i]));
                }
            }
            progress.advance(together.len() as u64);
        }
        Ok(out
            .into_iter()
            .map(|g| g.expect("every perturbation is in one step"))
            .collect())
    }

    /// Predicted frames under a perturbation, and those by fewer orders, by a table of every second width, and by every second
    /// wavelength, which follow from what is solved already; with declared kernels, those by other places of them. None of cells that are not rigorous, and of higher pillars at the rim.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn expose_coarser(
        &self,
        perturbation: &Perturbation,
        progress: &dyn Progress,
    ) -> Result<Option<Coarser<Vec<PixelGrid>>>> {
        let CellSource::Rigorous(cells) = &self.cells else {
            return Ok(None);
        };
        let change = &perturbation.cell;
        if change.at_the_rim().is_some() {
            return Ok(None);
        }
        let fine = cells.table(change, progress)?;
        let Some(few) = cells.with_few_orders(&fine, progress)? else {
            return Ok(None);
        };
        let chip = |cells: &Arc<PillarTable>, every| IlluminatedChip {
            cells: Arc::clone(cells),
            rim: None,
            geometry: &perturbation.geometry,
            lights: vec![&perturbation.light],
            every,
            scatter: None,
        };
        let (few, thin) = (Arc::new(few), Arc::new(fine.thinned()));
        let parts = [
            (&few, 1, 0.0, OF_ORDERS),
            (&thin, 1, 0.0, OF_WIDTHS),
            (&fine, 2, 0.0, OF_WAVELENGTHS),
            (&fine, 1, HALF_A_PLACE, OF_PLACES),
        ];
        let kernels = usize::from(!perturbation.camera.declared.is_empty());
        let parts = &parts[..parts.len() - 1 + kernels];
        let grids = |cells, every, moved| -> Result<Vec<PixelGrid>> {
            let light = self
                .bench
                .intensities(&[chip(cells, every)], &perturbation.path, progress)?;
            Ok(self.bench.grids_with(&light[0][0], perturbation, moved))
        };
        let coarse = parts.iter();
        let coarse = coarse.map(|(cells, every, moved, share)| Ok((*share, grids(cells, *every, *moved)?)));
        Ok(Some(Coarser {
            coarse: coarse.collect::<Result<_>>()?,
            fine: grids(&fine, 1, 0.0)?,
        }))
    }

    /// A table of pillars at the rim, so much higher than in the middle, from their own tops to those in the middle.
    fn at_middle_tops(&self, mut rim: PillarTable, higher_nm: f64) -> Result<Arc<PillarTable>> {
        let stack = &self.bench.set().stack.cell;
        for ((nm, row), bare) in self.wavelengths_nm.iter().zip(&mut rim.t).zip(&mut rim.bare) {
            let phase = to_middle_tops(stack, higher_nm, nm * 1e-3)?;
            row.iter_mut().chain([bare]).for_each(|t| *t *= phase);
        }
        Ok(Arc::new(rim))
    }
}
