//! A layout from anywhere, without a design: what its pillars do to light.

use std::io::Write;
use std::path::Path;

use ndarray::Array2;
use npyz::WriterBuilder;
use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use super::premise::Cells;
use metalith_cell::{CellModel, Fidelity};
use metalith_core::{Error, Progress, Result, Silent, WholeFile, WidthMap};
use metalith_gds::extract::{ElementSite, Extraction};
use metalith_report::{Cell, Column, ImageGrid, Page, PillarZoom, Table, count, sig, write_json};
use metalith_wave::{
    Accuracy, Aperture, Fold, Matched, Pillars, PlaneWave, Propagator, Psf, PsfMetrics, Scratch, Window,
};

/// In what light, and where on the sensor.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Wavelengths [um].
    pub wavelengths_um: Vec<f64>,
    /// Direction sines of the incident light, in air.
    pub incidence_sin: [f64; 2],
    /// Whether cells are solved at that angle, for both polarisations, or along the normal.
    pub cells_as_lit: bool,
    /// From the pillar tops to the sensor [um].
    pub distance_um: f64,
    /// Middle of the window, from the axis of an element [um].
    pub at_um: [f64; 2],
    /// Samples an axis, one pitch apart.
    pub samples: usize,
    /// Edge of a sensor pixel [um].
    pub pixel_um: f64,
    pub accuracy: Accuracy,
}

/// The PSF of one element at one wavelength.
#[derive(Clone, Debug, Serialize)]
pub struct LonePsf {
    /// Name of the element: of several with the same pillars, the first.
    pub element: String,
    pub wavelength_um: f64,
    pub fidelity: Fidelity,
    #[serde(flatten)]
    pub measures: PsfMetrics,
    #[serde(skip)]
    pub psf: Psf,
}

/// Simulate every distinct element of a layout.
///
/// # Errors
/// If the cell has no answer at a wavelength, the window is none, or the user stopped it.
pub fn lone_psfs(
    found: &Extraction,
    cell: &dyn CellModel,
    light: &Lighting,
    progress: &dyn Progress,
) -> Result<Vec<LonePsf>> {
    let elements = distinct(found);
    progress.begin(
        "simulating elements",
        (elements.len() * light.wavelengths_um.len()) as u64,
    );
    let widest = elements
        .iter()
        .flat_map(|(_, w)| w.width_nm.iter().copied())
        .max()
        .unwrap_or(0);
    let mut all = Vec::new();
    for &wavelength_um in &light.wavelengths_um {
        let mut cells = Cells::new(cell, wavelength_um, widest)?;
        let wave = light.wave(wavelength_um);
        if light.cells_as_lit {
            cells.look_along(cell, &[wave], widest, &Silent)?;
        }
        let full = cells.full;
        let simulated = elements
            .par_iter()
            .map_init(Scratch::default, |scratch, (site, widths)| {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let mut of = |table: &Vec<Complex64>| light.psf(&Pillars::new(widths, table)?, &wave, scratch);
                let psf = Psf::mean(cells.tables(&wave).iter().map(&mut of).collect::<Result<_>>()?);
                let aperture = Pillars::new(widths, &cells.normal)?;
                let focus = [light.at_um[0], light.at_um[1], light.distance_um];
                let matched = Matched::of(&aperture, focus, wavelength_um, full);
                progress.advance(1);
                Ok(LonePsf {
                    element: site.name.clone(),
                    wavelength_um,
                    fidelity: cell.fidelity(),
                    measures: psf.metrics(&matched, light.pixel_um),
                    psf,
                })
            })
            .collect::<Result<Vec<_>>>()?;
        all.extend(simulated);
    }
    Ok(all)
}

impl Lighting {
    fn wave(&self, wavelength_um: f64) -> PlaneWave {
        PlaneWave {
            wavelength_um,
            sin_x: self.incidence_sin[0],
            sin_y: self.incidence_sin[1],
        }
    }

    fn psf(&self, aperture: &Pillars<'_>, wave: &PlaneWave, scratch: &mut Scratch) -> Result<Psf> {
        let lattice = aperture.lattice();
        let window = Window::about(self.at_um, lattice.pitch_um(), self.samples, self.distance_um);
        let fold = Fold::plan(lattice, aperture.radius_um(), wave.wavelength_um, window, self.accuracy)?;
        Ok(Psf::of(&fold.field(aperture, wave, scratch)?))
    }
}

/// Elements whose pillars differ from those of all before them.
fn distinct(found: &Extraction) -> Vec<(&ElementSite, &WidthMap)> {
    let mut kept: Vec<(&ElementSite, &WidthMap)> = Vec::new();
    for element in &found.elements {
        if kept.iter().all(|(_, widths)| **widths != element.widths) {
            kept.push((&element.site, &element.widths));
        }
    }
    kept
}

/// Write `report.html`, `report.json` and each PSF as an NPY array (float64, rows along +y) into a folder.
///
/// # Errors
/// If a file cannot be written.
pub fn write_lone_report(file: &str, found: &Extraction, psfs: &[LonePsf], folder: &Path) -> Result<()> {
    let elements = distinct(found);
    let mut page = Page::new(
        format!("PSFs of {file}"),
        "a layout without a design, computed from its bytes",
    );
    page.facts(&[
        ("Pillars", count(found.pillars)),
        ("Elements", found.elements.len().to_string()),
        ("of them distinct", elements.len().to_string()),
        ("Other shapes on the pillar layer", count(found.oddities.total())),
    ]);
    let mut table = Table::new([
        Column::text("Element"),
        Column::number("Wavelength", "nm"),
        Column::number("Strehl", ""),
        Column::number("Energy in 1 pixel", "%"),
        Column::number("in 2", "%"),
        Column::number("Peak x", "um"),
        Column::number("y", "um"),
    ]);
    let mut images = ImageGrid::new("PSFs", 4).values("|E|² / |E inc|²", "").log(4.0);
    for (k, found) in psfs.iter().enumerate() {
        let m = &found.measures;
        table.row([
            Cell::from(found.element.as_str()),
            Cell::sig(found.wavelength_um * 1e3, 5),
            Cell::sig(m.strehl, 3),
            Cell::fixed(m.energy_1_pixel * 100.0, 2),
            Cell::fixed(m.energy_2_pixels * 100.0, 2),
            Cell::fixed(m.peak_um[0], 2),
            Cell::fixed(m.peak_um[1], 2),
        ]);
        let nm = sig(found.wavelength_um * 1e3, 4);
        images = images.pixel_um(found.psf.window.step_um);
        images.image(format!("{}, {nm} nm", found.element), found.psf.values.clone());
        write_npy(&folder.join(format!("psf_{k}_{nm}nm.npy")), &found.psf.values)?;
    }
    page.section("PSFs");
    page.table(table);
    page.figure(images.caption("The whole window, four decades."));
    page.section("Pillars");
    let zooms = elements.iter().take(4).map(|(site, widths)| {
        PillarZoom::new(format!("Middle of {}", site.name), widths, (0.0, 0.0), 10.0).caption("As read, to scale.")
    });
    page.row(zooms);
    write_json(
        &folder.join("report.json"),
        "psf",
        &Numbers {
            psfs,
            oddities: &found.oddities,
        },
    )?;
    page.write(&folder.join("report.html"))
}

#[derive(Serialize)]
struct Numbers<'a> {
    psfs: &'a [LonePsf],
    oddities: &'a metalith_gds::extract::Oddities,
}

fn write_npy(path: &Path, values: &Array2<f64>) -> Result<()> {
    let mut bytes = Vec::new();
    let shape = [values.nrows() as u64, values.ncols() as u64];
    let fill = |bytes: &mut Vec<u8>| -> std::io::Result<()> {
        let mut npy = npyz::WriteOptions::new()
            .default_dtype()
            .shape(&shape)
            .writer(bytes)
            .begin_nd()?;
        npy.extend(values.iter().copied())?;
        npy.finish()
    };
    fill(&mut bytes).map_err(Error::io("encode", path))?;
    let mut file = WholeFile::create(path)?;
    file.write_all(&bytes).map_err(Error::io("write", path))?;
    file.commit()
}
