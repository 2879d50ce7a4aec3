//! What the lab brings to a hand-off: the process, its decks of rules and accepted violations, each read once.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::listing::Listing;
use super::process::{Process, ShapeRules};
use metalith_core::Result;
use metalith_core::text::is_printable;
use metalith_drc::{Deck, Waivers};
use metalith_pillars::{DatabaseUnit, PillarShape};

/// Process, decks, waivers, and copies of all inputs.
pub(super) struct Lab {
    pub process: Process,
    shape: PillarShape,
    /// The decks of the process, in its order.
    decks: Vec<(PathBuf, Deck)>,
    pub waivers: Option<Waivers>,
    kept: Vec<InputCopy>,
}

/// One input as it was read.
pub(super) struct InputCopy {
    /// File name with a prefix for its kind; not yet unique.
    name: String,
    purpose: &'static str,
    bytes: Vec<u8>,
}

impl Lab {
    /// Read these decks of a process for pillars of a shape, each as `adapted` makes it, and the waivers. `kept` are inputs that
    /// were read before.
    ///
    /// # Errors
    /// Mistakes in a file, or one that cannot be read.
    pub(crate) fn read(
        process: Process,
        (shape, unit): (PillarShape, DatabaseUnit),
        rules: &[&Path],
        adapted: impl Fn(&Path, Deck) -> Deck,
        waivers: Option<&Path>,
        mut kept: Vec<InputCopy>,
    ) -> Result<Self> {
        // The process and its decks may be those of the program, which are no files.
        let (path, text) = process.source();
        kept.push(InputCopy::new("process_", path, "the process values", text.as_bytes()));
        let mut decks: Vec<(PathBuf, Deck)> = Vec::new();
        for rules in rules.iter().copied() {
            if decks.iter().any(|(known, _)| known == rules) {
                continue;
            }
            let deck = adapted(rules, process.deck(rules, unit)?);
            let (path, text) = deck.source();
            kept.push(InputCopy::new(
                "rules_",
                path,
                "rules that layouts were checked with",
                text.as_bytes(),
            ));
            decks.push((rules.to_owned(), deck));
        }
        let waivers = waivers.map(Waivers::read).transpose()?;
        if let Some(waivers) = &waivers {
            let purpose = "violations that were accepted";
            kept.push(InputCopy::new(
                "waivers_",
                &waivers.path,
                purpose,
                waivers.text.as_bytes(),
            ));
        }
        Ok(Self {
            process,
            shape,
            decks,
            waivers,
            kept,
        })
    }

    /// The decks of the first step for the pillars.
    pub(crate) fn first_step(&self) -> &ShapeRules {
        let rules = self.process.checks.of_shape(self.shape);
        rules.expect("a process that has none is refused before")
    }

    /// A deck that the process names.
    pub(crate) fn deck(&self, rules: &Path) -> &Deck {
        let found = self.decks.iter().find(|(path, _)| path == rules);
        &found.expect("all decks of the process are read").1
    }

    /// Keep one more input.
    pub(crate) fn keep_copy(&mut self, copy: InputCopy) {
        self.kept.push(copy);
    }

    /// Write all inputs as they were read, each under a separate name.
    ///
    /// # Errors
    /// If one cannot be written.
    pub(crate) fn keep(&self, files: &mut Listing) -> Result<()> {
        let mut taken = BTreeSet::new();
        for input in &self.kept {
            let name = unique(&taken, &input.name);
            files.write(format!("inputs/{name}"), input.purpose, &input.bytes)?;
            taken.insert(name.to_lowercase());
        }
        Ok(())
    }
}

/// Characters of a file name that every file system takes; others become an underscore.
pub(super) fn legal_name(name: &str) -> String {
    let legal = |c: char| {
        if is_printable(c) && !r#"/\:*?"<>|"#.contains(c) {
            c
        } else {
            '_'
        }
    };
    name.chars().map(legal).collect()
}

impl InputCopy {
    pub(crate) fn new(kind: &str, path: &Path, purpose: &'static str, bytes: &[u8]) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        Self {
            name: legal_name(&format!("{kind}{name}")),
            purpose,
            bytes: bytes.to_owned(),
        }
    }
}

/// The name, with a number before its extension if it is taken. Upper and lower case count as equal, because some file
/// systems do not distinguish them.
fn unique(taken: &BTreeSet<String>, name: &str) -> String {
    let (stem, ending) = match name.rfind('.') {
        Some(dot) if dot > 0 => name.split_at(dot),
        _ => (name, ""),
    };
    std::iter::once(name.to_owned())
        .chain((2u32..).map(|k| format!("{stem}_{k}{ending}")))
        .find(|candidate| !taken.contains(&candidate.to_lowercase()))
        .expect("there are more numbers than names")
}
