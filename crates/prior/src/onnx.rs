//! Denoisers of a user's own, as ONNX files.
//!
//! A file may be of any network that takes pictures `[1, 3, rows, columns]` in sRGB values from 0 to 1, of any size whose sides
//! are multiples of 32, and answers with clean ones of the same shape. How it takes the noise level is found by trying
//! ([`Form`]): the way of DRUNet and FFDNet (Zhang et al., IEEE T-PAMI 44, 6360 (2022); IEEE TIP 27, 4608 (2018)), or not
//! at all.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use metalith_core::file::read_at_most;
use metalith_core::{Error, Result};
use ndarray::{Array3, Axis};
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::infer::Factoid;

use crate::network::COLOURS;

/// Pixels of which the sides of a network's input are a multiple: five halvings.
pub const SIDE: usize = 32;
/// Longest file (bytes): a network of a hundred million weights and more.
const LONGEST: u64 = 1 << 30;
/// Rows and columns of the picture that is tried first.
const TRIAL: [usize; 2] = [2 * SIDE, 3 * SIDE];
/// Value and deviation of the picture that is tried.
const TRIED: [f32; 2] = [0.5, 0.1];

/// Form in which a network receives the deviation of the noise, in the unit of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Fourth plane of its only input, the mean over colours.
    FourPlanes,
    /// Planes four to six of its only input.
    SixPlanes,
    /// Not at all: it finds out on its own, or knows one.
    Blind,
    /// Second input `[1, 1, rows, columns]`, the mean over colours.
    Map,
    /// Single number, a second input of this many dimensions.
    Number(usize),
}

impl Form {
    /// Forms that may be of a network with so many inputs.
    fn of_inputs(inputs: usize) -> &'static [Self] {
        match inputs {
            1 => &[Self::FourPlanes, Self::SixPlanes, Self::Blind],
            2 => &[
                Self::Map,
                Self::Number(4),
                Self::Number(2),
                Self::Number(1),
                Self::Number(0),
            ],
            _ => &[],
        }
    }

    /// Shapes of the inputs.
    fn shapes(self, [rows, columns]: [usize; 2]) -> Vec<Vec<usize>> {
        let planes = |n: usize| vec![1, n, rows, columns];
        match self {
            Self::FourPlanes => vec![planes(COLOURS + 1)],
            Self::SixPlanes => vec![planes(2 * COLOURS)],
            Self::Blind => vec![planes(COLOURS)],
            Self::Map => vec![planes(COLOURS), planes(1)],
            Self::Number(dimensions) => vec![planes(COLOURS), vec![1; dimensions]],
        }
    }

    /// Values of the inputs.
    fn values(self, picture: &Array3<f32>, deviation: &Array3<f32>) -> Vec<Vec<f32>> {
        let planes = |all: &Array3<f32>| -> Vec<f32> { all.axis_iter(Axis(2)).flatten().copied().collect() };
        let mean = || -> Vec<f32> {
            let sums = deviation.sum_axis(Axis(2));
            sums.iter().map(|v| v / COLOURS as f32).collect()
        };
        match self {
            Self::FourPlanes => vec![[planes(picture), mean()].concat()],
            Self::SixPlanes => vec![[planes(picture), planes(deviation)].concat()],
            Self::Blind => vec![planes(picture)],
            Self::Map => vec![planes(picture), mean()],
            Self::Number(_) => {
                let squares: f64 = deviation.iter().map(|v| f64::from(*v).powi(2)).sum();
                vec![planes(picture), vec![(squares / deviation.len() as f64).sqrt() as f32]]
            }
        }
    }
}

/// A network that is ready for pictures of one size.
type Ready = ([usize; 2], Arc<TypedRunnableModel>);

/// The network of a file.
pub struct OnnxNetwork {
    path: PathBuf,
    model: InferenceModel,
    form: Form,
    /// Network prepared for the size that came last.
    ready: Mutex<Option<Ready>>,
}

impl std::fmt::Debug for OnnxNetwork {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "OnnxNetwork({}, {:?})", self.path.display(), self.form)
    }
}

impl OnnxNetwork {
    /// Read a file and try it on a small picture.
    ///
    /// # Errors
    /// If the file cannot be read, or is not of a network that makes pictures from pictures.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = read_at_most(path, LONGEST, "a network")?;
        let model = guarded(|| tract_onnx::onnx().model_for_read(&mut &bytes[..]))
            .map_err(|e| fault(path, format!("it is no network in ONNX that can be read: {e}")))?;
        let inputs = model.inputs.len();
        let mut refused = vec![format!("it has {inputs} inputs")];
        for form in Form::of_inputs(inputs) {
            if let Some(other) = declared(&model, &form.shapes(TRIAL)) {
                refused.push(other);
                continue;
            }
            let own = Self {
                path: path.to_owned(),
                model: model.clone(),
                form: *form,
                ready: Mutex::new(None),
            };
            let [picture, deviation] = TRIED.map(|v| Array3::from_elem((TRIAL[0], TRIAL[1], COLOURS), v));
            match guarded(|| own.run(&picture, &deviation)) {
                Ok(_) => return Ok(own),
                Err(why) => refused.push(format!("as {:?}: {why}", form.shapes(TRIAL))),
            }
        }
        Err(fault(path, refused.join("; ")))
    }

    /// Form in which it receives the noise.
    #[cfg(test)]
    fn form(&self) -> Form {
        self.form
    }

    /// A clean picture, of sides that are multiples of [`SIDE`]; see [`crate::NetworkDenoiser::denoise`].
    ///
    /// # Errors
    /// If the network cannot take this size, or answers with what is no picture.
    pub fn denoise(&self, picture: &Array3<f32>, deviation: &Array3<f32>) -> Result<Array3<f32>> {
        guarded(|| self.run(picture, deviation)).map_err(|e| fault(&self.path, e))
    }

    fn run(&self, picture: &Array3<f32>, deviation: &Array3<f32>) -> TractResult<Array3<f32>> {
        let (rows, columns, _) = picture.dim();
        let network = self.ready_for([rows, columns])?;
        let shapes = self.form.shapes([rows, columns]);
        let values = self.form.values(picture, deviation);
        let inputs = shapes.iter().zip(values);
        let inputs: TVec<TValue> = inputs
            .map(|(shape, values)| Ok(Tensor::from_shape(shape, &values)?.into_tvalue()))
            .collect::<TractResult<_>>()?;
        let answers = network.run(inputs)?;
        let Some(answer) = answers.first() else {
            return Err(TractError::msg("it has no output"));
        };
        if answer.shape() != [1, COLOURS, rows, columns] {
            return Err(TractError::msg(format!(
                "it answers with the shape {:?}, not {:?}",
                answer.shape(),
                [1, COLOURS, rows, columns]
            )));
        }
        let plain = answer.try_as_plain_ram()?;
        let values = plain.as_slice::<f32>()?;
        if values.iter().any(|v| !v.is_finite()) {
            return Err(TractError::msg("it answers with what is no number"));
        }
        Ok(Array3::from_shape_fn((rows, columns, COLOURS), |(y, x, c)| {
            values[(c * rows + y) * columns + x]
        }))
    }

    fn ready_for(&self, size: [usize; 2]) -> TractResult<Arc<TypedRunnableModel>> {
        let ready = || self.ready.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some((last, network)) = &*ready()
            && *last == size
        {
            return Ok(Arc::clone(network));
        }
        // Prepared outside the lock: a process that is forked meanwhile would wait for it without end.
        let mut model = self.model.clone();
        for (k, shape) in self.form.shapes(size).into_iter().enumerate() {
            model.set_input_fact(k, f32::fact(shape).into())?;
        }
        let network = model.into_optimized()?.into_runnable()?;
        *ready() = Some((size, Arc::clone(&network)));
        Ok(network)
    }
}

/// The first of its inputs that a network declares to be of another shape, in words.
fn declared(model: &InferenceModel, shapes: &[Vec<usize>]) -> Option<String> {
    shapes.iter().enumerate().find_map(|(k, shape)| {
        let own = &model.input_fact(k).ok()?.shape;
        let sides: Vec<_> = own.dims().map(|d| d.concretize().and_then(|d| d.as_i64())).collect();
        let fits = sides
            .iter()
            .zip(shape)
            .all(|(side, wanted)| side.is_none_or(|s| s == *wanted as i64));
        let fits = fits && (own.is_open() || sides.len() == shape.len());
        (!fits).then(|| format!("input {} is of the shape {own:?}, not {shape:?}", k + 1))
    })
}

/// Result of a network, or the reason why it has none: files from anywhere may break what reads them.
fn guarded<T>(work: impl FnOnce() -> TractResult<T>) -> std::result::Result<T, String> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(answer) => answer.map_err(|e| format!("{e:#}")),
        Err(_) => Err("it breaks the reader of networks".into()),
    }
}

/// Letters of a reason that are shown.
const SHOWN: usize = 600;

fn fault(path: &Path, what: String) -> Error {
    let hint = "give a network from pictures [1, 3, rows, columns] to pictures of the same shape, with rows and columns left \
                open and the deviation of the noise as a fourth plane, as a second input or not at all";
    Error::table(path, None, what.chars().take(SHOWN).collect::<String>(), hint)
}

#[cfg(test)]
mod tests;
