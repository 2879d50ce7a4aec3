//! The design file: everything that a person decides, read with a place for every mistake.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use metalith_cell::{CellStack, FocusedLight, PolarisationAxis, cache_folder};
use metalith_core::document::{Document, KeyTable, Section, explore, load};
use metalith_core::text::quoted;
use metalith_core::{Error, Progress, Result, Silent};
use metalith_pillars::{ElementSite, Lattice};

use crate::spec::{
    ArraySpec, CellSpec, Element, FieldAngle, Footprint, LayoutSpec, LensOutline, LensSpec, LibraryFile, MappingSpec,
    OptimiseSpec, VerifySpec,
};

/// Version of the format of design files that this program reads.
const SCHEMA: i64 = 1;

/// A design: what is to be built, how it is to be written, and what must hold of the result.
#[derive(Clone, Debug)]
pub struct Design {
    /// Name of the design; the files it leaves are named after it, so only letters, digits, `_` and `-`.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// Path that the design was read from.
    pub path: PathBuf,
    pub cell: CellSpec,
    pub lens: LensSpec,
    pub array: ArraySpec,
    pub mapping: MappingSpec,
    pub layout: LayoutSpec,
    pub verify: VerifySpec,
    /// Settings by which `metalith optimise` finds the phase; they have no effect on the layout.
    pub optimise: OptimiseSpec,
}

impl Design {
    /// Read the design file at `path`, and the files that it names.
    ///
    /// # Errors
    /// [`metalith_core::Error::Text`] with every mistake of the file and of the tables that it names, each with line, column and
    /// remedy.
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_with(path, &Silent)
    }

    /// [`Design::read`], with progress of the mapping where that is solved from the cell: seconds, once for each cell.
    ///
    /// # Errors
    /// As [`Design::read`]; also if the user stopped it.
    pub fn read_with(path: &Path, progress: &dyn Progress) -> Result<Self> {
        Self::parse_with(path, &load(path)?, progress)
    }

    /// The design of a text, as if it stood in the file at `path`; the files that it names are read, and a mapping that it
    /// asks of the cell is solved, or read from the cache.
    ///
    /// # Errors
    /// As [`Design::read`], but for reading the file itself.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        Self::parse_with(path, text, &Silent)
    }

    /// [`Design::parse`], with progress as [`Design::read_with`].
    ///
    /// # Errors
    /// As [`Design::parse`]; also if the user stopped it.
    pub fn parse_with(path: &Path, text: &str, progress: &dyn Progress) -> Result<Self> {
        let mut design = Self::of_text(path, text, LibraryFile::Needed)?;
        design.solve_mapping(cache_folder().as_deref(), progress)?;
        Ok(design)
    }

    /// Solve the mapping from the cell, or read it from the folder `cache`, if the design has no other: for designs of
    /// [`Design::parse_without_library`].
    ///
    /// # Errors
    /// If the cell cannot be solved, all widths transmit little, or the user stopped it.
    pub fn solve_mapping(&mut self, cache: Option<&Path>, progress: &dyn Progress) -> Result<()> {
        let stack = self.cell_stack()?;
        self.mapping.solve(&self.cell, &stack, cache, progress)
    }

    /// Reads a design as [`Design::read`] and [`Design::parse_without_library`] do.
    ///
    /// # Errors
    /// As [`Design::read`].
    pub fn read_without_library(path: &Path) -> Result<Self> {
        Self::parse_without_library(path, &load(path)?)
    }

    /// Variant of [`Design::parse`] for a caller that makes the library of its pillars or needs no pillars: the file of the
    /// library may not be there yet, and no mapping is solved. Until it is, the design has no pillars.
    ///
    /// # Errors
    /// As [`Design::parse`].
    pub fn parse_without_library(path: &Path, text: &str) -> Result<Self> {
        Self::of_text(path, text, LibraryFile::ToBeMade)
    }

    /// The keys of a design file; `seeds` are texts of designs that have uncommon ones.
    pub fn keys(seeds: &[&str]) -> KeyTable {
        explore(seeds, |root, path| Self::sections(path, root, LibraryFile::Needed))
    }

    /// The design of a text, with the files that it names.
    fn of_text(path: &Path, text: &str, library: LibraryFile) -> Result<Self> {
        let (design, loaded) = Document::read(path, text, |root| {
            let mut design = Self::sections(path, root, library);
            let loaded = design.load_files(root, library);
            (design, loaded)
        })?;
        loaded?;
        design.in_known_bands()
    }

    fn sections(path: &Path, root: &Section<'_, '_>, library: LibraryFile) -> Self {
        root.integer("schema", SCHEMA..=SCHEMA, "");
        let name = root.text("name");
        let legal = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if root.has("name") && (name.is_empty() || name.len() > MAX_NAME || !name.chars().all(legal)) {
            root.fault(
                "name",
                format!("\"{}\" cannot name files and cells", quoted(&name)),
                format!("use 1 to {MAX_NAME} of the characters A-Z a-z 0-9 _ -"),
            );
        }
        let title = root.optional_text("title").unwrap_or_else(|| name.clone());
        let cell = CellSpec::read(&root.section("cell"));
        let phase = root.section("phase");
        let lens = LensSpec::read(&root.section("lens"), &phase, &cell);
        let array_section = root.section("array");
        let mapping_section = match library {
            LibraryFile::Needed => root.section("mapping"),
            LibraryFile::ToBeMade => root.section_or_none("mapping"),
        };
        let from_cells = MappingSpec::is_from_cells(&mapping_section, &cell, library);
        let mapping_um = MappingSpec::read_wavelength(&mapping_section, &cell, &lens, from_cells);
        let array = ArraySpec::read(
            &array_section,
            &lens,
            &phase,
            &cell,
            mapping_um,
            &root.sections("element"),
        );
        let mapping = MappingSpec::read(&mapping_section, mapping_um, &cell, &array, library, from_cells);
        let layout = LayoutSpec::read(root, &lens, &array);
        let verify = VerifySpec::read(&root.section("verify"), &cell);
        check_directions(&array_section, &array, &verify);
        let optimise = OptimiseSpec::read(root.optional_section("optimise").as_ref(), &cell);
        Self {
            name,
            title,
            path: path.to_owned(),
            cell,
            lens,
            array,
            mapping,
            layout,
            verify,
            optimise,
        }
    }

    /// Read the files that the design names. One that cannot be used is a mistake of the key that names it. What a file must hold
    /// follows from the sections about it: where these have mistakes, it is not read.
    fn load_files(&mut self, root: &Section<'_, '_>, library: LibraryFile) -> Result<()> {
        let mut errors = Vec::new();
        if root.sound_within(&["cell", "lens", "phase", "array", "element"]) {
            // A map of elements with separate lenses covers these, not the lens that the others share.
            let indices = self.elements().into_iter().map(|e| e.index);
            let sharing: Vec<_> = indices
                .filter(|index| self.array.placed(*index).is_none_or(|p| p.lens.is_none()))
                .collect();
            errors.extend(self.lens.load(|term| sharing.iter().any(|index| term.is_of(*index))));
            for own in self.array.placed.iter_mut().filter_map(|p| p.lens.as_mut()) {
                errors.extend(own.load(|_| true));
            }
        }
        if root.sound_within(&["cell", "mapping"]) {
            errors.extend(self.mapping.load(&self.cell, library).err());
        }
        let others: Vec<Result<()>> = errors.into_iter().map(|error| root.unusable_file(error)).collect();
        others.into_iter().collect()
    }

    /// This design, if its materials are known at all of its wavelengths.
    fn in_known_bands(mut self) -> Result<Self> {
        // Unknown materials and wavelengths that they are not known at are mistakes of the design, whoever asks first.
        let stack = self.cell_stack()?;
        let band_um = self.band_of(&stack);
        self.optimise.within(band_um);
        self.check_bands(&stack)?;
        stack.check_substrate(band_um)?;
        let named: [(&str, &[f64]); 3] = [
            ("`wavelengths_nm` of [verify]", &self.verify.wavelengths_um),
            ("the comparison of [mapping]", &self.mapping.comparison.wavelengths_um),
            ("`wavelength_nm` of [mapping]", &[self.mapping.wavelength_um]),
        ];
        for (key, wavelengths_um) in named {
            let known = wavelengths_um.iter().try_for_each(|um| {
                stack.full_transmission(*um)?;
                stack
                    .materials()
                    .try_for_each(|material| material.index(*um).map(|_| ()))?;
                Ok(())
            });
            known.map_err(|error| match error {
                Error::Invalid { id, what, hint, source } => Error::Invalid {
                    id,
                    what: format!("{}: {key}: {what}", self.path.display()),
                    hint,
                    source,
                },
                other => other,
            })?;
        }
        Ok(self)
    }

    /// Checks that all bands that the design says are where its materials are known: else only a simulation would find
    /// out, after the layout is written.
    fn check_bands(&self, stack: &CellStack) -> Result<()> {
        let bands = [
            ("cell", self.cell.band_um),
            ("mapping", self.mapping.comparison.band_um),
            ("optimise", self.optimise.said_band_um()),
        ];
        let is_known = |um: f64| stack.materials().all(|material| material.index(um).is_ok());
        let known_um = stack.range_um();
        let nm = |(short, long): (f64, f64)| {
            let [short, long] = [short, long].map(|um| (um * 1e6).round() / 1e3);
            format!("{short} to {long} nm")
        };
        for (section, band_um) in bands.into_iter().filter_map(|(section, band)| Some((section, band?))) {
            if !(is_known(band_um.0) && is_known(band_um.1)) {
                return Err(Error::refused(
                    "design/band-beyond-materials",
                    format!(
                        "{}: `band_nm` of [{section}] is {}, and the materials of [cell] are known from {}",
                        self.path.display(),
                        nm(band_um),
                        nm(known_um)
                    ),
                    "give a band in that range, or other materials",
                ));
            }
        }
        Ok(())
    }

    /// The lattice that the pillars of each element stand on: it covers the largest.
    pub fn lattice(&self) -> Lattice {
        let largest_nm = self.array.largest_nm(&self.lens);
        let lattice = self.cell.lattice_covering(largest_nm);
        lattice.expect("checked when the design was read")
    }

    /// The lens of an element: its own, or that all share.
    pub fn lens_of(&self, element: &Element) -> &LensSpec {
        self.array.lens_of(&self.lens, element.index)
    }

    /// Radius and focal length of the lens of each element (um).
    pub fn lens_sizes_um(&self) -> impl Iterator<Item = [f64; 2]> {
        self.elements().into_iter().map(|element| {
            let lens = self.lens_of(&element);
            [lens.radius_um(), lens.focal_length_um]
        })
    }

    /// The light that pillars give the phase of the design, if they distinguish polarisations.
    pub fn focused(&self) -> Option<FocusedLight> {
        self.cell.focused(self.verify.polarisation)
    }

    /// Axis of the light that the design is verified in, for upright rectangles.
    pub fn axis(&self) -> PolarisationAxis {
        match self.focused() {
            Some(FocusedLight::Linear(axis)) => axis,
            _ => PolarisationAxis::X,
        }
    }

    /// The design as light polarised along y sees it, if any of its lenses has another phase for that.
    pub fn along_y(&self) -> Option<Self> {
        let own = self.array.placed.iter().filter_map(|p| p.lens.as_ref());
        let any = std::iter::once(&self.lens)
            .chain(own)
            .any(|lens| lens.along_y.is_some());
        any.then(|| {
            let mut seen = self.clone();
            seen.lens = seen.lens.seen_along_y();
            for lens in seen.array.placed.iter_mut().filter_map(|p| p.lens.as_mut()) {
                *lens = lens.seen_along_y();
            }
            seen
        })
    }

    /// The design as the light sees it that it is verified in.
    pub fn as_verified(&self) -> Cow<'_, Self> {
        match self.axis() {
            PolarisationAxis::X => Cow::Borrowed(self),
            PolarisationAxis::Y => self.along_y().map_or(Cow::Borrowed(self), Cow::Owned),
        }
    }

    /// Succeeds if all elements are of one round lens.
    ///
    /// # Errors
    /// If they are not; `who` knows one round lens alone.
    pub fn one_lens(&self, who: &str) -> Result<()> {
        if self.array.has_own_lenses() {
            return Err(Error::refused(
                "design/individual-lenses",
                format!(
                    "{who} supports one lens for all elements, and elements of the design have individual or rotated lenses"
                ),
                "make a design of the elements that share a lens: without `diameter_um`, `aperture`, `focal_length_um`, \
                 `rotation_deg` and [element.phase]",
            ));
        }
        if self.lens.outline.is_some() {
            return Err(Error::refused(
                "design/polygonal-aperture",
                format!("{who} supports round lenses only, and the aperture of the design is a polygon"),
                "leave `aperture` of [lens] out: simulate the round lens about it",
            ));
        }
        Ok(())
    }

    /// Succeeds if the phase of the lens is one over the radius alone.
    ///
    /// # Errors
    /// If phases over the plane are added to it, of whichever element; `who` knows none.
    pub fn radial_phase(&self, who: &str) -> Result<()> {
        if self.lens.along_y.is_some() {
            return Err(Error::refused(
                "design/two-phases",
                format!(
                    "{who} supports one phase for both polarisations, and {} has another in [phase.y]",
                    self.path.display()
                ),
                "leave [phase.y] out",
            ));
        }
        if self.lens.terms.is_empty() {
            return Ok(());
        }
        Err(Error::refused(
            "design/phase-not-radial",
            format!(
                "{who} supports radial phases only, and {} adds {} over the plane by [[phase.term]]",
                self.path.display(),
                self.lens.terms.len()
            ),
            "leave [[phase.term]] out; what of it is round fits into `even_powers` or a `table` of [phase]",
        ))
    }

    /// The outline of an element as it stands on the chip, from its middle; none where it is a circle.
    pub fn outline_of(&self, element: &Element) -> Option<LensOutline> {
        let outline = self.lens_of(element).outline.as_ref()?;
        Some(outline.rotated(self.array.rotation_deg(element.index)))
    }

    /// Radius of the openings in the metal around the lenses that state none (um).
    pub fn aperture_radius_um(&self) -> f64 {
        self.around_um(&self.lens)
    }

    /// Radius of the opening in the metal around an element (um).
    pub fn aperture_radius_of_um(&self, element: &Element) -> f64 {
        self.around_um(self.lens_of(element))
    }

    fn around_um(&self, lens: &LensSpec) -> f64 {
        lens.radius_um() + self.layout.apertures.margin_nm as f64 * 1e-3
    }

    /// The elements of the array, row by row from the lowest.
    pub fn elements(&self) -> Vec<Element> {
        self.array.elements()
    }

    /// Places of the elements in a layout, in the same order. All have the lattice of the largest; where these overlap,
    /// each has the part that its own pillars stand in.
    pub fn sites(&self) -> Vec<ElementSite> {
        let lattice = self.lattice();
        let roomy = self.array.has_room_for(lattice.sides_nm());
        let site = |element: Element| ElementSite {
            name: element.label(),
            centre_nm: [element.centre_nm.0, element.centre_nm.1],
            lattice,
            within_nm: if roomy { None } else { self.within_nm(&element) },
        };
        let mut sites: Vec<_> = self.elements().into_iter().map(site).collect();
        ElementSite::widen(&mut sites);
        sites
    }

    /// Outermost places of the pillars of an element, from its middle (nm).
    fn within_nm(&self, element: &Element) -> Option<[[i64; 2]; 2]> {
        let rotation_deg = self.array.rotation_deg(element.index);
        Footprint::of(self.lens_of(element), rotation_deg, &self.cell).map(|footprint| footprint.ends_nm)
    }

    /// Places of some of the elements in a layout, in the order of `chosen`.
    ///
    /// # Panics
    /// If one is no element of the design.
    pub fn sites_of(&self, chosen: &[Element]) -> Vec<ElementSite> {
        let (all, sites) = (self.elements(), self.sites());
        let site = |element: &Element| {
            let found = all.iter().position(|e| e.index == element.index);
            sites[found.expect("an element of the design")].clone()
        };
        chosen.iter().map(site).collect()
    }
}

/// Every element must have light to look at, at each wavelength and field angle that it is simulated for, and send it to
/// the sensor: else only the simulation would find out, after the layout is written.
fn check_directions(section: &Section<'_, '_>, array: &ArraySpec, verify: &VerifySpec) {
    for element in array.elements() {
        for &wavelength_um in &verify.wavelengths_um {
            let arrives = |angle: &FieldAngle| {
                let field_rad = [angle.x_deg, angle.y_deg].map(f64::to_radians);
                element.wedge.arriving(wavelength_um, field_rad).is_some()
            };
            if let Some(angle) = verify.field_angles.iter().find(|a| !arrives(a)) {
                section.fault_given(
                    &[
                        "verify.wavelengths_nm",
                        "verify.field_x_deg",
                        "verify.field_y_deg",
                        "array.wedge_wavelength_nm",
                        "phase.wavelength_nm",
                        "mapping.wavelength_nm",
                    ],
                    "steering_deg",
                    format!(
                        "element {} has no light at {:.0} nm from the field angle ({}, {}) degrees",
                        element.label(),
                        wavelength_um * 1e3,
                        angle.x_deg,
                        angle.y_deg
                    ),
                    "steer less, or take shorter wavelengths or smaller field angles in [verify]",
                );
                return;
            }
        }
    }
}

/// Leaves room within the 32 characters of a GDSII cell name for the parts a layout adds.
const MAX_NAME: usize = 24;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_angle_beyond_a_right_angle_is_refused() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../designs/mixed_lenses.toml");
        let text = load(&path).unwrap();
        let read = |angle: &str| {
            let (from, to) = ("field_x_deg = [0]", format!("field_x_deg = [{angle}]"));
            assert!(text.contains(from));
            Design::parse(&path, &text.replacen(from, &to, 1))
        };
        // One of the elements looks nearly 8 degrees to this side.
        assert!(read("-80").is_ok());
        let error = read("-86").unwrap_err();
        insta::assert_snapshot!(metalith_testing::without_folder(&error, path.parent().unwrap()), @"
            mixed_lenses.toml:22:1: element (3, 0) has no light at 530 nm from the field angle (-86, 0) degrees
              help: steer less, or take shorter wavelengths or smaller field angles in [verify]
            ");
        assert_eq!(error.ids(), ["array.steering_deg/inconsistent"]);
    }
}
