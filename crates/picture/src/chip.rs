//! The chip before its sensor: elements as read from a layout, in light.

use metalith_camera::{Camera, Sampling};
use metalith_core::{Error, Progress, Result, WidthMap};
use metalith_design::Design;
use metalith_design::array::{Symmetry, SymmetryGroup};
use metalith_gds::extract::Extraction;
use metalith_made::{
    ArrivingLight, CameraChange, ClassTable, DrawnElement, MadeElement, MadeView, PathChange, Perturbation,
    SimulationCase,
};
use metalith_wave::{Matched, PhaseFunction, PlaneWave};

use crate::ElementView;

/// An element that differs from all others by more than a symmetry.
pub struct DistinctChipElement {
    pub view: ElementView,
    made: MadeElement,
    /// Symmetries that leave its pillars and its wedge as they are.
    pub symmetries: Vec<Symmetry>,
}

/// All elements of a chip, with what they transmit at the wavelengths of a camera.
pub struct ChipInLight {
    pub elements: Vec<ElementView>,
    /// For each element the distinct one that it is a copy of, and what turns that one into it.
    pub copies: Vec<(usize, Symmetry)>,
    pub distinct: Vec<DistinctChipElement>,
    pub sampling: Sampling,
    /// Transmission by distinct element and wavelength.
    tables: Vec<Vec<Tables>>,
    perturbation: Perturbation,
    /// Power of the light that arrives at an element, at each wavelength, in the unit of a PSF's energy (um^2).
    pub arriving_um2: Vec<f64>,
    /// One over the distance of the scene (1/m).
    source_per_m: f64,
}

struct Tables {
    classes: Vec<ClassTable>,
    /// Share of the light that arrives and leaves undiffracted.
    zero_order: f64,
    gap_um: f64,
    camera: CameraChange,
}

/// Largest distance of the wavelengths that are simulated (nm), as in the figures of white light of a run.
pub const STEP_NM: f64 = 12.5;

/// Where the elements of a design are before a sensor.
pub fn element_views(design: &Design, camera: &Camera) -> Vec<ElementView> {
    let view = |element: metalith_design::Element| ElementView {
        centre_um: [element.centre_nm.0 as f64 * 1e-3, element.centre_nm.1 as f64 * 1e-3],
        wedge: element.wedge,
        focal_um: design.lens.focal_length_um,
        slope: camera.sensor.tilt_rad.map(f64::tan),
    };
    design.elements().into_iter().map(view).collect()
}

/// Wavelengths at which a camera is simulated behind a design.
///
/// # Errors
/// If a channel counts no light at which the design's materials are known.
pub fn sampling_of(design: &Design, camera: &Camera) -> Result<Sampling> {
    let (low, high) = design.band_um()?;
    camera.sampling([low * 1e3, high * 1e3], STEP_NM)
}

impl ChipInLight {
    /// Elements as they were read, at the wavelengths of a camera, before a scene at a distance (um).
    ///
    /// # Errors
    /// If a cell has no answer, a channel no light, or the user stopped it.
    pub fn new(
        design: &Design,
        extraction: &Extraction,
        case: SimulationCase<'_>,
        camera: &Camera,
        scene_distance_um: f64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let sampling = sampling_of(design, camera)?;
        let elements = element_views(design, camera);
        let perturbation = match case {
            SimulationCase::Cell(_) => Perturbation::default(),
            SimulationCase::Made(chip) => chip.perturbation().clone(),
        };
        let symmetric = keeps_symmetry(&perturbation) && elements.iter().all(|e| e.slope == [0.0; 2]);
        let turns = if symmetric { &Symmetry::ALL[..] } else { &[] };
        let centres: Vec<[f64; 2]> = design
            .elements()
            .iter()
            .map(metalith_design::Element::centre_um)
            .collect();
        let widths: Vec<&WidthMap> = extraction.elements.iter().map(|e| &e.widths).collect();
        let (mut distinct, mut copies): (Vec<(usize, Vec<Symmetry>)>, Vec<_>) = (Vec::new(), Vec::new());
        for (k, view) in elements.iter().enumerate() {
            let copy = distinct.iter().enumerate().find_map(|(base, (of, _))| {
                let is = |t: &&Symmetry| same_wedge(**t, &elements[*of], view) && t.maps(widths[*of], widths[k]);
                Some((base, *turns.iter().find(is)?))
            });
            copies.push(copy.unwrap_or((distinct.len(), Symmetry::IDENTITY)));
            if copy.is_none() {
                let group = match symmetric {
                    true => SymmetryGroup::of(widths[k]),
                    false => SymmetryGroup::trivial(),
                };
                let own = group.members().iter().copied().filter(|t| same_wedge(*t, view, view));
                distinct.push((k, own.collect()));
            }
        }
        progress.begin(
            "solving the cells",
            (distinct.len() * sampling.wavelengths_nm.len()) as u64,
        );
        let full = |um: f64| case.full_transmission(um);
        let ones = PhaseFunction {
            lattice: design.lattice(),
            radius_um: design.lens.radius_um(),
            amplitude: 1.0,
            phase_rad: |_, _| 0.0,
        };
        let area = Matched::of(
            &ones,
            [0.0, 0.0, design.lens.focal_length_um],
            design.mapping.wavelength_um,
            1.0,
        )
        .power_um2;
        let arriving = |nm: &f64| Ok(full(nm * 1e-3)?.powi(2) * area);
        let arriving_um2 = sampling.wavelengths_nm.iter().map(arriving).collect::<Result<_>>()?;
        let mut found = Vec::new();
        let mut tables = Vec::new();
        let cells = CellTables::new(case, &sampling, design, progress)?;
        for (k, symmetries) in distinct {
            let drawn = DrawnElement::new(widths[k], design.aperture_radius_um()).placed(centres[k]);
            let made = MadeElement::new(&drawn, &perturbation.geometry)?;
            let mut own = Vec::new();
            for (i, nm) in sampling.wavelengths_nm.iter().enumerate() {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let mut tables = cells.of(&made, i, nm * 1e-3, progress)?;
                tables.zero_order = zero_order(&made, &tables.classes, full(nm * 1e-3)?, area);
                own.push(tables);
                progress.advance(1);
            }
            tables.push(own);
            found.push(DistinctChipElement {
                view: elements[k],
                made,
                symmetries,
            });
        }
        Ok(Self {
            elements,
            copies,
            distinct: found,
            sampling,
            tables,
            perturbation,
            arriving_um2,
            source_per_m: 1e6 / scene_distance_um,
        })
    }

    /// A distinct element in the light of one wavelength, by its index, from a direction.
    pub fn lit(&self, distinct: usize, wavelength: usize, sines: [f64; 2]) -> MadeView<'_> {
        let stated = PlaneWave {
            wavelength_um: self.sampling.wavelengths_nm[wavelength] * 1e-3,
            sin_x: sines[0],
            sin_y: sines[1],
        };
        let tables = &self.tables[distinct][wavelength];
        let path = PathChange {
            source_per_m: self.perturbation.path.source_per_m + self.source_per_m,
            ..self.perturbation.path.clone()
        };
        MadeView {
            element: &self.distinct[distinct].made,
            tables: tables.classes.clone(),
            light: ArrivingLight::new(&stated, &path),
            gap_um: tables.gap_um,
            camera: tables.camera.clone(),
        }
    }

    /// Share of the light that leaves a distinct element in the direction it came from, as one wave: the square of the
    /// mean transmission of its sites, at a wavelength by its index.
    pub fn zero_order(&self, distinct: usize, wavelength: usize) -> f64 {
        self.tables[distinct][wavelength].zero_order
    }
}

/// |mean t|^2 over what a cell that passes everything has, mean over polarisations.
fn zero_order(made: &MadeElement, classes: &[ClassTable], full: f64, area_um2: f64) -> f64 {
    let mut counts = vec![0u32; made.widths_nm().len() + 1];
    for class in made.classes() {
        counts[usize::from(*class)] += 1;
    }
    let site_um2 = made.lattice().cell_um2();
    let of = |table: &ClassTable| {
        let sum: num_complex::Complex64 = counts
            .iter()
            .zip(&table.t)
            .map(|(n, t)| num_complex::Complex64::new(f64::from(t.re), f64::from(t.im)) * f64::from(*n))
            .sum();
        (sum * site_um2 / (full * area_um2)).norm_sqr()
    };
    classes.iter().map(of).sum::<f64>() / classes.len() as f64
}

/// Whether what a process and a bench do has no direction of its own.
fn keeps_symmetry(perturbation: &Perturbation) -> bool {
    let (geometry, path) = (&perturbation.geometry, &perturbation.path);
    geometry.aperture_offset_um == [0.0; 2]
        && geometry.wavefront_nm.is_empty()
        && path.tilt_mrad == [0.0; 2]
        && !perturbation.depends_on_place()
}

/// Whether a symmetry turns the wedge of one element into that of another.
fn same_wedge(turn: Symmetry, from: &ElementView, to: &ElementView) -> bool {
    /// Sines of the same angle, computed for both signs.
    const ROUNDING: f64 = 1e-12;
    let wedge = turn.vector([from.wedge.sin_x, from.wedge.sin_y]);
    (wedge[0] - to.wedge.sin_x).abs() < ROUNDING && (wedge[1] - to.wedge.sin_y).abs() < ROUNDING
}

/// Cells along the normal at all wavelengths.
struct CellTables<'a> {
    case: SimulationCase<'a>,
    by_width: Vec<Vec<num_complex::Complex64>>,
}

impl<'a> CellTables<'a> {
    fn new(case: SimulationCase<'a>, sampling: &Sampling, design: &Design, progress: &dyn Progress) -> Result<Self> {
        use rayon::prelude::*;
        let widest = design.cell.pitch_nm as u16;
        let by_width = match case {
            SimulationCase::Made(_) => Vec::new(),
            SimulationCase::Cell(cell) => sampling
                .wavelengths_nm
                .par_iter()
                .map(|nm| {
                    if progress.stopped() {
                        return Err(Error::Interrupted);
                    }
                    cell.transmissions_in_band(nm * 1e-3, widest)
                })
                .collect::<Result<_>>()?,
        };
        Ok(Self { case, by_width })
    }

    fn of(&self, made: &MadeElement, index: usize, um: f64, progress: &dyn Progress) -> Result<Tables> {
        match self.case {
            SimulationCase::Cell(_) => {
                let table = &self.by_width[index];
                let pillar = |width: f64| table.get(width.round() as usize).copied().unwrap_or_default();
                Ok(Tables {
                    zero_order: 0.0,
                    classes: vec![made.table(pillar, num_complex::Complex64::ZERO)],
                    gap_um: 0.0,
                    camera: CameraChange::default(),
                })
            }
            SimulationCase::Made(chip) => {
                let view = chip.view_in_band(made, &PlaneWave::normal(um), false, progress)?;
                Ok(Tables {
                    zero_order: 0.0,
                    classes: view.tables,
                    gap_um: view.gap_um,
                    camera: view.camera,
                })
            }
        }
    }
}
