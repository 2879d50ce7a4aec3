//! Making the folder: everything is made beside its place and moved there when it is complete.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::census::Census;
use super::dose::{Beam, DoseRow, Exposure, WriteTime, doses};
use super::drawing::Rect;
use super::exposure::{exposures, snapping};
use super::guard::{fits, replaceable};
use super::manifest::{Manifest, entry_of, files_below};
use super::matrix::{self, Block};
use super::process::Process;
use super::rules::{RuleReports, Subject};
use super::sites::{Cross, Site, crosses, sites};
use super::structures::{Structure, Structures, middle_of_reference};
use super::{front, inputs, job, rules, tables, zip};
use metalith_cell::Fidelity;
use metalith_core::{Error, Progress, Result};
use metalith_design::array::PillarArray;
use metalith_design::{Design, cell_models};
use metalith_layout::{write_apertures, write_layer_properties, write_pillars};
use metalith_report::{Verdict, write_json};
use metalith_verify::{SimulationCases, verify, write_report};
use metalith_wave::Accuracy;

/// What to hand over, and where to.
#[derive(Clone, Debug)]
pub struct HandoffOptions {
    /// The design file.
    pub design: PathBuf,
    /// The process file; the program's own if left out.
    pub process: Option<PathBuf>,
    /// Folder to make; the archive stands beside it, with `.zip` behind its name.
    pub out: PathBuf,
    /// The command as it was given, for the manifest.
    pub command: String,
    /// The cell that the layout is judged by; the published polynomials are shown beside it.
    pub fidelity: Fidelity,
    /// How closely the layout is simulated.
    pub accuracy: Accuracy,
    /// Violations of the rules that have been accepted.
    pub waivers: Option<PathBuf>,
}

/// What was handed over.
#[derive(Clone, Debug)]
pub struct Handoff {
    pub folder: PathBuf,
    pub archive: PathBuf,
    pub manifest: Manifest,
    pub checks: Vec<Check>,
}

/// One look at the layout that is part of the hand-off.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    pub name: String,
    #[serde(serialize_with = "as_word")]
    pub verdict: Verdict,
    /// What came out, in one sentence.
    pub words: String,
    /// Its own report, in the folder.
    pub report: Option<String>,
}

fn as_word<S: serde::Serializer>(verdict: &Verdict, s: S) -> Result<S::Ok, S::Error> {
    s.serialize_str(verdict.word())
}

/// Everything that the front page and `handoff.json` tell.
#[derive(Serialize)]
pub(super) struct Contents<'a> {
    #[serde(skip)]
    pub design: &'a Design,
    pub process: &'a Process,
    pub command: &'a str,
    pub design_digest: String,
    pub pillars: u64,
    pub census: Vec<Census>,
    /// Exposure of each file of the first step, with its time at each current.
    pub exposures: Vec<(String, Exposure, Vec<WriteTime>)>,
    /// Root mean square change of the widths when snapped to the shots of each beam [nm].
    pub snapping: Vec<(Beam, f64)>,
    pub doses: Vec<DoseRow>,
    pub blocks: Vec<Block>,
    pub structures: Vec<Structure>,
    #[serde(skip)]
    pub tests_frame: (Rect, (i64, i64)),
    pub sites: Vec<Site>,
    pub crosses: Vec<Cross>,
    pub checks: Vec<Check>,
    /// What became of each rule, by layout.
    pub rules: RuleReports,
    /// Path in the folder and what it is for.
    pub files: Vec<(String, String)>,
}

/// Make the hand-off of a design for a process.
///
/// The folder appears whole or not at all. An older hand-off at the same place is replaced; any other
/// folder with something in it is left alone.
///
/// # Errors
/// Mistakes in the design or process file; a folder in the way; a file that cannot be written; the user
/// stopped it.
pub fn handoff(options: &HandoffOptions, progress: &dyn Progress) -> Result<Handoff> {
    let design = Design::read(&options.design)?;
    let process = options
        .process
        .as_deref()
        .map_or_else(|| Ok(Process::standard()), Process::read)?;
    fits(&design, &process)?;
    replaceable(&options.out)?;
    let name = options.out.file_name().ok_or_else(|| {
        Error::invalid(
            format!("{} is not the name of a folder", options.out.display()),
            "name a folder with --out",
        )
    })?;
    let part = options.out.with_file_name(format!(".{}.part", name.to_string_lossy()));
    if part.exists() {
        fs::remove_dir_all(&part).map_err(Error::io("remove", &part))?;
    }
    let made = fill(&part, options, &design, &process, progress);
    let (manifest, checks) = match made {
        Ok(made) => made,
        Err(error) => {
            // What is left of an unfinished hand-off is of no use; the first error is the one to tell.
            let _ = fs::remove_dir_all(&part);
            return Err(error);
        }
    };
    if options.out.exists() {
        fs::remove_dir_all(&options.out).map_err(Error::io("replace", &options.out))?;
    }
    fs::rename(&part, &options.out).map_err(Error::io("rename to", &options.out))?;

    let archive = options.out.with_file_name(format!("{}.zip", name.to_string_lossy()));
    let (there, _) = files_below(&options.out)?;
    let packed: Vec<_> = there
        .into_iter()
        .map(|(file, path)| (format!("{}/{file}", name.to_string_lossy()), path))
        .collect();
    zip::pack(&archive, &packed, progress)?;
    Ok(Handoff {
        folder: options.out.clone(),
        archive,
        manifest,
        checks,
    })
}

fn fill(
    folder: &Path,
    options: &HandoffOptions,
    design: &Design,
    process: &Process,
    progress: &dyn Progress,
) -> Result<(Manifest, Vec<Check>)> {
    let at = |name: &str| folder.join(name);
    let named = |folder: &str, rest: &str| format!("{folder}/{}_{rest}", design.name);
    let mut files: Vec<(String, String)> = Vec::new();
    let mut list = |name: String, purpose: &str| -> PathBuf {
        files.push((name.clone(), purpose.to_owned()));
        folder.join(name)
    };

    let array = PillarArray::build(design, progress)?;
    let pillars = list(named("layout", "pillars.gds"), "layout of step 1: pillars and marks");
    write_pillars(design, &array, design.layout.hierarchy, &pillars, progress)?;
    let apertures = list(
        named("layout", "apertures.gds"),
        "layout of step 2: openings in the metal and marks, flat",
    );
    write_apertures(design, &apertures)?;
    write_layer_properties(
        design,
        &list(
            format!("layout/{}.lyp", design.name),
            "layer names and colours for KLayout",
        ),
    )?;

    let matrix_file = list(
        named("dose", "dose_matrix.gds"),
        "dose matrix for step 1: nine doses, datatype is the dose",
    );
    let blocks = matrix::write(&matrix_file, design, process)?;
    let doses = doses(process);
    let dose_table = list(
        "dose/dose_table.csv".into(),
        "the nine doses, where each is, a column to fill in",
    );
    tables::write_doses(&dose_table, &doses, &blocks, process.dose_matrix.layer)?;

    let structures = Structures::new(design, process);
    let tests_frame = (structures.frame, structures.field_border);
    let tests = list(named("tests", "tests_pillars.gds"), "test structures of step 1");
    let tests2 = list(named("tests", "tests_apertures.gds"), "test structures of step 2, flat");
    let structures = structures.write(design, &tests, &tests2)?;
    tables::write_structures(
        &list(
            "tests/structures.csv".into(),
            "what each test structure is for and where",
        ),
        &structures,
    )?;
    let reference = reference_design(design, process);
    let single = PillarArray::build(&reference, progress)?;
    let lens = list(
        named("tests", "reference_pillars.gds"),
        "hyperbolic reference lens, step 1",
    );
    write_pillars(&reference, &single, reference.layout.hierarchy, &lens, progress)?;
    let lens2 = list(
        named("tests", "reference_apertures.gds"),
        "hyperbolic reference lens, step 2",
    );
    write_apertures(&reference, &lens2)?;

    let sites = sites(design, process, &array, &structures);
    let cd = list(
        "metrology/cd_table.csv".into(),
        "where to measure widths, columns to fill in",
    );
    tables::write_sites(&cd, &sites, process)?;
    let crosses = crosses(design);
    let layers = &design.layout.layers;
    let both = format!(
        "{}/{} step 1, {}/{} step 2",
        layers.pillar_marks.layer,
        layers.pillar_marks.datatype,
        layers.aperture_marks.layer,
        layers.aperture_marks.datatype
    );
    let alignment = list("metrology/alignment.csv".into(), "alignment crosses of both steps");
    tables::write_crosses(&alignment, &crosses, &both)?;

    let mut census = Vec::new();
    for file in [&pillars, &apertures, &matrix_file, &tests, &tests2, &lens] {
        census.push(Census::take(file, progress)?);
    }
    let exposures = exposures(design, process, &census)?;
    let times: Vec<_> = exposures.iter().map(|(f, _, t)| (f.clone(), t.clone())).collect();
    tables::write_times(
        &list(
            "dose/write_time.csv".into(),
            "time of each file of step 1 at each current",
        ),
        &times,
    )?;
    let snapping = snapping(&array, process)?;
    for (beam, _) in &snapping {
        let name = |kind: &str| format!("job/{}.{kind}", job::stem(design, beam));
        let deck = job::job_deck(design, process, &crosses, beam);
        let schedule = job::schedule(design, process, beam);
        write_text(
            &list(name("jdf"), "DRAFT of the job deck, to be reviewed by staff"),
            &deck,
        )?;
        write_text(
            &list(name("sdf"), "DRAFT of the schedule, to be reviewed by staff"),
            &schedule,
        )?;
    }

    for (name, purpose) in inputs::keep(options, design, process, &at("inputs"))? {
        list(format!("inputs/{name}"), purpose);
    }
    let decks = &process.checks;
    let subject = |name, layout, rules, with, design| Subject {
        name,
        layout,
        rules,
        with,
        design,
        structures: &[],
    };
    let in_reference = [middle_of_reference()];
    let subjects = [
        subject("pillars", &pillars, &decks.pillar_rules, None, Some(design)),
        subject(
            "apertures",
            &apertures,
            &decks.aperture_rules,
            Some(&pillars),
            Some(design),
        ),
        subject("dose_matrix", &matrix_file, &decks.dose_rules, None, None),
        Subject {
            structures: &structures,
            ..subject("tests_pillars", &tests, &decks.test_rules, None, None)
        },
        subject(
            "tests_apertures",
            &tests2,
            &decks.test_opening_rules,
            Some(&tests),
            None,
        ),
        Subject {
            structures: &in_reference,
            ..subject("reference_pillars", &lens, &decks.pillar_rules, None, Some(&reference))
        },
        subject(
            "reference_apertures",
            &lens2,
            &decks.aperture_rules,
            Some(&lens),
            Some(&reference),
        ),
    ];
    let checked = rules::check(&subjects, process, options.waivers.as_deref(), &at("checks"), progress)?;
    for (name, purpose) in &checked.files {
        list(format!("checks/{name}"), purpose);
    }
    let mut checks = checked.checks;
    let (check, made) = verification(options, design, &array, &pillars, &at("verification"), progress)?;
    for (name, purpose) in made {
        list(format!("verification/{name}"), purpose);
    }
    checks.push(check);
    for (name, purpose) in [
        ("index.html", "this page: start here"),
        ("handoff.json", "all numbers of this page for programs"),
        ("chip.svg", "the chip with origin and orientation"),
        ("tone.svg", "tone of both steps in cross-section"),
    ] {
        list(name.into(), purpose);
    }
    let contents = Contents {
        design,
        process,
        command: &options.command,
        design_digest: design.digest(),
        pillars: array.pillars(),
        census,
        exposures,
        snapping,
        doses,
        blocks,
        structures,
        tests_frame,
        sites,
        crosses,
        checks,
        rules: checked.reports,
        files,
    };
    front::write(folder, &contents)?;
    write_json(&at("handoff.json"), "handoff", &contents)?;

    let mut listed = std::collections::BTreeMap::new();
    let (there, _) = files_below(folder)?;
    progress.begin("digests", there.len() as u64);
    for (name, path) in there {
        listed.insert(name, entry_of(&path, &metalith_core::Silent)?);
        progress.advance(1);
    }
    let manifest = Manifest {
        metalith: env!("CARGO_PKG_VERSION").into(),
        command: options.command.clone(),
        design: design.name.clone(),
        design_digest: design.digest(),
        process: process.name.clone(),
        files: listed,
        seal: String::new(),
    }
    .sealed();
    manifest.write(folder)?;
    Ok((manifest, contents.checks))
}

type Reports = [(&'static str, &'static str); 2];

/// Read the pillar layout back, simulate it, and put the report beside it.
fn verification(
    options: &HandoffOptions,
    design: &Design,
    array: &PillarArray,
    pillars: &Path,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<(Check, Reports)> {
    let mut wanted = vec![options.fidelity];
    if options.fidelity != Fidelity::Published {
        wanted.push(Fidelity::Published);
    }
    let models = cell_models(design, &wanted)?;
    let cases = SimulationCases::of_cells(&models)?;
    let found = verify(design, array, pillars, &cases, options.accuracy, progress)?;
    write_report(design, array, &found, folder)?;
    let failed: Vec<_> = found
        .checks
        .iter()
        .filter(|c| !c.passed())
        .map(|c| c.what.as_str())
        .collect();
    let check = Check {
        name: "read back and simulated".into(),
        verdict: Verdict::of(failed.is_empty()),
        words: if failed.is_empty() {
            format!(
                "all {} limits of the design hold, by the {} cell",
                found.checks.len(),
                found.fidelity
            )
        } else {
            format!(
                "{} of {} limits do not hold: {}",
                failed.len(),
                found.checks.len(),
                failed.join("; ")
            )
        },
        report: Some("verification/report.html".into()),
    };
    let made = [
        ("report.html", "what was written, read back, compared and simulated"),
        ("report.json", "all its numbers for programs"),
    ];
    Ok((check, made))
}

/// From the opening over the reference lens to the edge of its chip [nm]: decks ask for room there.
const BESIDE_REFERENCE: i64 = 50_000;

/// The design with one hyperbolic lens on a chip of its own, at full size.
fn reference_design(design: &Design, process: &Process) -> Design {
    let mut reference = matrix::hyperbolic(design, process.tests.reference_wavelength_nm);
    reference.name = "reference_lens".into();
    reference.title = "Hyperbolic reference lens".into();
    reference.layout.marks.clear();
    let room = i64::from(design.lens.diameter_nm) + 2 * (design.layout.apertures.margin_nm + BESIDE_REFERENCE);
    let room = room + room % 2;
    reference.layout.chip.size_nm = (room, room);
    reference
}

fn write_text(path: &Path, text: &str) -> Result<()> {
    // The writer's computer and a PC both read lines that end this way.
    metalith_core::WholeFile::write(path, text.replace('\n', "\r\n").as_bytes())
}
