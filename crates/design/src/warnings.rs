//! What a design may be and easily is by mistake.

use metalith_core::{Result, Warning};
use metalith_pillars::Steepness;

use crate::phase::{ElementPhase, LensPhase};
use crate::{AskedLight, Design, LatticeOrders};

/// Sites of a design whose phase is compared with the phase of their neighbours: of larger elements some rows are.
const MOST_SITES: usize = 1 << 22;

/// Rows of an element that are compared at least.
const FEWEST_ROWS: usize = 16;

/// Wavelengths that differ by less are one (um): the rounding of a file.
const ROUNDING_UM: f64 = 1e-7;

impl Design {
    /// All warnings about the design, those about its mapping first.
    ///
    /// # Errors
    /// If a material is not known at a wavelength.
    pub fn warnings(&self) -> Result<Vec<Warning>> {
        let mut found = self.mapping_warnings();
        found.extend(self.wavelengths_differ());
        found.extend(self.unwrapped_tables());
        found.extend(self.steep_phase());
        found.extend(lattice_warning(
            &self.lattice_orders(AskedLight::All)?,
            self.cell.pitch_nm,
        ));
        Ok(found)
    }

    /// Warnings about the cell that the mapping is for.
    pub fn mapping_warnings(&self) -> Vec<Warning> {
        let own = self.cell.mapped(self.mapping.wavelength_um);
        self.mapping.identity.warnings(&own).collect()
    }

    /// Wavelengths of phase, mapping and wedges that are not one.
    fn wavelengths_differ(&self) -> Option<Warning> {
        let elements = self.elements();
        let phases = elements.iter().filter_map(|e| self.lens_of(e).focused_um());
        let wedges = elements.iter().map(|e| e.wedge);
        let wedges = wedges.filter(|wedge| (wedge.sin_x, wedge.sin_y) != (0.0, 0.0));
        let phases: Vec<f64> = distinct(phases);
        let wedges: Vec<f64> = distinct(wedges.map(|wedge| wedge.wavelength_um));
        let mapping = vec![self.mapping.wavelength_um];
        let all = distinct([&phases, &mapping, &wedges].into_iter().flatten().copied());
        if all.len() < 2 {
            return None;
        }
        let named = [("phase", phases), ("mapping", mapping), ("wedges", wedges)];
        let named: Vec<String> = named
            .into_iter()
            .filter(|(_, um)| !um.is_empty())
            .map(|(name, um)| {
                let nm: Vec<String> = um.iter().map(|um| format!("{}", (um * 1e6).round() / 1e3)).collect();
                format!("{name} {} nm", nm.join(", "))
            })
            .collect();
        Some(Warning::new(
            "design/wavelengths-differ",
            format!(
                "parts of the design are for different wavelengths: {}",
                named.join("; ")
            ),
            "use one wavelength in [phase], [mapping] and [array], unless this is meant",
        ))
    }

    /// Tables of phases that jump by whole waves.
    fn unwrapped_tables(&self) -> Option<Warning> {
        let own = self.array.placed.iter().filter_map(|p| p.lens.as_ref());
        let files = std::iter::once(&self.lens).chain(own).flat_map(|lens| lens.unwrapped());
        let mut names: Vec<String> = files.map(|file| file.display().to_string()).collect();
        names.dedup();
        (!names.is_empty()).then(|| {
            Warning::new(
                "phase/unwrapped",
                format!(
                    "phases of {} are wrapped: whole waves are added where they jump",
                    names.join(", ")
                ),
                "give unwrapped phases, or `wrapped = \"no\"` if the jumps are meant",
            )
        })
    }

    /// Pillars between which the phase steps by more than half a wave.
    fn steep_phase(&self) -> Option<Warning> {
        let (lens, elements) = (LensPhase::of(self), self.elements());
        let lattice = lens.lattice();
        let rows = (MOST_SITES / elements.len().max(1) / lattice.sites()).max(FEWEST_ROWS);
        let one_in = lattice.sites().div_ceil(rows);
        let mut all = Steepness::default();
        for element in &elements {
            let phase = ElementPhase::of(&lens, element);
            // Maps that are known up to whole waves jump where nothing does.
            let known = |ix, iy| phase.parts(ix, iy).map(|[known, _]| known);
            let found = Steepness::of_rows(&lattice, one_in, known);
            all.sites += found.sites;
            all.steep_sites += found.steep_sites;
            all.largest_step_rad = all.largest_step_rad.max(found.largest_step_rad);
        }
        (all.steep_sites > 0).then(|| {
            let percent = 100.0 * all.steep_sites as f64 / all.sites as f64;
            Warning::new(
                "phase/steep",
                format!(
                    "the phase steps by more than pi from one pillar to the next at {percent:.1} % of the pillars, by up to {:.2} rad: \
                     there the lattice cannot follow it",
                    all.largest_step_rad
                ),
                "use a smaller pitch, a longer focal length, a smaller diameter, or less steering",
            )
        })
    }
}

/// Light that the lattice diffracts, and the pitch (nm) that would not.
fn lattice_warning(orders: &[LatticeOrders], pitch_nm: u32) -> Option<Warning> {
    let pitches = orders.iter().map(|o| o.wavelength_um / o.edge_um * f64::from(pitch_nm));
    let pitch = pitches.fold(f64::INFINITY, f64::min).floor();
    (!orders.is_empty()).then(|| {
        Warning::new(
            "lattice/diffracts",
            LatticeOrders::summary(orders).join("; "),
            format!(
                "a pitch of up to {pitch} nm, instead of {pitch_nm} nm, has no such orders; or use longer wavelengths"
            ),
        )
    })
}

/// Wavelengths in rising order, each once.
fn distinct(um: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut um: Vec<f64> = um.collect();
    um.sort_by(f64::total_cmp);
    um.dedup_by(|a, b| (*a - *b).abs() < ROUNDING_UM);
    um
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn warned(name: &str, changes: &[(&str, &str)]) -> Vec<Warning> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../designs/{name}.toml"));
        let mut text = std::fs::read_to_string(&path).unwrap();
        for (from, to) in changes {
            assert!(text.contains(from), "{from}");
            text = text.replacen(from, to, 1);
        }
        Design::parse(&path, &text).unwrap().warnings().unwrap()
    }

    fn ids(warnings: &[Warning]) -> Vec<&'static str> {
        warnings.iter().map(|w| w.id).collect()
    }

    #[test]
    fn a_sound_design_has_no_warnings() {
        for name in ["asi_940", "silicon_10600"] {
            assert_eq!(warned(name, &[]), [], "{name}");
        }
    }

    #[test]
    fn wavelengths_that_differ_are_named() {
        let found = warned("tio2_532", &[("wavelength_nm = 532", "wavelength_nm = 633")]);
        let found = found.iter().find(|w| w.id == "design/wavelengths-differ").unwrap();
        assert!(found.what.ends_with("phase 633 nm; mapping 532 nm"), "{found}");
    }

    #[test]
    fn a_steep_phase_is_named_with_its_share() {
        // At the rim, sin(theta) = 0.89: 0.32 um * 0.89 / 0.532 um = 0.54 waves along a row.
        let found = warned("tio2_532", &[("focal_length_um = 80", "focal_length_um = 20")]);
        let found = found.iter().find(|w| w.id == "phase/steep").unwrap();
        assert!(found.what.contains(" % of the pillars, by up to 3.3"), "{found}");
        assert!(!ids(&warned("tio2_532", &[])).contains(&"phase/steep"));
    }

    #[test]
    fn a_lattice_that_diffracts_is_named_with_a_pitch_that_does_not() {
        let found = warned("mini_3x3", &[]);
        assert_eq!(ids(&found), ["design/wavelengths-differ", "lattice/diffracts"]);
        assert!(found[1].what.contains("into the substrate"), "{}", found[1]);
    }
}
