//! `[lens]` and `[phase]`: the lens that all elements share, or that one of them has in its place.

use std::path::Path;

use serde::Serialize;

use super::array::whole_nm;
use super::outline::{self, DIAMETER, LensOutline};
use super::{CellSpec, phase_term};
use crate::phase::{Interpolation, PhaseTerm, RadialPhase, TableReading, TermForm};
use metalith_core::Error;
use metalith_core::document::{Limits, Section};
use metalith_pillars::PolarisationBasis;

/// The lens that all elements of the array share, or that one element alone has.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LensSpec {
    /// Pillars stand where their centre is within this diameter (nm).
    pub diameter_nm: u32,
    /// And within this outline, if it is no circle; the diameter is that of the circle about it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outline: Option<LensOutline>,
    /// Distance from the pillar tops to the sensor (um).
    pub focal_length_um: f64,
    /// Phase over the radius, before wedge and modulo.
    pub phase: RadialPhase,
    /// Phases over the plane that are added to it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<PhaseTerm>,
    /// Phase of light polarised along y, for upright rectangles, if it is another than the phase of light along x.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub along_y: Option<PhaseAlongY>,
}

/// The phase of light polarised along y, before wedge and modulo.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PhaseAlongY {
    /// Phase over the radius.
    pub phase: RadialPhase,
    /// Phases over the plane that are added to it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<PhaseTerm>,
}

impl LensSpec {
    pub fn read(lens: &Section<'_, '_>, phase: &Section<'_, '_>, cell: &CellSpec) -> Self {
        let (diameter_nm, outline) = outline::read(lens, cell);
        let focal_length_um = lens.float("focal_length_um", FOCAL_LENGTH);
        lens.finish();
        let mut it = Self {
            diameter_nm,
            outline,
            focal_length_um,
            phase: RadialPhase::Flat,
            terms: Vec::new(),
            along_y: None,
        };
        it.read_phase(phase, cell);
        it
    }

    /// The lens of an element that is placed individually, if it says anything of it; the rest is as in the lens that
    /// all share, whose phase `shared_phase` says.
    pub(super) fn read_own(
        s: &Section<'_, '_>,
        shared: &Self,
        shared_phase: &Section<'_, '_>,
        index: (i32, i32),
        cell: &CellSpec,
    ) -> Option<Self> {
        let phase = s.optional_section("phase");
        let sized = s.has("diameter_um") || s.has("aperture");
        if phase.is_none() && !sized && !s.has("focal_length_um") {
            return None;
        }
        let (diameter_nm, outline) = if sized {
            outline::read(s, cell)
        } else {
            (shared.diameter_nm, shared.outline.clone())
        };
        let mut own = Self {
            diameter_nm,
            outline,
            focal_length_um: s.float_or("focal_length_um", FOCAL_LENGTH, shared.focal_length_um),
            ..shared.clone()
        };
        if let Some(phase) = phase {
            own.read_phase(&phase, cell);
        } else {
            // A hyperbola that names no focal length has that of the element; its radius of normalisation is no other.
            let focal_length_um = own.focal_length_um;
            let renew = |phase: &mut RadialPhase, terms: &mut Vec<PhaseTerm>, said: &Section<'_, '_>| {
                *phase = read_radial(said, focal_length_um, shared.radius_um());
                let sections = said.sections("term");
                for (term, said) in terms.iter_mut().zip(phase_term::sections(said, &sections)) {
                    phase_term::default_focal_length(term, said, focal_length_um);
                }
                terms.retain(|term| term.is_of(index));
            };
            renew(&mut own.phase, &mut own.terms, shared_phase);
            if let (Some(y), Some(said)) = (&mut own.along_y, shared_phase.optional_section("y")) {
                renew(&mut y.phase, &mut y.terms, &said);
            }
        }
        Some(own)
    }

    /// The phase that a section says, of a lens with this diameter and focal length.
    fn read_phase(&mut self, s: &Section<'_, '_>, cell: &CellSpec) {
        let (focal_length_um, radius_um) = (self.focal_length_um, self.radius_um());
        let read = |s: &Section<'_, '_>| {
            let radial = read_radial(s, focal_length_um, radius_um);
            let terms = s.sections("term");
            let of_phase = phase_term::is_plane(s).then(|| phase_term::read_keys(s, focal_length_um, radius_um));
            let terms = terms
                .iter()
                .map(|term| phase_term::read(term, focal_length_um, radius_um));
            (radial, of_phase.into_iter().chain(terms).collect())
        };
        (self.phase, self.terms) = read(s);
        self.along_y = s.optional_section("y").map(|y| {
            let (phase, terms) = read(&y);
            y.finish();
            PhaseAlongY { phase, terms }
        });
        if self.along_y.is_some() && cell.shape.basis() != Some(PolarisationBasis::Linear) {
            s.fault_given(
                &["cell.shape"],
                "y",
                format!(
                    "a phase of light polarised along y, and {} give all light one",
                    cell.shape.plural()
                ),
                "leave [phase.y] out, or use `shape = \"upright_rectangle\"`",
            );
        }
        s.finish();
    }

    /// The lens that light along y sees.
    #[must_use]
    pub fn seen_along_y(&self) -> Self {
        let mut seen = self.clone();
        if let Some(PhaseAlongY { phase, terms }) = seen.along_y.take() {
            (seen.phase, seen.terms) = (phase, terms);
        }
        seen
    }

    /// Read the files that its phase names, of the phases over the plane those that elements of this lens have. The errors are of
    /// those that cannot be used.
    pub(crate) fn load(&mut self, is_had: impl Fn(&PhaseTerm) -> bool) -> Vec<Error> {
        let (radius_um, ends_um) = (self.radius_um(), self.ends_um());
        let load = |phase: &mut RadialPhase, terms: &mut Vec<PhaseTerm>| {
            let radial = phase.load(radius_um);
            let had = terms.iter_mut().filter(|term| is_had(term));
            let terms = had.map(|term| term.load(radius_um, ends_um));
            let all = std::iter::once(radial).chain(terms);
            all.filter_map(Result::err).collect::<Vec<_>>()
        };
        let mut errors = load(&mut self.phase, &mut self.terms);
        if let Some(y) = &mut self.along_y {
            errors.extend(load(&mut y.phase, &mut y.terms));
        }
        errors
    }

    /// The files that its phases name, each with what it holds.
    pub fn phase_files(&self) -> impl Iterator<Item = (&Path, &'static str)> {
        let along_y = self.along_y.iter().map(|y| (&y.phase, &y.terms));
        std::iter::once((&self.phase, &self.terms))
            .chain(along_y)
            .flat_map(|(phase, terms)| {
                let table = match phase {
                    RadialPhase::Table { file, .. } => Some((file.as_path(), "phase of the lens over its radius")),
                    _ => None,
                };
                let terms = terms.iter().filter_map(|term| term.file.as_deref());
                table
                    .into_iter()
                    .chain(terms.map(|file| (file, "a phase over the plane of the lens")))
            })
    }

    /// Files of its phases over the radius to which whole waves were added.
    pub(crate) fn unwrapped(&self) -> impl Iterator<Item = &Path> {
        self.radial_phases().filter_map(RadialPhase::unwrapped)
    }

    /// Least and greatest place of the aperture from the middle, along x and along y (um), as the phase has it: before the element
    /// is rotated.
    fn ends_um(&self) -> [[f64; 2]; 2] {
        match &self.outline {
            Some(outline) => outline.ends_nm().map(|ends| ends.map(|nm| nm as f64 / 1e3)),
            None => [[-self.radius_um(), self.radius_um()]; 2],
        }
    }

    /// Wavelength that its hyperbola focuses (um), of its radius or the first over the plane; none where it has no hyperbola.
    pub fn focused_um(&self) -> Option<f64> {
        let terms = self.terms.iter().filter_map(|term| match &term.form {
            TermForm::Radial(radial) => Some(radial),
            _ => None,
        });
        std::iter::once(&self.phase)
            .chain(terms)
            .find_map(|radial| match radial {
                RadialPhase::Hyperbola { wavelength_um, .. } => Some(*wavelength_um),
                _ => None,
            })
    }

    /// Phases over the radius, in the middle of the lens or elsewhere, of light along x and along y.
    pub(crate) fn radial_phases(&self) -> impl Iterator<Item = &RadialPhase> {
        let along_y = self.along_y.iter().map(|y| (&y.phase, &y.terms));
        std::iter::once((&self.phase, &self.terms))
            .chain(along_y)
            .flat_map(|(phase, terms)| {
                let of_terms = terms.iter().filter_map(|term| match &term.form {
                    TermForm::Radial(radial) => Some(radial),
                    _ => None,
                });
                std::iter::once(phase).chain(of_terms)
            })
    }

    /// Half the diameter (um).
    pub fn radius_um(&self) -> f64 {
        f64::from(self.diameter_nm) * 0.5e-3
    }
}

/// Focal lengths of lenses, and distances of sensors: up to those of a lens of a whole wafer.
pub const FOCAL_LENGTH: Limits = Limits::new(1.0..=1_000_000.0, "um");

/// The diameter that a section says (nm).
pub(super) fn read_diameter(s: &Section<'_, '_>, cell: &CellSpec) -> u32 {
    let diameter_um = s.float("diameter_um", DIAMETER);
    let diameter_nm = whole_nm(s, "diameter_um", diameter_um) as u32;
    if cell.lattice_covering(diameter_nm).is_err() {
        s.fault_given(
            &["cell.pitch_nm"],
            "diameter_um",
            "the lens has no sites on this lattice",
            "make it larger than the pitch",
        );
    }
    diameter_nm
}

/// The radius that powers are of (um): that of the lens, if a section says no other.
pub(super) fn read_normalisation(s: &Section<'_, '_>, radius_um: f64) -> f64 {
    s.float_or("normalisation_radius_um", Limits::new(1e-3..=1e6, "um"), radius_um)
}

/// The phase over the radius that a section says.
pub(super) fn read_radial(s: &Section<'_, '_>, focal_length_um: f64, radius_um: f64) -> RadialPhase {
    #[derive(Clone, Copy, PartialEq)]
    enum PhaseSource {
        Hyperbola,
        EvenPowers,
        Table,
        Flat,
    }
    let sources = [
        ("hyperbola", PhaseSource::Hyperbola),
        ("even_powers", PhaseSource::EvenPowers),
        ("table", PhaseSource::Table),
        ("flat", PhaseSource::Flat),
        // Phases over the plane, which are read as terms.
        ("map", PhaseSource::Flat),
        ("zernike", PhaseSource::Flat),
        ("polynomial", PhaseSource::Flat),
        ("optic_studio", PhaseSource::Flat),
    ];
    match s.choice("source", &sources, None) {
        PhaseSource::Hyperbola => RadialPhase::Hyperbola {
            wavelength_um: s.float("wavelength_nm", WAVELENGTH) * 1e-3,
            focal_length_um: s.float_or("focal_length_um", FOCAL_LENGTH, focal_length_um),
        },
        PhaseSource::EvenPowers => {
            let coefficients_rad = s.floats("coefficients_rad", COEFFICIENT);
            if coefficients_rad.is_empty() {
                s.fault(
                    "coefficients_rad",
                    "a phase of even powers needs coefficients",
                    "list those of (r/R)^2, (r/R)^4, ... in radians",
                );
            }
            RadialPhase::EvenPowers {
                coefficients_rad,
                normalisation_um: read_normalisation(s, radius_um),
            }
        }
        PhaseSource::Table => RadialPhase::table(s.file("file"), Interpolation::read(s)).read_as(TableReading::read(s)),
        PhaseSource::Flat => RadialPhase::Flat,
    }
}

/// A hundred million turns: beyond it the fraction of a turn has fewer digits in double precision than a layout needs.
pub(super) const COEFFICIENT: Limits = Limits {
    range: -6e8..=6e8,
    unit: "rad",
};

/// Wavelengths from the ultraviolet to the thermal infrared: a value in um instead of nm falls outside.
pub(crate) const WAVELENGTH: Limits = Limits {
    range: 150.0..=20_000.0,
    unit: "nm",
};
