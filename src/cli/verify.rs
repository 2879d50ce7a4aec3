//! `metalith verify`: a layout is read back and held to its design.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::calibrate::CalibratedModel;
use metalith::design::CellIncidence;
use metalith::report::sig;
use metalith::{
    Accuracy, Design, Fidelity, PillarArray, Premise, Result, Verification, cell_models, verify, write_report,
};

use super::{Outcome, Terminal};

/// Read a layout back, compare every pillar with its design, simulate it, and write the report.
#[derive(Args)]
#[command(after_help = "Example:\n  metalith verify designs/mini_3x3.toml out/mini_3x3/mini_3x3_pillars.gds --fast")]
pub struct VerifyArgs {
    /// The design file.
    design: PathBuf,

    /// The pillar layout, by whatever program it was written.
    layout: PathBuf,

    /// Folder for `report.html` and `report.json`; that of the layout if left out.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    #[command(flatten)]
    judging: Judging,
}

/// How a layout is judged.
#[derive(Args)]
pub struct Judging {
    /// Simulate with errors of 1e-3 instead of 1e-5 of the peak, several times faster.
    #[arg(long)]
    fast: bool,

    /// The cell that the layout is judged by.
    #[arg(long, value_enum, default_value = "rigorous")]
    fidelity: FidelityArg,

    /// Judge by the pillars as a measured line makes them: the `model.toml` that `metalith calibrate` wrote. What
    /// it says of lamps and camera stays with the bench it was found on.
    #[arg(long, value_name = "MODEL", conflicts_with = "fidelity")]
    model: Option<PathBuf>,

    /// Solve the cells at the angles that light arrives at, for both polarisations, as `incidence = "as_lit"` in
    /// [verify] of the design asks for; else along the normal.
    #[arg(long)]
    as_lit: bool,

    /// Print `report.json` to standard output.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
pub enum FidelityArg {
    /// Phase by the published polynomials, no amplitude.
    Published,
    /// Phase by polynomials fitted to the rigorous cell, no amplitude.
    Fitted,
    /// Complex transmission by rigorous coupled-wave analysis.
    Rigorous,
}

impl From<FidelityArg> for Fidelity {
    fn from(arg: FidelityArg) -> Self {
        match arg {
            FidelityArg::Published => Self::Published,
            FidelityArg::Fitted => Self::Fitted,
            FidelityArg::Rigorous => Self::Rigorous,
        }
    }
}

impl Judging {
    /// Read back, simulate, write the report into `folder`, and say what came out.
    pub fn judge(
        &self,
        design: &Design,
        array: &PillarArray,
        layout: &Path,
        folder: &Path,
        terminal: &Terminal,
    ) -> Result<Outcome> {
        let mut design = design.clone();
        if self.as_lit {
            design.verify.incidence = CellIncidence::AsLit;
        }
        let design = &design;
        let model = self.model.as_deref().map(CalibratedModel::read).transpose()?;
        let made = model.as_ref().map(|m| m.cell(design, array.fill())).transpose()?;
        let judge = Fidelity::from(self.fidelity);
        let beside = [Fidelity::Rigorous, Fidelity::Fitted, Fidelity::Published];
        let beside = beside.into_iter().filter(|f| *f != judge);
        let wanted = std::iter::once(judge).chain(beside).collect::<Vec<_>>();
        let models = cell_models(design, &wanted)?;
        let predicted = model.as_ref().zip(made.as_ref()).map(|(m, cell)| m.premise(cell));
        let premises = predicted
            .into_iter()
            .chain(models.iter().map(|m| Premise::from(m.as_ref())))
            .collect::<Vec<_>>();
        let accuracy = if self.fast { Accuracy::Fast } else { Accuracy::Accurate };
        let found = verify(design, array, layout, &premises, accuracy, terminal)?;
        write_report(design, array, &found, folder)?;
        terminal.clear();
        if self.json {
            println!(
                "{}",
                serde_json::to_string_pretty(&found).expect("plain data serialises")
            );
        } else {
            summary(&found, folder);
        }
        Ok(if found.passed() {
            Outcome::Fine
        } else {
            Outcome::OutsideLimits
        })
    }
}

fn summary(found: &Verification, folder: &Path) {
    for element in &found.distinct {
        for spot in &element.spots {
            println!(
                "element {}, {}: Strehl {} ({}), {} designed",
                element.element.label(),
                spot.place(),
                sig(spot.judged().measures.strehl, 3),
                found.fidelity,
                sig(spot.designed.measures.strehl, 3),
            );
        }
    }
    for check in &found.checks {
        let verdict = if check.passed() { "holds" } else { "FAILS" };
        println!(
            "{verdict}: {}: {} (limit {}, `{}`)",
            check.what,
            sig(check.reached, 4),
            sig(check.limit, 4),
            check.key
        );
    }
    println!("report: {}", folder.join("report.html").display());
}

pub fn run(args: &VerifyArgs, terminal: &Terminal) -> Result<Outcome> {
    let design = Design::read(&args.design)?;
    metalith::verify::fits(&design, &args.layout)?;
    terminal.stop_on_interrupt();
    let array = PillarArray::build(&design, terminal)?;
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| args.layout.parent().map_or_else(PathBuf::new, Path::to_owned));
    args.judging.judge(&design, &array, &args.layout, &folder, terminal)
}
