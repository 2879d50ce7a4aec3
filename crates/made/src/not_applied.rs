//! What a perturbation says of the bench alone: a simulation of other light cannot apply it.

use std::fmt;

use serde::Serialize;

use super::Perturbation;

/// A quantity of a model file that a command does not apply, with the reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NotApplied {
    /// Its key in the model file.
    pub quantity: &'static str,
    /// Its value there.
    pub value: String,
    pub because: &'static str,
}

/// Lamps of the bench are not those of the simulation.
const SPECTRUM: &str =
    "shifts and widths of the bench's LEDs are those of its lamps alone, not of the light that is simulated here";

/// The model file gives the source in units of the bench's own.
const SOURCE: &str =
    "the size is relative to the disc of the bench's own source, which is no part of what is simulated here";

impl fmt::Display for NotApplied {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "not applied: `{}` = {}, because {}",
            self.quantity, self.value, self.because
        )
    }
}

impl Perturbation {
    /// What a PSF of one wavelength and one point of the scene, or a picture, leaves out, each quantity that is not zero with
    /// the reason. Everything else of a perturbation is applied.
    pub fn not_applied(&self) -> Vec<NotApplied> {
        let light = &self.light;
        let mut out = Vec::new();
        let mut note = |nothing: bool, quantity, value: String, because| {
            if !nothing {
                out.push(NotApplied {
                    quantity,
                    value,
                    because,
                });
            }
        };
        let shifts = &light.led_shift_nm;
        note(
            shifts.iter().all(|s| *s == 0.0),
            "light.led_shift_nm",
            format!("{shifts:?}"),
            SPECTRUM,
        );
        let declared: Vec<&str> = light.declared.iter().map(|t| t.name.as_str()).collect();
        note(declared.is_empty(), "light.declared", declared.join(", "), SPECTRUM);
        note(
            light.led_width == 0.0,
            "light.led_width",
            light.led_width.to_string(),
            SPECTRUM,
        );
        note(
            light.source_size == 0.0,
            "light.source_size",
            light.source_size.to_string(),
            SOURCE,
        );
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_are_named_and_nothing_else_is() {
        let mut p = Perturbation::default();
        p.camera.pixel_blur_um = 1.0;
        p.path.gap_um = 3.0;
        assert_eq!(p.not_applied(), []);
        *p.light.shift_mut(2) = 1.5;
        p.light.source_size = 0.5;
        let text: Vec<String> = p.not_applied().iter().map(ToString::to_string).collect();
        assert_eq!(text.len(), 2);
        assert!(
            text[0].starts_with("not applied: `light.led_shift_nm` = [0.0, 0.0, 1.5], because "),
            "{text:?}"
        );
    }
}
