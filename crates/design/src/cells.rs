//! The cell of a design, as true as asked for.

use std::path::{Path, PathBuf};

use metalith_cell::{
    CellModel, CellStack, Fidelity, FittedCell, FocusingStack, Mapping, NeighbourCell, PointwiseCell, PublishedCell,
    TableSpec, UniformLayer, cache_folder, polarising_cell,
};
use metalith_core::{Error, Result};
use metalith_rcwa::{CellLattice, Material};

use crate::spec::{CellSpec, UnderSpec};
use crate::{Design, PillarRule};

/// The band of designs whose wavelengths are all visible (um): that of colour sensors.
pub const VISIBLE_UM: (f64, f64) = (0.4, 0.7);

/// Share by which the band of other designs is wider than the wavelengths that they name, to either side.
const BEYOND: f64 = 0.03;

/// The band of light of which single wavelengths are named (um): the visible, if all of them are; else those and 3 % more to either
/// side; as far as materials are known, which is `known_um`.
pub fn band_about(named_um: impl IntoIterator<Item = f64>, known_um: (f64, f64)) -> (f64, f64) {
    let (short, long) = named_um
        .into_iter()
        .fold((f64::INFINITY, 0.0), |(short, long): (f64, f64), um| {
            (short.min(um), long.max(um))
        });
    let band = if short >= VISIBLE_UM.0 && long <= VISIBLE_UM.1 {
        VISIBLE_UM
    } else {
        (short * (1.0 - BEYOND), long * (1.0 + BEYOND))
    };
    (band.0.max(known_um.0), band.1.min(known_um.1))
}

impl Design {
    /// The folder that paths in the design count from.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Stack of the same pillars in the light that the design is verified in.
    ///
    /// # Errors
    /// As [`Design::cell_stack`].
    pub fn lit_stack(&self) -> Result<FocusingStack> {
        Ok(FocusingStack {
            stack: self.cell_stack()?,
            focused: self.focused(),
        })
    }

    /// Check that its pillars can be judged by a cell.
    ///
    /// # Errors
    /// If they cannot, or a material is not known.
    pub fn check_fidelity(&self, fidelity: Fidelity) -> Result<()> {
        fidelity.check(self.cell.shape, self.cell.lattice)?;
        match fidelity {
            Fidelity::Published => PublishedCell::of_stack(&self.cell_stack()?).map(|_| ()),
            _ => Ok(()),
        }
    }

    /// The cell that the design asks for: upright walls, sharp corners, no mask.
    ///
    /// # Errors
    /// If a material is not known or its table cannot be read.
    pub fn cell_stack(&self) -> Result<CellStack> {
        self.cell.stack(self.folder())
    }

    /// The table of the cell that the design needs, over its band.
    ///
    /// # Errors
    /// If a material is not known.
    pub fn table_spec(&self) -> Result<TableSpec> {
        let stack = self.cell_stack()?;
        let band_um = self.band_of(&stack);
        Ok(TableSpec::new(stack, band_um, self.cell.width_range_nm))
    }

    /// Wavelengths that the design is judged over (um), all that it names among them. Where it does not say its band: the
    /// visible, if all that it names are; else those and a little more; as far as its materials are known.
    ///
    /// # Errors
    /// If a material is not known.
    pub fn band_um(&self) -> Result<(f64, f64)> {
        Ok(self.band_of(&self.cell_stack()?))
    }

    /// [`Design::band_um`] of a design whose [`Design::cell_stack`] was read before (um).
    pub fn band_of(&self, stack: &CellStack) -> (f64, f64) {
        let named = self.verify.wavelengths_um.iter().chain([&self.mapping.wavelength_um]);
        match self.cell.band_um {
            Some(band) => named.fold(band, |(short, long), &l| (short.min(l), long.max(l))),
            None => band_about(named.copied(), stack.range_um()),
        }
    }
}

impl CellSpec {
    /// The cell with upright walls, sharp corners and no mask. Paths of materials count from `folder`.
    ///
    /// # Errors
    /// If a material is not known or its table cannot be read.
    pub fn stack(&self, folder: &Path) -> Result<CellStack> {
        let material = |name: &str| Material::resolve(name, folder);
        let layer = |under: &UnderSpec| -> Result<UniformLayer> {
            Ok(UniformLayer {
                material: material(&under.material)?,
                height_nm: under.height_nm,
            })
        };
        Ok(CellStack {
            lattice: CellLattice::drawn(self.lattice, self.pitch_nm, self.database_unit),
            shape: self.shape,
            film: material(&self.pillar_material)?,
            substrate: material(&self.substrate_material)?,
            under: self.under.iter().map(layer).collect::<Result<_>>()?,
            ambient: match &self.ambient_material {
                Some(name) => material(name)?,
                None => Material::constant(self.ambient_index, 0.0)?,
            },
            ..CellStack::paper(f64::from(self.pitch_nm), self.pillar_height_nm)?
        })
    }
}

impl Design {
    /// Band that mappings should send light to the first order in (um): that of the design where it says no other.
    ///
    /// # Errors
    /// As [`Design::band_um`].
    pub fn mapping_band_um(&self) -> Result<(f64, f64)> {
        match self.mapping.comparison.band_um {
            Some(band) => Ok(band),
            None => self.band_um(),
        }
    }

    /// Single wavelengths that mappings are compared at (um): those that the design is verified at where it says no other.
    pub fn compared_um(&self) -> &[f64] {
        match self.mapping.comparison.wavelengths_um.as_slice() {
            [] => &self.verify.wavelengths_um,
            own => own,
        }
    }
}

/// The cells of a design for a few wavelengths, one for each fidelity asked for.
///
/// # Errors
/// If a fidelity cannot be had for this design.
pub fn cell_models(design: &Design, wanted: &[Fidelity]) -> Result<Vec<Box<dyn CellModel>>> {
    wanted
        .iter()
        .map(|fidelity| -> Result<Box<dyn CellModel>> {
            design.check_fidelity(*fidelity)?;
            if let Some(focused) = design.focused()
                && let Some(cell) = polarising_cell(&design.cell_stack()?, focused, cache_folder().as_deref())
            {
                return Ok(cell);
            }
            match fidelity {
                Fidelity::Published => Ok(Box::new(PublishedCell::of_stack(&design.cell_stack()?)?)),
                Fidelity::Rigorous => {
                    let stack = design.cell_stack()?;
                    let cell = PointwiseCell::new(stack, design.cell.widths_nm());
                    Ok(Box::new(cell.cached_in(cache_folder().as_deref())))
                }
                Fidelity::Neighbours => Ok(Box::new(neighbour_cell(design, cache_folder())?)),
                Fidelity::Calibrated => Err(Error::refused(
                    "cell/no-calibrated-model",
                    "the cell is calibrated, and its model is missing",
                    "read the model that `metalith calibrate` wrote and make an `AsBuiltChip` of it",
                )),
                Fidelity::Fitted => {
                    let stack = design.cell_stack()?;
                    Ok(Box::new(FittedCell::of_stack(
                        &stack,
                        design.band_of(&stack),
                        design.cell.width_range_nm,
                        cache_folder().as_deref(),
                    )?))
                }
            }
        })
        .collect()
}

/// The coupled model, with tables at the wavelengths that the design is verified at, which are kept in the folder
/// `cache`.
///
/// # Errors
/// If the design has a shape or lattice that it is not made for, or a material is not known.
pub fn neighbour_cell(design: &Design, cache: Option<PathBuf>) -> Result<NeighbourCell> {
    Fidelity::Neighbours.check(design.cell.shape, design.cell.lattice)?;
    let cell = NeighbourCell::new(design.cell_stack()?, mappings(design), cache);
    Ok(cell.tabulated_at(&design.verify.wavelengths_um))
}

/// Mappings of a design, one for each rule: how often its elements draw each width next to which others.
pub fn mappings(design: &Design) -> Vec<Mapping> {
    let rules = PillarRule::all(design);
    rules.iter().map(|rule| Mapping::new(|u| rule.width_nm(u))).collect()
}
