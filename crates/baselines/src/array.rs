//! The chip of a design before its sensor, as a camera.

use metalith_core::{Progress, Result, Silent, srgb};
use metalith_imaging::scene::SceneImage;
use metalith_imaging::{ForecastScene, Frame, FrameOperator, ImagingSystem, LightStatement, OperatorError};
use metalith_prior::PictureFit;
use metalith_restoration::{
    Blend, FrameFit, FrameModel, Recorded, RestorationMethod, SplittingPictures, restore_by_prior, restore_each,
};
use ndarray::{Array2, Array3, Axis, Zip};

use crate::baseline_camera::{BaselineCamera, Method, no_stage};
use crate::post_processing::{Stage, StageKind};
use crate::wiener;

/// A chip that is open for scenes of one field, and the ways of restoring its frames.
pub struct ArrayCamera<'a> {
    system: &'a ImagingSystem,
    simulation: FrameOperator<'a>,
    restoration: FrameOperator<'a>,
    error: OperatorError,
    ways: Vec<(RestorationMethod, bool)>,
    stages: Vec<Stage>,
}

/// An element is shown alone where it has at least this share of its most trusted place; elsewhere the blend stands in its picture.
const LEAST_WEIGHT: f32 = 0.02;

impl<'a> ArrayCamera<'a> {
    /// Camera for an imaging system and these methods, by all elements at once and, if asked for, by each alone.
    pub fn new(system: &'a ImagingSystem, methods: &[RestorationMethod], separate: bool) -> Self {
        let restoration = system.restoration();
        let error = ForecastScene::new(system, &restoration).operator_error;
        let alone = separate && restoration.elements() > 1;
        let ways = methods.iter().flat_map(|m| {
            let kinds: &[bool] = if alone { &[true, false] } else { &[true] };
            kinds.iter().map(move |joint| (*m, *joint))
        });
        Self {
            simulation: system.simulation(),
            restoration,
            error,
            ways: ways.collect(),
            stages: Vec::new(),
            system,
        }
    }

    /// This camera with learnt last stages, each a further method.
    #[must_use]
    pub fn with_stages(mut self, stages: Vec<Stage>) -> Self {
        self.stages = stages;
        self
    }

    /// The blend of all elements, then the picture of each alone.
    fn blend_and_elements(&self, recorded: &Recorded<'_>, progress: &dyn Progress) -> Result<Vec<Vec<Array2<f32>>>> {
        let shape = (self.system.view.rows, self.system.view.columns);
        let mut blend = Blend::new(shape, self.restoration.inputs());
        let mut alone = vec![None; self.restoration.elements()];
        restore_each(
            recorded,
            RestorationMethod::Tikhonov,
            progress,
            &mut |element, picture, inverse_variance| {
                blend.add(picture, inverse_variance);
                alone[element] = Some((picture.clone(), inverse_variance.clone()));
            },
        )?;
        let blend = blend.finished();
        for (picture, inverse_variance) in alone.iter_mut().flatten() {
            for ((plane, inverse_variance), blend) in picture.iter_mut().zip(inverse_variance).zip(&blend) {
                let least = LEAST_WEIGHT * inverse_variance.iter().copied().fold(0.0, f32::max);
                Zip::from(plane)
                    .and(&*inverse_variance)
                    .and(blend)
                    .for_each(|p, t, b| *p = if *t > least { *p } else { *b });
            }
        }
        // Elements that see nothing of the scene have no picture.
        let mut pictures = vec![blend];
        for seen in alone {
            let own = seen.map_or_else(|| pictures[0].clone(), |(picture, _)| picture);
            pictures.push(own);
        }
        Ok(pictures)
    }
}

impl BaselineCamera for ArrayCamera<'_> {
    fn methods(&self) -> Vec<Method> {
        let several = self.restoration.elements() > 1;
        let way = |(method, joint): &(RestorationMethod, bool)| Method {
            method: method.name().to_owned(),
            joint: several.then_some(*joint),
        };
        let learnt = |stage: &Stage| Method {
            method: stage.kind.words().to_owned(),
            joint: None,
        };
        let learnt = self.stages.iter().map(learnt);
        self.ways.iter().map(way).chain(learnt).collect()
    }

    fn channel_names(&self) -> Vec<String> {
        self.system.camera.channel_names()
    }

    fn limits(&self) -> Option<String> {
        let all = self
            .system
            .direction_notes()
            .chain(self.error.note(&self.channel_names()));
        all.reduce(|a, b| format!("{a}; {b}"))
    }

    fn record_in(&self, scene: &SceneImage, brighter: f64, seed: u64) -> Result<Frame> {
        let exposure = self.system.exposure.in_light(&self.system.camera, brighter);
        self.system.record_in(&self.simulation, scene, &exposure, seed)
    }

    fn light(&self) -> LightStatement {
        self.system.light()
    }

    fn truth(&self, scene: &SceneImage) -> Array3<f64> {
        self.system.truth(scene)
    }

    fn unrestored(&self, frame: &Frame) -> Option<Array3<f64>> {
        Some(self.system.unrestored(&self.restoration, frame))
    }

    fn restore(&self, frame: &Frame, way: usize, progress: &dyn Progress) -> Result<Array3<f64>> {
        if let Some(k) = way.checked_sub(self.ways.len()) {
            let stage = &self.stages[k];
            let pictures = self.pictures(frame, stage.kind, progress)?;
            let is_fitted = stage.provenance().refits > 0;
            let fit = is_fitted.then(|| self.fit(frame)).transpose()?;
            stage.finish(&pictures, fit.as_deref())
        } else {
            let (method, joint) = self.ways[way];
            self.system
                .restore(&self.restoration, &self.error, frame, method, joint, progress)
        }
    }

    fn pictures(&self, frame: &Frame, kind: StageKind, progress: &dyn Progress) -> Result<Vec<Array3<f64>>> {
        frame.is_of(self.restoration.frame(), self.system.exposure.gain.len())?;
        let (light, inverse_variance) = frame.light(&self.system.camera, &self.error);
        let recorded = Recorded {
            operator: &self.restoration,
            light: &light,
            inverse_variance: &inverse_variance,
            prior: &self.system.prior,
        };
        match kind {
            StageKind::MultiWiener => {
                let all = wiener::pictures(self.system, &self.restoration, &recorded, progress)?;
                Ok(all.iter().map(|planes| self.system.colours.rgb(planes)).collect())
            }
            StageKind::Blending => {
                let all = self.blend_and_elements(&recorded, progress)?;
                Ok(all
                    .iter()
                    .map(|planes| self.system.picture(&self.restoration, planes))
                    .collect())
            }
            StageKind::RefinedPrior if self.restoration.sees_colours() => {
                let SplittingPictures { first, fitted, clean } = restore_by_prior(&recorded, progress)?;
                let all = [clean, fitted, first];
                Ok(all
                    .iter()
                    .map(|planes| self.system.picture(&self.restoration, planes))
                    .collect())
            }
            _ => no_stage(kind, "this array"),
        }
    }

    fn fit(&self, frame: &Frame) -> Result<Box<dyn PictureFit + '_>> {
        if !self.restoration.sees_colours() {
            return no_stage(StageKind::RefinedPrior, "an array that sees no colours");
        }
        frame.is_of(self.restoration.frame(), self.system.exposure.gain.len())?;
        let (light, inverse_variance) = frame.light(&self.system.camera, &self.error);
        let fit = FrameFit::new(&self.restoration, &light, &inverse_variance, &self.system.prior);
        Ok(Box::new(SrgbFit(fit)))
    }
}

/// Fit to a frame of pictures in sRGB values.
struct SrgbFit<'a>(FrameFit<'a>);

impl SrgbFit<'_> {
    /// Planes of values by colour.
    fn planes(picture: &Array3<f32>, of: impl Fn(f32) -> f32) -> Vec<Array2<f32>> {
        picture.axis_iter(Axis(2)).map(|plane| plane.mapv(&of)).collect()
    }

    /// Values by colour of planes.
    fn picture(planes: &[Array2<f32>], of: impl Fn(f32) -> f32) -> Array3<f32> {
        let (rows, columns) = planes[0].dim();
        Array3::from_shape_fn((rows, columns, planes.len()), |(y, x, c)| of(planes[c][[y, x]]))
    }
}

impl PictureFit for SrgbFit<'_> {
    fn fitted(&self, picture: &Array3<f32>) -> Array3<f32> {
        let z = Self::planes(picture, |v| srgb::linear(f64::from(v).clamp(0.0, 1.0)) as f32);
        let fitted = self.0.fitted(&z, &Silent).expect("nobody stops a silent solver");
        Self::picture(&fitted, |light| srgb::encoded(f64::from(light)) as f32)
    }

    /// Values that are cut to 0 to 1 have no gradient.
    fn adjoint(&self, picture: &Array3<f32>, fitted: &Array3<f32>, gradient: &Array3<f32>) -> Array3<f32> {
        let slope = |value: f32| srgb::slope(srgb::linear(f64::from(value))) as f32;
        let inside = |value: f32| value > 0.0 && value < 1.0;
        let mut light = gradient.clone();
        Zip::from(&mut light)
            .and(fitted)
            .for_each(|g, v| *g *= if inside(*v) { slope(*v) } else { 0.0 });
        let back = self.0.adjoint(&Self::planes(&light, |v| v));
        let mut back = Self::picture(&back, |v| v);
        Zip::from(&mut back)
            .and(picture)
            .for_each(|g, v| *g *= if inside(*v) { 1.0 / slope(*v) } else { 0.0 });
        back
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::post_processing::PICTURES;
    use metalith_design::array::PillarArray;
    use metalith_design::{Design, cell_models};
    use metalith_layout::{read_pillars, write_pillars};
    use metalith_optics::SimulationCase;
    use metalith_sensor::{Camera, Sensor};

    #[test]
    #[ignore = "second tier: CPU time, run by scripts/slow_tests.sh"]
    fn last_stages_see_what_they_say() {
        let design = Design::read("../../designs/mini_3x3.toml".as_ref()).unwrap();
        let array = PillarArray::build(&design, &Silent).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let layout = folder.path().join("mini.gds");
        write_pillars(&design, &array, design.layout.hierarchy, &layout, &Silent).unwrap();
        let extraction = read_pillars(&design, &layout, &Silent).unwrap();
        let plain = Camera::three_bands(2.0);
        let camera = Camera {
            sensor: Sensor {
                columns: 280,
                rows: 280,
                ..plain.sensor
            },
            ..plain
        };
        let cells = cell_models(&design, &[metalith_cell::Fidelity::Published]).unwrap();
        let case = SimulationCase::from(cells[0].as_ref());
        let rgb = Array3::from_shape_fn((64, 64, 3), |(y, x, c)| {
            0.1 + 0.7 * f64::from(u8::from((x / 8 + y / 11 + c) % 3 == 0))
        });
        let scene = SceneImage::of_rgb("", &rgb, 60.0, f64::INFINITY);
        let system = ImagingSystem::of_pillars(&design, &extraction, case, &camera, &scene, Some(5), &Silent).unwrap();
        let methods = [RestorationMethod::Tikhonov, RestorationMethod::LearnedPrior];
        let ready = ArrayCamera::new(&system, &methods, true);
        let frame = ready.record(&scene, 1).unwrap();
        let truth = ready.truth(&scene);
        let wiener = ready.pictures(&frame, StageKind::MultiWiener, &Silent).unwrap();
        assert_eq!(wiener.len(), PICTURES);
        assert!(
            wiener
                .iter()
                .all(|p| p.dim() == truth.dim() && p.iter().all(|v| v.is_finite()))
        );
        assert!(wiener[0] != wiener[1], "kernels of two places are not the same");
        let alone = ready.pictures(&frame, StageKind::Blending, &Silent).unwrap();
        assert_eq!(alone.len(), 1 + 9);
        assert!(
            alone[0] == ready.restore(&frame, 1, &Silent).unwrap(),
            "the blend is that of --separate"
        );
        assert!(ready.pictures(&frame, StageKind::FlatNet, &Silent).is_err());
        let refined = ready.pictures(&frame, StageKind::RefinedPrior, &Silent).unwrap();
        assert!(
            refined.len() == 3 && refined[0] == ready.restore(&frame, 2, &Silent).unwrap(),
            "the first picture is that of the prior"
        );
        /// Steps that do not converge, whose change with the picture is left out.
        const QUOTIENT: f32 = 0.08;
        let fit = ready.fit(&frame).unwrap();
        let picture = refined[0].mapv(|v| 0.2 + 0.5 * srgb::encoded(v) as f32);
        let fitted = fit.fitted(&picture);
        let gradient = &fitted - &picture;
        // Along the gradient, where its terms do not cancel.
        let change = &gradient * 0.1;
        let moved = |sign: f32| (fit.fitted(&(&picture + &(&change * sign))) * &gradient).sum();
        let quotient = 0.5 * (moved(1.0) - moved(-1.0));
        let found = (fit.adjoint(&picture, &fitted, &gradient) * &change).sum();
        let whole = (&change * &gradient).sum();
        println!("adjoint of the fit {found}, differences {quotient}, without a fit {whole}");
        assert!(
            (found - quotient).abs() < QUOTIENT * quotient.abs(),
            "{found} {quotient}"
        );
    }
}
