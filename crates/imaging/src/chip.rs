//! The chip before its sensor: elements as read from a layout, in light.

use metalith_cell::{Fidelity, Illumination, PolarisedLight};
use metalith_core::{Progress, Result, Steps};
use metalith_design::array::Symmetry;
use metalith_design::phase::OpenAreas;
use metalith_design::{CellIncidence, Design, Element};
use metalith_gds::extract::Extraction;
use metalith_optics::{
    ArrivingLight, AsBuiltElement, CaseOptics, ClassFields, ClassTable, DrawnElement, IncoherentFields, PathChange,
    SimulationCase,
};
use metalith_pillars::{LatticeKind, PillarMap};
use metalith_sensor::{Camera, Sampling, WavelengthSteps};
use metalith_wave::PlaneWave;

use crate::ElementView;
use crate::directional_cells::DirectionalCells;

/// An element that differs from all others by more than a symmetry.
pub struct DistinctChipElement<'a> {
    pub view: ElementView,
    widths: &'a PillarMap,
    /// Element as fabricated.
    pub made: AsBuiltElement,
    /// Symmetries that leave its pillars and its wedge as they are.
    pub symmetries: Vec<Symmetry>,
    /// Area of its sites (um^2).
    open_um2: f64,
}

/// All elements of a chip, with what decides what they transmit at the wavelengths of a camera.
pub struct ChipInLight<'a> {
    pub elements: Vec<ElementView>,
    /// Distinct element that each element is a copy of, and the symmetry that turns the distinct one into it.
    pub copies: Vec<(usize, Symmetry)>,
    pub distinct: Vec<DistinctChipElement<'a>>,
    pub sampling: Sampling,
    optics: CaseOptics<'a>,
    /// The direction that cells are solved for.
    incidence: CellIncidence,
    lattice: LatticeKind,
    polarised: PolarisedLight,
    /// Change on the path of the chip.
    path: PathChange,
    /// Share of the light that cells send on that pass everything, at each wavelength.
    full: Vec<f64>,
    /// One over the distance of the scene (1/m).
    source_per_m: f64,
}

/// A distinct element in the light of some wavelengths of the camera.
pub struct ElementInLight<'c> {
    chip: &'c ChipInLight<'c>,
    distinct: usize,
    /// Fields by wavelength of the camera; `None` for wavelengths that were not asked for.
    classes: Vec<Option<DirectionalCells>>,
}

/// Distance from the pillar tops of a design to the sensor of a camera, below the middle of the chip (um): as the
/// camera says, else in the focus of the lens that elements share.
pub fn sensor_um(design: &Design, camera: &Camera) -> f64 {
    camera.sensor.distance_um.unwrap_or(design.lens.focal_length_um)
}

/// Direction that the cells of pictures are solved for: coupled models are solved for the viewing direction of each element alone.
pub(crate) fn incidence(design: &Design) -> CellIncidence {
    match design.verify.fidelity {
        Fidelity::Neighbours => CellIncidence::Normal,
        _ => design.verify.incidence,
    }
}

/// Views of the elements of a design before a sensor: one plane for all, whatever their focal lengths.
pub fn element_views(design: &Design, camera: &Camera) -> Vec<ElementView> {
    views_of(design, camera, &OpenAreas::of(design))
}

fn views_of(design: &Design, camera: &Camera, areas: &OpenAreas) -> Vec<ElementView> {
    let view = |(element, open_um2): (Element, &f64)| ElementView {
        centre_um: element.centre_um(),
        wedge: element.wedge,
        area: open_um2 / areas.lens_um2,
        sensor_um: sensor_um(design, camera),
        slope: camera.sensor.tilt_rad.map(f64::tan),
    };
    design
        .elements()
        .into_iter()
        .zip(&areas.elements_um2)
        .map(view)
        .collect()
}

/// Wavelengths at which a camera is simulated behind a design.
///
/// # Errors
/// If a channel counts no light at which the design's materials are known.
pub fn sampling_of(design: &Design, camera: &Camera) -> Result<Sampling> {
    let (low, high) = design.band_um()?;
    let steps = WavelengthSteps::from(WavelengthSteps::USUAL_NM).behind(design.lens_sizes_um(), camera.sensor.pixel_um);
    camera.sampling([low * 1e3, high * 1e3], steps)
}

impl<'a> ChipInLight<'a> {
    /// Elements as they were read, at the wavelengths of a camera, before a scene at a distance (um).
    ///
    /// # Errors
    /// If a cell has no answer, a channel no light, or the user stopped it.
    pub fn new(
        design: &Design,
        extraction: &'a Extraction,
        case: SimulationCase<'a>,
        camera: &Camera,
        scene_distance_um: f64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let sampling = sampling_of(design, camera)?;
        let areas = OpenAreas::of(design);
        let elements = views_of(design, camera, &areas);
        let perturbation = case.perturbation();
        let symmetric = perturbation.keeps_symmetry() && elements.iter().all(|e| e.slope == [0.0; 2]);
        let widths: Vec<&PillarMap> = extraction.elements.iter().map(|e| &e.widths).collect();
        case.check_drawn(widths.iter().map(|map| map.histogram()))?;
        let symmetries = Symmetry::ALL
            .into_iter()
            .filter(|s| symmetric && s.keeps(design.cell.shape));
        let (chosen, copies) = distinct_of(&elements, &widths, &symmetries.collect::<Vec<_>>());
        let full = |nm: &f64| Ok(case.full_transmission(nm * 1e-3)?.powi(2));
        let optics = case.optics(design.cell.lattice, design.cell.most());
        let wavelengths_um: Vec<f64> = sampling.wavelengths_nm.iter().map(|nm| nm * 1e-3).collect();
        let (incidence, lattice) = (incidence(design), design.cell.lattice);
        let directions = DirectionalCells::<()>::count(incidence);
        let steps = Steps::begin(
            progress,
            "solving the cells",
            (chosen.len() * wavelengths_um.len() * directions) as u64,
        );
        let mut distinct = Vec::new();
        for (k, symmetries) in chosen {
            let element = &design.elements()[k];
            let drawn = DrawnElement::new(widths[k], design.aperture_radius_of_um(element))
                .of_shape(design.cell.shape)
                .placed(element.centre_um());
            distinct.push(DistinctChipElement {
                view: elements[k],
                widths: widths[k],
                made: optics.as_built(&drawn)?,
                symmetries,
                open_um2: areas.elements_um2[k],
            });
            let solve = |light: &Illumination<'_>| {
                DirectionalCells::solve(incidence, lattice, light, |light| {
                    optics.respond_over(&wavelengths_um, light, &steps)
                })
                .map(|_| ())
            };
            in_band(&elements[k], wavelengths_um[0], design.verify.light(), solve)?;
        }
        Ok(Self {
            copies,
            distinct,
            full: sampling.wavelengths_nm.iter().map(full).collect::<Result<_>>()?,
            sampling,
            elements,
            optics,
            incidence,
            lattice,
            polarised: design.verify.light(),
            path: perturbation.path,
            source_per_m: 1e6 / scene_distance_um,
        })
    }

    /// A distinct element in the light of some wavelengths, by their indices. Where pillars have dissimilar neighbours,
    /// each wavelength takes two bytes a site.
    ///
    /// # Errors
    /// If a cell has no answer, or the user stopped it.
    pub fn in_light(
        &'a self,
        distinct: usize,
        wavelengths: &[usize],
        progress: &dyn Progress,
    ) -> Result<ElementInLight<'a>> {
        let mut classes: Vec<Option<DirectionalCells>> = self.sampling.wavelengths_nm.iter().map(|_| None).collect();
        let element = &self.distinct[distinct];
        for i in wavelengths {
            progress.check_stopped()?;
            let um = self.sampling.wavelengths_nm[*i] * 1e-3;
            let of = |light: &Illumination<'_>| {
                DirectionalCells::solve(self.incidence, self.lattice, light, |light| {
                    self.optics.classes(&element.made, element.widths, light, progress)
                })
            };
            classes[*i] = Some(in_band(&element.view, um, self.polarised, of)?);
        }
        Ok(ElementInLight {
            chip: self,
            distinct,
            classes,
        })
    }

    /// Power of the light that arrives at a distinct element at a wavelength, by its index, in the unit of a PSF's energy (um^2).
    pub fn arriving_um2(&self, distinct: usize, wavelength: usize) -> f64 {
        self.full[wavelength] * self.distinct[distinct].open_um2
    }
}

impl ElementInLight<'_> {
    /// Area of the light that arrives (um^2), as [`ChipInLight::arriving_um2`].
    pub fn arriving_um2(&self, wavelength: usize) -> f64 {
        self.chip.arriving_um2(self.distinct, wavelength)
    }

    /// Element in the light of one wavelength, by its index, from a direction.
    ///
    /// # Panics
    /// If it was not made for this wavelength.
    pub fn lit(&self, wavelength: usize, sines: [f64; 2]) -> IncoherentFields<'_> {
        let made = &self.chip.distinct[self.distinct].made;
        self.classes_at(wavelength)
            .from(sines)
            .lit(made, self.arriving(wavelength, sines))
    }

    /// Fields of one wavelength, by its index, that do not depend on the direction of arrival but for the wave itself; none where
    /// cells are solved along several directions.
    ///
    /// # Panics
    /// As [`ElementInLight::lit`].
    pub fn lit_of_all_directions(&self, wavelength: usize) -> Option<IncoherentFields<'_>> {
        let made = &self.chip.distinct[self.distinct].made;
        let fields = self.classes_at(wavelength).of_all_directions()?;
        Some(fields.lit(made, self.arriving(wavelength, [0.0; 2])))
    }

    /// Radius of the circle that light passes (um).
    pub fn radius_um(&self) -> f64 {
        self.chip.distinct[self.distinct].made.radius_um()
    }

    /// Light of one wavelength, by its index, as it arrives at the element from a direction.
    pub fn arriving(&self, wavelength: usize, sines: [f64; 2]) -> ArrivingLight {
        let chip = self.chip;
        let stated = PlaneWave {
            wavelength_um: chip.sampling.wavelengths_nm[wavelength] * 1e-3,
            sin_x: sines[0],
            sin_y: sines[1],
        };
        let path = PathChange {
            source_per_m: chip.path.source_per_m + chip.source_per_m,
            ..chip.path.clone()
        };
        ArrivingLight::new(&stated, &path)
    }

    /// Tables of light whose direction is asked for, each with how often it has the phase of the element: see
    /// [`ClassFields::departing`].
    ///
    /// # Panics
    /// As [`ElementInLight::lit`].
    pub fn departing(&self, wavelength: usize) -> Vec<(&ClassTable, i32)> {
        self.at(wavelength).departing()
    }

    /// Share of the light that leaves the element in the direction it came from, as one wave: the square of the mean
    /// transmission of its sites, at a wavelength by its index, mean over the polarisations in which it arrives.
    ///
    /// # Panics
    /// As [`ElementInLight::lit`].
    pub fn zero_order(&self, wavelength: usize) -> f64 {
        let element = &self.chip.distinct[self.distinct];
        // The power of a wave is the square of its sum over the area, over the area.
        let all = self.arriving_um2(wavelength) * element.open_um2;
        self.at(wavelength).zeroth_order(&element.made, all)
    }

    /// Cells along the normal.
    fn at(&self, wavelength: usize) -> &ClassFields {
        &self.classes_at(wavelength).normal
    }

    fn classes_at(&self, wavelength: usize) -> &DirectionalCells {
        self.classes[wavelength]
            .as_ref()
            .expect("wavelengths are asked for before")
    }
}

/// Result of `with` for light along the normal at a wavelength of a band (um); coupled cells are solved for light from
/// the viewing direction of the element.
fn in_band<T>(
    view: &ElementView,
    um: f64,
    polarised: PolarisedLight,
    with: impl FnOnce(&Illumination<'_>) -> Result<T>,
) -> Result<T> {
    with(&Illumination {
        viewing: Some(&|um| view.wedge.looks_at(um).into()),
        polarised,
        ..Illumination::normal(um).in_band()
    })
}

/// Distinct elements with those of these symmetries that leave each as it is; and for each element the distinct one that it is a
/// copy of, and how turned.
#[allow(clippy::type_complexity, reason = "both halves are taken apart at once")]
fn distinct_of(
    elements: &[ElementView],
    widths: &[&PillarMap],
    symmetries: &[Symmetry],
) -> (Vec<(usize, Vec<Symmetry>)>, Vec<(usize, Symmetry)>) {
    let turns = |t: Symmetry, from: usize, to: usize| {
        elements[from].area == elements[to].area
            && same_wedge(t, &elements[from], &elements[to])
            && t.maps(widths[from], widths[to])
    };
    let (mut distinct, mut copies): (Vec<(usize, Vec<Symmetry>)>, Vec<_>) = (Vec::new(), Vec::new());
    for k in 0..elements.len() {
        let copy = distinct.iter().enumerate().find_map(|(base, (of, _))| {
            let turned = symmetries.iter().find(|t| turns(**t, *of, k));
            Some((base, *turned?))
        });
        copies.push(copy.unwrap_or((distinct.len(), Symmetry::IDENTITY)));
        if copy.is_none() {
            let others = symmetries.iter().copied().filter(|t| *t != Symmetry::IDENTITY);
            let own = others.filter(|t| turns(*t, k, k));
            distinct.push((k, std::iter::once(Symmetry::IDENTITY).chain(own).collect()));
        }
    }
    (distinct, copies)
}

/// True if a symmetry turns the wedge of one element into the wedge of another.
fn same_wedge(turn: Symmetry, from: &ElementView, to: &ElementView) -> bool {
    /// Sines of the same angle, computed for both signs.
    const ROUNDING: f64 = 1e-12;
    let wedge = turn.vector([from.wedge.sin_x, from.wedge.sin_y]);
    (wedge[0] - to.wedge.sin_x).abs() < ROUNDING && (wedge[1] - to.wedge.sin_y).abs() < ROUNDING
}
