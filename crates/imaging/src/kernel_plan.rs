//! Plan of the kernels and the stray light of a chip that scenes in a camera need.

use std::borrow::Cow;

use metalith_cell::{Fidelity, PolarisedLight};
use metalith_core::{Error, Progress, Result};
use metalith_design::{CellIncidence, Design};
use metalith_gds::extract::Extraction;
use metalith_optics::{CalibratedModel, SimulationCase};
use metalith_restoration::LearnedDenoiser;
use metalith_sensor::{AngularResponse, Blend, Camera, ChannelSampling, Sampling, Walls};
use serde::Serialize;

use crate::approximation_set::ApproximationSet;
use crate::chip::{ChipInLight, element_views, incidence, sampling_of, sensor_um};
use crate::colour::ChannelColours;
use crate::exposure::ChosenExposure;
use crate::field_of_view::{check_coverage, check_view, check_windows, light_left_out, needed_reach_um};
use crate::geometry::{ElementView, SceneView};
use crate::imaging_system::ImagingSystem;
use crate::kernel_parts::KernelParts;
use crate::kernels::{BankSpec, KernelBank, SMALL_UM};
use crate::operator::BetweenNodes;
use crate::scene::SceneImage;
use crate::spectra::{SceneSpectrum, rgb_basis};
use crate::stray_light::StrayLight;

/// Field of an element that kernels are at least made for: the angle from its axis, behind it (degrees). Light that leaves
/// more steeply is the stray light's. A lens of the paper sees 60 degrees.
const FIELD_DEG: f64 = 30.0;
/// Nodes an axis of this field. A wider field has its nodes as far apart.
const NODES: usize = 17;
/// Widest field that kernels are made for (degrees), where a scene needs it: three times as far from the axis.
pub(crate) const WIDEST_FIELD_DEG: f64 = 60.0;
/// Steps of a field from node to node by which it is widened: as many on both sides of the axis, and a restoration knows every
/// second node.
const WIDENED_BY: usize = 4;
/// Steps between nodes in light of narrow bands, where nothing but the sensor's pixels smooths the images, for one in light
/// of wide bands, if so many can be held. A restoration knows no more of them than of the others.
const NARROW_STEPS: [usize; 2] = [2, 1];
/// Steps for one where six nodes are to hold the rings of an image out of focus (455 nm behind a lens of 140 um) to a
/// thousandth of its peak.
const SIXFOLD_STEPS: [usize; 2] = [5, 2];
/// Steps between nodes for one between the nodes that a restoration knows.
const RESTORED_STEP: usize = 2;
/// Pixels an axis of a kernel.
const WINDOW: usize = 64;

impl BankSpec {
    /// Specification for the elements of a design before a camera, in light of wide bands, over the least field.
    pub fn standard(design: &Design, camera: &Camera) -> Self {
        Self {
            pixel_um: camera.sensor.pixel_um,
            window: WINDOW,
            nodes: NODES,
            reach_um: sensor_um(design, camera) * FIELD_DEG.to_radians().tan(),
            accurate: design.lens_sizes_um().all(|[radius_um, _]| radius_um < SMALL_UM),
        }
    }

    /// This specification over a field in which elements image each place of a scene that they image onto the sensor at all, up to
    /// the widest one. Nodes stay as far apart.
    #[must_use]
    pub(crate) fn over(self, elements: &[ElementView], camera: &Camera, view: &SceneView) -> Self {
        let step_um = self.reach_um / ((self.nodes - 1) / 2) as f64;
        let widest = WIDEST_FIELD_DEG.to_radians().tan() / FIELD_DEG.to_radians().tan();
        let most = (widest * (self.nodes - 1) as f64).round() as usize + 1;
        let mut wider = self;
        let needed_um = needed_reach_um(elements, camera, view);
        while wider.reach_um < needed_um && wider.nodes < most {
            wider.nodes += WIDENED_BY;
            wider.reach_um = step_um * ((wider.nodes - 1) / 2) as f64;
        }
        wider
    }

    /// This specification with the nodes that light of a camera asks for, by how images follow from those at its
    /// wavelengths ([`Sampling::blend`](metalith_sensor::Sampling)).
    #[must_use]
    pub fn in_light(self, blend: Blend) -> Self {
        let [steps, of] = match (blend, self.between_nodes(blend)) {
            (Blend::Linear, _) => [1, 1],
            (Blend::Cubic, BetweenNodes::Linear) => NARROW_STEPS,
            (Blend::Cubic, BetweenNodes::Sixfold) => SIXFOLD_STEPS,
        };
        Self {
            nodes: (self.nodes - 1) * steps / of + 1,
            ..self
        }
    }

    /// Rule for the kernels between its nodes in such light. The error of fields that are not accurate is no polynomial
    /// from node to node: of kernels of `prototype_3x3` (530 nm, between 33 nodes) six err by 0.3 to 1.3 % of the peak,
    /// two by 0.8 to 1.1 %.
    pub fn between_nodes(&self, blend: Blend) -> BetweenNodes {
        match blend {
            Blend::Cubic if self.accurate => BetweenNodes::Sixfold,
            _ => BetweenNodes::Linear,
        }
    }
}

/// Plan of the kernels that scenes in a camera need.
pub(crate) struct KernelPlan<'a> {
    design: &'a Design,
    pub(crate) camera: &'a Camera,
    /// Scene in the pixels that it is simulated in.
    pub(crate) scene: Cow<'a, SceneImage>,
    /// View of the scene as it was given.
    given: SceneView,
    elements: Vec<ElementView>,
    channels: Vec<ChannelSampling>,
    /// Wavelengths between which images follow a cubic (nm), in light of narrow bands.
    cubic_nm: Option<Vec<f64>>,
    between: BetweenNodes,
    /// Nodes an axis in light of wide bands. They are enough where those of the specification are too many to be held.
    wide_nodes: usize,
    /// True in light of narrow bands, unless the nodes are given.
    more_nodes: bool,
    /// Spectra of the scenes, and the primaries of the restoration among or after them.
    basis: Vec<SceneSpectrum>,
    /// Index where the primaries begin.
    primaries: usize,
    pub(crate) spec: BankSpec,
}

/// The view in which a camera's pictures behind a design are simulated of scenes with this one: sensor pixels look at two points along
/// each axis, in the middle of the field, and what is finer than these would be taken for something coarse.
pub fn simulated_view(design: &Design, camera: &Camera, view: &SceneView) -> SceneView {
    view.no_finer(0.5 * camera.sensor.pixel_um / sensor_um(design, camera))
}

/// Inputs that decide a bank, as text.
#[derive(Serialize)]
struct Inputs<'a> {
    solver: u32,
    layout: &'a str,
    design: &'a str,
    lens_um: [f64; 2],
    elements: &'a [ElementView],
    camera: &'a Camera,
    model: &'a str,
    /// The cell that pillars are simulated by, and the wavelengths that it has tables of dissimilar neighbours for.
    fidelity: Fidelity,
    /// True if cells are solved along the directions of arrival.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    oblique: bool,
    tabulated_um: &'a [f64],
    /// Light of the scene, and the part of it that reaches the sensor, for pillars that change polarisation.
    #[serde(skip_serializing_if = "Option::is_none")]
    polarised: Option<PolarisedLight>,
    basis: &'a [SceneSpectrum],
    spec: &'a BankSpec,
    scene_distance_um: f64,
    /// Wavelengths of light of narrow bands (nm), where it asks for its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    cubic_nm: Option<&'a [f64]>,
}

impl<'a> KernelPlan<'a> {
    pub(crate) fn new(design: &'a Design, camera: &'a Camera, scene: &'a SceneImage) -> Result<Self> {
        let elements = element_views(design, camera);
        let given = scene.view;
        let view = simulated_view(design, camera, &given);
        let scene = if view == given {
            Cow::Borrowed(scene)
        } else {
            Cow::Owned(scene.averaged(&view))
        };
        let mut basis = scene.basis.clone();
        let primaries = if basis == rgb_basis() { 0 } else { basis.len() };
        if primaries > 0 {
            basis.extend_from_slice(rgb_basis());
        }
        let Sampling {
            wavelengths_nm,
            channels,
            blend,
        } = sampling_of(design, camera)?;
        let wide = BankSpec::standard(design, camera).over(&elements, camera, &given);
        let spec = wide.in_light(blend);
        StrayLight::check_size(&camera.sensor, channels.len(), basis.len())?;
        if primaries > 0 {
            check_coverage(&scene, &channels)?;
        }
        check_view(&elements, &spec, camera, &given)?;
        Ok(Self {
            design,
            camera,
            scene,
            given,
            elements,
            channels,
            cubic_nm: (blend == Blend::Cubic).then_some(wavelengths_nm),
            between: spec.between_nodes(blend),
            wide_nodes: wide.nodes,
            more_nodes: blend == Blend::Cubic,
            basis,
            primaries,
            spec,
        })
    }

    /// Notes on light that is left out, and on the pixels of the scene if they are not those that were given.
    pub(crate) fn notes(&self) -> impl Iterator<Item = String> {
        let light = light_left_out(&self.channels, self.design);
        light.into_iter().chain(averaging(&self.given, &self.scene.view))
    }

    /// Inputs that decide the kernels of a layout.
    pub(crate) fn inputs(&self, layout: &str, model: Option<&CalibratedModel>) -> Result<Vec<u8>> {
        let lens = &self.design.lens;
        let model_text = model.map_or_else(String::new, |m| format!("{:?}", m.perturbation));
        let mut unexposed = self.camera.clone();
        // What only acts after the light has landed, and the colour of the filter, do not decide kernels.
        unexposed.name = String::new();
        unexposed.sensor.angular_response = AngularResponse::Unstated;
        unexposed.sensor.walls = Walls::None;
        unexposed.exposure = Camera::three_bands(1.0).exposure.of_brightness();
        let inputs = Inputs {
            solver: metalith_cell::cache_file::solver_of(self.design.cell.shape),
            layout,
            design: &self.design.optics_digest()?,
            lens_um: [lens.radius_um(), lens.focal_length_um],
            elements: &self.elements,
            camera: &unexposed,
            model: &model_text,
            fidelity: model.map_or(self.design.verify.fidelity, |_| Fidelity::Calibrated),
            oblique: incidence(self.design) == CellIncidence::Oblique,
            tabulated_um: &self.design.verify.wavelengths_um,
            polarised: (self.design.cell.shape.basis()).map(|_| self.design.verify.light()),
            basis: &self.basis,
            spec: &self.spec,
            // JSON knows no infinity.
            scene_distance_um: self.scene.view.distance_um.min(f64::MAX),
            cubic_nm: self.cubic_nm.as_deref(),
        };
        serde_json::to_vec(&inputs)
            .map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))
    }

    pub(crate) fn chip<'c>(
        &self,
        extraction: &'c Extraction,
        case: SimulationCase<'c>,
        progress: &dyn Progress,
    ) -> Result<ChipInLight<'c>> {
        let distance_um = self.scene.view.distance_um;
        ChipInLight::new(self.design, extraction, case, self.camera, distance_um, progress)
    }

    /// This plan with so many nodes whatever the light, and linear between them.
    pub(crate) fn with_nodes(mut self, nodes: usize) -> Self {
        (self.spec.nodes, self.between, self.more_nodes) = (nodes, BetweenNodes::Linear, false);
        self
    }

    /// This plan as in light of wide bands, for one wavelength that stands for such a band.
    pub(crate) fn for_wide_bands(self) -> Self {
        let nodes = self.wide_nodes;
        self.with_nodes(nodes)
    }

    /// Every how many-th node of a bank a restoration knows.
    fn restored_step(&self, spec: &BankSpec) -> usize {
        if self.more_nodes {
            RESTORED_STEP * (spec.nodes - 1) / (self.wide_nodes - 1)
        } else {
            RESTORED_STEP
        }
    }

    /// The kernels of a chip, with parts that are stored on the way.
    pub(crate) fn bank(
        &self,
        chip: &ChipInLight<'_>,
        parts: &KernelParts<'_>,
        progress: &dyn Progress,
    ) -> Result<KernelBank> {
        let mut spec = self.spec;
        if self.more_nodes && KernelBank::check_size(chip, self.basis.len(), &spec).is_err() {
            spec.nodes = self.wide_nodes;
        }
        KernelBank::build_in_parts(chip, &self.basis, spec, parts, progress)
    }

    pub(crate) fn stray_light(
        &self,
        chip: &ChipInLight<'_>,
        bank: &KernelBank,
        progress: &dyn Progress,
    ) -> Result<StrayLight> {
        StrayLight::build(chip, bank, &self.basis, &self.camera.sensor, &self.scene.view, progress)
    }

    pub(crate) fn system(self, bank: KernelBank, stray_light: StrayLight) -> Result<ImagingSystem> {
        check_windows(&stray_light, bank.bases, &self.channels, &bank.spec)?;
        let restored_step = self.restored_step(&bank.spec);
        let system = ImagingSystem {
            design: self.design.clone(),
            camera: self.camera.clone(),
            bank,
            between: self.between,
            restored_step,
            stray_light,
            elements: self.elements,
            colours: ChannelColours::of(&self.channels),
            channels: self.channels,
            basis: self.basis,
            scene_spectra: self.scene.basis.len(),
            primaries: self.primaries,
            view: self.scene.view,
            given: self.given,
            pillars: None,
            exposure: ChosenExposure::of_gain(self.camera, &[]),
            from_cache: [false; 2],
            assumed: ApproximationSet::default(),
            prior: LearnedDenoiser::shipped()?,
        };
        system.exposed()
    }
}

/// Words for scenes of a view that are averaged to the larger pixels of another; `None` if both views are equal.
pub(crate) fn averaging(given: &SceneView, view: &SceneView) -> Option<String> {
    let size = |v: &SceneView| format!("{} x {}", v.columns, v.rows);
    (given != view).then(|| {
        format!(
            "the scene of {} pixels is averaged to {}: the pixels of the sensor do not resolve finer ones",
            size(given),
            size(view)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    /// More nodes, and other keys of what is kept, in light of narrow bands alone; a band that one wavelength stands for is none.
    #[test]
    fn light_of_narrow_bands_asks_for_more_nodes() {
        let design = Design::read("../../designs/prototype_3x3.toml".as_ref()).unwrap();
        let scene = SceneImage::of_rgb("dark", &Array3::zeros((64, 64, 3)), 80.0, f64::INFINITY);
        for (camera, narrow) in [("gt1930", false), ("gt1930_mono", false), ("gt1930_narrow", true)] {
            let camera = Camera::read(format!("../../cameras/{camera}.toml").as_ref()).unwrap();
            let plan = KernelPlan::new(&design, &camera, &scene).unwrap();
            let (nodes, step) = if narrow { (33, 4) } else { (NODES, 2) };
            assert_eq!(plan.spec.nodes, nodes);
            assert_eq!(plan.more_nodes, narrow);
            // A restoration knows as many of both, and of those behind small lenses.
            assert_eq!(plan.restored_step(&plan.spec), step);
            let small = BankSpec {
                accurate: true,
                nodes: NODES,
                ..plan.spec
            };
            let small = small.in_light(if narrow { Blend::Cubic } else { Blend::Linear });
            assert_eq!(plan.restored_step(&small), if narrow { 5 } else { 2 });
            let inputs = plan.inputs("layout", None).unwrap();
            let wide = plan.for_wide_bands();
            assert_eq!((wide.spec.nodes, wide.between), (NODES, BetweenNodes::Linear));
            assert_eq!(wide.inputs("layout", None).unwrap() == inputs, !narrow);
        }
    }

    /// Fields of scenes that 30 degrees hold have the kernels of these; wider ones have kernels as far apart, up to 60 degrees.
    #[test]
    fn the_field_of_kernels_follows_the_scene() {
        let camera = Camera::read("../../cameras/gt1930.toml".as_ref()).unwrap();
        let one = [
            ("elements = [3, 3]", "elements = [1, 1]"),
            ("steering_deg = 15", "steering_deg = 0"),
        ];
        let of = |name: &str, changed: &[(&str, &str)]| {
            let text = metalith_testing::accepting(&metalith_testing::changed(name, changed));
            Design::parse(&metalith_testing::design(name), &text).unwrap()
        };
        let steering = of("prototype_3x3", &[]);
        let alone = of("prototype_3x3", &one);
        let nodes = |design: &Design, field_deg: f64| {
            let scene = SceneImage::of_rgb("dark", &Array3::zeros((64, 64, 3)), field_deg, f64::INFINITY);
            KernelPlan::new(design, &camera, &scene).map(|plan| {
                let BankSpec { nodes, reach_um, .. } = plan.spec;
                assert_eq!(plan.restored_step(&plan.spec), 2);
                (nodes, (reach_um / 2400.0).atan().to_degrees())
            })
        };
        let standard = BankSpec::standard(&steering, &camera);
        for design in [(&steering, 80.0), (&steering, 60.0), (&alone, 60.0)] {
            assert_eq!(nodes(design.0, design.1).unwrap().0, NODES, "{}", design.1);
        }
        let (count, reach_deg) = nodes(&alone, 80.0).unwrap();
        // The step of nodes is that of the standard field, and the reach is no more than a restored step farther than needed.
        assert_eq!(count, 25);
        let step_um = standard.node_um(1) - standard.node_um(0);
        let farther = 2400.0 * (reach_deg.to_radians().tan() - 40f64.to_radians().tan());
        assert!((0.0..2.0 * step_um).contains(&farther), "{reach_deg}");
        // The sensor ends at 56 degrees along y, before the kernels do.
        assert_eq!(nodes(&alone, 118.0).unwrap_err().id(), "scene/field-too-wide");
    }

    /// Scenes that are finer than half a pixel of the sensor are averaged to that, and others stay as they are.
    #[test]
    fn fine_scenes_are_averaged_to_what_is_simulated() {
        let design = Design::read("../../designs/prototype_3x3.toml".as_ref()).unwrap();
        let camera = Camera::read("../../cameras/gt1930.toml".as_ref()).unwrap();
        let view = |pixels: usize| SceneView {
            rows: pixels,
            columns: pixels,
            field_deg: 80.0,
            distance_um: f64::INFINITY,
        };
        let side = |pixels: usize| simulated_view(&design, &camera, &view(pixels)).columns;
        // 2 tan 40 over 2.93 / 2400.
        assert_eq!([512, 800, 1374, 1375, 4096].map(side), [512, 800, 1374, 1374, 1374]);
        assert_eq!(averaging(&view(800), &view(800)), None);
        let words = averaging(&view(4096), &view(1374)).unwrap();
        assert!(
            words.contains("4096 x 4096 pixels is averaged to 1374 x 1374"),
            "{words}"
        );
        let rgb = Array3::from_shape_fn((100, 2748, 3), |(y, x, _)| f64::from(u8::from((x + y) % 2 == 0)));
        let scene = SceneImage::of_rgb("fine", &rgb, 80.0, f64::INFINITY);
        let plan = KernelPlan::new(&design, &camera, &scene).unwrap();
        // Each pixel is the mean of four.
        let SceneView { rows, columns, .. } = plan.scene.view;
        assert_eq!((plan.given, rows, columns), (scene.view, 50, 1374));
        assert!(plan.scene.planes[0].iter().all(|v| *v == 0.5) && plan.notes().count() == 1);
        let coarse = SceneImage::of_rgb("coarse", &Array3::zeros((64, 64, 3)), 80.0, f64::INFINITY);
        let plan = KernelPlan::new(&design, &camera, &coarse).unwrap();
        assert!(matches!(plan.scene, Cow::Borrowed(_)) && plan.notes().count() == 0);
    }
}
