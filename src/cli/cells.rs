//! `metalith cells`: the library of a design's cell, its fits, and where its mapping sends the light.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::cell::{CellTable, MappingError, Origin, PolarisationAxis, RigorousCell, cache_folder};
use metalith::cell_study::{
    CellStudy, LibraryStudy, MappingStudy, RotationStudy, StudyOptions, rotation_keys, study_steered,
    write_cell_report, write_library_report, write_rotation_report,
};
use metalith::report::{counted, fixed, sig};
use metalith::{AtomicFile, Design, Error, PolarisationBasis, Progress, Result};

use super::out_folder::OutFolder;
use super::paths::{name_of, paths};
use super::section_text::with_keys;
use super::{Outcome, Terminal, print_json, print_line, print_text, standard_input};

/// Tabulate the unit cell of a design by RCWA, fit it, and report the errors of its mapping.
#[derive(Args)]
#[command(after_help = "Example:\n  metalith cells designs/prototype_3x3.toml --out out/cells")]
pub(crate) struct CellsArgs {
    /// The design file.
    design: PathBuf,

    /// Folder for `cells.html`, `cells.json` and the mappings; `out/NAME` of the design if left out.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Folder of cached tables; `METALITH_CACHE` or the user's cache folder if left out.
    #[arg(long, value_name = "FOLDER")]
    cache: Option<PathBuf>,

    /// Power in the zeroth order of the lattice below which a width is avoided.
    #[arg(long, value_name = "SHARE", default_value_t = StudyOptions::default().threshold)]
    avoid: f64,

    /// Diffraction orders along an axis, odd.
    #[arg(long, value_name = "N", default_value_t = 13)]
    orders: usize,

    /// Largest error of the transmission between wavelengths of the table, where it has cubics; rational functions aim at a
    /// twentieth.
    #[arg(long, value_name = "T", default_value_t = 0.01)]
    tolerance: f64,

    /// Also find a mapping for each distinct steered element with the coupled model. It solves a table for each element and
    /// each wavelength of `compared_nm` in [mapping] (of [verify] if that is left out). With four wavelengths an element takes
    /// about six CPU minutes the first time.
    #[arg(long)]
    steered: bool,

    /// Put the best mapping into the design file: its coefficients, or the name of a table that is written to the same folder.
    /// The rest of the file does not change.
    #[arg(long)]
    write: bool,

    /// Print `cells.json` to standard output, without its first two fields, `report` and `metalith`.
    #[arg(long)]
    json: bool,
}

/// Do it.
pub(crate) fn run(args: &CellsArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    if args.write && args.design.as_os_str() == "-" {
        return Err(Error::refused(
            "cells/write-to-standard-input",
            "--write needs a file, and the design comes from standard input",
            "name the design file, or leave --write out",
        ));
    }
    let mut design = standard_input::design_without_library(&args.design)?;
    terminal.warnings(&design.mapping_warnings());
    let out = OutFolder::of(args.out.as_deref(), Path::new("out").join(&design.name), &args.design)?;
    match design.cell.shape.basis() {
        Some(_) if args.steered => {
            return Err(Error::refused(
                "cells/steered-without-squares",
                "--steered does not support rectangles",
                "leave out --steered: the coupled model is made of squares only",
            ));
        }
        Some(PolarisationBasis::Circular) => return rotations(args, &design, &out, terminal),
        Some(PolarisationBasis::Linear) => return library(args, &design, &out, terminal),
        None => {}
    }
    let options = StudyOptions { threshold: args.avoid };
    options.check()?;
    let cache = args.cache.clone().or_else(cache_folder);
    design.solve_mapping(cache.as_deref(), terminal)?;
    let design = design;
    let mut spec = design.table_spec()?;
    spec.orders = args.orders;
    spec.tolerance = args.tolerance;
    let (table, origin) = CellTable::obtain(&spec, cache.as_deref(), terminal)?;
    terminal.clear();
    let mut study = CellStudy::new(&design, &RigorousCell::new(table), options)?;
    if args.steered {
        study.steered = study_steered(&design, cache.as_deref(), terminal)?;
        terminal.clear();
    }
    let turn = out.turn(paths(&design.inputs()), terminal)?;
    turn.publish("cells", &[], |folder| write_cell_report(&study, folder))?;
    drop(turn);
    let folder = out.path;
    if args.json {
        print_json(&study);
        return Ok(Outcome::Fine);
    }
    match origin {
        Origin::Kept(file) => print_line!("library: {} (kept)", file.display()),
        Origin::Computed(Some(file)) => print_line!("library: {} ({} cells solved)", file.display(), study.points),
        Origin::Computed(None) => print_line!("library: {} cells solved, not kept", study.points),
    }
    print_line!("between their wavelengths: {}", study.interpolation.words());
    print_line!(
        "at {} nm the widths span {} waves; {} errs by {} rad rms",
        sig(study.mapping_um * 1e3, 4),
        fixed(study.span_waves, 2),
        if design.mapping.from_cells {
            "the mapping that is solved from the cell"
        } else {
            "the mapping of the design"
        },
        fixed(study.design_round_trip.rms_rad, 3)
    );
    let wavelengths = study
        .compared_um
        .iter()
        .map(|um| format!("{:>14}", format!("{:.0} nm", um * 1e3)));
    print_line!("first / zero order      {}     band", wavelengths.collect::<String>());
    for mapping in &study.mappings {
        let led: Vec<_> = mapping
            .led
            .iter()
            .map(|o| format!("{} / {}", fixed(o.first, 3), fixed(o.zero, 3)))
            .collect();
        print_line!(
            "{:26} {}  {}",
            mapping.name,
            led.join(" "),
            fixed(mapping.mean(|o| o.first), 3)
        );
    }
    if let Some(best) = study.best() {
        print_line!(
            "best, by the light in the first order: {} with {} ({} in the zeroth order, {} rad rms)",
            best.name,
            fixed(best.compared(), 3),
            fixed(
                best.led.iter().map(|o| o.zero).sum::<f64>() / best.led.len().max(1) as f64,
                3
            ),
            fixed(best.phase.rms_rad, 3)
        );
        if args.write {
            write_mapping(&args.design, &design, best, terminal)?;
        }
    }
    for study in &study.steered {
        let light = study
            .light
            .iter()
            .map(|l| l.supercells.map(|share| fixed(share, 3)).join(" to "));
        print_line!(
            "steered by {} and {} steps: first order {} ({} times{})",
            study.steps.0,
            study.steps.1,
            light.collect::<Vec<_>>().join(", "),
            fixed(study.gain(), 3),
            if study.is_better() {
                ""
            } else {
                "; the common mapping stays"
            }
        );
    }
    print_line!("report: {}", folder.join("cells.html").display());
    Ok(Outcome::Fine)
}

/// Put a mapping into a design file, and the table that it may need beside that.
fn write_mapping(path: &Path, design: &Design, best: &MappingStudy, terminal: &Terminal) -> Result<()> {
    if best.name == "design" {
        print_line!("design: {} has the best of these mappings", path.display());
        return Ok(());
    }
    let text = std::fs::read_to_string(path).map_err(Error::io("read", path))?;
    let wavelength = ((design.mapping.wavelength_um * 1e6).round() / 1e3).to_string();
    let table = format!("{}_mapping.csv", design.name);
    let coefficients = best.coefficients.as_ref().map(|list| format!("{list:?}"));
    let is_table = coefficients.is_none();
    let cell = design.cell.mapped(design.mapping.wavelength_um);
    let stated = cell.to_toml();
    let stated: Vec<(&str, Option<&str>)> = stated
        .lines()
        .filter_map(|line| line.split_once(" = "))
        .map(|(key, value)| (key, Some(value)))
        .collect();
    let naming = |table: &str| {
        let quoted = format!("\"{table}\"");
        let keys = [
            ("source", None),
            ("table", is_table.then_some(quoted.as_str())),
            ("basis", (!is_table).then_some("\"all_powers\"")),
            ("coefficients", coefficients.as_deref()),
            ("wavelength_nm", Some(wavelength.as_str())),
        ];
        let changed = with_keys(&text, "[mapping]", 0, &keys);
        with_keys(&changed, "[mapping.cell]", 0, &stated)
    };
    // Tables that the design names stand beside it; both are to be replaced.
    let beside = path.parent().unwrap_or(Path::new(""));
    terminal.turn_at(beside, [])?.replace(&name_of(path), &[], |folder| {
        if is_table {
            let rows = cell.to_comments() + &best.table.to_csv();
            AtomicFile::write(&folder.join(&table), rows.as_bytes())?;
        }
        // What cannot be read does not replace what can.
        Design::parse(path, &naming(&format!("{}/{table}", name_of(folder))))?;
        AtomicFile::write(&folder.join(name_of(path)), naming(&table).as_bytes())
    })?;
    if is_table {
        print_line!("mapping: {}", path.with_file_name(&table).display());
    }
    print_line!("design: {} has this mapping now", path.display());
    Ok(())
}

/// The study of a design of rotated rectangles: a few cells, and no library.
fn rotations(args: &CellsArgs, design: &Design, out: &OutFolder, terminal: &Terminal) -> Result<Outcome> {
    let study = RotationStudy::new(design, terminal)?;
    terminal.clear();
    let turn = out.turn(paths(&design.inputs()), terminal)?;
    let folder = turn.folder();
    turn.publish("cells", &[], |folder| write_rotation_report(&study, folder))?;
    if args.json {
        print_json(&study);
        return Ok(Outcome::Fine);
    }
    let [low, high] = study.converted();
    print_line!(
        "at {} nm {} to {} of the light is converted; phase of the pillars as drawn against that of the mapping:",
        sig(study.wavelength_um * 1e3, 4),
        fixed(low, 3),
        fixed(high, 3)
    );
    let line = |name: &str, error: MappingError| {
        let (rms, worst) = (fixed(error.rms_rad, 4), fixed(error.worst_rad, 4));
        print_line!("{name:26} {rms} rad rms, {worst} at most");
    };
    line("half of the phase", study.half);
    line("design", study.design);
    for fit in &study.fits {
        line(&counted(fit.mapping.sines.len(), "term"), fit.error);
    }
    if let Some(fit) = study.fits.get(1) {
        print_text(&rotation_keys(fit, &study.mapped_cell));
    }
    print_line!("report: {}", folder.join("cells.html").display());
    Ok(Outcome::Fine)
}

/// The study of a design of upright rectangles, and their library.
fn library(args: &CellsArgs, design: &Design, out: &OutFolder, terminal: &Terminal) -> Result<Outcome> {
    if let Some(why) = &design.mapping.pillar_library_refused {
        terminal.warn(&format!("the library that the design names is not judged: {why}"));
    }
    let cache = args.cache.clone().or_else(cache_folder);
    let study = LibraryStudy::new(design, cache.as_deref(), terminal)?;
    terminal.clear();
    let turn = out.turn(paths(&design.inputs()), terminal)?;
    let folder = turn.folder();
    turn.publish("cells", &[], |folder| write_library_report(&study, folder))?;
    if args.json {
        print_json(&study);
        return Ok(Outcome::Fine);
    }
    print_line!(
        "at {} nm {} of {} sizes are the nearest to some pair of phases",
        sig(study.wavelength_um * 1e3, 4),
        study.nearest.pillars().len(),
        study.pillars.count()
    );
    for (name, errors) in [
        ("of all sizes", Some(&study.errors)),
        ("of the design", study.design.as_ref()),
    ] {
        let Some(errors) = errors else { continue };
        for axis in PolarisationAxis::ALL {
            let k = axis.index();
            print_line!(
                "{name:14} light along {axis}: {} rad rms, {} at most; {} of it follows its phase, {} passes",
                fixed(errors.phase[k].rms_rad, 3),
                fixed(errors.phase[k].worst_rad, 2),
                fixed(errors.first[k], 3),
                fixed(errors.passed[k], 3)
            );
        }
    }
    print_line!("library: {}", folder.join("library.csv").display());
    print_line!("report: {}", folder.join("cells.html").display());
    Ok(Outcome::Fine)
}
