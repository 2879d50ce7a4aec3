//! Grid phases of OpticStudio (`.DAT`).
//!
//! The first line is `nx ny delx dely unitflag xdec ydec`; each of the nx ny lines after it begins with a phase (rad), the highest row
//! first, each from the least x on. Derivatives, which follow, are not used: between places the phase is linear. Lines that begin with
//! `!` are comments. The format is that of Grid Sag in the help of OpticStudio, with phases for sags.

use std::f64::consts::TAU;
use std::path::Path;

use super::MapTable;
use super::map::MOST;
use metalith_core::text::quoted;
use metalith_core::{Error, Result};

/// Units of the distances (um), by their number in a file.
const UNITS_UM: [f64; 4] = [1e3, 1e4, 25.4e3, 1e6];

/// Difference of the distances along x and y, as a share of them, that is the rounding of a program.
const ROUNDING: f64 = 1e-6;

/// The grid of a text; none if its first line is not of seven numbers.
pub(super) fn read(path: &Path, text: &str) -> Option<Result<MapTable>> {
    let is_line = |(_, line): &(usize, &str)| !line.is_empty() && !line.starts_with(['!', '#']);
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(k, line)| (k + 1, line.trim()))
        .filter(is_line);
    let (line, head) = lines.next()?;
    let head: Vec<f64> = head
        .split_ascii_whitespace()
        .map_while(|word| word.parse().ok())
        .collect();
    let &[nx, ny, dx, dy, unit, x, y] = head.as_slice() else {
        return None;
    };
    let fault = |line: usize, what: String, hint: &str| Error::Table {
        path: path.to_owned(),
        line: Some(line),
        what,
        hint: hint.into(),
    };
    let is_count = |n: f64| n.fract() == 0.0 && (2.0..=MOST as f64).contains(&n);
    let unit_um = UNITS_UM
        .iter()
        .zip(0_u8..)
        .find(|(_, number)| f64::from(*number) == unit)
        .map(|(um, _)| um);
    let steps = [dx.abs(), dy.abs()];
    let (Some(unit_um), true, true) = (
        unit_um,
        is_count(nx) && is_count(ny),
        steps.iter().all(|d| d.is_finite() && *d > 0.0),
    ) else {
        let hint = "give nx, ny, delx, dely, unitflag (0 mm, 1 cm, 2 in, 3 m), xdec and ydec";
        return Some(Err(fault(line, "no grid of phases".into(), hint)));
    };
    if (steps[0] - steps[1]).abs() > ROUNDING * steps[0] || x != 0.0 || y != 0.0 {
        let what = format!("places {} by {} apart, moved by {x} and {y}", steps[0], steps[1]);
        let hint =
            "give equal distances along x and y, no decentre (`centre_um` moves the phase), or the phase as a `map`";
        return Some(Err(fault(line, what, hint)));
    }
    let (columns, rows) = (nx as usize, ny as usize);
    let mut values = Vec::new();
    for (line, text) in lines {
        let word = text.split_ascii_whitespace().next().unwrap_or_default();
        match word.parse::<f64>() {
            Ok(rad) if rad.is_finite() && values.len() < columns * rows => values.push(rad),
            _ => {
                return Some(Err(fault(
                    line,
                    format!("`{}` is no phase of the grid", quoted(word)),
                    "give nx ny phases in rad",
                )));
            }
        }
    }
    if values.len() < columns * rows {
        let what = format!("{} phases of {columns} by {rows}", values.len());
        return Some(Err(fault(line, what, "give nx ny phases in rad")));
    }
    let turned: Vec<f64> = values.chunks(columns).rev().flatten().copied().collect();
    // Phases that never jump are interpolated as they are.
    let jumps = |a: f64, b: f64| (a - b).abs() > TAU / 2.0;
    let along_x = turned
        .chunks(columns)
        .any(|row| row.windows(2).any(|pair| jumps(pair[0], pair[1])));
    let along_y = turned.iter().zip(&turned[columns..]).any(|(a, b)| jumps(*a, *b));
    Some(Ok(MapTable::of_values(
        path,
        steps[0] * unit_um,
        along_x || along_y,
        columns,
        &turned,
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase::TermForm;
    use crate::phase::term::optic_studio;

    fn read_text(text: &str) -> Result<TermForm> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.dat");
        std::fs::write(&path, text).unwrap();
        optic_studio::read(&path, None)
    }

    #[test]
    fn the_first_row_is_the_highest() {
        let phase = |x_um: f64, y_um: f64| 0.02 * x_um - 0.05 * y_um;
        let mut text = "! a grid\n5 5 0.01 0.01 0 0 0\n".to_owned();
        for row in 0..5 {
            for column in 0..5 {
                let (x, y) = (f64::from(column) * 10.0 - 20.0, 20.0 - f64::from(row) * 10.0);
                text += &format!("{} 0 0 0\n", phase(x, y));
            }
        }
        let Ok(TermForm::Map(map)) = read_text(&text) else {
            panic!("no map");
        };
        assert!(!map.is_wrapped());
        for (x, y) in [(-20.0, 20.0), (3.0, -7.0), (15.0, 1.0)] {
            assert!((map.turns(x, y) * TAU - phase(x, y)).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_no_grid_is_refused() {
        let said = [
            "2 2 0.01 0.02 0 0 0\n",
            "2 2 0.01 0.01 9 0 0\n",
            "99999999 2 0.01 0.01 0 0 0\n",
            "2 2 0.01 0.01 0 0 0\n1\n2\n3\n",
            "2 2 0.01 0.01 0 0 0\n1\n2\nx\n4\n",
            "2 2 0.01 0.01 0 0 0\n1\n2\n3\n4\n5\n",
        ]
        .map(|text| match read_text(text).unwrap_err() {
            Error::Table { line, what, .. } => format!("{line:?} {what}"),
            other => other.to_string(),
        });
        insta::assert_snapshot!(said.join("\n"), @"
            Some(1) places 0.01 by 0.02 apart, moved by 0 and 0
            Some(1) no grid of phases
            Some(1) no grid of phases
            Some(1) 3 phases of 2 by 2
            Some(4) `x` is no phase of the grid
            Some(6) `5` is no phase of the grid
            ");
    }
}
