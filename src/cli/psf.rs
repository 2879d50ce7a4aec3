//! `metalith psf`: what a layout from anywhere does to light.

use std::path::PathBuf;

use clap::Args;
use metalith::calibrate::CalibratedModel;
use metalith::cell::{CellStack, FittedCell, PointwiseCell, PublishedCell};
use metalith::gds::{LayerNumber, ReadLimits};
use metalith::report::{count, sig};
use metalith::verify::{Lighting, lone_psfs, write_lone_report};
use metalith::{Accuracy, CellModel, Extraction, ExtractionPlan, Layout, Result, extract};

use super::verify::FidelityArg;
use super::{Outcome, Terminal, print_line};

/// Find the elements of any GDSII layout, read their pillars, and simulate their PSFs.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith psf lens.gds --layer 1/0 --distance-um 2400 --wavelength-nm 530 --out out/lens\n\n\
    Light comes along the chip's normal unless --angle-x-deg, --angle-y-deg say otherwise; the window is about the\n\
    element's axis unless --at-x-um, --at-y-um do. A steered element sends light along the normal far off its axis."
)]
pub struct PsfArgs {
    /// The layout, by whatever program it was written.
    layout: PathBuf,

    /// Layer and datatype of the pillars.
    #[arg(long, default_value = "1/0", value_parser = layer)]
    layer: LayerNumber,

    /// Cell to start from; the top cell if there is one only.
    #[arg(long)]
    top: Option<String>,

    /// From the pillar tops to the sensor [um].
    #[arg(long, default_value_t = 2400.0)]
    distance_um: f64,

    /// Wavelength [nm]; may be given several times.
    #[arg(long = "wavelength-nm", default_values_t = [455.0, 530.0, 660.0])]
    wavelengths_nm: Vec<f64>,

    /// Angle of incidence in the x-z plane, in air [degrees].
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    angle_x_deg: f64,

    /// Angle of incidence in the y-z plane, in air [degrees].
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    angle_y_deg: f64,

    /// Middle of the window from the element's axis [um].
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    at_x_um: f64,

    /// Middle of the window from the element's axis [um].
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    at_y_um: f64,

    /// Samples an axis, one pitch apart.
    #[arg(long, default_value_t = 256)]
    samples: usize,

    /// Height of the pillars [nm], for the rigorous cell.
    #[arg(long, default_value_t = 700.0)]
    height_nm: f64,

    /// The cell.
    #[arg(long, value_enum, default_value = "rigorous")]
    fidelity: FidelityArg,

    /// Pillars as a measured line makes them: the `model.toml` that `metalith calibrate` wrote.
    #[arg(long, value_name = "MODEL", conflicts_with = "fidelity")]
    model: Option<PathBuf>,

    /// Solve the cell at the angle of incidence, for both polarisations, instead of along the normal.
    #[arg(long)]
    as_lit: bool,

    /// Simulate with errors of 1e-3 instead of 1e-5 of the peak, several times faster.
    #[arg(long)]
    fast: bool,

    /// Only read the pillars; simulate nothing.
    #[arg(long)]
    extract_only: bool,

    /// Folder for a report and the PSFs as NPY.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Print all numbers as JSON.
    #[arg(long)]
    json: bool,
}

/// `1/0` as layer 1, datatype 0.
fn layer(text: &str) -> std::result::Result<LayerNumber, String> {
    let (layer, datatype) = text.split_once('/').unwrap_or((text, "0"));
    match (layer.parse(), datatype.parse()) {
        (Ok(layer), Ok(datatype)) => Ok(LayerNumber::new(layer, datatype)),
        _ => Err("write layer and datatype as 1/0".into()),
    }
}

impl PsfArgs {
    /// The cell of the layout's own pitch, materials of the paper.
    fn cell(&self, found: &Extraction, model: Option<&CalibratedModel>) -> Result<Box<dyn CellModel>> {
        let pitch_nm = found.elements.first().map_or(350, |e| e.site.lattice.pitch_nm());
        if model.is_none() && matches!(self.fidelity, FidelityArg::Published) {
            return Ok(Box::new(PublishedCell::new(pitch_nm)));
        }
        let stack = CellStack::paper(f64::from(pitch_nm), self.height_nm)?;
        let mut widths = found
            .elements
            .iter()
            .flat_map(|e| e.widths.width_nm.iter().copied())
            .collect::<Vec<_>>();
        widths.sort_unstable();
        widths.dedup();
        if let Some(model) = model {
            let filled = found.elements.iter().map(|e| e.widths.filled_sites()).sum::<f64>();
            let fill = filled / found.pillars.max(1) as f64;
            return Ok(Box::new(model.cell_of(&stack, widths, fill)));
        }
        if matches!(self.fidelity, FidelityArg::Fitted) {
            let band_um = self.wavelengths_nm.iter().map(|nm| nm * 1e-3);
            let (low, high) = band_um.fold((0.4, 0.7), |(a, b), um| (um.min(a), um.max(b)));
            let range = (
                *widths.iter().find(|w| **w > 0).unwrap_or(&100),
                *widths.last().unwrap_or(&300),
            );
            return Ok(Box::new(FittedCell::of_stack(&stack, (low, high), range)?));
        }
        Ok(Box::new(PointwiseCell::new(stack, widths)))
    }

    fn lighting(&self, model: Option<&CalibratedModel>) -> Lighting {
        let path = model.map(|m| &m.departure.path);
        let tilt_mrad = path.map_or([0.0; 2], |p| p.tilt_mrad);
        let sine = |deg: f64, mrad: f64| (deg.to_radians() + mrad * 1e-3).sin();
        Lighting {
            wavelengths_um: self.wavelengths_nm.iter().map(|nm| nm * 1e-3).collect(),
            incidence_sin: [
                sine(self.angle_x_deg, tilt_mrad[0]),
                sine(self.angle_y_deg, tilt_mrad[1]),
            ],
            cells_as_lit: self.as_lit,
            distance_um: self.distance_um + path.map_or(0.0, |p| p.gap_um),
            at_um: [self.at_x_um, self.at_y_um],
            samples: self.samples,
            pixel_um: 5.86,
            accuracy: if self.fast { Accuracy::Fast } else { Accuracy::Accurate },
        }
    }
}

pub fn run(args: &PsfArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let layout = Layout::open_with(&args.layout, ReadLimits::default(), terminal)?;
    let plan = ExtractionPlan {
        top: args.top.clone(),
        ..ExtractionPlan::discover(args.layer)
    };
    let found = extract(&layout, &plan, terminal)?;
    let psfs = if args.extract_only {
        Vec::new()
    } else {
        let model = args.model.as_deref().map(CalibratedModel::read).transpose()?;
        let cell = args.cell(&found, model.as_ref())?;
        lone_psfs(&found, cell.as_ref(), &args.lighting(model.as_ref()), terminal)?
    };
    if let Some(folder) = &args.out {
        let name = args
            .layout
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        write_lone_report(&name, &found, &psfs, folder)?;
    }
    terminal.clear();
    if args.json {
        let elements = found.elements.iter().map(|e| {
            serde_json::json!({
                "name": e.site.name,
                "centre_nm": e.site.centre_nm,
                "pitch_nm": e.site.lattice.pitch_nm(),
                "sites": e.site.lattice.sites(),
                "pillars": e.widths.pillars(),
            })
        });
        let json = serde_json::json!({
            "pillars": found.pillars,
            "elements": elements.collect::<Vec<_>>(),
            "other_shapes": found.oddities,
            "psfs": psfs,
        });
        print_line!("{json:#}");
        return Ok(Outcome::Fine);
    }
    for element in &found.elements {
        let (site, lattice) = (&element.site, element.site.lattice);
        print_line!(
            "{} at ({}, {}) um: {} pillars on {} x {} sites of {} nm",
            site.name,
            sig(site.centre_nm[0] as f64 * 1e-3, 8),
            sig(site.centre_nm[1] as f64 * 1e-3, 8),
            count(element.widths.pillars()),
            lattice.sites(),
            lattice.sites(),
            lattice.pitch_nm(),
        );
    }
    print_line!("{} other shapes on layer {}", count(found.oddities.total()), args.layer);
    for psf in &psfs {
        print_line!(
            "{}, {} nm: Strehl {}, {} % in a pixel of 5.86 um, peak at ({}, {}) um",
            psf.element,
            sig(psf.wavelength_um * 1e3, 4),
            sig(psf.measures.strehl, 3),
            sig(psf.measures.energy_1_pixel * 100.0, 3),
            sig(psf.measures.peak_um[0], 5),
            sig(psf.measures.peak_um[1], 5),
        );
    }
    if let Some(folder) = &args.out {
        print_line!("report: {}", folder.join("report.html").display());
    }
    Ok(Outcome::Fine)
}
