//! `metalith calibrate`: from a measured set to what the model lacks.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::Args;
use metalith::calibrate::{
    Calibration, DeclaredEffect, MeasuredSet, SetVerdict, Settings, ValidationPlan, calibrate, validate,
    write_validation,
};
use metalith::cell::cache_folder;
use metalith::extract::PillarsAt;
use metalith::file::InputFiles;
use metalith::metrology::{self, Answer, SetKind, kind_of};
use metalith::{Error, Result};

use super::out_folder::OutFolder;
use super::paths::paths;
use super::reading::ReadingArgs;
use super::{Outcome, Terminal, print_json, print_line, print_text};

/// Find the effects by which a measured set differs from its prediction.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith calibrate bench/session-1 --out out/session-1\n\nWrites diagnosis.json, report.html, model.toml and, if the residual shows a pattern, proposal.toml; those of an earlier run are removed. With the verdict unexplained or data_unfit there is no model.toml. Exit code 1 if too few measurements can be used."
)]
pub(crate) struct CalibrateArgs {
    /// Folders of sets, or their `measurement.toml`. Sessions of one plan share their simulations.
    #[arg(required = true)]
    sets: Vec<PathBuf>,

    /// Folder for the results, created if it does not exist, with a folder for each set if there are several; `out/calibrate/`
    /// and the set's name if left out.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    #[command(flatten)]
    reading: ReadingArgs,

    /// Try these effects only, separated by commas; all if left out. With `--validate` all are tried, and the synthetic
    /// sets have these effects.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    effects: Vec<String>,

    /// Also try the effects that this file declares by expressions: `[[effect]]` with name, stage and expression.
    #[arg(long, value_name = "FILE")]
    declare: Option<PathBuf>,

    /// If a residual remains that no effect explains, also try the effects that are proposed for it (`proposal.toml`).
    #[arg(long, conflicts_with = "validate")]
    adopt: bool,

    /// Validate the calibration instead, on synthetic sets like this one: without effects, with each effect at three sizes,
    /// with pairs of effects, and with effects that are not in the list. Takes about an hour of CPU time. Writes
    /// validation.html, validation.json, validation.txt and, set by set, validation_trials.jsonl.
    #[arg(long, alias = "proof")]
    validate: bool,

    /// Number of synthetic sets without effect; if left out 60, with `--trial` or `--random` none.
    #[arg(long, value_name = "N", requires = "validate")]
    nulls: Option<u64>,

    /// Validate on one synthetic set with these effects, in typical sizes: `cd_bias=1+film_index=-0.5`, or with each
    /// value of an effect: `tilt=1,-0.5`. May be given several times.
    #[arg(long, value_name = "EFFECTS", requires = "validate")]
    trial: Vec<String>,

    /// Validate on this number of synthetic sets with one or two effects of random size, which tests the intervals.
    #[arg(long, value_name = "N", requires = "validate", default_value_t = 0)]
    random: u64,

    /// Seed of the synthetic sets: chips of `--random`, noise and bench of all sets.
    #[arg(long, value_name = "N", requires = "validate", default_value_t = 0)]
    seed: u32,

    /// Use sets without noise and fit only the effects that are present; the remaining errors of values are errors of the
    /// model.
    #[arg(long, requires = "validate")]
    noiseless: bool,

    /// Diffraction orders along an axis for the cells of synthetic sets, odd; fits use 13.
    #[arg(long, value_name = "N", requires = "validate")]
    orders: Option<usize>,

    /// Print the diagnosis as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &CalibrateArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let out_of = |set: &PathBuf| {
        let folder = match set.parent() {
            Some(parent) if !set.is_dir() => parent,
            _ => set,
        };
        let name = folder.file_name().unwrap_or(OsStr::new("set"));
        let asked = match &args.out {
            Some(out) if args.sets.len() == 1 => Some(out.clone()),
            out => out.as_ref().map(|root| root.join(name)),
        };
        OutFolder::of(asked.as_deref(), Path::new("out/calibrate").join(name), folder)
    };
    let folders = args.sets.iter().map(out_of).collect::<Result<Vec<_>>>()?;
    let outs: Vec<PathBuf> = folders.iter().map(|folder| folder.path.clone()).collect();
    if let Some(k) = (1..outs.len()).find(|&k| outs[..k].contains(&outs[k])) {
        return Err(Error::refused(
            "calibrate/same-output-folder",
            format!(
                "the results of {} and of another set would go to the same folder, {}",
                args.sets[k].display(),
                outs[k].display()
            ),
            "calibrate sets whose folders have the same name with one command each, and different --out",
        ));
    }
    let outcome = calibrate_into(args, &outs, terminal)?;
    folders.iter().try_for_each(OutFolder::note)?;
    Ok(outcome)
}

/// Calibrate or validate the sets, each into its folder.
fn calibrate_into(args: &CalibrateArgs, outs: &[PathBuf], terminal: &Terminal) -> Result<Outcome> {
    // Those of an earlier run are removed, and an effect may be declared by one.
    let inputs = InputFiles::of(paths(&args.sets).chain(args.declare.as_deref()));
    for out in outs {
        let answers = ["diagnosis.json", "report.html", "model.toml", "proposal.toml"].map(|name| out.join(name));
        answers.iter().try_for_each(|answer| inputs.check_output(answer))?;
    }
    let kinds: Vec<_> = args.sets.iter().map(|set| kind_of(set)).collect();
    if kinds.iter().any(Option::is_some) {
        return run_metrology(args, &kinds, outs, terminal);
    }
    if args.validate && args.sets.len() > 1 {
        return Err(Error::refused(
            "calibrate/several-sets-to-validate",
            "--validate is given with several sets",
            "validate one set at a time",
        ));
    }
    let settings = Settings {
        cache: cache_folder(),
        // A validation makes sets with some effects, but always tries all of them.
        only: if args.validate {
            Vec::new()
        } else {
            args.effects.clone()
        },
        declared: match &args.declare {
            Some(path) => DeclaredEffect::read(path)?,
            None => Vec::new(),
        },
        adopt: args.adopt,
        ..Settings::default()
    };
    args.reading.file.apply(terminal);
    let reader = PillarsAt {
        layer: args.reading.layer,
        top: args.reading.file.top.clone(),
    };
    if args.validate {
        let (set, out) = (MeasuredSet::read(&args.sets[0], &reader, terminal)?, &outs[0]);
        let base = if args.trial.is_empty() && args.random == 0 {
            ValidationPlan::default()
        } else {
            ValidationPlan::only(args.trial.clone(), args.random)
        };
        let plan = ValidationPlan {
            nulls: args.nulls.unwrap_or(base.nulls),
            effects: args.effects.clone(),
            seed: args.seed,
            noiseless: args.noiseless,
            journal: Some(out.join("validation_trials.jsonl")),
            orders: args.orders.unwrap_or(base.orders),
            ..base
        };
        let validation = validate(&set, &settings, &plan, terminal)?;
        terminal
            .turn_at(out, paths(&set.inputs()))?
            .publish("validation", &[], |folder| write_validation(folder, &validation))?;
        terminal.clear();
        if args.json {
            print_json(&validation);
        } else {
            print_text(validation.text().trim_end());
            print_line!("{}", out.join("validation.html").display());
        }
        return Ok(Outcome::Fine);
    }
    let mut outcome = Outcome::Fine;
    for done in calibrate(&args.sets, outs, &settings, &reader, terminal)? {
        terminal.clear();
        if args.json {
            print_json(&done.diagnosis);
        } else {
            describe(&done);
        }
        if done.diagnosis.verdict == SetVerdict::DataUnfit {
            outcome = Outcome::OutsideLimits;
        }
    }
    Ok(outcome)
}

/// Calibrate sets of heights, of spectra and of widths.
fn run_metrology(
    args: &CalibrateArgs,
    kinds: &[Option<SetKind>],
    outs: &[PathBuf],
    terminal: &Terminal,
) -> Result<Outcome> {
    if args.validate || args.adopt {
        return Err(Error::refused(
            "calibrate/kind-has-none",
            "--validate and --adopt are for sets of kind `psf`",
            "leave the option out: sets of heights, spectra, widths and stacks are judged by what was left out of the fit",
        ));
    }
    for ((set, kind), out) in args.sets.iter().zip(kinds).zip(outs) {
        let Some(kind) = kind else {
            return Err(Error::refused(
                "calibrate/kinds",
                format!(
                    "{} is not of kind `heights`, `spectra`, `widths` or `psf_stack`, another set is",
                    set.display()
                ),
                "calibrate sets of kind `psf` by a command of their own",
            ));
        };
        let done = metrology::calibrate(set, *kind, out, (&args.effects, args.declare.as_deref()), terminal)?;
        terminal.clear();
        if args.json {
            print_json(&done.diagnosis);
        } else {
            describe_metrology(&done);
        }
    }
    Ok(Outcome::Fine)
}

fn describe_metrology(done: &Answer) {
    let diagnosis = &done.diagnosis;
    print_line!("{}: {}", diagnosis.set, diagnosis.sentence());
    for line in &diagnosis.remarks {
        print_line!("{line}");
    }
    for line in diagnosis.ladder_lines() {
        print_line!("{line}");
    }
    for line in &diagnosis.validation {
        print_line!("{line}");
    }
    for lost in &diagnosis.not_in_model {
        print_line!("not in model.toml: `{}`, because {}", lost.effect, lost.why);
    }
    print_line!("{}", done.answer.display());
    print_line!("{}", done.report.display());
    if let Some(model) = &done.model {
        print_line!("{}", model.display());
    }
}

/// Most measurements that are left out and named.
const MOST_LEFT_OUT: usize = 8;

fn describe(done: &Calibration) {
    let error = &done.diagnosis.error;
    for warning in &done.diagnosis.warnings {
        print_line!("warning: {warning}");
    }
    for left in done.diagnosis.left_out.iter().take(MOST_LEFT_OUT) {
        print_line!("left out: `{}`: {}", left.measurement, left.reason);
    }
    if let Some(more) = done.diagnosis.left_out.len().checked_sub(MOST_LEFT_OUT + 1) {
        print_line!("left out: {} more, see {}", more + 1, done.report.display());
    }
    print_line!("{}: {}", done.diagnosis.set, done.diagnosis.sentence());
    print_line!(
        "{} on measurements left out: {:.4} before, {:.4} after; noise alone gives 1",
        error.measure,
        error.before.held_out,
        error.after.held_out
    );
    for remark in &done.diagnosis.remarks {
        print_line!("{remark}");
    }
    for pattern in &done.diagnosis.patterns {
        print_line!("{}", pattern.sentence());
    }
    if let Some(proposal) = &done.diagnosis.proposal {
        print_line!("{}", proposal.sentence(&done.diagnosis));
    }
    print_line!("{}", done.answer.display());
    print_line!("{}", done.report.display());
    if let Some(model) = &done.model {
        print_line!("{}", model.display());
    }
}
