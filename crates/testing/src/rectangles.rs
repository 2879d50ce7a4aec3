//! Small lenses of rectangles that are drawn wider, higher or in other light: what chips as fabricated are compared
//! with.

use std::fs;
use std::path::{Path, PathBuf};

use crate::design;

/// Edges that the upright pillars of the small lens may have: every so many of the shipped library.
const EVERY_NM: u32 = 30;

/// A small lens, whose design is a text.
#[derive(Clone, Debug)]
pub struct Small {
    /// True for upright rectangles; false for rotated ones.
    is_upright: bool,
    bias_nm: i32,
    height_nm: i32,
    /// The value of `polarisation`, and other keys of `[verify]` after it.
    light: String,
}

/// Design of upright rectangles, whose light along x and along y goes to two places.
pub fn upright() -> Small {
    Small {
        is_upright: true,
        bias_nm: 0,
        height_nm: 600,
        light: "\"x\"".into(),
    }
}

/// Design of rotated rectangles.
pub fn rotated() -> Small {
    Small {
        is_upright: false,
        light: "\"left\"".into(),
        ..upright()
    }
}

impl Small {
    /// This design in this light: the value of `polarisation` of `[verify]`, and more keys.
    #[must_use]
    pub fn in_light(mut self, light: &str) -> Self {
        light.clone_into(&mut self.light);
        self
    }

    /// This design with both edges of all pillars wider, and all higher (nm).
    #[must_use]
    pub fn changed(&self, wider_nm: i32, higher_nm: i32) -> Self {
        Self {
            bias_nm: self.bias_nm + wider_nm,
            height_nm: self.height_nm + higher_nm,
            ..self.clone()
        }
    }

    /// Length by which both edges of all pillars are wider (nm). Designs of upright rectangles do not say it: the same
    /// pillars of their library have other edges.
    pub fn wider_nm(&self) -> i32 {
        self.bias_nm
    }

    /// Write the design, and its library, into a folder: where the design is.
    ///
    /// # Panics
    /// If it cannot be written.
    pub fn write(&self, folder: &Path) -> PathBuf {
        if self.is_upright {
            fs::write(folder.join("library.csv"), Self::library()).expect("a folder for tests");
        }
        let path = folder.join("design.toml");
        fs::write(&path, self.text()).expect("a folder for tests");
        path
    }

    /// The design.
    ///
    /// # Panics
    /// If the shipped design has other values than are changed here.
    pub fn text(&self) -> String {
        let name = if self.is_upright {
            "birefringent_532"
        } else {
            "geometric_phase_532"
        };
        let text = fs::read_to_string(design(name)).expect("a shipped design");
        let wider = |drawn_nm: i32| drawn_nm + self.bias_nm;
        let mut changes = vec![
            (
                "pillar_height_nm = 600",
                format!("pillar_height_nm = {}", self.height_nm),
            ),
            ("diameter_um = 80", "diameter_um = 20".into()),
            (
                "window_samples = 96",
                format!("window_samples = 32\npolarisation = {}", self.light),
            ),
        ];
        if self.is_upright {
            changes.extend([
                ("width_max_nm = 280", "width_max_nm = 270".into()),
                ("width_step_nm = 10", format!("width_step_nm = {EVERY_NM}")),
                ("focal_length_um = 120", "focal_length_um = 30".into()),
                ("centre_um = [8, 0]", "centre_um = [2, 0]".into()),
                ("centre_um = [-8, 0]", "centre_um = [-2, 0]".into()),
                ("phases/birefringent_532.csv", "library.csv".into()),
                ("field_x_deg = [0, 3]", "field_x_deg = [0]".into()),
            ]);
        } else {
            changes.extend([
                ("pillar_width_nm = 100", format!("pillar_width_nm = {}", wider(100))),
                ("pillar_length_nm = 250", format!("pillar_length_nm = {}", wider(250))),
                ("focal_length_um = 80", "focal_length_um = 20".into()),
                // Beside no resonance, where pillars a little wider are another cell.
                ("wavelengths_nm = [532]", "wavelengths_nm = [526]".into()),
                ("field_x_deg = [0, 5]", "field_x_deg = [0]".into()),
            ]);
        }
        changes.push(("field_y_deg = [0, 0]", "field_y_deg = [0]".into()));
        crate::replaced(&crate::accepting(&text), &changes)
    }

    /// The shipped library with every third length of edges alone.
    fn library() -> String {
        let text = fs::read_to_string(design("birefringent_532").with_file_name("phases/birefringent_532.csv"));
        let text = text.expect("a shipped library");
        let kept = text.lines().filter_map(|line| {
            if !line.starts_with(|c: char| c.is_ascii_digit()) {
                return Some(format!("{line}\n"));
            }
            let mut cells = line.split(',');
            let mut edge = || -> Option<u32> { cells.next()?.parse().ok() };
            let edges = [edge()?, edge()?];
            let is_kept = edges.iter().all(|nm| (nm - 90).is_multiple_of(EVERY_NM));
            is_kept.then(|| format!("{line}\n"))
        });
        kept.collect()
    }
}
