//! `metalith calibrate`: from a measured set to what the model lacks.

use std::path::PathBuf;

use clap::Args;
use metalith::Result;
use metalith::calibrate::{
    Calibration, MeasuredSet, SetVerdict, Settings, ValidationPlan, calibrate, validate, write_validation,
};
use metalith::cell::cache_folder;

use super::{Outcome, Terminal, print_line};

/// Find what a measured set tells that the model does not know.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith calibrate bench/session-1 --out out/session-1\n\nWrites diagnosis.json, report.html and model.toml. Exit code 1 if too few captures can be used."
)]
pub struct CalibrateArgs {
    /// Folders of sets, or their `measurement.toml`. Sessions planned alike share their simulations.
    #[arg(required = true)]
    sets: Vec<PathBuf>,

    /// Folder for the answers, created if need be, with one folder a set if there are several;
    /// `out/calibrate/` and the set's name if left out.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Try these effects alone, separated by commas; all of them if left out.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    effects: Vec<String>,

    /// Judge the calibration itself instead: twins of this set with nothing, with each effect at three sizes,
    /// and with effects in no list. Takes half an hour; writes proof.html, proof.json and proof.txt.
    #[arg(long)]
    proof: bool,

    /// Synthesizer without effect that the proof judges.
    #[arg(long, value_name = "N", default_value_t = 60, requires = "proof")]
    nulls: u64,

    /// Print the diagnosis as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &CalibrateArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let name = |set: &PathBuf| {
        let folder = if set.is_dir() {
            Some(set.as_path())
        } else {
            set.parent()
        };
        folder
            .and_then(|f| f.file_name())
            .map_or_else(|| "set".into(), |n| n.to_os_string())
    };
    let outs: Vec<PathBuf> = match &args.out {
        Some(out) if args.sets.len() == 1 => vec![out.clone()],
        out => {
            let root = out.clone().unwrap_or_else(|| PathBuf::from("out").join("calibrate"));
            args.sets.iter().map(|s| root.join(name(s))).collect()
        }
    };
    let settings = Settings {
        cache: cache_folder(),
        // A proof makes twins with some effects, but always tries all of them.
        only: if args.proof { Vec::new() } else { args.effects.clone() },
        ..Settings::default()
    };
    if args.proof {
        let (set, out) = (MeasuredSet::read(&args.sets[0], terminal)?, &outs[0]);
        let extent = ValidationPlan {
            nulls: args.nulls,
            effects: args.effects.clone(),
            ..ValidationPlan::default()
        };
        let proof = validate(&set, &settings, &extent, terminal)?;
        write_validation(out, &proof)?;
        terminal.clear();
        if args.json {
            print_line!("{}", serde_json::to_string_pretty(&proof).unwrap_or_default());
        } else {
            print_line!("{}", proof.text().trim_end());
            print_line!("{}", out.join("proof.html").display());
        }
        return Ok(Outcome::Fine);
    }
    let mut outcome = Outcome::Fine;
    for done in calibrate(&args.sets, &outs, &settings, terminal)? {
        terminal.clear();
        if args.json {
            print_line!("{}", serde_json::to_string_pretty(&done.diagnosis).unwrap_or_default());
        } else {
            describe(&done);
        }
        if done.diagnosis.verdict == SetVerdict::DataUnfit {
            outcome = Outcome::OutsideLimits;
        }
    }
    Ok(outcome)
}

fn describe(done: &Calibration) {
    let error = &done.diagnosis.error;
    print_line!("{}: {}", done.diagnosis.set, done.diagnosis.sentence());
    print_line!(
        "{} on captures left out: {:.4} before, {:.4} after; 1 is noise alone",
        error.measure,
        error.before.held_out,
        error.after.held_out
    );
    print_line!("{}", done.answer.display());
    print_line!("{}", done.report.display());
    if let Some(model) = &done.model {
        print_line!("{}", model.display());
    }
}
