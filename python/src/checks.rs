//! Checks of a layout: rules, verification, calibration. Answers are those of the program, as JSON.

use std::path::PathBuf;

use metalith::bench_plan::BenchFile;
use metalith::calibrate::Settings;
use metalith::cell::cache_folder;
use metalith::drc::{self, CheckInput, Date, Deck, Waivers};
use metalith::extract::PillarsAt;
use metalith::gds::{LayerNumber, ReadLimits};
use metalith::{
    Accuracy, AsBuiltChip, CalibratedModel, Layout, PillarArray, PillarRows as _, Result, SimulationCases, cell_models,
};
use pyo3::prelude::*;

use crate::arrays::Design;
use crate::reading::Reading;
use crate::work::work;

/// Plain data as JSON.
pub fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).expect("plain data serialises")
}

/// Design rules: the report as JSON, and whether it is clean.
#[pyfunction]
#[pyo3(signature = (layout, rules=None, design=None, with_layouts=vec![], waivers=None, markers=100, progress=None, layer=None, top=None))]
#[allow(clippy::too_many_arguments)]
pub fn check(
    py: Python<'_>,
    layout: PathBuf,
    rules: Option<PathBuf>,
    design: Option<&Design>,
    with_layouts: Vec<PathBuf>,
    waivers: Option<PathBuf>,
    markers: usize,
    progress: Option<Py<PyAny>>,
    layer: Option<(u16, u16)>,
    top: Option<String>,
) -> PyResult<(String, bool)> {
    let design = design.map(|d| &d.design);
    work(py, progress, |p| {
        let deck = match (rules.as_deref(), design) {
            (Some(path), _) => Some(Deck::read(path)?),
            (None, Some(design)) => Some(Deck::for_design(design)),
            (None, None) => None,
        };
        let layer = layer.map(|(layer, datatype)| LayerNumber::new(layer, datatype));
        let deck = match (deck, layer) {
            (Some(deck), Some(layer)) => Some(deck.with_pillars_on(layer)),
            (deck, _) => deck,
        };
        let waivers = waivers.as_deref().map(Waivers::read).transpose()?;
        let open = |path: &PathBuf| Layout::open_with(path, ReadLimits::default(), p);
        let file = Layout::open_counted(&layout, ReadLimits::default(), p)?;
        let file = match &top {
            Some(top) => file.below(top)?,
            None => file,
        };
        let with = with_layouts.iter().map(open).collect::<Result<Vec<_>, _>>()?;
        let input = CheckInput {
            with: with.iter().collect(),
            design,
            array: None,
            waivers: waivers.as_ref(),
            today: Date::today(),
            markers,
        };
        let report = match &deck {
            Some(deck) => drc::check(&file, deck, &input, p)?,
            None => drc::check_generic(&file, layer, &input, p)?,
        };
        Ok((json(&report), report.exit_code() == 0))
    })
}

/// A layout read back, compared with its design, simulated and judged: the numbers of `report.json`, as JSON, and
/// whether all limits hold. With a folder the page is written too.
#[pyfunction]
#[pyo3(signature = (design, layout, fast=false, model=None, out=None, progress=None, layer=None, top=None))]
#[allow(clippy::too_many_arguments)]
pub fn verify(
    py: Python<'_>,
    design: &Design,
    layout: PathBuf,
    fast: bool,
    model: Option<PathBuf>,
    out: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
    layer: Option<(u16, u16)>,
    top: Option<String>,
) -> PyResult<(String, bool)> {
    let reading = Reading { layer, top };
    let design = &reading.design(&design.design);
    work(py, progress, |p| {
        let layout = reading.below(&layout, p)?;
        let array = PillarArray::build(design, p)?;
        let model_file = model;
        let model = model_file.as_deref().map(CalibratedModel::read).transpose()?;
        let chip = |model| -> Result<AsBuiltChip> {
            Ok(AsBuiltChip::in_light(&design.lit_stack()?, model)?.cached_in(cache_folder().as_deref()))
        };
        let made = model.as_ref().map(chip).transpose()?;
        if let Some(chip) = &made {
            chip.check_drawn(array.classes.iter().map(|class| class.widths.histogram()))?;
        }
        let cells = match &made {
            None => cell_models(design, &[design.verify.fidelity])?,
            Some(_) => Vec::new(),
        };
        let cases = match &made {
            Some(chip) => SimulationCases::judged_by(chip),
            None => SimulationCases::of_cells(&cells)?,
        };
        let accuracy = if fast { Accuracy::Fast } else { Accuracy::Accurate };
        let cases = cases.with_through_focus();
        let found = metalith::verify(design, &array, &layout.path, &cases, accuracy, p)?;
        if let Some(folder) = out {
            let inputs = design.inputs();
            let named = [layout.path.as_path()].into_iter().chain(model_file.as_deref());
            let turn = metalith::FolderLock::wait(&folder, p, || ())?;
            let turn = turn.keeping(inputs.iter().map(PathBuf::as_path).chain(named));
            turn.publish("report", &[], |folder| {
                metalith::write_report(design, &array, &found, None, folder)
            })?;
        }
        Ok((json(&found), found.passed()))
    })
}

/// The diagnosis of a measured set, as JSON; report and model are written into a folder.
#[pyfunction]
#[pyo3(signature = (set, out, effects=vec![], progress=None, layer=None, top=None))]
pub fn calibrate(
    py: Python<'_>,
    set: PathBuf,
    out: PathBuf,
    effects: Vec<String>,
    progress: Option<Py<PyAny>>,
    layer: Option<(u16, u16)>,
    top: Option<String>,
) -> PyResult<String> {
    work(py, progress, |p| {
        let layer = layer.map(|(layer, datatype)| LayerNumber::new(layer, datatype));
        let reader = PillarsAt { layer, top };
        let settings = Settings {
            cache: cache_folder(),
            only: effects,
            ..Settings::default()
        };
        let done = metalith::calibrate::calibrate(&[set], &[out], &settings, &reader, p)?;
        Ok(json(&done[0].diagnosis))
    })
}

/// A bench session planned into a folder: its plan as JSON, whether it finds every effect at its wanted size, and one line
/// for a person.
#[pyfunction]
#[pyo3(signature = (design, bench, out, layout=None, effects=vec![], progress=None, layer=None, top=None))]
#[allow(clippy::too_many_arguments)]
pub fn plan(
    py: Python<'_>,
    design: &Design,
    bench: PathBuf,
    out: PathBuf,
    layout: Option<PathBuf>,
    effects: Vec<String>,
    progress: Option<Py<PyAny>>,
    layer: Option<(u16, u16)>,
    top: Option<String>,
) -> PyResult<(String, bool, String)> {
    let reading = Reading { layer, top };
    let design = &reading.design(&design.design);
    work(py, progress, |p| {
        let bench = BenchFile::read(&bench)?;
        let layout = layout.map(|path| reading.below(&path, p)).transpose()?;
        let layout = layout.as_ref().map(|layout| layout.path.as_path());
        let planned = metalith::plan_session(design, &bench, layout, &out, effects, p)?;
        Ok((json(&planned), planned.finds_all(), planned.sentence()))
    })
}
