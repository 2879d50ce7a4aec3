//! Files of weights: safetensors, one tensor `[output, input, row, column]` a convolution, in half or single precision.

use std::collections::HashMap;
use std::path::Path;

use half::f16;
use metalith_core::file::read_at_most;
use metalith_core::{AtomicFile, Error, Result};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use crate::network::{Layer, Plan, Size};

/// The weights that come with the program: see its model card, `crates/prior/weights/README.md`.
static SHIPPED: &[u8] = include_bytes!("../weights/denoiser.safetensors");
/// Key under which a file says what its weights were learnt from: one word alone, so that the same weights are the same
/// bytes.
const TRAINING: &str = "training";
/// Longest file of weights (bytes): a hundred times what the network needs.
const LONGEST: u64 = 256 << 20;

/// Weights that are shipped with the program.
pub(crate) fn shipped_weights() -> Result<Vec<f32>> {
    let path = Path::new("the shipped weights");
    parse(SHIPPED, path, &Plan::new(Size::DENOISER))
}

/// Weights of a denoiser in a file.
pub(crate) fn read_weights(path: &Path) -> Result<Vec<f32>> {
    parse(&read(path)?, path, &Plan::new(Size::DENOISER))
}

/// Weights of a network whose size follows from what the file says they were learnt from.
pub(crate) fn read_described<T>(
    path: &Path,
    described: impl Fn(&serde_json::Value) -> Option<(T, Size)>,
) -> Result<(T, Vec<f32>)> {
    let bytes = read(path)?;
    let (_, header) =
        SafeTensors::read_metadata(&bytes).map_err(|e| fault(path, format!("it is no file of weights: {e}")))?;
    let training = header.metadata().as_ref().and_then(|words| words.get(TRAINING));
    let (about, size) = training
        .and_then(|text| described(&serde_json::from_str(text).ok()?))
        .ok_or_else(|| fault(path, "it does not say which camera its network was trained for".into()))?;
    Ok((about, parse(&bytes, path, &Plan::new(size))?))
}

fn read(path: &Path) -> Result<Vec<u8>> {
    read_at_most(path, LONGEST, "a file of weights")
}

fn fault(path: &Path, what: String) -> Error {
    Error::table(path, None, what, "give a file that `metalith train` wrote")
}

fn shape(layer: &Layer) -> Vec<usize> {
    let side = if layer.shape.taps == 9 { 3 } else { 1 };
    vec![layer.shape.outputs, layer.shape.inputs, side, side]
}

/// Write weights in half precision, with what they were learnt from.
///
/// # Errors
/// If the file cannot be written.
pub fn write_weights(path: &Path, plan: &Plan, weights: &[f32], training: &str) -> Result<()> {
    let about = HashMap::from([(TRAINING.to_owned(), training.to_owned())]);
    let halves: Vec<Vec<u8>> = plan
        .layers
        .iter()
        .map(|l| {
            let part = &weights[l.start..l.start + l.shape.weights()];
            part.iter().flat_map(|v| f16::from_f32(*v).to_le_bytes()).collect()
        })
        .collect();
    let views = plan.layers.iter().zip(&halves).map(|(layer, bytes)| {
        let view = TensorView::new(Dtype::F16, shape(layer), bytes).expect("two bytes a weight");
        (layer.name.clone(), view)
    });
    let bytes = safetensors::serialize(views, Some(about))
        .map_err(|e| Error::refused("internal/serialisation-failed", e.to_string(), "report this"))?;
    AtomicFile::write(path, &bytes)
}

fn parse(bytes: &[u8], path: &Path, plan: &Plan) -> Result<Vec<f32>> {
    let fault = |what: String| fault(path, what);
    let file = SafeTensors::deserialize(bytes).map_err(|e| fault(format!("it is no file of weights: {e}")))?;
    let mut weights = Vec::with_capacity(plan.weights());
    for layer in &plan.layers {
        let tensor = file
            .tensor(&layer.name)
            .map_err(|_| fault(format!("it has no tensor `{}`", layer.name)))?;
        if tensor.shape() != shape(layer) {
            let (has, wants) = (tensor.shape(), shape(layer));
            return Err(fault(format!("`{}` has the shape {has:?}, not {wants:?}", layer.name)));
        }
        let data = tensor.data();
        match tensor.dtype() {
            Dtype::F16 => weights.extend(data.as_chunks().0.iter().map(|b| f16::from_le_bytes(*b).to_f32())),
            Dtype::F32 => weights.extend(data.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b))),
            other => return Err(fault(format!("`{}` is of type {other:?}, not F16 or F32", layer.name))),
        }
    }
    if file.len() != plan.layers.len() {
        return Err(fault(format!(
            "it has {} tensors, the network {}",
            file.len(),
            plan.layers.len()
        )));
    }
    if weights.iter().any(|w| !w.is_finite()) {
        return Err(fault("it holds weights that are no numbers".into()));
    }
    Ok(weights)
}
