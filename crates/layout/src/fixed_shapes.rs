//! Shapes of a layout other than its pillars: polygons and a label, in no format yet.

use metalith_design::{Design, LayoutLayer};
use metalith_gds::library::GdsElement;

use super::{mark, point};

/// Polygons and texts of a top cell.
#[derive(Clone, Debug, Default)]
pub(super) struct FixedShapes<'a> {
    /// Corners (database units), the first not repeated.
    pub polygons: Vec<(&'a LayoutLayer, Vec<(i64, i64)>)>,
    pub texts: Vec<(&'a LayoutLayer, String, (i64, i64))>,
}

impl<'a> FixedShapes<'a> {
    /// Marks of the first step, outline of the chip and label.
    pub(crate) fn of_pillars(design: &'a Design) -> Self {
        let layers = &design.layout.layers;
        let mut fixed = Self::default();
        fixed.add(&layers.pillar_marks, mark::crosses(&design.layout.marks));
        fixed.add(&layers.outline, [mark::outline(&design.layout.chip).to_vec()]);
        fixed.label(design);
        fixed.on_grid(design)
    }

    /// Openings, marks of the second step and label.
    pub(crate) fn of_apertures(design: &'a Design) -> Self {
        let layers = &design.layout.layers;
        let mut fixed = Self::default();
        fixed.add(&layers.apertures, super::aperture::openings(design));
        fixed.add(&layers.aperture_marks, mark::crosses(&design.layout.marks));
        fixed.label(design);
        fixed.on_grid(design)
    }

    /// Shapes in nanometres as shapes in database units.
    fn on_grid(mut self, design: &Design) -> Self {
        let unit = design.cell.database_unit;
        let scaled = |(x, y): &mut (i64, i64)| (*x, *y) = (unit.units(*x), unit.units(*y));
        self.polygons
            .iter_mut()
            .flat_map(|(_, corners)| corners)
            .for_each(scaled);
        self.texts.iter_mut().for_each(|(_, _, at)| scaled(at));
        self
    }

    fn add(&mut self, layer: &'a LayoutLayer, polygons: impl IntoIterator<Item = Vec<(i64, i64)>>) {
        self.polygons
            .extend(polygons.into_iter().map(|corners| (layer, corners)));
    }

    /// The design's name and digest, at the lower left of the chip.
    fn label(&mut self, design: &'a Design) {
        let (x, y) = design.layout.chip.size_nm;
        let inset = x.min(y) / 50;
        let text = format!("{} sha256:{}", design.name, design.digest());
        self.texts
            .push((&design.layout.layers.label, text, (-x / 2 + inset, -y / 2 + inset)));
    }

    /// Shapes as elements of GDSII.
    pub(crate) fn gds(&self) -> Vec<GdsElement> {
        let polygons = self
            .polygons
            .iter()
            .map(|(layer, corners)| super::polygon(layer, corners));
        let texts = self.texts.iter().map(|(layer, text, at)| GdsElement::Text {
            layer: layer.number(),
            text: text.clone(),
            at: point(at.0, at.1),
        });
        polygons.chain(texts).collect()
    }
}
