//! Drafts of the writer's job files, for staff to review: JEOL schedule (SDF) and job deck (JDF).

use std::fmt::Write;

use super::dose::{Beam, doses};
use super::metrology_sites::Cross;
use super::process::Process;
use metalith_design::Design;

const WARNING: &str = "\
; DRAFT, NOT FOR EXPOSURE. Made by a program that never saw this writer.
; To be reviewed and completed by the staff of the writer: names of patterns,
; calibration, path, marks, slot and offsets follow the habits of each lab.
";

/// Longest name of a job or magazine that all versions take.
const LONGEST_NAME: usize = 8;

/// Name of a job: capitals and digits, a letter first.
fn job_name(design: &Design) -> String {
    let name = design.name.chars().filter(char::is_ascii_alphanumeric);
    let name = name.map(|c| c.to_ascii_uppercase());
    let name = name
        .skip_while(char::is_ascii_digit)
        .take(LONGEST_NAME)
        .collect::<String>();
    if name.is_empty() { "CHIP".into() } else { name }
}

/// Name of the job deck and of the schedule for a beam, without its ending: one dot is enough for a file.
pub(super) fn stem(design: &Design, beam: &Beam) -> String {
    format!("{}_{}nA", design.name, beam.current_na).replace('.', "p")
}

/// The job deck: marks, position of each pattern, doses.
pub(super) fn job_deck(design: &Design, process: &Process, crosses: &[Cross], beam: &Beam) -> String {
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
        "; design {} sha256 {}\n; process {}: {}\n;\nJOB/W '{}',{}",
        design.name,
        design.digest(),
        process.name,
        process.title,
        job_name(design),
        process.job.substrate_inch
    );
    text.push_str(if crosses.is_empty() {
        ";\n; The design has no crosses.\n"
    } else {
        ";\n; Global marks: cross centres on the substrate [um]. The first exposure makes them and does not\n\
         ; look for them; keep these lines for any exposure that has to find them again.\n"
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
    let _ = writeln!(text, "PATH {}", process.job.path);
    text.push_str(
        "; One chip in the middle of the substrate. Repeat it by count and pitch: (first,count,pitch)/(first,count,pitch),\n\
         ; x to the right, rows downwards. The origin of a chip is the middle of its pattern: convert the layout with a\n\
         ; chip size that has (0, 0) in its middle.\n",
    );
    text.push_str(" ARRAY (0,1,0)/(0,1,0)\n");
    let corners: Vec<_> = ["M1", "M2", "M3", "M4"]
        .iter()
        .filter_map(|m| Some(format!("{m}={}", place(m)?)))
        .collect();
    if corners.len() == 4 {
        let _ = writeln!(text, "  CHMPOS {}", corners.join(","));
    }
    text.push_str("  ASSIGN P(1) -> ((*,*),SHOT1)   ; pillars at the base dose\n AEND\n");
    text.push_str(
        "; Dose matrix and test structures, beside the chip: choose where, then take the semicolons away\n\
                   ; ARRAY (X,1,0)/(Y,1,0)\n;  ASSIGN P(2) -> ((*,*),SHOT2)  ; dose matrix: its own ranks\n; AEND\n\
                   ; ARRAY (X,1,0)/(Y,1,0)\n;  ASSIGN P(3) -> ((*,*),SHOT1)  ; test structures\n; AEND\nPEND\n",
    );
    let _ = writeln!(text, "LAYER {}", process.job.layer_step1);
    for (k, what) in ["pillars", "dose_matrix", "tests_pillars"].iter().enumerate() {
        let _ = writeln!(
            text,
            " P({}) '{}_{what}.v30'   ; converted from the layout of that name",
            k + 1,
            design.name
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
pub(super) fn schedule(design: &Design, process: &Process, beam: &Beam) -> String {
    let name = job_name(design);
    format!(
        "{WARNING}; base dose, current and shot step belong together: shot step {} nm at {:.3} MHz gives {} uC/cm2 at {} nA\nMAGAZIN '{name}'\n#1\n%{}\nJDF '{}',{}\nACC {}\n\
         ; CALPRM '...'               ; or EOS mode,'...': lens mode ({}) and condition file of {} nA, the lab's names\n\
         DEFMODE 2                    ; two-stage deflection: check\nRESIST {}\nSHOT A,{}\nOFFSET(0,0)\nEND\n",
        beam.shot_step_nm,
        beam.clock_mhz,
        process.resist.dose_uc_cm2,
        beam.current_na,
        process.job.cassette_slot,
        stem(design, beam),
        process.job.layer_step1,
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
