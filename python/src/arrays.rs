//! Designs, arrays and layouts.

use std::path::{Path, PathBuf};

use metalith::design::CellSpec;
use metalith::extract::ExtractedElement;
use metalith::gds::{LayerNumber, ReadLimits};
use metalith::layout::{FreeLayout, LayoutFormat, OasisEncoding, extraction_plan, write_free, write_pillars_as};
use metalith::{
    ElementSite, Error, ExtractionPlan, Hierarchy, LatticeKind, Layout, NewDesign, PillarArray, PillarMap, PillarShape,
    Pitch, Wedge, extract, pitch_of_nm,
};
use numpy::ndarray::Array2;
use numpy::{Element, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::lattices::{PitchNm, check_places, check_shape, kind_of, lattice_of};
use crate::reading::Reading;
use crate::shapes::{ToldShape, check_numbers, shape_of, told};
use crate::work::{error, work};

/// Wavelength (nm), focal length and diameter (um) of a lens.
type LensNumbers = (f64, f64, f64);

/// Pitch and height of the pillars, narrowest and widest of them (nm), where they are given.
type CellNumbers = (Option<f64>, Option<f64>, Option<u16>, Option<u16>);

fn asked_pitch(nm: f64) -> metalith::Result<Pitch> {
    pitch_of_nm(nm).map_err(|remedy| Error::refused("new/pitch", format!("`pitch_nm` = {nm}"), remedy))
}

/// A design: what is built, how it is written, and what must hold of it.
#[pyclass(frozen, module = "metalith._native")]
pub struct Design {
    pub design: metalith::Design,
}

#[pymethods]
impl Design {
    /// Read a design file, and the files that it names.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let design = work(py, None, |_| metalith::Design::read(&path))?;
        Ok(Self { design })
    }

    /// The design of a text; files that it names count from the folder of `path`.
    #[staticmethod]
    fn parse(py: Python<'_>, text: &str, path: PathBuf) -> PyResult<Self> {
        let design = work(py, None, |_| metalith::Design::parse(&path, text))?;
        Ok(Self { design })
    }

    /// A lens for one wavelength with the pillars that `metalith new` chooses, and its text. Lengths are in nanometres where a name
    /// says no other unit.
    #[staticmethod]
    #[pyo3(signature = (name, lens, words, cell, progress=None))]
    fn lens(
        py: Python<'_>,
        name: &str,
        lens: LensNumbers,
        words: [Option<String>; 4],
        cell: CellNumbers,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Self, String)> {
        let (wavelength_nm, focal_length_um, diameter_um) = lens;
        let [material, substrate, shape, lattice] = words;
        let (pitch_nm, pillar_height_nm, width_min_nm, width_max_nm) = cell;
        let shape = shape.map(|word| shape_of((word, 0, 0, 0))).transpose().map_err(error)?;
        let asked = NewDesign {
            elements: Some((1, 1)),
            diameter_um: Some(diameter_um),
            focal_length_um: Some(focal_length_um),
            wavelength_nm: Some(wavelength_nm),
            steering_deg: None,
            material,
            substrate,
            shape,
            lattice: lattice.as_deref().map(kind_of).transpose().map_err(error)?,
            pillar_height_nm,
            pitch_nm: pitch_nm.map(|nm| asked_pitch(nm).map_err(error)).transpose()?,
            width_min_nm,
            width_max_nm,
        };
        let path = PathBuf::from(format!("{name}.toml"));
        let (design, text) = work(py, progress, |p| {
            let made = asked.text(name, Path::new(""), p)?;
            let design = metalith::Design::parse(&path, &made.text)?;
            Ok((design, made.text))
        })?;
        Ok((Self { design }, text))
    }

    #[getter]
    fn name(&self) -> &str {
        &self.design.name
    }

    #[getter]
    fn title(&self) -> &str {
        &self.design.title
    }

    #[getter]
    fn digest(&self) -> String {
        self.design.digest()
    }

    #[getter]
    fn path(&self) -> PathBuf {
        self.design.path.clone()
    }

    #[getter]
    fn pitch_nm(&self) -> PitchNm {
        self.design.cell.pitch_nm.into()
    }

    /// Lattice of the pillars.
    #[getter]
    fn lattice(&self) -> String {
        self.design.cell.lattice.to_string()
    }

    /// Shape of the pillars.
    #[getter]
    fn shape(&self) -> ToldShape {
        told(self.design.cell.shape)
    }

    /// Places along an axis of the map of one element.
    #[getter]
    fn sites(&self) -> usize {
        self.design.lattice().sites()
    }

    #[getter]
    fn pillar_height_nm(&self) -> f64 {
        self.design.cell.pillar_height_nm
    }

    #[getter]
    fn diameter_um(&self) -> f64 {
        f64::from(self.design.lens.diameter_nm) * 1e-3
    }

    #[getter]
    fn focal_length_um(&self) -> f64 {
        self.design.lens.focal_length_um
    }

    #[getter]
    fn wavelengths_nm(&self) -> Vec<f64> {
        self.design.verify.wavelengths_um.iter().map(|um| um * 1e3).collect()
    }

    /// Index and centre (um) of each element.
    #[getter]
    fn elements(&self) -> Vec<((i32, i32), [f64; 2])> {
        let elements = self.design.elements();
        elements.iter().map(|e| (e.index, e.centre_um())).collect()
    }

    /// The pillars of all elements.
    #[pyo3(signature = (progress=None))]
    fn array(&self, py: Python<'_>, progress: Option<Py<PyAny>>) -> PyResult<Array> {
        let design = &self.design;
        let array = work(py, progress, |p| PillarArray::build(design, p))?;
        Ok(Array {
            array,
            design: Some(design.clone()),
        })
    }
}

/// The pillars of all elements of a chip.
#[pyclass(frozen, module = "metalith._native")]
pub struct Array {
    pub array: PillarArray,
    /// Design of the pillars; `None` for pillars that were given as arrays.
    pub design: Option<metalith::Design>,
}

#[pymethods]
impl Array {
    /// Number of pillars.
    #[getter]
    fn pillars(&self) -> u64 {
        self.array.pillars()
    }

    #[getter]
    fn pitch_nm(&self) -> PitchNm {
        self.array.lattice.pitch_nm().into()
    }

    /// Lattice of the pillars.
    #[getter]
    fn lattice(&self) -> String {
        self.array.lattice.kind().to_string()
    }

    /// Places along an axis of the map of one element.
    #[getter]
    fn sites(&self) -> usize {
        self.array.lattice.sites()
    }

    /// Shape of the pillars.
    #[getter]
    fn shape(&self) -> ToldShape {
        told(self.array.shape)
    }

    /// Label, centre (nm) and number of the distinct lens of each element.
    #[getter]
    fn elements(&self) -> Vec<(String, [i64; 2], usize)> {
        let placed = self.array.placed.iter();
        placed
            .map(|p| {
                (
                    p.element.label(),
                    [p.element.centre_nm.0, p.element.centre_nm.1],
                    p.class,
                )
            })
            .collect()
    }

    /// Widths of one element (nm): uint16, rows along +y, columns along +x, zero where there is no pillar.
    fn widths<'py>(&self, py: Python<'py>, element: usize) -> PyResult<Bound<'py, PyArray2<u16>>> {
        let placed = self.array.placed.get(element).ok_or_else(|| {
            error(Error::refused(
                "array/unknown-element",
                format!("there is no element {element}"),
                format!("this array has elements 0 to {}", self.array.placed.len() - 1),
            ))
        })?;
        let widths = work(py, None, |_| Ok(self.array.widths(placed).into_owned()))?;
        Ok(PyArray2::from_owned_array(py, widths.number))
    }

    /// Write the pillar layout, as GDSII or OASIS by the ending of the name. Returns the number of bytes.
    #[pyo3(signature = (path, hierarchy=None, layer=(1, 0), progress=None))]
    fn write(
        &self,
        py: Python<'_>,
        path: PathBuf,
        hierarchy: Option<&str>,
        layer: (u16, u16),
        progress: Option<Py<PyAny>>,
    ) -> PyResult<u64> {
        let hierarchy = match hierarchy {
            None => self.design.as_ref().map_or(Hierarchy::Folded, |d| d.layout.hierarchy),
            Some("folded") => Hierarchy::Folded,
            Some("sref") => Hierarchy::Sref,
            Some("flat") => Hierarchy::Flat,
            Some(other) => {
                return Err(error(Error::refused(
                    "layout/unknown-hierarchy",
                    format!("there is no hierarchy `{other}`"),
                    "use folded, sref or flat",
                )));
            }
        };
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let format = match ending.as_deref() {
            Some("gds") => LayoutFormat::Gds,
            Some("oas") => LayoutFormat::Oasis(OasisEncoding::default()),
            _ => {
                return Err(error(Error::refused(
                    "layout/unknown-ending",
                    format!("{}: this ending is not known", path.display()),
                    "name a file that ends in .gds or .oas",
                )));
            }
        };
        let written = work(py, progress, |p| match &self.design {
            Some(design) => write_pillars_as(design, &self.array, hierarchy, format, &path, p),
            None => {
                let free = FreeLayout {
                    top: "TOP",
                    layer: LayerNumber::new(layer.0, layer.1),
                    shape: self.array.shape,
                };
                write_free(&free, &self.array, hierarchy, format, &path, p)
            }
        })?;
        Ok(written.bytes)
    }
}

/// An array of pillars that are given as widths, or as numbers of rectangles, one map for each element.
#[pyfunction]
#[pyo3(signature = (widths, pitch_nm, lattice, centres_nm, shape, progress=None))]
pub fn array_of_widths(
    py: Python<'_>,
    widths: Vec<PyReadonlyArray2<'_, u16>>,
    pitch_nm: u32,
    lattice: &str,
    centres_nm: Vec<(i64, i64)>,
    shape: ToldShape,
    progress: Option<Py<PyAny>>,
) -> PyResult<Array> {
    let shape = shape_of(shape).map_err(error)?;
    if widths.len() != centres_nm.len() || widths.is_empty() {
        return Err(error(Error::refused(
            "array/counts-differ",
            format!("{} maps of widths, {} centres", widths.len(), centres_nm.len()),
            "give one centre for each map, and at least one",
        )));
    }
    let kind = kind_of(lattice).map_err(error)?;
    let maps = given(widths);
    let array = work(py, progress, |p| {
        let maps = maps.into_iter().map(|w| width_map(w, pitch_nm, kind, shape));
        let placed = maps
            .zip(centres_nm)
            .map(|(map, centre)| Ok((map?, centre)))
            .collect::<metalith::Result<_>>()?;
        PillarArray::of_maps(shape, placed, p)
    })?;
    Ok(Array { array, design: None })
}

/// The array of a design with other pillars: one map for each of its elements, in their order.
#[pyfunction]
#[pyo3(signature = (widths, design, progress=None))]
pub fn array_of_design(
    py: Python<'_>,
    widths: Vec<PyReadonlyArray2<'_, u16>>,
    design: &Design,
    progress: Option<Py<PyAny>>,
) -> PyResult<Array> {
    let design = design.design.clone();
    let (cell, lattice, elements) = (&design.cell, design.lattice(), design.elements());
    if widths.len() != elements.len() {
        return Err(error(Error::refused(
            "array/counts-differ",
            format!(
                "{} maps of widths for a design of {} elements",
                widths.len(),
                elements.len()
            ),
            "give one map for each element of the design, or `pitch_nm`, `shape` and `lattice` in place of `design`",
        )));
    }
    let maps = given(widths);
    let array = work(py, progress, |p| {
        let placed = maps.into_iter().zip(&elements).map(|(map, element)| {
            let (rows, columns) = map.dim();
            let sites = lattice.sites();
            if (rows, columns) != (sites, sites) {
                return Err(Error::refused(
                    "array/sizes-differ",
                    format!("a map of {rows} x {columns} sites; elements of the design have {sites} x {sites}"),
                    "give maps of the size of the design: pad smaller ones with zeros",
                ));
            }
            check_places(lattice, &map, |w| *w != 0)?;
            check_widths(&map, cell)?;
            Ok((PillarMap { lattice, number: map }, element.centre_nm))
        });
        let mut array = PillarArray::of_maps(cell.shape, placed.collect::<metalith::Result<_>>()?, p)?;
        // Elements look where the design says.
        for (placed, element) in array.placed.iter_mut().zip(elements) {
            placed.element = element;
        }
        Ok(array)
    })?;
    Ok(Array {
        array,
        design: Some(design),
    })
}

/// Refuse widths (nm) that the cell of a design does not allow, and numbers of rectangles that it does not have.
fn check_widths(map: &Array2<u16>, cell: &CellSpec) -> metalith::Result<()> {
    let (least, most) = cell.width_range_nm;
    if cell.shape.last().is_some() {
        return check_numbers(cell.shape, map);
    }
    let is_on_grid = |w: u16| w.is_multiple_of(2) || !cell.database_unit.is_nanometre();
    let is_allowed = |w: u16| w == 0 || ((least..=most).contains(&w) && is_on_grid(w));
    match map.iter().find(|w| !is_allowed(**w)) {
        Some(wrong) => Err(Error::refused(
            "array/width-not-of-design",
            format!("a pillar {wrong} nm wide, and the design allows {least} to {most} nm"),
            "give even widths within these, change the limits of the design, or give `pitch_nm`, `shape` and `lattice` in place of `design`",
        )),
        None => Ok(()),
    }
}

/// Copies of arrays of Python, for when its lock is not held.
pub fn given<T: Element + Clone>(arrays: Vec<PyReadonlyArray2<'_, T>>) -> Vec<Array2<T>> {
    arrays.iter().map(|array| array.as_array().to_owned()).collect()
}

/// A map of pillars of a shape as the library has it.
pub fn width_map(
    width_nm: Array2<u16>,
    pitch_nm: u32,
    kind: LatticeKind,
    shape: PillarShape,
) -> metalith::Result<PillarMap> {
    check_shape(kind, shape)?;
    let lattice = lattice_of(kind, pitch_nm, width_nm.dim(), "map")?;
    let widest_nm = kind.widest_nm(pitch_nm.into(), lattice.unit());
    if let (Some(_), Some((_, longer))) = (shape.last(), shape.edge_range_nm()) {
        if u32::from(longer) > pitch_nm {
            return Err(Error::refused(
                "array/pillar-too-wide",
                format!("rectangles {longer} nm long at a pitch of {pitch_nm} nm"),
                "give edges of at most the pitch",
            ));
        }
        check_numbers(shape, &width_nm)?;
    } else if let Some(wrong) = width_nm.iter().find(|w| **w % 2 != 0 || u32::from(**w) > widest_nm) {
        return Err(Error::refused(
            "array/pillar-too-wide",
            format!("a pillar {wrong} nm wide"),
            format!(
                "widths are even, so that edges are whole nanometres, and at most the distance of neighbours, {widest_nm} nm"
            ),
        ));
    }
    check_places(lattice, &width_nm, |w| *w != 0)?;
    Ok(PillarMap {
        lattice,
        number: width_nm,
    })
}

/// Contents of a layout: names, centres (nm) and widths (nm) of its elements, pitch (nm) and kind of their lattices,
/// number of pillars, number of other shapes on the layer, top cell, shape of the pillars.
type ReadLayout<'py> = (
    Vec<String>,
    Vec<[i64; 2]>,
    Vec<Bound<'py, PyArray2<u16>>>,
    PitchNm,
    String,
    u64,
    u64,
    String,
    ToldShape,
);

/// Read the pillars of a layout: at the elements of a design or of an array, or wherever there are squares or circles on a
/// lattice.
#[pyfunction]
#[pyo3(signature = (path, layer=None, top=None, design=None, array=None, progress=None))]
pub fn read_layout<'py>(
    py: Python<'py>,
    path: PathBuf,
    layer: Option<(u16, u16)>,
    top: Option<String>,
    design: Option<&Design>,
    array: Option<&Array>,
    progress: Option<Py<PyAny>>,
) -> PyResult<ReadLayout<'py>> {
    let reading = Reading { layer, top };
    let design = design.map(|d| reading.design(&d.design));
    let found = work(py, progress, |p| {
        let layout = Layout::open_with(&path, ReadLimits::default(), p)?;
        let layout = match &reading.top {
            Some(top) => layout.below(top)?,
            None => layout,
        };
        let plan = match (&design, array) {
            (Some(design), _) => extraction_plan(design),
            (None, Some(array)) => {
                let layer = reading.pillar_layer(&layout, p)?;
                ExtractionPlan::given(layer, sites(array)).of_shape(array.array.shape)
            }
            (None, None) => ExtractionPlan::discover(reading.pillar_layer(&layout, p)?),
        };
        let found = extract(&layout, &plan, p)?;
        found.check_one_lattice(&path, "name a cell with elements of one kind by `top`")?;
        Ok(found)
    })?;
    let pillars = found.pillars;
    let others = found.oddities.total();
    let shape = told(found.shape);
    let lattice = found.elements.first().map(|e| e.site.lattice);
    let (pitch_nm, kind) = lattice.map_or((Pitch::whole(0), LatticeKind::Square), |l| (l.pitch_nm(), l.kind()));
    let pitch_nm = PitchNm::from(pitch_nm);
    let (mut names, mut centres_nm, mut widths_nm) = (vec![], vec![], vec![]);
    for ExtractedElement { site, widths } in found.elements {
        names.push(site.name);
        centres_nm.push(site.centre_nm);
        // The memory that it was read into becomes the array's: nothing is copied.
        widths_nm.push(PyArray2::from_owned_array(py, widths.number));
    }
    let kind = kind.to_string();
    Ok((
        names, centres_nm, widths_nm, pitch_nm, kind, pillars, others, found.top, shape,
    ))
}

/// Places of the elements of an array.
fn sites(array: &Array) -> Vec<ElementSite> {
    if let Some(design) = &array.design {
        return design.sites();
    }
    let array = &array.array;
    let placed = array.placed.iter();
    placed
        .map(|p| ElementSite {
            name: p.element.label(),
            centre_nm: [p.element.centre_nm.0, p.element.centre_nm.1],
            lattice: array.lattice,
            within_nm: None,
        })
        .collect()
}

/// The direction of an element that steers nothing.
pub fn no_wedge() -> Wedge {
    Wedge {
        wavelength_um: 0.55,
        sin_x: 0.0,
        sin_y: 0.0,
    }
}
