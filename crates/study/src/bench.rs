//! Bench that judges draws: the designs, their layouts as read back, and tables of cells.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use metalith_cell::{BAND_ORDERS, CellStack, FocusedLight, FocusingStack};
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Quiet, Result};
use metalith_design::array::PillarArray;
use metalith_design::{CellIncidence, Design};
use metalith_gds::{Layout, ReadLimits};
use metalith_optics::{AsBuiltChip, BankRange, CalibratedModel, CellBank, CellChange, Perturbation, bank_orders};
use metalith_verify::{ReadLayout, SimulationCases, Verification, wavelengths_um};

use crate::bias::check_biases;
use crate::draw::Sampler;
use crate::manifest::another_plan;
use crate::picture::{KnownChip, PictureBench, TakenPicture};
use crate::plan::{PillarPlace, Plan, key};
use crate::record::{DrawRecord, LimitStatement, figures, finite};
use crate::study_file::Tolerance;

/// Relative difference of amounts that are the same: machines may round logarithms and exponentials otherwise.
const SAME_AMOUNT: f64 = 1e-12;

/// Everything that judges a draw.
pub(crate) struct StudyBench {
    pub tolerance: Tolerance,
    pub drawer: Sampler,
    picture: Option<PictureBench>,
    made: AsBuiltRange,
    key: [u8; 32],
    files: Files,
    /// The design of the draws that are made now: one at a time is held, since draws of a design stand together.
    current: Mutex<Option<Arc<Subject>>>,
}

/// Paths of the layout and the tables of each design, by its number.
pub(crate) struct Files {
    pub layouts: Vec<std::path::PathBuf>,
    pub place: PillarPlace,
    pub cells: Vec<std::path::PathBuf>,
}

/// One design of a study, with what its draws are judged by.
pub(crate) struct Subject {
    number: u64,
    design: Design,
    array: PillarArray,
    layout: ReadLayout,
    bank: Arc<CellBank>,
    /// Chip that restorations know, if it is not the chip of the draw.
    known: Option<KnownChip>,
}

/// A draw, judged.
pub struct JudgedDraw {
    pub record: DrawRecord,
    pub found: Verification,
    pub picture: Option<TakenPicture>,
}

/// Range of what all draws make of a pillar, from the least to the most.
struct AsBuiltRange {
    bias_nm: [f64; 2],
    changes: [CellChange; 2],
}

impl StudyBench {
    /// Bench for a tolerance that was read. `key`: of the random numbers.
    pub(crate) fn new(tolerance: Tolerance, key: [u8; 32], files: Files) -> Result<Self> {
        let base = match &tolerance.model {
            Some(path) => CalibratedModel::read(path)?.perturbation,
            None => Perturbation::default(),
        };
        if base.declared().next().is_some() {
            return Err(Error::refused(
                "study/declared-effects-unsupported",
                "the model has declared effects, and a study cannot know the widths of their pillars before they are drawn",
                "give a model without declared effects",
            ));
        }
        let drawer = Sampler::new(&tolerance, base);
        let picture = tolerance.picture.as_ref().map(PictureBench::open).transpose()?;
        let mut made = AsBuiltRange::of(&drawer, key)?;
        if picture.as_ref().is_some_and(PictureBench::knows_design) {
            made.add(drawer.base());
        }
        Ok(Self {
            made,
            picture,
            tolerance,
            drawer,
            key,
            files,
            current: Mutex::default(),
        })
    }

    /// The bench of a plan, with the tables that were solved for it; they are read when a draw asks for them.
    ///
    /// # Errors
    /// If a file has changed since the plan was made.
    pub(crate) fn open(plan: &Plan, progress: &dyn Progress) -> Result<Self> {
        let tolerance = Tolerance::read(&plan.tolerance)?;
        let files = plan.files();
        let known = if files.layouts.len() as u64 == tolerance.designs() {
            Some(key(&tolerance, &files.layouts, &files.place, progress)?)
        } else {
            None
        };
        let Some(key) = known.filter(|key| hex(key) == plan.key) else {
            return Err(another_plan(&plan.folder));
        };
        let cells = files.cells.len() as u64;
        let bench = Self::new(tolerance, key, files)?;
        let drawer = &bench.drawer;
        // Amounts, draws and tables are found by their numbers.
        if (drawer.count(), drawer.names()) != (plan.draws, plan.quantities.clone())
            || cells != bench.tolerance.designs()
        {
            return Err(another_plan(&plan.folder));
        }
        Ok(bench)
    }

    /// True if a record has the amounts, the values of keys and the verdict of its draw.
    pub(crate) fn is_drawn(&self, record: &DrawRecord, limits: &[LimitStatement]) -> Result<bool> {
        let amounts = self.drawer.draw(self.key, record.draw)?.amounts;
        let is_same = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME_AMOUNT * a.abs();
        let setting = self.tolerance.setting(self.drawer.design_of(record.draw));
        let holds = limits.iter().zip(&record.reached).all(|(l, r)| l.holds(*r));
        Ok(amounts.iter().zip(&record.amounts).all(is_same)
            && record.passed == holds
            && setting.len() == record.design.len()
            && setting
                .iter()
                .all(|(key, value)| record.design.get(*key) == Some(value)))
    }

    /// A design with the tables in its file.
    fn subject(&self, number: u64, progress: &dyn Progress) -> Result<Arc<Subject>> {
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(subject) = current.as_ref().filter(|s| s.number == number) {
            return Ok(subject.clone());
        }
        // The former one is not kept while this one is read.
        *current = None;
        let path = &self.files.cells[number as usize];
        let read = |stated: &CellStack, range| CellBank::read(path, stated, range);
        let subject = Arc::new(self.make(number, &read, progress)?);
        *current = Some(subject.clone());
        Ok(subject)
    }

    /// Take a design whose tables were solved, or found, by `bank`; its layout is read back.
    ///
    /// # Errors
    /// If its layout cannot be read, or it cannot be judged in a study.
    pub(crate) fn take(
        &self,
        number: u64,
        bank: &dyn Fn(&CellStack, BankRange) -> Result<CellBank>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        *current = None;
        *current = Some(Arc::new(self.make(number, bank, progress)?));
        Ok(())
    }

    fn make(
        &self,
        number: u64,
        bank: &dyn Fn(&CellStack, BankRange) -> Result<CellBank>,
        progress: &dyn Progress,
    ) -> Result<Subject> {
        let mut design = self.tolerance.design(number, progress)?;
        if let Some(layer) = self.files.place.layer {
            let pillars = &mut design.layout.layers.pillars;
            (pillars.layer, pillars.datatype) = (layer.layer as i16, layer.datatype as i16);
        }
        if design.verify.incidence == CellIncidence::Oblique {
            return Err(Error::refused(
                "study/oblique-unsupported",
                "a study uses cells at normal incidence, and the design asks for oblique incidence",
                "leave out `incidence = \"oblique\"` in [verify] of the design of the study",
            ));
        }
        check_rectangles(&design, &self.made, self.picture.is_some())?;
        let array = PillarArray::build(&design, &Quiet(progress))?;
        let path: &Path = &self.files.layouts[number as usize];
        let opened = Layout::open_with(path, ReadLimits::default(), progress)?;
        let opened = match &self.files.place.top {
            Some(top) => opened.below(top)?,
            None => opened,
        };
        let layout = ReadLayout::of(&design, &array, &opened, progress)?;
        check_biases(
            &self.drawer,
            self.key,
            number,
            &design.cell_stack()?,
            layout.extraction(),
        )?;
        let mut range = self.made.range(&design, &layout)?;
        if let Some(picture) = &self.picture {
            range.colours.extend(picture.colours(&design)?);
            // White light and pictures may be of one camera.
            range.colours.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            range.colours.dedup();
        }
        let bank = Arc::new(bank(&design.cell_stack()?, range)?);
        let known = match &self.picture {
            Some(picture) if picture.knows_design() => {
                let model = Self::model("as designed".into(), self.drawer.base().clone());
                let chip = chip_of(&design, &bank, &model)?;
                Some(picture.known(&design, layout.extraction(), &chip, &Quiet(progress))?)
            }
            _ => None,
        };
        Ok(Subject {
            number,
            design,
            array,
            layout,
            bank,
            known,
        })
    }

    /// Pillars whose tables the design that was taken last has, for every width and wavelength.
    pub(crate) fn stacks(&self) -> usize {
        let current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        current.as_ref().map_or(0, |s| s.bank.stacks())
    }

    /// Judge draw `k`.
    ///
    /// # Errors
    /// If the tables cannot be used, it cannot be simulated, or the user stopped it.
    pub(crate) fn draw(&self, k: u64, progress: &dyn Progress) -> Result<JudgedDraw> {
        let number = self.drawer.design_of(k);
        let subject = self.subject(number, progress)?;
        let drawn = self.drawer.draw(self.key, k)?;
        let model = Self::model(format!("draw {k}"), self.drawer.perturbation(&drawn));
        let chip = chip_of(&subject.design, &subject.bank, &model)?;
        let cases = SimulationCases::judged_by(&chip);
        let accuracy = self.tolerance.accuracy;
        let found = subject
            .layout
            .judge(&subject.design, &subject.array, &cases, accuracy, progress)?;
        let mut figures = figures(&found);
        let picture = match &self.picture {
            Some(bench) => {
                let pillars = subject.layout.extraction();
                Some(bench.take(&subject.design, pillars, &chip, subject.known.as_ref(), progress)?)
            }
            None => None,
        };
        for (key, value) in picture.iter().flat_map(TakenPicture::figures) {
            figures.insert(key, finite(value));
        }
        let limits = self.limits(&found);
        let of_design = found.checks.iter().map(|c| finite(c.reached));
        let own = self
            .tolerance
            .limits
            .iter()
            .map(|l| figures.get(&l.figure).copied().flatten());
        let reached: Vec<Option<f64>> = of_design.chain(own).collect();
        let setting = self.tolerance.setting(number).into_iter();
        let record = DrawRecord {
            draw: k,
            passed: limits.iter().zip(&reached).all(|(l, r)| l.holds(*r)),
            amounts: drawn.amounts,
            design: setting.map(|(key, value)| (key.to_owned(), value.clone())).collect(),
            figures,
            reached,
        };
        Ok(JudgedDraw { record, found, picture })
    }

    fn model(set: String, perturbation: Perturbation) -> CalibratedModel {
        CalibratedModel::new(set, "drawn".into(), perturbation)
    }

    /// All limits: of the design, then of the study.
    pub(crate) fn limits(&self, found: &Verification) -> Vec<LimitStatement> {
        let of_design = found.checks.iter().map(LimitStatement::of_check);
        of_design
            .chain(self.tolerance.limits.iter().map(LimitStatement::of_figure))
            .collect()
    }
}

/// A chip of a design, all its cells from a bank.
fn chip_of(design: &Design, bank: &Arc<CellBank>, model: &CalibratedModel) -> Result<AsBuiltChip> {
    let stated = FocusingStack {
        stack: bank.stated().clone(),
        focused: design.focused(),
    };
    Ok(AsBuiltChip::in_light(&stated, model)?.from_bank(bank))
}

/// Check that rectangles, if the pillars of a design are such, can be made like that.
fn check_rectangles(design: &Design, made: &AsBuiltRange, has_picture: bool) -> Result<()> {
    if design.cell.shape.has_width() {
        return Ok(());
    }
    if made.changes.iter().any(|change| change.corner_rounding_nm != 0.0) {
        return Err(Error::refused(
            "study/rounded-rectangles",
            "`corner_rounding` is not supported for rectangles",
            "leave it out of the study and of its model: rectangles are solved with sharp corners",
        ));
    }
    if has_picture {
        return Err(Error::refused(
            "study/pictures-with-rectangles",
            "a study does not simulate pictures of rectangles",
            "leave out [picture]; `metalith picture` takes the picture of the chip as drawn",
        ));
    }
    Ok(())
}

impl AsBuiltRange {
    /// Every draw is drawn, none is simulated.
    fn of(drawer: &Sampler, key: [u8; 32]) -> Result<Self> {
        let first = drawer.perturbation(&drawer.draw(key, 0)?);
        let mut range = Self {
            bias_nm: [f64::MAX, f64::MIN],
            changes: [first.cell.in_the_middle(); 2],
        };
        for k in 0..drawer.count() {
            range.add(&drawer.perturbation(&drawer.draw(key, k)?));
        }
        Ok(range)
    }

    fn add(&mut self, made: &Perturbation) {
        // Area fractions are from zero to one.
        for fill in [0.0, 1.0] {
            let bias = made.geometry.bias_nm(fill);
            self.bias_nm = [self.bias_nm[0].min(bias), self.bias_nm[1].max(bias)];
        }
        let pillars = [Some(made.cell.in_the_middle()), made.cell.at_the_rim()];
        for cell in pillars.into_iter().flatten() {
            let [low, high] = self.changes;
            self.changes = [joined(low, cell, f64::min), joined(high, cell, f64::max)];
        }
    }

    /// Range that the tables of a design must hold for all draws. Ranges of other designs count too: designs whose
    /// pillars are alike then have the same tables.
    fn range(&self, design: &Design, layout: &ReadLayout) -> Result<BankRange> {
        let histograms = layout.extraction().elements.iter().map(|e| e.widths.histogram());
        let mut drawn: BTreeSet<u16> = BTreeSet::new();
        for histogram in histograms {
            let there = histogram.iter().zip(0..).skip(1).filter(|(n, _)| **n > 0);
            drawn.extend(there.map(|(_, width)| width));
        }
        // The mapping's own are judged too, whatever was read.
        let library = design
            .mapping
            .pillar_library
            .iter()
            .flat_map(|library| library.pillars());
        drawn.extend(library.map(|pillar| pillar.number));
        let (least, most) = design.cell.width_range_nm;
        // Rectangles are told by numbers that are no widths.
        let (narrow, wide) = if design.cell.shape.has_width() {
            (
                f64::from(drawn.first().map_or(least, |w| least.min(*w))),
                f64::from(drawn.last().map_or(most, |w| most.max(*w))),
            )
        } else {
            (0.0, 0.0)
        };
        let numbers = match design.focused() {
            Some(FocusedLight::Linear(_)) => drawn.into_iter().collect(),
            _ => Vec::new(),
        };
        let (single, band) = wavelengths_um(design)?;
        let single = single.into_iter().map(|um| (um, bank_orders(design.cell.shape)));
        Ok(BankRange {
            widths_nm: [narrow + self.bias_nm[0], wide + self.bias_nm[1]],
            numbers,
            changes: self.changes,
            colours: single.chain(band.into_iter().map(|um| (um, BAND_ORDERS))).collect(),
        })
    }
}

fn joined(a: CellChange, b: CellChange, of: fn(f64, f64) -> f64) -> CellChange {
    CellChange {
        height_nm: of(a.height_nm, b.height_nm),
        index: of(a.index, b.index),
        taper_deg: of(a.taper_deg, b.taper_deg),
        corner_rounding_nm: of(a.corner_rounding_nm, b.corner_rounding_nm),
        residual_mask_nm: of(a.residual_mask_nm, b.residual_mask_nm),
        ..a.in_the_middle()
    }
}
