//! PSFs of arrays and of maps of widths.

use std::path::PathBuf;

use metalith::cell::{FocusingStack, PolarisedLight, cache_folder};
use metalith::extract::{ElementSite, ExtractedElement, Extraction};
use metalith::verify::{FocusRequest, Lighting, SimulationCase, SinglePsf, single_psfs};
use metalith::wave::propagation::{incident, landing_um};
use metalith::wave::psf::{FocusPlane, ThroughFocus};
use metalith::{
    Accuracy, AsBuiltChip, Error, PillarMap, PillarRows as _, PillarShape, Progress, Result, Wedge, cell_models,
};
use numpy::ndarray::{Axis, stack as stack_arrays};
use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Array, given, no_wedge, width_map};
use crate::checks::json;
use crate::lattices::{kind_of, stack_on};
use crate::light::stack;
use crate::shapes::{ToldShape, shape_of};
use crate::wanted::{Wanted, cell_of, focused, polarised, refuse};
use crate::work::{error, work};

/// Edge of a sensor pixel where neither a design nor the caller says (um).
const PIXEL_UM: f64 = 5.86;

/// Edges of pixels that are taken (um), as by the program.
const PIXELS_UM: std::ops::RangeInclusive<f64> = 0.1..=100.0;

/// Diameters of openings that are taken (um), as by the program.
const APERTURES_UM: std::ops::RangeInclusive<f64> = 0.1..=1e5;

/// Distances to the sensor that are taken (um): beyond them no light is resolved in double precision.
const DISTANCES_UM: std::ops::RangeInclusive<f64> = 1e-3..=1e9;

/// Succeeds if a length that is given lies within a range (um).
fn within(what: &str, um: Option<f64>, range: &std::ops::RangeInclusive<f64>) -> Result<()> {
    match um.filter(|um| !range.contains(um)) {
        Some(um) => Err(Error::refused(
            "option/out-of-range",
            format!("{what} = {um}"),
            format!(
                "give a number from {} to {}, in micrometres",
                range.start(),
                range.end()
            ),
        )),
        None => Ok(()),
    }
}

/// An element to simulate.
struct Lit {
    name: String,
    /// Place on the chip (nm).
    centre_nm: [i64; 2],
    /// Radius of the opening in the metal around it (um); that of the circle around the pillars if none is given.
    aperture_radius_um: Option<f64>,
    shape: PillarShape,
    widths: PillarMap,
    wedge: Wedge,
    /// Distance from the pillars to the plane that is viewed (um).
    distance_um: f64,
}

impl Lit {
    /// Properties that elements simulated together share; `by_place` where the result for one depends on its place.
    fn like(&self, by_place: bool) -> (Wedge, f64, Option<f64>, Option<[i64; 2]>) {
        let place = by_place.then_some(self.centre_nm);
        (self.wedge, self.distance_um, self.aperture_radius_um, place)
    }
}

/// Light in which elements are viewed.
struct Looked {
    wavelengths_nm: Vec<f64>,
    fields_deg: Vec<(f64, f64)>,
    samples: usize,
    pixel_um: f64,
    /// Polarisation of source and detector, where pillars change it.
    polarised: PolarisedLight,
    fast: bool,
    through_focus: Option<FocusRequest>,
}

/// Range (um) and number of planes along z, if asked for.
type Planes = Option<(Option<f64>, usize)>;

fn request(planes: Planes) -> Option<FocusRequest> {
    planes.map(|(range_um, planes)| FocusRequest { range_um, planes })
}

/// One PSF with where it is from.
struct Found {
    field_deg: (f64, f64),
    incidence_sin: [f64; 2],
    /// Edge of the pixel that figures are of (um).
    pixel_um: f64,
    psf: SinglePsf,
}

/// All elements, each in every light. Those that look the same way are simulated together: their cells are solved once, and
/// of those with the same pillars one is.
fn simulate(
    elements: Vec<Lit>,
    case: SimulationCase<'_>,
    light: &Looked,
    progress: &dyn Progress,
) -> Result<Vec<Found>> {
    let by_place = case.perturbation().depends_on_place();
    let mut found: Vec<(usize, Vec<Found>)> = Vec::new();
    let mut waiting: Vec<(usize, Lit)> = elements.into_iter().enumerate().collect();
    while let Some((_, first)) = waiting.first() {
        let like = first.like(by_place);
        let (together, others) = waiting.into_iter().partition(|(_, lit)| lit.like(by_place) == like);
        waiting = others;
        found.extend(simulate_together(together, case, light, progress)?);
    }
    found.sort_by_key(|(k, _)| *k);
    Ok(found.into_iter().flat_map(|(_, own)| own).collect())
}

/// Elements that look the same way, by their numbers; at least one.
fn simulate_together(
    elements: Vec<(usize, Lit)>,
    case: SimulationCase<'_>,
    light: &Looked,
    progress: &dyn Progress,
) -> Result<Vec<(usize, Vec<Found>)>> {
    let first = &elements[0].1;
    let (wedge, distance_um, shape) = (first.wedge, first.distance_um, first.shape);
    let aperture_radius_um = first.aperture_radius_um;
    let mut found: Vec<(usize, Vec<Found>)> = elements.iter().map(|(k, _)| (*k, Vec::new())).collect();
    let named = elements.into_iter().map(|(_, lit)| ExtractedElement {
        site: ElementSite {
            name: lit.name,
            centre_nm: lit.centre_nm,
            lattice: lit.widths.lattice,
            within_nm: None,
        },
        widths: lit.widths,
    });
    let elements: Vec<ExtractedElement> = named.collect();
    // The simulation leaves out what is the same as one before.
    let like = |k: usize| {
        let of = &elements[k].widths;
        elements[..k].iter().position(|e| e.widths == *of).unwrap_or(k)
    };
    let like: Vec<usize> = (0..elements.len()).map(like).collect();
    let simulated: Vec<usize> = (0..elements.len()).filter(|k| like[*k] == *k).collect();
    let names: Vec<String> = elements.iter().map(|e| e.site.name.clone()).collect();
    let extraction = Extraction {
        top: String::new(),
        shape,
        pillars: elements.iter().map(|e| e.widths.pillars()).sum(),
        elements,
        turned_deg: None,
        oddities: Default::default(),
        survey: Default::default(),
    };
    for nm in &light.wavelengths_nm {
        for field_deg in &light.fields_deg {
            let um = nm * 1e-3;
            let field_rad = [field_deg.0, field_deg.1].map(f64::to_radians);
            let wave = incident(&wedge, um, field_rad)?;
            let lighting = Lighting {
                wavelengths_um: vec![um],
                incidence_sin: [wave.sin_x, wave.sin_y],
                oblique_cells: false,
                distance_um,
                at_um: landing_um(&wedge, &wave, distance_um)?,
                samples: light.samples,
                pixel_um: light.pixel_um,
                polarised: light.polarised,
                aperture_radius_um,
                accuracy: if light.fast { Accuracy::Fast } else { Accuracy::Accurate },
                through_focus: light.through_focus,
            };
            let psfs = single_psfs(&extraction, case, &lighting, progress)?;
            for (k, (_, own)) in found.iter_mut().enumerate() {
                let place = simulated.iter().position(|s| *s == like[k]);
                let psf = psfs[place.expect("what is like another is simulated")].clone();
                own.push(Found {
                    field_deg: *field_deg,
                    incidence_sin: lighting.incidence_sin,
                    pixel_um: light.pixel_um,
                    psf: SinglePsf {
                        element: names[k].clone(),
                        ..psf
                    },
                });
            }
        }
    }
    Ok(found)
}

/// PSFs for Python: a dictionary for each. With the statement of the model that they rest on, if any, as JSON.
type ToldPsfs<'py> = (Vec<Bound<'py, PyDict>>, Option<String>);

/// PSFs with what is simulated as fabricated, if anything.
fn told<'py>(py: Python<'py>, (found, made): (Vec<Found>, Option<AsBuiltChip>)) -> PyResult<ToldPsfs<'py>> {
    let one = |f: Found| {
        let dict = PyDict::new(py);
        let (m, window) = (f.psf.metrics, f.psf.psf.window);
        dict.set_item("element", f.psf.element)?;
        dict.set_item("wavelength_nm", f.psf.wavelength_um * 1e3)?;
        dict.set_item("field_deg", f.field_deg)?;
        dict.set_item("incidence_sin", (f.incidence_sin[0], f.incidence_sin[1]))?;
        let along = |axis: usize| (0..window.samples).map(move |i| window.coordinate_um(axis, i));
        dict.set_item("x_um", PyArray1::from_iter(py, along(0)))?;
        dict.set_item("y_um", PyArray1::from_iter(py, along(1)))?;
        dict.set_item("values", PyArray2::from_owned_array(py, f.psf.psf.values))?;
        dict.set_item("pixel_um", f.pixel_um)?;
        dict.set_item("strehl", m.strehl)?;
        dict.set_item("fwhm_um", (m.fwhm_um[0], m.fwhm_um[1]))?;
        dict.set_item("focusing_efficiency", m.focusing_efficiency)?;
        dict.set_item("peak_um", (m.peak_um[0], m.peak_um[1]))?;
        dict.set_item("centroid_um", (m.centroid_um[0], m.centroid_um[1]))?;
        dict.set_item("energy_1_pixel", m.energy_1_pixel)?;
        dict.set_item("energy_2_pixels", m.energy_2_pixels)?;
        dict.set_item("energy_passed", m.energy_passed)?;
        dict.set_item("mtf_half_nyquist", (m.mtf_half_nyquist[0], m.mtf_half_nyquist[1]))?;
        dict.set_item("mtf_nyquist", (m.mtf_nyquist[0], m.mtf_nyquist[1]))?;
        let series = f.psf.through_focus.map(|series| planes(py, series)).transpose()?;
        dict.set_item("through_focus", series)?;
        Ok(dict)
    };
    let psfs = found.into_iter().map(one).collect::<PyResult<_>>()?;
    Ok((psfs, made.map(|chip| json(&chip.statement()))))
}

/// A through-focus series for Python: arrays with an entry for each plane, NaN where there is no number.
fn planes(py: Python<'_>, series: ThroughFocus) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    let planes = &series.planes;
    let each = |of: &dyn Fn(&FocusPlane) -> f64| PyArray1::from_iter(py, planes.iter().map(of));
    let number = |number: Option<f64>| number.unwrap_or(f64::NAN);
    dict.set_item("focal_length_um", series.focal_length_um)?;
    dict.set_item("sensor_um", series.sensor_um)?;
    dict.set_item("depth_of_focus_um", series.depth_of_focus_um)?;
    dict.set_item("plane_spacing_um", series.plane_spacing_um)?;
    dict.set_item("distance_um", each(&|p| p.distance_um))?;
    dict.set_item("strehl", each(&|p| p.focus.strehl))?;
    dict.set_item("peak", each(&|p| p.peak))?;
    dict.set_item("fwhm_x_um", each(&|p| number(p.focus.fwhm_um[0])))?;
    dict.set_item("fwhm_y_um", each(&|p| number(p.focus.fwhm_um[1])))?;
    dict.set_item("focusing_efficiency", each(&|p| number(p.focus.focusing_efficiency)))?;
    let values: Vec<_> = series.psfs.iter().map(|psf| psf.values.view()).collect();
    let values = stack_arrays(Axis(0), &values).expect("windows of one size");
    dict.set_item("values", PyArray3::from_owned_array(py, values))?;
    Ok(dict)
}

/// PSFs of the distinct lenses of an array of a design, or of the elements that are named.
#[pyfunction]
#[pyo3(signature = (array, wavelengths_nm, fields_deg, fidelity, model, fast, samples, pixel_um, elements=None,
    through_focus=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn psf_of_array<'py>(
    py: Python<'py>,
    array: &Array,
    wavelengths_nm: Vec<f64>,
    fields_deg: Vec<(f64, f64)>,
    fidelity: Option<&str>,
    model: Option<PathBuf>,
    fast: bool,
    samples: Option<usize>,
    pixel_um: Option<f64>,
    elements: Option<Vec<usize>>,
    through_focus: Planes,
    progress: Option<Py<PyAny>>,
) -> PyResult<ToldPsfs<'py>> {
    let design = array.design.as_ref().ok_or_else(|| {
        error(Error::refused(
            "psf/no-sensor",
            "an array of widths says nothing of the sensor",
            "give `distance_um` and what pillars are made of",
        ))
    })?;
    let wanted = Wanted::of(fidelity, model.as_deref()).map_err(error)?;
    within("pixel_um", pixel_um, &PIXELS_UM).map_err(error)?;
    let placed = &array.array.placed;
    // Lenses with the same pillars may look at planes at other distances.
    let looks = |k: usize| (placed[k].class, design.lens_of(&placed[k].element).focal_length_um);
    let is_first = |k: &usize| (0..*k).all(|earlier| looks(earlier) != looks(*k));
    let chosen = elements.unwrap_or_else(|| (0..placed.len()).filter(is_first).collect());
    if let Some(wrong) = chosen.iter().find(|k| **k >= placed.len()) {
        return Err(error(Error::refused(
            "array/unknown-element",
            format!("there is no element {wrong}"),
            format!("this array has elements 0 to {}", placed.len() - 1),
        )));
    }
    let found = work(py, progress, |p| {
        let mut design = design.clone();
        // Tables span the wavelengths that a design names.
        design
            .verify
            .wavelengths_um
            .extend(wavelengths_nm.iter().map(|nm| nm * 1e-3));
        let (cells, made) = match &wanted {
            Wanted::Cell(fidelity) => (cell_models(&design, &[*fidelity])?, None),
            Wanted::Model(model) => {
                let chip = AsBuiltChip::in_light(&design.lit_stack()?, model)?.cached_in(cache_folder().as_deref());
                let classes = chosen.iter().map(|k| &array.array.classes[placed[*k].class]);
                chip.check_drawn(classes.map(|class| class.widths.histogram()))?;
                (Vec::new(), Some(chip))
            }
        };
        let lit = chosen.iter().map(|k| Lit {
            name: placed[*k].element.label(),
            centre_nm: placed[*k].element.centre_nm.into(),
            aperture_radius_um: Some(design.aperture_radius_of_um(&placed[*k].element)),
            shape: array.array.shape,
            widths: array.array.widths(&placed[*k]).into_owned(),
            wedge: placed[*k].element.wedge,
            distance_um: design.lens_of(&placed[*k].element).focal_length_um,
        });
        let light = Looked {
            wavelengths_nm,
            fields_deg,
            samples: samples.unwrap_or(design.verify.window_samples),
            pixel_um: pixel_um.unwrap_or(design.verify.pixel_um),
            polarised: design.verify.light(),
            fast,
            through_focus: request(through_focus),
        };
        let case = match &made {
            Some(chip) => SimulationCase::from(chip),
            None => SimulationCase::from(cells[0].as_ref()),
        };
        Ok((simulate(lit.collect(), case, &light, p)?, made))
    })?;
    told(py, found)
}

/// PSFs of maps of widths, without a design.
#[pyfunction]
#[pyo3(signature = (widths, names, centres_nm, pitch_nm, lattice, wavelengths_nm, fields_deg, distance_um, fidelity, model,
    aperture_um, fast, samples, pixel_um, shape, arriving, analyser, height_nm, pillar, substrate, through_focus=None,
    progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn psf_of_widths<'py>(
    py: Python<'py>,
    widths: Vec<PyReadonlyArray2<'py, u16>>,
    names: Vec<String>,
    centres_nm: Vec<[i64; 2]>,
    pitch_nm: u32,
    lattice: &str,
    wavelengths_nm: Vec<f64>,
    fields_deg: Vec<(f64, f64)>,
    distance_um: f64,
    fidelity: Option<&str>,
    model: Option<PathBuf>,
    aperture_um: Option<f64>,
    fast: bool,
    samples: usize,
    pixel_um: Option<f64>,
    shape: ToldShape,
    arriving: Option<&str>,
    analyser: Option<&str>,
    height_nm: f64,
    pillar: &str,
    substrate: &str,
    through_focus: Planes,
    progress: Option<Py<PyAny>>,
) -> PyResult<ToldPsfs<'py>> {
    let wanted = Wanted::of(fidelity, model.as_deref()).map_err(error)?;
    within("pixel_um", pixel_um, &PIXELS_UM).map_err(error)?;
    within("aperture_um", aperture_um, &APERTURES_UM).map_err(error)?;
    within("distance_um", Some(distance_um), &DISTANCES_UM).map_err(error)?;
    let shape = shape_of(shape).map_err(error)?;
    let light = polarised(arriving, analyser, shape).map_err(error)?;
    let kind = kind_of(lattice).map_err(error)?;
    if let Wanted::Cell(fidelity) = wanted {
        refuse(fidelity, shape, kind).map_err(error)?;
    }
    let maps = given(widths);
    let stack = stack(f64::from(pitch_nm), height_nm, pillar, substrate)
        .and_then(|stack| stack_on(stack, kind, shape))
        .map_err(error)?;
    let found = work(py, progress, |p| {
        let maps = maps.into_iter().map(|w| width_map(w, pitch_nm, kind, shape));
        let maps = maps.collect::<Result<Vec<_>>>()?;
        let (cell, made) = match &wanted {
            Wanted::Cell(fidelity) => (Some(cell_of(*fidelity, stack, &maps, light, &wavelengths_nm)?), None),
            Wanted::Model(model) => {
                let stated = FocusingStack {
                    focused: shape.basis().map(|_| focused(light, shape)),
                    stack,
                };
                let chip = AsBuiltChip::in_light(&stated, model)?.cached_in(cache_folder().as_deref());
                chip.check_drawn(maps.iter().map(PillarMap::histogram))?;
                (None, Some(chip))
            }
        };
        let lit = maps.into_iter().zip(names).zip(centres_nm);
        let lit = lit.map(|((widths, name), centre_nm)| Lit {
            name,
            centre_nm,
            aperture_radius_um: aperture_um.map(|diameter| 0.5 * diameter),
            shape,
            widths,
            wedge: no_wedge(),
            distance_um,
        });
        let light = Looked {
            wavelengths_nm,
            fields_deg,
            samples,
            pixel_um: pixel_um.unwrap_or(PIXEL_UM),
            polarised: light,
            fast,
            through_focus: request(through_focus),
        };
        let case = match (&made, &cell) {
            (Some(chip), _) => SimulationCase::from(chip),
            (None, cell) => SimulationCase::from(cell.as_deref().expect("a cell where there is no model")),
        };
        Ok((simulate(lit.collect(), case, &light, p)?, made))
    })?;
    told(py, found)
}
