//! Drafts of the writer's job files, for staff to review: JEOL schedule (SDF) and job deck (JDF).

use std::fmt::Write;

use super::dose::{Beam, doses};
use super::metrology_sites::Cross;
use super::process::{JeolJob, Process};
use metalith_design::Design;

const WARNING: &str = "\
; DRAFT, NOT FOR EXPOSURE. Made by a program that never saw this writer.
; To be reviewed and completed by the staff of the writer: names of patterns,
; calibration, path, marks, slot and offsets follow the habits of each lab.
";

/// Longest name of a job or magazine that all versions take.
const LONGEST_NAME: usize = 8;

/// Patterns of a job, and what they were made from.
pub(super) struct JobPatterns<'a> {
    /// Name of the hand-off, which the names of its files begin with.
    pub name: &'a str,
    /// `design` or `layout`.
    pub source: &'static str,
    /// SHA-256 of the source.
    pub digest: String,
    /// Layouts of step 1 without their endings: the pillars first, then the dose matrix, then others.
    pub files: Vec<String>,
    /// Middle of the exposed layers (um), where that is not the origin of the layout.
    pub middle_um: Option<[f64; 2]>,
}

impl<'a> JobPatterns<'a> {
    /// The patterns of a design.
    pub(crate) fn of(design: &'a Design) -> Self {
        let files = ["pillars", "dose_matrix", "tests_pillars"];
        Self {
            name: &design.name,
            source: "design",
            digest: design.digest(),
            files: files.map(|what| format!("{}_{what}", design.name)).into(),
            middle_um: None,
        }
    }
}

/// Name of a job: capitals and digits, a letter first.
fn job_name(name: &str) -> String {
    let name = name.chars().filter(char::is_ascii_alphanumeric);
    let name = name.map(|c| c.to_ascii_uppercase());
    let name = name
        .skip_while(char::is_ascii_digit)
        .take(LONGEST_NAME)
        .collect::<String>();
    if name.is_empty() { "CHIP".into() } else { name }
}

/// Name of the job deck and of the schedule for a beam, without its ending: one dot is enough for a file.
pub(super) fn stem(name: &str, beam: &Beam) -> String {
    format!("{name}_{}nA", beam.current_na).replace('.', "p")
}

/// The job deck: marks, position of each pattern, doses.
pub(super) fn job_deck(
    patterns: &JobPatterns<'_>,
    process: &Process,
    job: &JeolJob,
    crosses: &[Cross],
    beam: &Beam,
) -> String {
    let source = patterns.source;
    let mut text = String::from(WARNING);
    let place = |role: &str| {
        crosses
            .iter()
            .find(|c| c.role == role)
            .map(|c| format!("({},{})", whole(c.x_um), whole(c.y_um)))
    };
    let dose = process.resist.dose_uc_cm2;
    // Writing to a string does not fail.
    let _ = writeln!(
        text,
        "; {source} {} sha256 {}\n; process {}: {}\n;\nJOB/W '{}',{}",
        patterns.name,
        patterns.digest,
        process.name,
        process.title,
        job_name(patterns.name),
        job.substrate_inch
    );
    text.push_str(&if crosses.is_empty() {
        format!(";\n; The {source} has no crosses.\n")
    } else {
        ";\n; Global marks: cross centres on the substrate [um]. The first exposure makes them and does not\n\
         ; look for them; keep these lines for any exposure that has to find them again.\n"
            .to_owned()
    });
    if let (Some(p), Some(q)) = (place("P"), place("Q")) {
        let _ = writeln!(text, "GLMPOS P={p},Q={q}");
    }
    if let Some(mark) = crosses.iter().find(|c| c.role == "P") {
        let _ = writeln!(
            text,
            "GLMP {},{},0,0        ; width and length of an arm [um], cross, upright",
            mark.width_um, mark.length_um
        );
    }
    let _ = writeln!(text, "PATH {}", job.path);
    text.push_str(
        "; One chip in the middle of the substrate. Repeat it by count and pitch: (first,count,pitch)/(first,count,pitch),\n\
         ; x to the right, rows downwards. The origin of a chip is the middle of its pattern: convert the layout with a\n\
         ; chip size that has (0, 0) in its middle.\n",
    );
    if let Some([x, y]) = patterns.middle_um {
        let _ = writeln!(
            text,
            "; The middle of the exposed layers of this layout is ({},{}) um: make that the middle of the chip, or shift it.",
            whole(x),
            whole(y)
        );
    }
    text.push_str(" ARRAY (0,1,0)/(0,1,0)\n");
    let corners: Vec<_> = ["M1", "M2", "M3", "M4"]
        .iter()
        .filter_map(|m| Some(format!("{m}={}", place(m)?)))
        .collect();
    if corners.len() == 4 {
        let _ = writeln!(text, "  CHMPOS {}", corners.join(","));
    }
    text.push_str("  ASSIGN P(1) -> ((*,*),SHOT1)   ; pillars at the base dose\n AEND\n");
    let tests = patterns.files.len() > 2;
    let _ = writeln!(
        text,
        "; Dose matrix{}, beside the chip: choose where, then take the semicolons away\n\
         ; ARRAY (X,1,0)/(Y,1,0)\n;  ASSIGN P(2) -> ((*,*),SHOT2)  ; dose matrix: its own ranks\n; AEND",
        if tests { " and test structures" } else { "" }
    );
    if tests {
        text.push_str("; ARRAY (X,1,0)/(Y,1,0)\n;  ASSIGN P(3) -> ((*,*),SHOT1)  ; test structures\n; AEND\n");
    }
    let _ = writeln!(text, "PEND\nLAYER {}", job.layer_step1);
    for (k, file) in patterns.files.iter().enumerate() {
        let _ = writeln!(
            text,
            " P({}) '{file}.v30'   ; converted from the layout of that name",
            k + 1
        );
    }
    let _ = writeln!(text, " STDCUR {}                  ; beam current [nA]", beam.current_na);
    text.push_str(" SHOT1: MODULAT ((0,0))\n");
    let ranks: Vec<_> = doses(process)
        .iter()
        .map(|d| format!("({},{:+.1})", d.number, d.modulation_percent))
        .collect();
    let _ = writeln!(
        text,
        "; rank = datatype in the dose matrix; change of dose in per cent of {dose} uC/cm2\n SHOT2: MODULAT ({})\nEND",
        ranks.join(",")
    );
    text
}

/// The schedule: which deck, at which current, dose and step.
pub(super) fn schedule(patterns: &JobPatterns<'_>, process: &Process, job: &JeolJob, beam: &Beam) -> String {
    let name = job_name(patterns.name);
    format!(
        "{WARNING}; base dose, current and shot step belong together: shot step {} nm at {:.3} MHz gives {} uC/cm2 at {} nA\nMAGAZIN '{name}'\n#1\n%{}\nJDF '{}',{}\nACC {}\n\
         ; CALPRM '...'               ; or EOS mode,'...': lens mode ({}) and condition file of {} nA, the lab's names\n\
         DEFMODE 2                    ; two-stage deflection: check\nRESIST {}\nSHOT A,{}\nOFFSET(0,0)\nEND\n",
        beam.shot_step_nm,
        beam.clock_mhz,
        process.resist.dose_uc_cm2,
        beam.current_na,
        job.cassette_slot,
        stem(patterns.name, beam),
        job.layer_step1,
        process.writer.acceleration_kv,
        process.writer.mode,
        beam.current_na,
        process.resist.dose_uc_cm2,
        (beam.shot_step_nm / process.writer.grid_nm).round(),
    )
}

/// A coordinate without trailing zeros.
fn whole(x: f64) -> String {
    let text = format!("{x:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
