//! Effects that a person declares in a file, by an expression, without compiling anything.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Effect, Parameter, Stage};
use crate::set::MeasuredSet;
use metalith_attribution::{DeclaredParameter, keys_of_declared_effects, read_declared_effects};
use metalith_core::Result;
use metalith_core::document::{KeyTable, Section};
use metalith_optics::{CompiledTerm, DeclaredQuantity, DeclaredTerm, Perturbation};
use metalith_report::sig;

/// An effect of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct DeclaredEffect {
    pub name: String,
    /// Unit of its first parameter, for people.
    pub unit: String,
    pub quantity: DeclaredQuantity,
    pub expression: String,
    pub parameters: Vec<DeclaredParameter>,
}

/// Stage at which an expression acts, by the word of the file.
const STAGES: [(&str, Stage); 6] = [
    ("pupil", Stage::Geometry),
    ("width", Stage::Geometry),
    ("distance", Stage::Diffraction),
    ("spectrum", Stage::Source),
    ("kernel", Stage::Camera),
    ("transfer", Stage::Camera),
];

/// The word for where a quantity acts.
fn stage_word(quantity: DeclaredQuantity) -> &'static str {
    match quantity {
        DeclaredQuantity::OpdNm | DeclaredQuantity::PhaseRad | DeclaredQuantity::Amplitude => "pupil",
        DeclaredQuantity::WidthNm => "width",
        DeclaredQuantity::DistanceUm => "distance",
        DeclaredQuantity::Spectrum => "spectrum",
        DeclaredQuantity::Kernel => "kernel",
        DeclaredQuantity::Transfer => "transfer",
    }
}

impl DeclaredEffect {
    /// The effects of a file.
    ///
    /// # Errors
    /// All faults of the file at once, each with its line and column.
    pub fn read(path: &Path) -> Result<Vec<Self>> {
        read_declared_effects(path, |section| Some(declared(section)), |effect| &effect.name)
    }

    /// The keys of a file of effects.
    pub fn keys() -> KeyTable {
        keys_of_declared_effects(|section| Some(declared(section)), |effect| &effect.name)
    }

    /// The effects as a file that [`DeclaredEffect::read`] reads.
    pub fn text(effects: &[Self]) -> String {
        let quoted = |text: &str| toml::Value::String(text.into()).to_string();
        let mut out = String::new();
        for e in effects {
            let key = DeclaredQuantity::ALL
                .iter()
                .find(|(_, q)| *q == e.quantity)
                .map_or("", |q| q.0);
            out.push_str(&format!(
                "[[effect]]\nname = {}\nunit = {}\nstage = \"{}\"\n{key} = {}\n",
                quoted(&e.name),
                quoted(&e.unit),
                stage_word(e.quantity),
                quoted(&e.expression)
            ));
            for p in &e.parameters {
                out.push_str(&p.text());
            }
            out.push('\n');
        }
        out
    }

    fn term(&self, values: BTreeMap<String, f64>) -> DeclaredTerm {
        DeclaredTerm {
            name: self.name.clone(),
            quantity: self.quantity,
            expression: self.expression.clone(),
            values,
        }
    }
}

fn declared(s: &Section<'_, '_>) -> DeclaredEffect {
    let name = DeclaredParameter::name_of_effect(s);
    let unit = s.optional_text("unit").unwrap_or_default();
    let stages = STAGES.map(|(word, _)| (word, word));
    let stage = s.choice("stage", &stages, None);
    let keys: Vec<_> = DeclaredQuantity::ALL.iter().filter(|(key, _)| s.has(key)).collect();
    let own: Vec<&str> = DeclaredQuantity::ALL
        .iter()
        .filter(|(_, q)| stage_word(*q) == stage)
        .map(|(key, _)| *key)
        .collect();
    let (key, quantity) = if let [(key, quantity)] = keys.as_slice() {
        (*key, *quantity)
    } else {
        let what = format!("an effect has one expression, this one has {}", keys.len());
        s.fault(
            "name",
            what,
            format!("for the stage `{stage}`, give {}", own.join(" or ")),
        );
        keys.first().map_or(("opd_nm", DeclaredQuantity::OpdNm), |k| **k)
    };
    if !keys.is_empty() && stage_word(quantity) != stage {
        s.fault(
            key,
            format!("`{key}` does not act at the stage `{stage}`"),
            format!(
                "the stage of `{key}` is `{}`; that stage has {}",
                stage_word(quantity),
                own.join(", ")
            ),
        );
    }
    let expression = if keys.is_empty() { "0".into() } else { s.text(key) };
    for (other, _) in keys.iter().skip(1) {
        let _ = s.optional_text(other);
    }
    let parameters = DeclaredParameter::read_all(s, quantity.variables());
    s.finish();
    let effect = DeclaredEffect {
        name,
        unit,
        quantity,
        expression,
        parameters,
    };
    let start = effect.parameters.iter().map(|p| (p.name.clone(), p.start)).collect();
    match effect.term(start).compiled() {
        Err(fault) => s.fault_in_text(key, fault.at, fault.what, fault.hint),
        Ok(term) => {
            if let Some((what, hint)) = does_something(&term) {
                s.fault(key, what, hint);
            }
        }
    }
    effect
}

/// An expression that is off by this where its parameters start, in its unit, rounds; more is something that the effect does.
const NOTHING: f64 = 1e-9;

/// Values of a variable that expressions are tried at: of no symmetry, close to the middle of a lens and far from it, on every side of
/// a chip. Variables have unlike numbers of them, so that values meet in many ways.
fn tried(variable: &str) -> &'static [f64] {
    match variable {
        "x" => &[0.4, 3.7, -21.3, 64.1, -310.7],
        "y" => &[0.0, -2.9, 17.9, 0.3, 41.3, -7.7, 205.3],
        "R" => &[30.0, 70.0, 500.0],
        "X" => &[0.0, 400.0, -150.0, 2420.0],
        "Y" => &[0.0, -400.0, 150.0, 400.0, 2420.0],
        "wavelength" => &[455.0, 530.0, 660.0, 1550.0],
        "w" => &[90.0, 150.0, 240.0],
        "fill" => &[0.1, 0.35, 0.6, 0.8],
        "centre" => &[450.0, 533.0, 660.0],
        "fx" => &[0.0, 0.07, -0.31, 0.9],
        "fy" => &[0.0, -0.05, 0.23, 0.6, 1.1],
        _ => &[0.0],
    }
}

/// Places at which an expression is tried: all ways in which five, seven, three and four values meet.
const PLACES: usize = 420;

/// Fault of an expression at the start of its parameters, and its remedy; none where it changes nothing at any place that is
/// tried. Changes are counted from there: they would begin with a jump.
fn does_something(term: &CompiledTerm) -> Option<(String, String)> {
    let (nothing, example) = match term.quantity {
        DeclaredQuantity::Spectrum => (1.0, "such as `1 + a * (wavelength - centre)`"),
        DeclaredQuantity::Transfer => (1.0, "such as `exp(-2 * pi^2 * a * fx^2)`"),
        _ => (0.0, "such as `a` times a shape"),
    };
    let variables = term.quantity.variables();
    (0..PLACES).find_map(|k| {
        let at = |variable: &str| {
            let values = tried(variable);
            values[k % values.len()]
        };
        let (x, y) = (at("x"), at("y"));
        let values: Vec<f64> = variables
            .iter()
            .map(|variable| match *variable {
                "r" => x.hypot(y),
                "theta" => y.atan2(x),
                other => at(other),
            })
            .collect();
        let value = term.value(&values);
        if (value - nothing).abs() <= NOTHING {
            return None;
        }
        let used = variables.iter().zip(&values).filter(|(name, _)| term.uses(name));
        let place: Vec<String> = used.map(|(name, v)| format!("{name} = {}", sig(*v, 4))).collect();
        let at = if place.is_empty() { String::new() } else { format!(" at {}", place.join(", ")) };
        Some((
            format!("with all parameters at their `start` the expression is {}{at}, not {nothing}", sig(value, 4)),
            format!(
                "an effect does nothing at the start, which is 0 where none is given: write an expression that is {nothing} there, \
                 {example}"
            ),
        ))
    })
}

impl Effect for DeclaredEffect {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn unit(&self) -> &str {
        &self.unit
    }

    fn stage(&self) -> Stage {
        let word = stage_word(self.quantity);
        STAGES.iter().find(|s| s.0 == word).map_or(Stage::Geometry, |s| s.1)
    }

    fn parameters(&self) -> Vec<Parameter> {
        let of = |p: &DeclaredParameter| Parameter {
            // The width of a spot may well be zero, the lower end of its range, wherever a fit starts from.
            sound_end: if p.range.0 == 0.0 { -p.start } else { 0.0 },
            ..Parameter::new(p.range.0 - p.start, p.range.1 - p.start, p.prior)
        };
        self.parameters.iter().map(of).collect()
    }

    fn dormant(&self) -> bool {
        // An amplitude with its places and widths, which do nothing where it is zero.
        self.parameters.len() > 1
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        if parameters.iter().any(|p| *p != 0.0) {
            let pairs = self.parameters.iter().zip(parameters);
            to.declare(self.term(pairs.map(|(p, v)| (p.name.clone(), p.start + v)).collect()));
        }
    }

    fn reported(&self, numbers: &[f64], half_widths: &[f64], _set: &MeasuredSet) -> Vec<(f64, [f64; 2])> {
        let parts = self.parameters.iter().zip(numbers).zip(half_widths);
        parts
            .map(|((p, v), w)| {
                let at = p.start + v;
                (at, [(at - w).max(p.range.0), (at + w).min(p.range.1)])
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{table::TABLE, value_error_of};
    use super::*;

    const SOUND: &str = r#"
[[effect]]
name = "bow"
unit = "nm"
range = [-200.0, 200.0]
prior = 15.0
stage = "pupil"
opd_nm = "a * (x^2 - y^2) / R^2"

[[effect]]
name = "ghost"
stage = "kernel"
kernel = "a * exp(-((x - u)^2 + y^2) / 0.5) / (0.5 * pi)"
[[effect.parameter]]
name = "a"
range = [-0.5, 0.5]
prior = 0.05
[[effect.parameter]]
name = "u"
range = [-20.0, 20.0]
prior = 1.0
start = 5.0
"#;

    fn read(text: &str) -> Result<Vec<DeclaredEffect>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("effects.toml");
        std::fs::write(&path, text).unwrap();
        DeclaredEffect::read(&path)
    }

    #[test]
    fn a_file_is_read_and_written_back() {
        let effects = read(SOUND).unwrap();
        assert_eq!(effects.len(), 2);
        assert_eq!(read(&DeclaredEffect::text(&effects)).unwrap(), effects);
        let mut made = Perturbation::default();
        effects[1].apply(&[0.1, 0.0], &mut made);
        assert_eq!(made.camera.declared[0].values["u"], 5.0);
        assert_eq!(effects[1].parameters()[1].range, (-25.0, 15.0));
    }

    /// An error that was measured belongs to an effect, not to whatever has its name in front.
    #[test]
    fn a_declared_effect_has_the_error_of_its_stage() {
        let mut effect = read(SOUND).unwrap().remove(0);
        effect.name = "defocus_of_the_lid".into();
        assert_eq!(effect.value_error(), value_error_of(effect.stage()));
        let defocus = TABLE.iter().find(|e| e.name == "defocus").unwrap();
        assert_ne!(effect.value_error(), defocus.value_error());
    }

    /// Changes are counted from the start of the parameters: what is there already would come with the first of them.
    #[test]
    fn an_effect_that_does_something_at_its_start_is_refused() {
        let with = |stage: &str, expression: &str| {
            let effect = "[[effect]]\nname = \"own\"\nrange = [-9.0, 9.0]\nprior = 1.0";
            read(&format!("{effect}\nstage = \"{stage}\"\n{expression}\n"))
        };
        for (stage, expression, part) in [
            ("pupil", "opd_nm = \"50 * x / R + a * y / R\"", ":6:"),
            ("pupil", "opd_nm = \"50 * x / R + a * y / R\"", "not 0"),
            ("spectrum", "spectrum = \"a * (wavelength - centre)\"", "not 1"),
            (
                "spectrum",
                "spectrum = \"1 + (a + 0.01) * (wavelength - centre)\"",
                "wavelength = ",
            ),
            (
                "kernel",
                "kernel = \"(a + 0.05) * exp(-((x - 5)^2 + (y + 3)^2) / 0.5)\"",
                "not 0",
            ),
            ("distance", "distance_um = \"a * X + 0.01 * Y\"", "Y = "),
            ("width", "width_nm = \"a + (fill - 0.3)\"", "fill = "),
            ("transfer", "transfer = \"a * fx^2\"", "not 1"),
        ] {
            let error = with(stage, expression).unwrap_err().to_string();
            assert!(error.contains(part), "{part} is not in:\n{error}");
        }
        for (stage, expression) in [
            ("spectrum", "spectrum = \"1 + a * (wavelength - centre) / 100\""),
            ("pupil", "amplitude = \"cos(a * x / R) - 1\""),
            ("transfer", "transfer = \"exp(-2 * pi^2 * a * fx^2)\""),
            ("width", "width_nm = \"a * w / 150\""),
            ("distance", "distance_um = \"a * step(1 - hypot(X - 400, Y))\""),
        ] {
            assert!(with(stage, expression).is_ok(), "{expression}");
        }
    }

    #[test]
    fn faults_have_a_line_and_a_column() {
        let text = SOUND
            .replace("y^2) / R^2", "q^2) / R^2")
            .replace("stage = \"kernel\"", "stage = \"width\"")
            .replace("prior = 0.05", "prior = 1.5");
        let error = read(&text).unwrap_err().to_string();
        // The eighth line, where `q` stands within the text.
        for part in [
            ":8:22",
            "`q` is not known",
            "does not act at the stage `width`",
            "a typical value of 1.5 in a range from -0.5 to 0.5",
        ] {
            assert!(error.contains(part), "{part} is not in:\n{error}");
        }
    }
}
