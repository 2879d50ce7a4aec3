//! A bench session planned from a design: its layout, then its measurements.

use std::path::{Path, PathBuf};

use metalith_bench_plan::{BenchFile, MeasurementPlan, PlanRequest, check_not_begun, check_plannable, plan};
use metalith_cell::cache_folder;
use metalith_core::{Error, FolderLock, Progress, Result};
use metalith_design::{Design, PillarArray};
use metalith_gds::extract::PillarsAt;
use metalith_layout::write_pillars;

/// Name of the layout in the folder of the session.
const LAYOUT: &str = "layout.gds";

/// Plan a bench session into a folder: the fewest measurements that find every effect at a wanted size and tell it from the
/// others. `layout` is the one that was written; without it the pillars of the design are written into the folder. `only`:
/// names of the effects that it is planned for; all if empty.
///
/// # Errors
/// If no session of the design can be planned, a file cannot be read or written, the folder holds a session that was begun, an effect is
/// not known, or the user stopped it.
pub fn plan_session(
    design: &Design,
    bench: &BenchFile,
    layout: Option<&Path>,
    folder: &Path,
    only: Vec<String>,
    progress: &dyn Progress,
) -> Result<MeasurementPlan> {
    check_plannable(design, bench)?;
    let turn = FolderLock::wait(folder, progress, || {
        progress.warn("another run writes into this folder: waiting for it");
    })?;
    check_not_begun(folder)?;
    let inputs = design.inputs();
    let turn = turn.keeping(inputs.iter().map(PathBuf::as_path).chain(layout));
    // Not listed: a person fills some of these files in.
    let planned = turn.replace("plan", &[], |into| {
        let (layout, layout_in_set) = if let Some(file) = layout {
            let whole = std::fs::canonicalize(file).map_err(Error::io("find", file))?;
            let name = whole.display().to_string();
            (whole, name)
        } else {
            let file = into.join(LAYOUT);
            let array = PillarArray::build(design, progress)?;
            write_pillars(design, &array, design.layout.hierarchy, &file, progress)?;
            (file, LAYOUT.to_owned())
        };
        let request = PlanRequest {
            design,
            bench,
            layout: &layout,
            layout_in_set,
            folder,
            into,
            only,
            cache: cache_folder(),
        };
        plan(&request, &PillarsAt::STATED, progress)
    })?;
    let frames = folder.join("captures");
    std::fs::create_dir_all(&frames).map_err(Error::io("make", &frames))?;
    Ok(planned)
}
