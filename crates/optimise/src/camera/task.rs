//! The cameras that a design asks for, tried one after the other, and the best of them for each light.

use metalith_cell::{CellModel, Fidelity};
use metalith_core::document::Faults;
use metalith_core::{Error, Progress, Result};
use metalith_design::array::PillarRule;
use metalith_design::{CameraSearchSpec, CameraSizes, Design};
use metalith_report::sig;
use metalith_sensor::{Camera, Walls, WavelengthSteps};
use serde::{Deserialize, Serialize};

use super::design_text::{DesignText, design_text};
use super::diameters;
use super::efficiency::efficiency;
use super::element::CameraElement;
use super::light::CameraLight;
use super::model::{CameraModel, Judged, ModelSettings, WINDOW_UM};
use super::readable;
use super::scene::NaturalScene;
use super::search::{Arrangement, CameraStart, SensorLattice};
use super::tried_cameras::TriedCameras;
use crate::rings::mapping::Mapping;

/// Band that lenses of glass and silicon nitride are simulated in where the camera counts (nm).
const BAND_NM: [f64; 2] = [400.0, 700.0];
/// Steps of wavelength while cameras are compared, and of the last descent (nm).
const STEPS_NM: [f64; 2] = [25.0, 12.5];
/// Points along half of the field while cameras are compared, and in the last descent.
const NODES: [usize; 2] = [3, 4];
/// Share of the wavelength by which the channels of a colour camera are wide: what a wedge smears.
const WIDTH: f64 = 0.2;

/// One camera that was tried.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TriedCamera {
    pub lux: f64,
    pub arrangement: Arrangement,
    pub start: CameraStart,
    pub judged: Judged,
    pub overlaps: bool,
    /// Elements, of the best cameras after their last descent.
    pub elements: Vec<CameraElement>,
}

/// Search of a whole camera.
pub struct CameraTask {
    pub spec: CameraSearchSpec,
    camera: Camera,
    sensor: SensorLattice,
    settings: ModelSettings,
    mapping: Mapping,
    seed: u64,
    /// True if designs of cameras have cells at oblique incidence, whatever the design says.
    oblique: bool,
}

/// Cameras that were tried.
pub struct CameraFindings {
    /// All of them, each after its first descents.
    pub tried: Vec<TriedCamera>,
    /// The best for each light, after the last descent.
    pub best: Vec<TriedCamera>,
    /// True if the user stopped the search before all were tried.
    pub interrupted: bool,
}

/// Phases of a turn that a piston is chosen from.
const PISTONS: usize = 64;
/// Share by which a refinement first changes a distance or a diameter, and the smallest one: below it the error is flat.
const REFINED: [f64; 2] = [0.2, 0.04];
/// Most cameras of a refinement.
const MOST_REFINED: usize = 16;

/// Field from which on designs of cameras have cells at oblique incidence (degrees): light arrives at half of it from the normal.
const LEAST_OBLIQUE_DEG: f64 = 20.0;

/// The cell of the design must be known where the camera counts light, which is found before the cell is solved.
fn check_band(design: &Design, text: &str, camera: &Camera) -> Result<()> {
    // The published and the fitted cell are formulas.
    if !matches!(design.optimise.fidelity, Fidelity::Rigorous | Fidelity::Neighbours) {
        return Ok(());
    }
    let counted = camera
        .sampling(BAND_NM, WavelengthSteps::from(STEPS_NM[1]))?
        .wavelengths_nm;
    let [least, most] = counted
        .iter()
        .fold([f64::MAX, 0.0], |[a, b]: [f64; 2], nm| [a.min(*nm), b.max(*nm)]);
    let (short, long) = design.band_um()?;
    let (short, long) = (short * 1e3, long * 1e3);
    // Limits of files are decimal numbers.
    const ROUNDING_NM: f64 = 1e-6;
    if least >= short - ROUNDING_NM && most <= long + ROUNDING_NM {
        return Ok(());
    }
    let fault = (
        "cell.band_nm".to_owned(),
        format!(
            "the cell is solved from {} to {} nm, and the camera counts light from {} to {} nm",
            sig(short, 6),
            sig(long, 6),
            sig(least, 6),
            sig(most, 6)
        ),
        format!(
            "give `band_nm = [{}, {}]` in [cell], or a camera that counts less",
            least.floor(),
            most.ceil()
        ),
    );
    Err(Error::Text(Box::new(Faults::at_keys(&design.path, text, vec![fault]))))
}

impl CameraTask {
    /// The task that a design sets before a camera. `text`: the text of the design.
    ///
    /// # Errors
    /// If the design has no section [optimise.camera], its pillars have no width, a diameter fits no arrangement, the cell is not solved
    /// where the camera counts light, or a camera of the search would be no design that can be read.
    pub fn of(design: &Design, text: &str, camera: Camera) -> Result<Self> {
        let Some(spec) = design.optimise.camera.clone() else {
            return Err(Error::refused(
                "optimise/no-camera-section",
                format!("the design `{}` has no section [optimise.camera]", design.name),
                "add the section with `field_deg`, `most_track_um`, `columns`, `rows` and `diameters_um`, or leave --camera out",
            ));
        };
        crate::cells::check_shape(design)?;
        if design.cell.shape.rotated().is_some() {
            return Err(Error::refused(
                "optimise/camera-of-rotated-pillars",
                "whole cameras are searched for pillars that their width distinguishes",
                "take a cell with round or square pillars",
            ));
        }
        let sensor = SensorLattice::of(&camera.sensor);
        diameters::check(&spec, &sensor, (&design.path, text))?;
        check_band(design, text, &camera)?;
        let settings = ModelSettings {
            scene: NaturalScene::new(spec.field_deg, spec.scene_pixels),
            field_deg: spec.field_deg,
            wedge_um: design.array.wedge_wavelength_um,
            walls: camera.sensor.walls,
            window_um: WINDOW_UM,
        };
        let task = Self {
            oblique: design.verify.fidelity == Fidelity::Rigorous && spec.field_deg > LEAST_OBLIQUE_DEG,
            settings,
            sensor,
            camera,
            mapping: Mapping::new(&PillarRule::new(&design.cell, &design.mapping)),
            seed: design.optimise.seed,
            spec,
        };
        readable::check(&task, &design.path, text)?;
        Ok(task)
    }

    /// Text that decides the cameras of the search: the design's own, the camera file, the version of the program.
    ///
    /// # Errors
    /// If the camera cannot be written as text.
    pub fn decides(&self, text: &str) -> Result<String> {
        let camera = serde_json::to_string(&self.camera)
            .map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))?;
        Ok(format!("{} {camera} {text}", env!("CARGO_PKG_VERSION")))
    }

    fn light(&self, lux: f64, step_nm: f64, cell: &dyn CellModel) -> Result<CameraLight> {
        let share = |um: f64| efficiency(cell, &self.mapping, um);
        CameraLight::new(&self.camera, lux, self.spec.longest_s, BAND_NM, step_nm, &share)
    }

    fn edge(&self) -> f64 {
        (0.5 * self.spec.field_deg).to_radians().tan()
    }

    /// Arrangements to try: those whose elements do not overlap.
    ///
    /// # Errors
    /// If there are none.
    pub fn arrangements(&self) -> Result<Vec<Arrangement>> {
        let spec = &self.spec;
        let sensor = &self.sensor;
        let mut all = Vec::new();
        for &count in &spec.arrangements {
            let largest = Arrangement::largest_um(count, sensor, self.edge()).min(spec.most_track_um);
            // Whole micrometres.
            let own = [largest.floor()];
            let distances = if spec.focal_lengths_um.is_empty() {
                &own[..]
            } else {
                &spec.focal_lengths_um
            };
            for &distance_um in distances {
                for &diameter_um in &spec.diameters_um {
                    for &wedge_share in &spec.wedge_shares {
                        all.push(Arrangement {
                            count,
                            distance_um,
                            diameter_um,
                            wedge_share,
                            steering_deg: 0.0,
                        });
                    }
                }
            }
        }
        all.retain(|a| self.has_room(a));
        if all.is_empty() {
            return Err(Error::refused(
                "optimise/no-camera-fits",
                "the elements of every arrangement overlap on a chip of the size of the sensor",
                "use smaller `diameters_um` or fewer columns and rows",
            ));
        }
        Ok(all)
    }

    /// True if neighbours of an arrangement do not overlap on the chip.
    fn has_room(&self, a: &Arrangement) -> bool {
        (0..2).all(|axis| a.count[axis] == 1 || a.pitch_um(axis, &self.sensor, self.edge()) > a.diameter_um)
    }

    /// True if images of neighbours overlap on the sensor.
    fn overlaps(&self, a: &Arrangement) -> bool {
        self.settings.walls == Walls::None && a.overlaps(&self.sensor, self.edge())
    }

    fn settings_of(&self, arrangement: &Arrangement) -> ModelSettings {
        // What a wedge smears within a channel.
        let smear = arrangement.wedge_share * self.edge() * arrangement.distance_um * WIDTH;
        ModelSettings {
            window_um: WINDOW_UM.max(0.45 * arrangement.diameter_um).max(2.5 * smear),
            ..self.settings
        }
    }

    /// Try all cameras, and improve the best for each light. The same task gives the same cameras on any number of threads. Cameras that
    /// `kept` holds are not tried again; each that is tried is kept there.
    ///
    /// # Errors
    /// If the cell is not known at a wavelength of the camera, the light is not visible, no camera fits, or a camera cannot be kept.
    pub fn search(
        &self,
        cell: &dyn CellModel,
        kept: &mut TriedCameras,
        progress: &dyn Progress,
    ) -> Result<CameraFindings> {
        let mut findings = CameraFindings {
            tried: Vec::new(),
            best: Vec::new(),
            interrupted: false,
        };
        let lights = &self.spec.illuminance_lux;
        let coarse = lights
            .iter()
            .map(|lux| self.light(*lux, STEPS_NM[0], cell))
            .collect::<Result<Vec<_>>>()?;
        let fine = lights
            .iter()
            .map(|lux| self.light(*lux, STEPS_NM[1], cell))
            .collect::<Result<Vec<_>>>()?;
        let arrangements = self.arrangements()?;
        if let Some(words) = diameters::left_out(&self.spec, &self.sensor) {
            progress.warn(&words);
        }
        let refined = match self.spec.sizes {
            CameraSizes::Listed => 0,
            CameraSizes::Refined => MOST_REFINED,
        };
        progress.begin("cameras", (lights.len() * (arrangements.len() + refined + 1)) as u64);
        for ((&lux, light), fine) in lights.iter().zip(&coarse).zip(&fine) {
            for arrangement in &arrangements {
                match self.tried(lux, light, arrangement, kept, progress) {
                    Ok(camera) => findings.tried.push(camera),
                    Err(_) if progress.check_stopped().is_err() => {
                        findings.interrupted = true;
                        break;
                    }
                    Err(other) => return Err(other),
                }
                progress.advance(1);
            }
            let own = findings.tried.iter().filter(|c| c.lux == lux);
            let Some(mut best) = own.min_by(|a, b| a.judged.error.total_cmp(&b.judged.error)).cloned() else {
                break;
            };
            if self.spec.sizes == CameraSizes::Refined && !findings.interrupted {
                best = self.refined(best, light, kept, &mut findings, progress)?;
            }
            findings
                .best
                .push(self.last(best, fine, &mut findings.interrupted, progress)?);
            progress.advance(1);
            if findings.interrupted {
                break;
            }
        }
        if findings.best.is_empty() {
            progress.check_stopped()?;
        }
        Ok(findings)
    }

    /// A camera after short descents, as it is kept or tried now.
    fn tried(
        &self,
        lux: f64,
        light: &CameraLight,
        arrangement: &Arrangement,
        kept: &mut TriedCameras,
        progress: &dyn Progress,
    ) -> Result<TriedCamera> {
        if let Some(found) = kept.find(lux, arrangement) {
            return Ok(found.clone());
        }
        let camera = self.first(lux, light, arrangement, progress)?;
        kept.add(camera.clone())?;
        Ok(camera)
    }

    /// The best camera after its distance and its diameter are changed one after the other, by shares that fall by half where no change
    /// is better. The best so far if the user stopped.
    fn refined(
        &self,
        mut best: TriedCamera,
        light: &CameraLight,
        kept: &mut TriedCameras,
        findings: &mut CameraFindings,
        progress: &dyn Progress,
    ) -> Result<TriedCamera> {
        let [mut share, least] = REFINED;
        let mut left = MOST_REFINED;
        while share >= least && left > 0 {
            let mut moved = false;
            for [distance, diameter] in [[0.0, share], [0.0, -share], [share, 0.0], [-share, 0.0]] {
                // Whole micrometres, so that a camera is not tried twice.
                let scaled = |um: f64, by: f64| (um * (1.0 + by)).round();
                let distance_um = scaled(best.arrangement.distance_um, distance);
                let arrangement = Arrangement {
                    distance_um: distance_um.min(self.spec.most_track_um.floor()),
                    diameter_um: scaled(best.arrangement.diameter_um, diameter),
                    ..best.arrangement
                };
                let known = findings
                    .tried
                    .iter()
                    .any(|c| c.lux == best.lux && c.arrangement == arrangement);
                let worse = self.overlaps(&arrangement) && !self.overlaps(&best.arrangement);
                if left == 0 || known || worse || !self.has_room(&arrangement) {
                    continue;
                }
                let camera = match self.tried(best.lux, light, &arrangement, kept, progress) {
                    Ok(camera) => camera,
                    Err(_) if progress.check_stopped().is_err() => {
                        findings.interrupted = true;
                        return Ok(best);
                    }
                    Err(other) => return Err(other),
                };
                left -= 1;
                progress.advance(1);
                findings.tried.push(camera.clone());
                if camera.judged.error < best.judged.error {
                    (best, moved) = (camera, true);
                }
            }
            if !moved {
                share *= 0.5;
            }
        }
        progress.advance(left as u64);
        Ok(best)
    }

    /// A camera after short descents from each start.
    fn first(
        &self,
        lux: f64,
        light: &CameraLight,
        arrangement: &Arrangement,
        progress: &dyn Progress,
    ) -> Result<TriedCamera> {
        let settings = self.settings_of(arrangement);
        let model = CameraModel::new(light.clone(), &settings, arrangement.distance_um, NODES[0]);
        let mut best: Option<TriedCamera> = None;
        for start in CameraStart::ALL.into_iter().take(self.spec.starts) {
            let elements = arrangement.elements(&self.sensor, self.edge(), start, self.seed);
            let (elements, judged) = arrangement.descend(&model, &elements, self.spec.steps, progress)?;
            if best.as_ref().is_none_or(|b| judged.error < b.judged.error) {
                best = Some(TriedCamera {
                    lux,
                    arrangement: *arrangement,
                    start,
                    judged,
                    overlaps: self.overlaps(arrangement),
                    elements,
                });
            }
        }
        Ok(best.expect("there is a start"))
    }

    /// The best camera after a long descent at more wavelengths and places; as it is if the user stopped.
    fn last(
        &self,
        best: TriedCamera,
        light: &CameraLight,
        interrupted: &mut bool,
        progress: &dyn Progress,
    ) -> Result<TriedCamera> {
        let settings = self.settings_of(&best.arrangement);
        let model = CameraModel::new(light.clone(), &settings, best.arrangement.distance_um, NODES[1]);
        match best
            .arrangement
            .descend(&model, &best.elements, self.spec.final_steps, progress)
        {
            Ok((elements, judged)) => Ok(TriedCamera {
                judged,
                elements,
                ..best
            }),
            Err(_) if progress.check_stopped().is_err() => {
                *interrupted = true;
                let judged = model.judge(&best.elements, false);
                Ok(TriedCamera { judged, ..best })
            }
            Err(other) => Err(other),
        }
    }

    /// Design text with the elements of an arrangement, before anything is searched.
    pub(super) fn first_text(&self, text: &str, arrangement: &Arrangement) -> String {
        let elements = arrangement.elements(&self.sensor, self.edge(), CameraStart::Identical, self.seed);
        self.text_with(text, "camera", "", &elements, arrangement.distance_um)
    }

    fn text_with(&self, design: &str, name: &str, title: &str, elements: &[CameraElement], distance_um: f64) -> String {
        design_text(&DesignText {
            design,
            name,
            title,
            elements,
            distance_um,
            wedge_um: self.settings.wedge_um,
            piston_rad: self.piston_rad(),
            oblique: self.oblique,
        })
    }

    /// Sides of the rectangle about the elements of an arrangement (um).
    pub(super) fn extent_um(&self, a: &Arrangement) -> [f64; 2] {
        [0, 1].map(|axis| (a.count[axis] - 1) as f64 * a.pitch_um(axis, &self.sensor, self.edge()) + a.diameter_um)
    }

    /// A camera as a design: the text of the design that it was searched for, with the camera's elements.
    pub fn design_text(&self, text: &str, name: &str, camera: &TriedCamera) -> String {
        let [x, y] = camera.arrangement.count;
        let title = format!(
            "{x} by {y} elements of {} um for {} lux, {:.2} dB expected",
            camera.arrangement.diameter_um,
            camera.lux,
            camera.judged.psnr_db()
        );
        self.text_with(text, name, &title, &camera.elements, camera.arrangement.distance_um)
    }

    /// Phase whose pillar has the mean of the least and the greatest width. The phase is level in the middle of an element: pillars of
    /// the greatest width fill more of the plane there than processes allow.
    fn piston_rad(&self) -> f64 {
        let width = |k: &usize| self.mapping.width_nm(*k as f64 / PISTONS as f64).0;
        let ends = (0..PISTONS)
            .map(|k| width(&k))
            .fold([f64::MAX, f64::MIN], |[a, b], w| [a.min(w), b.max(w)]);
        let off = |k: &usize| (width(k) - 0.5 * (ends[0] + ends[1])).abs();
        let best = (0..PISTONS).min_by(|a, b| off(a).total_cmp(&off(b)));
        std::f64::consts::TAU * best.unwrap_or(0) as f64 / PISTONS as f64
    }
}
