//! The report of a search: which cameras were tried, and what the best ones promise.

use std::fmt::Write;
use std::path::Path;

use metalith_core::{AtomicFile, Result};
use metalith_design::Design;
use metalith_report::{Axis, Cell, Chart, Column, Page, Table, Verdict, counted, exact, sig, write_json};
use serde::Serialize;

use super::task::{CameraFindings, CameraTask, TriedCamera};

/// Findings of a search, as they are written.
#[derive(Clone, Debug, Serialize)]
pub struct CameraReport {
    /// Name and title of the design.
    pub design: String,
    pub command: String,
    pub camera: String,
    /// Warnings, the gravest first.
    pub warnings: Vec<String>,
    /// Best camera for each light.
    pub best: Vec<CameraRow>,
    /// All cameras, after their first descents.
    pub tried: Vec<CameraRow>,
    /// Narrowest pillar of the cell (nm): what the writer must make.
    pub narrowest_line_nm: f64,
    #[serde(skip)]
    texts: Vec<(String, String)>,
    /// True if the designs of all best cameras can be read.
    #[serde(skip)]
    pub readable: bool,
    /// True if the search came to its end.
    #[serde(skip)]
    whole: bool,
    /// Angle between the edges of a scene (degrees).
    pub field_deg: f64,
    /// Pixels between them.
    #[serde(skip)]
    scene_pixels: usize,
}

/// One camera in figures.
#[derive(Clone, Debug, Serialize)]
pub struct CameraRow {
    /// File of its design, of the best ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    pub illuminance_lux: f64,
    pub columns: usize,
    pub rows: usize,
    pub distance_um: f64,
    pub diameter_um: f64,
    /// Distance over diameter.
    pub f_number: f64,
    pub wedge_share: f64,
    pub start: &'static str,
    /// Expected PSNR of linear light (dB): of the mean error of the field, and of its worst part.
    pub psnr_linear_db: f64,
    pub worst_psnr_linear_db: f64,
    /// Electrons of white on the axis, channel by channel, and the time (ms) after which they are there.
    pub white_e: Vec<f64>,
    pub time_ms: f64,
    pub images_overlap: bool,
    /// Sides of the rectangle about all elements (um).
    pub chip_um: [f64; 2],
    /// Area of all elements (mm^2), and pillars in them.
    pub open_mm2: f64,
    pub pillars: f64,
}

impl CameraRow {
    fn new(camera: &TriedCamera, pitch_um: f64, file: Option<String>) -> Self {
        let a = &camera.arrangement;
        let farthest = |axis: usize| {
            camera
                .elements
                .iter()
                .map(|e| e.centre_um[axis].abs())
                .fold(0.0, f64::max)
        };
        let open_um2: f64 = camera
            .elements
            .iter()
            .map(|e| std::f64::consts::PI * e.radius_um().powi(2))
            .sum();
        let decibel = |error: f64| -10.0 * error.log10();
        Self {
            file,
            illuminance_lux: camera.lux,
            columns: a.count[0],
            rows: a.count[1],
            distance_um: a.distance_um,
            diameter_um: a.diameter_um,
            f_number: a.distance_um / a.diameter_um,
            wedge_share: a.wedge_share,
            start: camera.start.name(),
            psnr_linear_db: camera.judged.psnr_db(),
            worst_psnr_linear_db: decibel(camera.judged.parts.iter().copied().fold(0.0, f64::max)),
            white_e: camera.judged.white_e.clone(),
            time_ms: camera.judged.time_s * 1e3,
            images_overlap: camera.overlaps,
            chip_um: [0, 1].map(|axis| 2.0 * farthest(axis) + a.diameter_um),
            open_mm2: open_um2 * 1e-6,
            pillars: (open_um2 / pitch_um.powi(2)).round(),
        }
    }
}

impl CameraReport {
    /// Report of a search. `text`: the design that it was made for; the designs of the best cameras are read back at `folder`.
    ///
    /// # Errors
    /// If the design of a camera cannot be read: its elements do not fit the chip or the marks of the design.
    pub fn new(
        design: &Design,
        text: &str,
        task: &CameraTask,
        camera: &str,
        found: &CameraFindings,
        command: String,
    ) -> Result<Self> {
        let pitch_um = f64::from(design.cell.pitch_nm) * 1e-3;
        let mut texts = Vec::new();
        let mut best = Vec::new();
        let mut warnings = Vec::new();
        let mut readable = true;
        if found.interrupted {
            let begun = |lux: &f64| found.tried.iter().any(|c| c.lux == *lux);
            let left: Vec<String> = task
                .spec
                .illuminance_lux
                .iter()
                .filter(|l| !begun(l))
                .map(f64::to_string)
                .collect();
            let not_begun = if left.is_empty() {
                String::new()
            } else {
                format!(" No camera was tried at {} lux.", left.join(", "))
            };
            warnings.push(format!(
                "The search was interrupted after {}. The last descent did not come to its end.{not_begun} The same command continues.",
                counted(found.tried.len(), "camera")
            ));
        }
        for one in &found.best {
            let name = format!("camera_{}", one.lux).replace('.', "_");
            let file = format!("{name}.toml");
            let own = task.design_text(text, &name, one);
            // Hours of search are not lost to marks in the way.
            if let Err(error) = Design::parse(&design.path, &own) {
                warnings.push(format!("The program does not read `{file}`: {error}"));
                readable = false;
            }
            let row = CameraRow::new(one, pitch_um, Some(file.clone()));
            if one.judged.time_s < 0.99 * task.spec.longest_s {
                warnings.push(format!(
                    "At {} lux white fills the pixels after {} ms, less than the {} ms that are allowed.",
                    exact(one.lux),
                    sig(row.time_ms, 3),
                    exact(task.spec.longest_s * 1e3)
                ));
            }
            if one.overlaps {
                warnings.push(format!(
                    "At {} lux images of neighbouring elements overlap. The foreign light counts as noise.",
                    exact(one.lux)
                ));
            }
            texts.push((file, own));
            best.push(row);
        }
        Ok(Self {
            design: format!("{}: {}", design.name, design.title),
            command,
            camera: camera.to_owned(),
            warnings,
            best,
            tried: found.tried.iter().map(|c| CameraRow::new(c, pitch_um, None)).collect(),
            narrowest_line_nm: f64::from(design.cell.width_range_nm.0),
            texts,
            readable,
            whole: !found.interrupted,
            field_deg: task.spec.field_deg,
            scene_pixels: task.spec.scene_pixels,
        })
    }

    /// Write page, numbers, front and designs into a folder.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        for (file, text) in &self.texts {
            AtomicFile::write(&folder.join(file), text.as_bytes())?;
        }
        AtomicFile::write(&folder.join("front.csv"), self.front().as_bytes())?;
        write_json(&folder.join("report.json"), "optimise-camera", self)?;
        self.page().write(&folder.join("report.html"))
    }

    /// All cameras as a table: one line each.
    fn front(&self) -> String {
        let mut text =
            "illuminance_lux,columns,rows,distance_um,diameter_um,wedge_share,psnr_linear_db,on_front\n".to_owned();
        for row in &self.tried {
            let on_front = u8::from(self.on_front(row));
            _ = writeln!(
                text,
                "{},{},{},{},{},{},{:.3},{on_front}",
                row.illuminance_lux,
                row.columns,
                row.rows,
                row.distance_um,
                row.diameter_um,
                row.wedge_share,
                row.psnr_linear_db
            );
        }
        text
    }

    /// True if no thinner camera, nor one as thin, promises more in the same light.
    fn on_front(&self, row: &CameraRow) -> bool {
        let same = self.tried.iter().filter(|o| o.illuminance_lux == row.illuminance_lux);
        !same
            .into_iter()
            .any(|o| o.distance_um <= row.distance_um && o.psnr_linear_db > row.psnr_linear_db)
    }

    fn page(&self) -> Page {
        let mut page = Page::new("Whole cameras", &self.design);
        let words = match self.best.first() {
            Some(best) => format!(
                "{} by {} elements of {} um promise {:.2} dB at {} lux.",
                best.columns,
                best.rows,
                exact(best.diameter_um),
                best.psnr_linear_db,
                exact(best.illuminance_lux)
            ),
            None => "No camera was tried to the end.".to_owned(),
        };
        let verdict = match (self.best.is_empty() || !self.readable, self.whole) {
            (true, _) => Verdict::Fail,
            (false, true) => Verdict::Pass,
            (false, false) => Verdict::NotRun,
        };
        page.finding(verdict, if self.whole { "Found:" } else { "So far:" }, words);
        for warning in &self.warnings {
            page.note(warning);
        }
        page.code(&self.command);
        page.note(format!(
            "The PSNR is that of linear light after the joint linear restoration, expected of scenes with the spectrum of photographs, \
             {} degrees and {} pixels from edge to edge: of a model with scalar pupils, one efficiency for all directions and the same pillars everywhere. \
             It serves to compare cameras, and a photograph can be 5 dB below it. `metalith layout` of a design below, then \
             `metalith compare`, take pictures with all physics.",
            exact(self.field_deg),
            self.scene_pixels
        ));
        page.section("Thickness against PSNR");
        let distances = self.tried.iter().map(|r| r.distance_um);
        let [near, far] = distances.fold([f64::MAX, 0.0], |[a, b]: [f64; 2], um| [a.min(um), b.max(um)]);
        // The best camera is often at the largest distance: its mark is not cut by the frame.
        let room = (0.03 * (far - near)).max(0.01 * far);
        let mut chart = Chart::new(
            "Expected PSNR over the distance of the sensor",
            Axis::linear("distance of the sensor", "um").range(near - room, far + room),
            Axis::linear("PSNR of linear light", "dB"),
        );
        for best in &self.best {
            let own = self.tried.iter().filter(|r| r.illuminance_lux == best.illuminance_lux);
            let mut front: Vec<(f64, f64)> = own
                .filter(|r| self.on_front(r))
                .map(|r| (r.distance_um, r.psnr_linear_db))
                .collect();
            front.sort_by(|a, b| a.0.total_cmp(&b.0));
            let lux = exact(best.illuminance_lux);
            let own = self.tried.iter().filter(|r| r.illuminance_lux == best.illuminance_lux);
            chart.points(
                format!("{lux} lux, cameras"),
                own.map(|r| (r.distance_um, r.psnr_linear_db)),
            );
            chart.line(format!("{lux} lux, front"), front);
            chart.points(
                format!("{lux} lux, best after the last descent"),
                [(best.distance_um, best.psnr_linear_db)],
            );
        }
        page.figure(chart.caption(
            "Pareto front: of cameras as thin or thinner, none promises more. Cameras of the front had short descents at fewer wavelengths.",
        ));
        page.section("Best cameras");
        page.table(Self::table(&self.best));
        page.section("Limits");
        page.paragraph(format!(
            "The narrowest pillar has {} nm. The time of writing depends on the process: `metalith handoff` states it.",
            exact(self.narrowest_line_nm)
        ));
        page.section("All cameras");
        page.details("Every camera after its first descents", |page| {
            page.table(Self::table(&self.tried));
        });
        page
    }

    fn table(rows: &[CameraRow]) -> Table {
        let mut table = Table::new([
            Column::text("Design"),
            Column::number("Illuminance", "lux"),
            Column::text("Elements"),
            Column::number("Distance of the sensor", "um"),
            Column::number("Diameter", "um"),
            Column::number("f-number", ""),
            Column::number("Share of the wedge", ""),
            Column::number("PSNR", "dB"),
            Column::number("PSNR of the worst part", "dB"),
            Column::number("Time", "ms"),
            Column::number("Most electrons of white", ""),
            Column::number("Chip along x", "um"),
            Column::number("Chip along y", "um"),
            Column::number("Pillars", "million"),
        ]);
        for row in rows {
            table.row([
                row.file.as_ref().map_or_else(Cell::none, Cell::link),
                Cell::sig(row.illuminance_lux, 4),
                format!("{} x {}", row.columns, row.rows).into(),
                Cell::sig(row.distance_um, 4),
                Cell::sig(row.diameter_um, 4),
                Cell::sig(row.f_number, 3),
                Cell::fixed(row.wedge_share, 2),
                Cell::fixed(row.psnr_linear_db, 2),
                Cell::fixed(row.worst_psnr_linear_db, 2),
                Cell::sig(row.time_ms, 3),
                Cell::sig(row.white_e.iter().copied().fold(0.0, f64::max), 3),
                Cell::sig(row.chip_um[0], 4),
                Cell::sig(row.chip_um[1], 4),
                Cell::sig(row.pillars * 1e-6, 3),
            ]);
        }
        table
    }
}
