//! An element in one light: fields that do not interfere, and all that is between them and the sensor.

use std::sync::Arc;

use num_complex::Complex64;

use super::{ArrivingLight, AsBuiltElement, CameraChange, ClassTable, Perturbation, SolvedWidths};
use crate::{NeighbourPillars, NeighbourSites};
use metalith_cell::{CellResponse, NeighbourTables, Orientation};
use metalith_core::Result;
use metalith_pillars::{Lattice, PillarRows};
use metalith_wave::propagation::{Direction, Together};
use metalith_wave::{
    Accuracy, Aperture, ApertureSet, FoldedPropagator, Pillars, PlaneWave, Propagator, Psf, Scratch, TransmissionMap,
    Window,
};

/// Fields of an element in light that arrives: the sum of the intensities of its fields, each times the weight.
pub struct IncoherentFields<'e> {
    pub fields: Vec<Field<'e>>,
    /// Share of the light that arrives that is in the polarisation of each field.
    pub weight: f64,
    pub light: ArrivingLight,
    /// Added to the distance of the sensor (um).
    pub defocus_um: f64,
    pub camera: CameraChange,
    pub(crate) lattice: Lattice,
    /// Radius of the circle that light passes (um).
    pub(crate) radius_um: f64,
    /// Spectra that a thread may hold at a time, if not all (bytes): see [`FoldedPropagator::within`].
    pub(crate) part_bytes: Option<usize>,
}

/// Light behind an element that interferes with itself alone.
pub enum Field<'e> {
    /// Sites transmit by the width or number of their pillar.
    Drawn {
        pillars: &'e dyn PillarRows,
        table: Vec<Complex64>,
    },
    /// Sites transmit by their pillar and its neighbours, from the direction with these sines; `polarisation` is 0 for s and 1 for p.
    Coupled {
        sites: &'e NeighbourSites,
        response: Arc<CellResponse>,
        sines: [f64; 2],
        polarisation: usize,
    },
    /// [`Field::Coupled`] whose rows have been formed.
    Formed(Arc<TransmissionMap>),
    /// Sites transmit by their class.
    AsBuilt {
        element: &'e AsBuiltElement,
        table: ClassTable,
    },
}

impl Field<'_> {
    /// The field behind the element, without the plane wave that arrives. Rows are formed when they are asked for.
    ///
    /// # Errors
    /// If a pillar is in no table.
    pub fn aperture(&self, light: &ArrivingLight) -> Result<Box<dyn Aperture + '_>> {
        Ok(match self {
            Self::Drawn { pillars, table } => Box::new(Pillars::new(*pillars, table)?),
            Self::Coupled {
                sites,
                response,
                sines,
                polarisation,
            } => Box::new(match response.as_ref() {
                CellResponse::Neighbours(NeighbourTables::Fitted(fitted)) => {
                    let turned = Orientation::of(*sines, [0.0; 2]).polarisation(*polarisation);
                    NeighbourPillars::new(sites, [&fitted.responses[turned]], *sines)
                }
                CellResponse::Neighbours(NeighbourTables::Band(band)) => NeighbourPillars::new(sites, [band], *sines),
                CellResponse::Scalar(_) | CellResponse::Jones(_) => unreachable!("made of neighbours alone"),
            }),
            Self::Formed(map) => Box::new(map.as_ref()),
            Self::AsBuilt { element, table } => Box::new(element.lit_aperture(table, light)),
        })
    }

    /// Identity of rows of pillars among neighbours: equal ones transmit the same. None of pillars that stand for themselves.
    fn rows(&self) -> Option<(*const NeighbourSites, *const CellResponse, [f64; 2], usize)> {
        match self {
            Self::Coupled {
                sites,
                response,
                sines,
                polarisation,
            } => Some((std::ptr::from_ref(*sites), Arc::as_ptr(response), *sines, *polarisation)),
            Self::Drawn { .. } | Self::Formed(_) | Self::AsBuilt { .. } => None,
        }
    }

    /// |t|^2 summed over sites of what missing pillars scatter, each on its own.
    fn scattered(&self) -> f64 {
        match self {
            Self::AsBuilt { table, .. } => table.scattered,
            Self::Drawn { .. } | Self::Coupled { .. } | Self::Formed(_) => 0.0,
        }
    }
}

impl<'e> IncoherentFields<'e> {
    /// A made element in a light, behind the path and before the camera of a chip; `solved`: transmission of its widths.
    pub fn as_built(
        element: &'e AsBuiltElement,
        light: ArrivingLight,
        perturbation: &Perturbation,
        solved: &SolvedWidths,
    ) -> Self {
        Self::of_classes(
            element,
            element.tables_of(solved),
            solved.share,
            light,
            perturbation.path.added_distance_um(element.centre_um()),
            perturbation.camera.clone(),
        )
    }

    /// A made element by tables of its classes.
    pub(crate) fn of_classes(
        element: &'e AsBuiltElement,
        tables: Vec<ClassTable>,
        weight: f64,
        light: ArrivingLight,
        defocus_um: f64,
        camera: CameraChange,
    ) -> Self {
        let tables = tables.into_iter();
        Self {
            fields: tables.map(|table| Field::AsBuilt { element, table }).collect(),
            weight,
            light,
            defocus_um,
            camera,
            lattice: element.lattice(),
            radius_um: element.radius_um(),
            part_bytes: None,
        }
    }

    /// The fields of both polarisations as a set whose rows are formed, or sent to a window, together; none where that is done one by
    /// one.
    fn both_polarised(&self) -> Option<Box<dyn ApertureSet + '_>> {
        match &self.fields[..] {
            [Field::Formed(s), Field::Formed(p)] => Some(Box::new(Together(vec![s.as_ref(), p.as_ref()]))),
            [
                Field::Coupled {
                    sites, response, sines, ..
                },
                Field::Coupled { .. },
            ] => match response.as_ref() {
                CellResponse::Neighbours(NeighbourTables::Fitted(fitted)) => {
                    Some(Box::new(NeighbourPillars::polarised(sites, &fitted.responses, *sines)))
                }
                _ => None,
            },
            _ => None,
        }
    }

    /// Forms the rows of pillars among their neighbours once for light from several directions that is the same to them, and
    /// holds them: 8 bytes a site and polarisation. The fields stay the same to the last bit.
    ///
    /// # Errors
    /// If a pillar is in no table.
    pub fn share_rows(mut lit: Vec<&mut Self>) -> Result<()> {
        while let Some(first) = lit.pop() {
            let (mut equal, others): (Vec<_>, Vec<_>) = lit.into_iter().partition(|other| first.has_rows_of(other));
            lit = others;
            if equal.is_empty() {
                continue;
            }
            equal.push(first);
            let formed: Vec<_> = equal[0].formed()?.into_iter().map(Arc::new).collect();
            for fields in equal {
                fields.fields = formed.iter().map(|map| Field::Formed(Arc::clone(map))).collect();
            }
        }
        Ok(())
    }

    /// True if both are of the same pillars among neighbours, in light that is the same to them.
    fn has_rows_of(&self, other: &Self) -> bool {
        let mut pairs = self.fields.iter().zip(&other.fields);
        self.fields.len() == other.fields.len()
            && pairs.all(|(a, b)| a.rows().is_some_and(|rows| b.rows() == Some(rows)))
    }

    /// The transmissions of the sites of each field.
    fn formed(&self) -> Result<Vec<TransmissionMap>> {
        if let Some(set) = self.both_polarised() {
            return Ok(TransmissionMap::of_set(set.as_ref(), self.radius_um));
        }
        let of = |field: &Field<'_>| {
            let aperture = field.aperture(&self.light)?;
            Ok(TransmissionMap::of_set(
                &Together(vec![aperture.as_ref()]),
                self.radius_um,
            ))
        };
        let maps: Vec<_> = self.fields.iter().map(of).collect::<Result<_>>()?;
        Ok(maps.into_iter().flatten().collect())
    }

    /// Radius of the circle that light passes (um).
    pub fn radius_um(&self) -> f64 {
        self.radius_um
    }

    /// The PSF on a window at the stated distance of the sensor; where the sensor stands farther off, the window
    /// keeps its place in it; with the transfer of all light at `lp_mm` (line pairs a millimetre). Missing pillars scatter evenly over the window, blur and veil of the camera follow.
    ///
    /// # Errors
    /// If the window is none, or the light arrives too steeply.
    pub fn psf(&self, stated: Window, accuracy: Accuracy, lp_mm: &[f64], scratch: &mut Scratch) -> Result<Psf> {
        self.psf_by(&self.folded(stated, accuracy)?, lp_mm, scratch)
            .map(|psf| Psf { window: stated, ..psf })
    }

    /// PSFs at some stated distances of the sensor (um), in windows along the ray through the middle of a window, without
    /// transfers; see [`FoldedPropagator::fields_at`].
    ///
    /// # Errors
    /// As [`IncoherentFields::psf`].
    pub fn psfs_at(
        &self,
        stated: Window,
        distances_um: &[f64],
        accuracy: Accuracy,
        scratch: &mut Scratch,
    ) -> Result<Vec<Psf>> {
        let nearest_um = distances_um.iter().copied().fold(stated.distance_um, f64::min);
        let nearest = Window {
            distance_um: nearest_um,
            centre_um: stated.centre_um.map(|c| c * nearest_um / stated.distance_um),
            ..stated
        };
        let fold = self.folded(nearest, accuracy)?;
        let as_built: Vec<f64> = distances_um.iter().map(|z| z + self.defocus_um).collect();
        let of = |field: &Field<'_>| {
            let aperture = field.aperture(&self.light)?;
            let mut psfs = Psf::formed_at(&fold, aperture.as_ref(), &self.light.plane, &as_built, scratch)?;
            psfs.iter_mut().for_each(|psf| self.add_scattered(field, psf));
            Ok(psfs.into_iter())
        };
        let mut fields = self.fields.iter().map(of).collect::<Result<Vec<_>>>()?;
        let plane = |distance_um: &f64| {
            let psfs = fields.iter_mut().filter_map(Iterator::next).collect();
            let mut psf = self.together(psfs);
            psf.window.distance_um = *distance_um;
            psf
        };
        Ok(distances_um.iter().map(plane).collect())
    }

    /// A window at the stated distance of the sensor where the sensor is.
    fn moved(&self, stated: Window) -> Window {
        stated.at_distance(stated.distance_um + self.defocus_um)
    }

    /// A direction of arrival and the window of it that is stated.
    pub(crate) fn direction(&self, wave: PlaneWave, stated: Window) -> Direction {
        let window = self.moved(stated);
        Direction { wave, window }
    }

    /// The PSF of all fields behind the camera, from those of each.
    pub(crate) fn together(&self, psfs: Vec<Psf>) -> Psf {
        let mut psf = Psf::sum(psfs, self.weight);
        self.camera.apply(&mut psf);
        psf
    }

    /// The propagator to a window at the stated distance of the sensor.
    fn folded(&self, stated: Window, accuracy: Accuracy) -> Result<FoldedPropagator> {
        let window = self.moved(stated);
        let wavelength_um = self.light.plane.wavelength_um;
        let fold = FoldedPropagator::plan(self.lattice, self.radius_um, wavelength_um, window, accuracy)?;
        Ok(match self.part_bytes {
            Some(bytes) => fold.within(bytes),
            None => fold,
        })
    }

    /// Light that missing pillars of a field scatter evenly over the window.
    pub(crate) fn add_scattered(&self, field: &Field<'_>, psf: &mut Psf) {
        let (scattered, window) = (field.scattered(), psf.window);
        let cell_um2 = self.lattice.cell_um2();
        let wavelength_um = self.light.plane.wavelength_um;
        psf.values += scattered * spread(cell_um2, window.centre_um, window.distance_um, wavelength_um);
        if let Some(otf) = &mut psf.otf {
            otf.power_um2 += scattered * cell_um2;
        }
    }

    /// PSF by a propagator of the caller's, whose window is at the distance as fabricated.
    ///
    /// # Errors
    /// As [`Propagator::field`].
    pub fn psf_by(&self, propagator: &dyn Propagator, lp_mm: &[f64], scratch: &mut Scratch) -> Result<Psf> {
        let wave = &self.light.plane;
        let psfs = if let Some(set) = self.both_polarised() {
            Psf::formed_of_set(propagator, set.as_ref(), wave, lp_mm, scratch)?
        } else {
            let of = |field: &Field<'_>| {
                let aperture = field.aperture(&self.light)?;
                let mut psf = Psf::formed(propagator, aperture.as_ref(), wave, lp_mm, scratch)?;
                self.add_scattered(field, &mut psf);
                Ok(psf)
            };
            self.fields.iter().map(of).collect::<Result<Vec<_>>>()?
        };
        Ok(self.together(psfs))
    }
}

/// Intensity at a place on the sensor for a unit of |t|^2 that one site scatters on its own: the square of a term
/// of the Rayleigh-Sommerfeld sum, far from the site, that of the element's centre for all. `cell_um2` is the area of the cell of a site; lengths in um.
pub fn spread(cell_um2: f64, at_um: [f64; 2], distance_um: f64, wavelength_um: f64) -> f64 {
    let [x, y] = at_um;
    let r2 = x * x + y * y + distance_um * distance_um;
    (cell_um2 / (wavelength_um * r2) * distance_um).powi(2)
}
