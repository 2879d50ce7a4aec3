//! Properties of a design that are allowed and easily are mistakes.

use metalith_cell::Fidelity;
use metalith_core::{Result, Warning, numerical_aperture};
use metalith_pillars::{DatabaseUnit, PillarShape, Pitch, Steepness};
use metalith_rcwa::Material;

use crate::phase::{ElementPhase, LensPhase, RadialPhase, TermForm};
use crate::{AskedLight, CellIncidence, CellSpec, Design, LatticeOrders, LensSpec};

/// Sites of a design whose phase is compared with the phase of their neighbours: of larger elements some rows are.
const MOST_SITES: usize = 1 << 19;

/// Rows of an element that are compared at least.
const FEWEST_ROWS: usize = 16;

/// Angle at which light arrives (degrees) beyond which cells that are solved at normal incidence are too good: at 15 degrees, Strehl
/// ratios of arrays of TiO2 pillars fall from 0.96 to 0.90.
pub const MOST_NORMAL_DEG: f64 = 10.0;

/// Share of the light that one pass through the film of the pillars absorbs, beyond which a mask of another material is better: shipped
/// designs lose less.
const MOST_ABSORBED: f64 = 0.1;

/// Height over width of the narrowest pillar that is written: beyond it no lens has been published.
const MOST_SLENDER: f64 = 20.0;

/// Ratio of the size of a map to that of the lens beyond which its pitch may be wrong.
const WIDE_MAP: f64 = 4.0;

/// Area of the opening beside the lens, in parts of the lens.
const WIDE_MARGIN: f64 = 0.6;

/// Share of a wavelength by which the nearest wavelength of [verify] may be off the phase: a lens moves its focus by this share of the
/// focal length.
const VERIFIED_NEAR: f64 = 0.05;

/// Sine of the marginal ray beyond which neither the scalar field nor the local periodic approximation is proven.
const MOST_SINE: f64 = 0.9;

/// Standard deviation of the distance to the sensor, in depths of focus of the design (wavelength over the square of the numerical
/// aperture): two depths off, the axis of an ideal lens is dark.
const MOST_DEPTHS: f64 = 2.0;

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
        found.extend(self.beyond_scalar());
        found.extend(self.unwrapped_tables());
        found.extend(crate::focus::warning(self));
        found.extend(self.wide_maps());
        found.extend(self.other_discs());
        found.extend(self.wide_margins());
        found.extend(self.coarse_circles());
        found.extend(self.rounded_places());
        found.extend(self.steep_phase());
        found.extend(self.steered_at_normal_incidence());
        found.extend(self.slender_pillars());
        found.extend(self.absorbing_pillars()?);
        found.extend(self.other_pixels());
        found.extend(self.beyond_focus());
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

    /// Wavelengths of phase, mapping and wedges that are not one, or are not near those of [verify].
    fn wavelengths_differ(&self) -> Option<Warning> {
        let elements = self.elements();
        let lenses = elements.iter().map(|e| self.lens_of(e));
        let phases = lenses
            .flat_map(LensSpec::radial_phases)
            .filter_map(|radial| match radial {
                RadialPhase::Hyperbola { wavelength_um, .. } => Some(*wavelength_um),
                _ => None,
            });
        let wedges = elements.iter().map(|e| e.wedge);
        let wedges = wedges.filter(|wedge| (wedge.sin_x, wedge.sin_y) != (0.0, 0.0));
        let phases: Vec<f64> = distinct(phases);
        let wedges: Vec<f64> = distinct(wedges.map(|wedge| wedge.wavelength_um));
        let mapping = vec![self.mapping.wavelength_um];
        let all = distinct([&phases, &mapping, &wedges].into_iter().flatten().copied());
        let verified = distinct(self.verify.wavelengths_um.iter().copied());
        let band = [verified.first(), verified.last()];
        let is_near = |um: &f64| match band {
            [Some(first), Some(last)] => (first * (1.0 - VERIFIED_NEAR)..=last * (1.0 + VERIFIED_NEAR)).contains(um),
            _ => true,
        };
        let is_verified = phases.is_empty() || phases.iter().any(is_near);
        if all.len() < 2 && is_verified {
            return None;
        }
        let far = if is_verified { Vec::new() } else { verified };
        let named = [
            ("verify", far),
            ("phase", phases),
            ("mapping", mapping),
            ("wedges", wedges),
        ];
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
            "use one wavelength in [phase], [mapping], [array] and [verify], unless this is meant",
        ))
    }

    /// Images of `metalith optimise` on pixels of another size than those of [verify].
    fn other_pixels(&self) -> Option<Warning> {
        let (pixel_um, verified_um) = (self.optimise.views.pixel_um, self.verify.pixel_um);
        let differ = self.optimise.merit.deconvolution != 0.0 && (pixel_um - verified_um).abs() > ROUNDING_UM;
        differ.then(|| {
            Warning::new(
                "optimise/pixels-differ",
                format!("images are optimised on pixels of {pixel_um} um and verified on pixels of {verified_um} um"),
                "give one size as `pixel_um` in [optimise.views] and [verify]",
            )
        })
    }

    /// Errors of the distance of the sensor by which no lens of the design has a focus.
    fn beyond_focus(&self) -> Option<Warning> {
        let defocus_um = self.optimise.robust?.defocus_um;
        let depth_um = |lens: &LensSpec| {
            self.optimise.band_um.1 / numerical_aperture(lens.radius_um(), lens.focal_length_um).powi(2)
        };
        let most_um = self.lenses().into_iter().map(depth_um).fold(0.0, f64::max);
        (defocus_um > MOST_DEPTHS * most_um).then(|| {
            Warning::new(
                "optimise/defocus-beyond-focus",
                format!(
                    "a standard deviation of {defocus_um} um of the distance to the sensor is {:.1} depths of focus",
                    defocus_um / most_um
                ),
                format!(
                    "give at most {:.3} um as `defocus_um` in [optimise.robust]",
                    MOST_DEPTHS * most_um
                ),
            )
        })
    }

    /// A lens whose marginal ray is steeper than the simulation is proven for.
    fn beyond_scalar(&self) -> Option<Warning> {
        let sine = |lens: &LensSpec| numerical_aperture(lens.radius_um(), lens.focal_length_um);
        let most = self.lenses().into_iter().map(sine).fold(0.0, f64::max);
        (most > MOST_SINE).then(|| {
            Warning::new(
                "design/na-beyond-scalar",
                format!(
                    "the marginal ray has a sine of {most:.3}: beyond {MOST_SINE} neither the scalar field nor the local periodic \
                     approximation is proven"
                ),
                "use a longer focal length or a smaller diameter, or simulate the lens with a solver of the whole vector field",
            )
        })
    }

    /// Elements whose light arrives at an angle at which no cell is solved.
    fn steered_at_normal_incidence(&self) -> Option<Warning> {
        let verify = &self.verify;
        if verify.incidence == CellIncidence::Oblique
            || verify.fidelity != Fidelity::Rigorous
            || self.cell.shape.basis().is_some()
        {
            return None;
        }
        let steered = self.elements().into_iter().map(|e| e.wedge.sin_x.hypot(e.wedge.sin_y));
        let most_deg = steered.fold(0.0, f64::max).min(1.0).asin().to_degrees();
        (most_deg > MOST_NORMAL_DEG).then(|| {
            Warning::new(
                "verify/normal-incidence",
                format!(
                    "light of elements arrives at up to {most_deg:.1} degrees, and their cells are solved at normal incidence: Strehl ratios and \
                     efficiencies of steered elements are too high"
                ),
                "use `incidence = \"oblique\"` in [verify], or --oblique",
            )
        })
    }

    /// Pillars and layers under them that absorb, at the wavelength where they absorb most.
    fn absorbing_pillars(&self) -> Result<Option<Warning>> {
        let stack = self.cell_stack()?;
        let film = (&stack.film, stack.height_nm);
        let layers = stack.under.iter().map(|layer| (&layer.material, layer.height_nm));
        let layers: Vec<(&Material, f64)> = [film].into_iter().chain(layers).collect();
        let mut most = (0.0, 0.0);
        for um in self.verify.wavelengths_um.iter().chain([&self.mapping.wavelength_um]) {
            let mut depth = 0.0;
            for (material, height_nm) in &layers {
                depth += 4.0 * std::f64::consts::PI * material.index(*um)?.im * height_nm * 1e-3 / um;
            }
            let lost = 1.0 - f64::exp(-depth);
            most = if lost > most.0 { (lost, *um) } else { most };
        }
        let (lost, um) = most;
        Ok((lost > MOST_ABSORBED).then(|| {
            Warning::new(
                "cell/absorbing-pillars",
                format!(
                    "the film of the pillars absorbs: one pass through {} nm of {} loses {:.0} % of the light at {:.0} nm where the film is \
                     not removed",
                    stack.height_nm,
                    stack.film,
                    lost * 100.0,
                    um * 1e3
                ),
                "use a material that is clear at the wavelengths of [verify] and [mapping], or a lower film",
            )
        }))
    }

    /// Pillars that are many times as high as wide.
    fn slender_pillars(&self) -> Option<Warning> {
        if self.cell.shape.basis().is_some() {
            // Rectangles are numbered, and their widths stand in a library.
            return None;
        }
        let (narrowest_nm, _) = self.cell.width_range_nm;
        let ratio = self.cell.pillar_height_nm / f64::from(narrowest_nm);
        (ratio > MOST_SLENDER).then(|| {
            Warning::new(
                "cell/slender-pillars",
                format!(
                    "pillars may be as narrow as {narrowest_nm} nm and are {} nm high, 1 : {ratio:.0}: few processes can make pillars beyond \
                     1 : {MOST_SLENDER}",
                    self.cell.pillar_height_nm
                ),
                "use a lower height, a larger `width_min_nm`, or a film of higher index; ask the cleanroom for its largest ratio",
            )
        })
    }

    /// Pillars that are not where the lattice has them, because the grid of the files is too coarse.
    fn rounded_places(&self) -> Option<Warning> {
        let (lattice, unit) = (self.lattice(), self.cell.database_unit);
        let rounding_nm = lattice.rounding_nm();
        let exact = DatabaseUnit::ALL.into_iter().filter(|finer| {
            let same = CellSpec {
                database_unit: *finer,
                ..self.cell.clone()
            };
            let lattice = same.lattice_covering(self.array.largest_nm(&self.lens));
            lattice.is_ok_and(|lattice| lattice.rounding_nm() == 0.0)
        });
        let mut exact = exact.map(|unit| format!("`database_unit_nm = {unit}` in [cell] leaves all where they are"));
        (rounding_nm > 0.0).then(|| {
            Warning::new(
                "layout/rounded-places",
                format!(
                    "pillars on a lattice of {} nm are up to {:.2} nm off their places along an axis, on the database unit of {unit} nm; copies by \
                     symmetry are exact, gaps differ by up to {:.2} nm",
                    self.cell.pitch_nm,
                    rounding_nm,
                    2.0 * rounding_nm
                ),
                exact.next().unwrap_or_else(|| "use a pitch that is a multiple of a database unit".to_owned()),
            )
        })
    }

    /// Tables of phases that jump by whole waves.
    fn unwrapped_tables(&self) -> Option<Warning> {
        let own = self.array.placed.iter().filter_map(|p| p.lens.as_ref());
        let files = std::iter::once(&self.lens).chain(own).flat_map(|lens| lens.unwrapped());
        let mut names: Vec<String> = files.map(|file| file.display().to_string()).collect();
        names.dedup();
        (!names.is_empty()).then(|| {
            Warning::new(
                "phase/wrapped",
                format!(
                    "phases of {} are wrapped: whole waves are added where they jump",
                    names.join(", ")
                ),
                "give unwrapped phases, or `wrapped = \"no\"` if the jumps are meant",
            )
        })
    }

    /// The lens that all elements share, if one has it, and the separate lenses of elements.
    fn lenses(&self) -> Vec<&LensSpec> {
        let mut lenses: Vec<&LensSpec> = Vec::new();
        for element in self.elements() {
            let lens = self.lens_of(&element);
            if !lenses.iter().any(|known| std::ptr::eq(*known, lens)) {
                lenses.push(lens);
            }
        }
        lenses
    }

    /// Maps of which the lens has a small part.
    fn wide_maps(&self) -> Option<Warning> {
        let mut maps = self.lenses().into_iter().flat_map(|lens| {
            let terms = lens.terms.iter();
            terms.filter_map(move |term| match &term.form {
                TermForm::Map(map) => Some((
                    map.extent_um().into_iter().fold(f64::INFINITY, f64::min),
                    lens.radius_um(),
                )),
                _ => None,
            })
        });
        let (extent_um, radius_um) = maps.find(|(extent, radius)| *extent > WIDE_MAP * radius)?;
        Some(Warning::new(
            "phase/map-too-wide",
            format!(
                "the phase map extends to {extent_um:.1} um from its middle, and the lens to {radius_um:.1} um only"
            ),
            "check `pitch_um`, the distance between samples of the map",
        ))
    }

    /// Zernike polynomials of a disc that is not the lens.
    fn other_discs(&self) -> Option<Warning> {
        let mut discs = self.lenses().into_iter().flat_map(|lens| {
            let terms = lens.terms.iter();
            terms.filter_map(move |term| match &term.form {
                TermForm::Zernike { radius_um, .. } => Some((*radius_um, lens.radius_um())),
                _ => None,
            })
        });
        let (disc_um, lens_um) = discs.find(|(disc, lens)| !(0.5..=2.0).contains(&(disc / lens)))?;
        Some(Warning::new(
            "phase/zernike-radius-differs",
            format!(
                "the Zernike polynomials are normalised to a radius of {disc_um} um, and the lens has a radius of {lens_um} um"
            ),
            "check `normalisation_radius_um`; if left out, it is the radius of the lens",
        ))
    }

    /// Openings that pass much light beside the lens.
    fn wide_margins(&self) -> Option<Warning> {
        let margin_um = self.layout.apertures.margin_nm as f64 * 1e-3;
        let beside = |lens: &LensSpec| (1.0 + margin_um / lens.radius_um()).powi(2) - 1.0;
        let most = self.lenses().into_iter().map(beside).fold(0.0, f64::max);
        (most > WIDE_MARGIN).then(|| {
            Warning::new(
                "apertures/margin-too-wide",
                format!(
                    "the opening of a lens is larger than the lens: light that no pillar focuses passes through {:.0} % of the area of the lens",
                    most * 100.0
                ),
                "use a smaller `margin_um`",
            )
        })
    }

    /// Circles whose polygons are off by more than the step of widths.
    fn coarse_circles(&self) -> Option<Warning> {
        let (error_nm, step_nm) = (self.layout.circle_chord_error_nm?, self.cell.width_step_nm);
        let is_coarse = self.cell.shape == PillarShape::Circle && error_nm > f64::from(step_nm);
        is_coarse.then(|| {
            Warning::new(
                "layout/coarse-circles",
                format!(
                    "polygons of round pillars are off by up to {error_nm} nm, and diameters have steps of {step_nm} nm"
                ),
                "use a smaller `circle_chord_error_nm`",
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
fn lattice_warning(orders: &[LatticeOrders], pitch_nm: Pitch) -> Option<Warning> {
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
    use super::*;

    fn warned(name: &str, changes: &[(&str, &str)]) -> Vec<Warning> {
        let text = metalith_testing::changed(name, changes);
        let design = Design::parse(&metalith_testing::design(name), &text).unwrap();
        design.warnings().unwrap()
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
        assert!(
            found.what.ends_with("verify 532 nm; phase 633 nm; mapping 532 nm"),
            "{found}"
        );
    }

    #[test]
    fn wavelengths_that_the_phase_is_not_for_are_named() {
        let at = |list: &str| {
            warned(
                "tio2_532",
                &[("wavelengths_nm = [532]", &format!("wavelengths_nm = {list}"))],
            )
        };
        let found = at("[633]");
        let found = found.iter().find(|w| w.id == "design/wavelengths-differ").unwrap();
        assert!(
            found.what.ends_with("verify 633 nm; phase 532 nm; mapping 532 nm"),
            "{found}"
        );
        for near in ["[532]", "[540]", "[450, 650]"] {
            assert!(!ids(&at(near)).contains(&"design/wavelengths-differ"), "{near}");
        }
    }

    #[test]
    fn a_marginal_ray_beyond_the_scalar_field_is_named() {
        // 40 um over hypot(40 um, 15 um) is 0.936.
        let found = warned("tio2_532", &[("focal_length_um = 80", "focal_length_um = 15")]);
        assert!(ids(&found).contains(&"design/na-beyond-scalar"), "{found:?}");
        assert!(!ids(&warned("tio2_532", &[])).contains(&"design/na-beyond-scalar"));
    }

    #[test]
    fn a_phase_that_focuses_elsewhere_is_named_with_both_distances() {
        let found = warned(
            "tio2_532",
            &[("source = \"hyperbola\"", "source = \"hyperbola\"\nfocal_length_um = 95")],
        );
        let found = found.iter().find(|w| w.id == "phase/other-focal-length").unwrap();
        insta::assert_snapshot!(
            found.what,
            @"rays of the phase at 532 nm meet 95.0 um from the pillars, and the sensor is 80 um away: 5.6 depths of focus"
        );
        // A third of a depth of focus, 0.532 um / 0.447^2.
        let near = warned(
            "tio2_532",
            &[(
                "source = \"hyperbola\"",
                "source = \"hyperbola\"\nfocal_length_um = 80.8",
            )],
        );
        assert!(!ids(&near).contains(&"phase/other-focal-length"), "{near:?}");
    }

    /// A map of the phase of a lens of 80 um that focuses at 80 um, times a factor and moved along x (um), in radians.
    #[test]
    fn rays_of_a_map_are_followed() {
        let (samples, pitch_um, focus_um) = (301, 0.3, 80.0_f64);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.csv");
        let found = |factor: f64, moved_um: f64| {
            let at = |k: i32| (f64::from(k) - 0.5 * f64::from(samples - 1)) * pitch_um;
            let phase = |x: f64, y: f64| {
                let r2 = (x - moved_um) * (x - moved_um) + y * y;
                let turns = (focus_um - (focus_um * focus_um + r2).sqrt()) / 0.532;
                format!("{:.4}", factor * std::f64::consts::TAU * (turns - turns.floor()))
            };
            let row = |iy: i32| {
                (0..samples)
                    .map(|ix| phase(at(ix), at(iy)))
                    .collect::<Vec<_>>()
                    .join(",")
            };
            let rows: Vec<String> = (0..samples).map(row).collect();
            std::fs::write(&path, rows.join("\n")).unwrap();
            let map = format!(
                "source = \"map\"\nfile = \"{}\"\npitch_um = {pitch_um}\nwrapped = \"yes\"",
                path.display()
            );
            let own = "source = \"hyperbola\"\nwavelength_nm = 532";
            ids(&warned("tio2_532", &[(own, map.as_str())])).join(", ")
        };
        assert_eq!(found(1.0, 0.0), "");
        assert_eq!(found(-1.0, 0.0), "phase/out-of-focus");
        // Turns, and degrees.
        assert_eq!(found(1.0 / std::f64::consts::TAU, 0.0), "phase/out-of-focus");
        assert_eq!(found(57.296, 0.0), "phase/out-of-focus");
        assert_eq!(found(1.0, 6.0), "phase/beside-the-axis");
    }

    #[test]
    fn pillars_beyond_any_process_are_named() {
        // 2800 nm over 100 nm is 1 : 28.
        let text = metalith_testing::accepting(&metalith_testing::changed(
            "mini_3x3",
            &[("pillar_height_nm = 700", "pillar_height_nm = 2800")],
        ));
        let design = Design::parse(&metalith_testing::design("mini_3x3"), &text).unwrap();
        let found = design.warnings().unwrap();
        assert!(ids(&found).contains(&"cell/slender-pillars"), "{found:?}");
    }

    /// One pass through 500 nm with k = 0.02 at 532 nm loses 1 - exp(-4 pi 0.02 500 / 532) = 21 %.
    #[test]
    fn pillars_that_absorb_are_named_with_the_loss() {
        let folder = tempfile::tempdir().unwrap();
        let film = |k: f64| {
            let path = folder.path().join("film.csv");
            std::fs::write(&path, format!("wavelength_um,n,k\n0.3,2.4,{k}\n0.9,2.4,{k}\n")).unwrap();
            let to = format!("pillar_material = '{}'", path.display());
            let text = metalith_testing::accepting(&metalith_testing::changed(
                "tio2_532",
                &[("pillar_material = \"tio2_siefke_2016\"", &to)],
            ));
            let design = Design::parse_without_library(&metalith_testing::design("tio2_532"), &text).unwrap();
            let nm = design.cell.pillar_height_nm;
            (nm, design.absorbing_pillars().unwrap())
        };
        let (nm, found) = film(0.02);
        let lost = 1.0 - f64::exp(-4.0 * std::f64::consts::PI * 0.02 * nm / 532.0);
        assert!(found.unwrap().what.contains(&format!("loses {:.0} %", lost * 100.0)));
        assert_eq!(film(0.001).1, None);
    }

    #[test]
    fn warnings_of_shipped_designs() {
        let mut lines = String::new();
        let folder = std::fs::read_dir(metalith_testing::design("tio2_532").parent().unwrap()).unwrap();
        let mut files: Vec<_> = folder.map(|entry| entry.unwrap().path()).collect();
        files.retain(|path| path.extension().is_some_and(|end| end == "toml"));
        files.sort();
        for path in files {
            let name = path.file_stem().unwrap().display();
            let design = Design::read_without_library(&path).unwrap();
            let found = design.warnings().unwrap();
            let found: Vec<String> = ids(&found).into_iter().map(|id| format!(" {id}")).collect();
            lines += &format!("{name}:{}\n", found.join(","));
        }
        insta::assert_snapshot!(lines, @r"
            array_2x4: design/wavelengths-differ, verify/normal-incidence, lattice/diffracts
            asi_940:
            birefringent_532:
            broadband_3x3: design/wavelengths-differ, lattice/diffracts
            geometric_phase_532: lattice/diffracts
            hexagonal_1550:
            hologram: mapping/difference-accepted
            imaging_3x3: design/wavelengths-differ, lattice/diffracts
            lens_10mm: design/wavelengths-differ, lattice/diffracts
            mini_3x3: design/wavelengths-differ, lattice/diffracts
            mixed_lenses: design/wavelengths-differ, lattice/diffracts
            neighbours_3x3: design/wavelengths-differ, lattice/diffracts
            neural_nano_optics: phase/out-of-focus, phase/steep, lattice/diffracts
            prototype_3x3: design/wavelengths-differ, lattice/diffracts
            robust_3x3: design/wavelengths-differ, lattice/diffracts
            silicon_10600:
            tio2_532:
            true_light_bright: design/wavelengths-differ, lattice/diffracts
            true_light_sharp: design/wavelengths-differ, lattice/diffracts
            true_light_thin: design/wavelengths-differ, lattice/diffracts
            wide_5x5: design/wavelengths-differ, phase/steep, lattice/diffracts
            ");
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
    }
}
