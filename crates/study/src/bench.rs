//! What draws are judged with: the design, its layout as read back, and tables of cells.

use std::path::Path;
use std::sync::Arc;

use metalith_cell::BAND_ORDERS;
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result};
use metalith_design::array::PillarArray;
use metalith_design::{CellIncidence, Design};
use metalith_gds::{Layout, ReadLimits};
use metalith_made::{BankRange, CalibratedModel, CellBank, CellChange, MadeChip, Perturbation};
use metalith_verify::{ReadLayout, SimulationCases, Verification, wavelengths_um};

use crate::draw::Drawer;
use crate::plan::{CELLS, Plan, key};
use crate::record::{DrawRecord, LimitStatement, figures, finite};
use crate::tolerance::Tolerance;

/// Orders of cells at single wavelengths.
const ORDERS: usize = metalith_cell::ORDERS;

/// Hears that the user wants to stop, and shows nothing: one draw is a step of something else.
pub(crate) struct Quiet<'a>(pub &'a dyn Progress);

impl Progress for Quiet<'_> {
    fn begin(&self, _what: &str, _steps: u64) {}

    fn advance(&self, _steps: u64) {}

    fn stopped(&self) -> bool {
        self.0.stopped()
    }
}

/// Everything that judges a draw.
pub(crate) struct Bench {
    pub tolerance: Tolerance,
    pub drawer: Drawer,
    pub bank: Arc<CellBank>,
    design: Design,
    array: PillarArray,
    layout: ReadLayout,
    key: [u8; 32],
}

impl Bench {
    /// Read the layout back and solve the tables: once for a study.
    pub fn make(
        tolerance: Tolerance,
        design: Design,
        array: PillarArray,
        layout: &Path,
        key: [u8; 32],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let solve = |stated: &_, range| CellBank::solve(stated, range, progress);
        Self::with_bank(tolerance, design, array, layout, key, &solve, progress)
    }

    /// The bench of a plan, with the tables that were solved for it.
    ///
    /// # Errors
    /// If a file has changed since the plan was made, or the tables cannot be used.
    pub fn open(plan: &Plan, progress: &dyn Progress) -> Result<Self> {
        let tolerance = Tolerance::read(&plan.tolerance)?;
        let design = Design::read(&tolerance.design)?;
        let layout = plan.layout_path();
        let key = key(&tolerance, &design, &layout)?;
        if hex(&key) != plan.key {
            return Err(Error::invalid(
                format!(
                    "the design, its layout, or another file of the study in {} has changed since it was planned, or \
                     another version of the program planned it",
                    plan.folder.display()
                ),
                "plan it again into another folder",
            ));
        }
        let array = PillarArray::build(&design, &Quiet(progress))?;
        let read = |stated: &_, range| CellBank::read(&plan.folder.join(CELLS), stated, range);
        Self::with_bank(tolerance, design, array, &layout, key, &read, progress)
    }

    fn with_bank(
        tolerance: Tolerance,
        design: Design,
        array: PillarArray,
        layout: &Path,
        key: [u8; 32],
        bank: &dyn Fn(&metalith_cell::CellStack, BankRange) -> Result<CellBank>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        if design.verify.incidence == CellIncidence::AsLit {
            return Err(Error::invalid(
                "a study takes the cells along the normal, and the design asks for them as they are lit",
                "leave out `incidence = \"as_lit\"` in [verify] of the design of the study",
            ));
        }
        let base = match &tolerance.model {
            Some(path) => CalibratedModel::read(path)?.perturbation,
            None => Perturbation::default(),
        };
        if base.declared().next().is_some() {
            return Err(Error::invalid(
                "a model with declared effects: how wide their pillars become is not known before they are drawn",
                "give a model without declared effects",
            ));
        }
        let drawer = Drawer::new(&tolerance, base);
        let opened = Layout::open_with(layout, ReadLimits::default(), progress)?;
        let layout = ReadLayout::of(&design, &array, &opened, progress)?;
        let range = range(&drawer, key, &design, &layout)?;
        let bank = Arc::new(bank(&design.cell_stack()?, range)?);
        Ok(Self {
            tolerance,
            drawer,
            bank,
            design,
            array,
            layout,
            key,
        })
    }

    /// Judge draw `k`.
    ///
    /// # Errors
    /// If it cannot be simulated, or the user stopped it.
    pub fn draw(&self, k: u64, progress: &dyn Progress) -> Result<(DrawRecord, Verification)> {
        let drawn = self.drawer.draw(self.key, k)?;
        let model = CalibratedModel::new(format!("draw {k}"), "drawn".into(), self.drawer.perturbation(&drawn));
        let chip = MadeChip::of_bank(&self.bank, &model)?;
        let cases = SimulationCases::judged_by(&chip);
        let accuracy = self.tolerance.accuracy;
        let found = self
            .layout
            .judge(&self.design, &self.array, &cases, accuracy, progress)?;
        let figures = figures(&found);
        let limits = self.limits(&found);
        let of_design = found.checks.iter().map(|c| finite(c.reached));
        let own = self
            .tolerance
            .limits
            .iter()
            .map(|l| figures.get(&l.figure).copied().flatten());
        let reached: Vec<Option<f64>> = of_design.chain(own).collect();
        let record = DrawRecord {
            draw: k,
            passed: limits.iter().zip(&reached).all(|(l, r)| l.holds(*r)),
            amounts: drawn.amounts,
            figures,
            reached,
        };
        Ok((record, found))
    }

    /// All limits: of the design, then of the study.
    pub fn limits(&self, found: &Verification) -> Vec<LimitStatement> {
        let of_design = found.checks.iter().map(LimitStatement::of_check);
        of_design
            .chain(self.tolerance.limits.iter().map(LimitStatement::of_figure))
            .collect()
    }
}

/// What the tables must hold for all draws: every one is drawn, none is simulated.
fn range(drawer: &Drawer, key: [u8; 32], design: &Design, layout: &ReadLayout) -> Result<BankRange> {
    let histograms = layout.extraction().elements.iter().map(|e| e.widths.histogram());
    let (mut narrow, mut wide) = (f64::MAX, 0.0_f64);
    for histogram in histograms {
        for (width, _) in histogram.iter().enumerate().skip(1).filter(|(_, n)| **n > 0) {
            narrow = narrow.min(width as f64);
            wide = wide.max(width as f64);
        }
    }
    // The mapping's own widths are judged too, whatever was read.
    narrow = narrow.min(f64::from(design.cell.width_range_nm.0));
    wide = wide.max(f64::from(design.cell.width_range_nm.1));
    let (mut least, mut most) = (f64::MAX, f64::MIN);
    let mut changes: Option<[CellChange; 2]> = None;
    for k in 0..drawer.count() {
        let made = drawer.perturbation(&drawer.draw(key, k)?);
        // Area fractions are from zero to one.
        for fill in [0.0, 1.0] {
            least = least.min(made.geometry.bias_nm(fill));
            most = most.max(made.geometry.bias_nm(fill));
        }
        let [low, high] = changes.unwrap_or([made.cell; 2]);
        changes = Some([joined(low, made.cell, f64::min), joined(high, made.cell, f64::max)]);
    }
    let (single, band) = wavelengths_um(design)?;
    let single = single.into_iter().map(|um| (um, ORDERS));
    Ok(BankRange {
        widths_nm: [narrow + least, wide + most],
        changes: changes.unwrap_or_default(),
        colours: single.chain(band.into_iter().map(|um| (um, BAND_ORDERS))).collect(),
    })
}

fn joined(a: CellChange, b: CellChange, of: fn(f64, f64) -> f64) -> CellChange {
    CellChange {
        height_nm: of(a.height_nm, b.height_nm),
        index: of(a.index, b.index),
        taper_deg: of(a.taper_deg, b.taper_deg),
        corner_rounding_nm: of(a.corner_rounding_nm, b.corner_rounding_nm),
        residual_mask_nm: of(a.residual_mask_nm, b.residual_mask_nm),
    }
}
