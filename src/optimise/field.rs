//! Merits of the field at a few points: linear in the transmission of each ring, and quick to change
//! one ring at a time.

use std::ops::Range;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::mapping::Mapping;
use super::planes::Planes;
use crate::cell::CellModel;
use crate::error::{Error, Result};

/// Rows are padded to whole groups of this many, so that inner loops have no ends to tidy.
pub(crate) const LANES: usize = 32;
/// Added to every intensity under a logarithm, in units of the matched peak: keeps a field of zero finite
/// and is a thousandth of a hyperbolic lens at its worst wavelength.
pub(crate) const FLOOR: f64 = 1e-9;

/// What a cell is asked for at one row: a wavelength and an error of fabrication.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// Vacuum wavelength [um].
    pub wavelength_um: f64,
    /// Which of the cells given: they differ in height.
    pub cell: usize,
    /// Made width less designed width [nm].
    pub width_bias_nm: f64,
}

/// A point of the field: its condition, what each ring contributes, and its weight in the merit.
#[derive(Clone, Debug)]
pub struct Row {
    /// Wavelength and fabrication error.
    pub condition: Condition,
    /// Field of each ring of unit transmission, in units of the matched peak at full transmission.
    pub kernel: Vec<Complex32>,
    /// Weight within its block; logarithms take them all as one.
    pub weight: f32,
}

/// How the intensities of a block make a merit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Mean of the logarithms.
    Log,
    /// Weighted sum; the weights may be negative.
    Linear,
}

/// Rows that are summed up in one way.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub kind: Kind,
    pub weight: f64,
    /// Padded to `LANES`.
    pub rows: Range<usize>,
    pub live: usize,
}

/// A merit of the field as a function of the phases of the rings. Larger is better.
pub struct FieldProblem {
    rings: usize,
    rows: usize,
    pub(super) blocks: Vec<Block>,
    pub(super) row_weight: Vec<f32>,
    /// `[ring][row]`.
    kernel: Planes,
    /// Transmission, `[width_nm][row]`, made width taken from the designed one.
    table: Planes,
    mapping: Mapping,
}

impl FieldProblem {
    /// A merit that is the sum of `weight` times each block of rows.
    ///
    /// `cells` are what [`Condition::cell`] counts. `memory_bytes` bounds the kernel.
    ///
    /// # Errors
    /// If there are no rows, the rows disagree in the number of rings, the kernel would not fit, or a cell
    /// does not cover a wavelength.
    pub fn new(
        blocks: Vec<(Kind, f64, Vec<Row>)>,
        cells: &[&dyn CellModel],
        mapping: Mapping,
        memory_bytes: u64,
    ) -> Result<Self> {
        let rings = blocks
            .iter()
            .flat_map(|b| &b.2)
            .map(|r| r.kernel.len())
            .max()
            .unwrap_or(0);
        if rings == 0 || blocks.iter().flat_map(|b| &b.2).any(|r| r.kernel.len() != rings) {
            return Err(Error::invalid(
                "the rows of a merit are empty or differ in the number of rings",
                "give every row one number a ring",
            ));
        }
        let mut layout = Vec::new();
        let mut all = Vec::<Option<Row>>::new();
        for (kind, weight, rows) in blocks {
            let (start, live) = (all.len(), rows.len());
            all.extend(rows.into_iter().map(Some));
            all.resize_with(all.len().next_multiple_of(LANES), || None);
            layout.push(Block {
                kind,
                weight,
                rows: start..all.len(),
                live,
            });
        }
        let rows = all.len();
        let widths = usize::from(mapping.max_width_nm()) + 2;
        let bytes = 8 * (rings as u64 + widths as u64) * rows as u64;
        if bytes > memory_bytes {
            return Err(Error::invalid(
                format!("the kernel of {rows} rows by {rings} rings takes {bytes} bytes, more than {memory_bytes}"),
                "take fewer wavelengths, errors or window points, or raise `memory_mb`",
            ));
        }
        let mut kernel = Planes::zeros(rings * rows);
        let mut row_weight = vec![0.0; rows];
        for (i, row) in all.iter().enumerate().filter_map(|(i, row)| Some((i, row.as_ref()?))) {
            row_weight[i] = row.weight;
            for (ring, value) in row.kernel.iter().enumerate() {
                kernel.re[ring * rows + i] = value.re;
                kernel.im[ring * rows + i] = value.im;
            }
        }
        let conditions = all.iter().map(|r| r.as_ref().map(|r| r.condition)).collect::<Vec<_>>();
        let table = transmissions(&conditions, cells, widths)?;
        Ok(Self {
            rings,
            rows,
            blocks: layout,
            row_weight,
            kernel,
            table,
            mapping,
        })
    }

    /// Number of rings.
    pub fn rings(&self) -> usize {
        self.rings
    }

    /// The mapping from phase to width.
    pub fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn kernel_of(&self, ring: usize) -> (&[f32], &[f32]) {
        self.kernel.row(ring, self.rows)
    }

    pub(crate) fn transmission_of(&self, width_nm: u16) -> (&[f32], &[f32]) {
        self.table.row(usize::from(width_nm), self.rows)
    }

    /// Merit if ring `k` has pillars of `width_nm[k]`.
    pub fn merit_of_widths(&self, width_nm: &[u16]) -> f64 {
        let fields = self.fields(|ring| (f64::from(width_nm[ring]), 0.0));
        self.merit(&fields)
    }

    /// Merit at continuous phases [turns], widths not rounded. Its gradient [1/turn] is added to
    /// `gradient`.
    pub fn merit_of_phases(&self, turns: &[f64], gradient: Option<&mut [f64]>) -> f64 {
        let widths = turns.iter().map(|&t| self.mapping.width_nm(t)).collect::<Vec<_>>();
        let fields = self.fields(|ring| widths[ring]);
        let merit = self.merit(&fields);
        if let Some(gradient) = gradient {
            let adjoint = self.field_gradient(&fields);
            for (ring, slope) in gradient.iter_mut().enumerate() {
                *slope += self.adjoint(ring, widths[ring].0, &adjoint) * widths[ring].1;
            }
        }
        merit
    }

    /// Fields of all rows, in double precision.
    pub(crate) fn fields(&self, width_of: impl Fn(usize) -> (f64, f64)) -> Vec<Complex64> {
        let mut fields = vec![Complex64::ZERO; self.rows];
        for ring in 0..self.rings {
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
    pub(crate) fn merit(&self, fields: &[Complex64]) -> f64 {
        self.blocks
            .iter()
            .map(|block| {
                let rows = block.rows.start..block.rows.start + block.live;
                let sum = match block.kind {
                    Kind::Log => {
                        fields[rows].iter().map(|e| (e.norm_sqr() + FLOOR).ln()).sum::<f64>() / block.live as f64
                    }
                    Kind::Linear => fields[rows.clone()]
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
    fn field_gradient(&self, fields: &[Complex64]) -> Vec<Complex64> {
        let mut gradient = vec![Complex64::ZERO; self.rows];
        for block in &self.blocks {
            for i in block.rows.start..block.rows.start + block.live {
                let scale = match block.kind {
                    Kind::Log => 1.0 / (block.live as f64 * (fields[i].norm_sqr() + FLOOR)),
                    Kind::Linear => f64::from(self.row_weight[i]),
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

/// Transmission of every whole width at every row, with the width's error taken in by interpolation.
fn transmissions(conditions: &[Option<Condition>], cells: &[&dyn CellModel], widths: usize) -> Result<Planes> {
    let columns = conditions
        .par_iter()
        .map(|condition| {
            let Some(condition) = condition else {
                return Ok(vec![Complex64::ZERO; widths]);
            };
            let cell = cells.get(condition.cell).ok_or_else(|| {
                Error::invalid(
                    format!("there is no cell {}", condition.cell),
                    "name one of the cells given",
                )
            })?;
            let margin = condition.width_bias_nm.abs().ceil() as usize + 1;
            let pure = cell.transmissions(condition.wavelength_um, (widths + margin) as u16)?;
            let column = (0..widths)
                .map(|width| {
                    let made = (width as f64 + condition.width_bias_nm).max(0.0);
                    let (low, part) = (made as usize, made.fract());
                    if part == 0.0 {
                        pure[low]
                    } else {
                        pure[low] * (1.0 - part) + pure[low + 1] * part
                    }
                })
                .collect();
            Ok(column)
        })
        .collect::<Result<Vec<Vec<Complex64>>>>()?;
    let rows = conditions.len();
    let mut table = Planes::zeros(widths * rows);
    for (row, column) in columns.iter().enumerate() {
        for (width, t) in column.iter().enumerate() {
            table.re[width * rows + row] = t.re as f32;
            table.im[width * rows + row] = t.im as f32;
        }
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::super::focus::{FabricationError, Lens};
    use super::super::mapping::tests::published;
    use super::super::rings::Rings;
    use super::super::{Start, wavelengths};
    use super::*;
    use crate::cell::PublishedCell;
    use crate::lattice::Lattice;

    fn lens() -> Lens {
        let rings = Rings::new(Lattice::covering(60_000, 350).unwrap(), 60_000).unwrap();
        Lens { rings, gap_um: 144.0 }
    }

    /// Two blocks of each kind, one of them made 5 nm too wide.
    fn problem() -> FieldProblem {
        let (lens, cell) = (lens(), PublishedCell::new(350));
        let cells: [&dyn CellModel; 1] = [&cell];
        let wide = FabricationError {
            width_bias_nm: 5.0,
            ..FabricationError::default()
        };
        let rows = |step, error| {
            lens.focal_rows(&wavelengths(400.0, 700.0, step), error, &cells)
                .unwrap()
        };
        let blocks = vec![
            (Kind::Log, 0.7, rows(10.0, FabricationError::default())),
            (Kind::Log, 0.3, rows(20.0, wide)),
            (Kind::Linear, 25.0, rows(50.0, FabricationError::default())),
        ];
        FieldProblem::new(blocks, &cells, published(), 1 << 24).unwrap()
    }

    /// Phases whose widths are half way between whole ones: transmission is a straight line between those.
    fn start() -> Vec<f64> {
        let mapping = published();
        let turns = Start::Hyperbolic { wavelength_um: 0.55 }.turns(&lens(), 0);
        let uneven = turns.iter().enumerate().map(|(i, t)| t + 0.1 * (i as f64 * 1.7).sin());
        uneven
            .map(|t| {
                let (width, slope) = mapping.width_nm(t);
                t + (width.floor() + 0.5 - width) / slope
            })
            .collect()
    }

    #[test]
    fn the_gradient_is_that_of_differences() {
        /// Single precision of the kernel, and the square of the difference, against the largest slope.
        const TOLERANCE: f64 = 2e-3;
        let (problem, turns, h) = (problem(), start(), 1e-3);
        let mut gradient = vec![0.0; problem.rings()];
        problem.merit_of_phases(&turns, Some(&mut gradient));
        let largest = gradient.iter().map(|g| g.abs()).fold(0.0, f64::max);
        for ring in (0..problem.rings()).step_by(7) {
            let at = |h: f64| {
                let mut moved = turns.clone();
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
        problem.score(ring, &without, &one_over_now, &all, &mut scores);
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

    #[test]
    fn a_kernel_beyond_its_memory_is_refused() {
        let (lens, cell) = (lens(), PublishedCell::new(350));
        let cells: [&dyn CellModel; 1] = [&cell];
        let rows = lens
            .focal_rows(&[0.5, 0.6], FabricationError::default(), &cells)
            .unwrap();
        assert!(FieldProblem::new(vec![(Kind::Log, 1.0, rows)], &cells, published(), 1000).is_err());
        assert!(FieldProblem::new(vec![(Kind::Log, 1.0, Vec::new())], &cells, published(), 1000).is_err());
    }
}
