//! What the options of `metalith psf` say of cells, light and sensor, and what is taken for granted.

use std::path::Path;

use metalith::cell::{CellStack, FittedCell, Handedness, PointwiseCell, PublishedCell, RotatedCell, cache_folder};
use metalith::grating::{Mapping, NeighbourCell};
use metalith::rcwa::{CellLattice, Material};
use metalith::report::sig;
use metalith::verify::Lighting;
use metalith::{Accuracy, CellModel, Error, Extraction, LatticeKind, Result, Wedge};

use super::{FidelityArg, PsfArgs, USUAL_NM};

impl PsfArgs {
    fn pitch_nm(found: &Extraction) -> u32 {
        found.elements.first().map_or(350, |e| e.site.lattice.pitch_nm())
    }

    pub(super) fn lattice_kind(found: &Extraction) -> LatticeKind {
        found
            .elements
            .first()
            .map_or(LatticeKind::Square, |e| e.site.lattice.kind())
    }

    /// The cell of the layout's own lattice.
    pub(super) fn stack(&self, found: &Extraction) -> Result<CellStack> {
        let here = Path::new("");
        Ok(CellStack {
            lattice: CellLattice::drawn(Self::lattice_kind(found), Self::pitch_nm(found)),
            shape: found.shape,
            film: Material::resolve(&self.pillar_material, here)?,
            substrate: Material::resolve(&self.substrate_material, here)?,
            ..CellStack::paper(f64::from(Self::pitch_nm(found)), self.height_nm)?
        })
    }

    /// What no layout says, and is taken from the options or their defaults.
    pub(super) fn assumptions(&self, found: &Extraction) -> Vec<(&'static str, String)> {
        let mut all = vec![
            (
                "pitch, as found",
                match Self::lattice_kind(found) {
                    LatticeKind::Square => format!("{} nm", Self::pitch_nm(found)),
                    LatticeKind::Hexagonal => format!("{} nm, of a hexagonal lattice", Self::pitch_nm(found)),
                },
            ),
            (
                "distance from pillar tops to sensor",
                format!("{} um", sig(self.distance_um, 6)),
            ),
            (
                "light arrives at",
                format!(
                    "({}, {}) deg in air",
                    sig(self.angle_x_deg, 4),
                    sig(self.angle_y_deg, 4)
                ),
            ),
        ];
        let published = self.model.is_none() && matches!(self.fidelity, FidelityArg::Published);
        let cell = match (&self.model, self.fidelity) {
            (Some(model), _) => format!("as made, by {}", model.display()),
            (None, FidelityArg::Published) => "published polynomials for pillars of the paper, no amplitude".into(),
            (None, FidelityArg::Fitted) => "polynomials fitted to the rigorous cell, no amplitude".into(),
            (None, FidelityArg::Neighbours) => {
                let white = match self.camera {
                    Some(_) => format!(
                        "; white light is between the wavelengths that have tables, {USUAL_NM:?} nm and those of \
                         --wavelength-nm"
                    ),
                    None => String::new(),
                };
                format!("each pillar among its neighbours, fitted to supercells of the layout's own widths{white}")
            }
            (None, FidelityArg::Rigorous) => "rigorous coupled-wave analysis of a lattice of equal pillars".into(),
        };
        all.push(("cell", cell));
        if let Some(pillars) = found.shape.rectangles() {
            let arriving = Handedness::from(self.arriving);
            let rotations = format!(
                "{} x {} nm, read to {} degrees; light arrives {arriving} circularly polarised, {}",
                pillars.width_nm,
                pillars.length_nm,
                pillars.step_deg(),
                if self.analyser {
                    "an analyser keeps what is not converted from the sensor"
                } else {
                    "what is not converted is in the figures"
                },
            );
            all.push(("rotated rectangles", rotations));
        }
        if !published {
            let stack = format!(
                "{} nm of {} on {}, lit from there",
                sig(self.height_nm, 5),
                self.pillar_material,
                self.substrate_material
            );
            all.push(("pillars", stack));
        }
        all
    }

    /// What solves it for the pillars as drawn.
    pub(super) fn cell(&self, found: &Extraction) -> Result<Box<dyn CellModel>> {
        let stack = self.stack(found)?;
        if let Some(pillars) = found.shape.rectangles() {
            return Ok(Box::new(RotatedCell::new(stack, pillars, self.arriving.into())));
        }
        if matches!(self.fidelity, FidelityArg::Published) {
            return Ok(Box::new(PublishedCell::new(stack.pitch_nm as u32)));
        }
        if matches!(self.fidelity, FidelityArg::Neighbours) {
            let mapping = Mapping::of_widths(found.elements.iter().map(|e| e.widths.histogram()))?;
            let cell = NeighbourCell::new(stack, vec![mapping], cache_folder());
            // White light is known between wavelengths that have tables, and little beyond.
            let of_white = USUAL_NM.iter().filter(|_| self.camera.is_some()).map(|nm| nm * 1e-3);
            let tabulated: Vec<f64> = self.wavelengths_um().into_iter().chain(of_white).collect();
            return Ok(Box::new(cell.tabulated_at(&tabulated)));
        }
        let mut widths = found
            .elements
            .iter()
            .flat_map(|e| e.widths.width_nm.iter().copied())
            .collect::<Vec<_>>();
        widths.sort_unstable();
        widths.dedup();
        if matches!(self.fidelity, FidelityArg::Fitted) {
            let band_um = self.wavelengths_um().into_iter();
            let (low, high) = band_um.fold((0.4, 0.7), |(a, b), um| (um.min(a), um.max(b)));
            let range = (
                *widths.iter().find(|w| **w > 0).unwrap_or(&100),
                *widths.last().unwrap_or(&300),
            );
            return Ok(Box::new(FittedCell::of_stack(&stack, (low, high), range)?));
        }
        Ok(Box::new(PointwiseCell::new(stack, widths)))
    }

    fn wavelengths_um(&self) -> Vec<f64> {
        self.wavelengths_nm.iter().map(|nm| nm * 1e-3).collect()
    }

    /// The wedge of the elements, by the options.
    pub(super) fn wedge(&self) -> Result<Wedge> {
        let sines = [self.wedge_x_deg, self.wedge_y_deg].map(|deg| deg.to_radians().sin());
        if !(self.wedge_wavelength_nm > 0.0 && sines[0].hypot(sines[1]) < 1.0) {
            return Err(Error::invalid(
                "a wedge that steers beyond the horizon or at no wavelength",
                "give smaller --wedge-x-deg and --wedge-y-deg, and a positive --wedge-wavelength-nm",
            ));
        }
        Ok(Wedge {
            wavelength_um: self.wedge_wavelength_nm * 1e-3,
            sin_x: sines[0],
            sin_y: sines[1],
        })
    }

    pub(super) fn lighting(&self) -> Lighting {
        Lighting {
            wavelengths_um: self.wavelengths_um(),
            incidence_sin: [self.angle_x_deg, self.angle_y_deg].map(|deg| deg.to_radians().sin()),
            cells_as_lit: self.as_lit,
            distance_um: self.distance_um,
            at_um: [self.at_x_um, self.at_y_um],
            samples: self.samples,
            pixel_um: 5.86,
            analyser: self.analyser,
            aperture_radius_um: self.aperture_um.map(|d| 0.5 * d),
            accuracy: if self.fast { Accuracy::Fast } else { Accuracy::Accurate },
        }
    }
}
