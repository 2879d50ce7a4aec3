//! Fields of the classes of an element, for pictures.

use super::{ArrivingLight, AsBuiltElement, CameraChange, ClassTable, IncoherentFields};

/// Fields of the classes of an element in one light, for pictures: from any direction, along which cells are not solved
/// anew.
#[derive(Clone)]
pub struct ClassFields {
    pub(crate) tables: Vec<ClassTable>,
    pub(crate) departing: Option<Vec<(ClassTable, i32)>>,
    pub(crate) weight: f64,
    pub(crate) defocus_um: f64,
    pub(crate) camera: CameraChange,
}

impl ClassFields {
    /// Fields of the same classes between directions that cells are solved for, by weights whose sum is one. The phase that all
    /// classes share turns fast with the direction and no intensity depends on it: it is taken out before tables are added.
    ///
    /// # Panics
    /// If there are none.
    #[must_use]
    pub fn between(parts: &[(f64, &Self)]) -> Self {
        // Along the normal one table is that of all polarisations.
        let first = parts.iter().map(|(_, part)| *part).max_by_key(|part| part.tables.len());
        let first = first.expect("there is one at least");
        let table = |k: usize| {
            let of = |part: &'_ Self| k.min(part.tables.len() - 1);
            let tables: Vec<_> = parts
                .iter()
                .map(|(weight, part)| (*weight, &part.tables[of(part)]))
                .collect();
            ClassTable::between(&tables)
        };
        Self {
            tables: (0..first.tables.len()).map(table).collect(),
            departing: None,
            weight: first.weight,
            defocus_um: first.defocus_um,
            camera: first.camera.clone(),
        }
    }

    /// The element in light from a direction.
    pub fn lit<'e>(&self, element: &'e AsBuiltElement, light: ArrivingLight) -> IncoherentFields<'e> {
        let (tables, camera) = (self.tables.clone(), self.camera.clone());
        IncoherentFields::of_classes(element, tables, self.weight, light, self.defocus_um, camera)
    }

    /// Tables of light whose direction is asked for, each with how often it has the phase of the element: as those of
    /// [`PolarisedTables::departing`](metalith_cell::PolarisedTables::departing) where pillars distinguish
    /// polarisations, with the power of what passes; else those of all light.
    pub fn departing(&self) -> Vec<(&ClassTable, i32)> {
        match &self.departing {
            Some(departing) => departing.iter().map(|(table, order)| (table, *order)).collect(),
            None => self.tables.iter().map(|table| (table, 1)).collect(),
        }
    }

    /// Power of the light that leaves an element of so many classes in the direction it came from, as one wave, over its area: the
    /// square of the sum of the transmissions of its sites, mean over the polarisations in which light arrives.
    pub fn zeroth_order(&self, element: &AsBuiltElement, all_um4: f64) -> f64 {
        let site_um2 = element.lattice().cell_um2();
        let of = |table: &ClassTable| (table.sum(element.classes()) * site_um2).norm_sqr() / all_um4;
        self.tables.iter().map(of).sum::<f64>() * self.weight
    }
}

/// Tables of light of an element by direction of departure, with the power of what passes: over one element light of
/// unlike orders may interfere a little.
pub(crate) fn scaled_to(
    passed: &[ClassTable],
    departing: Vec<(ClassTable, i32)>,
    classes: &[u16],
) -> Vec<(ClassTable, i32)> {
    let all: f64 = departing.iter().map(|(table, _)| table.power(classes)).sum();
    let passes: f64 = passed.iter().map(|table| table.power(classes)).sum();
    let scale = if all > 0.0 { (passes / all).sqrt() as f32 } else { 0.0 };
    let scaled = departing.into_iter().map(|(table, order)| (table.scaled(scale), order));
    scaled.collect()
}
