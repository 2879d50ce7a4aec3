//! `metalith photographs`: real images through the lens of a design, for several phases of it.

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use metalith::cell::{RigorousCell, cache_folder};
use metalith::optimise::{Deconvolution, OptimiseTask, Start, StepLimit, blurs_of_colours, turns_of, views};
use metalith::phase::{Interpolation, RadialPhase};
use metalith::picture::scene::read_picture;
use metalith::wave::Photograph;
use metalith::wave::restore::Restoration;
use metalith::{CellModel, Error, Fidelity, Result, cell_models};
use rayon::prelude::*;

use super::verify::FidelityArg;
use super::{Outcome, Terminal, print_line, standard_input};

/// Take photographs of images through a lens with each of several phases, restore them, and print how close
/// they come, as a table in Markdown.
///
/// At each field angle of [optimise.views]; blue, green and red are thirds of the band, lit evenly; photons and
/// reading make the noise that the merit `deconvolution` expects; scenes go on beyond their border as their mirror
/// images; restored by the Wiener filter of each colour's mean blur.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith photographs designs/imaging_3x3.toml images/*.png --phase log=designs/phases/broadband.csv"
)]
pub struct PhotographsArgs {
    /// The design file: lens, cell, mapping, views.
    design: PathBuf,

    /// PNG, JPEG or NPY images.
    #[arg(required = true)]
    images: Vec<PathBuf>,

    /// A phase to take them with: NAME=TABLE. A hyperbolic lens and a logarithmic asphere are always there.
    #[arg(long, value_name = "NAME=FILE")]
    phase: Vec<String>,

    /// The cell that images are formed with.
    #[arg(long, value_parser = of_single_pillars(), default_value = "rigorous")]
    fidelity: FidelityArg,
}

/// Reads a cell by which rings can be added up one by one: any but that of pillars among unlike neighbours.
fn of_single_pillars() -> impl TypedValueParser<Value = FidelityArg> {
    let cells = FidelityArg::value_variants()
        .iter()
        .filter(|cell| !matches!(cell, FidelityArg::Neighbours))
        .filter_map(ValueEnum::to_possible_value);
    PossibleValuesParser::new(cells)
        .map(|name| <FidelityArg as ValueEnum>::from_str(&name, false).expect("it is the name of a cell"))
}

pub fn run(args: &PhotographsArgs, terminal: &Terminal) -> Result<Outcome> {
    let design = standard_input::design(&args.design)?;
    terminal.stop_on_interrupt();
    let task = OptimiseTask::of(&design)?;
    let images = args
        .images
        .iter()
        .map(|path| read_picture(path))
        .collect::<Result<Vec<_>>>()?;
    let phases = phases(args, &task)?;
    let fidelity = Fidelity::from(args.fidelity);
    let cell: Box<dyn CellModel> = match fidelity {
        // The table, which a run of many wavelengths repays.
        Fidelity::Rigorous => {
            Box::new(RigorousCell::obtain(&design.table_spec()?, cache_folder().as_deref(), terminal)?.0)
        }
        _ => cell_models(&design, &[fidelity])?.remove(0),
    };
    let between = views(&task.spec, &task.spec.views, 0.5);
    let window = between.window;
    let expected = Restoration {
        scene: between.scene,
        noise: between.noise,
        longest_pixels: window.pixels as f64,
    };
    let memory = task.spec.memory_mb << 20;
    let lens = Deconvolution::new(
        &task.lens,
        between,
        cell.as_ref(),
        task.mapping.clone(),
        memory,
        terminal,
    )?;
    terminal.clear();
    let angles = &task.spec.views.angles_deg;
    let at = angles.iter().map(|a| format!("{a}°")).collect::<Vec<_>>().join(" / ");
    print_line!("| phase | PSNR [dB] at {at} | SSIM at {at} | mean PSNR | mean SSIM | expected PSNR |");
    print_line!("| --- | --- | --- | --- | --- | --- |");
    for (name, turns) in phases {
        let widths = task.widths_nm(&turns).into_iter().map(f64::from).collect::<Vec<_>>();
        let transfers = lens.transfers(&widths);
        let mut means = Vec::new();
        for at_angle in &transfers {
            let blurs = blurs_of_colours(at_angle, window)?;
            let found = images
                .par_iter()
                .enumerate()
                .map(|(i, image)| {
                    let photograph = Photograph::take(image, &blurs, &expected, i as u64)?;
                    Ok((photograph.psnr_db, photograph.ssim))
                })
                .collect::<Result<Vec<_>>>()?;
            let mean = |pick: fn(&(f64, f64)) -> f64| found.iter().map(pick).sum::<f64>() / found.len() as f64;
            means.push((mean(|f| f.0), mean(|f| f.1)));
        }
        let list = |values: Vec<String>| values.join(" / ");
        let count = means.len() as f64;
        print_line!(
            "| {name} | {} | {} | {:.2} | {:.3} | {:.2} |",
            list(means.iter().map(|m| format!("{:.2}", m.0)).collect()),
            list(means.iter().map(|m| format!("{:.3}", m.1)).collect()),
            means.iter().map(|m| m.0).sum::<f64>() / count,
            means.iter().map(|m| m.1).sum::<f64>() / count,
            lens.expected_psnr(&widths).0,
        );
    }
    Ok(Outcome::Fine)
}

/// Names and phases (turns), all within the step limit of the design.
fn phases(args: &PhotographsArgs, task: &OptimiseTask) -> Result<Vec<(String, Vec<f64>)>> {
    let band_um = task.spec.band_um;
    let hyperbolic = Start::Hyperbolic {
        wavelength_um: 0.5 * (band_um.0 + band_um.1),
    };
    let mut phases = vec![
        ("hyperbolic".to_owned(), hyperbolic.turns(&task.lens, 0)),
        (
            "log-asphere".to_owned(),
            Start::LogAsphere { band_um }.turns(&task.lens, 0),
        ),
    ];
    for phase in &args.phase {
        let (name, file) = phase.split_once('=').ok_or_else(|| {
            Error::refused(
                "photographs/unknown-phase",
                format!("`{phase}` names no phase"),
                "write --phase NAME=FILE",
            )
        })?;
        let edge_um = task.lens.rings.middle_um(task.lens.rings.len() - 1);
        let table = RadialPhase::read_table(Path::new(file), Interpolation::Nearest, edge_um)?;
        phases.push((name.to_owned(), turns_of(&task.lens.rings, &table)));
    }
    let limit: StepLimit = task.limit();
    for (_, turns) in &mut phases {
        let chosen = limit.nearest_choices(&task.mapping, turns);
        *turns = chosen.iter().map(|&c| task.mapping.choices()[c].turns).collect();
    }
    Ok(phases)
}
