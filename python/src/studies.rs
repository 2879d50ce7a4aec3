//! Studies: plan, shards and merge. Answers are JSON.

use std::path::PathBuf;

use metalith::FolderLock;
use metalith::gds::LayerNumber;
use metalith::study::{self, PillarPlace, Plan, PlanSettings, Work};
use pyo3::prelude::*;

use crate::work::work;

/// Plan a study into a folder, or read the plan that is there; its manifest, with the number of shards.
#[pyfunction]
#[pyo3(signature = (tolerance, folder, draws_per_shard=None, progress=None, layer=None, top=None))]
pub fn study_plan(
    py: Python<'_>,
    tolerance: PathBuf,
    folder: PathBuf,
    draws_per_shard: Option<u64>,
    progress: Option<Py<PyAny>>,
    layer: Option<(u16, u16)>,
    top: Option<String>,
) -> PyResult<String> {
    let layer = layer.map(|(layer, datatype)| LayerNumber::new(layer, datatype));
    let settings = PlanSettings {
        draws_per_shard,
        place: PillarPlace { layer, top },
    };
    let plan = work(py, progress, |p| study::plan(&tolerance, &folder, settings, p))?;
    Ok(serde_json::json!({ "plan": plan, "shards": plan.cut().shards() }).to_string())
}

/// Shards that are there.
#[pyfunction]
pub fn study_status(py: Python<'_>, folder: PathBuf) -> PyResult<String> {
    let status = work(py, None, |_| Work::open(&folder)?.cut().status())?;
    Ok(serde_json::json!(status).to_string())
}

/// Make one shard, if it is not there.
#[pyfunction]
#[pyo3(signature = (folder, shard, progress=None))]
pub fn study_run(py: Python<'_>, folder: PathBuf, shard: u64, progress: Option<Py<PyAny>>) -> PyResult<()> {
    work(py, progress, |p| Work::open(&folder)?.run(&[shard], p))
}

/// All draws and what they say; with a folder, the page is written there.
#[pyfunction]
#[pyo3(signature = (folder, out=None, psfs=0, progress=None))]
pub fn study_merge(
    py: Python<'_>,
    folder: PathBuf,
    out: Option<PathBuf>,
    psfs: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    work(py, progress, |p| {
        let plan = Plan::open(&folder)?;
        let result = study::merge(&plan, psfs, p)?;
        if let Some(out) = out {
            let inputs = plan.inputs()?;
            let turn = FolderLock::wait(&out, p, || ())?.keeping(inputs.iter().map(PathBuf::as_path));
            let files = study::report_files("result.csv");
            turn.publish("report", &[], |folder| study::write_page(&result, &files, folder))?;
        }
        Ok(serde_json::json!({ "study": result, "draws": result.draws }).to_string())
    })
}
