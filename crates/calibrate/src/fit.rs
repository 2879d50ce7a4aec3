//! Levenberg and Marquardt over any of the numbers, with the nuisances alongside.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::atlas::Atlas;
use super::nuisance::{BLACK_SIGMA_DN, Block, Data, Nuisances};
use super::optics::PixelGrid;
use super::placement::coarse;
use super::quadratic::{held, minimise, sum};
use super::simulator::Simulator;

/// Most steps of a fit.
const STEPS: usize = 12;

/// A fit has come to rest when chi-square falls by less than this share.
const AT_REST: f64 = 1e-5;

/// Everything that a fit needs to know of a set.
#[derive(Clone)]
pub struct Problem<'a> {
    pub simulator: &'a Simulator<'a>,
    pub atlas: Atlas,
    pub data: &'a Data,
    /// Captures that count.
    pub used: Vec<bool>,
    /// What the exact simulation adds to the atlas, for each capture; none where the atlas stands alone.
    pub exact: Option<Vec<PixelGrid>>,
}

/// Where a fit came to rest.
#[derive(Clone)]
pub struct Fit {
    /// Numbers that were free.
    pub active: Vec<usize>,
    /// All numbers.
    pub theta: Vec<f64>,
    pub nuisances: Nuisances,
    /// Of each capture, from which its placement follows.
    blocks: Vec<Block>,
    /// Forms of each capture, and of the SEM last, over flux, black and the active numbers, at rest.
    pub forms: Vec<DMatrix<f64>>,
    /// Chi-square of all that counts, priors included.
    pub chi2: f64,
}

impl Fit {
    /// Which of the active numbers is that of a slot.
    pub fn place(&self, slot: usize) -> Option<usize> {
        self.active.iter().position(|s| *s == slot)
    }

    /// Of `values`, one for each active number, those of some slots.
    pub fn pick(&self, slots: &[usize], values: &[f64]) -> Vec<f64> {
        let places = slots.iter().filter_map(|&s| self.place(s));
        places.map(|k| values[k]).collect()
    }
}

impl Problem<'_> {
    /// Number of shared nuisances.
    pub fn shared(&self) -> usize {
        self.data.leds + 1
    }

    /// A fit of the nuisances alone.
    pub fn nothing(&self) -> Fit {
        let theta = self.atlas.about.clone();
        let grids: Vec<_> = (0..self.data.signal.len())
            .into_par_iter()
            .map(|c| self.grid(&theta, c))
            .collect();
        let mut nuisances = Nuisances::stated(self.data);
        let pixel_um = self.simulator.bench.set().camera.pixel_um;
        nuisances.shift_um = grids
            .par_iter()
            .zip(&self.data.signal)
            .map(|(grid, seen)| coarse(seen, &grid.pixels([0.0; 2])).map(|pixels| pixels * pixel_um))
            .collect();
        let nuisances = nuisances.fit(self.data, &grids, &self.used);
        self.at(&[], theta, nuisances)
    }

    /// The forms at given numbers.
    pub fn at(&self, active: &[usize], theta: Vec<f64>, nuisances: Nuisances) -> Fit {
        let blocks: Vec<Block> = (0..self.data.signal.len())
            .into_par_iter()
            .map(|c| self.block(active, &theta, &nuisances, c))
            .collect();
        let mut forms: Vec<_> = blocks.iter().map(Block::reduced).collect();
        forms.push(self.sem_form(active, &theta));
        let free: Vec<usize> = (0..self.shared()).collect();
        let (_, chi2) = minimise(&self.total(&forms, &nuisances), &free);
        Fit {
            active: active.to_vec(),
            theta,
            nuisances,
            blocks,
            forms,
            chi2,
        }
    }

    /// Fit some numbers, starting from where another fit rests.
    pub fn fit(&self, active: &[usize], from: &Fit) -> Fit {
        let mut now = self.at(active, from.theta.clone(), from.nuisances.clone());
        let (mut damping, shared) = (1e-4, self.shared());
        let free: Vec<usize> = (0..shared + active.len()).collect();
        for _ in 0..STEPS {
            let mut form = self.total(&now.forms, &now.nuisances);
            let size = form.nrows();
            for k in shared..size - 1 {
                form[(k, k)] *= 1.0 + damping;
            }
            let (step, _) = minimise(&form, &free);
            let mut theta = now.theta.clone();
            for (i, &slot) in active.iter().enumerate() {
                let (low, high) = self.atlas.reach(slot);
                let range = self.simulator.slots[slot].parameter.range;
                theta[slot] = (theta[slot] + step[shared + i]).clamp(low.max(range.0), high.min(range.1));
            }
            let moved: Vec<f64> = active.iter().map(|&s| theta[s] - now.theta[s]).collect();
            let nuisances = self.follow(&now, &moved);
            let next = self.at(active, theta, nuisances);
            if next.chi2 < now.chi2 {
                let gain = now.chi2 - next.chi2;
                now = next;
                damping = (damping * 0.2).max(1e-9);
                if gain < AT_REST * now.chi2 {
                    break;
                }
            } else {
                damping = (damping * 20.0).max(1e-2);
                if damping > 1e6 {
                    break;
                }
            }
        }
        now
    }

    /// Nuisances after the numbers have moved: shared ones refitted for that move, placement after them.
    fn follow(&self, now: &Fit, moved: &[f64]) -> Nuisances {
        let shared = self.shared();
        let at: Vec<(usize, f64)> = moved.iter().enumerate().map(|(i, m)| (shared + i, *m)).collect();
        let form = held(&self.total(&now.forms, &now.nuisances), &at);
        let (step, _) = minimise(&form, &(0..shared).collect::<Vec<_>>());
        let mut out = now.nuisances.clone();
        let all =
            nalgebra::DVector::from_iterator(shared + moved.len(), step.iter().copied().chain(moved.iter().copied()));
        let most = 2.0 * self.data.registration_um;
        for (to, block) in out.shift_um.iter_mut().zip(&now.blocks) {
            let by = block.placement(&all);
            for axis in [0, 1] {
                to[axis] += by[axis].clamp(-most, most);
            }
        }
        for l in 0..self.data.leds {
            out.flux[l] += step[l];
        }
        out.black_dn += step[self.data.leds];
        out
    }

    /// What a capture should show.
    pub fn grid(&self, theta: &[f64], capture: usize) -> PixelGrid {
        let grid = self.atlas.grid(theta, capture);
        match &self.exact {
            None => grid,
            Some(exact) => PixelGrid::combine(&[(&grid, 1.0), (&exact[capture], 1.0)]),
        }
    }

    fn block(&self, active: &[usize], theta: &[f64], nuisances: &Nuisances, c: usize) -> Block {
        let grid = self.grid(theta, c);
        let more: Vec<_> = active.iter().map(|&s| self.atlas.slope(theta, s, c)).collect();
        Block::new(self.data, c, nuisances, &grid, &more)
    }

    /// The SEM's widths as a form, their common offset fitted away.
    pub fn sem_form(&self, active: &[usize], theta: &[f64]) -> DMatrix<f64> {
        let set = self.simulator.bench.set();
        let shared = self.shared();
        let size = shared + active.len() + 1;
        if set.sem.is_empty() {
            return DMatrix::zeros(size, size);
        }
        let geometry = self.simulator.perturbation(theta).geometry;
        // Widths are linear in what moves them: a unit of each number on top.
        let ahead: Vec<_> = active
            .iter()
            .map(|&s| {
                let mut more = theta.to_vec();
                more[s] += 1.0;
                self.simulator.perturbation(&more).geometry
            })
            .collect();
        let mut gram = DMatrix::<f64>::zeros(active.len() + 2, active.len() + 2);
        for site in &set.sem {
            let Some(element) = set.elements.iter().position(|e| e.index == site.element) else {
                continue;
            };
            let lattice = set.elements[element].pillars.lattice;
            let index = |x_um: f64| (x_um / lattice.pitch_um() + 0.5 * (lattice.sites() as f64 - 1.0)).round();
            let (ix, iy) = (index(site.at_um[0]), index(site.at_um[1]));
            let inside = 0.0..lattice.sites() as f64;
            if !inside.contains(&ix) || !inside.contains(&iy) {
                continue;
            }
            let at = iy as usize * lattice.sites() + ix as usize;
            let bias = self.simulator.bench.bias_nm(element, at, &geometry);
            let mut row = vec![1.0 / site.sigma_nm];
            row.extend(
                ahead
                    .iter()
                    .map(|g| (self.simulator.bench.bias_nm(element, at, g) - bias) / site.sigma_nm),
            );
            row.push((site.measured_nm - site.designed_nm - bias) / site.sigma_nm);
            for (i, a) in row.iter().enumerate() {
                for (j, b) in row.iter().enumerate() {
                    gram[(i, j)] += a * b;
                }
            }
        }
        gram[(0, 0)] += set.sem_offset_sigma_nm.powi(-2);
        let n = active.len() + 1;
        let cross = gram.view((0, 1), (1, n)).into_owned();
        let inner = gram.view((1, 1), (n, n)) - cross.transpose() * &cross / gram[(0, 0)];
        let mut form = DMatrix::zeros(size, size);
        form.view_mut((shared, shared), (n, n)).copy_from(&inner);
        form
    }

    /// What is known of flux and black beforehand, as a form about where they are now.
    pub fn prior(&self, nuisances: &Nuisances, size: usize) -> DMatrix<f64> {
        let mut form = DMatrix::zeros(size, size);
        let last = size - 1;
        let mut hold = |k: usize, off: f64, sigma: f64| {
            let weight = sigma.powi(-2);
            form[(k, k)] = weight;
            form[(k, last)] = -off * weight;
            form[(last, k)] = -off * weight;
            form[(last, last)] += off * off * weight;
        };
        for (l, flux) in nuisances.flux.iter().enumerate() {
            hold(l, flux - 1.0, self.data.flux_sigma);
        }
        hold(self.data.leds, nuisances.black_dn, BLACK_SIGMA_DN);
        form
    }

    /// All that counts.
    pub fn total(&self, forms: &[DMatrix<f64>], nuisances: &Nuisances) -> DMatrix<f64> {
        let size = forms[0].nrows();
        let counted = forms
            .iter()
            .enumerate()
            .filter(|(c, _)| self.used.get(*c).copied().unwrap_or(true))
            .map(|(_, f)| f);
        sum(counted, size) + self.prior(nuisances, size)
    }

    /// Pixels of the captures that count.
    pub fn pixels(&self) -> f64 {
        let counted = (0..self.used.len()).filter(|&c| self.used[c]);
        counted.map(|c| self.data.pixels(c) as f64).sum()
    }
}
