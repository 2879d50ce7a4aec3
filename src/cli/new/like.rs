//! A shipped design for another lens, wavelength or material: its text with the values that follow from these.

use std::path::Path;

use metalith::phase::RadialPhase;
use metalith::{Design, Error, NewDesign, Result};

use crate::cli::Terminal;
use crate::cli::section_text::{with_keys, without_section};
use crate::new_design::{Materials, chord_nm};

fn refused(like: &str, what: &str) -> Error {
    Error::refused(
        "new/not-rescaled",
        format!("{like} with other values: {what}"),
        "begin with another design, or without options, and change the file",
    )
}

/// Half of the extent of the elements along an axis (um).
fn extent_um(elements: u32, spacing_um: f64, diameter_um: f64) -> f64 {
    0.5 * (f64::from(elements.saturating_sub(1)) * spacing_um + diameter_um)
}

/// A shipped design to begin with, and what is asked of it.
pub(super) struct Like<'a> {
    pub shipped: &'a str,
    /// The new file, beside which those stand that the design reads.
    pub path: &'a Path,
    pub asked: NewDesign,
}

impl Like<'_> {
    /// True if anything is asked of the design.
    fn changes(&self) -> bool {
        let asked = &self.asked;
        let is_of_lens = asked.diameter_um.is_some() || asked.focal_length_um.is_some();
        let is_of_array = asked.elements.is_some() || asked.steering_deg.is_some();
        asked.changes_pillars() || is_of_lens || is_of_array
    }

    /// The text of the design with what is asked for.
    pub(super) fn rescaled(&self, text: String, terminal: &Terminal) -> Result<String> {
        if !self.changes() {
            return Ok(text);
        }
        let like = Design::parse_without_library(self.path, &text)?;
        let (asked, name) = (&self.asked, self.shipped);
        if !like.array.placed.is_empty() || like.lens.outline.is_some() {
            return Err(refused(name, "its elements are placed or shaped one by one"));
        }
        let old_um = f64::from(like.lens.diameter_nm) * 1e-3;
        let diameter_um = asked.diameter_um.unwrap_or(old_um);
        // A lens of another size has the same aperture.
        let scale = diameter_um / old_um;
        let focal_length_um = asked.focal_length_um.unwrap_or(like.lens.focal_length_um * scale);
        let is_hyperbola = matches!(like.lens.phase, RadialPhase::Hyperbola { .. }) && like.lens.terms.is_empty();
        let is_lens_new = diameter_um != old_um || focal_length_um != like.lens.focal_length_um;
        if !is_hyperbola && (is_lens_new || asked.wavelength_nm.is_some()) {
            return Err(refused(
                name,
                "its phase is no hyperbola, which alone is known for another lens",
            ));
        }
        let mut text = text;
        let mut set = |head: &str, nth: usize, keys: &[(&str, Option<String>)]| {
            let keys: Vec<_> = keys.iter().map(|(key, value)| (*key, value.as_deref())).collect();
            text = with_keys(&text, head, nth, &keys);
        };
        let (x, y) = asked.elements.unwrap_or(like.array.count);
        let steering_deg = asked.steering_deg.unwrap_or(like.array.steering_deg);
        let spacing_um = [
            like.array.spacing_nm,
            like.array.spacing_y_nm.unwrap_or(like.array.spacing_nm),
        ]
        .map(|nm| (nm as f64 * scale).round() * 1e-3);
        if is_lens_new {
            let um = |um: f64| Some(um.to_string());
            set(
                "[lens]",
                0,
                &[
                    ("diameter_um", um(diameter_um)),
                    ("focal_length_um", um(focal_length_um)),
                ],
            );
            let margin_um = like.layout.apertures.margin_nm as f64 * 1e-3;
            set(
                "[apertures]",
                0,
                &[("chord_error_nm", um(chord_nm(diameter_um, margin_um)))],
            );
        }
        set(
            "[array]",
            0,
            &[
                ("elements", Some(format!("[{x}, {y}]"))),
                (
                    "spacing_um",
                    Some(format!("[{:.3}, {:.3}]", spacing_um[0], spacing_um[1])),
                ),
                ("steering_deg", Some(steering_deg.to_string())),
            ],
        );
        // Chip and marks keep their distance from the outermost lenses.
        let old_spacing = [
            like.array.spacing_nm,
            like.array.spacing_y_nm.unwrap_or(like.array.spacing_nm),
        ];
        let further = |axis: usize| {
            let [count, old] = [[x, y][axis], [like.array.count.0, like.array.count.1][axis]];
            let old = extent_um(old, old_spacing[axis] as f64 * 1e-3, old_um);
            (extent_um(count, spacing_um[axis], diameter_um) - old).ceil()
        };
        let by_um = [further(0), further(1)];
        let size = like.layout.chip.size_nm;
        let sides = [size.0, size.1].map(|nm| nm as f64 * 1e-3);
        let side = |axis: usize| sides[axis] + 2.0 * by_um[axis];
        set("[chip]", 0, &[("size_um", Some(format!("[{}, {}]", side(0), side(1))))]);
        for (nth, mark) in like.layout.marks.iter().enumerate() {
            let list = |axis: usize| {
                let place = |&(x, y): &(i64, i64)| {
                    let um = [x, y][axis] as f64 * 1e-3;
                    if um == 0.0 { um } else { um + by_um[axis] * um.signum() }
                };
                Some(format!("{:?}", mark.centres_nm.iter().map(place).collect::<Vec<f64>>()))
            };
            set("[[mark]]", nth, &[("x_um", list(0)), ("y_um", list(1))]);
        }
        if asked.changes_pillars() {
            self.set_pillars(
                &like,
                [diameter_um, focal_length_um],
                steering_deg,
                (x, y),
                &mut set,
                terminal,
            )?;
            // The mapping is solved from the new cell: what the old one was for is no longer said.
            text = without_section(&text, "[mapping.cell]");
            text = text.replace("SiN pillars", "pillars");
        }
        Ok(self.titled(&text, [diameter_um, focal_length_um], (x, y)))
    }

    /// The text with a title for the new lens, without the words for people on the old one.
    fn titled(&self, text: &str, [diameter_um, focal_length_um]: [f64; 2], (x, y): (u32, u32)) -> String {
        let lenses = if (x, y) == (1, 1) {
            "One lens".into()
        } else {
            format!("{x} x {y} lenses")
        };
        let round = |um: f64| (um * 1e3).round() * 1e-3;
        let title = format!(
            "{lenses} of {} um, f = {} um, after {}",
            round(diameter_um),
            round(focal_length_um),
            self.shipped
        );
        let mut head = true;
        let lines = text.lines().filter(|line| {
            head &= line.starts_with('#') || line.is_empty();
            !head
        });
        let titled = |line: &str| match line.split_once('=') {
            Some((key, _)) if key.trim() == "title" => format!("title = \"{title}\"\n"),
            _ => format!("{line}\n"),
        };
        lines.map(titled).collect()
    }

    /// Other pillars, and what follows from another wavelength.
    fn set_pillars(
        &self,
        like: &Design,
        [diameter_um, focal_length_um]: [f64; 2],
        steering_deg: f64,
        elements: (u32, u32),
        set: &mut impl FnMut(&str, usize, &[(&str, Option<String>)]),
        terminal: &Terminal,
    ) -> Result<()> {
        let (asked, cell, name) = (&self.asked, &like.cell, self.shipped);
        if cell.shape.basis().is_some() || !cell.under.is_empty() || !like.mapping.steered.is_empty() {
            return Err(refused(
                name,
                "only squares and circles on their substrate are chosen anew",
            ));
        }
        let focused_um = like.lens.focused_um().unwrap_or(like.mapping.wavelength_um);
        let wavelength_um = asked.wavelength_nm.map_or(focused_um, |nm| nm * 1e-3);
        let is_same = wavelength_um == focused_um;
        let material = |said: &Option<String>, own: &str| said.clone().or_else(|| is_same.then(|| own.to_owned()));
        let film = asked.material.clone().unwrap_or_else(|| cell.pillar_material.clone());
        let substrate = material(&asked.substrate, &cell.substrate_material);
        let materials = Materials::new(Some(&film), substrate.as_deref(), wavelength_um, like.folder())?;
        let (request, chosen) = asked.choose_cell(
            &materials,
            wavelength_um,
            [diameter_um, focal_length_um],
            (elements, steering_deg),
            (cell.shape, cell.lattice),
            terminal,
        )?;
        terminal.clear();
        terminal.say(&chosen.mapping.words());
        let some = |value: &dyn std::fmt::Display| Some(value.to_string());
        let quoted = |text: &str| Some(format!("\"{}\"", text.replace('\\', "/")));
        let is_square = request.shape.is_square();
        set(
            "[cell]",
            0,
            &[
                ("shape", quoted(if is_square { "square" } else { "circle" })),
                (
                    "lattice",
                    quoted(if request.lattice.is_square() {
                        "square"
                    } else {
                        "hexagonal"
                    }),
                ),
                ("pitch_nm", some(&chosen.pitch_nm)),
                (
                    "database_unit_nm",
                    (!chosen.database_unit.is_nanometre()).then(|| chosen.database_unit.to_string()),
                ),
                ("pillar_height_nm", some(&chosen.height_nm)),
                ("width_min_nm", some(&chosen.widths_nm.0)),
                ("width_max_nm", some(&chosen.widths_nm.1)),
                ("width_step_nm", some(&chosen.step_nm)),
                ("pillar_material", quoted(materials.names()[0])),
                ("substrate_material", quoted(materials.names()[1])),
                ("band_nm", materials.band_nm(wavelength_um * 1e3)),
            ],
        );
        let nm = some(&((wavelength_um * 1e6).round() / 1e3));
        set(
            "[mapping]",
            0,
            &[
                ("source", quoted("cells")),
                ("wavelength_nm", nm.clone()),
                ("table", None),
                ("basis", None),
                ("coefficients", None),
                ("accept", None),
                ("band_nm", None),
                ("compared_nm", None),
            ],
        );
        set("[verify]", 0, &[("fidelity", quoted("rigorous"))]);
        if !is_same {
            set("[phase]", 0, &[("wavelength_nm", nm.clone())]);
            set("[array]", 0, &[("wedge_wavelength_nm", nm.clone())]);
            let list = nm.map(|nm| format!("[{nm}]"));
            set("[verify]", 0, &[("wavelengths_nm", list), ("camera", None)]);
        }
        Ok(())
    }
}
