//! Tables of phase over radius, from CSV or NPY.

use std::f64::consts::TAU;
use std::path::Path;

use super::Interpolation;
use metalith_core::text::{quoted, table_rows};
use metalith_core::{Error, Result, document, npy};

/// Most rows of a table: a ring for each site of the largest lens that can be designed.
const MOST_ROWS: usize = 1 << 20;

/// Radii (um), strictly ascending from zero or more, and phases (rad).
///
/// # Errors
/// If the file cannot be read, is neither CSV with the columns `r_um, phase_rad` nor an NPY array of
/// shape `[rows, 2]`, or holds something that is not a finite number.
pub(super) fn read(path: &Path) -> Result<(Vec<f64>, Vec<f64>)> {
    let (rows, lines) = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        (read_npy(path)?, Vec::new())
    } else {
        read_csv(path)?.into_iter().unzip()
    };
    let fault = |row: usize, what: String| Error::Table {
        path: path.to_owned(),
        line: lines.get(row).copied(),
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

/// Each row, and the line that it is in.
fn read_csv(path: &Path) -> Result<Vec<((f64, f64), usize)>> {
    let text = document::load(path)?;
    let fault = |line: usize, what: String| Error::Table {
        path: path.to_owned(),
        line: Some(line),
        what,
        hint: "the columns are `r_um,phase_rad`; lines that begin with # are comments".into(),
    };
    let mut lines = table_rows(&text);
    let (at, head) = lines.next().ok_or_else(|| fault(1, "the file is empty".into()))?;
    if head.split(',').map(str::trim).ne(["r_um", "phase_rad"]) {
        return Err(fault(at, format!("the columns are `{}`", quoted(head))));
    }
    lines
        .take(MOST_ROWS + 1)
        .map(|(at, line)| {
            let mut fields = line.split(',').map(|f| f.trim().parse::<f64>());
            match (fields.next(), fields.next(), fields.next()) {
                (Some(Ok(r)), Some(Ok(phase)), None) => Ok(((r, phase), at)),
                _ => Err(fault(at, format!("`{}` is not two numbers", quoted(line)))),
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
    let array = npy::read(path, |shape| {
        shape.len() == 2 && shape[1] == 2 && shape[0] <= MOST_ROWS as u64
    });
    let values = match array {
        Ok(array) => array.values,
        Err(npy::NpyError::Io(error)) => return Err(Error::io("read", path)(error)),
        Err(error) => return Err(fault(error.to_string())),
    };
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

/// Roundings, of a radius and of the middle of two rows, that a radius may be short of that middle and be on it.
const ROUNDINGS: f64 = 8.0;

/// The phase at radius `r`; beyond the ends of the table, that of the end. As near to two rows, as sites of a hexagonal lattice
/// are whose rows are the middles of rings, it is the outer one: a ring holds its inner border, whichever way numbers round.
pub(super) fn at(radius_um: &[f64], phase_rad: &[f64], interpolation: Interpolation, r: f64) -> f64 {
    let above = radius_um.partition_point(|&x| x < r);
    if above == 0 {
        return phase_rad[0];
    }
    if above == radius_um.len() {
        return phase_rad[above - 1];
    }
    let [inner, outer] = [radius_um[above - 1], radius_um[above]];
    match interpolation {
        Interpolation::Linear => {
            let share = (r - inner) / (outer - inner);
            phase_rad[above - 1] + share * (phase_rad[above] - phase_rad[above - 1])
        }
        Interpolation::Nearest => {
            let is_inner = r < 0.5 * (inner + outer) - ROUNDINGS * f64::EPSILON * r;
            phase_rad[if is_inner { above - 1 } else { above }]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unwrapping_leaves_small_steps_and_the_same_phases() {
        // A few sums of turns below ten in double precision.
        const ROUNDING: f64 = 1e-12;
        let wrapped = [0.1, 6.2, 6.0, 0.2, 3.3, 6.1];
        let mut phases = wrapped;
        unwrap(&mut phases);
        for (now, was) in phases.iter().zip(wrapped) {
            let turns = (now - was) / TAU;
            assert!((turns - turns.round()).abs() < ROUNDING);
        }
        assert!(phases.windows(2).all(|p| (p[1] - p[0]).abs() <= TAU / 2.0));
    }

    /// Table as spreadsheets save it.
    #[test]
    fn a_mark_of_the_byte_order_is_no_part_of_a_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("phase.csv");
        for comment in ["", "# rings\r\n"] {
            std::fs::write(&path, format!("\u{feff}{comment}r_um,phase_rad\r\n0,1\r\n2,3\r\n")).unwrap();
            assert_eq!(read(&path).unwrap(), (vec![0.0, 2.0], vec![1.0, 3.0]));
        }
    }

    /// Comments and empty lines count where a fault is told.
    #[test]
    fn a_fault_is_told_by_its_own_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("phase.csv");
        std::fs::write(&path, "# rings\n\nr_um,phase_rad\n0,0\n# again\n0,1\n").unwrap();
        match read(&path).unwrap_err() {
            Error::Table { line, .. } => assert_eq!(line, Some(6)),
            other => panic!("{other}"),
        }
    }

    /// Rows in the middles of rings, sites on their borders: the square of a radius may round to either side.
    #[test]
    fn a_border_is_of_the_outer_row() {
        let radius_um: Vec<f64> = (0..1000).map(|k| (f64::from(k) + 0.5) * 0.652).collect();
        let rows: Vec<f64> = (0..1000).map(f64::from).collect();
        for k in 1..1000 {
            let border = f64::from(k) * 652.0 * 1e-3;
            for (r, row) in [
                (border, k),
                (border.powi(2).sqrt().next_down(), k),
                // The next shorter distance of a site, whose square is a whole number of nm^2.
                ((border.powi(2) - 1e-6).sqrt(), k - 1),
            ] {
                assert_eq!(at(&radius_um, &rows, Interpolation::Nearest, r), f64::from(row), "{r}");
            }
        }
    }
}
