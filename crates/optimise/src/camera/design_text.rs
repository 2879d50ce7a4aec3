//! A camera as the text of a design file: elements one by one, everything else as in the design that it was searched for.

use std::fmt::Write;

use super::element::{CameraElement, POWERS, RADIAL};

/// Sections that the camera replaces; those below them too.
const REPLACED: [&str; 6] = ["lens", "phase", "array", "element", "optimise", "mapping.steered"];

/// Elements of a camera, and what a design file says of them.
pub(super) struct DesignText<'a> {
    /// Text of the design that the camera was searched for.
    pub design: &'a str,
    pub name: &'a str,
    pub title: &'a str,
    pub elements: &'a [CameraElement],
    pub distance_um: f64,
    /// Wavelength of wedges (um).
    pub wedge_um: f64,
    /// Phase in the middle of every element, on which no image depends.
    pub piston_rad: f64,
    /// True if cells are solved for the directions of the light, whatever the design says.
    pub oblique: bool,
}

/// Text of a design whose elements are those of a camera.
pub(super) fn design_text(of: &DesignText<'_>) -> String {
    let DesignText {
        design,
        name,
        title,
        elements,
        distance_um,
        wedge_um,
        piston_rad,
        oblique,
    } = *of;
    let mut text = String::new();
    let mut keeps = true;
    let mut head = true;
    let mut in_verify = false;
    for line in design.lines() {
        if let Some(section) = section_name(line) {
            head = false;
            in_verify = section == "verify";
            keeps = !REPLACED
                .iter()
                .any(|r| section == *r || section.strip_prefix(r).is_some_and(|rest| rest.starts_with('.')));
        }
        let key = line.split('=').next().unwrap_or_default().trim();
        match key {
            "name" if head => _ = writeln!(text, "name = \"{name}\""),
            "title" if head => _ = writeln!(text, "title = \"{title}\""),
            _ if head && line.starts_with('#') => {}
            "incidence" if oblique && in_verify => {}
            _ if keeps => {
                _ = writeln!(text, "{line}");
                if oblique && section_name(line) == Some("verify") {
                    text.push_str(
                        "incidence = \"oblique\"         # cells are solved for the directions of the light\n",
                    );
                }
            }
            _ => {}
        }
    }
    let first = elements.first();
    let [focused_um, _] = first.map_or([0.53, distance_um], |e| e.hyperbola_um);
    _ = write!(
        text,
        "\n[lens]\ndiameter_um = {}\nfocal_length_um = {distance_um}\n\n[phase]\nsource = \"hyperbola\"\nwavelength_nm = {}\n\n\
         [array]\nwedge_wavelength_nm = {}\n",
        first.map_or(1.0, |e| e.diameter_um),
        focused_um * 1e3,
        wedge_um * 1e3,
    );
    for element in elements {
        add_element(&mut text, element, piston_rad);
    }
    text
}

fn add_element(text: &mut String, element: &CameraElement, piston_rad: f64) {
    let [x, y] = element.centre_um;
    _ = write!(
        text,
        "\n[[element]]\nx_um = {x}\ny_um = {y}\ndiameter_um = {}\n",
        element.diameter_um
    );
    let steering = element.wedge.map(|s| s.asin().to_degrees());
    for (key, deg) in ["steering_x_deg", "steering_y_deg"].iter().zip(steering) {
        if deg != 0.0 {
            _ = writeln!(text, "{key} = {deg}");
        }
    }
    let [wavelength, focal] = element.hyperbola_um;
    _ = write!(
        text,
        "[element.phase]\nsource = \"hyperbola\"\nwavelength_nm = {}\nfocal_length_um = {focal}\n",
        wavelength * 1e3
    );
    let polynomial = POWERS
        .iter()
        .zip(&element.terms_rad)
        .map(|((px, py), c)| (*px, *py, *c));
    let mut terms: Vec<(u32, u32, f64)> = std::iter::once((0, 0, piston_rad)).chain(polynomial).collect();
    for (n, c) in RADIAL.iter().zip(&element.terms_rad[POWERS.len()..]) {
        terms.extend((0..=*n).map(|k| (2 * (n - k), 2 * k, c * binomial(*n, k))));
    }
    terms.retain(|(_, _, c)| c.abs() > LEAST_RAD);
    if terms.is_empty() {
        return;
    }
    let list = |of: &dyn Fn(&(u32, u32, f64)) -> String| terms.iter().map(of).collect::<Vec<_>>().join(", ");
    _ = write!(
        text,
        "[[element.phase.term]]\nsource = \"polynomial\"\npowers_x = [{}]\npowers_y = [{}]\ncoefficients_rad = [{}]\n",
        list(&|t| t.0.to_string()),
        list(&|t| t.1.to_string()),
        list(&|t| format!("{:.5}", t.2)),
    );
}

/// Coefficients below which a term is left out (rad).
const LEAST_RAD: f64 = 1e-5;

fn binomial(n: u32, k: u32) -> f64 {
    (0..k).map(|i| f64::from(n - i) / f64::from(i + 1)).product()
}

/// Name of the section that a line begins.
fn section_name(line: &str) -> Option<&str> {
    let inner = line.trim().strip_prefix('[')?;
    let inner = inner.strip_prefix('[').unwrap_or(inner);
    let name = inner.split(']').next()?.trim();
    let is_name = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '-');
    (name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(is_name)).then_some(name)
}
