//! `metalith calibrate`: from a measured set to what the model lacks.

use std::path::PathBuf;

use clap::Args;
use metalith::calibrate::{Calibration, Extent, MeasuredSet, SetVerdict, Settings, calibrate, prove, summary};
use metalith::cell::cache_folder;
use metalith::{Result, WholeFile};

use super::{Outcome, Terminal};

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

    /// Judge the calibration itself instead: twins of this set with nothing, with each effect, and with effects
    /// in no list. Takes half an hour; writes proof.json and proof.txt.
    #[arg(long)]
    proof: bool,

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
        ..Settings::default()
    };
    if args.proof {
        let (set, out) = (MeasuredSet::read(&args.sets[0], terminal)?, &outs[0]);
        let trials = prove(&set, &settings, Extent::default(), terminal)?;
        let text = summary(&trials);
        WholeFile::write(&out.join("proof.txt"), text.as_bytes())?;
        let json = serde_json::to_string_pretty(&trials).unwrap_or_default();
        WholeFile::write(&out.join("proof.json"), json.as_bytes())?;
        terminal.clear();
        print!("{text}");
        return Ok(Outcome::Fine);
    }
    let mut outcome = Outcome::Fine;
    for done in calibrate(&args.sets, &outs, &settings, terminal)? {
        terminal.clear();
        if args.json {
            println!("{}", serde_json::to_string_pretty(&done.diagnosis).unwrap_or_default());
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
    println!("{}: {}", done.diagnosis.set, done.diagnosis.sentence());
    println!(
        "{} on captures left out: {:.4} before, {:.4} after; 1 is noise alone",
        error.measure, error.before.held_out, error.after.held_out
    );
    println!("{}", done.answer.display());
    println!("{}", done.report.display());
    if let Some(model) = &done.model {
        println!("{}", model.display());
    }
}
