//! Report of a picture.

use metalith_cell::{Fidelity, FocusedLight, PolarisedLight};
use metalith_design::phase::OpenAreas;
use metalith_design::{CellIncidence, Design};
use metalith_optics::{CalibratedModel, ModelStatement};
use metalith_restoration::RestorationMethod;
use metalith_sensor::Camera;
use nalgebra::DMatrix;
use ndarray::Array3;
use serde::Serialize;

use crate::approximation_scores::AssumedScore;
use crate::chip::sensor_um;
use crate::element_images::ElementImage;
use crate::exposure::Frame;
use crate::field_of_view::light_left_out;
use crate::files::{FrameFile, picture_file};
use crate::forecast::NaturalForecast;
use crate::imaging_system::ImagingSystem;
use crate::kernel_plan::averaging;
use crate::layout::PillarCount;
use crate::light_statement::LightStatement;
use crate::operator::BetweenNodes;
use crate::point_image::PointImage;
use crate::resolution::ContrastCurve;
use crate::scene::SceneImage;
use crate::score::{ZoneScore, psnr_words};
use crate::spectra::rgb_basis;
use crate::stray_light::LightShares;
use crate::uncertainty::UncertaintyReport;

/// Statement of a frame, simulated or recorded, whatever is made of it.
#[derive(Clone, Debug, Serialize)]
pub struct FrameStatement {
    pub design: String,
    pub layout: String,
    pub camera: String,
    pub field_deg: f64,
    /// Distance of the scene (mm); none for one that is far.
    pub distance_mm: Option<f64>,
    pub saturated: usize,
    /// Share of all pixels that are saturated.
    pub saturated_share: f64,
    /// The calibrated model that the chip is made by, if one was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelStatement>,
    /// Notes to read before anything else: pixels that were lost, scenes and layouts that are not what they seem.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Error of the operator of the restoration, by channel; see [`crate::ForecastScene::operator_error`].
    pub operator_error: Vec<f64>,
    pub assumptions: Vec<Assumption>,
    /// Light of the scene, time, and electrons of a white pixel.
    pub light: LightStatement,
}

impl FrameStatement {
    /// Pixels at full scale, and their share.
    pub(crate) fn saturated_words(&self) -> String {
        format!(
            "{} ({} %)",
            self.saturated,
            metalith_report::fixed(100.0 * self.saturated_share, 1)
        )
    }

    /// Words for the error of the operator of the restoration, channel by channel.
    pub(crate) fn error_words(&self) -> String {
        let each = self.operator_error.iter();
        let words: Vec<String> = each
            .map(|e| format!("{} %", metalith_report::fixed(100.0 * e, 2)))
            .collect();
        words.join(", ")
    }

    /// Statement of a frame behind a layout whose file has this name; its chip is made by a model, if one is given. The
    /// caller adds notes and the error of the operator.
    pub fn new(
        system: &ImagingSystem,
        layout: String,
        scene: &SceneImage,
        frame: &Frame,
        model: Option<&CalibratedModel>,
    ) -> Self {
        let fidelity = match model {
            Some(_) => Fidelity::Calibrated,
            None => system.design.verify.fidelity,
        };
        let model = model.map(ModelStatement::of);
        let mut assumptions = system.assumptions(scene, fidelity);
        assumptions.extend(model.iter().flat_map(Assumption::of_model));
        let distance_mm = scene.view.distance_um * 1e-3;
        Self {
            design: system.design.name.clone(),
            layout,
            camera: system.camera.name.clone(),
            field_deg: scene.view.field_deg,
            distance_mm: distance_mm.is_finite().then_some(distance_mm),
            saturated: frame.saturated,
            saturated_share: frame.saturated_share(),
            model,
            notes: Vec::new(),
            operator_error: Vec::new(),
            assumptions,
            light: system.light(),
        }
    }
}

/// Everything that the page of a picture says, in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct PictureReport {
    pub scene: String,
    #[serde(flatten)]
    pub of_frame: FrameStatement,
    /// The frame as a file.
    pub frame: FrameFile,
    pub restorations: Vec<RestorationReport>,
    pub budget: Vec<ChannelBudget>,
    /// Images of a white point by each distinct element and channel.
    pub points: Vec<PointImage>,
    /// Image of each element.
    pub elements: Vec<ElementImage>,
    pub homographies: Vec<HomographyResidual>,
    /// Contrast of fine detail, for scenes that say it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contrast: Vec<ContrastCurve>,
    /// Uncertainty from samples, if any were drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<UncertaintyReport>,
    /// Worth of the assumptions of others, if asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub worth: Vec<AssumedScore>,
}

/// One way of restoring.
#[derive(Clone, Debug, Serialize)]
pub struct RestorationReport {
    pub method: String,
    /// True if by all elements at once; false for each alone.
    pub joint: bool,
    /// Name of the file of the picture, 16 bits in sRGB.
    pub picture: String,
    pub scores: Vec<ZoneScore>,
    /// Expected PSNR of linear light in each zone (dB) of scenes with the spectrum of this one, where there is a forecast.
    pub forecast_of_scene_db: Vec<f64>,
    /// Forecast for photographs, by the samplings that this scene may have.
    pub forecast_natural: Vec<NaturalForecast>,
}

/// Budget of the light of one channel.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelBudget {
    pub channel: String,
    pub shares: LightShares,
}

/// Distance of chief rays from the best homography.
#[derive(Clone, Debug, Serialize)]
pub struct HomographyResidual {
    pub element: String,
    pub channel: String,
    pub rms_pixels: f64,
    pub largest_pixels: f64,
}

/// One thing that was assumed.
#[derive(Clone, Debug, Serialize)]
pub struct Assumption {
    pub what: String,
    pub value: String,
}

impl Assumption {
    /// Assumptions of a calibrated model: where it comes from, what it changes, and what of it is not applied.
    pub fn of_model(model: &ModelStatement) -> Vec<Self> {
        let of = |quantity: &str, value: String| Self {
            what: format!("`{quantity}` of the model"),
            value,
        };
        let origin = Self {
            what: "calibrated model".into(),
            value: format!("of {}: {}", model.set, model.finding),
        };
        let applied = model.applied.iter().map(|q| of(&q.quantity, q.value.clone()));
        let not_applied = model.not_applied.iter().map(|q| {
            let value = format!("{} there, not applied: {}", q.value, q.because);
            of(q.quantity, value)
        });
        std::iter::once(origin).chain(applied).chain(not_applied).collect()
    }
}

impl RestorationReport {
    /// The forecast that holds for this picture, in words; `None` without a forecast.
    pub fn forecast_words(&self) -> Option<String> {
        let db = self.forecast_of_scene_db.first()?;
        Some(format!(
            "PSNR of linear light {}, forecast from the spectrum of this scene {}",
            psnr_words(self.scores[0].psnr_linear_db),
            psnr_words(*db)
        ))
    }

    /// Report of a method.
    pub fn new(method: RestorationMethod, joint: bool, scores: Vec<ZoneScore>) -> Self {
        Self {
            method: method.name().to_owned(),
            joint,
            picture: picture_file(method, joint),
            scores,
            forecast_of_scene_db: Vec::new(),
            forecast_natural: Vec::new(),
        }
    }
}

/// Notes on pictures that have a lower PSNR than the one by Tikhonov from the same elements, with the difference: where a scene is
/// all fine detail, a method that prefers smooth or learnt shapes removes some of it.
pub fn no_gain(restorations: &[RestorationReport]) -> Vec<String> {
    let tikhonov = RestorationMethod::Tikhonov.name();
    let note = |found: &RestorationReport| {
        let linear = restorations
            .iter()
            .find(|other| other.method == tikhonov && other.joint == found.joint)?;
        let less = linear.scores[0].psnr_db - found.scores[0].psnr_db;
        (less > 0.0).then(|| {
            format!(
                "`{}` does not help with this scene: its picture has {:.2} dB less than that of `{tikhonov}` ({:.2}, not {:.2} dB)",
                found.method, less, found.scores[0].psnr_db, linear.scores[0].psnr_db
            )
        })
    };
    restorations.iter().filter_map(note).collect()
}

impl ImagingSystem {
    /// Notes on a frame, to read before its picture is viewed; `truth` is the scene in linear sRGB.
    pub fn notes(&self, frame: &Frame, truth: &Array3<f64>) -> Vec<String> {
        let layout = self.pillars.as_ref().and_then(PillarCount::note);
        let all = [frame.saturation_note(truth), layout, averaging(&self.given, &self.view)];
        light_left_out(&self.channels, &self.design)
            .into_iter()
            .chain(self.light().notes())
            .chain(self.direction_notes())
            .chain(all.into_iter().flatten())
            .collect()
    }

    /// Light, time and electrons of the exposure.
    pub fn light(&self) -> LightStatement {
        let diameter_um = 2.0 * (OpenAreas::of(&self.design).lens_um2 / std::f64::consts::PI).sqrt();
        let f_number = sensor_um(&self.design, &self.camera) / diameter_um;
        LightStatement::of(&self.camera, &self.exposure, Some(f_number))
    }

    /// Light budget of each channel for a white scene.
    pub fn budget(&self) -> Vec<ChannelBudget> {
        let channels = self
            .channels
            .iter()
            .zip(self.stray_light.budget.chunks(self.bank.bases));
        channels
            .map(|(channel, shares)| ChannelBudget {
                channel: channel.name.clone(),
                shares: LightShares::sum(shares),
            })
            .collect()
    }

    /// Residual of the best homography between scene and sub-image, for each element and channel.
    pub fn homographies(&self) -> Vec<HomographyResidual> {
        let mut all = Vec::new();
        for (k, element) in self.design.elements().iter().enumerate() {
            for (channel, um) in self.channels.iter().zip(&self.bank.channel_um) {
                let points = self.chief_rays(k, *um);
                if let Some((rms, largest)) = homography_residual(&points) {
                    all.push(HomographyResidual {
                        element: element.label(),
                        channel: channel.name.clone(),
                        rms_pixels: rms,
                        largest_pixels: largest,
                    });
                }
            }
        }
        all
    }

    /// Tangents of the scene and pixels of the sub-image of an element, over its field.
    fn chief_rays(&self, element: usize, um: f64) -> Vec<([f64; 2], [f64; 2])> {
        const POINTS: usize = 13;
        let (view, spec) = (&self.elements[element], &self.bank.spec);
        let at = |k: usize| spec.reach_um * (2.0 * k as f64 / (POINTS as f64 - 1.0) - 1.0);
        let mut points = Vec::new();
        for k in 0..POINTS * POINTS {
            let sines = view.sines_of_landing([at(k % POINTS), at(k / POINTS)], view.wedge.wavelength_um);
            let seen = view
                .tangents(sines, self.view.distance_um)
                .zip(view.landing_um(sines, um));
            if let Some((tangents, landing)) = seen {
                let [row, column] = self.view.place(tangents);
                let inside =
                    (0.0..self.view.rows as f64).contains(&row) && (0.0..self.view.columns as f64).contains(&column);
                if inside {
                    points.push((tangents, landing.map(|l| l / spec.pixel_um)));
                }
            }
        }
        points
    }

    /// Assumptions on a scene and on everything else, in words.
    pub fn assumptions(&self, scene: &SceneImage, fidelity: Fidelity) -> Vec<Assumption> {
        let cell = match fidelity {
            Fidelity::Neighbours => {
                let nm: Vec<String> = self
                    .design
                    .verify
                    .wavelengths_um
                    .iter()
                    .map(|um| fixed(um * 1e3))
                    .collect();
                format!(
                    "`{fidelity}`: coupled model, from tables at {} nm, interpolated between them by optical paths; solved for light from the viewing direction of each element at every angle of arrival, mean of both polarisations",
                    nm.join(", ")
                )
            }
            _ => match self.design.verify.incidence {
                CellIncidence::Normal => format!("`{fidelity}`, solved at normal incidence for every angle of arrival"),
                CellIncidence::Oblique => format!(
                    "`{fidelity}`, solved for angles of arrival up to 64 degrees in two planes and interpolated between these, mean of both polarisations; stray light is that of cells at normal incidence"
                ),
            },
        };
        let assumption = |what: &str, value: String| Assumption {
            what: what.to_owned(),
            value,
        };
        let spec = &self.bank.spec;
        let polarised = (self.design.focused())
            .map(|focused| assumption("polarisation", polarised(focused, self.design.verify.light())));
        let mut all = vec![
            assumption("simulation model", cell),
            assumption(
                "field of the kernels",
                format!(
                    "{} degrees from the axis of each element, at {} x {} places; between these, kernels are interpolated{}; steeper light is traced as rays",
                    fixed(
                        (spec.reach_um / sensor_um(&self.design, &self.camera))
                            .atan()
                            .to_degrees()
                    ),
                    spec.nodes,
                    spec.nodes,
                    match self.between {
                        BetweenNodes::Linear => "",
                        BetweenNodes::Sixfold =>
                            " by polynomials through six along each axis, because the light has narrow bands",
                    }
                ),
            ),
            assumption(
                "window of a kernel",
                format!(
                    "{} pixels; light outside of it is stray light, in squares of {} pixels",
                    spec.window,
                    crate::stray_light::CELL_PIXELS
                ),
            ),
            assumption(
                "wavelengths",
                format!(
                    "at most {} nm apart, closer for narrow lamps; between these, the PSF is interpolated and moves with the chief ray",
                    metalith_sensor::WavelengthSteps::USUAL_NM
                ),
            ),
            assumption("sensor", place_of_sensor(&self.design, &self.camera)),
            assumption("light at an angle", self.angle_words()),
            assumption("illuminant", self.camera.illuminant.name().to_owned()),
            assumption("spectra of the scene", spectra_of(scene)),
            assumption(
                "exposure",
                format!(
                    "{}; the brightest pixel of a white scene has {} electrons, channel by channel, of {} at full scale",
                    self.light().words(),
                    self.light().each(|w| Some(w.electrons), 0),
                    metalith_report::fixed(self.camera.sensor.full_scale_e(), 0)
                ),
            ),
            assumption(
                "energy",
                "the square of the field counts as flux through the sensor, without the cosine of its incidence: 2 to 3 % too much behind elements at f/2.4 that do not steer, 16 % at 33 degrees; the face of the substrate where light enters reflects nothing, where bare glass reflects 3.5 %".into(),
            ),
            assumption(
                "restoration",
                format!(
                    "uses kernels of three primaries at {} of the places and one point of the scene for four pixels; it does not use the spectra of the scene",
                    match self.restored_step {
                        0..=2 => "half",
                        3..=4 => "a quarter",
                        _ => "a fifth",
                    }
                ),
            ),
            assumption(
                "metal",
                "opaque; light passes the openings only, and multiple reflections are not simulated".into(),
            ),
        ];
        all.extend(polarised);
        all.extend(self.pillars.as_ref().map(|found| assumption("layout", found.words())));
        let left_out = light_left_out(&self.channels, &self.design);
        all.extend(left_out.map(|words| assumption("light outside of the band", words)));
        let averaged = averaging(&self.given, &self.view);
        all.extend(averaged.map(|words| {
            let words = format!("{words}; pictures have the size of the averaged scene, and scores compare with it");
            assumption("pixels of the scene", words)
        }));
        all
    }
}

/// Place of the sensor, relative to the focal lengths of lenses.
fn place_of_sensor(design: &Design, camera: &Camera) -> String {
    let distance_um = sensor_um(design, camera);
    let source = match camera.sensor.distance_um {
        Some(_) => "from the camera file",
        None => "the focal length of [lens]",
    };
    let off = design.lens_sizes_um().map(|[_, focal_um]| focal_um);
    let off: Vec<f64> = off.filter(|focal_um| *focal_um != distance_um).collect();
    let others = match (
        off.iter().copied().reduce(f64::min),
        off.iter().copied().reduce(f64::max),
    ) {
        (Some(least), Some(most)) => format!(
            "; {} of {} elements have another focal length ({}) and are out of focus",
            off.len(),
            design.elements().len(),
            if least == most {
                format!("{least} um")
            } else {
                format!("{least} to {most} um")
            }
        ),
        _ => String::new(),
    };
    format!("{distance_um} um behind the pillar tops in the middle of the chip, {source}{others}")
}

/// Assumption on the polarisation of the scene, at pillars that give this light the phase of the design.
fn polarised(focused: FocusedLight, light: PolarisedLight) -> String {
    let arriving = light.arriving_at(focused);
    let own = focused.polarisation();
    let source = if arriving == own {
        format!("all light arrives {arriving}, as behind a filter")
    } else {
        format!("all light arrives {arriving}, and pillars focus light that arrives {own}")
    };
    format!("{source}; {}, in image and stray light", light.detector(focused))
}

/// Source of the spectra of a scene.
fn spectra_of(scene: &SceneImage) -> String {
    if scene.basis == rgb_basis() {
        return "smooth reflectances of sRGB after Mallett and Yuksel (2019)".into();
    }
    format!(
        "{} principal components of its bands; they leave out {:.2} % of its light (root mean square)",
        scene.basis.len(),
        100.0 * scene.left_out
    )
}

fn fixed(value: f64) -> String {
    format!("{value:.0}")
}

/// Root mean square and largest distance of pairs of points from the best homography, fitted without the weights that its
/// denominator brings first, then twice with them (direct linear transformation).
fn homography_residual(points: &[([f64; 2], [f64; 2])]) -> Option<(f64, f64)> {
    const LEAST: usize = 8;
    if points.len() < LEAST {
        return None;
    }
    let mut h = [0.0; 8];
    for _ in 0..3 {
        let weight = |t: &[f64; 2]| 1.0 / (1.0 + h[6] * t[0] + h[7] * t[1]).abs().max(1e-6);
        let mut a = DMatrix::zeros(2 * points.len(), 8);
        let mut b = DMatrix::zeros(2 * points.len(), 1);
        for (i, (t, p)) in points.iter().enumerate() {
            let w = weight(t);
            for axis in 0..2 {
                let row = 2 * i + axis;
                for (k, v) in [t[0], t[1], 1.0].into_iter().enumerate() {
                    a[(row, 3 * axis + k)] = w * v;
                }
                a[(row, 6)] = -w * t[0] * p[axis];
                a[(row, 7)] = -w * t[1] * p[axis];
                b[(row, 0)] = w * p[axis];
            }
        }
        let found = a.svd(true, true).solve(&b, 1e-12).ok()?;
        h.copy_from_slice(found.as_slice());
    }
    let miss = |(t, p): &([f64; 2], [f64; 2])| {
        let below = 1.0 + h[6] * t[0] + h[7] * t[1];
        let at = [0, 1].map(|k| (h[3 * k] * t[0] + h[3 * k + 1] * t[1] + h[3 * k + 2]) / below);
        (at[0] - p[0]).hypot(at[1] - p[1])
    };
    let misses: Vec<f64> = points.iter().map(miss).collect();
    let rms = (misses.iter().map(|m| m * m).sum::<f64>() / misses.len() as f64).sqrt();
    Some((rms, misses.into_iter().fold(0.0, f64::max)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spectra_are_named_after_what_they_are() {
        let rgb = ndarray::Array3::from_elem((20, 20, 3), 0.5);
        let mut scene = SceneImage::of_rgb("colours", &rgb, 60.0, f64::INFINITY);
        assert!(spectra_of(&scene).contains("Mallett"));
        scene.basis.truncate(2);
        scene.left_out = 0.0123;
        let words = spectra_of(&scene);
        assert!(words.starts_with("2 principal") && words.contains("1.23 %"), "{words}");
    }

    #[test]
    fn methods_without_a_gain_are_noted_with_their_loss() {
        let restored = |method, joint, psnr_db| {
            let score = |zone| crate::score::ZoneScore {
                zone,
                psnr_db,
                psnr_linear_db: psnr_db,
                ssim: 0.5,
            };
            RestorationReport::new(method, joint, crate::score::Zone::ALL.map(score).to_vec())
        };
        let (linear, learnt) = (RestorationMethod::Tikhonov, RestorationMethod::LearnedPrior);
        let notes = |learnt_db| no_gain(&[restored(learnt, true, learnt_db), restored(linear, true, 19.35)]);
        assert!(notes(18.93)[0].contains("0.42 dB"), "{:?}", notes(18.93));
        assert!(notes(19.35).is_empty());
        // Of other elements, or alone, nothing is known.
        assert!(no_gain(&[restored(learnt, false, 18.93), restored(linear, true, 19.35)]).is_empty());
        assert!(no_gain(&[restored(learnt, true, 18.93)]).is_empty());
    }

    #[test]
    fn a_homography_is_found_and_what_is_none_is_not() {
        let map = |t: [f64; 2], bend: f64| {
            let below = 1.0 + 0.2 * t[0] - 0.1 * t[1];
            [
                (100.0 * t[0] + 3.0 * t[1] + 7.0) / below + bend * t[1].powi(3),
                (90.0 * t[1] - 2.0) / below,
            ]
        };
        let points = |bend: f64| -> Vec<_> {
            (0..49)
                .map(|k| [f64::from(k % 7) / 6.0 - 0.5, f64::from(k / 7) / 6.0 - 0.5])
                .map(|t| (t, map(t, bend)))
                .collect()
        };
        // Rounding of a system of hundred rows.
        assert!(homography_residual(&points(0.0)).unwrap().1 < 1e-6);
        assert!(homography_residual(&points(20.0)).unwrap().0 > 0.1);
        assert!(homography_residual(&points(0.0)[..5]).is_none());
    }
}
