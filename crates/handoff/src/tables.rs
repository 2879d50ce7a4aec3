//! Tables as CSV: what a lab opens in a spreadsheet and fills in.

use std::path::Path;

use super::dose::{DoseRow, WriteTime};
use super::matrix::DoseBlock;
use super::process::Process;
use super::sites::{Cross, MetrologySite};
use super::structures::Structure;
use metalith_core::{Result, WholeFile};

/// Rows of text under a head.
struct Csv(String);

impl Csv {
    fn new(head: &[&str]) -> Self {
        let mut csv = Self(String::new());
        csv.row(head);
        csv
    }

    fn row<T: AsRef<str>>(&mut self, cells: &[T]) {
        let cells: Vec<_> = cells.iter().map(|c| quoted(c.as_ref())).collect();
        self.0.push_str(&cells.join(","));
        self.0.push_str("\r\n");
    }

    fn write(&self, path: &Path) -> Result<()> {
        WholeFile::write(path, self.0.as_bytes())
    }
}

/// As RFC 4180 asks: quoted where a comma, quote or line end would be taken for structure. A text that a spreadsheet
/// would compute as a formula has an apostrophe before it, which makes it a text there.
fn quoted(cell: &str) -> String {
    let cell = match cell.chars().next() {
        Some('=' | '+' | '-' | '@' | '\t' | '\r') if cell.parse::<f64>().is_err() => format!("'{cell}"),
        _ => cell.to_owned(),
    };
    if cell.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell
    }
}

fn um(x: f64) -> String {
    format!("{x:.3}")
}

pub(super) fn write_doses(path: &Path, doses: &[DoseRow], blocks: &[DoseBlock], layer: i16) -> Result<()> {
    let mut csv = Csv::new(&[
        "number",
        "layer",
        "datatype",
        "factor",
        "dose_uc_cm2",
        "modulation_percent",
        "lens_x_um",
        "lens_y_um",
        "pads_x_um",
        "pads_y_um",
        "measured_pad_width_nm",
        "remarks",
    ]);
    for (dose, block) in doses.iter().zip(blocks) {
        csv.row(&[
            dose.number.to_string(),
            layer.to_string(),
            dose.number.to_string(),
            format!("{:.3}", dose.factor),
            format!("{:.2}", dose.dose_uc_cm2),
            format!("{:+.2}", dose.modulation_percent),
            um(block.lens.0 as f64 * 1e-3),
            um(block.lens.1 as f64 * 1e-3),
            um(block.pads.0 as f64 * 1e-3),
            um(block.pads.1 as f64 * 1e-3),
            String::new(),
            String::new(),
        ]);
    }
    csv.write(path)
}

pub(super) fn write_times(path: &Path, files: &[(String, Vec<WriteTime>)]) -> Result<()> {
    let mut csv = Csv::new(&[
        "file",
        "current_na",
        "shot_step_nm",
        "clock_mhz",
        "beam_s",
        "shapes_s",
        "fields_s",
        "job_s",
        "total_s",
    ]);
    for (file, times) in files {
        for t in times {
            csv.row(&[
                file.clone(),
                t.beam.current_na.to_string(),
                t.beam.shot_step_nm.to_string(),
                format!("{:.4}", t.beam.clock_mhz),
                format!("{:.1}", t.beam_s),
                format!("{:.1}", t.shapes_s),
                format!("{:.1}", t.fields_s),
                format!("{:.1}", t.job_s),
                format!("{:.1}", t.total_s()),
            ]);
        }
    }
    csv.write(path)
}

pub(super) fn write_sites(path: &Path, sites: &[MetrologySite], process: &Process) -> Result<()> {
    let mut csv = Csv::new(&[
        "id",
        "file",
        "place",
        "x_um",
        "y_um",
        "element_x_um",
        "element_y_um",
        "drawn_nm",
        "neighbours_min_nm",
        "neighbours_max_nm",
        "expected_low_nm",
        "expected_high_nm",
        "measured_x_nm",
        "measured_y_nm",
        "remarks",
    ]);
    let within = 2.0 * process.metrology.width_tolerance_nm;
    for site in sites {
        let width = f64::from(site.width_nm);
        csv.row(&[
            site.id.clone(),
            site.file.to_owned(),
            site.place.clone(),
            um(site.x_um),
            um(site.y_um),
            site.element_x_um.map_or_else(String::new, um),
            site.element_y_um.map_or_else(String::new, um),
            site.width_nm.to_string(),
            site.around_nm.0.to_string(),
            site.around_nm.1.to_string(),
            format!("{:.1}", width - within),
            format!("{:.1}", width + within),
            String::new(),
            String::new(),
            String::new(),
        ]);
    }
    csv.write(path)
}

pub(super) fn write_crosses(path: &Path, crosses: &[Cross], steps: &str) -> Result<()> {
    let mut csv = Csv::new(&[
        "set",
        "role",
        "x_um",
        "y_um",
        "arm_length_um",
        "arm_width_um",
        "layers",
        "found_x_um",
        "found_y_um",
    ]);
    for cross in crosses {
        csv.row(&[
            cross.set.clone(),
            cross.role.clone(),
            um(cross.x_um),
            um(cross.y_um),
            um(cross.length_um),
            um(cross.width_um),
            steps.to_owned(),
            String::new(),
            String::new(),
        ]);
    }
    csv.write(path)
}

pub(super) fn write_structures(path: &Path, structures: &[Structure]) -> Result<()> {
    let mut csv = Csv::new(&["id", "x0_um", "y0_um", "x1_um", "y1_um", "drawn_nm", "purpose"]);
    for s in structures {
        let b = s.bounds;
        let corners = [b.x0, b.y0, b.x1, b.y1].map(|v| um(v as f64 * 1e-3));
        let [x0, y0, x1, y1] = corners;
        let width = s.width_nm.map_or_else(String::new, |w| w.to_string());
        csv.row(&[s.id.clone(), x0, y0, x1, y1, width, s.purpose.clone()]);
    }
    csv.write(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_no_formulas_and_numbers_stay_numbers() {
        for (cell, written) in [
            ("=1+1", "'=1+1"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("-cmd|' /C calc'!A0", "'-cmd|' /C calc'!A0"),
            ("+2.50", "+2.50"),
            ("-75.000", "-75.000"),
            ("=a,\"b\"", "\"'=a,\"\"b\"\"\""),
            ("plain", "plain"),
            ("", ""),
        ] {
            assert_eq!(quoted(cell), written);
        }
    }
}
