//! `[cell]`: the pillar and what surrounds it.

use serde::Serialize;

use super::lens::WAVELENGTH;
use metalith_cell::{FocusedLight, Handedness, InversePolynomial, Polarisation, PolarisationAxis};
use metalith_core::document::{Limits, Section};
use metalith_pillars::{
    DatabaseUnit, Lattice, LatticeKind, PillarId, PillarShape, Pitch, PolarisationBasis, RotatedRectangles,
    UprightRectangles,
};
use metalith_rcwa::Material;

/// The unit cell: a pillar on a lattice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellSpec {
    /// Distance of neighbouring pillars (nm).
    pub pitch_nm: Pitch,
    /// Grid of both files: places and edges are multiples of it.
    #[serde(rename = "database_unit_nm", skip_serializing_if = "DatabaseUnit::is_nanometre")]
    pub database_unit: DatabaseUnit,
    /// Lattice of the pillars; on a hexagonal one they are circles.
    #[serde(skip_serializing_if = "LatticeKind::is_square")]
    pub lattice: LatticeKind,
    /// Cross-section of the pillars.
    #[serde(skip_serializing_if = "PillarShape::is_square")]
    pub shape: PillarShape,
    /// Circular polarisation of the light that is focused, where the pillars are rotated rectangles: its phase is twice their
    /// rotation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arriving: Option<Handedness>,
    /// Height of the pillars (nm).
    pub pillar_height_nm: f64,
    /// Narrowest and widest pillar that may be written (nm), both multiples of the step; of rectangles the first and the last
    /// number.
    pub width_range_nm: (u16, u16),
    /// Widths are multiples of this (nm), even where the database unit is 1 nm, so that edges of centred squares are on the
    /// grid; 1 of rectangles.
    pub width_step_nm: u16,
    /// Name of the pillar's material, or path of a CSV table of n and k.
    pub pillar_material: String,
    /// Name of the substrate's material, or path of a CSV table of n and k.
    pub substrate_material: String,
    /// Refractive index between the pillars and towards the sensor.
    pub ambient_index: f64,
    /// Material there, over [`CellSpec::ambient_index`]: a name or the path of a CSV table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambient_material: Option<String>,
    /// Layers between substrate and pillars, from the substrate upwards.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub under: Vec<UnderSpec>,
    /// Wavelengths that the cell is tabulated over (um), if the design says so. Decides nothing of the layout.
    #[serde(skip)]
    pub band_um: Option<(f64, f64)>,
}

/// A layer without structure under the pillars.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnderSpec {
    /// Name of its material, or path of a CSV table of n and k.
    pub material: String,
    /// Thickness (nm).
    pub height_nm: f64,
}

/// Longest pitch (nm): that of pillars for the thermal infrared.
const WIDEST_PITCH_NM: u32 = 20_000;

/// Materials of a design that names none.
const DEFAULT_FILM: &str = "sin_luke_2015";
const DEFAULT_SUBSTRATE: &str = "fused_silica_malitson_1965";

/// Tallest pillar and thickest layer (nm).
pub const TALLEST_NM: f64 = 50_000.0;

impl CellSpec {
    pub(crate) fn read(s: &Section<'_, '_>) -> Self {
        let unit = read_unit(s);
        let lattice = s.choice("lattice", &LatticeKind::CHOICES, Some(LatticeKind::Square));
        let pitch_nm = read_pitch(s, lattice, unit);
        // A pitch with a fault bounds nothing.
        let widest = if s.sound(&["cell.pitch_nm"]) {
            lattice.widest_nm(pitch_nm, unit)
        } else {
            WIDEST_PITCH_NM
        };
        let kinds = [
            ("square", Kind::Square),
            ("circle", Kind::Circle),
            ("rectangle", Kind::Rectangle),
            ("upright_rectangle", Kind::Upright),
        ];
        let (shape, width_range_nm, width_step_nm) = match s.choice("shape", &kinds, Some(Kind::Square)) {
            Kind::Square => with_widths(s, PillarShape::Square, widest, unit),
            Kind::Circle => with_widths(s, PillarShape::Circle, widest, unit),
            Kind::Rectangle => {
                let pillars = read_rectangles(s, widest);
                (pillars.into(), (1, pillars.steps), 1)
            }
            Kind::Upright => {
                let pillars = read_upright(s, widest);
                (pillars.into(), (1, pillars.count()), 1)
            }
        };
        if let Some(what) = lattice.refusal(shape) {
            s.fault_given(
                &["cell.shape"],
                "lattice",
                what,
                "add `shape = \"circle\"`, or use the square lattice",
            );
        }
        let arriving = (shape.basis() == Some(PolarisationBasis::Circular))
            .then(|| s.choice("arriving", &Handedness::CHOICES, Some(Handedness::default())));
        let pillar_material = read_material(s, "pillar_material").unwrap_or_else(|| DEFAULT_FILM.into());
        let ambient_material = read_material(s, "ambient_material");
        if ambient_material.is_some() && s.has("ambient_index") {
            s.fault(
                "ambient_index",
                "an index beside the material that stands in for it",
                "leave out `ambient_index` or `ambient_material`",
            );
        }
        let cell = Self {
            pitch_nm,
            database_unit: unit,
            lattice,
            shape,
            arriving,
            pillar_height_nm: s.float("pillar_height_nm", Limits::new(10.0..=TALLEST_NM, "nm")),
            width_range_nm,
            width_step_nm,
            under: read_under(s, &pillar_material),
            band_um: read_band(s),
            pillar_material,
            substrate_material: read_material(s, "substrate_material").unwrap_or_else(|| DEFAULT_SUBSTRATE.into()),
            ambient_index: s.float_or("ambient_index", Limits::new(1.0..=3.0, ""), 1.0),
            ambient_material,
        };
        s.finish();
        cell
    }

    /// True if it is the cell of the paper: square pillars of silicon nitride, 700 nm high on a pitch of 350 nm, on
    /// glass, in air. Published polynomials, and errors that were measured against truth data, hold for this cell.
    pub fn is_of_the_paper(&self) -> bool {
        self.shape.is_square()
            && self.lattice.is_square()
            && self.pitch_nm == Pitch::whole(350)
            && self.pillar_height_nm == 700.0
            && self.pillar_material == DEFAULT_FILM
            && self.substrate_material == DEFAULT_SUBSTRATE
            && self.ambient_index == 1.0
            && self.ambient_material.is_none()
            && self.under.is_empty()
    }

    /// True if it is another cell than the paper's, as far as the keys of its section have no fault: what is published
    /// does not hold for it.
    pub(crate) fn is_known_to_be_another(&self, s: &Section<'_, '_>) -> bool {
        let keys = [
            "cell.pitch_nm",
            "cell.lattice",
            "cell.shape",
            "cell.pillar_height_nm",
            "cell.width_min_nm",
            "cell.width_max_nm",
            "cell.pillar_material",
            "cell.substrate_material",
            "cell.ambient_index",
            "cell.ambient_material",
            "cell.spacer_nm",
            "cell.residual_nm",
        ];
        !self.is_of_the_paper() && s.sound(&keys)
    }

    /// True if a mapping asks only for widths that may be written, to within half a step.
    pub fn fits(&self, mapping: &InversePolynomial) -> bool {
        let (low, high) = mapping.range();
        let pitch = f64::from(self.pitch_nm);
        let (narrow, wide) = self.width_range_nm;
        let half_step = f64::from(self.width_step_nm) / 2.0;
        low * pitch >= f64::from(narrow) - half_step && high * pitch <= f64::from(wide) + half_step
    }

    /// The largest width (nm) or number that a pillar can have: no width is beyond the pitch.
    pub fn most(&self) -> u16 {
        let last = self.shape.last().map(|PillarId(number)| number);
        last.unwrap_or_else(|| self.lattice.widest_nm(self.pitch_nm, self.database_unit) as u16)
    }

    /// The smallest lattice of this cell that covers a disc of this diameter.
    ///
    /// # Errors
    /// As [`Lattice::covering_on_grid`].
    pub fn lattice_covering(&self, diameter_nm: u32) -> metalith_core::Result<Lattice> {
        Lattice::covering_on_grid(self.lattice, diameter_nm, self.pitch_nm, self.database_unit)
    }

    /// The light that pillars give the phase of the design where they distinguish polarisations, in the light that it
    /// is verified in: of upright rectangles that along the nearer axis.
    pub fn focused(&self, verified: Option<Polarisation>) -> Option<FocusedLight> {
        let axis = || verified.map_or(PolarisationAxis::X, PolarisationAxis::nearest);
        match self.arriving {
            Some(hand) => Some(FocusedLight::Circular(hand)),
            None => (self.shape.basis() == Some(PolarisationBasis::Linear)).then(|| FocusedLight::Linear(axis())),
        }
    }

    /// All widths that may be written (nm), narrowest first; of rectangles all numbers.
    pub fn widths_nm(&self) -> impl Iterator<Item = u16> + use<> {
        (self.width_range_nm.0..=self.width_range_nm.1).step_by(usize::from(self.width_step_nm))
    }
}

/// The shapes as the key has them.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Square,
    Circle,
    Rectangle,
    Upright,
}

/// The database unit.
fn read_unit(s: &Section<'_, '_>) -> DatabaseUnit {
    let Some(nm) = s.optional_float("database_unit_nm", Limits::new(0.1..=1.0, "nm")) else {
        return DatabaseUnit::default();
    };
    DatabaseUnit::of_nm(nm).unwrap_or_else(|| {
        s.fault(
            "database_unit_nm",
            format!("a database unit of {nm} nm"),
            "use 1, 0.5, 0.25 or 0.1",
        );
        DatabaseUnit::default()
    })
}

/// The pitch: on a hexagonal lattice a multiple of the database unit.
fn read_pitch(s: &Section<'_, '_>, lattice: LatticeKind, unit: DatabaseUnit) -> Pitch {
    let nm = s.float("pitch_nm", Limits::new(100.0..=f64::from(WIDEST_PITCH_NM), "nm"));
    let Some(pitch) = Pitch::of_nm(nm) else {
        let nearest = (nm * 20.0).round() / 20.0;
        s.fault(
            "pitch_nm",
            format!("a pitch of {nm} nm is no multiple of 0.05 nm"),
            format!("use {nearest}"),
        );
        return Pitch::whole(nm as u32);
    };
    if lattice == LatticeKind::Hexagonal && !unit.divides(pitch) {
        let finer = DatabaseUnit::of_pitch(pitch).map_or_else(
            || format!("use a pitch of {nm:.1} nm with `database_unit_nm = 0.1`"),
            |finer| format!("add `database_unit_nm = {finer}`, or use a multiple of {unit} nm"),
        );
        s.fault_given(
            &["cell.database_unit_nm"],
            "pitch_nm",
            format!("a hexagonal lattice with a pitch of {nm} nm on a grid of {unit} nm"),
            finer,
        );
    }
    pitch
}

/// A shape with its narrowest and widest pillar and the step between widths (nm). Edges of centred pillars of an odd width are
/// on the grid of half a nanometre and finer ones.
fn with_widths(
    s: &Section<'_, '_>,
    shape: PillarShape,
    widest: u32,
    unit: DatabaseUnit,
) -> (PillarShape, (u16, u16), u16) {
    let even = unit.is_nanometre();
    let least = if even { 2 } else { 1 };
    let step = s.integer_or("width_step_nm", least..=100, "nm", 2) as u16;
    if even && !step.is_multiple_of(2) {
        s.fault(
            "width_step_nm",
            format!("a width step of {step} nm is odd"),
            "use an even number, so that all edges are on the 1 nm grid, or add `database_unit_nm = 0.5`",
        );
    }
    let low = s.integer("width_min_nm", 10..=i64::from(widest), "nm") as u16;
    let high = s.integer("width_max_nm", 10..=i64::from(widest), "nm") as u16;
    for (key, width) in [("width_min_nm", low), ("width_max_nm", high)] {
        if step > 0 && width % step != 0 {
            s.fault_given(
                &["cell.width_step_nm"],
                key,
                format!("{width} nm is not a multiple of the width step"),
                format!("use a multiple of {step} nm"),
            );
        }
    }
    if low > high {
        s.fault_given(
            &["cell.width_min_nm"],
            "width_max_nm",
            "the widest pillar is narrower than the narrowest",
            "exchange the two",
        );
    }
    (shape, (low, high), step)
}

/// Most rotations in half a turn.
const MOST_STEPS: f64 = 1800.0;

/// Rounding of half a turn over a step.
const WHOLE: f64 = 1e-6;

/// Upright rectangles: the lengths that both edges may have.
fn read_upright(s: &Section<'_, '_>, widest: u32) -> UprightRectangles {
    // Upright rectangles are numbered by even lengths.
    let (_, (shortest_nm, longest_nm), step_nm) = with_widths(s, PillarShape::Square, widest, DatabaseUnit::default());
    let step_nm = step_nm.max(2);
    let lengths = longest_nm.saturating_sub(shortest_nm) / step_nm + 1;
    let most = UprightRectangles::MOST_LENGTHS;
    if lengths > most {
        s.fault_given(
            &["cell.width_min_nm", "cell.width_max_nm"],
            "width_step_nm",
            format!("edges of {lengths} lengths, at most {most}"),
            "use larger steps: pillars are chosen by both edges, of which there are as many pairs as the square of the lengths",
        );
    }
    UprightRectangles {
        shortest_nm,
        step_nm,
        lengths: lengths.min(most),
    }
}

/// Rectangles: one size, and the step of their rotation.
fn read_rectangles(s: &Section<'_, '_>, widest: u32) -> RotatedRectangles {
    let width_nm = s.integer("pillar_width_nm", 10..=i64::from(widest), "nm") as u16;
    let length_nm = s.integer("pillar_length_nm", 10..=i64::from(widest), "nm") as u16;
    for (key, edge) in [("pillar_width_nm", width_nm), ("pillar_length_nm", length_nm)] {
        if !edge.is_multiple_of(2) {
            s.fault(
                key,
                format!("an edge of {edge} nm is odd"),
                "use an even number, so that the corners of an upright pillar are on the 1 nm grid",
            );
        }
    }
    if width_nm >= length_nm {
        s.fault_given(
            &["cell.pillar_width_nm"],
            "pillar_length_nm",
            format!("{length_nm} nm is not longer than the width of {width_nm} nm"),
            "give the shorter edge as the width: a square has no geometric phase",
        );
    }
    let diagonal_nm = f64::from(width_nm).hypot(f64::from(length_nm));
    if diagonal_nm > f64::from(widest) {
        s.fault_given(
            &["cell.pitch_nm", "cell.pillar_width_nm"],
            "pillar_length_nm",
            format!("a pillar with a diagonal of {diagonal_nm:.0} nm reaches beyond its cell where it is rotated"),
            format!("use shorter edges or a wider pitch: the diagonal is to be at most {widest} nm"),
        );
    }
    let step_deg = s.float_or(
        "rotation_step_deg",
        Limits::new(180.0 / MOST_STEPS..=15.0, "degrees"),
        1.0,
    );
    let steps = (180.0 / step_deg).round().clamp(1.0, MOST_STEPS);
    if (steps * step_deg - 180.0).abs() > WHOLE || steps % 2.0 != 0.0 {
        s.fault(
            "rotation_step_deg",
            format!("a quarter turn is no whole number of steps of {step_deg} degrees"),
            "use a step such as 1, 0.5 or 2 degrees",
        );
    }
    // Corners are half the diagonal of the grid off at most, to either side at the two ends of an edge.
    let told_nm = 2.0 * std::f64::consts::SQRT_2;
    let finest_deg = (told_nm / f64::from(length_nm.max(1))).to_degrees();
    if step_deg < finest_deg {
        s.fault_given(
            &["cell.pillar_length_nm", "cell.pillar_width_nm"],
            "rotation_step_deg",
            format!("corners on the grid of 1 nm do not tell rotations of {step_deg} degrees of a pillar {length_nm} nm long"),
            format!("use a step of {:.1} degrees or more that divides 90", (finest_deg * 10.0).ceil() / 10.0),
        );
    }
    RotatedRectangles {
        width_nm: width_nm & !1,
        length_nm: length_nm & !1,
        steps: steps as u16,
    }
}

/// The material at a key, if it is there; a table is read, so that a mistake of it is one of the key.
fn read_material(s: &Section<'_, '_>, key: &str) -> Option<String> {
    let text = s.optional_text(key)?;
    if Material::is_table(&text) {
        s.contents(key, Material::read_file);
        return Some(text);
    }
    match Material::named(&text) {
        Ok(material) => Some(material.name().to_owned()),
        Err(error) => {
            s.fault(key, error.to_string(), error.remedy());
            Some(text)
        }
    }
}

/// A spacer on the substrate, then what the etch left of the film.
fn read_under(s: &Section<'_, '_>, pillar_material: &str) -> Vec<UnderSpec> {
    let height = |key: &str| s.float_or(key, Limits::new(0.0..=TALLEST_NM, "nm"), 0.0);
    let spacer_nm = height("spacer_nm");
    let spacer = read_material(s, "spacer_material");
    if spacer.is_some() && !s.has("spacer_nm") {
        s.fault(
            "spacer_material",
            "a spacer without a thickness",
            "add `spacer_nm`, or leave `spacer_material` out",
        );
    }
    if spacer_nm > 0.0 && spacer.is_none() {
        s.fault(
            "spacer_nm",
            "a spacer of no material",
            "add `spacer_material`: a name or the path of a CSV table",
        );
    }
    let layers = [
        (spacer.unwrap_or_default(), spacer_nm),
        (pillar_material.to_owned(), height("residual_nm")),
    ];
    let layers = layers.into_iter().filter(|(_, height_nm)| *height_nm > 0.0);
    layers
        .map(|(material, height_nm)| UnderSpec { material, height_nm })
        .collect()
}

/// The band, shortest wavelength first.
pub(super) fn read_band(s: &Section<'_, '_>) -> Option<(f64, f64)> {
    let [short, long] = s.optional_array::<2>("band_nm", WAVELENGTH)?;
    if short >= long {
        s.fault(
            "band_nm",
            format!("a band from {short} to {long} nm"),
            "give the shortest wavelength first, then the longest",
        );
    }
    Some((short * 1e-3, long * 1e-3))
}
