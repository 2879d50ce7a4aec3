//! Light that arrives far from the direction that cells are solved for.

use metalith_cell::Fidelity;
use metalith_design::CellIncidence;

use crate::chip::incidence;
use crate::field_of_view::off_axis_um;
use crate::geometry::SceneView;
use crate::imaging_system::ImagingSystem;

/// Difference between direction sines from which on cells of another direction mislead: with pillars 350 nm apart the image at
/// 530 nm is 2.0 times too bright at 0.5, 4.3 times at 0.64 (`crates/imaging/tests/oblique.rs`).
const MISLEADING: f64 = 0.45;

impl ImagingSystem {
    /// Notes on directions: light far from those that cells are solved for, and angles at which the response of pixels is not known.
    pub fn direction_notes(&self) -> impl Iterator<Item = String> {
        [self.steep_note(), self.angle_note()].into_iter().flatten()
    }

    /// Note on light of the scene that is imaged by cells which are solved for another direction.
    fn steep_note(&self) -> Option<String> {
        if incidence(&self.design) == CellIncidence::Oblique {
            return None;
        }
        let coupled = self.design.verify.fidelity == Fidelity::Neighbours;
        let view: &SceneView = &self.view;
        let (last_row, last_column) = (view.rows as f64 - 1.0, view.columns as f64 - 1.0);
        let ends = |last: f64| [0.0, 0.5 * last, last];
        let places = ends(last_row)
            .into_iter()
            .flat_map(|row| ends(last_column).map(|column| (row, column)));
        let farthest = places.flat_map(|(row, column)| {
            self.elements.iter().enumerate().filter_map(move |(k, element)| {
                let tangents = view.tangents(row, column);
                off_axis_um(&self.elements, k, &self.camera, view, tangents)
                    .filter(|um| *um <= self.bank.spec.reach_um)?;
                let sines = element.sines(tangents, view.distance_um);
                let solved = if coupled {
                    element.wedge.looks_at(element.wedge.wavelength_um).into()
                } else {
                    [0.0; 2]
                };
                Some((sines[0] - solved[0]).hypot(sines[1] - solved[1]))
            })
        });
        let farthest = farthest.fold(0.0, f64::max);
        (farthest > MISLEADING).then(|| {
            format!(
                "elements image light {:.0} degrees from the direction that their cells are solved for: where the lattice of the pillars diffracts, such images are up to 4 times too bright; give `incidence = \"oblique\"` in [verify]{}",
                farthest.min(1.0).asin().to_degrees(),
                if coupled { " with `fidelity = \"rigorous\"`" } else { "" }
            )
        })
    }
}
