//! The inner loop of exchange: the merit of every candidate of one ring.

use crate::merit::field::{FLOOR, FieldProblem, MeritKind};
use crate::merit::ring_context::RingContext;
use crate::rings::split_complex::Planes;

impl FieldProblem {
    /// The merit, but for a constant, with each candidate width in one ring. `fields` are those without what depends on that
    /// width, and the inverse intensities that logarithms count from.
    pub fn score(
        &self,
        ring: usize,
        context: Option<&RingContext>,
        fields: Fields<'_>,
        widths_nm: &[u16],
        scores: &mut [f64],
    ) {
        pulp::Arch::new().dispatch(|| {
            if context.is_none() {
                let kernel = self.kernel_of(ring);
                for (score, &width) in scores.iter_mut().zip(widths_nm) {
                    *score = self.score_of(kernel, self.transmission_of(width), fields);
                }
            } else {
                let one = vec![1.0; self.rows()];
                let none = vec![0.0; self.rows()];
                let mut own = Planes::zeros(self.rows());
                for (score, &width) in scores.iter_mut().zip(widths_nm) {
                    self.contribution(ring, width, context, &mut own);
                    *score = self.score_of((&own.re, &own.im), (&one, &none), fields);
                }
            }
        });
    }

    /// Score with a kernel times a transmission in place of what was left out.
    #[inline(always)]
    fn score_of(
        &self,
        (k_re, k_im): (&[f32], &[f32]),
        (t_re, t_im): (&[f32], &[f32]),
        Fields { without, one_over_now }: Fields<'_>,
    ) -> f64 {
        let mut score = 0.0;
        for block in &self.blocks {
            let r = block.rows.clone();
            let trial = Trial {
                base: (&without.re[r.clone()], &without.im[r.clone()]),
                kernel: (&k_re[r.clone()], &k_im[r.clone()]),
                transmission: (&t_re[r.clone()], &t_im[r.clone()]),
            };
            score += block.weight
                * match block.kind {
                    MeritKind::Log => trial.log_ratio(&one_over_now[r]) / block.live as f64,
                    MeritKind::Linear => trial.weighted(&self.row_weight[r]),
                };
        }
        score
    }
}

/// Fields that a ring is tried in.
#[derive(Clone, Copy)]
pub struct Fields<'a> {
    /// Fields without what depends on the width of the ring.
    pub without: &'a Planes,
    /// Inverse intensities that logarithms count from.
    pub one_over_now: &'a [f32],
}

/// One ring's contribution added to the field of all others, a block of rows long.
struct Trial<'a> {
    base: (&'a [f32], &'a [f32]),
    kernel: (&'a [f32], &'a [f32]),
    transmission: (&'a [f32], &'a [f32]),
}

impl Trial<'_> {
    /// Intensities of eight rows.
    #[inline(always)]
    fn intensity(&self, i: usize) -> [f32; 8] {
        let at = |s: &[f32]| -> [f32; 8] { s.as_chunks::<8>().0[i] };
        let (b_re, b_im) = (at(self.base.0), at(self.base.1));
        let (k_re, k_im) = (at(self.kernel.0), at(self.kernel.1));
        let (t_re, t_im) = (at(self.transmission.0), at(self.transmission.1));
        let mut out = [0.0; 8];
        for l in 0..8 {
            let re = b_re[l] + k_re[l] * t_re[l] - k_im[l] * t_im[l];
            let im = b_im[l] + k_re[l] * t_im[l] + k_im[l] * t_re[l];
            out[l] = re * re + im * im + FLOOR as f32;
        }
        out
    }

    /// Sum of ln(intensity / present intensity): one logarithm of the product of all ratios. One ring of
    /// many changes an intensity by little, so that the product stays within double precision; if it
    /// does not, the candidate is as bad as the -inf it gets.
    #[inline(always)]
    fn log_ratio(&self, one_over_now: &[f32]) -> f64 {
        let groups = one_over_now.as_chunks::<8>().0;
        let mut product = [1.0f64; 8];
        for (g, four) in groups.chunks_exact(4).enumerate() {
            let mut part = [1.0f32; 8];
            for (j, now) in four.iter().enumerate() {
                let intensity = self.intensity(4 * g + j);
                for l in 0..8 {
                    part[l] *= intensity[l] * now[l];
                }
            }
            for l in 0..8 {
                product[l] *= f64::from(part[l]);
            }
        }
        product.iter().product::<f64>().ln()
    }

    #[inline(always)]
    fn weighted(&self, weights: &[f32]) -> f64 {
        let mut sum = [0.0f64; 8];
        for (g, weight) in weights.as_chunks::<8>().0.iter().enumerate() {
            let intensity = self.intensity(g);
            for l in 0..8 {
                sum[l] += f64::from(weight[l] * intensity[l]);
            }
        }
        sum.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::merit::field::tests::{problem, start};

    /// Scores of candidates against the merit with each of them in place.
    #[test]
    fn scores_are_differences_of_the_merit() {
        /// Single precision over a hundred rows.
        const TOLERANCE: f64 = 2e-5;
        let problem = problem();
        let mapping = problem.mapping();
        let mut widths = start()
            .iter()
            .map(|&t| mapping.choices()[mapping.nearest(t)].width_nm)
            .collect::<Vec<_>>();
        let ring = 40;
        let all = mapping.choices().iter().map(|c| c.width_nm).collect::<Vec<_>>();
        let (k, t) = (problem.kernel_of(ring), problem.transmission_of(widths[ring]));
        let exact = problem.fields(|r| (f64::from(widths[r]), 0.0));
        let mut without = Planes::zeros(problem.rows());
        let mut one_over_now = vec![0.0; problem.rows()];
        for (i, e) in exact.iter().enumerate() {
            without.re[i] = e.re as f32 - (k.0[i] * t.0[i] - k.1[i] * t.1[i]);
            without.im[i] = e.im as f32 - (k.0[i] * t.1[i] + k.1[i] * t.0[i]);
            one_over_now[i] = 1.0 / (e.norm_sqr() + FLOOR) as f32;
        }
        let mut scores = vec![0.0; all.len()];
        let fields = Fields {
            without: &without,
            one_over_now: &one_over_now,
        };
        problem.score(ring, None, fields, &all, &mut scores);
        let merits = all
            .iter()
            .map(|&w| {
                widths[ring] = w;
                problem.merit_of_widths(&widths)
            })
            .collect::<Vec<_>>();
        for i in 1..all.len() {
            let (quick, exact) = (scores[i] - scores[0], merits[i] - merits[0]);
            assert!((quick - exact).abs() < TOLERANCE, "{} nm: {quick} {exact}", all[i]);
        }
    }
}
