//! Weights of networks, and pictures that a training keeps.

use std::path::Path;

use metalith::prior::parts::{Plan, STAGE, Size, write_weights};
use metalith::prior::{NetworkDenoiser, PostProcessor};
use metalith::training::Stack;
use ndarray::Array3;

use super::{Format, Kind, file};

pub(super) fn all(folder: &Path) -> Vec<Format> {
    let stage = folder.join("stage.safetensors");
    let plan = Plan::new(Size::post_processor(2));
    let training = format!(r#"{{"steps":9,"{STAGE}":{{"kind":"blending","camera":"a1","pictures":2,"optics":"b2"}}}}"#);
    write_weights(&stage, &plan, &vec![0.0; plan.weights()], &training).unwrap();
    let kept = folder.join("stack.safetensors");
    let picture = Array3::from_elem((8, 6, 3), 0.5);
    let stack = Stack::new(&[picture.clone(), picture.clone()], &picture).unwrap();
    stack.write(&kept, "photograph").unwrap();
    let [stage_bytes, stack_bytes] = [&stage, &kept].map(|path| std::fs::read(path).unwrap());
    vec![
        Format::new(
            "weights",
            folder.join("denoiser.safetensors"),
            Kind::Safetensors,
            vec![file("crates/prior/weights/denoiser.safetensors")],
            NetworkDenoiser::read,
        ),
        Format::new(
            "stage",
            stage,
            Kind::Safetensors,
            vec![stage_bytes],
            PostProcessor::read,
        ),
        Format::new("stack", kept, Kind::Safetensors, vec![stack_bytes], |path| {
            Stack::kept(path, "photograph").ok_or("to be made again")
        }),
    ]
}
