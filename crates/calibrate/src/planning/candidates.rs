//! Captures that a bench could take of a design: every element, colour, angle and distance that it names.

use std::path::Path;

use metalith_core::{ElementSite, Error, Lattice, PillarReader, Progress, Result, Wedge, WidthMap};
use metalith_design::{Design, Element};
use ndarray::Array2;

use super::bench_file::{BenchFile, SemOffer};
use crate::set::{
    Capture, ElementIndex, LedIndex, MeasuredElement, MeasuredSet, PerCapture, PerElement, SemSite, Stack,
};

/// Steepest direction of light behind an element that a camera sees (sine).
const STEEPEST: f64 = 0.9;

/// Distances about the focus where the bench names none, over the focal length: where the spot is about twice as wide.
const DEFOCUS: f64 = 0.035;

/// Part of the radius of a lens that holds the sites of a SEM: pillars at the rim are cut by nothing.
const SEM_REACH: f64 = 0.97;

/// The design as a session without captures, and all captures that the bench could take of it.
pub struct Candidates {
    pub set: MeasuredSet,
    pub captures: Vec<Capture>,
    /// Captures that were left out because no camera could see their light.
    pub unseen: usize,
}

/// All that the bench could take of a design, whose layout is at `layout`.
///
/// # Errors
/// If the design has rectangles or a hexagonal lattice, the layout cannot be read, an element is not in the design, or nothing can be
/// seen of any.
pub fn candidates(
    design: &Design,
    bench: &BenchFile,
    layout: &Path,
    reader: &dyn PillarReader,
    progress: &dyn Progress,
) -> Result<Candidates> {
    if design.cell.shape.rectangles().is_some() {
        return Err(Error::invalid(
            format!("{} is a design of rectangles", design.path.display()),
            "plan sessions of squares or circles: sets are read of these alone",
        ));
    }
    design.square_lattice("`plan`")?;
    let chosen = chosen_elements(design, bench)?;
    let sites: Vec<ElementSite> = chosen.iter().map(|e| design.site_of(e)).collect();
    let layer = design.layout.layers.pillars.number();
    let maps = reader.pillars(layout, layer, design.cell.shape, &sites, progress)?;
    if let Some(empty) = maps.iter().zip(&sites).find(|(map, _)| map.pillars() == 0) {
        return Err(Error::invalid(
            format!("the layout has no pillars of element {}", empty.1.name),
            "give the layout that was written from this design",
        ));
    }
    let set = session(design, bench, layout, &chosen, maps)?;
    let (captures, unseen) = captures(design, bench, &set, &chosen);
    if captures.is_empty() {
        return Err(Error::invalid(
            "no capture of this bench would see light",
            "name angles in `field_deg` that the elements look at",
        ));
    }
    Ok(Candidates { set, captures, unseen })
}

/// The elements that the bench names; else the central one, the one farthest along x, and the farthest of all.
fn chosen_elements(design: &Design, bench: &BenchFile) -> Result<Vec<Element>> {
    let all = design.elements();
    if !bench.elements.is_empty() {
        let of = |index: &[i64; 2]| {
            all.iter().find(|e| index_of(e) == *index).copied().ok_or_else(|| {
                Error::invalid(
                    format!("the design has no element {index:?}"),
                    "correct `elements` of the bench",
                )
            })
        };
        return bench.elements.iter().map(of).collect();
    }
    let picked = [
        all.iter().min_by_key(|e| e.centre_nm.0.abs() + e.centre_nm.1.abs()),
        all.iter().max_by_key(|e| e.centre_nm.0 - e.centre_nm.1.abs()),
        all.iter().max_by_key(|e| e.centre_nm.0 + e.centre_nm.1),
    ];
    let mut out: Vec<Element> = Vec::new();
    for e in picked.into_iter().flatten() {
        if !out.contains(e) {
            out.push(*e);
        }
    }
    Ok(out)
}

/// Index of an element as sets have it.
fn index_of(element: &Element) -> [i64; 2] {
    [element.index.0.into(), element.index.1.into()]
}

fn session(
    design: &Design,
    bench: &BenchFile,
    layout: &Path,
    chosen: &[Element],
    maps: Vec<WidthMap>,
) -> Result<MeasuredSet> {
    let elements: PerElement<MeasuredElement> = chosen
        .iter()
        .zip(maps)
        .map(|(element, pillars)| MeasuredElement {
            index: index_of(element),
            centre_um: element.centre_um(),
            aperture_diameter_um: 2.0 * design.aperture_radius_um(),
            pillars,
        })
        .collect();
    Ok(MeasuredSet {
        path: layout.to_owned(),
        title: format!("{}, planned session", design.name),
        layout: layout.to_owned(),
        stack: Stack {
            cell: design.cell_stack()?,
            lens_diameter_um: f64::from(design.lens.diameter_nm) * 1e-3,
            focal_length_um: design.lens.focal_length_um,
        },
        divergence_rad: bench.divergence_rad,
        camera: bench.camera,
        leds: bench.leds.clone(),
        sem: Vec::new(),
        sem_offset_sigma_nm: bench.sem.map_or(1.0, |s| s.offset_sigma_nm),
        elements,
        captures: PerCapture::default(),
        field_boundary_um: bench.field_boundary_um,
    })
}

fn captures(design: &Design, bench: &BenchFile, set: &MeasuredSet, chosen: &[Element]) -> (Vec<Capture>, usize) {
    let f_um = design.lens.focal_length_um;
    let distances = if bench.distances_um.is_empty() {
        vec![f_um * (1.0 - DEFOCUS), f_um, f_um * (1.0 + DEFOCUS)]
    } else {
        bench.distances_um.clone()
    };
    let distances: Vec<f64> = distances.into_iter().map(|d| (d * 10.0).round() / 10.0).collect();
    let most = bench.frames.last().copied().unwrap_or(1);
    let dark = Array2::zeros((bench.camera.rows, bench.camera.cols));
    let (mut out, mut unseen) = (Vec::new(), 0);
    for (e, element) in chosen.iter().enumerate() {
        let (index, wedge) = (index_of(element), element.wedge);
        let turn = [wedge.sin_x, wedge.sin_y];
        for (led, lamp) in set.leds.iter().enumerate() {
            for (a, field) in bench.fields_deg.iter().enumerate() {
                // Where the element looks, and the field from there, to a hundredth of a degree as a person would set it.
                let axis = turn.map(|s| -s.asin().to_degrees());
                let aoi_deg = [0, 1].map(|k| ((axis[k] + field[k]) * 100.0).round() / 100.0);
                let Some(centre) = landing_um(wedge, aoi_deg, lamp.centre_nm * 1e-3, f_um) else {
                    unseen += distances.len();
                    continue;
                };
                for (z, distance_um) in distances.iter().enumerate() {
                    out.push(Capture {
                        name: format!("e{}_{}_{}_a{a}_z{z}", index[0], index[1], lamp.name()),
                        element: ElementIndex::from(e),
                        led: LedIndex::from(led),
                        aoi_rad: aoi_deg.map(f64::to_radians),
                        distance_um: *distance_um,
                        window_centre_um: centre,
                        scale_dn: 1.0,
                        frames: most,
                        dn: dark.clone(),
                        noise: None,
                    });
                }
            }
        }
    }
    (out, unseen)
}

/// Where light of a wavelength (um) lands from the element's axis, in the focal plane, to a hundredth of a micrometre; none
/// if it leaves too steeply.
fn landing_um(wedge: Wedge, aoi_deg: [f64; 2], wavelength_um: f64, f_um: f64) -> Option<[f64; 2]> {
    let turn = [wedge.sin_x, wedge.sin_y];
    let sines = [0, 1].map(|k| aoi_deg[k].to_radians().sin() + turn[k] * wavelength_um / wedge.wavelength_um);
    let across = sines[0].hypot(sines[1]);
    let along = (1.0 - across * across).sqrt();
    (across < STEEPEST).then(|| sines.map(|s| (f_um * s / along * 100.0).round() / 100.0))
}

/// Sites for a SEM, spread evenly over the area of each lens, the same number of each element.
pub fn sem_sites(set: &MeasuredSet, offer: SemOffer) -> Vec<SemSite> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let elements = set.elements.len().max(1);
    let each = offer.sites.div_ceil(elements);
    let mut out: Vec<SemSite> = Vec::new();
    for element in &set.elements {
        let lattice = element.pillars.lattice;
        let radius = SEM_REACH * 0.5 * set.stack.lens_diameter_um;
        for k in 0..each {
            let share = (k as f64 + 0.5) / each as f64;
            let (r, turn) = (radius * share.sqrt(), golden * k as f64);
            let at = [r * turn.cos(), r * turn.sin()].map(|v| nearest(lattice, v));
            let designed = element.pillars.width_nm[[at[1], at[0]]];
            if designed > 0 && out.len() < offer.sites {
                out.push(SemSite {
                    element: element.index,
                    at_um: at.map(|i| lattice.coordinate_um(i)),
                    designed_nm: f64::from(designed),
                    measured_nm: f64::from(designed),
                    sigma_nm: offer.sigma_nm,
                });
            }
        }
    }
    out
}

/// The site nearest to a place along an axis (um).
fn nearest(lattice: Lattice, at_um: f64) -> usize {
    let along = at_um / lattice.pitch_um() + 0.5 * (lattice.sites() as f64 - 1.0);
    (along.round().max(0.0) as usize).min(lattice.sites() - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_of_the_wedge_lands_on_the_axis_and_other_colours_beside_it() {
        let sin_x = 15f64.to_radians().sin();
        let wedge = Wedge {
            wavelength_um: 0.55,
            sin_x,
            sin_y: 0.0,
        };
        assert_eq!(landing_um(wedge, [-15.0, 0.0], 0.55, 144.0), Some([0.0, 0.0]));
        let red = landing_um(wedge, [-15.0, 0.0], 0.66, 144.0).unwrap();
        let sine = sin_x * 0.2;
        // Places are rounded to a hundredth of a micrometre.
        assert!((red[0] - 144.0 * sine / (1.0 - sine * sine).sqrt()).abs() < 0.006);
        assert_eq!(landing_um(wedge, [60.0, 0.0], 0.66, 144.0), None);
    }
}
