//! `[layout]`, `[layers]`, `[apertures]`, `[chip]`, `[[mark]]`: how the design is written to files.

use chrono::NaiveDateTime;
use serde::Serialize;

use super::array::whole_nm;
use super::{ArraySpec, Element, LensSpec};
use metalith_core::LayerNumber;
use metalith_core::document::{Limits, Section};
use metalith_core::text::quoted;

/// Hierarchy: nesting of the geometry in the file. All three hold the same geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Hierarchy {
    /// The smallest part that symmetry leaves unique, referenced with mirrors and rotations.
    Folded,
    /// One reference for each pillar to a cell for each width.
    Sref,
    /// One square for each pillar, all in the top cell.
    Flat,
}

/// A GDSII layer, and what it is for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LayoutLayer {
    pub layer: i16,
    pub datatype: i16,
    /// Purpose for people: shown in the viewer and in the hand-off.
    pub purpose: String,
}

impl LayoutLayer {
    /// Number as readers of layouts know it.
    pub fn number(&self) -> LayerNumber {
        // Both are 0 to 255, checked when the design was read.
        LayerNumber::new(self.layer as u16, self.datatype as u16)
    }
}

/// The layers of both files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Layers {
    /// Pillars: exposed in the first step.
    pub pillars: LayoutLayer,
    /// Openings of the metal: exposed in the second step.
    pub apertures: LayoutLayer,
    /// Marks written with the pillars.
    pub pillar_marks: LayoutLayer,
    /// Marks written with the apertures.
    pub aperture_marks: LayoutLayer,
    /// Outline of the chip; not exposed.
    pub outline: LayoutLayer,
    /// Text for people; not exposed.
    pub label: LayoutLayer,
}

/// Circular openings in the metal, one round each lens.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ApertureSpec {
    /// Distance from the rim of the lens to the metal (nm).
    pub margin_nm: i64,
    /// Largest distance between a circle and its polygon (nm).
    pub chord_error_nm: f64,
    /// Most vertices of a polygon, the closing one counted.
    pub max_vertices: usize,
}

/// The piece of glass.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChipSpec {
    /// Edges along x and y (nm); the centre element is in its middle.
    pub size_nm: (i64, i64),
}

/// A set of equal crosses for alignment, in both steps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MarkSpec {
    /// Purpose of the set, such as "global".
    pub name: String,
    /// Length of an arm from tip to tip (nm).
    pub length_nm: i64,
    /// Width of an arm (nm).
    pub width_nm: i64,
    /// Centres on the chip (nm).
    pub centres_nm: Vec<(i64, i64)>,
}

/// Everything about the files that is not the pillars themselves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayoutSpec {
    pub hierarchy: Hierarchy,
    /// Largest distance between a round pillar and its polygon (nm), if the design says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub circle_chord_error_nm: Option<f64>,
    /// The date in the headers of the file. One fixed date, so that equal designs give equal bytes.
    pub timestamp: NaiveTimestamp,
    pub layers: Layers,
    pub apertures: ApertureSpec,
    pub chip: ChipSpec,
    pub marks: Vec<MarkSpec>,
}

/// `YYYY-MM-DDThh:mm:ss`.
pub(crate) type NaiveTimestamp = String;

/// A valid date for every reader of the format, and not "now".
const FIXED_TIMESTAMP: &str = "2000-01-01T00:00:00";

impl LayoutSpec {
    pub fn read(root: &Section<'_, '_>, lens: &LensSpec, array: &ArraySpec) -> Self {
        let layout = root.optional_section("layout");
        let (mut hierarchy, mut timestamp) = (Hierarchy::Folded, FIXED_TIMESTAMP.to_owned());
        let mut circle_chord_error_nm = None;
        if let Some(s) = &layout {
            let choices = [
                ("folded", Hierarchy::Folded),
                ("sref", Hierarchy::Sref),
                ("flat", Hierarchy::Flat),
            ];
            hierarchy = s.choice("hierarchy", &choices, Some(Hierarchy::Folded));
            if let Some(text) = s.optional_text("timestamp") {
                if text.parse::<NaiveDateTime>().is_err() {
                    s.fault(
                        "timestamp",
                        format!("\"{}\" is not a date and time", quoted(&text)),
                        "write it as \"2026-01-31T12:00:00\"",
                    );
                }
                timestamp = text;
            }
            circle_chord_error_nm = s.optional_float("circle_chord_error_nm", Limits::new(0.1..=1000.0, "nm"));
            s.finish();
        }
        let layers = Layers::read(&root.section("layers"));
        let apertures = ApertureSpec::read(&root.section("apertures"), lens, array);
        let chip = ChipSpec::read(&root.section("chip"), lens, array, &apertures);
        let marks = root.sections("mark");
        let marks = marks.iter().map(|s| {
            let mark = MarkSpec::read(s, &chip);
            mark.check_elements(s, lens, array, &apertures);
            mark
        });
        let marks = marks.collect();
        Self {
            hierarchy,
            circle_chord_error_nm,
            timestamp,
            layers,
            apertures,
            chip,
            marks,
        }
    }
}

impl Layers {
    /// All layers with their key in the design file, in the order of both steps.
    pub fn all(&self) -> [(&'static str, &LayoutLayer); 6] {
        [
            ("pillars", &self.pillars),
            ("pillar_marks", &self.pillar_marks),
            ("apertures", &self.apertures),
            ("aperture_marks", &self.aperture_marks),
            ("outline", &self.outline),
            ("label", &self.label),
        ]
    }

    fn read(s: &Section<'_, '_>) -> Self {
        let one = |key: &str| {
            let layer = s.section(key);
            let read = LayoutLayer {
                layer: layer.integer("layer", 0..=255, "") as i16,
                datatype: layer.integer("datatype", 0..=255, "") as i16,
                purpose: layer.text("purpose"),
            };
            layer.finish();
            read
        };
        let layers = Self {
            pillars: one("pillars"),
            apertures: one("apertures"),
            pillar_marks: one("pillar_marks"),
            aperture_marks: one("aperture_marks"),
            outline: one("outline"),
            label: one("label"),
        };
        let all = layers.all();
        for (k, (key, layer)) in all.iter().enumerate() {
            let number = |l: &LayoutLayer| (l.layer, l.datatype);
            if let Some((other, _)) = all[..k].iter().find(|(_, l)| number(l) == number(layer))
                && s.has(key)
                && s.has(other)
            {
                let numbers =
                    [*key, *other].map(|layer| [format!("layers.{layer}.layer"), format!("layers.{layer}.datatype")]);
                s.fault_given(
                    &numbers.iter().flatten().map(String::as_str).collect::<Vec<_>>(),
                    key,
                    format!(
                        "`{key}` is on the layer of `{other}`, {}/{}",
                        layer.layer, layer.datatype
                    ),
                    "give each purpose a layer or datatype of its own",
                );
            }
        }
        s.finish();
        layers
    }
}

impl ApertureSpec {
    fn read(s: &Section<'_, '_>, lens: &LensSpec, array: &ArraySpec) -> Self {
        let spec = Self {
            margin_nm: whole_nm(s, "margin_um", s.float("margin_um", Limits::new(0.2..=1000.0, "um"))),
            chord_error_nm: s.float("chord_error_nm", Limits::new(0.5..=10_000.0, "nm")),
            max_vertices: s.integer_or("max_vertices", 16..=8191, "vertices", 200) as usize,
        };
        let round = array.lenses(lens).filter(|lens| lens.outline.is_none());
        let largest_nm = round.map(|lens| lens.diameter_nm).max().unwrap_or(0);
        let radius_nm = f64::from(largest_nm) / 2.0 + spec.margin_nm as f64;
        if spec.vertices(radius_nm) + 1 > spec.max_vertices {
            s.fault_given(
                &["lens.diameter_um", "apertures.margin_um", "apertures.max_vertices"],
                "chord_error_nm",
                format!(
                    "this takes {} vertices, `max_vertices` is {}",
                    spec.vertices(radius_nm) + 1,
                    spec.max_vertices
                ),
                format!(
                    "allow at least {:.1} nm, or more vertices (readers of old take 200, the format 8191)",
                    spec.error_nm(radius_nm)
                ),
            );
        }
        for outline in array.lenses(lens).filter_map(|lens| lens.outline.as_ref()) {
            if !outline.grows(spec.margin_nm) {
                s.fault_given(
                    &["lens.aperture_um", "lens.corners_x_um"],
                    "margin_um",
                    "the opening about an aperture meets itself: a notch of the aperture is narrower than two margins",
                    "use a smaller margin or a wider notch",
                );
            }
            let corners = outline.corners_nm().len() + 1;
            if corners > spec.max_vertices {
                s.fault_given(
                    &["apertures.max_vertices"],
                    "max_vertices",
                    format!("an aperture has {corners} vertices, the closing one counted"),
                    "allow as many, or use fewer corners",
                );
            }
        }
        s.finish();
        spec
    }

    /// Corners of the polygon round a circle of this radius, so that it keeps to the chord error: a
    /// multiple of eight, so that it has the symmetries of the square.
    pub fn vertices(&self, radius_nm: f64) -> usize {
        let half_angle = (radius_nm / (radius_nm + self.chord_error_nm)).acos();
        ((std::f64::consts::PI / half_angle / 8.0).ceil() as usize).max(2) * 8
    }

    /// Farthest place of the opening about an element from its middle, along x and along y (nm).
    fn reach_nm(&self, array: &ArraySpec, shared: &LensSpec, element: &Element) -> [i64; 2] {
        let lens = array.lens_of(shared, element.index);
        match &lens.outline {
            Some(outline) => {
                let corners = outline.rotated(array.rotation_deg(element.index)).grown(self.margin_nm);
                corners.iter().fold([0, 0], |[x, y], corner| {
                    [x.max(corner.0.saturating_abs()), y.max(corner.1.saturating_abs())]
                })
            }
            None => {
                // The polygon about the circle touches it at both axes.
                [i64::from(lens.diameter_nm.div_ceil(2)) + self.margin_nm; 2]
            }
        }
    }

    /// Chord error that the most vertices allowed reach (nm).
    fn error_nm(&self, radius_nm: f64) -> f64 {
        let corners = ((self.max_vertices - 1) / 8 * 8).max(8) as f64;
        radius_nm * (1.0 / (std::f64::consts::PI / corners).cos() - 1.0)
    }
}

impl ChipSpec {
    fn read(s: &Section<'_, '_>, lens: &LensSpec, array: &ArraySpec, apertures: &ApertureSpec) -> Self {
        let size_um = s.array::<2>("size_um", Limits::new(10.0..=300_000.0, "um"));
        let size_nm = (whole_nm(s, "size_um", size_um[0]), whole_nm(s, "size_um", size_um[1]));
        let (mut x, mut y) = (0, 0);
        for element in array.elements() {
            let [reach_x, reach_y] = apertures.reach_nm(array, lens, &element);
            // An outline with a fault may reach anywhere.
            let twice = |centre: i64, reach: i64| centre.saturating_abs().saturating_add(reach).saturating_mul(2);
            x = x.max(twice(element.centre_nm.0, reach_x));
            y = y.max(twice(element.centre_nm.1, reach_y));
        }
        if s.has("size_um") && (size_nm.0 < x || size_nm.1 < y) {
            // A quotient prints as a short number, a product with a thousandth does not.
            let um = |nm: i64| nm as f64 / 1e3;
            s.fault_given(
                &[
                    "lens.diameter_um",
                    "array.elements",
                    "array.spacing_um",
                    "apertures.margin_um",
                    "apertures.chord_error_nm",
                    "apertures.max_vertices",
                ],
                "size_um",
                format!(
                    "the apertures reach over {} by {} um, the chip over {} by {} um",
                    um(x),
                    um(y),
                    um(size_nm.0),
                    um(size_nm.1)
                ),
                format!("use at least {} by {} um", um(x), um(y)),
            );
        }
        s.finish();
        Self { size_nm }
    }
}

impl MarkSpec {
    /// A cross over an opening would be written over its pillars.
    fn check_elements(&self, s: &Section<'_, '_>, lens: &LensSpec, array: &ArraySpec, apertures: &ApertureSpec) {
        let half = [self.length_nm / 2, self.width_nm / 2];
        let meets = |element: &Element, at: (i64, i64)| {
            let reach = apertures.reach_nm(array, lens, element);
            let is_round = array.lens_of(lens, element.index).outline.is_none();
            [half, [half[1], half[0]]].into_iter().any(|[x, y]| {
                // From the middle of the element to the nearest place of the arm.
                let beside = |middle: i64, arm: i64, half: i64| {
                    (middle.saturating_sub(arm).saturating_abs() - half).max(0) as f64
                };
                let off = [
                    beside(element.centre_nm.0, at.0, x),
                    beside(element.centre_nm.1, at.1, y),
                ];
                if is_round {
                    off[0].hypot(off[1]) < reach[0] as f64
                } else {
                    off[0] < reach[0] as f64 && off[1] < reach[1] as f64
                }
            })
        };
        let elements = array.elements();
        let met = self
            .centres_nm
            .iter()
            .find_map(|&at| Some((at, elements.iter().find(|e| meets(e, at))?)));
        if let Some(((x, y), element)) = met {
            s.fault_given(
                &[
                    "lens.diameter_um",
                    "array.elements",
                    "array.spacing_um",
                    "apertures.margin_um",
                    "mark.y_um",
                    "mark.length_um",
                    "mark.width_um",
                ],
                "x_um",
                format!(
                    "the cross at ({}, {}) um of the set \"{}\" is over the opening of element {}",
                    x as f64 * 1e-3,
                    y as f64 * 1e-3,
                    self.name,
                    element.label()
                ),
                "move it away from the elements",
            );
        }
    }

    fn read(s: &Section<'_, '_>, chip: &ChipSpec) -> Self {
        let xs = s.floats("x_um", PLACE);
        let ys = s.floats("y_um", PLACE);
        if xs.len() != ys.len() || xs.is_empty() {
            s.fault_given(
                &["mark.x_um"],
                "y_um",
                format!("{} places along x, {} along y", xs.len(), ys.len()),
                "give one entry of `x_um` and one of `y_um` for each cross",
            );
        }
        let spec = Self {
            name: s.text("name"),
            length_nm: whole_nm(s, "length_um", s.float("length_um", Limits::new(0.1..=10_000.0, "um"))),
            width_nm: whole_nm(s, "width_um", s.float("width_um", Limits::new(0.01..=1_000.0, "um"))),
            centres_nm: xs
                .iter()
                .zip(&ys)
                .map(|(&x, &y)| (whole_nm(s, "x_um", x), whole_nm(s, "y_um", y)))
                .collect(),
        };
        if spec.length_nm % 2 != 0 || spec.width_nm % 2 != 0 || spec.width_nm >= spec.length_nm {
            s.fault_given(
                &["mark.length_um"],
                "width_um",
                "the arms of the cross are not centred or wider than long",
                "use even numbers of nanometres, the width below the length",
            );
        }
        let reach = spec.length_nm / 2;
        if spec
            .centres_nm
            .iter()
            .any(|c| c.0.abs() + reach > chip.size_nm.0 / 2 || c.1.abs() + reach > chip.size_nm.1 / 2)
        {
            s.fault_given(
                &["chip.size_um", "mark.y_um", "mark.length_um"],
                "x_um",
                format!("a cross of the set \"{}\" reaches beyond the chip", spec.name),
                "move it inwards or enlarge [chip]",
            );
        }
        s.finish();
        spec
    }
}

const PLACE: Limits = Limits {
    range: -150_000.0..=150_000.0,
    unit: "um",
};
