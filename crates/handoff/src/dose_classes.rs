//! Dose classes: what a model adds to widths, undone by the dose of each pillar in place of its width.
//!
//! The layout stays as intended. Each class has a layout of its own, whose pillars have the number of the class as their datatype.
//! The layouts are read back, and the same model says how wide their pillars come out.

use metalith_core::{Error, Progress, Result};
use metalith_design::Design;
use metalith_design::array::{PillarArray, SymmetryGroup};
use metalith_layout::{read_pillars, write_pillars};
use metalith_optics::{CalibratedModel, DoseResponse, DrawnElement, GeometryChange};
use metalith_pillars::{PillarId, PillarMap};
use metalith_verify::compensate::check_equal_copies;
use serde::Serialize;

use super::listing::Listing;
use super::process::Process;
use super::tables;

/// Step of widths from one class to the next (nm): pillars are off by half of it at most.
const CLASS_NM: f64 = 1.0;

/// Most classes: datatypes that every reader of GDSII takes.
const MOST_CLASSES: usize = 60;

/// Least slope with dose (nm for a per cent): below, no writer has the dose that would be needed.
const LEAST_SLOPE: f64 = 0.01;

/// A dose and the pillars that are written with it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DoseClass {
    /// Number of the class, which is the datatype of its pillars.
    pub number: usize,
    /// Dose over the base dose.
    pub factor: f64,
    pub dose_uc_cm2: f64,
    pub pillars: u64,
    pub area_um2: f64,
    /// Layout of its pillars, in the folder.
    pub file: String,
}

/// Classes, and what the model says of the pillars that are written with them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DoseClasses {
    /// Set that the model comes from.
    pub model: String,
    pub classes: Vec<DoseClass>,
    /// Root mean square of the error of widths without classes, and with them (nm).
    pub error_rms_nm: [f64; 2],
    /// Greatest error with classes (nm).
    pub error_most_nm: f64,
    /// Pillars whose dose would be outside of what was measured.
    pub clipped: u64,
}

impl DoseClasses {
    /// The result in one sentence.
    pub(super) fn words(&self) -> String {
        let [before, after] = self.error_rms_nm;
        format!(
            "{} dose classes by the model of {}: read back and simulated, widths are off by {after:.2} nm rms and {:.2} nm at most, \
             from {before:.2} nm rms with one dose; {} pillars would need a dose that was not measured",
            self.classes.len(),
            self.model,
            self.error_most_nm,
            self.clipped
        )
    }
}

/// The dose of each pillar.
struct Doses<'a> {
    geometry: &'a GeometryChange,
    response: DoseResponse,
    step_percent: f64,
}

impl Doses<'_> {
    /// Steps of the dose, and whether it is held at what was measured, that undo what is added to a width (nm).
    fn steps(&self, added_nm: f64) -> (i32, bool) {
        let wanted = -added_nm / self.response.nm_per_percent;
        let [low, high] = self.response.measured_percent;
        // A class is within what was measured, also after rounding.
        let [least, most] = [(low / self.step_percent).ceil(), (high / self.step_percent).floor()];
        let steps = (wanted / self.step_percent).round().clamp(least.min(most), most);
        (steps as i32, !(low..=high).contains(&wanted))
    }
}

/// Width that is added to each pillar of an element (nm), by its site.
fn added(design: &Design, map: &PillarMap, opening_um: f64, geometry: &GeometryChange) -> Vec<(usize, f64)> {
    let element = DrawnElement::new(map, opening_um).of_shape(design.cell.shape);
    let steps = element.site_steps(geometry);
    let pillars = map.number.iter().enumerate().filter(|(_, n)| **n > 0);
    let more = |site: usize| {
        steps
            .as_ref()
            .map_or(0.0, |s| f64::from(s[site]) * metalith_optics::BIAS_STEP_NM)
    };
    pillars
        .map(|(site, _)| (site, geometry.cd_bias_nm + more(site)))
        .collect()
}

/// Write the dose classes of an array: a layout for each, and the table of the classes.
///
/// # Errors
/// If the model has no slope with dose or differs between copies, a file cannot be written, or the user stopped it.
pub(super) fn write(
    files: &mut Listing,
    design: &Design,
    process: &Process,
    (array, model): (&PillarArray, &CalibratedModel),
    progress: &dyn Progress,
) -> Result<DoseClasses> {
    let response = model.dose.filter(|d| d.nm_per_percent.abs() >= LEAST_SLOPE);
    let Some(response) = response else {
        return Err(Error::refused(
            "handoff/no-dose-slope",
            format!("the model of {} has no slope of widths with dose", model.set),
            "measure widths at four doses or more, and calibrate them as a set of kind `widths`",
        ));
    };
    check_equal_copies(model)?;
    let geometry = &model.perturbation.geometry;
    let [low, high] = response.measured_percent;
    let doses = Doses {
        geometry,
        response,
        step_percent: (CLASS_NM / response.nm_per_percent.abs()).max((high - low) / (MOST_CLASSES - 1) as f64),
    };
    let opening_um = |class: usize| {
        let first = array.first_of(class);
        first.map_or(0.0, |placed| design.aperture_radius_of_um(&placed.element))
    };
    let mut steps: Vec<Vec<(usize, i32)>> = Vec::new();
    let mut clipped = 0;
    for (k, class) in array.classes.iter().enumerate() {
        let copies = array.placed.iter().filter(|p| p.class == k).count() as u64;
        let own = added(design, &class.widths.map(), opening_um(k), geometry);
        let own = own.into_iter().map(|(site, nm)| {
            let (step, held) = doses.steps(nm);
            clipped += copies * u64::from(held);
            (site, step)
        });
        steps.push(own.collect());
    }
    let mut used: Vec<i32> = steps.iter().flatten().map(|(_, step)| *step).collect();
    used.sort_unstable();
    used.dedup();
    let mut read = ReadBack::default();
    let mut classes = Vec::new();
    progress.begin("dose classes", used.len() as u64);
    for (k, step) in used.into_iter().enumerate() {
        let (number, percent) = (k + 1, f64::from(step) * doses.step_percent);
        let mut own = array.clone();
        for (class, steps) in own.classes.iter_mut().zip(&steps) {
            let map = class.widths.map_mut();
            let numbers = map.number.as_slice_mut().expect("rows one after the other");
            for (site, _) in steps.iter().filter(|(_, s)| *s != step) {
                numbers[*site] = 0;
            }
            class.group = SymmetryGroup::of_shape(map, design.cell.shape);
        }
        let mut alone = design.clone();
        alone.layout.layers.pillars.datatype = number as i16;
        alone.layout.marks.clear();
        let file = format!("dose/{}_class_{number:02}.gds", design.name);
        let path = files.add(
            &file,
            format!("pillars of dose class {number}, which is their datatype"),
        );
        write_pillars(&alone, &own, design.layout.hierarchy, &path, progress)?;
        let found = read_pillars(&alone, &path, progress)?;
        let maps = found.elements.into_iter().map(|e| e.widths);
        let area_um2 = read.add(design, maps, percent);
        classes.push(DoseClass {
            number,
            factor: 1.0 + 0.01 * percent,
            dose_uc_cm2: (1.0 + 0.01 * percent) * process.resist.dose_uc_cm2,
            pillars: found.pillars,
            area_um2,
            file,
        });
        progress.advance(1);
    }
    let (error_rms_nm, error_most_nm) = read.errors(design, &doses, array.pillars())?;
    let out = DoseClasses {
        model: model.set.clone(),
        classes,
        error_rms_nm,
        error_most_nm,
        clipped,
    };
    let table = files.add(
        "dose/dose_classes.csv",
        "dose classes: factor, area, pillars and file of each",
    );
    tables::write_dose_classes(&table, &out.classes, design.layout.layers.pillars.layer)?;
    Ok(out)
}

/// Layouts of classes as they were read back: all pillars of each element, and the change of dose of each (%).
#[derive(Default)]
struct ReadBack {
    elements: Vec<(PillarMap, Vec<f32>)>,
    pillars: u64,
}

impl ReadBack {
    /// Add the elements of a class; its area (um^2).
    fn add(&mut self, design: &Design, maps: impl Iterator<Item = PillarMap>, percent: f64) -> f64 {
        let mut area = 0.0;
        for (k, map) in maps.enumerate() {
            if self.elements.len() <= k {
                let empty = PillarMap::empty(map.lattice);
                let doses = vec![0.0; empty.number.len()];
                self.elements.push((empty, doses));
            }
            let (all, doses) = &mut self.elements[k];
            let sites = all.number.iter_mut().zip(doses.iter_mut()).zip(&map.number);
            for ((to, dose), &number) in sites.filter(|(_, number)| **number > 0) {
                (*to, *dose) = (number, percent as f32);
                area += 1e-6 * design.cell.shape.area_nm2(PillarId(number));
                self.pillars += 1;
            }
        }
        area
    }

    /// Errors of widths by the model: root mean square with one dose and with the classes, and the greatest (nm).
    ///
    /// # Errors
    /// If the classes do not have each pillar once.
    fn errors(&self, design: &Design, doses: &Doses<'_>, pillars: u64) -> Result<([f64; 2], f64)> {
        let there: u64 = self.elements.iter().map(|(map, _)| map.pillars()).sum();
        if [there, self.pillars] != [pillars; 2] {
            return Err(Error::refused(
                "handoff/classes-differ",
                format!(
                    "the dose classes have {} pillars at {there} sites, the layout has {pillars}",
                    self.pillars
                ),
                "this is a fault of the program: please report it",
            ));
        }
        let (mut squares, mut most) = ([0.0; 2], 0.0_f64);
        for (element, (map, percents)) in design.elements().iter().zip(&self.elements) {
            for (site, nm) in added(design, map, design.aperture_radius_of_um(element), doses.geometry) {
                let left = nm + doses.response.nm_per_percent * f64::from(percents[site]);
                squares[0] += nm * nm;
                squares[1] += left * left;
                most = most.max(left.abs());
            }
        }
        Ok((squares.map(|s| (s / pillars.max(1) as f64).sqrt()), most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;
    use metalith_optics::Perturbation;

    #[test]
    fn classes_undo_what_the_model_adds() {
        let text = metalith_testing::changed(
            "mini_3x3",
            &[
                ("diameter_um = 60", "diameter_um = 20"),
                ("focal_length_um = 144", "focal_length_um = 48"),
            ],
        );
        let design = Design::parse(&metalith_testing::design("mini_3x3"), &text).unwrap();
        let array = PillarArray::build(&design, &Silent).unwrap();
        let mut perturbation = Perturbation::default();
        perturbation.geometry.cd_bias_nm = -6.0;
        perturbation.geometry.cd_bias_density_nm = 30.0;
        perturbation.geometry.cd_bias_density_range_um = Some(3.0);
        let mut model = CalibratedModel::new("widths".into(), String::new(), perturbation);
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("dose")).unwrap();
        let process = Process::standard();
        let mut files = Listing::new(folder.path());
        let refused = write(&mut files, &design, &process, (&array, &model), &Silent);
        assert_eq!(refused.unwrap_err().id(), "handoff/no-dose-slope");
        model.dose = Some(DoseResponse {
            nm_per_percent: 0.5,
            measured_percent: [-30.0, 30.0],
        });
        let made = write(&mut files, &design, &process, (&array, &model), &Silent).unwrap();
        println!("{}", made.words());
        assert!(made.classes.len() > 3 && made.clipped == 0, "{made:?}");
        let [before, after] = made.error_rms_nm;
        // Half of a class, and the step that biases are rounded to.
        assert!(
            made.error_most_nm <= 0.5 * CLASS_NM + metalith_optics::BIAS_STEP_NM,
            "{made:?}"
        );
        assert!(after < 0.5 * CLASS_NM && before > 3.0 * CLASS_NM, "{before} {after}");
        assert_eq!(made.classes.iter().map(|c| c.pillars).sum::<u64>(), array.pillars());
        // A dose that was not measured is not asked for.
        model.dose = Some(DoseResponse {
            nm_per_percent: 0.5,
            measured_percent: [-5.0, 5.0],
        });
        let clipped = write(&mut files, &design, &process, (&array, &model), &Silent).unwrap();
        assert!(clipped.clipped > 0 && clipped.classes.iter().all(|c| (0.95..=1.05).contains(&c.factor)));
    }
}
