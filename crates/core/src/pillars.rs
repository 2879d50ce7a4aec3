//! Pillars of elements, whatever file they are read from.

use std::path::Path;

use crate::{Lattice, LayerNumber, PillarShape, Progress, Result, WidthMap};

/// Where an element is and which lattice its pillars should stand on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ElementSite {
    /// For messages and reports.
    pub name: String,
    /// Centre of the lattice in the layout (nm).
    pub centre_nm: [i64; 2],
    pub lattice: Lattice,
}

/// What reads pillars out of a layout: crates that only need the widths take it from their caller, and know no format.
pub trait PillarReader: Sync {
    /// Widths of the pillars of each element, all of this shape, in the order given.
    ///
    /// # Errors
    /// If the layout cannot be read, an element is out of all proportion, or the user stopped it.
    fn pillars(
        &self,
        layout: &Path,
        layer: LayerNumber,
        shape: PillarShape,
        elements: &[ElementSite],
        progress: &dyn Progress,
    ) -> Result<Vec<WidthMap>>;
}
