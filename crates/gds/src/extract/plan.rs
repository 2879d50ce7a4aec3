//! Plan of what to read out of a layout, and result of reading it.

use std::path::Path;

use super::survey::Survey;
use super::unrecognised_shapes::UnrecognisedShapes;
use crate::{LayerNumber, Selection};
use metalith_core::{Error, Result};
use metalith_pillars::{ElementSite, PillarMap, PillarShape};

/// Places of the elements.
#[derive(Clone, Debug)]
pub enum Elements {
    /// Elements as a design says.
    Given(Vec<ElementSite>),
    /// Wherever clusters of pillars are: pitch and phase of the lattice from their distances, its centre
    /// from the middle of the outermost. Elements less than 8 um apart count as one; where no pitch is
    /// below 6 um, or elements are larger than some 13 mm together, those less than 33 um apart.
    Discover,
}

/// Plan of what to read out of a layout.
#[derive(Clone, Debug)]
pub struct ExtractionPlan {
    /// Layer that the pillars are on.
    pub pillar_layer: LayerNumber,
    /// Shape of the pillars; where it is left out, the shape of most of the elements that are found.
    pub shape: Option<PillarShape>,
    pub elements: Elements,
    /// Cell to start from; the top cell if there is one only.
    pub top: Option<String>,
    /// Most oddities and texts that are listed; all are counted.
    pub listed: usize,
    /// True if faults of the tree of cells are passed over.
    pub lenient: bool,
}

impl ExtractionPlan {
    /// The elements of a design, square pillars.
    pub fn given(pillar_layer: LayerNumber, elements: Vec<ElementSite>) -> Self {
        Self {
            pillar_layer,
            shape: Some(PillarShape::default()),
            elements: Elements::Given(elements),
            top: None,
            listed: 1000,
            lenient: false,
        }
    }

    /// This plan for pillars of this shape.
    #[must_use]
    pub fn of_shape(self, shape: PillarShape) -> Self {
        Self {
            shape: Some(shape),
            ..self
        }
    }

    /// Selection of the layout that is visited.
    pub(super) fn selection(&self) -> Selection {
        Selection {
            top: self.top.clone(),
            lenient: self.lenient,
            ..Selection::default()
        }
    }

    /// A layout from anywhere.
    pub fn discover(pillar_layer: LayerNumber) -> Self {
        Self {
            shape: None,
            elements: Elements::Discover,
            ..Self::given(pillar_layer, Vec::new())
        }
    }
}

/// The pillars of one element as the layout has them.
#[derive(Clone, Debug)]
pub struct ExtractedElement<W = PillarMap> {
    pub site: ElementSite,
    pub widths: W,
}

/// Contents of a layout.
#[derive(Clone, Debug)]
pub struct Extraction<W = PillarMap> {
    /// Name of the cell that was read.
    pub top: String,
    pub elements: Vec<ExtractedElement<W>>,
    /// Shape of the pillars.
    pub shape: PillarShape,
    /// Pillars on a lattice, over all elements.
    pub pillars: u64,
    /// Angle at which the layout is placed (degrees), if all of it was turned back by it before it was read.
    pub turned_deg: Option<f64>,
    /// Everything on the pillar layer that is not a pillar on the lattice of an element.
    pub oddities: UnrecognisedShapes,
    /// All layers and texts.
    pub survey: Survey,
}

impl<W> Extraction<W> {
    /// Place in the layout of one in the rows and columns of its elements (nm): another one where the layout was turned back.
    pub fn in_layout_nm(&self, at_nm: [f64; 2]) -> [f64; 2] {
        turned(at_nm, self.turned_deg)
    }

    /// Check that the pillars of all elements stand on lattices of one kind and pitch. `file` is what was read, `hint` what to do else.
    ///
    /// # Errors
    /// With the first element that stands on another one.
    pub fn check_one_lattice(&self, file: &Path, hint: &str) -> Result<()> {
        let is_other = |e: &&ExtractedElement<W>| !e.site.lattice.is_like(&self.elements[0].site.lattice);
        let Some(other) = self.elements.iter().find(is_other) else {
            return Ok(());
        };
        Err(Error::refused(
            "extract/lattices-differ",
            format!(
                "{}: {} stands on another lattice than the elements before it",
                file.display(),
                other.site.name
            ),
            hint,
        ))
    }
}

/// A place turned by an angle about the origin, if there is one (degrees).
pub(crate) fn turned([x, y]: [f64; 2], deg: Option<f64>) -> [f64; 2] {
    let Some(deg) = deg else { return [x, y] };
    let (sin, cos) = deg.to_radians().sin_cos();
    [cos * x - sin * y, sin * x + cos * y]
}
