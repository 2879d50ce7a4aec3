//! A library as CSV.

use std::collections::BTreeSet;
use std::path::Path;

use super::{LibraryPillar, PillarLibrary};
use metalith_core::file::read_at_most;
use metalith_core::text::quoted;
use metalith_core::{Error, Result, csv_rows};
use metalith_pillars::UprightRectangles;

/// Longest library that is read (bytes): twice that of the most pillars.
const LONGEST_CSV: u64 = 1 << 20;

/// Most turns of a phase, either way: beyond it the fraction of a turn has fewer digits than a choice needs.
const MOST_TURNS: f64 = 1e6;

const HEAD: &str = "width_x_nm,width_y_nm,turns_x,turns_y,passed_x,passed_y";

/// Most of the power that a pillar passes, with room for the rounding of a solver.
const MOST_PASSED: f64 = 1.05;

impl PillarLibrary {
    /// The library as text: edges of each pillar (nm), phases of light along x and y (turns) and the shares of both that pass.
    pub fn to_csv(&self, pillars: UprightRectangles) -> String {
        let row = |p: &LibraryPillar| {
            let [x, y] = pillars.edges_nm(p.number);
            let [turns_x, turns_y] = p.turns;
            let [passed_x, passed_y] = p.passed;
            format!("{x},{y},{turns_x:.5},{turns_y:.5},{passed_x:.4},{passed_y:.4}\n")
        };
        let rows: String = self.pillars.iter().map(row).collect();
        format!("{HEAD}\n{rows}")
    }

    /// Reads what [`PillarLibrary::to_csv`] writes, or somebody else has measured or solved: pillars of these sizes, each once.
    /// Lines that begin with # are comments.
    ///
    /// # Errors
    /// If the file cannot be read, has no or too many rows, or a row is no such pillar, with its line.
    pub fn read_csv(path: &Path, pillars: UprightRectangles) -> Result<Self> {
        let hint =
            format!("the columns are `{HEAD}`: edges that the design may write, phases in turns, shares of the power");
        let refuse = |line: Option<usize>, what: String| Error::table(path, line, what, &hint);
        let bytes = read_at_most(path, LONGEST_CSV, "a library")?;
        let text = String::from_utf8_lossy(&bytes);
        let mut seen = BTreeSet::new();
        let read = csv_rows(&text, HEAD, &refuse)?.map(|row| {
            let row = row?;
            let [x, y, turns_x, turns_y, passed_x, passed_y] = row.numbers()?;
            if ![turns_x, turns_y].iter().all(|v| v.abs() <= MOST_TURNS) {
                return Err(row.refused(format!("\"{}\" is not a pillar", quoted(row.text))));
            }
            let whole = |nm: f64| (nm.fract() == 0.0 && (0.0..=f64::from(u16::MAX)).contains(&nm)).then_some(nm as u16);
            let number = whole(x).zip(whole(y)).and_then(|(x, y)| pillars.number([x, y]));
            let number = number.ok_or_else(|| {
                let [shortest, longest] = [pillars.shortest_nm, pillars.longest_nm()];
                let what = format!(
                    "{x} x {y} nm is no pillar of the design, whose edges are {shortest} to {longest} nm in steps of {}",
                    pillars.step_nm
                );
                row.refused(what)
            })?;
            if !seen.insert(number) {
                return Err(row.refused(format!("{x} x {y} nm stands here twice")));
            }
            let passed = [passed_x, passed_y];
            if let Some(share) = passed.iter().find(|p| !(**p > 0.0 && **p <= MOST_PASSED)) {
                return Err(row.refused(format!("a share of {share} of the power passes")));
            }
            Ok(LibraryPillar {
                number,
                turns: [turns_x, turns_y],
                passed,
            })
        });
        let read = read.collect::<Result<Vec<_>>>()?;
        if read.is_empty() {
            return Err(refuse(None, "the library has no pillars".into()));
        }
        Self::new(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PILLARS: UprightRectangles = UprightRectangles {
        shortest_nm: 100,
        step_nm: 20,
        lengths: 8,
    };

    fn read(text: &str) -> Result<PillarLibrary> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("library.csv");
        std::fs::write(&path, text).unwrap();
        PillarLibrary::read_csv(&path, PILLARS)
    }

    #[test]
    fn what_is_written_is_read() {
        let text = format!("{HEAD}\n100,140,0.12500,0.50000,0.9100,0.8800\n240,100,0.75000,0.00000,0.9000,0.9700\n");
        let library = read(&format!("\u{feff}# a comment\n{text}")).unwrap();
        assert_eq!(library.to_csv(PILLARS), text);
        assert_eq!(library.number([0.1, 0.5]), PILLARS.number([100, 140]).unwrap());
    }

    #[test]
    fn faults_are_told_by_their_lines() {
        let mut said = Vec::new();
        for (row, line) in [
            ("100,140,0,0,1", 2),
            ("100,140,0,x,1,1", 2),
            ("100,140,0,inf,1,1", 2),
            ("100,140,1.7e308,0,1,1", 2),
            ("100,140,0,0,1,1,1", 2),
            ("100,150,0,0,1,1", 2),
            ("100,260,0,0,1,1", 2),
            ("100,140,0,0,1,1\n100,140,0,0,1,1", 3),
            ("100,140,0,0,1,1.2", 2),
            ("100,140,0,0,0,1", 2),
        ] {
            match read(&format!("{HEAD}\n{row}\n")) {
                Err(Error::Table { line: at, what, .. }) => {
                    assert_eq!(at, Some(line), "{row}: {what}");
                    said.push(what);
                }
                other => panic!("{row}: {other:?}"),
            }
        }
        insta::assert_snapshot!(said.join("\n"), @r#"
            5 fields under 6 columns: `100,140,0,0,1`
            `x` in column `turns_y` is not a finite number
            `inf` in column `turns_y` is not a finite number
            "100,140,1.7e308,0,1,1" is not a pillar
            7 fields under 6 columns: `100,140,0,0,1,1,1`
            100 x 150 nm is no pillar of the design, whose edges are 100 to 240 nm in steps of 20
            100 x 260 nm is no pillar of the design, whose edges are 100 to 240 nm in steps of 20
            100 x 140 nm stands here twice
            a share of 1.2 of the power passes
            a share of 0 of the power passes
            "#);
        assert!(read("a,b\n").is_err() && read(&format!("{HEAD}\n")).is_err());
    }
}
