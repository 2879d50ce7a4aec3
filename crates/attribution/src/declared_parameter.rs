//! Parameters of effects that a person declares in a file: name, physical limits, typical size, start.

use std::path::Path;

use metalith_core::Result;
use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};
use metalith_core::file::check_unaltered;

/// Most parameters of one effect: a step of the search fits all of them at once.
pub const MOST_PARAMETERS: usize = 6;

/// Largest number that a file may ask for, in any unit.
const LARGEST: f64 = 1e6;

/// One parameter of a declared effect.
#[derive(Clone, Debug, PartialEq)]
pub struct DeclaredParameter {
    /// Name in the expression.
    pub name: String,
    /// Physical limits.
    pub range: (f64, f64),
    /// A typical distance from its start.
    pub prior: f64,
    /// Value where there is no effect.
    pub start: f64,
}

/// True for letters, digits and `_`, a letter first.
fn is_word(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// The effects of a file, each from its section `[[effect]]` by `read`; none of a section that has faults without a value.
///
/// # Errors
/// All faults of the file at once, each with its line and column.
pub fn read_declared_effects<E>(
    path: &Path,
    read: impl Fn(&Section<'_, '_>) -> Option<E>,
    name: impl Fn(&E) -> &str,
) -> Result<Vec<E>> {
    check_unaltered(path)?;
    let text = load(path)?;
    Document::read(path, &text, |root| sections(root, &read, &name))
}

/// The keys of a file of effects whose sections `read` reads.
pub fn keys_of_declared_effects<E>(
    read: impl Fn(&Section<'_, '_>) -> Option<E>,
    name: impl Fn(&E) -> &str,
) -> KeyTable {
    explore(&[], |root, _| sections(root, &read, &name))
}

fn sections<E>(
    root: &Section<'_, '_>,
    read: impl Fn(&Section<'_, '_>) -> Option<E>,
    name: impl Fn(&E) -> &str,
) -> Vec<E> {
    let sections = root.sections("effect");
    if sections.is_empty() {
        root.fault("effect", "no effect is declared", "add one [[effect]] for each");
    }
    let mut effects: Vec<E> = Vec::new();
    for section in &sections {
        let Some(effect) = read(section) else {
            continue;
        };
        if effects.iter().any(|e| name(e) == name(&effect)) {
            section.fault("name", format!("`{}` is declared twice", name(&effect)), "rename one");
        }
        effects.push(effect);
    }
    effects
}

impl DeclaredParameter {
    /// Name of the effect of a section `[[effect]]`.
    pub fn name_of_effect(s: &Section<'_, '_>) -> String {
        let name = s.text("name");
        if !name.is_empty() && !is_word(&name) {
            s.fault(
                "name",
                format!("`{name}` is no name"),
                "write letters, digits and _, a letter first",
            );
        }
        name
    }

    /// Parameters of a section `[[effect]]`: one, `a`, in its own keys, or its sections `[[effect.parameter]]`. None may have
    /// the name of a variable.
    pub fn read_all(s: &Section<'_, '_>, variables: &[&str]) -> Vec<Self> {
        let parts = s.sections("parameter");
        let parameters: Vec<Self> = if parts.is_empty() {
            vec![Self::read(s, "a".into())]
        } else {
            parts.iter().map(|p| Self::read(p, p.text("name"))).collect()
        };
        for (p, part) in parameters.iter().zip(&parts) {
            let taken =
                variables.contains(&p.name.as_str()) || parameters.iter().filter(|o| o.name == p.name).count() > 1;
            if taken || !is_word(&p.name) {
                part.fault(
                    "name",
                    format!("`{}` cannot name a parameter", p.name),
                    "choose another name",
                );
            }
            part.finish();
        }
        if parameters.len() > MOST_PARAMETERS {
            s.fault(
                "parameter",
                format!("more than {MOST_PARAMETERS} parameters"),
                "split it into two effects",
            );
        }
        parameters
    }

    fn read(s: &Section<'_, '_>, name: String) -> Self {
        let any = || Limits::new(-LARGEST..=LARGEST, "");
        let [low, high] = s.array("range", any());
        let prior = s.float("prior", Limits::new(1e-9..=LARGEST, ""));
        let start = s.float_or("start", any(), 0.0);
        if !(low <= start && start <= high && low < high) {
            s.fault(
                "range",
                format!("the start {start} is not within {low} to {high}"),
                "give the lower end first, and a start between the ends",
            );
        }
        if prior > high - low {
            s.fault(
                "prior",
                format!("a typical value of {prior} in a range from {low} to {high}"),
                "make the range wider, or the prior smaller",
            );
        }
        Self {
            name,
            range: (low, high),
            prior,
            start,
        }
    }

    /// Its section of a file that [`DeclaredParameter::read_all`] reads.
    pub fn text(&self) -> String {
        format!(
            "\n[[effect.parameter]]\nname = \"{}\"\nrange = [{:?}, {:?}]\nprior = {:?}\nstart = {:?}\n",
            self.name, self.range.0, self.range.1, self.prior, self.start
        )
    }
}
