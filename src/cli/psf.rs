//! `metalith psf`: what a layout from anywhere does to light.

use std::path::PathBuf;

use clap::Args;
use metalith::report::{count, sig};
use metalith::{
    Accuracy, CellModel, CellStack, Extraction, ExtractionPlan, LayerNumber, Layout, Lighting, Material, PointwiseCell,
    PublishedCell, ReadLimits, Result, extract, lone_psfs, write_lone_report,
};

use super::verify::FidelityArg;
use super::{Outcome, Terminal};

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
    fn cell(&self, found: &Extraction) -> Result<Box<dyn CellModel>> {
        let pitch_nm = found.elements.first().map_or(350, |e| e.site.lattice.pitch_nm());
        if matches!(self.fidelity, FidelityArg::Published) {
            return Ok(Box::new(PublishedCell::new(pitch_nm)));
        }
        let stack = CellStack {
            pitch_nm: f64::from(pitch_nm),
            height_nm: self.height_nm,
            film: Material::named("sin_luke_2015")?,
            substrate: Material::named("fused_silica_malitson_1965")?,
            ambient: Material::named("air")?,
            taper: 0.0,
            corner_radius_nm: 0.0,
            mask_height_nm: 0.0,
            mask: Material::named("alumina_zhukovsky_2015")?,
        };
        let mut widths = found
            .elements
            .iter()
            .flat_map(|e| e.widths.width_nm.iter().copied())
            .collect::<Vec<_>>();
        widths.sort_unstable();
        widths.dedup();
        Ok(Box::new(PointwiseCell::new(stack, widths)))
    }

    fn lighting(&self) -> Lighting {
        Lighting {
            wavelengths_um: self.wavelengths_nm.iter().map(|nm| nm * 1e-3).collect(),
            incidence_sin: [self.angle_x_deg, self.angle_y_deg].map(|deg| deg.to_radians().sin()),
            distance_um: self.distance_um,
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
        lone_psfs(&found, args.cell(&found)?.as_ref(), &args.lighting(), terminal)?
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
        println!("{json:#}");
        return Ok(Outcome::Fine);
    }
    for element in &found.elements {
        let (site, lattice) = (&element.site, element.site.lattice);
        println!(
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
    println!("{} other shapes on layer {}", count(found.oddities.total()), args.layer);
    for psf in &psfs {
        println!(
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
        println!("report: {}", folder.join("report.html").display());
    }
    Ok(Outcome::Fine)
}
