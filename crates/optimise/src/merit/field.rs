//! The field at a few points, linear in the transmission of each ring: kernel and transmissions.

use std::ops::Range;

use num_complex::Complex64;
use rayon::prelude::*;

use crate::merit::field_point::{Condition, FieldPoint};
use crate::merit::focus::Lens;
use crate::merit::neighbour_terms::NeighbourTerms;
use crate::merit::ring_context::RingContext;
use crate::rings::mapping::Mapping;
use crate::rings::split_complex::Planes;
use metalith_cell::{CellModel, Fidelity};
use metalith_core::{Error, Result};

/// Rows are padded to whole groups of this many, so that inner loops have no ends to tidy.
pub(crate) const LANES: usize = 32;
/// Added to every intensity under a logarithm, in units of the matched peak: keeps a field of zero finite
/// and is a thousandth of a hyperbolic lens at its worst wavelength.
pub(crate) const FLOOR: f64 = 1e-9;

/// Merit that the intensities of a block make.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeritKind {
    /// Mean of the logarithms.
    Log,
    /// Weighted sum; the weights may be negative.
    Linear,
}

/// Rows that are summed up in one way.
#[derive(Clone, Debug)]
pub(crate) struct MeritBlock {
    pub kind: MeritKind,
    pub weight: f64,
    /// Padded to `LANES`.
    pub rows: Range<usize>,
    pub live: usize,
}

/// A merit of the field as a function of the phases of the rings. Larger is better.
pub struct FieldProblem {
    rings: usize,
    rows: usize,
    pub(crate) blocks: Vec<MeritBlock>,
    pub(crate) row_weight: Vec<f32>,
    /// `[ring][row]`.
    kernel: Planes,
    /// Transmission, `[width_nm][row]`, made width taken from the designed one; among dissimilar neighbours its mean
    /// over them.
    pub(crate) table: Planes,
    pub(crate) mapping: Mapping,
    /// Condition of each row that is no padding.
    pub(crate) conditions: Vec<Option<Condition>>,
    /// Terms of neighbours, where they are not taken for equals.
    pub(crate) surroundings: Option<NeighbourTerms>,
}

impl FieldProblem {
    /// A merit that is the sum of `weight` times each block of rows.
    ///
    /// `cells` are what [`Condition::cell`] counts. `memory_bytes` bounds the kernel. With the cell `neighbours` nothing passes
    /// before [`FieldProblem::among_neighbours`].
    ///
    /// # Errors
    /// If there are no rows, the rows disagree in the number of rings, the kernel would not fit, or a cell
    /// does not cover a wavelength.
    pub fn new(
        blocks: Vec<(MeritKind, f64, Vec<FieldPoint>)>,
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
            return Err(Error::refused(
                "optimise/row-lengths-differ",
                "the rows of a merit are empty or differ in the number of rings",
                "give every row one number for each ring",
            ));
        }
        let mut layout = Vec::new();
        let mut all = Vec::<Option<FieldPoint>>::new();
        for (kind, weight, rows) in blocks {
            let (start, live) = (all.len(), rows.len());
            all.extend(rows.into_iter().map(Some));
            all.resize_with(all.len().next_multiple_of(LANES), || None);
            layout.push(MeritBlock {
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
            return Err(Error::refused(
                "optimise/too-much-memory",
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
            conditions,
            surroundings: None,
        })
    }

    /// This merit with the coupled model: of rows that are all of the focus, without errors of fabrication.
    ///
    /// # Errors
    /// If it takes more than `memory_bytes` with the kernel of the rings, rows are of pillars that are made with
    /// errors, or the cell is not coupled at a wavelength.
    pub fn among_neighbours(mut self, lens: &Lens, cell: &dyn CellModel, memory_bytes: u64) -> Result<Self> {
        let widths: Vec<u16> = self.mapping.choices().iter().map(|c| c.width_nm).collect();
        let most = self.mapping.max_width_nm();
        let pairs = NeighbourTerms::of(&self.conditions, &widths, most, lens, cell, memory_bytes)?;
        for (row, own) in pairs.own.iter().enumerate() {
            let Some(own) = own else { continue };
            for w in widths.iter().copied().map(usize::from) {
                self.table.set(w * self.rows + row, own[w]);
            }
        }
        self.surroundings = Some(pairs.terms);
        Ok(self)
    }

    /// Number of rings.
    pub fn rings(&self) -> usize {
        self.rings
    }

    /// The mapping from phase to width.
    pub fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    pub fn rows(&self) -> usize {
        self.rows
    }

    pub fn kernel_of(&self, ring: usize) -> (&[f32], &[f32]) {
        self.kernel.row(ring, self.rows)
    }

    pub fn transmission_of(&self, width_nm: u16) -> (&[f32], &[f32]) {
        self.table.row(usize::from(width_nm), self.rows)
    }

    /// Context of a ring: what its width acts on other than its own transmission, while other rings have these widths
    /// (nm); `None` among equal neighbours.
    pub fn context(&self, ring: usize, widths_nm: &[u16]) -> Option<RingContext> {
        self.surroundings.as_ref().map(|s| s.context(ring, widths_nm))
    }

    /// Fields of all rows that depend on the width of a ring, if it has this one.
    #[inline(always)]
    pub fn contribution(&self, ring: usize, width_nm: u16, context: Option<&RingContext>, out: &mut Planes) {
        let (k_re, k_im) = self.kernel_of(ring);
        let (t_re, t_im) = self.transmission_of(width_nm);
        for i in 0..k_re.len() {
            out.re[i] = k_re[i] * t_re[i] - k_im[i] * t_im[i];
            out.im[i] = k_re[i] * t_im[i] + k_im[i] * t_re[i];
        }
        if let (Some(surroundings), Some(context)) = (&self.surroundings, context) {
            surroundings.add_contribution(width_nm, context, out);
        }
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
                Error::refused(
                    "optimise/unknown-cell",
                    format!("there is no cell {}", condition.cell),
                    "name one of the cells given",
                )
            })?;
            if cell.fidelity() == Fidelity::Neighbours {
                // What a width alone transmits is not asked for: `among_neighbours` has the rest.
                return Ok(vec![Complex64::ZERO; widths]);
            }
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
            table.set(width * rows + row, *t);
        }
    }
    Ok(table)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::merit::focus::FabricationError;
    use crate::rings::mapping::tests::published;
    use crate::rings::sites::Rings;
    use crate::{Start, wavelengths};
    use metalith_cell::PublishedCell;
    use metalith_pillars::Lattice;

    pub(crate) fn lens() -> Lens {
        let rings = Rings::new(Lattice::covering(60_000, 350).unwrap(), 60_000).unwrap();
        Lens {
            rings,
            distance_um: 144.0,
        }
    }

    /// Two blocks of each kind, one of them made 5 nm too wide.
    pub(crate) fn problem() -> FieldProblem {
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
            (MeritKind::Log, 0.7, rows(10.0, FabricationError::default())),
            (MeritKind::Log, 0.3, rows(20.0, wide)),
            (MeritKind::Linear, 25.0, rows(50.0, FabricationError::default())),
        ];
        FieldProblem::new(blocks, &cells, published(), 1 << 24).unwrap()
    }

    /// Phases whose widths are half way between whole ones: transmission is a straight line between those.
    pub(crate) fn start() -> Vec<f64> {
        let mapping = published();
        let waves = Start::Hyperbolic { wavelength_um: 0.55 }.waves(&lens(), 0);
        let uneven = waves.iter().enumerate().map(|(i, t)| t + 0.1 * (i as f64 * 1.7).sin());
        uneven
            .map(|t| {
                let (width, slope) = mapping.width_nm(t);
                t + (width.floor() + 0.5 - width) / slope
            })
            .collect()
    }

    #[test]
    fn a_kernel_beyond_its_memory_is_refused() {
        let (lens, cell) = (lens(), PublishedCell::new(350));
        let cells: [&dyn CellModel; 1] = [&cell];
        let rows = lens
            .focal_rows(&[0.5, 0.6], FabricationError::default(), &cells)
            .unwrap();
        assert!(FieldProblem::new(vec![(MeritKind::Log, 1.0, rows)], &cells, published(), 1000).is_err());
        assert!(FieldProblem::new(vec![(MeritKind::Log, 1.0, Vec::new())], &cells, published(), 1000).is_err());
    }
}
