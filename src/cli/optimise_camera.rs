//! `metalith optimise --camera`: a whole camera.

use std::path::Path;

use metalith::cell::cache_folder;
use metalith::file::InputFiles;
use metalith::optimise::TaskCells;
use metalith::optimise::camera::{CameraReport, CameraTask, TriedCameras};
use metalith::sensor::Camera;
use metalith::text::counted;
use metalith::{Design, Error, Result};

use super::out_folder::OutFolder;
use super::paths::{inputs_of, paths};
use super::{Outcome, Terminal, print_json, print_line};

/// What is asked for.
pub(super) struct CameraSearch<'a> {
    pub design: &'a Design,
    pub camera: &'a Path,
    /// Folder of the results, and its note.
    pub folder: &'a Path,
    pub out: &'a OutFolder,
    pub command: String,
    pub json: bool,
}

/// File of the cameras that were tried, until the search is at its end.
const KEPT: &str = ".cameras.json";
/// Files of a search that may be there already, and their list.
const STALE: [&str; 4] = ["report.html", "report.json", "front.csv", ".report.sha256"];

pub(super) fn run(asked: &CameraSearch<'_>, terminal: &Terminal) -> Result<Outcome> {
    let design = asked.design;
    let camera = Camera::read(asked.camera)?;
    let text = std::fs::read_to_string(&design.path).map_err(Error::io("read", &design.path))?;
    let task = CameraTask::of(design, &text, camera.clone())?;
    let inputs = inputs_of(design, camera.files.iter().map(std::path::PathBuf::as_path));
    InputFiles::of(paths(&inputs)).check_outputs(&[&asked.folder.join("report.json")])?;
    let cells = TaskCells::of(design, false, cache_folder().as_deref(), terminal)?;
    let turn = terminal.turn_at(asked.folder, paths(&inputs))?;
    asked.out.note()?;
    let mut kept = TriedCameras::open(&asked.folder.join(KEPT), &task.decides(&text)?);
    if kept.count() > 0 {
        terminal.say(&format!(
            "{} of an earlier search are taken from `{}`",
            counted(kept.count(), "camera"),
            asked.folder.join(KEPT).display()
        ));
    }
    let found = task.search(cells.own(), &mut kept, terminal)?;
    let report = CameraReport::new(design, &text, &task, &camera.name, &found, asked.command.clone())?;
    turn.publish("report", &STALE, |folder| report.write(folder))?;
    if !found.interrupted {
        kept.discard()?;
    }
    terminal.clear();
    if asked.json {
        print_json(&report);
    } else {
        for best in &report.best {
            print_line!(
                "{} lux: {} x {} elements of {} um, {} um before the sensor: {:.2} dB expected, {}",
                best.illuminance_lux,
                best.columns,
                best.rows,
                best.diameter_um,
                best.distance_um,
                best.psnr_linear_db,
                asked.folder.join(best.file.as_deref().unwrap_or_default()).display()
            );
        }
        print_line!("report: {}", asked.folder.join("report.html").display());
        if let Some(best) = report.best.first().and_then(|b| b.file.as_deref()) {
            print_line!("next: metalith layout {}", asked.folder.join(best).display());
        }
    }
    for warning in &report.warnings {
        terminal.say(warning);
    }
    Ok(if found.interrupted {
        Outcome::NotDone
    } else {
        Outcome::of(report.readable)
    })
}
