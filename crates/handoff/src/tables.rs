//! Tables as CSV: what a lab opens in a spreadsheet and fills in.

use std::path::Path;

use super::dose::{DoseRow, WriteTime};
use super::dose_classes::DoseClass;
use super::dose_matrix::DoseBlock;
use super::kind_words::KindWords;
use super::metrology_sites::{Cross, MetrologySite};
use super::pad::DrawnSize;
use super::process::Process;
use super::structures::Structure;
use metalith_core::{AtomicFile, Result, csv_field};
use metalith_pillars::PillarShape;

/// Rows of text under a head.
struct Csv(String);

impl Csv {
    fn new(head: &[&str]) -> Self {
        let mut csv = Self(String::new());
        csv.row(head);
        csv
    }

    fn row<T: AsRef<str>>(&mut self, cells: &[T]) {
        let cells: Vec<_> = cells.iter().map(|c| csv_field(c.as_ref())).collect();
        self.0.push_str(&cells.join(","));
        self.0.push_str("\r\n");
    }

    fn write(&self, path: &Path) -> Result<()> {
        AtomicFile::write(path, self.0.as_bytes())
    }
}

fn um(x: f64) -> String {
    format!("{x:.3}")
}

/// The doses, with a column to fill in for each size that tells a pad: of rectangles two, of other shapes one.
pub(super) fn write_doses(
    path: &Path,
    doses: &[DoseRow],
    blocks: &[DoseBlock],
    layer: i16,
    shape: Option<PillarShape>,
) -> Result<()> {
    let mut head = vec![
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
    ];
    match shape {
        Some(shape) => head.extend(KindWords::of(shape).dose_columns),
        None => head.push("measured_width_nm"),
    }
    head.push("remarks");
    let mut csv = Csv::new(&head);
    for (dose, block) in doses.iter().zip(blocks) {
        let mut cells = vec![
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
        ];
        cells.resize(head.len(), String::new());
        csv.row(&cells);
    }
    csv.write(path)
}

/// Dose classes with their areas.
pub(super) fn write_dose_classes(path: &Path, classes: &[DoseClass], layer: i16) -> Result<()> {
    let mut csv = Csv::new(&[
        "class",
        "layer",
        "datatype",
        "factor",
        "dose_uc_cm2",
        "pillars",
        "area_um2",
        "file",
    ]);
    for class in classes {
        csv.row(&[
            class.number.to_string(),
            layer.to_string(),
            class.number.to_string(),
            format!("{:.4}", class.factor),
            format!("{:.2}", class.dose_uc_cm2),
            class.pillars.to_string(),
            format!("{:.3}", class.area_um2),
            class.file.clone(),
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

/// Places to measure at. Squares and circles are measured along x and y, rectangles along their edges.
pub(super) fn write_sites(path: &Path, sites: &[MetrologySite], process: &Process, shape: PillarShape) -> Result<()> {
    let mut head = vec!["id", "file", "place", "x_um", "y_um", "element_x_um", "element_y_um"];
    let words = KindWords::of(shape);
    head.extend(words.drawn_columns.iter().chain(words.site_columns));
    head.push("remarks");
    let mut csv = Csv::new(&head);
    let within = 2.0 * process.metrology.width_tolerance_nm;
    for site in sites {
        let mut cells = vec![
            site.id.clone(),
            site.file.to_owned(),
            site.place.clone(),
            um(site.x_um),
            um(site.y_um),
            site.element_x_um.map_or_else(String::new, um),
            site.element_y_um.map_or_else(String::new, um),
        ];
        cells.extend(drawn_cells(shape, Some(&site.drawn)));
        if shape.has_width() {
            let nm = |pick: fn((u16, u16)) -> u16| site.around_nm.map_or_else(String::new, |a| pick(a).to_string());
            let width = f64::from(site.drawn.width_nm);
            let expected = [width - within, width + within].map(|nm| format!("{nm:.1}"));
            cells.extend([nm(|a| a.0), nm(|a| a.1)].into_iter().chain(expected));
        } else if shape.has_one_size() {
            let deg = |pick: fn((f64, f64)) -> f64| site.around_deg.map_or_else(String::new, |a| pick(a).to_string());
            cells.extend([deg(|a| a.0), deg(|a| a.1), format!("{within:.1}")]);
        } else {
            let by = site.around_by_nm.map_or_else(String::new, |nm| nm.to_string());
            cells.extend([by, format!("{within:.1}")]);
        }
        cells.resize(head.len(), String::new());
        csv.row(&cells);
    }
    csv.write(path)
}

fn drawn_cells(shape: PillarShape, drawn: Option<&DrawnSize>) -> Vec<String> {
    let width = drawn.map_or_else(String::new, |d| d.width_nm.to_string());
    if shape.has_width() {
        return vec![width];
    }
    let length = drawn.and_then(|d| d.length_nm).map(|nm| nm.to_string());
    let rotation = drawn.and_then(|d| d.rotation_deg).map(|deg| deg.to_string());
    let mut cells = vec![width, length.unwrap_or_default()];
    cells.extend(shape.has_one_size().then(|| rotation.unwrap_or_default()));
    cells
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

pub(super) fn write_structures(path: &Path, structures: &[Structure], shape: PillarShape) -> Result<()> {
    let mut head = vec!["id", "x0_um", "y0_um", "x1_um", "y1_um"];
    head.extend(KindWords::of(shape).drawn_columns);
    head.push("purpose");
    let mut csv = Csv::new(&head);
    for s in structures {
        let b = s.bounds;
        let mut cells = vec![s.id.clone()];
        cells.extend([b.x0, b.y0, b.x1, b.y1].map(|v| um(v as f64 * 1e-3)));
        cells.extend(drawn_cells(shape, s.drawn.as_ref()));
        cells.push(s.purpose.clone());
        csv.row(&cells);
    }
    csv.write(path)
}
