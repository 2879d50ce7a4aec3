//! What a hand-off was made from, kept in it.

use std::path::{Path, PathBuf};

use super::build::HandoffOptions;
use super::process::Process;
use metalith_core::{Error, Result, WholeFile};
use metalith_design::Design;
use metalith_design::phase::RadialPhase;

/// Copy the design, the process, the decks, the waivers and the tables of the design into `folder`; names and what
/// each is.
///
/// # Errors
/// If a file cannot be read or written.
pub(super) fn keep(
    options: &HandoffOptions,
    design: &Design,
    process: &Process,
    folder: &Path,
) -> Result<Vec<(String, &'static str)>> {
    let mut kept = Vec::new();
    let mut put = |name: String, purpose: &'static str, bytes: &[u8]| {
        WholeFile::write(&folder.join(&name), bytes)?;
        kept.push((name, purpose));
        Ok::<_, Error>(())
    };
    // The process and its decks may be those of the program, which are no files.
    let (path, text) = process.source();
    put(format!("process_{}", name(path)), "the process values", text.as_bytes())?;
    for rules in process.checks.decks() {
        let deck = process.deck(rules)?;
        let (path, text) = deck.source();
        put(
            format!("rules_{}", name(path)),
            "rules that layouts were checked with",
            text.as_bytes(),
        )?;
    }
    for (path, name, purpose) in files(options, design) {
        let bytes = std::fs::read(&path).map_err(Error::io("read", &path))?;
        put(name, purpose, &bytes)?;
    }
    Ok(kept)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Path, name in the folder, purpose.
fn files(options: &HandoffOptions, design: &Design) -> Vec<(PathBuf, String, &'static str)> {
    let mut files = vec![(
        options.design.clone(),
        format!("design_{}", name(&options.design)),
        "the design",
    )];
    if let Some(waivers) = &options.waivers {
        files.push((
            waivers.clone(),
            format!("waivers_{}", name(waivers)),
            "violations that were accepted",
        ));
    }
    if let Some(table) = &design.mapping.table_file {
        files.push((table.clone(), name(table), "phase to width, the mapping of the design"));
    }
    if let RadialPhase::Table { file, .. } = &design.lens.phase {
        files.push((file.clone(), name(file), "phase of the lens over its radius"));
    }
    let folder = options.design.parent().unwrap_or(Path::new(""));
    for material in [&design.cell.pillar_material, &design.cell.substrate_material] {
        let table = folder.join(material);
        if table.is_file() {
            files.push((table.clone(), name(&table), "index of a material of the cell"));
        }
    }
    files
}
