//! Parts of a perturbation that a simulation applies, and parts on the bench alone, which a simulation of other light
//! cannot apply.

use std::fmt;

use serde::Serialize;

use super::Perturbation;

/// A quantity of a model file that a command does not apply, with the reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NotApplied {
    /// Key in the model file.
    pub quantity: &'static str,
    /// Value there.
    pub value: String,
    pub because: &'static str,
}

/// A quantity of a model file that is applied.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Applied {
    /// Key in the model file.
    pub quantity: String,
    /// Value there, to five digits.
    pub value: String,
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

impl fmt::Display for Applied {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` = {}", self.quantity, self.value)
    }
}

/// A value of a model file for people.
fn words(value: &toml::Value) -> String {
    let list = |values: &[toml::Value]| values.iter().map(words).collect::<Vec<_>>().join(", ");
    match value {
        toml::Value::Float(v) => format!("{v:.4e}").parse().unwrap_or(*v).to_string(),
        toml::Value::String(text) => text.clone(),
        toml::Value::Array(values) => format!("[{}]", list(values)),
        toml::Value::Table(table) => {
            let each = table.iter().map(|(key, value)| format!("{key} {}", words(value)));
            each.collect::<Vec<_>>().join(", ")
        }
        other => other.to_string(),
    }
}

impl Perturbation {
    /// Parts that a simulation applies: all that the model file has otherwise than a chip and a bench as stated, by its
    /// keys, less what is [not applied](Self::not_applied).
    pub fn applied(&self) -> Vec<Applied> {
        let table = |p: &Self| toml::Table::try_from(p).expect("plain data serialises");
        let (own, stated) = (table(self), table(&Self::default()));
        let left_out = self.not_applied();
        let mut all = Vec::new();
        for (part, values) in &own {
            for (key, value) in values.as_table().into_iter().flatten() {
                let quantity = format!("{part}.{key}");
                let is_stated = stated.get(part).and_then(|p| p.get(key)) == Some(value);
                if !is_stated && left_out.iter().all(|n| n.quantity != quantity) {
                    let value = words(value);
                    all.push(Applied { quantity, value });
                }
            }
        }
        all
    }

    /// Parts that a PSF of one wavelength and one point of the scene, or a picture, leaves out, each quantity that is
    /// not zero with the reason. Everything else of a perturbation is applied.
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
        p.path.defocus_um = 3.0;
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

    #[test]
    fn what_is_applied_is_named_with_its_value() {
        let mut p = Perturbation::default();
        assert_eq!(p.applied(), []);
        p.path.defocus_um = 2.0;
        p.path.tilt_mrad = [0.0, -1.25];
        p.geometry.cd_bias_nm = -8.123_456;
        p.light.source_size = 0.5;
        let text: Vec<String> = p.applied().iter().map(ToString::to_string).collect();
        assert_eq!(
            text,
            [
                "`geometry.cd_bias_nm` = -8.1235",
                "`path.defocus_um` = 2",
                "`path.tilt_mrad` = [0, -1.25]"
            ]
        );
    }
}
