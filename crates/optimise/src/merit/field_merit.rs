//! The merit of the field at a few points, its gradient, and its expansion to first order.

use num_complex::Complex64;
use rayon::prelude::*;

use crate::merit::field::{FLOOR, FieldProblem, LANES, MeritKind};
use crate::merit::objective::Objective;
use crate::rings::split_complex::Planes;

impl FieldProblem {
    /// Merit if ring `k` has pillars of `width_nm[k]`.
    pub fn merit_of_widths(&self, width_nm: &[u16]) -> f64 {
        self.merit_of_fields(&self.fields_of_widths(width_nm))
    }

    /// Fields of all rows with pillars of these widths, in double precision.
    pub fn fields_of_widths(&self, width_nm: &[u16]) -> Vec<Complex64> {
        let mut fields = self.fields(|ring| (f64::from(width_nm[ring]), 0.0));
        if let Some(surroundings) = &self.surroundings {
            surroundings.add_pairs(width_nm, &mut fields);
        }
        fields
    }

    /// Merit at continuous phases (waves), widths not rounded. Its gradient (1/turn) is added to
    /// `gradient`.
    ///
    /// # Panics
    /// Among dissimilar neighbours, whose widths are whole: designs with them and a solver that needs this are refused.
    pub fn merit_of_phases(&self, waves: &[f64], gradient: Option<&mut [f64]>) -> f64 {
        assert!(self.surroundings.is_none(), "no slopes among unlike neighbours");
        let widths = waves.iter().map(|&t| self.mapping.width_nm(t)).collect::<Vec<_>>();
        let fields = self.fields(|ring| widths[ring]);
        let merit = self.merit_of_fields(&fields);
        if let Some(gradient) = gradient {
            let adjoint = self.field_gradient(&fields);
            for (ring, slope) in gradient.iter_mut().enumerate() {
                *slope += self.adjoint(ring, widths[ring].0, &adjoint) * widths[ring].1;
            }
        }
        merit
    }

    /// Fields of all rows, in double precision.
    pub fn fields(&self, width_of: impl Fn(usize) -> (f64, f64)) -> Vec<Complex64> {
        let mut fields = vec![Complex64::ZERO; self.rows()];
        for ring in 0..self.rings() {
            let (k_re, k_im) = self.kernel_of(ring);
            let (low, high, part) = self.bracket(width_of(ring).0);
            for (i, field) in fields.iter_mut().enumerate() {
                let re = low.0[i] + part * (high.0[i] - low.0[i]);
                let im = low.1[i] + part * (high.1[i] - low.1[i]);
                field.re += f64::from(k_re[i] * re - k_im[i] * im);
                field.im += f64::from(k_re[i] * im + k_im[i] * re);
            }
        }
        fields
    }

    /// The merit of given fields.
    fn merit_of_fields(&self, fields: &[Complex64]) -> f64 {
        self.blocks
            .iter()
            .map(|block| {
                let rows = block.rows.start..block.rows.start + block.live;
                let sum = match block.kind {
                    MeritKind::Log => {
                        fields[rows].iter().map(|e| (e.norm_sqr() + FLOOR).ln()).sum::<f64>() / block.live as f64
                    }
                    MeritKind::Linear => fields[rows.clone()]
                        .iter()
                        .zip(&self.row_weight[rows])
                        .map(|(e, &w)| f64::from(w) * e.norm_sqr())
                        .sum(),
                };
                block.weight * sum
            })
            .sum()
    }

    /// Derivative of the merit by the conjugate of each field (Wirtinger).
    pub(crate) fn field_gradient(&self, fields: &[Complex64]) -> Vec<Complex64> {
        let mut gradient = vec![Complex64::ZERO; self.rows()];
        for block in &self.blocks {
            for i in block.rows.start..block.rows.start + block.live {
                let scale = match block.kind {
                    MeritKind::Log => 1.0 / (block.live as f64 * (fields[i].norm_sqr() + FLOOR)),
                    MeritKind::Linear => f64::from(self.row_weight[i]),
                };
                gradient[i] = block.weight * scale * fields[i];
            }
        }
        gradient
    }

    /// Derivative of the merit by the width of one ring: twice the real part of <field gradient, dE/dw>.
    fn adjoint(&self, ring: usize, width_nm: f64, field_gradient: &[Complex64]) -> f64 {
        let (k_re, k_im) = self.kernel_of(ring);
        let (low, high, _) = self.bracket(width_nm);
        let mut sum = 0.0;
        for (i, g) in field_gradient.iter().enumerate() {
            let (re, im) = (high.0[i] - low.0[i], high.1[i] - low.1[i]);
            sum += g.re * f64::from(k_re[i] * re - k_im[i] * im) + g.im * f64::from(k_re[i] * im + k_im[i] * re);
        }
        2.0 * sum
    }

    /// [`Objective::expand`] where a ring acts on those about it.
    fn expand_contexts(&self, widths_nm: &[u16], slopes: &[Complex64], gains: &mut [f64]) {
        let choices = self.mapping.choices();
        let rings = gains.par_chunks_exact_mut(choices.len()).enumerate();
        rings.for_each_init(
            || Planes::zeros(self.rows()),
            |own, (ring, gains)| {
                let context = self.context(ring, widths_nm);
                let mut of = |width: u16| {
                    self.contribution(ring, width, context.as_ref(), own);
                    let each = slopes.iter().zip(own.re.iter().zip(&own.im));
                    2.0 * each
                        .map(|(g, (re, im))| g.re * f64::from(*re) + g.im * f64::from(*im))
                        .sum::<f64>()
                };
                let now = of(widths_nm[ring]);
                for (gain, choice) in gains.iter_mut().zip(choices) {
                    *gain += of(choice.width_nm) - now;
                }
            },
        );
    }

    /// The two whole widths about one, and how far it is from the lower to the upper.
    #[allow(clippy::type_complexity)] // two pairs of planes
    fn bracket(&self, width_nm: f64) -> ((&[f32], &[f32]), (&[f32], &[f32]), f32) {
        let low = (width_nm.max(0.0) as u16).min(self.mapping.max_width_nm());
        (
            self.transmission_of(low),
            self.transmission_of(low + 1),
            (width_nm - f64::from(low)) as f32,
        )
    }
}

impl Objective for FieldProblem {
    fn merit(&self, widths_nm: &[u16]) -> f64 {
        self.merit_of_widths(widths_nm)
    }

    fn climb(&self, waves: &[f64], _seed: u64, _step: u32, gradient: &mut [f64]) -> f64 {
        self.merit_of_phases(waves, Some(gradient))
    }

    fn expand(&self, widths_nm: &[u16], gains: &mut [f64]) -> f64 {
        let fields = self.fields_of_widths(widths_nm);
        let slopes = self.field_gradient(&fields);
        let choices = self.mapping.choices();
        if self.surroundings.is_some() {
            self.expand_contexts(widths_nm, &slopes, gains);
            return self.merit_of_fields(&fields);
        }
        gains
            .par_chunks_exact_mut(choices.len())
            .enumerate()
            .for_each(|(ring, gains)| {
                let (k_re, k_im) = self.kernel_of(ring);
                let mut own = Planes::zeros(self.rows());
                for (i, slope) in slopes.iter().enumerate() {
                    let (re, im) = (slope.re as f32, slope.im as f32);
                    own.re[i] = k_re[i] * re + k_im[i] * im;
                    own.im[i] = k_re[i] * im - k_im[i] * re;
                }
                let of = |width: u16| {
                    let (t_re, t_im) = self.transmission_of(width);
                    let mut sum = [0.0f32; LANES];
                    for start in (0..self.rows()).step_by(LANES) {
                        for (l, sum) in sum.iter_mut().enumerate() {
                            let i = start + l;
                            *sum += own.re[i] * t_re[i] + own.im[i] * t_im[i];
                        }
                    }
                    2.0 * sum.iter().map(|&s| f64::from(s)).sum::<f64>()
                };
                let now = of(widths_nm[ring]);
                for (gain, choice) in gains.iter_mut().zip(choices) {
                    *gain += of(choice.width_nm) - now;
                }
            });
        self.merit_of_fields(&fields)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::merit::field::tests::{problem, start};

    #[test]
    fn the_gradient_is_that_of_differences() {
        /// Single precision of the kernel, and the square of the difference, against the largest slope.
        const TOLERANCE: f64 = 2e-3;
        let (problem, waves, h) = (problem(), start(), 1e-3);
        let mut gradient = vec![0.0; problem.rings()];
        problem.merit_of_phases(&waves, Some(&mut gradient));
        let largest = gradient.iter().map(|g| g.abs()).fold(0.0, f64::max);
        for ring in (0..problem.rings()).step_by(7) {
            let at = |h: f64| {
                let mut moved = waves.clone();
                moved[ring] += h;
                problem.merit_of_phases(&moved, None)
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            assert!(
                (difference - gradient[ring]).abs() < TOLERANCE * largest,
                "ring {ring}: {difference} {}",
                gradient[ring]
            );
        }
    }

    /// <g, A d> = <A* g, d> for the derivative A of the fields by the widths.
    #[test]
    fn the_adjoint_is_the_adjoint() {
        /// Sums of some thousand terms of single precision.
        const TOLERANCE: f64 = 1e-5;
        let problem = problem();
        let widths = start()
            .iter()
            .map(|&t| problem.mapping().width_nm(t).0)
            .collect::<Vec<_>>();
        let (h, d) = (
            0.45,
            (0..widths.len()).map(|i| (i as f64 * 0.9).cos()).collect::<Vec<_>>(),
        );
        let g = (0..problem.rows())
            .map(|i| Complex64::cis(i as f64 * 2.3))
            .collect::<Vec<_>>();
        // Transmission is a straight line between whole widths: stay between them.
        let whole = |w: f64| w.floor() + 0.5;
        let fields = |s: f64| problem.fields(|ring| (whole(widths[ring]) + s * d[ring], 0.0));
        let (plus, minus) = (fields(h), fields(-h));
        let inner = |a: &Complex64, b: Complex64| a.re * b.re + a.im * b.im;
        let left = g
            .iter()
            .zip(plus.iter().zip(&minus))
            .map(|(g, (p, m))| 2.0 * inner(g, (p - m) / (2.0 * h)))
            .sum::<f64>();
        let right = d
            .iter()
            .enumerate()
            .map(|(ring, d)| d * problem.adjoint(ring, whole(widths[ring]), &g))
            .sum::<f64>();
        let scale = d
            .iter()
            .enumerate()
            .map(|(ring, d)| (d * problem.adjoint(ring, whole(widths[ring]), &g)).abs())
            .sum::<f64>();
        assert!((left - right).abs() < TOLERANCE * scale, "{left} {right} of {scale}");
    }

    /// Gain of a single choice to first order, against the merit with a small part of it in place.
    #[test]
    fn first_order_gains_are_slopes_of_the_merit() {
        /// Single precision over a hundred rows.
        const TOLERANCE: f64 = 1e-3;
        let problem = problem();
        let mapping = problem.mapping();
        let choices = mapping.choices();
        let widths = mapping.widths_of(&start().iter().map(|&t| mapping.nearest(t)).collect::<Vec<_>>());
        let mut gains = vec![0.0; problem.rings() * choices.len()];
        let merit = problem.expand(&widths, &mut gains);
        assert_eq!(merit, problem.merit_of_widths(&widths));
        let fields = problem.fields(|ring| (f64::from(widths[ring]), 0.0));
        let largest = gains.iter().map(|g| g.abs()).fold(0.0, f64::max);
        for (ring, choice) in [(0, 3), (20, 93), (57, 40), (85, 0)] {
            let (k, part) = (problem.kernel_of(ring), 1e-3);
            let now = problem.transmission_of(widths[ring]);
            let new = problem.transmission_of(choices[choice].width_nm);
            let at = |part: f64| {
                let mut fields = fields.clone();
                for (i, field) in fields.iter_mut().enumerate() {
                    let change = Complex64::new((new.0[i] - now.0[i]).into(), (new.1[i] - now.1[i]).into());
                    *field += Complex64::new(k.0[i].into(), k.1[i].into()) * change * part;
                }
                problem.merit_of_fields(&fields)
            };
            let slope = (at(part) - at(-part)) / (2.0 * part);
            let found = gains[ring * choices.len() + choice];
            assert!((slope - found).abs() < TOLERANCE * largest, "{ring}: {slope} {found}");
        }
    }
}
