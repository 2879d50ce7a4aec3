//! Tables of phase over radius, from CSV or NPY.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use super::Interpolation;
use metalith_core::text::{quoted, table_rows};
use metalith_core::{CsvRow, Error, Result, csv_rows, document, npy};

/// Most rows of a table: a ring for each site of the largest lens that can be designed.
const MOST_ROWS: usize = 1 << 20;

/// Rows of a table.
#[derive(Debug)]
pub(super) struct Rows {
    /// Strictly ascending from zero or more.
    pub radius_um: Vec<f64>,
    pub phase_rad: Vec<f64>,
    /// Line of each row; none of a binary file.
    pub lines: Vec<usize>,
}

/// A table, of phases alone at radii this far apart (um) if that is given.
///
/// # Errors
/// If the file cannot be read, is neither CSV with the columns `r_um, phase_rad` nor an NPY array of
/// shape `[rows, 2]`, of phases alone neither one of both, or holds something that is not a finite number.
pub(super) fn read(path: &Path, pitch_um: Option<f64>) -> Result<Rows> {
    let (rows, lines) = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        (read_npy(path, pitch_um)?, Vec::new())
    } else {
        read_csv(path, pitch_um)?.into_iter().unzip()
    };
    let fault = |row: usize, what: String| {
        let hint = "radii ascend strictly from zero, all entries are finite";
        Error::table(path, lines.get(row).copied(), what, hint)
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
    let (radius_um, phase_rad) = rows.into_iter().unzip();
    Ok(Rows {
        radius_um,
        phase_rad,
        lines,
    })
}

/// Each row, and the line that it is in.
fn read_csv(path: &Path, pitch_um: Option<f64>) -> Result<Vec<((f64, f64), usize)>> {
    let text = document::load(path)?;
    let hint = match pitch_um {
        None => "the columns are `r_um,phase_rad`; lines that begin with # are comments; phases alone need `pitch_um`",
        Some(_) => "with `pitch_um` the one column is `phase_rad`; lines that begin with # are comments",
    };
    let refuse = |line: Option<usize>, what: String| Error::table(path, line, what, hint);
    let Some(pitch_um) = pitch_um else {
        let row = |row: Result<CsvRow<'_, Error>>| {
            let row = row?;
            let [r, phase] = row.numbers()?;
            Ok(((r, phase), row.line))
        };
        return csv_rows(&text, "r_um,phase_rad", &refuse)?
            .take(MOST_ROWS + 1)
            .map(row)
            .collect();
    };
    let mut lines = table_rows(&text).peekable();
    lines.next_if(|(_, head)| *head == "phase_rad");
    let row = |(k, (at, line)): (usize, (usize, &str))| match line.parse::<f64>() {
        Ok(phase) => Ok(((k as f64 * pitch_um, phase), at)),
        Err(_) => Err(refuse(Some(at), format!("`{}` is not a number", quoted(line)))),
    };
    lines.take(MOST_ROWS + 1).enumerate().map(row).collect()
}

fn read_npy(path: &Path, pitch_um: Option<f64>) -> Result<Vec<(f64, f64)>> {
    let hint = match pitch_um {
        None => {
            "save an array of shape [rows, 2], columns r_um and phase_rad, as float64 or float32; one of phases alone needs `pitch_um`"
        }
        Some(_) => "with `pitch_um`, save phases in rad or complex fields as an array of one axis",
    };
    let array = npy::read_phases(path, |shape| match (pitch_um, shape) {
        (None, [rows, 2]) | (Some(_), [rows]) => *rows <= MOST_ROWS as u64,
        _ => false,
    });
    let values = match array {
        Ok(array) => array.values,
        Err(npy::NpyError::Io(error)) => return Err(Error::io("read", path)(error)),
        Err(error) => return Err(Error::table(path, None, error.to_string(), hint)),
    };
    Ok(match pitch_um {
        None => values.chunks_exact(2).map(|row| (row[0], row[1])).collect(),
        Some(pitch_um) => values
            .iter()
            .zip(0..)
            .map(|(v, k)| (f64::from(k) * pitch_um, *v))
            .collect(),
    })
}

/// Largest step from row to row, in parts of pi, of a table that is surely wrapped: with larger ones it may fall as well as rise.
const SURE: f64 = 0.75;

/// Rounding of the phases of a table that ends a little above two pi (rad).
const ROUNDED_RAD: f64 = 0.01;

/// Add whole waves to phases that jump because they are wrapped: all are within one wave, and with the waves the jumps are steps
/// such as those beside them. True if waves were added.
///
/// # Errors
/// The row of a jump that may be one of a wave or a step.
pub(super) fn unwrap_if_wrapped(phase_rad: &mut [f64]) -> std::result::Result<bool, usize> {
    let (least, most) = phase_rad
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
    let jumps: Vec<usize> = (1..phase_rad.len())
        .filter(|&k| (phase_rad[k] - phase_rad[k - 1]).abs() > PI)
        .collect();
    if jumps.is_empty() || most - least > TAU + ROUNDED_RAD {
        return Ok(false);
    }
    let mut joined = phase_rad.to_vec();
    unwrap(&mut joined);
    // Difference of a step from the mean of those beside it; no number if there is none.
    let step = |phases: &[f64], k: usize| (1..phases.len()).contains(&k).then(|| phases[k] - phases[k - 1]);
    let apart = |phases: &[f64], k: usize| {
        let beside: Vec<f64> = [step(phases, k - 1), step(phases, k + 1)]
            .into_iter()
            .flatten()
            .collect();
        let mean = beside.iter().sum::<f64>() / beside.len() as f64;
        step(phases, k).map_or(f64::NAN, |own| (own - mean).abs())
    };
    // Rows far apart of a weak lens: the steps beside a jump are more like it as it stands.
    if jumps.iter().all(|&k| apart(phase_rad, k) < apart(&joined, k)) {
        return Ok(false);
    }
    let step = |k: usize| step(&joined, k);
    let is_clear = |k: usize| step(k).is_some_and(|own| own.abs() <= SURE * PI) && apart(&joined, k) < 0.5 * PI;
    if let Some(row) = jumps.into_iter().find(|&k| !is_clear(k)) {
        return Err(row);
    }
    // Steps of nearly half a wave elsewhere may be jumps of the other sign.
    if let Some(row) = (1..joined.len()).find(|&k| step(k).is_some_and(|step| step.abs() > SURE * PI)) {
        return Err(row);
    }
    phase_rad.copy_from_slice(&joined);
    Ok(true)
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

    #[test]
    fn wrapped_tables_are_joined_and_others_stay() {
        // A lens of 20 waves, some rows for each.
        let lens = |rows: i32| -> Vec<f64> {
            let r = |k| f64::from(k) / f64::from(rows);
            (0..=rows).map(|k| -20.0 * TAU * r(k).powi(2)).collect()
        };
        const ROUNDING: f64 = 1e-9;
        let wrap = |phases: &[f64]| phases.iter().map(|v| v.rem_euclid(TAU)).collect::<Vec<_>>();
        let fine = lens(400);
        let mut joined = wrap(&fine);
        assert_eq!(unwrap_if_wrapped(&mut joined), Ok(true));
        assert!(joined.iter().zip(&fine).all(|(a, b)| (a - b).abs() < ROUNDING));
        // Steps of more than half a wave at the rim: where it is cannot be told.
        assert!(unwrap_if_wrapped(&mut wrap(&lens(60))).is_err());
        // Unwrapped, however steep, and what never jumps.
        for mut stays in [
            lens(20),
            vec![0.0, 3.0, 6.0],
            vec![0.0, -3.0, -6.0],
            vec![0.0, -1.25, -5.0],
        ] {
            let was = stays.clone();
            assert_eq!(unwrap_if_wrapped(&mut stays), Ok(false));
            assert_eq!(stays, was);
        }
        // One step of most of a wave is either.
        assert_eq!(unwrap_if_wrapped(&mut [0.0, -5.0]), Err(1));
    }

    #[test]
    fn phases_alone_have_a_pitch() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("phase.csv");
        for head in ["", "phase_rad\n"] {
            std::fs::write(&path, format!("{head}1\n2\n4\n")).unwrap();
            let rows = read(&path, Some(0.5)).unwrap();
            assert_eq!(
                (rows.radius_um, rows.phase_rad),
                (vec![0.0, 0.5, 1.0], vec![1.0, 2.0, 4.0])
            );
        }
        assert!(read(&path, None).is_err());
    }

    /// Table as spreadsheets save it.
    #[test]
    fn a_mark_of_the_byte_order_is_no_part_of_a_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("phase.csv");
        for comment in ["", "# rings\r\n"] {
            std::fs::write(&path, format!("\u{feff}{comment}r_um,phase_rad\r\n0,1\r\n2,3\r\n")).unwrap();
            let rows = read(&path, None).unwrap();
            assert_eq!((rows.radius_um, rows.phase_rad), (vec![0.0, 2.0], vec![1.0, 3.0]));
        }
    }

    /// Comments and empty lines count in the line number of a fault.
    #[test]
    fn a_fault_is_told_by_its_own_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("phase.csv");
        std::fs::write(&path, "# rings\n\nr_um,phase_rad\n0,0\n# again\n0,1\n").unwrap();
        match read(&path, None).unwrap_err() {
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
