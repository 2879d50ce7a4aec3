//! Tables of phase over radius, from CSV or NPY.

use std::f64::consts::TAU;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::Interpolation;
use metalith_core::{Error, Result, document};

/// Most rows of a table: a ring for each site of the largest lens that can be designed.
const MOST_ROWS: usize = 1 << 20;

/// Radii [um], strictly ascending from zero or more, and phases [rad].
///
/// # Errors
/// If the file cannot be read, is neither CSV with the columns `r_um, phase_rad` nor an NPY array of
/// shape `[rows, 2]`, or holds something that is not a finite number.
pub(super) fn read(path: &Path) -> Result<(Vec<f64>, Vec<f64>)> {
    let rows = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        read_npy(path)?
    } else {
        read_csv(path)?
    };
    let fault = |row: usize, what: String| Error::Table {
        path: path.to_owned(),
        line: Some(row + 2),
        what,
        hint: "radii ascend strictly from zero, all entries are finite".into(),
    };
    if rows.len() < 2 {
        return Err(fault(0, format!("a table of {} rows", rows.len())));
    }
    for (k, &(r, phase)) in rows.iter().enumerate() {
        if !r.is_finite() || !phase.is_finite() || r < 0.0 {
            return Err(fault(k, format!("radius {r} um with phase {phase} rad")));
        }
        if k > 0 && r <= rows[k - 1].0 {
            return Err(fault(k, format!("radius {r} um follows {} um", rows[k - 1].0)));
        }
    }
    Ok(rows.into_iter().unzip())
}

fn read_csv(path: &Path) -> Result<Vec<(f64, f64)>> {
    let text = document::load(path)?;
    let fault = |line: usize, what: String| Error::Table {
        path: path.to_owned(),
        line: Some(line),
        what,
        hint: "the columns are `r_um,phase_rad`; lines that begin with # are comments".into(),
    };
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(k, line)| (k + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let (at, head) = lines.next().ok_or_else(|| fault(1, "the file is empty".into()))?;
    if head.split(',').map(str::trim).ne(["r_um", "phase_rad"]) {
        return Err(fault(at, format!("the columns are `{head}`")));
    }
    lines
        .take(MOST_ROWS + 1)
        .map(|(at, line)| {
            let mut fields = line.split(',').map(|f| f.trim().parse::<f64>());
            match (fields.next(), fields.next(), fields.next()) {
                (Some(Ok(r)), Some(Ok(phase)), None) => Ok((r, phase)),
                _ => Err(fault(at, format!("`{line}` is not two numbers"))),
            }
        })
        .collect()
}

fn read_npy(path: &Path) -> Result<Vec<(f64, f64)>> {
    let fault = |what: String| Error::Table {
        path: path.to_owned(),
        line: None,
        what,
        hint: "save an array of shape [rows, 2], columns r_um and phase_rad, as float64 or float32 in C order".into(),
    };
    let file = File::open(path).map_err(Error::io("read", path))?;
    let npy = npyz::NpyFile::new(BufReader::new(file)).map_err(|e| fault(format!("this is no NPY file: {e}")))?;
    let shape = npy.shape().to_vec();
    if shape.len() != 2 || shape[1] != 2 || shape[0] > MOST_ROWS as u64 || npy.order() != npyz::Order::C {
        return Err(fault(format!("an array of shape {shape:?}")));
    }
    let values = match npy.try_data::<f64>() {
        Ok(data) => data.collect::<std::io::Result<Vec<_>>>(),
        Err(npy) => npy
            .try_data::<f32>()
            .map_err(|_| fault("the entries are neither float64 nor float32".into()))?
            .map(|v| v.map(f64::from))
            .collect(),
    };
    let values = values.map_err(|e| fault(format!("the file ends early: {e}")))?;
    Ok(values.chunks_exact(2).map(|row| (row[0], row[1])).collect())
}

/// Whole turns are added so that no step from row to row is more than half a turn: phases given ring by
/// ring are known up to whole turns, and steps between neighbours are judged.
pub(super) fn unwrap(phase_rad: &mut [f64]) {
    for k in 1..phase_rad.len() {
        let turns = ((phase_rad[k] - phase_rad[k - 1]) / TAU).round();
        phase_rad[k] -= turns * TAU;
    }
}

/// The phase at radius `r`; beyond the ends of the table, that of the end.
pub(super) fn at(radius_um: &[f64], phase_rad: &[f64], interpolation: Interpolation, r: f64) -> f64 {
    let above = radius_um.partition_point(|&x| x < r);
    if above == 0 {
        return phase_rad[0];
    }
    if above == radius_um.len() {
        return phase_rad[above - 1];
    }
    let share = (r - radius_um[above - 1]) / (radius_um[above] - radius_um[above - 1]);
    match interpolation {
        Interpolation::Linear => phase_rad[above - 1] + share * (phase_rad[above] - phase_rad[above - 1]),
        Interpolation::Nearest => phase_rad[if share < 0.5 { above - 1 } else { above }],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unwrapping_leaves_small_steps_and_the_same_phases() {
        let wrapped = [0.1, 6.2, 6.0, 0.2, 3.3, 6.1];
        let mut phases = wrapped;
        unwrap(&mut phases);
        for (now, was) in phases.iter().zip(wrapped) {
            let turns = (now - was) / TAU;
            assert!((turns - turns.round()).abs() < 1e-12);
        }
        assert!(phases.windows(2).all(|p| (p[1] - p[0]).abs() <= TAU / 2.0));
    }
}
