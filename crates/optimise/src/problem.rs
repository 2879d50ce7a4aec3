//! The merit that a design asks for.

use metalith_cell::{CellModel, Fidelity};
use metalith_core::{Progress, Result};
use metalith_design::{MeritSpec, OptimiseSpec, ViewSpec};
use metalith_sensor::Noise;
use rayon::prelude::*;

use crate::PixelWindow;
use crate::image::deconvolution::Deconvolution;
use crate::image::scene::Scene;
use crate::image::views::Views;
use crate::merit::fabrication_errors;
use crate::merit::field::{FieldProblem, MeritKind};
use crate::merit::field_point::FieldPoint;
use crate::merit::focus::{FabricationError, Lens, wavelengths};
use crate::rings::kernel::RingField;
use crate::rings::mapping::Mapping;

/// Radii at which side lobes are sampled, out to four times the radius where they begin.
const SIDE_LOBE_POINTS: usize = 48;
/// Distance of wavelengths at which side lobes are sampled (nm): haze is smooth in wavelength.
const SIDE_LOBE_STEP_NM: f64 = 15.0;

/// Wavelengths of a design's merit (um).
pub(crate) fn band(spec: &OptimiseSpec) -> Vec<f64> {
    wavelengths(spec.band_um.0 * 1e3, spec.band_um.1 * 1e3, spec.step_um * 1e3)
}

/// The part of the merit that is a function of the field at a few points: `sum`, `log` and `side_lobes`, in
/// expectation over errors where that is asked for. None if their weights are zero.
///
/// # Errors
/// If the kernel does not fit, or the cell does not cover the band.
pub(crate) fn field_problem(
    lens: &Lens,
    spec: &OptimiseSpec,
    merit: &MeritSpec,
    cells: &[&dyn CellModel],
    mapping: &Mapping,
) -> Result<Option<FieldProblem>> {
    let band = band(spec);
    let draws = match &spec.robust {
        Some(robust) => fabrication_errors::draw(robust, robust.draws as usize, cells.len(), spec.seed ^ 0x5eed),
        None => vec![FabricationError::default()],
    };
    let share = 1.0 / draws.len() as f64;
    let mut blocks = Vec::new();
    for (i, &error) in draws.iter().enumerate() {
        // Many errors need few wavelengths each: those of one lie between those of the others.
        let stride = draws.len().min(4);
        let some = band
            .iter()
            .copied()
            .skip(i % stride)
            .step_by(stride)
            .collect::<Vec<_>>();
        for (kind, weight) in [(MeritKind::Log, merit.log), (MeritKind::Linear, merit.sum)] {
            if weight != 0.0 {
                blocks.push((kind, weight * share, lens.focal_rows(&some, error, cells)?));
            }
        }
        if merit.side_lobes != 0.0 {
            let rows = side_lobe_rows(lens, spec, merit.side_lobe_radius_um, error, cells)?;
            blocks.push((MeritKind::Linear, -merit.side_lobes * share, rows));
        }
    }
    if blocks.is_empty() {
        return Ok(None);
    }
    let memory = spec.memory_mb << 20;
    let problem = FieldProblem::new(blocks, cells, mapping.clone(), memory)?;
    match cells[0].fidelity() {
        Fidelity::Neighbours => problem.among_neighbours(lens, cells[0], memory).map(Some),
        _ => Ok(Some(problem)),
    }
}

/// Rows whose weighted intensities sum up to the mean share of the incident power that arrives between
/// `radius_um` and four times that.
fn side_lobe_rows(
    lens: &Lens,
    spec: &OptimiseSpec,
    radius_um: f64,
    error: FabricationError,
    cells: &[&dyn CellModel],
) -> Result<Vec<FieldPoint>> {
    let lengths = wavelengths(spec.band_um.0 * 1e3, spec.band_um.1 * 1e3, SIDE_LOBE_STEP_NM);
    let area = lens.rings.sites() as f64 * lens.rings.lattice().cell_um2();
    let width = 3.0 * radius_um / SIDE_LOBE_POINTS as f64;
    let distance_um = lens.distance_um + error.defocus_um;
    let bessel = RingField::new(&lens.rings, spec.band_um.0, distance_um).bessel(4.0 * radius_um);
    let points = lengths
        .iter()
        .flat_map(|&l| (0..SIDE_LOBE_POINTS).map(move |i| (l, radius_um + (i as f64 + 0.5) * width)))
        .collect::<Vec<_>>();
    points
        .into_par_iter()
        .map(|(wavelength_um, rho)| {
            let full = cells[error.cell].full_transmission(wavelength_um)?;
            let field = RingField::new(&lens.rings, wavelength_um, distance_um);
            // Each ring around the axis with its power, so that all rows are of like size.
            let scale = (std::f64::consts::TAU * rho * width / area).sqrt() / full;
            let weight = 1.0 / lengths.len() as f32;
            Ok(lens.field_point(error.at(wavelength_um), weight, |ring| {
                field.at_radius(ring, rho, &bessel) * scale
            }))
        })
        .collect()
}

/// Views of a design, at wavelengths `shift` of their distance off.
pub fn views(spec: &OptimiseSpec, views: &ViewSpec, shift: f64) -> Views {
    let step_nm = views.step_um * 1e3;
    let (first, last) = (spec.band_um.0 * 1e3 + shift * step_nm, spec.band_um.1 * 1e3);
    Views {
        wavelengths_um: wavelengths(first, last, step_nm),
        angles_rad: views.angles_deg.iter().map(|a| a.to_radians()).collect(),
        channels: 3,
        window: PixelWindow {
            pixels: views.pixels,
            pixel_um: views.pixel_um,
        },
        shared_filter: views.shared_filter,
        drawn: views.drawn,
        scene: Scene::default(),
        noise: Noise::default(),
    }
}

/// The merit `deconvolution` of a design, if it has a weight.
///
/// # Errors
/// As [`Deconvolution::new`].
pub(crate) fn deconvolution(
    lens: &Lens,
    spec: &OptimiseSpec,
    cell: &dyn CellModel,
    mapping: &Mapping,
    progress: &dyn Progress,
) -> Result<Option<Deconvolution>> {
    if spec.merit.deconvolution == 0.0 {
        return Ok(None);
    }
    let views = views(spec, &spec.views, 0.0);
    Deconvolution::new(lens, views, cell, mapping.clone(), spec.memory_mb << 20, progress).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_design::Design;

    /// Every channel has its wavelengths, however narrow the band is; in the visible they are 10 nm apart.
    #[test]
    fn views_are_as_many_in_any_band() {
        let path = metalith_testing::design("tio2_532");
        let text = std::fs::read_to_string(&path).unwrap();
        let band = "band_nm = [515, 550]";
        assert!(text.contains(band));
        for own in [band, "band_nm = [531, 533]", "band_nm = [420, 1200]"] {
            let design = Design::parse(&path, &text.replacen(band, own, 1)).unwrap();
            for shift in [0.0, 0.5] {
                let found = views(&design.optimise, &design.optimise.views, shift);
                let count = found.wavelengths_um.len();
                assert!((30..=31).contains(&count), "{own}: {count}");
            }
        }
        let visible = Design::read(&metalith_testing::design("broadband_3x3")).unwrap();
        assert_eq!(visible.optimise.views, OptimiseSpec::default().views);
    }
}
