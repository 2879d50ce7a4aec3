//! Files of weights: safetensors, one tensor `[output, input, row, column]` a convolution, in half or single precision.

use std::collections::HashMap;
use std::path::Path;

use half::f16;
use metalith_core::file::read_at_most;
use metalith_core::{Error, Result, WholeFile};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use crate::network::{Layer, Plan};

/// The weights that come with the program: see its model card, `crates/prior/weights/README.md`.
static SHIPPED: &[u8] = include_bytes!("../weights/denoiser.safetensors");
/// Longest file of weights (bytes): a hundred times what the network needs.
const LONGEST: u64 = 256 << 20;

/// Those that come with the program.
pub(crate) fn shipped_weights() -> Result<Vec<f32>> {
    parse(SHIPPED, Path::new("the shipped weights"))
}

/// Those of a file.
pub(crate) fn read_weights(path: &Path) -> Result<Vec<f32>> {
    parse(&read_at_most(path, LONGEST, "a file of weights")?, path)
}

fn shape(layer: &Layer) -> Vec<usize> {
    let side = if layer.shape.taps == 9 { 3 } else { 1 };
    vec![layer.shape.outputs, layer.shape.inputs, side, side]
}

/// Write weights in half precision, with words on their origin.
pub(crate) fn write_weights(path: &Path, weights: &[f32], origin: HashMap<String, String>) -> Result<()> {
    let plan = Plan::new();
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
    let bytes =
        safetensors::serialize(views, Some(origin)).map_err(|e| Error::invalid(e.to_string(), "report this"))?;
    WholeFile::write(path, &bytes)
}

fn parse(bytes: &[u8], path: &Path) -> Result<Vec<f32>> {
    let fault = |what: String| Error::Table {
        path: path.to_owned(),
        line: None,
        what,
        hint: "give a file that `metalith train` wrote".into(),
    };
    let file = SafeTensors::deserialize(bytes).map_err(|e| fault(format!("it is no file of weights: {e}")))?;
    let plan = Plan::new();
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
