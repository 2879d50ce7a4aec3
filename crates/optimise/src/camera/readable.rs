//! Designs of a search that can be read: their chip, apertures and marks have room for the elements that are tried.

use std::path::Path;

use metalith_core::document::Faults;
use metalith_core::{Error, Result};
use metalith_design::Design;

use super::search::Arrangement;
use super::task::CameraTask;

/// Fault of the design of an arrangement.
struct Found {
    key: String,
    what: String,
    hint: String,
    size_um: f64,
}

/// Checks that the design of each arrangement of a task can be read, before anything is computed. `text`: the design, in the file at
/// `path`. Of all arrangements with a fault at one key the largest is named.
///
/// # Errors
/// [`Error::Text`] with the faults, at the keys of the design that was given.
pub(super) fn check(task: &CameraTask, path: &Path, text: &str) -> Result<()> {
    let mut found: Vec<Found> = Vec::new();
    for arrangement in task.arrangements()? {
        match Design::parse_without_library(path, &task.first_text(text, &arrangement)) {
            Ok(_) => {}
            Err(Error::Text(faults)) => {
                for fault in faults.faults() {
                    let own = Found {
                        key: fault.key.clone(),
                        what: format!("{}: {}", words(&arrangement), fault.what),
                        hint: fault.hint.clone(),
                        size_um: size_um(task, &arrangement, &fault.key),
                    };
                    match found.iter_mut().find(|f| f.key == own.key) {
                        Some(known) if known.size_um < own.size_um => *known = own,
                        Some(_) => {}
                        None => found.push(own),
                    }
                }
            }
            Err(other) => return Err(other),
        }
    }
    if found.is_empty() {
        return Ok(());
    }
    let faults = found.into_iter().map(|f| (f.key, f.what, f.hint)).collect();
    Err(Error::Text(Box::new(Faults::at_keys(path, text, faults))))
}

fn words(a: &Arrangement) -> String {
    let [x, y] = a.count;
    format!(
        "a camera of {x} by {y} elements of {} um, {} um before the sensor",
        a.diameter_um, a.distance_um
    )
}

/// Size that decides a fault (um): openings depend on the diameter, all else on the place that all elements take.
fn size_um(task: &CameraTask, a: &Arrangement, key: &str) -> f64 {
    if key.starts_with("apertures") {
        a.diameter_um
    } else {
        let [x, y] = task.extent_um(a);
        x.max(y)
    }
}
