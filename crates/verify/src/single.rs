//! PSFs of a single layout from anywhere, without a design.

use std::collections::BTreeMap;
use std::path::Path;

use ndarray::Array2;
use npyz::WriterBuilder;
use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use super::lens_figures::{focus_cells, focus_columns};
use super::lens_outline::outline_warnings;
use super::polychromatic::CameraStatement;
use super::single_memory::FocusRequest;
use super::single_stack::write_stacks;
use super::single_white::SingleWhite;
use super::{model_page, polychromatic_page, through_focus};
use metalith_cell::{Fidelity, Illumination, PolarisedLight};
use metalith_core::{AtomicFile, Error, Progress, Result, Steps};
use metalith_gds::extract::LeftOut;
use metalith_gds::extract::{ElementSite, Extraction};
use metalith_optics::{CaseOptics, ElementOptics, ModelStatement, Placement, SimulationCase};
use metalith_pillars::{LatticeKind, PillarMap};
use metalith_report::{Cell, Column, ImageGrid, Page, PillarZoom, Table, count, sig, write_json};
use metalith_wave::psf::{IdealPsf, PixelFrequencies, Psf, PsfMetrics, ThroughFocus};
use metalith_wave::{Accuracy, Pillars, Scratch, Window};

/// Lighting: the light, and the place on the sensor.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Wavelengths (um).
    pub wavelengths_um: Vec<f64>,
    /// Direction sines of the incident light, in air.
    pub incidence_sin: [f64; 2],
    /// True if cells are solved at that angle, for both polarisations; false for along the normal.
    pub oblique_cells: bool,
    /// Distance from the pillar tops to the sensor (um).
    pub distance_um: f64,
    /// Middle of the window, from the axis of an element (um).
    pub at_um: [f64; 2],
    /// Samples an axis, one pitch apart.
    pub samples: usize,
    /// Edge of a sensor pixel (um).
    pub pixel_um: f64,
    /// Polarisation of source and detector, where pillars change it.
    pub polarised: PolarisedLight,
    /// Radius of the openings in the metal (um); that of the circle around the pillars if none is given. It counts
    /// where a model has them off their place.
    pub aperture_radius_um: Option<f64>,
    pub accuracy: Accuracy,
    /// Planes along z besides the plane of the sensor; none if not asked for.
    pub through_focus: Option<FocusRequest>,
}

/// The PSF of one element of a layout at one wavelength.
#[derive(Clone, Debug, Serialize)]
pub struct SinglePsf {
    /// Name of the element: of several with the same pillars, the first.
    pub element: String,
    pub wavelength_um: f64,
    pub fidelity: Fidelity,
    #[serde(flatten)]
    pub metrics: PsfMetrics,
    /// Planes along z, if asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub through_focus: Option<ThroughFocus>,
    #[serde(skip)]
    pub psf: Psf,
}

/// Simulate every distinct element of a layout.
///
/// # Errors
/// If a cell has no answer at a wavelength, the window is none, or the user stopped it.
pub fn single_psfs(
    found: &Extraction,
    case: SimulationCase<'_>,
    light: &Lighting,
    progress: &dyn Progress,
) -> Result<Vec<SinglePsf>> {
    let elements = distinct(found);
    if let Some(request) = &light.through_focus {
        request.check(light.distance_um)?;
        for (um, (_, widths)) in light
            .wavelengths_um
            .iter()
            .flat_map(|um| elements.iter().map(move |e| (um, e)))
        {
            let samples = light.window(light.at_um, widths, *um).samples;
            request.check_samples(samples, samples / light.samples.max(1))?;
        }
    }
    light.check_held(&elements, &light.wavelengths_um, 1)?;
    let apertures: Vec<PillarMap> = elements.iter().map(|(_, widths)| whole_aperture(widths)).collect();
    let steps = Steps::begin(
        progress,
        "simulating elements",
        (elements.len() * light.wavelengths_um.len()) as u64,
    );
    let optics = case.optics(kind_of(&elements), largest_number(&elements));
    let read = elements.iter().map(|(site, widths)| light.read(&optics, site, widths));
    let read = read.collect::<Result<Vec<_>>>()?;
    let mut all = Vec::new();
    for &wavelength_um in &light.wavelengths_um {
        let lit = light.illumination(wavelength_um);
        let fields = read.iter().map(|element| element.in_light(&lit, &steps));
        let fields = fields.collect::<Result<Vec<_>>>()?;
        let full = case.full_transmission(wavelength_um)?;
        let focus = [light.at_um[0], light.at_um[1], light.distance_um];
        let psfs = fields.par_iter().zip(elements.par_iter().zip(&apertures)).map_init(
            Scratch::default,
            |scratch, (fields, ((site, widths), aperture))| {
                progress.check_stopped()?;
                let window = light.window(light.at_um, widths, wavelength_um);
                let psf = fields.psf(window, light.accuracy, &light.reported_lp_mm(), scratch)?;
                let matched = IdealPsf::of(&Pillars::new(aperture, &OPEN)?, focus, wavelength_um, full);
                let through = |request: &FocusRequest| -> Result<ThroughFocus> {
                    let planes = request.planes(wavelength_um, widths.circle_um(), light.distance_um);
                    let distances_um = planes.distances_um(light.distance_um);
                    let psfs = fields.psfs_at(window, &distances_um, light.accuracy, scratch)?;
                    let size_um = [widths.circle_um(), light.distance_um];
                    let series = ThroughFocus::of(psfs, &matched, wavelength_um, size_um);
                    // Planes of many elements do not fit into memory.
                    Ok(through_focus::shown(series))
                };
                let through_focus = light.through_focus.as_ref().map(through).transpose()?;
                steps.done();
                Ok(SinglePsf {
                    through_focus,
                    element: site.name.clone(),
                    wavelength_um,
                    fidelity: case.fidelity(),
                    metrics: psf.metrics(&matched, light.pixel_um),
                    psf,
                })
            },
        );
        all.extend(psfs.collect::<Result<Vec<_>>>()?);
    }
    Ok(all)
}

/// The kind of lattice that the elements of a layout stand on.
pub(super) fn kind_of(elements: &[(&ElementSite, &PillarMap)]) -> LatticeKind {
    elements.first().map_or(LatticeKind::Square, |(_, w)| w.lattice.kind())
}

/// Transmissions of the sites of [`whole_aperture`].
pub(super) const OPEN: [Complex64; 2] = [Complex64::ZERO, Complex64::ONE];

/// Sites that an ideal lens in the place of an element fills (1): those with a pillar, whatever it transmits, and holes, which have
/// pillars before and behind them in their row and in their column. A disc without holes is its own pillars.
pub(super) fn whole_aperture(widths: &PillarMap) -> PillarMap {
    let (lattice, n) = (widths.lattice, widths.lattice.sites());
    let none = (n, 0);
    let (mut rows, mut columns) = (vec![none; n], vec![none; n]);
    let widen = |ends: &mut (usize, usize), k: usize| *ends = (ends.0.min(k), ends.1.max(k));
    for ((iy, ix), _) in widths.number.indexed_iter().filter(|(_, number)| **number > 0) {
        widen(&mut rows[iy], ix);
        widen(&mut columns[ix], iy);
    }
    let within = |(first, last): (usize, usize), k: usize| (first..=last).contains(&k);
    let mut whole = PillarMap::empty(lattice);
    for ((iy, ix), number) in whole.number.indexed_iter_mut() {
        let is_inside = within(rows[iy], ix) && within(columns[ix], iy) && lattice.has(ix, iy);
        *number = u16::from(is_inside);
    }
    whole
}

pub(super) fn largest_number(elements: &[(&ElementSite, &PillarMap)]) -> u16 {
    let all = elements.iter().flat_map(|(_, w)| w.number.iter().copied());
    all.max().unwrap_or(0)
}

impl Lighting {
    /// The light at a wavelength (um).
    pub(super) fn illumination(&self, wavelength_um: f64) -> Illumination<'static> {
        let light = Illumination {
            polarised: self.polarised,
            ..Illumination::from_direction(wavelength_um, self.incidence_sin)
        };
        if self.oblique_cells { light.oblique() } else { light }
    }

    /// An element as read.
    pub(super) fn read<'r>(
        &self,
        optics: &'r CaseOptics<'_>,
        site: &ElementSite,
        widths: &'r PillarMap,
    ) -> Result<Box<dyn ElementOptics + 'r>> {
        let placement = Placement {
            radius_um: widths.circle_um(),
            aperture_radius_um: self.aperture_radius_um.unwrap_or_else(|| widths.circle_um()),
            centre_um: site.centre_nm.map(|c| c as f64 * 1e-3),
        };
        optics.element(widths, &placement)
    }

    /// Frequencies at which contrast is reported (line pairs a millimetre).
    fn reported_lp_mm(&self) -> [f64; 2] {
        PixelFrequencies::of(self.pixel_um).reported()
    }

    /// The window of a PSF of an element about a place (um).
    pub(super) fn window(&self, at_um: [f64; 2], widths: &PillarMap, wavelength_um: f64) -> Window {
        let pitches = (widths.lattice.pitch_um(), self.samples);
        Window::of_psf(at_um, pitches, (widths.circle_um(), self.distance_um), wavelength_um)
    }
}

/// Elements whose pillars differ from those of all before them.
pub(super) fn distinct(found: &Extraction) -> Vec<(&ElementSite, &PillarMap)> {
    let mut kept: Vec<(&ElementSite, &PillarMap)> = Vec::new();
    for element in &found.elements {
        if kept.iter().all(|(_, widths)| **widths != element.widths) {
            kept.push((&element.site, &element.widths));
        }
    }
    kept
}

/// Report of the PSFs of one layout.
pub struct SinglePsfReport<'a> {
    /// Name of the layout file.
    pub file: &'a str,
    pub found: &'a Extraction,
    /// Shapes of elements that are no pillars, if there are any.
    pub left_out: Option<&'a LeftOut>,
    pub psfs: &'a [SinglePsf],
    /// Assumptions that no layout states, each with its value.
    pub assumptions: &'a [(&'static str, String)],
    /// Model that chips were made by, if any.
    pub model: Option<&'a ModelStatement>,
    /// White light for a camera, if one was named.
    pub white: Option<&'a (CameraStatement, Vec<SingleWhite>)>,
}

/// Reference of Strehl ratios of a layout without a design, in words for people.
pub const STREHL_AGAINST: &str = "Strehl ratios are against the sites that hold a pillar and the holes among them: a hole lowers the \
     Strehl ratio. `run` and `verify` divide by the aperture of the design.";

/// Write `report.html`, `report.json` and each PSF as an NPY array (float64, rows along +y) into a folder, and all
/// of them as NetCDF.
///
/// # Errors
/// If a file cannot be written.
pub fn write_single_psf_report(report: &SinglePsfReport<'_>, folder: &Path) -> Result<()> {
    let SinglePsfReport {
        file,
        found,
        left_out,
        psfs,
        assumptions,
        model,
        white,
    } = *report;
    let elements = distinct(found);
    let is_simulated = !psfs.is_empty();
    let mut page = Page::new(
        format!("{} of {file}", if is_simulated { "PSFs" } else { "Pillars" }),
        "a layout without a design, computed from the bytes of its file",
    );
    if let Some(left_out) = left_out {
        page.paragraph(&left_out.words);
    }
    for warning in outline_warnings(found) {
        page.paragraph(&warning);
    }
    page.facts(&[
        ("Pillars", format!("{} {}", count(found.pillars), found.shape.plural())),
        ("Elements", found.elements.len().to_string()),
        ("Distinct elements", elements.len().to_string()),
        ("Other shapes on the pillar layer", count(found.oddities.total())),
    ]);
    if let Some(model) = model {
        model_page::write(&mut page, model);
    }
    let mut table = Table::new(
        [
            Column::text("Element"),
            Column::number("Wavelength", "nm"),
            Column::number("Strehl ratio", ""),
        ]
        .into_iter()
        .chain(focus_columns())
        .chain([
            Column::number("Energy in 1 pixel", "%"),
            Column::number("in 2", "%"),
            Column::number("Peak x", "um"),
            Column::number("y", "um"),
        ]),
    );
    let mut images = ImageGrid::new("PSFs", 4).values("|E|² / |E inc|²", "").log(4.0);
    for (k, found) in psfs.iter().enumerate() {
        let m = &found.metrics;
        table.row(
            [
                Cell::from(found.element.as_str()),
                Cell::sig(found.wavelength_um * 1e3, 5),
                Cell::sig(m.strehl, 3),
            ]
            .into_iter()
            .chain(focus_cells(m.focusing_efficiency, m.fwhm_um))
            .chain([
                Cell::fixed(m.energy_1_pixel * 100.0, 2),
                Cell::fixed(m.energy_2_pixels * 100.0, 2),
                Cell::fixed(m.peak_um[0], 2),
                Cell::fixed(m.peak_um[1], 2),
            ]),
        );
        let nm = sig(found.wavelength_um * 1e3, 4);
        images = images.pixel_um(found.psf.window.step_um);
        images.image(format!("{}, {nm} nm", found.element), found.psf.values.clone());
        write_npy(&folder.join(format!("psf_{k}_{nm}nm.npy")), &found.psf.values)?;
    }
    write_stacks(psfs, assumptions, folder)?;
    page.section("Pillars");
    let zooms = elements.iter().take(4).map(|(site, widths)| {
        PillarZoom::new(format!("Middle of {}", site.name), widths, (0.0, 0.0), 10.0)
            .shape(found.shape)
            .caption("Pillars as read, to scale.")
    });
    page.row(zooms);
    if is_simulated {
        page.section("PSFs");
        page.row([images.caption("Whole window, four decades.")]);
    }
    let name = |found: &SinglePsf| format!("{}, {} nm", found.element, sig(found.wavelength_um * 1e3, 4));
    let series = || {
        psfs.iter()
            .filter_map(|psf| Some((name(psf), psf.through_focus.as_ref()?)))
    };
    for (name, series) in series() {
        page.row([through_focus::row(&name, series)]);
    }
    if is_simulated {
        page.table(table.caption(STREHL_AGAINST));
    }
    if series().next().is_some() {
        page.table(through_focus::table("Element, wavelength", series()));
    }
    if let Some((camera, elements)) = white {
        page.section("Polychromatic figures");
        for element in elements {
            page.subsection(&element.element);
            polychromatic_page::channels(&mut page, camera, &element.channels, &[]);
        }
    }
    page.section("Assumptions");
    page.details("Quantities that no layout states", |page| {
        page.paragraph(
            "A layout contains shapes only. The other quantities are options of the command, or their defaults:",
        );
        let mut assumed = Table::new([Column::text("Quantity"), Column::text("Value")]);
        for (what, value) in assumptions {
            assumed.row([Cell::from(*what), Cell::from(value.as_str())]);
        }
        page.table(assumed);
    });
    write_json(
        &folder.join("report.json"),
        "psf",
        &Numbers {
            psfs,
            assumptions: assumptions
                .iter()
                .map(|(what, value)| (*what, value.as_str()))
                .collect(),
            oddities: &found.oddities,
            model,
            camera: white.map(|w| &w.0),
            white: white.map(|w| w.1.as_slice()),
        },
    )?;
    page.write(&folder.join("report.html"))
}

#[derive(Serialize)]
struct Numbers<'a> {
    psfs: &'a [SinglePsf],
    assumptions: BTreeMap<&'a str, &'a str>,
    oddities: &'a metalith_gds::extract::UnrecognisedShapes,
    #[serde(skip_serializing_if = "Option::is_none")]
    model: Option<&'a ModelStatement>,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera: Option<&'a CameraStatement>,
    #[serde(skip_serializing_if = "Option::is_none")]
    white: Option<&'a [SingleWhite]>,
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
    AtomicFile::write(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_pillars::Lattice;

    /// A disc is its own aperture on both lattices, and holes of any size inside of it are part of it.
    #[test]
    fn holes_are_part_of_the_aperture() {
        for kind in [LatticeKind::Square, LatticeKind::Hexagonal] {
            let lattice = Lattice::of_kind(kind, 400, 61).unwrap();
            let sites = (0..61 * 61)
                .map(|k| (k % 61, k / 61))
                .filter(|(x, y)| lattice.has(*x, *y));
            let mut disc = PillarMap::empty(lattice);
            for (ix, iy) in sites.filter(|(x, y)| lattice.radius2_nm2(*x, *y) < 5_000.0f64.powi(2)) {
                disc.number[[iy, ix]] = 120;
            }
            let filled = disc.number.mapv(|number| u16::from(number > 0));
            assert_eq!(whole_aperture(&disc).number, filled);
            let mut holed = disc.clone();
            let middle = lattice.sites() / 2;
            for (_, number) in holed.number.indexed_iter_mut().filter(|((iy, ix), _)| {
                let apart = [ix.abs_diff(middle), iy.abs_diff(middle)];
                apart[0] < 6 && apart[1] < 4 || (ix + 3 * iy) % 7 == 0 && apart[0] < 8 && apart[1] < 8
            }) {
                *number = 0;
            }
            assert!(holed.pillars() < disc.pillars());
            assert_eq!(whole_aperture(&holed).number, filled);
        }
    }
}
