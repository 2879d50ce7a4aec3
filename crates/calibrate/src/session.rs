//! One set from its files to its diagnosis.

use std::path::PathBuf;

use super::atlas::Atlas;
use super::attribute::{Finding, attribute};
use super::bench::{Bench, Sampling};
use super::cells::{CellSource, RigorousCells};
use super::diagnosis::{Diagnosis, LeftOut, Rung};
use super::effects;
use super::fit::{Fit, Problem};
use super::forward::RESIDUAL;
use super::heldout::{held_out, mean};
use super::nuisance::Data;
use super::set::MeasuredSet;
use super::simulator::{Simulator, WIDTH_ROOM_NM};
use super::speckle::Speckle;
use super::unfit::unfit;
use metalith_cell::{CellStack, FittedCell, Material, PublishedCell};
use metalith_core::{Progress, Result};
use metalith_made::Perturbation;

/// How a set is worked on.
#[derive(Clone, Debug)]
pub struct Settings {
    pub sampling: Sampling,
    /// Where tables of cells are kept from one run to the next; nowhere if none.
    pub cache: Option<PathBuf>,
    /// Try these effects alone; all if empty.
    pub only: Vec<String>,
    /// Compare the three fidelities of the cell first.
    pub ladder: bool,
    /// Simulate the free terms, which placebos are made of as well.
    pub free: bool,
    /// Bring what is found to rest on simulations of the very chip, where the atlas adds up polynomials.
    pub exact: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            sampling: Sampling::default(),
            cache: None,
            only: Vec::new(),
            ladder: true,
            free: true,
            exact: true,
        }
    }
}

/// Times that a set far from what was stated is looked at again from where it was found.
const RECENTRED: usize = 2;

/// Times that effects and grain are fitted in turn.
const ROUNDS: usize = 4;

/// They have come to rest when the share changes by less than this part of it.
const SHARE_AT_REST: f64 = 0.05;

/// Before other effects are known, they may differ by this factor.
const SHARES_ALIKE: f64 = 4.0;

/// Mean and grain speak of one share of missing pillars if they differ by less than this part of it: the grain
/// is known from a few draws, and the mean is seen through the grain.
const SHARES_AGREE: f64 = 0.3;

/// A set with its simulator and its data.
pub struct Session<'a> {
    pub simulator: Simulator<'a>,
    pub data: Data,
    /// Captures that count.
    pub used: Vec<bool>,
    pub settings: Settings,
}

/// The cell as a set states it.
///
/// # Errors
/// If a material is not known.
pub fn stated_cell(set: &MeasuredSet) -> Result<CellStack> {
    Ok(CellStack {
        pitch_nm: f64::from(set.stack.pitch_nm),
        height_nm: set.stack.pillar_height_nm,
        film: set.stack.film.clone(),
        substrate: Material::named("fused_silica_malitson_1965")?,
        ambient: Material::constant(set.stack.ambient_index, 0.0)?,
        taper: 0.0,
        corner_radius_nm: 0.0,
        mask_height_nm: 0.0,
        mask: Material::named("alumina_zhukovsky_2015")?,
    })
}

impl<'a> Session<'a> {
    /// Plan the work on a set.
    ///
    /// # Errors
    /// If a material is not known.
    pub fn new(set: &'a MeasuredSet, settings: Settings) -> Result<Self> {
        let bench = Bench::new(set, settings.sampling);
        let (low, high) = bench.widths_nm();
        let cells = RigorousCells::new(
            stated_cell(set)?,
            bench.wavelengths_nm(),
            (low - WIDTH_ROOM_NM, high + WIDTH_ROOM_NM),
            settings.cache.clone(),
        );
        let mut tried = effects::all(set);
        if !settings.only.is_empty() {
            tried.retain(|e| settings.only.contains(&e.name()));
        }
        let simulator = Simulator::new(bench, CellSource::Rigorous(Box::new(cells)), tried);
        Ok(Self {
            simulator,
            data: Data::new(set),
            used: vec![true; set.captures.len()],
            settings,
        })
    }

    /// The set.
    pub fn set(&self) -> &'a MeasuredSet {
        self.simulator.bench.set()
    }

    /// Simulate every effect about the stated chip and bench.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn atlas(&self, progress: &dyn Progress) -> Result<Atlas> {
        let nothing = vec![0.0; self.simulator.slots.len()];
        self.simulator.atlas(&nothing, self.settings.free, progress)
    }

    /// A problem over this set's data.
    pub fn problem(&self, atlas: &Atlas) -> Problem<'_> {
        Problem {
            simulator: &self.simulator,
            atlas: atlas.clone(),
            data: &self.data,
            used: self.used.clone(),
            exact: None,
        }
    }

    /// The same, resting on what a finding rests on.
    pub fn problem_of(&self, finding: &Finding) -> Problem<'_> {
        Problem {
            exact: finding.exact.clone(),
            ..self.problem(&finding.atlas)
        }
    }

    /// The answer for the set, and what it rests on where there is a finding.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn diagnose(&mut self, atlas: &Atlas, progress: &dyn Progress) -> Result<(Diagnosis, Option<Finding>)> {
        let mut left_out = Vec::new();
        let nothing = self.problem(atlas).nothing();
        for (c, reason) in unfit(&self.problem(atlas), &nothing.nuisances) {
            self.used[c] = false;
            left_out.push(LeftOut {
                capture: self.set().captures[c].name.clone(),
                reason,
            });
        }
        if 2 * left_out.len() > self.used.len() {
            let problem = self.problem(atlas);
            return Ok((Diagnosis::unfit(self, &problem, left_out, &nothing), None));
        }
        let ladder = if self.settings.ladder {
            self.ladder(atlas, progress)?
        } else {
            Vec::new()
        };
        let exact = self.settings.exact;
        let mut finding = attribute(&self.simulator, atlas, &self.data, &self.used, exact, None, progress)?;
        // What is far from what was stated is looked at again from where it was found.
        for _ in 0..RECENTRED {
            if !exact || finding.chosen.is_empty() || mean(&finding.held_after) < RESIDUAL {
                break;
            }
            let (data, used) = (&self.data, &self.used);
            let after = &finding.after;
            let nearer = self
                .simulator
                .recentred(&finding.atlas, &after.theta, &after.active, progress)?;
            let next = attribute(&self.simulator, &nearer, data, used, exact, Some(&finding), progress)?;
            let (before, after) = (mean(&finding.held_after), mean(&next.held_after));
            if after >= before {
                break;
            }
            finding = next;
            if before - after < 0.05 * after {
                break;
            }
        }
        if let Some((data, grained)) = self.grained(atlas, &finding, progress)? {
            (self.data, finding) = (data, grained);
        }
        let diagnosis = Diagnosis::new(self, &finding, left_out, ladder);
        Ok((diagnosis, Some(finding)))
    }

    /// What is found if the grain of missing pillars is counted as noise, where that explains what is left: if
    /// their mean and their grain speak of the same share.
    fn grained(&self, atlas: &Atlas, plain: &Finding, progress: &dyn Progress) -> Result<Option<(Data, Finding)>> {
        let random = self.simulator.effects.iter().position(|e| e.random());
        let Some((effect, speckle)) = random.zip(atlas.grain.as_ref()) else {
            return Ok(None);
        };
        if mean(&plain.held_after) < RESIDUAL {
            return Ok(None);
        }
        let slot = self.simulator.slots_of(effect)[0];
        let problem = self.problem_of(plain);
        let mut active = plain.after.active.clone();
        if !active.contains(&slot) {
            active.push(slot);
        }
        let fit = problem.fit(&active, &plain.after);
        let mut share = speckle.share(&problem, &fit);
        // Whatever else is there, a share of the kind is in the mean before it is looked for in earnest.
        if fit.theta[slot] < share / SHARES_ALIKE {
            return Ok(None);
        }
        let mut data = speckle.counted(&problem, &fit, share);
        for _ in 0..ROUNDS {
            if !Speckle::conceivable(share) {
                break;
            }
            let exact = self.settings.exact;
            let mut found = attribute(&self.simulator, atlas, &data, &self.used, exact, None, progress)?;
            // Judged by the noise of the camera alone, from which the grain is told.
            let bare = self.problem_of(&found);
            let next = speckle.share(&bare, &found.after);
            if (next / share - 1.0).abs() < SHARE_AT_REST {
                let by_mean = found.after.theta[slot];
                let agree = (by_mean - share).abs() <= SHARES_AGREE * share.max(by_mean);
                let whole = mean(&found.held_after) < RESIDUAL;
                if !(found.chosen.contains(&effect) && agree && whole) {
                    break;
                }
                found.by_grain = Some(share);
                // Two answers to one question: the interval holds both.
                if let Some(k) = found.after.place(slot) {
                    let width = &mut found.half_widths[k];
                    *width = width.max((by_mean - share).abs());
                }
                found.before = plain.before.clone();
                found.held_before.clone_from(&plain.held_before);
                return Ok(Some((data, found)));
            }
            share = next;
            data = speckle.counted(&bare, &found.after, share);
        }
        Ok(None)
    }

    /// The error of each fidelity of the cell, nuisances fitted.
    fn ladder(&self, atlas: &Atlas, progress: &dyn Progress) -> Result<Vec<Rung>> {
        let mut rungs = Vec::new();
        let published = CellSource::Model(Box::new(PublishedCell::new(self.set().stack.pitch_nm)));
        let wavelengths = self.simulator.bench.wavelengths_nm();
        let ends = wavelengths
            .iter()
            .fold((f64::MAX, 0.0f64), |(a, b), &l| (a.min(l), b.max(l)));
        let (low, high) = self.simulator.bench.widths_nm();
        let fitted = FittedCell::of_stack(
            &stated_cell(self.set())?,
            (ends.0 * 1e-3, ends.1 * 1e-3),
            (low as u16, high as u16),
        )?;
        let fitted = CellSource::Model(Box::new(fitted));
        for (name, cells) in [
            ("published", Some(published)),
            ("fitted", Some(fitted)),
            ("rigorous", None),
        ] {
            let problem = self.problem(atlas);
            let fit = match cells {
                None => problem.nothing(),
                Some(cells) => {
                    let bench = Bench::new(self.set(), self.settings.sampling);
                    let simulator = Simulator::new(bench, cells, Vec::new());
                    let exposed = simulator.expose(&[Perturbation::default()], progress)?.remove(0);
                    let problem = Problem {
                        simulator: &simulator,
                        atlas: Atlas::alone(exposed),
                        ..self.problem(atlas)
                    };
                    let fit = problem.nothing();
                    rungs.push(rung(name, &problem, &fit));
                    continue;
                }
            };
            rungs.push(rung(name, &problem, &fit));
        }
        Ok(rungs)
    }
}

fn rung(name: &str, problem: &Problem<'_>, fit: &Fit) -> Rung {
    let residual = |c| fit.nuisances.residual(problem.data, &problem.grid(&fit.theta, c), c);
    Rung {
        fidelity: name.into(),
        fit: fit.chi2 / problem.pixels(),
        held_out: mean(&held_out(problem, &fit.forms, fit)),
        residuals: (0..problem.used.len()).map(residual).collect(),
    }
}
