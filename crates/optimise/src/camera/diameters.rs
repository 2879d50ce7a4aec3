//! Diameters that have room in an arrangement: neighbours on a chip of the size of the sensor must not overlap.

use std::path::Path;

use metalith_core::document::Faults;
use metalith_core::{Error, Result};
use metalith_design::CameraSearchSpec;

use super::search::{Arrangement, SensorLattice};

/// Key of the diameters.
const KEY: &str = "optimise.camera.diameters_um";

/// Checks that each diameter of a task has room in one arrangement or more, before anything is computed. `text`: the design, in the file
/// at `path`.
///
/// # Errors
/// [`Error::Text`] with each diameter that has none, and the largest that has.
pub(super) fn check(spec: &CameraSearchSpec, sensor: &SensorLattice, (path, text): (&Path, &str)) -> Result<()> {
    let [across, down] = sensor.sides_um;
    let bounds: Vec<f64> = spec
        .arrangements
        .iter()
        .map(|count| Arrangement::diameters_below_um(*count, sensor))
        .collect();
    let bound = bounds.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // Whole micrometres.
    let most = bound.ceil() - 1.0;
    let of = |(k, diameter): (usize, &f64)| {
        let what = format!(
            "{diameter} um, and neighbouring elements of every arrangement would overlap on a chip of the size of the sensor, {across:.0} by {down:.0} um"
        );
        let hint = if most >= 1.0 {
            format!("give at most {most} um, or fewer `columns` and `rows`")
        } else {
            "give fewer `columns` and `rows`: no diameter has room".to_owned()
        };
        (format!("{KEY}.{k}"), what, hint)
    };
    let too_large = spec.diameters_um.iter().enumerate().filter(|(_, d)| **d >= bound);
    let faults: Vec<_> = too_large.map(of).collect();
    if faults.is_empty() {
        return Ok(());
    }
    Err(Error::Text(Box::new(Faults::at_keys(path, text, faults))))
}

/// Words for diameters that have no room in some arrangements, which are then left out; `None` if there are none.
pub(super) fn left_out(spec: &CameraSearchSpec, sensor: &SensorLattice) -> Option<String> {
    let mut all = Vec::new();
    for count in &spec.arrangements {
        let bound = Arrangement::diameters_below_um(*count, sensor);
        let large: Vec<String> = spec
            .diameters_um
            .iter()
            .filter(|d| **d >= bound)
            .map(f64::to_string)
            .collect();
        if !large.is_empty() {
            let [x, y] = count;
            all.push(format!("{x} by {y} elements of {} um", large.join(", ")));
        }
    }
    (!all.is_empty()).then(|| format!("left out, for neighbouring elements would overlap: {}", all.join("; ")))
}
