//! Exposed area and writing time of the first step, and the effect of the shot grid on widths.

use super::dose::{Beam, Exposure, WriteTime};
use super::layout_statistics::{LayerCount, LayoutStatistics};
use super::process::Process;
use super::write_fields;
use metalith_core::{LayerNumber, Result};
use metalith_design::Design;
use metalith_design::array::PillarArray;
use metalith_pillars::{CHORD_ERROR, PillarId, PillarRows, PillarShape};

/// Exposed area and writing time of each file of the first step.
pub(super) fn exposures(
    design: &Design,
    process: &Process,
    census: &[LayoutStatistics],
) -> Result<Vec<(String, Exposure, Vec<WriteTime>)>> {
    let layers = &design.layout.layers;
    let own = [layers.pillars.number(), layers.pillar_marks.number()];
    let mut exposures = Vec::new();
    for file in census {
        let exposed = |number: LayerNumber| own.contains(&number) || is_of_dose_matrix(number, process);
        let Some((mut exposure, bounds)) = exposure_of(file, exposed) else {
            continue;
        };
        exposure.fields = if exposures.is_empty() {
            write_fields::of_design(design, process)
        } else {
            write_fields::of_bounds(bounds, process)
        };
        exposures.push((file.file.clone(), exposure, times(process, &exposure)?));
    }
    Ok(exposures)
}

/// True if a layer is one of the dose matrix.
pub(super) fn is_of_dose_matrix(number: LayerNumber, process: &Process) -> bool {
    i32::from(number.layer) == i32::from(process.dose_matrix.layer)
}

/// Area and shapes on the exposed layers of a file, without fields, and their bounding box (um); none if they are empty.
pub(super) fn exposure_of(
    file: &LayoutStatistics,
    exposed: impl Fn(LayerNumber) -> bool,
) -> Option<(Exposure, [f64; 4])> {
    let mut exposure = Exposure::default();
    let mut bounds: Option<[f64; 4]> = None;
    let is_exposed = |l: &&LayerCount| exposed(LayerNumber::new(l.layer, l.datatype));
    for layer in file.layers.iter().filter(is_exposed) {
        exposure.area_um2 += layer.area_um2;
        exposure.shapes += layer.shapes;
        if let Some(b) = layer.bounds_um {
            bounds = Some(bounds.map_or(b, |a| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]));
        }
    }
    bounds.map(|bounds| (exposure, bounds))
}

/// Writing time at each current.
pub(super) fn times(process: &Process, exposure: &Exposure) -> Result<Vec<WriteTime>> {
    let currents = process.writer.currents_na.iter();
    currents.map(|&i| WriteTime::of(process, exposure, i)).collect()
}

/// Change of the pillars of the array on the shots of each beam, root mean square over all pillars (nm): of their
/// widths, or, for rotated rectangles, which have no edges along the shots, of the places of their corners.
pub(super) fn snapping(array: &PillarArray, process: &Process) -> Result<Vec<(Beam, f64)>> {
    let mut counts: Vec<u64> = Vec::new();
    let histograms: Vec<_> = array.classes.iter().map(|c| c.widths.histogram()).collect();
    for placed in &array.placed {
        let histogram = &histograms[placed.class];
        counts.resize(counts.len().max(histogram.len()), 0);
        counts.iter_mut().zip(histogram).for_each(|(all, n)| *all += n);
    }
    snapping_of(array.shape, &counts, process)
}

/// Variant of [`snapping`] for pillars that are counted by their widths or numbers.
pub(super) fn snapping_of(shape: PillarShape, counts: &[u64], process: &Process) -> Result<Vec<(Beam, f64)>> {
    let pillars: u64 = counts.iter().skip(1).sum();
    process
        .writer
        .currents_na
        .iter()
        .map(|&current| {
            let beam = Beam::choose(&process.writer, current, process.resist.dose_uc_cm2)?;
            let of_pillar = |(w, &n): (usize, &u64)| n as f64 * snapped_square(shape, w as u16, &beam);
            let sum: f64 = counts.iter().enumerate().skip(1).map(of_pillar).sum();
            Ok((beam, (sum / pillars.max(1) as f64).sqrt()))
        })
        .collect()
}

/// Square of what the shots change of a pillar (nm^2): of its width, or, mean over them, of the places of its corners.
fn snapped_square(shape: PillarShape, number: u16, beam: &Beam) -> f64 {
    let off = |nm: f64| beam.snapped_nm(nm) - nm;
    let edges_nm = shape.axis_edges_nm(PillarId(number));
    if edges_nm.is_empty() {
        let corners = shape.corners(PillarId(number), CHORD_ERROR);
        let sum: f64 = corners
            .iter()
            .map(|&(x, y)| off(x as f64).powi(2) + off(y as f64).powi(2))
            .sum();
        return sum / corners.len() as f64;
    }
    let sum: f64 = edges_nm.iter().map(|&nm| off(f64::from(nm)).powi(2)).sum();
    sum / edges_nm.len() as f64
}
