//! The terms of a field at a few points that two rings make together, because their pillars are neighbours.
//!
//! E = sum over rings of K_r own(w_r) + sum over links of K_l sum over b of U_b(w_r) V_b(w_s),
//!
//! r the ring of a link and s that of the neighbours ([`crate::rings::pair_response`]). What depends on the width of one ring is gathered
//! before its candidates are tried: it is a sum of a few products for each of them.

use rayon::prelude::*;

use crate::merit::field_point::Condition;
use crate::merit::focus::Lens;
use crate::merit::ring_context::RingContext;
use crate::rings::kernel::RingField;
use crate::rings::neighbour_links::{DISTANCES, Links};
use crate::rings::pair_response::{PRODUCTS, PairResponse};
use crate::rings::split_complex::Planes;
use metalith_cell::{CellModel, NEIGHBOUR_DEGREE};
use metalith_core::{Error, Result};
use num_complex::Complex64;

/// Terms that neighbours add at each row.
pub(crate) struct NeighbourTerms {
    links: Links,
    rows: usize,
    /// Field of what a neighbour adds, `[link][row]`.
    kernel: Planes,
    /// Factors of the own width, `[width_nm][product][row]`.
    factors: Planes,
    /// Terms of neighbours in the same ring, whose width is the own one: `[width_nm][distance][row]`.
    same: Planes,
    /// Factors of a neighbour's width, by it.
    neighbour: Vec<[f32; NEIGHBOUR_DEGREE]>,
}

/// Terms of neighbours with what each pillar transmits on the mean over its neighbours.
pub(crate) struct PairTerms {
    pub terms: NeighbourTerms,
    /// Transmissions of each row, by width (nm) as far as it was asked for; `None` for padding.
    pub own: Vec<Option<Vec<Complex64>>>,
}

impl NeighbourTerms {
    /// The terms of rows that are all of the focus, without errors of fabrication, for pillars of these widths (nm) that are at
    /// most `max_width_nm` wide.
    ///
    /// # Errors
    /// If they take more than `memory_bytes` with the kernel of the rings, rows are of pillars that are made with
    /// errors, or the cell is not coupled at a wavelength.
    pub(crate) fn of(
        conditions: &[Option<Condition>],
        widths: &[u16],
        max_width_nm: u16,
        lens: &Lens,
        cell: &dyn CellModel,
        memory_bytes: u64,
    ) -> Result<PairTerms> {
        let (rows, links) = (conditions.len(), lens.rings.links().clone());
        let of_width = usize::from(max_width_nm) + 1;
        let numbers = links.all().len() + of_width * (PRODUCTS + DISTANCES);
        // In single precision, and in double precision before; and the kernel of the rings with its table.
        let bytes = (24 * numbers + 8 * (lens.rings.len() + of_width + 1)) as u64 * rows as u64;
        if bytes > memory_bytes {
            return Err(Error::refused(
                "optimise/too-much-memory",
                format!(
                    "neighbours of {} rings at {rows} wavelengths take {bytes} bytes, more than {memory_bytes}",
                    lens.rings.len()
                ),
                "take fewer wavelengths, or raise `memory_mb`",
            ));
        }
        let column = |condition: &Option<Condition>| -> Result<Option<(PairResponse, Vec<Complex64>)>> {
            let Some(condition) = *condition else {
                return Ok(None);
            };
            let wavelength_um = condition.wavelength_um;
            if condition.cell != 0 || condition.width_bias_nm != 0.0 {
                return Err(Error::refused(
                    "optimise/errors-with-neighbours",
                    "errors of fabrication are not supported with the coupled model",
                    "leave out [optimise.robust], or optimise with the cell `rigorous`",
                ));
            }
            let unlike = PairResponse::of(cell, wavelength_um, widths.iter().copied())?.ok_or_else(|| {
                Error::refused(
                    "optimise/no-neighbour-model",
                    format!("the cell `{}` has no terms for neighbours", cell.fidelity()),
                    "optimise with the cell `neighbours`",
                )
            })?;
            let field = RingField::new(&lens.rings, wavelength_um, lens.distance_um);
            let scale = 1.0 / (cell.full_transmission(wavelength_um)? * field.matched());
            let kernel = (0..lens.rings.len()).flat_map(|ring| field.on_axis_by_link(ring).map(|e| e * scale));
            Ok(Some((unlike, kernel.collect())))
        };
        let columns: Vec<_> = conditions.par_iter().map(column).collect::<Result<_>>()?;
        let mut all = NeighbourTerms {
            rows,
            kernel: Planes::zeros(links.all().len() * rows),
            factors: Planes::zeros(of_width * PRODUCTS * rows),
            same: Planes::zeros(of_width * DISTANCES * rows),
            neighbour: vec![[0.0; NEIGHBOUR_DEGREE]; of_width],
            links,
        };
        for (row, column) in columns.iter().enumerate() {
            let Some((unlike, kernel)) = column else { continue };
            for (link, e) in kernel.iter().enumerate() {
                all.kernel.set(link * rows + row, *e);
            }
            for &width in widths {
                let w = usize::from(width);
                all.neighbour[w] = unlike.neighbour[w].map(|v| v as f32);
                for (k, factor) in unlike.factors[w].iter().enumerate() {
                    all.factors.set((w * PRODUCTS + k) * rows + row, *factor);
                }
                for distance in 0..DISTANCES {
                    let pair = unlike.pair(distance, width, width);
                    all.same.set((w * DISTANCES + distance) * rows + row, pair);
                }
            }
        }
        let own = columns.into_iter().map(|c| Some(c?.0.own)).collect();
        Ok(PairTerms { terms: all, own })
    }

    /// Fields of all pairs together, added to those of rings by themselves.
    pub(crate) fn add_pairs(&self, widths_nm: &[u16], fields: &mut [Complex64]) {
        for (k, link) in self.links.all().iter().enumerate() {
            let (k_re, k_im) = self.kernel.row(k, self.rows);
            let v = self.neighbour[usize::from(widths_nm[link.other])];
            for (b, v) in v.into_iter().enumerate() {
                let (u_re, u_im) = self.factor(widths_nm[link.ring], link.distance * NEIGHBOUR_DEGREE + b);
                for (i, field) in fields.iter_mut().enumerate() {
                    field.re += f64::from(v * (k_re[i] * u_re[i] - k_im[i] * u_im[i]));
                    field.im += f64::from(v * (k_re[i] * u_im[i] + k_im[i] * u_re[i]));
                }
            }
        }
    }

    /// Context of a ring: what its width, whatever it is, is multiplied with, while others have these widths.
    pub(crate) fn context(&self, ring: usize, widths_nm: &[u16]) -> RingContext {
        let mut context = RingContext {
            around: Planes::zeros(PRODUCTS * self.rows),
            reverse: Planes::zeros(NEIGHBOUR_DEGREE * self.rows),
            same: [None; DISTANCES],
        };
        for k in self.links.of_ring(ring) {
            let link = &self.links.all()[k];
            if link.other == ring {
                context.same[link.distance] = Some(k);
                continue;
            }
            let (k_re, k_im) = self.kernel.row(k, self.rows);
            for (b, v) in self.neighbour[usize::from(widths_nm[link.other])]
                .into_iter()
                .enumerate()
            {
                let (re, im) = context.around.row_mut(link.distance * NEIGHBOUR_DEGREE + b, self.rows);
                add_scaled((re, im), v, (k_re, k_im));
            }
        }
        for &k in self.links.to_ring(ring) {
            let link = &self.links.all()[k];
            for b in 0..NEIGHBOUR_DEGREE {
                let u = self.factor(widths_nm[link.ring], link.distance * NEIGHBOUR_DEGREE + b);
                add_product(context.reverse.row_mut(b, self.rows), self.kernel.row(k, self.rows), u);
            }
        }
        context
    }

    /// Add what the width of a ring that is visited contributes beside its own transmission.
    #[inline(always)]
    pub(crate) fn add_contribution(&self, width_nm: u16, context: &RingContext, out: &mut Planes) {
        let (re, im) = (&mut out.re[..], &mut out.im[..]);
        for product in 0..PRODUCTS {
            let around = context.around.row(product, self.rows);
            add_product((re, im), around, self.factor(width_nm, product));
        }
        for (distance, link) in context.same.iter().enumerate() {
            if let Some(link) = link {
                let same = self.same.row(usize::from(width_nm) * DISTANCES + distance, self.rows);
                add_product((re, im), self.kernel.row(*link, self.rows), same);
            }
        }
        for (b, v) in self.neighbour[usize::from(width_nm)].into_iter().enumerate() {
            add_scaled((re, im), v, context.reverse.row(b, self.rows));
        }
    }

    fn factor(&self, width_nm: u16, product: usize) -> (&[f32], &[f32]) {
        self.factors.row(usize::from(width_nm) * PRODUCTS + product, self.rows)
    }
}

#[inline(always)]
fn add_product((re, im): (&mut [f32], &mut [f32]), (a_re, a_im): (&[f32], &[f32]), (b_re, b_im): (&[f32], &[f32])) {
    let n = re.len();
    let (im, a_re, a_im, b_re, b_im) = (&mut im[..n], &a_re[..n], &a_im[..n], &b_re[..n], &b_im[..n]);
    for i in 0..n {
        re[i] += a_re[i] * b_re[i] - a_im[i] * b_im[i];
        im[i] += a_re[i] * b_im[i] + a_im[i] * b_re[i];
    }
}

#[inline(always)]
fn add_scaled((re, im): (&mut [f32], &mut [f32]), by: f32, (a_re, a_im): (&[f32], &[f32])) {
    let n = re.len();
    let (im, a_re, a_im) = (&mut im[..n], &a_re[..n], &a_im[..n]);
    for i in 0..n {
        re[i] += by * a_re[i];
        im[i] += by * a_im[i];
    }
}

#[cfg(test)]
mod tests {
    use metalith_cell::{CellModel, CellResponse, Fidelity, Illumination, NeighbourTables, SiteResponse};
    use metalith_core::Silent;
    use metalith_design::array::PillarRule;
    use metalith_design::{Design, cell_models};
    use metalith_pillars::{Lattice, PillarMap};

    use super::*;
    use crate::merit::field::{FLOOR, FieldProblem, MeritKind};
    use crate::merit::focus::FabricationError;
    use crate::solvers::score::Fields;
    use crate::{Exchange, Mapping, Objective, Rings, Schedule, StepLimit, wavelengths};

    /// Single precision over some ten thousand products, of a field near one.
    const SINGLE: f64 = 2e-5;

    /// The cell of the full-size designs, whose tables come with the program, and a small lens.
    struct Setup {
        cell: Box<dyn CellModel>,
        lens: Lens,
        mapping: Mapping,
        wavelengths_um: Vec<f64>,
    }

    impl Setup {
        fn new(diameter_nm: u32) -> Self {
            let design = Design::read(&metalith_testing::design("broadband_3x3")).unwrap();
            let rings = Rings::new(Lattice::covering(diameter_nm, 350).unwrap(), diameter_nm).unwrap();
            Self {
                cell: cell_models(&design, &[Fidelity::Neighbours]).unwrap().remove(0),
                lens: Lens {
                    rings,
                    distance_um: 2.4e-3 * f64::from(diameter_nm),
                },
                mapping: Mapping::new(&PillarRule::new(&design.cell, &design.mapping)),
                wavelengths_um: wavelengths(460.0, 660.0, 20.0),
            }
        }

        fn problem(&self) -> FieldProblem {
            let cells = [self.cell.as_ref()];
            let rows = self
                .lens
                .focal_rows(&self.wavelengths_um, FabricationError::default(), &cells);
            let blocks = vec![(MeritKind::Log, 1.0, rows.unwrap())];
            let problem = FieldProblem::new(blocks, &cells, self.mapping.clone(), 1 << 28).unwrap();
            problem.among_neighbours(&self.lens, cells[0], 1 << 28).unwrap()
        }

        /// Widths that jump from ring to ring.
        fn widths(&self) -> Vec<u16> {
            let choices = self.mapping.choices();
            let of = |ring: usize| choices[(ring * ring * 7 + ring * 31) % choices.len()].width_nm;
            (0..self.lens.rings.len()).map(of).collect()
        }

        /// The field at the focus, site by site, each among the twelve pillars about it.
        fn of_sites(&self, widths: &PillarMap, wavelength_um: f64) -> Complex64 {
            let light = Illumination::normal(wavelength_um).in_band();
            let response = self.cell.response(&light, 0, &Silent).unwrap();
            let CellResponse::Neighbours(NeighbourTables::Band(response)) = response else {
                panic!("it knows its neighbours")
            };
            let field = RingField::new(&self.lens.rings, wavelength_um, self.lens.distance_um);
            let n = widths.lattice.sites() as i32;
            let width = |x: i32, y: i32| {
                let inside = (0..n).contains(&x) && (0..n).contains(&y);
                if inside {
                    widths.number[(y as usize, x as usize)]
                } else {
                    0
                }
            };
            let mut sum = Complex64::ZERO;
            for (y, x) in (0..n * n).map(|k| (k / n, k % n)).filter(|(y, x)| width(*x, *y) > 0) {
                let own = f64::from(width(x, y));
                let mut t = response.own(own);
                for (number, [dx, dy]) in metalith_cell::NEIGHBOURS.into_iter().enumerate() {
                    let other = width(x + dx, y + dy);
                    if other > 0 {
                        t += response.pair(number, own, f64::from(other));
                    }
                }
                let units2 = widths.lattice.units2(x as usize, y as usize) as f64;
                sum += field.point(units2 * widths.lattice.unit_um().powi(2)) * t;
            }
            sum / (field.matched() * self.cell.full_transmission(wavelength_um).unwrap())
        }
    }

    #[test]
    fn fields_and_strehl_ratios_are_sums_over_all_sites_and_their_neighbours() {
        /// Eight radii for the sites of a ring, in double precision.
        const OF_RINGS: f64 = 1e-7;
        let setup = Setup::new(24_000);
        let (problem, widths) = (setup.problem(), setup.widths());
        let map = setup.lens.rings.width_map(&widths);
        let fields = problem.fields_of_widths(&widths);
        let cell = setup.cell.as_ref();
        let rings = setup
            .lens
            .strehl_of_rings(&widths, cell, &setup.wavelengths_um)
            .unwrap();
        let layout = setup.lens.strehl_of_layout(&map, cell, &setup.wavelengths_um).unwrap();
        let mut apart: f64 = 0.0;
        for (i, um) in setup.wavelengths_um.iter().enumerate() {
            let wanted = setup.of_sites(&map, *um);
            assert!((fields[i] - wanted).norm() < SINGLE, "{um}: {} {wanted}", fields[i]);
            assert!((rings.ratio[i] - wanted.norm_sqr()).abs() < OF_RINGS, "{um}");
            assert!((layout.ratio[i] - wanted.norm_sqr()).abs() < OF_RINGS, "{um}");
            // Neighbours count, or nothing would be shown.
            let equal = problem.fields(|ring| (f64::from(widths[ring]), 0.0))[i];
            apart = apart.max((equal - wanted).norm());
        }
        assert!(apart > 100.0 * SINGLE, "{apart}");
    }

    /// One ring changed, over all rows: what it contributes, the merit, and the gain to first order.
    #[test]
    fn a_ring_that_changes_changes_what_is_about_it() {
        let setup = Setup::new(16_000);
        let (problem, mut widths) = (setup.problem(), setup.widths());
        let choices: Vec<u16> = setup.mapping.choices().iter().map(|c| c.width_nm).collect();
        let mut gains = vec![0.0; problem.rings() * choices.len()];
        let merit = problem.expand(&widths, &mut gains);
        assert_eq!(merit, problem.merit(&widths));
        for ring in [0, 1, 2, 11, problem.rings() - 1] {
            let context = problem.context(ring, &widths);
            let mut own = Planes::zeros(problem.rows());
            let mut contribution = |width: u16| {
                problem.contribution(ring, width, context.as_ref(), &mut own);
                let both = own.re.iter().zip(&own.im);
                both.map(|(re, im)| Complex64::new(f64::from(*re), f64::from(*im)))
                    .collect::<Vec<_>>()
            };
            let (before, old) = (problem.fields_of_widths(&widths), widths[ring]);
            let now = contribution(old);
            let mut without = Planes::zeros(problem.rows());
            let mut one_over_now = vec![0.0; problem.rows()];
            for (i, (field, own)) in before.iter().zip(&now).enumerate() {
                without.set(i, field - own);
                one_over_now[i] = 1.0 / (field.norm_sqr() + FLOOR) as f32;
            }
            let fields = Fields {
                without: &without,
                one_over_now: &one_over_now,
            };
            let mut scores = vec![0.0; choices.len()];
            problem.score(ring, context.as_ref(), fields, &choices, &mut scores);
            let slopes = problem.field_gradient(&before);
            for (k, &width) in choices.iter().enumerate().step_by(9) {
                let new = contribution(width);
                widths[ring] = width;
                let after = problem.fields_of_widths(&widths);
                for i in 0..setup.wavelengths_um.len() {
                    let (found, wanted) = (new[i] - now[i], after[i] - before[i]);
                    assert!((found - wanted).norm() < SINGLE, "{ring} {width}: {found} {wanted}");
                }
                let gained = problem.merit(&widths) - merit;
                // Logarithms of ratios that are far from zero where one ring of few changes.
                assert!(
                    (scores[k] - gained).abs() < 1e-3,
                    "{ring} {width}: {} {gained}",
                    scores[k]
                );
                let slope: f64 = slopes
                    .iter()
                    .zip(after.iter().zip(&before))
                    .map(|(g, (a, b))| {
                        let change = a - b;
                        2.0 * (g.re * change.re + g.im * change.im)
                    })
                    .sum();
                let gain = gains[ring * choices.len() + k];
                assert!(
                    (gain - slope).abs() < 1e-3 * (1.0 + slope.abs()),
                    "{ring} {width}: {gain} {slope}"
                );
            }
            widths[ring] = old;
        }
    }

    /// Test that at the end of a cold exchange no single ring has a better width, by the merit over all pairs.
    #[test]
    fn an_exchange_ends_where_no_ring_gains() {
        let setup = Setup::new(30_000);
        let problem = setup.problem();
        let schedule = Schedule {
            hot_sweeps: 2,
            cold_sweeps: 60,
            temperature: (1e-2, 1e-3),
        };
        let limit = StepLimit::new(0.5).unwrap();
        let start = setup.mapping.turns_of(&vec![5; problem.rings()]);
        let mut exchange = Exchange::new(&problem, limit, schedule, 3, &start);
        while !exchange.finished() {
            exchange.sweep_once();
        }
        let mut widths = exchange.widths_nm();
        let best = problem.merit(&widths);
        assert!(best > problem.merit(&setup.widths()));
        for ring in [0, 1, 9, problem.rings() - 1] {
            let kept = widths[ring];
            for choice in setup.mapping.choices() {
                widths[ring] = choice.width_nm;
                let merit = problem.merit(&widths);
                assert!(
                    merit < best + 100.0 * SINGLE,
                    "{ring} {}: {merit} {best}",
                    choice.width_nm
                );
            }
            widths[ring] = kept;
        }
    }
}
