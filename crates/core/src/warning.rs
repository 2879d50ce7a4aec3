//! Something of an input that is allowed, and that is easily a mistake.

use std::fmt;

use serde::Serialize;

use crate::text::printable_message;

/// A warning: it stands first on the terminal, in the report and in its JSON file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// The identity of the warning, `subject/cause`: the text may change, the identity stays.
    pub id: &'static str,
    pub what: String,
    pub hint: String,
}

impl Warning {
    /// A warning by its identity (`subject/cause`), with the remedy.
    pub fn new(id: &'static str, what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self {
            id,
            what: what.into(),
            hint: hint.into(),
        }
    }

    /// The warning as a paragraph of a page; the identity between back quotes.
    pub fn paragraph(&self) -> String {
        format!("Warning: {}. {}. `{}`", self.what, self.hint, self.id)
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [what, hint] = [&self.what, &self.hint].map(|text| printable_message(text));
        write!(f, "warning: {what} [{}]\n  help: {hint}", self.id)
    }
}
