//! PSFs of arrays and of maps of widths.

use metalith::cell::{
    Analyser, FittedCell, Handedness, PointwiseCell, Polarisation, PolarisationAxis, PolarisedLight, PublishedCell,
    RotatedCell, UprightCell, cache_folder,
};
use metalith::design::band_about;
use metalith::extract::{ElementSite, ExtractedElement, Extraction};
use metalith::grating::{Mapping, NeighbourCell};
use metalith::verify::{Lighting, SimulationCase, SinglePsf, single_psfs};
use metalith::wave::propagation::{incident, landing_um};
use metalith::{
    Accuracy, CellModel, Error, Fidelity, LatticeKind, PillarShape, Progress, Rectangles, Result, Wedge, WidthMap,
    cell_models,
};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Array, no_wedge, width_map};
use crate::lattices::{kind_of, stack_on};
use crate::light::stack;
use crate::shapes::{ToldShape, shape_of};
use crate::work::{error, work};

/// The cell that a word names.
fn fidelity(word: &str) -> Result<Fidelity> {
    match word {
        "rigorous" => Ok(Fidelity::Rigorous),
        "neighbours" => Ok(Fidelity::Neighbours),
        "fitted" => Ok(Fidelity::Fitted),
        "published" => Ok(Fidelity::Published),
        _ => Err(Error::invalid(
            format!("there is no fidelity `{word}`"),
            "use rigorous, neighbours, fitted or published",
        )),
    }
}

/// The light that words or angles name, at pillars of a shape.
fn polarised(arriving: Option<&str>, analyser: Option<&str>, shape: PillarShape) -> Result<PolarisedLight> {
    let own = match shape.upright() {
        Some(_) => PolarisationAxis::X.polarisation(),
        None => Polarisation::Circular(Handedness::default()),
    };
    let arriving: Polarisation = arriving.map_or(Ok(own), str::parse)?;
    let analyser: Option<Analyser> = analyser.map(str::parse).transpose()?;
    let usual = arriving == own && analyser.is_none();
    if shape.upright().is_some() && analyser == Some(Analyser::Circular) {
        return Err(Error::invalid(
            "a circular analyser behind upright rectangles, which focus no hand",
            "give `analyser` x, y or an angle",
        ));
    }
    if shape.rectangles().is_none() && !usual {
        return Err(Error::invalid(
            format!("light of a polarisation for {}", shape.plural()),
            "leave out `arriving` and `analyser`: they count for rectangles alone",
        ));
    }
    if analyser == Some(Analyser::Circular) && !matches!(arriving, Polarisation::Circular(_)) {
        return Err(Error::invalid(
            format!("a circular analyser in light that arrives {arriving}"),
            "give an array of a design, which says what the pillars focus: the analyser passes what that is converted to",
        ));
    }
    Ok(PolarisedLight {
        arriving: Some(arriving),
        analyser,
    })
}

/// The hand that light of these is focused in by rotated rectangles.
fn focused(light: PolarisedLight) -> Handedness {
    match light.arriving {
        Some(Polarisation::Circular(hand)) if light.analyser.is_some() => hand,
        _ => Handedness::default(),
    }
}

/// Cells that pillars of a shape on such a lattice do not have.
fn refuse(wanted: Fidelity, shape: PillarShape, kind: LatticeKind) -> Result<()> {
    // Its polynomials are of squares.
    if shape == PillarShape::Circle && wanted == Fidelity::Published {
        return Err(Error::invalid(
            format!("{} by the `{wanted}` cell", shape.plural()),
            "use rigorous, neighbours or fitted",
        ));
    }
    wanted.check(shape, kind)
}

/// An element to simulate.
struct Lit {
    name: String,
    shape: PillarShape,
    widths: WidthMap,
    wedge: Wedge,
    /// From the pillars to the plane that is looked at (um).
    distance_um: f64,
}

/// In what light elements are looked at.
struct Looked {
    wavelengths_nm: Vec<f64>,
    fields_deg: Vec<(f64, f64)>,
    samples: usize,
    pixel_um: f64,
    /// Polarisation of source and detector, where pillars change it.
    polarised: PolarisedLight,
    fast: bool,
}

/// One PSF with where it is from.
struct Found {
    field_deg: (f64, f64),
    incidence_sin: [f64; 2],
    psf: SinglePsf,
}

/// All elements, each in every light. Those that look the same way are simulated together: their cells are solved once, and
/// of those with the same pillars one is.
fn simulate(elements: Vec<Lit>, cell: &dyn CellModel, light: &Looked, progress: &dyn Progress) -> Result<Vec<Found>> {
    let mut found: Vec<(usize, Vec<Found>)> = Vec::new();
    let mut waiting: Vec<(usize, Lit)> = elements.into_iter().enumerate().collect();
    while let Some((_, first)) = waiting.first() {
        let (wedge, distance_um, shape) = (first.wedge, first.distance_um, first.shape);
        let (together, others) = waiting
            .into_iter()
            .partition(|(_, lit)| (lit.wedge, lit.distance_um) == (wedge, distance_um));
        waiting = others;
        found.extend(simulate_together(
            together,
            wedge,
            distance_um,
            shape,
            cell,
            light,
            progress,
        )?);
    }
    found.sort_by_key(|(k, _)| *k);
    Ok(found.into_iter().flat_map(|(_, own)| own).collect())
}

/// Elements that look the same way, by their numbers.
fn simulate_together(
    elements: Vec<(usize, Lit)>,
    wedge: Wedge,
    distance_um: f64,
    shape: PillarShape,
    cell: &dyn CellModel,
    light: &Looked,
    progress: &dyn Progress,
) -> Result<Vec<(usize, Vec<Found>)>> {
    let mut found: Vec<(usize, Vec<Found>)> = elements.iter().map(|(k, _)| (*k, Vec::new())).collect();
    let named = elements.into_iter().map(|(_, lit)| ExtractedElement {
        site: ElementSite {
            name: lit.name,
            centre_nm: [0; 2],
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
                cells_as_lit: false,
                distance_um,
                at_um: landing_um(&wedge, &wave, distance_um)?,
                samples: light.samples,
                pixel_um: light.pixel_um,
                polarised: light.polarised,
                aperture_radius_um: None,
                accuracy: if light.fast { Accuracy::Fast } else { Accuracy::Accurate },
            };
            let psfs = single_psfs(&extraction, SimulationCase::Cell(cell), &lighting, progress)?;
            for (k, (_, own)) in found.iter_mut().enumerate() {
                let place = simulated.iter().position(|s| *s == like[k]);
                let psf = psfs[place.expect("what is like another is simulated")].clone();
                own.push(Found {
                    field_deg: *field_deg,
                    incidence_sin: lighting.incidence_sin,
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

/// PSFs for Python: a dictionary for each.
fn told<'py>(py: Python<'py>, found: Vec<Found>) -> PyResult<Vec<Bound<'py, PyDict>>> {
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
        dict.set_item("strehl", m.strehl)?;
        dict.set_item("peak_um", (m.peak_um[0], m.peak_um[1]))?;
        dict.set_item("centroid_um", (m.centroid_um[0], m.centroid_um[1]))?;
        dict.set_item("energy_1_pixel", m.energy_1_pixel)?;
        dict.set_item("energy_2_pixels", m.energy_2_pixels)?;
        dict.set_item("energy_passed", m.energy_passed)?;
        dict.set_item("mtf_half_nyquist", (m.mtf_half_nyquist[0], m.mtf_half_nyquist[1]))?;
        dict.set_item("mtf_nyquist", (m.mtf_nyquist[0], m.mtf_nyquist[1]))?;
        Ok(dict)
    };
    found.into_iter().map(one).collect()
}

/// PSFs of the distinct lenses of an array of a design, or of the elements that are named.
#[pyfunction]
#[pyo3(signature = (array, wavelengths_nm, fields_deg, fidelity, fast, samples, elements=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn psf_of_array<'py>(
    py: Python<'py>,
    array: &Array,
    wavelengths_nm: Vec<f64>,
    fields_deg: Vec<(f64, f64)>,
    fidelity: &str,
    fast: bool,
    samples: Option<usize>,
    elements: Option<Vec<usize>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let design = array.design.as_ref().ok_or_else(|| {
        error(Error::invalid(
            "an array of widths says nothing of the sensor",
            "give `distance_um` and what pillars are made of",
        ))
    })?;
    let wanted = self::fidelity(fidelity).map_err(error)?;
    let placed = &array.array.placed;
    // Lenses with the same pillars may look at planes at other distances.
    let looks = |k: usize| (placed[k].class, design.lens_of(&placed[k].element).focal_length_um);
    let is_first = |k: &usize| (0..*k).all(|earlier| looks(earlier) != looks(*k));
    let chosen = elements.unwrap_or_else(|| (0..placed.len()).filter(is_first).collect());
    if let Some(wrong) = chosen.iter().find(|k| **k >= placed.len()) {
        return Err(error(Error::invalid(
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
        let cells = cell_models(&design, &[wanted])?;
        let lit = chosen.iter().map(|k| Lit {
            name: placed[*k].element.label(),
            shape: array.array.shape,
            widths: array.array.widths(&placed[*k]).into_owned(),
            wedge: placed[*k].element.wedge,
            distance_um: design.lens_of(&placed[*k].element).focal_length_um,
        });
        let light = Looked {
            wavelengths_nm,
            fields_deg,
            samples: samples.unwrap_or(design.verify.window_samples),
            pixel_um: design.verify.pixel_um,
            polarised: design.verify.light(),
            fast,
        };
        simulate(lit.collect(), cells[0].as_ref(), &light, p)
    })?;
    told(py, found)
}

/// PSFs of maps of widths, without a design.
#[pyfunction]
#[pyo3(signature = (widths, pitch_nm, lattice, wavelengths_nm, fields_deg, distance_um, fidelity, fast, samples, shape,
    arriving, analyser, height_nm, pillar, substrate, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn psf_of_widths<'py>(
    py: Python<'py>,
    widths: Vec<PyReadonlyArray2<'py, u16>>,
    pitch_nm: u32,
    lattice: &str,
    wavelengths_nm: Vec<f64>,
    fields_deg: Vec<(f64, f64)>,
    distance_um: f64,
    fidelity: &str,
    fast: bool,
    samples: usize,
    shape: ToldShape,
    arriving: Option<&str>,
    analyser: Option<&str>,
    height_nm: f64,
    pillar: &str,
    substrate: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let wanted = self::fidelity(fidelity).map_err(error)?;
    let shape = shape_of(shape).map_err(error)?;
    let light = polarised(arriving, analyser, shape).map_err(error)?;
    let kind = kind_of(lattice).map_err(error)?;
    refuse(wanted, shape, kind).map_err(error)?;
    let maps = widths
        .iter()
        .map(|w| width_map(w.as_array().to_owned(), pitch_nm, kind, shape));
    let maps = maps.collect::<Result<Vec<_>>>().map_err(error)?;
    drop(widths);
    let stack = stack(f64::from(pitch_nm), height_nm, pillar, substrate)
        .and_then(|stack| stack_on(stack, kind, shape))
        .map_err(error)?;
    let found = work(py, progress, |p| {
        let drawn = drawn(&maps);
        let cell: Box<dyn CellModel> = match (wanted, shape.rectangles()) {
            (_, Some(Rectangles::Rotated(pillars))) => Box::new(RotatedCell::new(stack, pillars, focused(light))),
            (_, Some(Rectangles::Upright(pillars))) => {
                let axis = light.arriving.map_or(PolarisationAxis::X, PolarisationAxis::nearest);
                Box::new(UprightCell::new(stack, pillars, axis).kept_in(cache_folder().as_deref()))
            }
            (Fidelity::Published, None) => Box::new(PublishedCell::new(pitch_nm)),
            (Fidelity::Neighbours, None) => {
                let mapping = Mapping::of_widths(maps.iter().map(WidthMap::histogram))?;
                Box::new(NeighbourCell::new(stack, vec![mapping], cache_folder()))
            }
            (Fidelity::Fitted, None) => {
                let band = band_about(wavelengths_nm.iter().map(|nm| nm * 1e-3), stack.range_um());
                let range = (*drawn.first().unwrap_or(&100), *drawn.last().unwrap_or(&300));
                Box::new(FittedCell::of_stack(&stack, band, range)?)
            }
            (_, None) => Box::new(PointwiseCell::new(stack, drawn)),
        };
        let lit = maps.into_iter().enumerate().map(|(k, widths)| Lit {
            name: format!("element {k}"),
            shape,
            widths,
            wedge: no_wedge(),
            distance_um,
        });
        let light = Looked {
            wavelengths_nm,
            fields_deg,
            samples,
            pixel_um: 5.86,
            polarised: light,
            fast,
        };
        simulate(lit.collect(), cell.as_ref(), &light, p)
    })?;
    told(py, found)
}

/// The widths that are drawn (nm), rising.
fn drawn(maps: &[WidthMap]) -> Vec<u16> {
    let mut widths: Vec<u16> = Vec::new();
    for map in maps {
        let histogram = map.histogram();
        let there = histogram.iter().enumerate().skip(1).filter(|(_, n)| **n > 0);
        widths.extend(there.map(|(w, _)| w as u16));
    }
    widths.sort_unstable();
    widths.dedup();
    widths
}
