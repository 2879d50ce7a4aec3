//! The cameras that a design asks for, tried one after the other, and the best of them for each light.

use metalith_cell::CellModel;
use metalith_core::{Error, Progress, Result};
use metalith_design::array::PillarRule;
use metalith_design::{CameraSearchSpec, CameraSizes, Design};
use metalith_sensor::{Camera, Walls};
use serde::{Deserialize, Serialize};

use super::design_text::design_text;
use super::diameters;
use super::efficiency::efficiency;
use super::element::CameraElement;
use super::light::CameraLight;
use super::model::{CameraModel, Judged, ModelSettings, WINDOW_UM};
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
    settings: ModelSettings,
    mapping: Mapping,
    seed: u64,
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

impl CameraTask {
    /// The task that a design sets before a camera. `text`: the text of the design.
    ///
    /// # Errors
    /// If the design has no section [optimise.camera], its pillars have no width, or a diameter fits no arrangement.
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
        diameters::check(&spec, &SensorLattice::of(&camera.sensor), (&design.path, text))?;
        let settings = ModelSettings {
            scene: NaturalScene::new(spec.field_deg, spec.scene_pixels),
            field_deg: spec.field_deg,
            wedge_um: design.array.wedge_wavelength_um,
            walls: camera.sensor.walls,
            window_um: WINDOW_UM,
        };
        Ok(Self {
            settings,
            camera,
            mapping: Mapping::new(&PillarRule::new(&design.cell, &design.mapping)),
            seed: design.optimise.seed,
            spec,
        })
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
    pub fn arrangements(&self, light: &CameraLight) -> Result<Vec<Arrangement>> {
        let spec = &self.spec;
        let mut all = Vec::new();
        for &count in &spec.arrangements {
            let largest = Arrangement::largest_um(count, light, self.edge()).min(spec.most_track_um);
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
        all.retain(|a| self.has_room(a, light));
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
    fn has_room(&self, a: &Arrangement, light: &CameraLight) -> bool {
        (0..2).all(|axis| a.count[axis] == 1 || a.pitch_um(axis, light, self.edge()) > a.diameter_um)
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
        let arrangements = self.arrangements(&coarse[0])?;
        if let Some(words) = diameters::left_out(&self.spec, &SensorLattice::of(&self.camera.sensor)) {
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
                let overlaps = |a: &Arrangement| self.settings.walls == Walls::None && a.overlaps(light, self.edge());
                let known = findings
                    .tried
                    .iter()
                    .any(|c| c.lux == best.lux && c.arrangement == arrangement);
                let worse = overlaps(&arrangement) && !overlaps(&best.arrangement);
                if left == 0 || known || worse || !self.has_room(&arrangement, light) {
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
            let elements = arrangement.elements(light, self.edge(), start, self.seed);
            let (elements, judged) = arrangement.descend(&model, &elements, self.spec.steps, progress)?;
            if best.as_ref().is_none_or(|b| judged.error < b.judged.error) {
                best = Some(TriedCamera {
                    lux,
                    arrangement: *arrangement,
                    start,
                    judged,
                    overlaps: self.settings.walls == Walls::None && arrangement.overlaps(light, self.edge()),
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

    /// A camera as a design: the text of the design that it was searched for, with the camera's elements.
    pub fn design_text(&self, text: &str, name: &str, camera: &TriedCamera) -> String {
        let [x, y] = camera.arrangement.count;
        let title = format!(
            "{x} by {y} elements of {} um for {} lux, {:.2} dB expected",
            camera.arrangement.diameter_um,
            camera.lux,
            camera.judged.psnr_db()
        );
        let wedge_um = self.settings.wedge_um;
        design_text(
            text,
            name,
            &title,
            &camera.elements,
            camera.arrangement.distance_um,
            wedge_um,
            self.piston_rad(),
        )
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
