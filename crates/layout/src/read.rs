//! A layout of a design, read back.

use std::path::Path;

use metalith_core::{Progress, Result};
use metalith_design::Design;
use metalith_gds::extract::{Extraction, ExtractionPlan, extract, fits};
use metalith_gds::{Layout, ReadLimits};

/// Plan of what is read of a layout of this design: its elements, in the order of [`Design::elements`], and its
/// pillars.
pub fn extraction_plan(design: &Design) -> ExtractionPlan {
    ExtractionPlan::given(design.layout.layers.pillars.number(), design.sites()).of_shape(design.cell.shape)
}

/// The pillars of a layout at the elements of a design, in the order of [`Design::elements`].
///
/// # Errors
/// If the elements have more sites together than are held at a time, the layout cannot be read, or the user stopped it.
pub fn read_pillars(design: &Design, layout: &Path, progress: &dyn Progress) -> Result<Extraction> {
    fits(layout, &design.sites())?;
    let layout = Layout::open_with(layout, ReadLimits::default(), progress)?;
    Ok(extract(&layout, &extraction_plan(design), progress)?)
}
