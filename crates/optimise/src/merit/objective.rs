//! Objective that a gradient climbs.

/// A merit of the phases of the rings; larger is better.
pub trait Objective: Sync {
    /// The merit with pillars of `widths_nm[k]` in ring `k`.
    fn merit(&self, widths_nm: &[u16]) -> f64;

    /// The merit that step `step` climbs, with its gradient (1/turn) added to `gradient`. Parts that are
    /// drawn afresh for each step depend on the seed and the step alone.
    fn climb(&self, waves: &[f64], seed: u64, step: u32, gradient: &mut [f64]) -> f64;

    /// The merit with pillars of `widths_nm`, and what each choice in each ring would add to it to first order
    /// in the ring's transmissions, all resonances in them: added to `gains`, `[ring][choice]`.
    fn expand(&self, widths_nm: &[u16], gains: &mut [f64]) -> f64;
}

/// A weighted sum of merits.
pub struct Sum<'o>(pub Vec<(f64, &'o dyn Objective)>);

impl Objective for Sum<'_> {
    fn merit(&self, widths_nm: &[u16]) -> f64 {
        self.0.iter().map(|(weight, part)| weight * part.merit(widths_nm)).sum()
    }

    fn climb(&self, waves: &[f64], seed: u64, step: u32, gradient: &mut [f64]) -> f64 {
        let mut merit = 0.0;
        for (weight, part) in &self.0 {
            let mut own = vec![0.0; gradient.len()];
            merit += weight * part.climb(waves, seed, step, &mut own);
            gradient.iter_mut().zip(own).for_each(|(g, o)| *g += weight * o);
        }
        merit
    }

    fn expand(&self, widths_nm: &[u16], gains: &mut [f64]) -> f64 {
        let mut merit = 0.0;
        for (weight, part) in &self.0 {
            let mut own = vec![0.0; gains.len()];
            merit += weight * part.expand(widths_nm, &mut own);
            gains.iter_mut().zip(own).for_each(|(g, o)| *g += weight * o);
        }
        merit
    }
}
