//! Measurements that a bench could take of a design: every element, colour, angle and distance that it names.

use std::path::Path;

use metalith_core::{Error, Progress, Result, Wedge};
use metalith_design::{Design, Element};
use metalith_pillars::{PillarMap, PillarReader};
use ndarray::Array2;

use crate::bench_file::{BenchFile, SemOffer};
use metalith_calibrate::set_format::WINDOW_CENTRE_UM;
use metalith_calibrate::{
    ElementIndex, LedIndex, MeasuredElement, MeasuredSet, Measurement, PerElement, PerMeasurement, SemSite, Stack,
};

/// Steepest direction of light behind an element that a camera sees (sine).
const STEEPEST: f64 = 0.9;

/// Distances about the focus where the bench names none, over the focal length: where the spot is about twice as wide.
const DEFOCUS: f64 = 0.035;

/// Part of the radius of a lens that holds the sites of a SEM: pillars at the rim are cut by nothing.
const SEM_REACH: f64 = 0.97;

/// The design as a session without measurements, and all measurements that the bench could take of it.
pub(crate) struct Candidates {
    pub set: MeasuredSet,
    pub measurements: Vec<Measurement>,
    /// Measurements that were left out because no camera could see their light, or it lands farther off than a set may say.
    pub unseen: usize,
}

/// All that the bench could take of a design that can be planned, whose layout is at `layout`.
///
/// # Errors
/// If the layout cannot be read, or nothing can be seen of any element.
pub(crate) fn candidates(
    design: &Design,
    bench: &BenchFile,
    layout: &Path,
    reader: &dyn PillarReader,
    progress: &dyn Progress,
) -> Result<Candidates> {
    let chosen = chosen_elements(design, bench)?;
    let sites = design.sites_of(&chosen);
    let layer = design.layout.layers.pillars.number();
    let maps = reader.pillars(layout, layer, design.cell.shape, &sites, progress)?;
    if let Some(empty) = maps.iter().zip(&sites).find(|(map, _)| map.pillars() == 0) {
        return Err(Error::refused(
            "layout/element-not-found",
            format!("the layout has no pillars of element {}", empty.1.name),
            "give the layout that was written from this design",
        ));
    }
    let set = session(design, bench, layout, &chosen, maps)?;
    let (measurements, unseen) = measurements(design, bench, &set, &chosen);
    if measurements.is_empty() {
        return Err(Error::refused(
            "plan/no-measurement-with-light",
            "no measurement of this bench receives light",
            "name angles in `field_deg` of the bench that are viewing directions of the elements",
        ));
    }
    Ok(Candidates {
        set,
        measurements,
        unseen,
    })
}

/// The elements that the bench names; else, of those that are round, the central one, the one farthest along x, and the farthest of
/// all.
///
/// # Errors
/// If the design has no such element, or its opening is no circle.
pub(crate) fn chosen_elements(design: &Design, bench: &BenchFile) -> Result<Vec<Element>> {
    let all = design.elements();
    let is_round = |e: &Element| design.lens_of(e).outline.is_none();
    let not_round = |what: String| {
        Error::refused(
            "plan/element-not-round",
            what,
            "name round elements by `elements` of the bench: measurements are predicted through round openings",
        )
    };
    let mut picked: Vec<Element> = Vec::new();
    if bench.elements.is_empty() {
        let round = || all.iter().copied().filter(is_round);
        picked.extend(round().min_by_key(|e| e.centre_nm.0.abs() + e.centre_nm.1.abs()));
        picked.extend(round().max_by_key(|e| e.centre_nm.0 - e.centre_nm.1.abs()));
        picked.extend(round().max_by_key(|e| e.centre_nm.0 + e.centre_nm.1));
        if picked.is_empty() {
            return Err(not_round(format!("{} has no round element", design.path.display())));
        }
    }
    for index in &bench.elements {
        let Some(own) = all.iter().find(|e| index_of(e) == *index) else {
            return Err(Error::refused(
                "plan/unknown-element",
                format!("the design has no element {index:?}"),
                "correct `elements` of the bench",
            ));
        };
        if !is_round(own) {
            return Err(not_round(format!("the opening of element {index:?} is a polygon")));
        }
        picked.push(*own);
    }
    Ok(without_repeats(picked))
}

/// The first of each.
fn without_repeats<T: PartialEq>(all: Vec<T>) -> Vec<T> {
    let mut out: Vec<T> = Vec::new();
    for one in all {
        if !out.contains(&one) {
            out.push(one);
        }
    }
    out
}

/// Diameter of the largest lens of a design (um): the lattices of all are as large.
pub(crate) fn lens_diameter_um(design: &Design) -> f64 {
    f64::from(design.array.largest_nm(&design.lens)) * 1e-3
}

/// Distances at which an element of this focal length is looked at (um), to a tenth of a micrometre.
pub(crate) fn distances_um(bench: &BenchFile, focal_um: f64) -> Vec<f64> {
    let all = if bench.distances_um.is_empty() {
        vec![focal_um * (1.0 - DEFOCUS), focal_um, focal_um * (1.0 + DEFOCUS)]
    } else {
        bench.distances_um.clone()
    };
    without_repeats(all.into_iter().map(|d| (d * 10.0).round() / 10.0).collect())
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
    maps: Vec<PillarMap>,
) -> Result<MeasuredSet> {
    let elements: PerElement<MeasuredElement> = chosen
        .iter()
        .zip(maps)
        .map(|(element, pillars)| MeasuredElement {
            index: index_of(element),
            centre_um: element.centre_um(),
            aperture_diameter_um: 2.0 * design.aperture_radius_of_um(element),
            axis_um: [0.0; 2],
            pillars,
        })
        .collect();
    Ok(MeasuredSet {
        path: layout.to_owned(),
        title: format!("{}, planned session", design.name),
        layout: layout.to_owned(),
        stack: Stack {
            cell: design.cell_stack()?,
            lens_diameter_um: lens_diameter_um(design),
            focal_length_um: design.lens.focal_length_um,
        },
        divergence_rad: bench.divergence_rad,
        camera: bench.camera,
        leds: bench.leds.clone(),
        sem: Vec::new(),
        sem_offset_sigma_nm: bench.sem.map_or(1.0, |s| s.offset_sigma_nm),
        elements,
        measurements: PerMeasurement::default(),
        free_scale: false,
        field_boundary_um: bench.field_boundary_um,
    })
}

fn measurements(
    design: &Design,
    bench: &BenchFile,
    set: &MeasuredSet,
    chosen: &[Element],
) -> (Vec<Measurement>, usize) {
    let most = bench.frames.last().copied().unwrap_or(1);
    let dark = Array2::zeros((bench.camera.rows, bench.camera.cols));
    let (mut out, mut unseen) = (Vec::new(), 0);
    for (e, element) in chosen.iter().enumerate() {
        let (index, wedge) = (index_of(element), element.wedge);
        let turn = [wedge.sin_x, wedge.sin_y];
        let f_um = design.lens_of(element).focal_length_um;
        let distances = distances_um(bench, f_um);
        for (led, lamp) in set.leds.iter().enumerate() {
            for (a, field) in without_repeats(bench.fields_deg.clone()).into_iter().enumerate() {
                // Where the element looks, and the field from there, to a hundredth of a degree as a person would set it.
                let axis = turn.map(|s| -s.asin().to_degrees());
                let aoi_deg = [0, 1].map(|k| ((axis[k] + field[k]) * 100.0).round() / 100.0);
                let centre = landing_um(wedge, aoi_deg, lamp.centre_nm * 1e-3, f_um);
                let within = |c: &[f64; 2]| c.iter().all(|v| WINDOW_CENTRE_UM.range.contains(v));
                let Some(centre) = centre.filter(within) else {
                    unseen += distances.len();
                    continue;
                };
                for (z, distance_um) in distances.iter().enumerate() {
                    out.push(Measurement {
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

/// Place where light of a wavelength (um) lands from the element's axis, in the focal plane, to a hundredth of a
/// micrometre; `None` if it leaves too steeply.
fn landing_um(wedge: Wedge, aoi_deg: [f64; 2], wavelength_um: f64, f_um: f64) -> Option<[f64; 2]> {
    let turn = [wedge.sin_x, wedge.sin_y];
    let sines = [0, 1].map(|k| aoi_deg[k].to_radians().sin() + turn[k] * wavelength_um / wedge.wavelength_um);
    let across = sines[0].hypot(sines[1]);
    let along = (1.0 - across * across).sqrt();
    (across < STEEPEST).then(|| sines.map(|s| (f_um * s / along * 100.0).round() / 100.0))
}

/// Sites for a SEM, spread evenly over the area of each lens, the same number of each element.
pub(crate) fn sem_sites(set: &MeasuredSet, offer: SemOffer) -> Vec<SemSite> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let elements = set.elements.len().max(1);
    let each = offer.sites.div_ceil(elements);
    let mut out: Vec<SemSite> = Vec::new();
    for element in &set.elements {
        let lattice = element.pillars.lattice;
        let radius = SEM_REACH * 0.5 * set.stack.lens_diameter_um.min(element.aperture_diameter_um);
        for k in 0..each {
            let share = (k as f64 + 0.5) / each as f64;
            let (r, turn) = (radius * share.sqrt(), golden * k as f64);
            let Some(at) = lattice.site_at([r * turn.cos(), r * turn.sin()]) else {
                continue;
            };
            let designed = element.pillars.number[[at[1], at[0]]];
            if designed > 0 && out.len() < offer.sites {
                out.push(SemSite {
                    element: element.index,
                    at_um: [0, 1].map(|axis| lattice.place_um(axis, at[axis])),
                    designed_nm: f64::from(designed),
                    measured_nm: f64::from(designed),
                    sigma_nm: offer.sigma_nm,
                });
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench_file::tests::small_bench;
    use metalith_core::Silent;
    use metalith_design::PillarArray;
    use metalith_gds::extract::PillarsAt;
    use metalith_layout::write_pillars;

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

    #[test]
    fn elements_that_are_named_twice_are_taken_once() {
        let design = Design::read(&metalith_testing::root().join("designs/mini_3x3.toml")).unwrap();
        let bench = small_bench("elements = [0, 0, 1, 0, 0, 0]\ndistance_um = [139.0, 144.0, 139.01]\n");
        let chosen = chosen_elements(&design, &bench).unwrap();
        assert_eq!(chosen.iter().map(index_of).collect::<Vec<_>>(), [[0, 0], [1, 0]]);
        assert_eq!(distances_um(&bench, 144.0), [139.0, 144.0]);
    }

    /// Round lenses of several kinds, each at its own focal length; polygons are left out, and refused where they are named.
    #[test]
    fn lenses_of_several_kinds_are_looked_at_each_in_its_own_focus() {
        let folder = tempfile::tempdir().unwrap();
        let text = std::fs::read_to_string(metalith_testing::root().join("designs/mixed_lenses.toml")).unwrap();
        let file = folder.path().join("mixed.toml");
        // The hexagon as the circle about it.
        std::fs::write(&file, text.replace("aperture = \"regular\"\naperture_sides = 6\n", "")).unwrap();
        let design = Design::read(&file).unwrap();
        let layout = folder.path().join("layout.gds");
        let array = PillarArray::build(&design, &Silent).unwrap();
        write_pillars(&design, &array, design.layout.hierarchy, &layout, &Silent).unwrap();
        let bench = small_bench("elements = [1, 0, 3, 0]\n");
        let found = candidates(&design, &bench, &layout, &PillarsAt::STATED, &Silent).unwrap();
        let set = &found.set;
        assert_eq!(set.stack.lens_diameter_um, 80.0);
        for (e, element) in set.elements.iter_enumerated() {
            let own: Vec<f64> = found
                .measurements
                .iter()
                .filter(|c| c.element == e)
                .map(|c| c.distance_um)
                .collect();
            let (focal_um, diameter_um) = if element.index == [3, 0] {
                (110.0, 80.0)
            } else {
                (144.0, 60.0)
            };
            assert!(own.contains(&focal_um), "{:?}: {own:?}", element.index);
            // Openings are larger by a margin of 2 um.
            assert_eq!(element.aperture_diameter_um, diameter_um + 4.0);
            assert!(element.pillars.pillars() > 0);
        }
        let unnamed = chosen_elements(&design, &small_bench("")).unwrap();
        assert!(unnamed.iter().all(|e| index_of(e) != [2, 0]), "the square is left out");
        let named = small_bench("elements = [2, 0]\n");
        let error = chosen_elements(&design, &named).unwrap_err().to_string();
        assert!(error.contains("[2, 0] is a polygon"), "{error}");
    }
}
