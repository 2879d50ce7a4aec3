//! JSON schemas of the text files that people write, for editors and other checkers.
//!
//! Keys, forms, limits and defaults are those that the readers ask for: see [`KeyTable`]. Meanings are those of the tables in
//! `docs/guide`. Conditions between keys are checked by the program alone.

mod guide;
mod json;

use std::path::Path;

use metalith_core::document::KeyTable;
use metalith_metrology::{SetKind, keys_of_effects};
use serde_json::Value;

use guide::Guide;

/// A kind of file that has a schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    Design,
    Camera,
    Rules,
    Waivers,
    Process,
    Study,
    Slurm,
    Bench,
    Set,
    HeightSet,
    SpectrumSet,
    WidthSet,
    StackSet,
    Effects,
    HeightEffects,
    SpectrumEffects,
}

impl FileKind {
    /// All kinds, each with its name in commands and one line for people.
    pub const ALL: [(&str, FileKind, &str); 16] = [
        ("design", Self::Design, "design of a chip"),
        ("camera", Self::Camera, "camera: sensor, channels, exposure and light"),
        ("rules", Self::Rules, "design rules of `metalith check`"),
        ("waivers", Self::Waivers, "accepted violations of `metalith check`"),
        (
            "process",
            Self::Process,
            "process of a cleanroom, for `metalith handoff`",
        ),
        ("study", Self::Study, "tolerance study"),
        ("slurm", Self::Slurm, "jobs of a study on a Slurm cluster"),
        ("bench", Self::Bench, "bench of `metalith plan`"),
        ("set", Self::Set, "measured set of point spread functions"),
        ("set-heights", Self::HeightSet, "measured set of heights"),
        ("set-spectra", Self::SpectrumSet, "measured set of spectra"),
        ("set-widths", Self::WidthSet, "measured set of widths"),
        ("set-psf-stack", Self::StackSet, "measured set of stacks of objects"),
        ("effects", Self::Effects, "declared effects of `metalith calibrate`"),
        (
            "effects-heights",
            Self::HeightEffects,
            "declared effects for a set of heights",
        ),
        (
            "effects-spectra",
            Self::SpectrumEffects,
            "declared effects for a set of spectra",
        ),
    ];

    /// Name in commands.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].0
    }

    /// The kind of this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .find(|(own, ..)| *own == name)
            .map(|(_, kind, _)| *kind)
    }

    /// Name of the file that the schema is written to beside files that refer to it.
    pub fn file_name(self) -> String {
        format!("{}.schema.json", self.name())
    }

    /// First line of a file beside its schema: editors with Taplo (Even Better TOML) read it.
    pub fn reference(self) -> String {
        format!("#:schema ./{}\n", self.file_name())
    }

    /// Address that a schema gives for itself. It names the schema; nothing can be fetched from it.
    fn id(self) -> String {
        format!("{ID}{}", self.name())
    }

    /// The keys that the reader of such files asks for.
    pub fn keys(self) -> KeyTable {
        match self {
            Self::Design => metalith_design::Design::keys(&[]),
            Self::Camera => metalith_sensor::Camera::keys(),
            Self::Rules => metalith_drc::Deck::keys(),
            Self::Waivers => metalith_drc::Waivers::keys(),
            Self::Process => metalith_handoff::Process::keys(),
            Self::Study => metalith_study::Tolerance::keys(),
            Self::Slurm => metalith_study::Slurm::keys(),
            Self::Bench => metalith_bench_plan::BenchFile::keys(),
            Self::Set => metalith_calibrate::MeasuredSet::keys(&metalith_gds::extract::PillarsAt::STATED),
            Self::HeightSet => metalith_metrology::HeightSet::keys(),
            Self::SpectrumSet => metalith_metrology::SpectrumSet::keys(),
            Self::WidthSet => metalith_metrology::WidthSet::keys(),
            Self::StackSet => metalith_metrology::StackSet::keys(),
            Self::Effects => metalith_calibrate::DeclaredEffect::keys(),
            Self::HeightEffects => keys_of_effects(SetKind::Heights).unwrap_or_default(),
            Self::SpectrumEffects => keys_of_effects(SetKind::Spectra).unwrap_or_default(),
        }
    }

    /// JSON schema of such files, in draft 7, as it comes with the program.
    pub fn schema(self) -> &'static str {
        SHIPPED[self as usize]
    }

    /// JSON schema of such files as the readers have it now: seconds of work, which [`FileKind::schema`] spares.
    pub fn schema_of_readers(self) -> String {
        format!("{:#}\n", self.schema_value())
    }

    /// Write the schema beside a file that refers to it, if there is no other file of its name.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write_beside(self, file: &Path) -> metalith_core::Result<()> {
        match write_schema(self, &file.with_file_name(self.file_name())) {
            Err(error) if error.id() == "schema/not-replaced" => Ok(()),
            written => written,
        }
    }

    fn schema_value(self) -> Value {
        let (_, _, what) = Self::ALL[self as usize];
        let mut schema = json::of_table(&self.keys(), "", &Guide::of(self));
        let head = [
            ("$schema", "http://json-schema.org/draft-07/schema#".to_owned()),
            ("$id", self.id()),
            ("title", format!("metalith: {what}")),
            (
                "$comment",
                format!(
                    "written by `metalith schema {}`, version {}",
                    self.name(),
                    env!("CARGO_PKG_VERSION")
                ),
            ),
        ];
        for (key, text) in head {
            schema[key] = text.into();
        }
        schema
    }
}

/// The schemas that come with the program, in the order of [`FileKind::ALL`]: those of the readers, kept since design files take
/// seconds to explore. `scripts/make_schemas.sh` renews them.
static SHIPPED: [&str; 16] = [
    include_str!("../../schemas/design.schema.json"),
    include_str!("../../schemas/camera.schema.json"),
    include_str!("../../schemas/rules.schema.json"),
    include_str!("../../schemas/waivers.schema.json"),
    include_str!("../../schemas/process.schema.json"),
    include_str!("../../schemas/study.schema.json"),
    include_str!("../../schemas/slurm.schema.json"),
    include_str!("../../schemas/bench.schema.json"),
    include_str!("../../schemas/set.schema.json"),
    include_str!("../../schemas/set-heights.schema.json"),
    include_str!("../../schemas/set-spectra.schema.json"),
    include_str!("../../schemas/set-widths.schema.json"),
    include_str!("../../schemas/set-psf-stack.schema.json"),
    include_str!("../../schemas/effects.schema.json"),
    include_str!("../../schemas/effects-heights.schema.json"),
    include_str!("../../schemas/effects-spectra.schema.json"),
];

/// Beginning of the addresses of all schemas.
const ID: &str = "urn:metalith:schema:";

/// Write the schema of a kind of file.
///
/// # Errors
/// If a file is there that is no schema of this program, or it cannot be written.
pub fn write_schema(kind: FileKind, path: &Path) -> metalith_core::Result<()> {
    let text = kind.schema();
    if path.exists() {
        let found = std::fs::read_to_string(path).unwrap_or_default();
        if found == text {
            return Ok(());
        }
        if !found.contains(&format!("\"$id\": \"{ID}")) {
            return Err(metalith_core::Error::refused(
                "schema/not-replaced",
                format!("{} exists and is no schema of metalith", path.display()),
                "give another name with --out, or move the file away",
            ));
        }
    }
    metalith_core::AtomicFile::write(path, text.as_bytes())
}

#[cfg(test)]
mod tests;
