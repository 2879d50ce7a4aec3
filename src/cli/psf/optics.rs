//! Cells, light and sensor by the options of `metalith psf`, and the assumptions beside them.

use metalith::cell::{
    CellStack, FittedCell, FocusedLight, FocusingStack, Handedness, Mapping, MixedCell, NeighbourCell, PointwiseCell,
    Polarisation, PolarisationAxis, PolarisedLight, PublishedCell, cache_folder, polarising_cell,
};
use metalith::design::CellFile;
use metalith::rcwa::CellLattice;
use metalith::report::{exact, sig};
use metalith::verify::{FocusRequest, Lighting};
use metalith::{
    AsBuiltChip, CalibratedModel, CellModel, Error, Extraction, LatticeKind, PillarShape, Pitch, PolarisationBasis,
    Result, Wedge,
};

use super::{FidelityArg, PsfArgs, PsfLight};

/// Height of pillars that no file states (nm).
const USUAL_HEIGHT_NM: f64 = 700.0;

impl PsfArgs {
    fn pitch_nm(found: &Extraction) -> Pitch {
        let first = found.elements.first();
        first.map_or(Pitch::whole(350), |e| e.site.lattice.pitch_nm())
    }

    pub(super) fn lattice_kind(found: &Extraction) -> LatticeKind {
        found
            .elements
            .first()
            .map_or(LatticeKind::Square, |e| e.site.lattice.kind())
    }

    /// The cell of the layout's own lattice.
    pub(super) fn stack(&self, found: &Extraction) -> Result<CellStack> {
        let pitch_nm = Self::pitch_nm(found);
        let stated = match &self.stated {
            Some(file) => file.stack()?,
            None => CellStack::paper(f64::from(pitch_nm), USUAL_HEIGHT_NM)?,
        };
        Ok(CellStack {
            pitch_nm: f64::from(pitch_nm),
            lattice: found
                .elements
                .first()
                .map_or(CellLattice::Square, |e| CellLattice::of(&e.site.lattice)),
            shape: found.shape,
            ..stated
        })
    }

    /// Material of the pillars, in words.
    pub(super) fn pillars(&self) -> String {
        let Some(CellFile { cell, .. }) = &self.stated else {
            return format!("{USUAL_HEIGHT_NM} nm of sin_luke_2015 on fused_silica_malitson_1965, lit from there");
        };
        let mut words = format!(
            "{} nm of {} on {}, lit from there",
            sig(cell.pillar_height_nm, 5),
            cell.pillar_material,
            cell.substrate_material
        );
        for layer in &cell.under {
            let height = exact(layer.height_nm);
            words += &if layer.material == cell.pillar_material {
                format!("; {height} nm of the film left between them")
            } else {
                format!("; a spacer of {height} nm of {} below the film", layer.material)
            };
        }
        words += &match &cell.ambient_material {
            Some(material) => format!("; in {material}"),
            None => format!("; in n = {}", exact(cell.ambient_index)),
        };
        words
    }

    /// Lattice as it was found and, where light is simulated, assumptions that no layout states, of the options or their defaults.
    pub(super) fn assumptions(&self, found: &Extraction, light: Option<&PsfLight>) -> Vec<(&'static str, String)> {
        let mut all = vec![(
            "pitch, as found",
            match Self::lattice_kind(found) {
                LatticeKind::Square => format!("{} nm", Self::pitch_nm(found)),
                kind @ LatticeKind::Hexagonal => format!("{} nm, of a {kind} lattice", Self::pitch_nm(found)),
            },
        )];
        if let Some(deg) = found.turned_deg {
            let words = format!(
                "at an angle of {} deg; places and directions are along rows and columns of its lattice",
                sig(deg, 6)
            );
            all.push(("the layout is placed", words));
        }
        if found.shape.basis().is_some() {
            all.push(("pillars, as found", found.shape.description()));
        }
        let Some(light) = light else { return all };
        all.extend([
            ("edge of a sensor pixel", format!("{} um", exact(self.pixel_um(light)))),
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
        ]);
        let published = self.model.is_none() && matches!(self.fidelity, FidelityArg::Published);
        let cell = match (&self.model, self.fidelity) {
            (Some(model), _) => format!("as made, by {}", model.display()),
            (None, FidelityArg::Published) => "published polynomials for pillars of the paper, no amplitude".into(),
            (None, FidelityArg::Fitted) => "polynomials fitted to the rigorous cell, no amplitude".into(),
            (None, FidelityArg::Neighbours) => {
                let white = match &light.white {
                    Some(_) => {
                        let tables: Vec<String> = light.tabulated_um().iter().map(|um| exact(um * 1e3)).collect();
                        format!(
                            "; polychromatic light is interpolated between the wavelengths that have tables, {} nm",
                            tables.join(", ")
                        )
                    }
                    None => String::new(),
                };
                format!("each pillar among its neighbours, fitted to supercells of the layout's own widths{white}")
            }
            (None, FidelityArg::Rigorous) => "rigorous coupled-wave analysis of a lattice of equal pillars".into(),
        };
        all.push(("cell", cell));
        if found.shape.basis().is_some() {
            all.push(("polarisation", self.polarised(found.shape)));
        }
        if !published {
            all.push(("pillars", self.pillars()));
        }
        all
    }

    /// Polarisation of the light that arrives at pillars of a shape.
    pub(super) fn arriving(&self, shape: PillarShape) -> Polarisation {
        let usual = match shape.basis() {
            Some(PolarisationBasis::Linear) => PolarisationAxis::X.polarisation(),
            _ => Polarisation::Circular(Handedness::default()),
        };
        self.arriving.unwrap_or(usual)
    }

    /// The light that they are taken to focus.
    fn focused(&self, shape: PillarShape) -> FocusedLight {
        match shape.basis() {
            Some(PolarisationBasis::Linear) => FocusedLight::Linear(PolarisationAxis::nearest(self.arriving(shape))),
            _ => FocusedLight::Circular(self.hand().unwrap_or_default()),
        }
    }

    /// The circular polarisation that the layout focuses, if options say.
    pub(super) fn hand(&self) -> Option<Handedness> {
        let stated = self.stated.as_ref().and_then(|file| file.cell.arriving);
        match (self.focused.map(Handedness::from).or(stated), self.arriving) {
            (Some(focused), _) => Some(focused),
            (None, Some(Polarisation::Circular(hand))) => Some(hand),
            (None, None) => Some(Handedness::default()),
            (None, Some(_)) => None,
        }
    }

    fn polarised_light(&self, shape: PillarShape) -> PolarisedLight {
        PolarisedLight {
            arriving: Some(self.arriving(shape)),
            analyser: self.analyser,
        }
    }

    /// Source and detector at pillars of a shape, in words.
    fn polarised(&self, shape: PillarShape) -> String {
        let (arriving, light) = (self.arriving(shape), self.polarised_light(shape));
        let focused = match (shape.basis(), self.hand()) {
            (Some(PolarisationBasis::Circular), Some(hand)) => format!(", {hand} is focused"),
            _ => String::new(),
        };
        let detector = light.detector(self.focused(shape));
        format!("light arrives {arriving}{focused}; {detector}; figures are of all that arrives")
    }

    /// The chip as a measured process makes it.
    pub(super) fn made(&self, found: &Extraction, model: &CalibratedModel) -> Result<AsBuiltChip> {
        let shape = found.shape;
        let stated = FocusingStack {
            stack: self.stack(found)?,
            focused: shape.basis().map(|_| self.focused(shape)),
        };
        model.check_drawn(&stated.stack, found.elements.iter().map(|e| e.widths.histogram()))?;
        Ok(AsBuiltChip::in_light(&stated, model)?.cached_in(cache_folder().as_deref()))
    }

    /// Cell that solves it for the pillars as drawn.
    pub(super) fn cell(&self, found: &Extraction, light: &PsfLight) -> Result<Box<dyn CellModel>> {
        let (stack, cache) = (self.stack(found)?, cache_folder());
        let focused = self.focused(found.shape);
        if let Some(cell) = polarising_cell(&stack, focused, cache.as_deref()) {
            return Ok(cell);
        }
        if matches!(self.fidelity, FidelityArg::Published) {
            return Ok(Box::new(PublishedCell::of_stack(&stack)?));
        }
        if matches!(self.fidelity, FidelityArg::Neighbours) {
            let mapping = Mapping::of_widths(found.elements.iter().map(|e| e.widths.histogram()))?;
            let cell = NeighbourCell::new(stack, vec![mapping], cache);
            return Ok(Box::new(cell.tabulated_at(&light.tabulated_um())));
        }
        let mut widths = found
            .elements
            .iter()
            .flat_map(|e| e.widths.number.iter().copied())
            .collect::<Vec<_>>();
        widths.sort_unstable();
        widths.dedup();
        if found.shape == PillarShape::Mixed {
            return Ok(Box::new(MixedCell::new(&stack, widths).cached_in(cache.as_deref())));
        }
        if matches!(self.fidelity, FidelityArg::Fitted) {
            let band_um = light.band_um(stack.range_um());
            let range = (
                *widths.iter().find(|w| **w > 0).unwrap_or(&100),
                *widths.last().unwrap_or(&300),
            );
            return Ok(Box::new(FittedCell::of_stack(
                &stack,
                band_um,
                range,
                cache.as_deref(),
            )?));
        }
        Ok(Box::new(PointwiseCell::new(stack, widths).cached_in(cache.as_deref())))
    }

    /// The wedge of the elements, by the options.
    pub(super) fn wedge(&self) -> Result<Wedge> {
        let sines = [self.wedge_x_deg, self.wedge_y_deg].map(|deg| deg.to_radians().sin());
        if !(self.wedge_wavelength_nm > 0.0 && sines[0].hypot(sines[1]) < 1.0) {
            return Err(Error::refused(
                "option/wedge-out-of-range",
                "the wedge steers beyond 90 degrees, or its wavelength is not positive",
                "give smaller --wedge-x-deg and --wedge-y-deg, and a positive --wedge-wavelength-nm",
            ));
        }
        Ok(Wedge {
            wavelength_um: self.wedge_wavelength_nm * 1e-3,
            sin_x: sines[0],
            sin_y: sines[1],
        })
    }

    pub(super) fn lighting(&self, light: &PsfLight, shape: PillarShape) -> Lighting {
        Lighting {
            wavelengths_um: light.wavelengths_um.clone(),
            incidence_sin: [self.angle_x_deg, self.angle_y_deg].map(|deg| deg.to_radians().sin()),
            oblique_cells: self.oblique,
            distance_um: self.distance_um,
            at_um: [self.at_x_um, self.at_y_um],
            samples: self.samples,
            pixel_um: self.pixel_um(light),
            polarised: self.polarised_light(shape),
            aperture_radius_um: self.aperture_um.map(|d| 0.5 * d),
            accuracy: self.accuracy.accuracy(),
            through_focus: self.through_focus.map(|range_um| FocusRequest {
                range_um,
                planes: self.planes,
            }),
        }
    }
}
