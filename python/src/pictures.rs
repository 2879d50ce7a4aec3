//! Pictures: the frame that a camera records, and what can be restored from it.

use std::path::PathBuf;
use std::sync::OnceLock;

use metalith::imaging::scene::SceneImage;
use metalith::imaging::{self, ForecastScene, OperatorError};
use metalith::prior::NetworkDenoiser;
use metalith::restoration::{LearnedDenoiser, RestorationMethod};
use metalith::sensor::{Camera, StatedExposure};
use metalith::{CalibratedModel, Error, Result};
use ndarray::{Array, Array3, ArrayD, IxDyn};
use numpy::{PyArray2, PyArray3, PyArrayDyn, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::arrays::{Design, given};
use crate::work::{error, work};

/// Distance of a scene of which none is said (um).
const FAR: f64 = f64::INFINITY;

/// A layout behind a camera, and the field of its scenes.
#[pyclass(frozen)]
pub struct ImagingSystem {
    system: imaging::ImagingSystem,
    /// Error of the operator of the restoration; computed when it is first needed.
    operator_error: OnceLock<OperatorError>,
}

/// A frame that was recorded.
#[pyclass(frozen)]
pub struct Frame {
    frame: imaging::Frame,
}

#[pymethods]
impl Frame {
    /// Planes of full scale: one with a colour filter array, else one for each channel.
    #[getter]
    fn planes<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray2<f32>>> {
        self.frame.planes.iter().map(|p| PyArray2::from_array(py, p)).collect()
    }

    /// Pixels at full scale.
    #[getter]
    fn saturated(&self) -> usize {
        self.frame.saturated
    }
}

#[pymethods]
impl ImagingSystem {
    /// Kernels and stray light of a layout, made or taken from the disk. Scenes whose pixels are finer than half of one of the sensor are
    /// averaged to these; truth and pictures have the size of the averaged scene then.
    #[staticmethod]
    #[pyo3(signature = (design, layout, camera, rows, columns, field_deg, distance_mm=None, model=None, prior=None, lux=None, time_ms=None, longest_ms=None, progress=None))]
    #[allow(clippy::too_many_arguments)]
    fn open(
        py: Python<'_>,
        design: &Design,
        layout: PathBuf,
        camera: PathBuf,
        rows: usize,
        columns: usize,
        field_deg: f64,
        distance_mm: Option<f64>,
        model: Option<PathBuf>,
        prior: Option<PathBuf>,
        lux: Option<f64>,
        time_ms: Option<f64>,
        longest_ms: Option<f64>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let design = &design.design;
        let system = work(py, progress, |p| {
            let camera = Camera::read(&camera)?.stated(&StatedExposure {
                lux,
                time_ms,
                longest_ms,
            })?;
            let model = model.as_deref().map(CalibratedModel::read).transpose()?;
            let prior = prior.as_deref().map(LearnedDenoiser::read).transpose()?;
            let black = Array3::zeros((rows, columns, 3));
            let scene = SceneImage::of_rgb("scene", &black, field_deg, distance_mm.map_or(FAR, |mm| mm * 1e3));
            let mut system = imaging::ImagingSystem::open(design, &layout, &camera, model.as_ref(), &scene, p)?;
            if let Some(prior) = prior {
                system.prior = prior;
            }
            Ok(system)
        })?;
        Ok(Self {
            system,
            operator_error: OnceLock::new(),
        })
    }

    /// The frame of a scene `[row, column, colour]` in linear sRGB.
    #[pyo3(signature = (scene, seed=1, progress=None))]
    fn record(
        &self,
        py: Python<'_>,
        scene: PyReadonlyArray3<'_, f64>,
        seed: u64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Frame> {
        let rgb = scene.as_array().to_owned();
        let frame = work(py, progress, |_| {
            let scene = self.scene(&rgb)?;
            self.system.record(&self.system.simulation(), &scene, seed)
        })?;
        Ok(Frame { frame })
    }

    /// The frame of signals that a camera recorded, full scale being one.
    fn frame(&self, py: Python<'_>, planes: Vec<PyReadonlyArray2<'_, f32>>) -> PyResult<Frame> {
        let signals = given(planes);
        let frame = work(py, None, |_| self.system.frame_of(signals))?;
        Ok(Frame { frame })
    }

    /// Image of a scene by an ideal camera of the same channels, linear sRGB.
    fn truth<'py>(&self, py: Python<'py>, scene: PyReadonlyArray3<'py, f64>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let rgb = scene.as_array().to_owned();
        let truth = work(py, None, |_| Ok(self.system.truth(&self.scene(&rgb)?)))?;
        Ok(PyArray3::from_owned_array(py, truth))
    }

    /// The picture restored from a frame, linear sRGB.
    #[pyo3(signature = (frame, method="tikhonov", joint=true, progress=None))]
    fn restore<'py>(
        &self,
        py: Python<'py>,
        frame: &Frame,
        method: &str,
        joint: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let method: RestorationMethod = method.parse().map_err(error)?;
        let found = work(py, progress, |p| {
            let operator = self.system.restoration();
            let expected = self.operator_error(&operator);
            self.system.restore(&operator, expected, &frame.frame, method, joint, p)
        })?;
        Ok(PyArray3::from_owned_array(py, found))
    }

    /// Pictures that a frame may be of, linear sRGB, one for each seed from zero.
    #[pyo3(signature = (frame, count, progress=None))]
    fn samples<'py>(
        &self,
        py: Python<'py>,
        frame: &Frame,
        count: u64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyArray3<f64>>>> {
        let drawn = work(py, progress, |p| {
            let operator = self.system.restoration();
            let expected = self.operator_error(&operator);
            self.system.samples(&operator, expected, &frame.frame, 0..count, p)
        })?;
        Ok(drawn.into_iter().map(|d| PyArray3::from_owned_array(py, d)).collect())
    }

    /// Kernels of an element `[row, column, channel, colour, y, x]`, whose colours add up to white, at every `step`-th place of its field along both axes, these
    /// places and the places of the values (um), and each channel with the wavelength that its kernels are about (nm).
    fn kernels<'py>(&self, py: Python<'py>, element: usize, step: usize) -> PyResult<KernelArrays<'py>> {
        let bank = &self.system.bank;
        let (side, channels, colours) = (bank.spec.side(), bank.channel_um.len(), self.system.primaries());
        let nodes: Vec<usize> = (0..bank.spec.nodes).step_by(step).collect();
        let shape = IxDyn(&[nodes.len(), nodes.len(), channels, colours.len(), side, side]);
        let values = work(py, None, |_| {
            if element >= bank.elements.len() {
                return Err(Error::refused(
                    "kernels/no-such-element",
                    format!("there is no element {element}"),
                    format!("elements count from 0 to {}", bank.elements.len() - 1),
                ));
            }
            let mut values = Vec::with_capacity(nodes.len().pow(2) * channels * colours.len() * side * side);
            for (row, column) in nodes
                .iter()
                .flat_map(|row| nodes.iter().map(move |column| (*row, *column)))
            {
                for channel in 0..channels {
                    for colour in colours.clone() {
                        values.extend_from_slice(&bank.kernel(element, [row, column], channel, colour).turned());
                    }
                }
            }
            Ok(values)
        })?;
        let values: ArrayD<f32> = Array::from_shape_vec(shape, values).expect("as many values as the shape has");
        // Values stand at every half of a pixel.
        let samples = (0..side).map(|i| 0.25 * bank.spec.pixel_um * (2.0 * i as f64 - (side as f64 - 1.0)));
        let channels = self.system.channels.iter().zip(&bank.channel_um);
        Ok((
            PyArrayDyn::from_owned_array(py, values),
            nodes.iter().map(|i| bank.spec.node_um(*i)).collect(),
            samples.collect(),
            channels.map(|(channel, um)| (channel.name.clone(), um * 1e3)).collect(),
        ))
    }
}

/// Kernels, places of the field and of the values (um), and channels with their wavelengths (nm).
type KernelArrays<'py> = (Bound<'py, PyArrayDyn<f32>>, Vec<f64>, Vec<f64>, Vec<(String, f64)>);

impl ImagingSystem {
    fn scene(&self, rgb: &Array3<f64>) -> Result<SceneImage> {
        let view = self.system.given;
        if rgb.dim() != (view.rows, view.columns, 3) {
            return Err(Error::refused(
                "scene/size-differs",
                format!("a scene of shape {:?}", rgb.dim()),
                format!("give one of shape ({}, {}, 3)", view.rows, view.columns),
            ));
        }
        if !rgb.iter().all(|v| v.is_finite() && *v >= 0.0) {
            return Err(Error::refused(
                "scene/not-numbers",
                "a scene with light that is negative or no number",
                "give finite values from zero, white being one",
            ));
        }
        Ok(SceneImage::of_rgb("scene", rgb, view.field_deg, view.distance_um))
    }

    fn operator_error(&self, operator: &imaging::FrameOperator<'_>) -> &OperatorError {
        if let Some(known) = self.operator_error.get() {
            return known;
        }
        // Computed outside the lock: a child that is forked meanwhile would wait for it without end.
        let made = ForecastScene::new(&self.system, operator).operator_error;
        self.operator_error.get_or_init(|| made)
    }
}

/// A picture `[row, column, colour]` in sRGB values without its normal noise, whose deviation is given for each value.
#[pyfunction]
#[pyo3(signature = (values, deviation, weights=None))]
pub fn denoise<'py>(
    py: Python<'py>,
    values: PyReadonlyArray3<'py, f32>,
    deviation: PyReadonlyArray3<'py, f32>,
    weights: Option<PathBuf>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let (values, deviation) = (values.as_array().to_owned(), deviation.as_array().to_owned());
    let clean = work(py, None, |_| {
        let denoiser = match &weights {
            Some(path) => NetworkDenoiser::read(path)?,
            None => NetworkDenoiser::shipped()?,
        };
        denoiser.denoise(&values, &deviation)
    })?;
    Ok(PyArray3::from_owned_array(py, clean))
}
