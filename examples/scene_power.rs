//! Power of photographs by zone of the field, plane of colour and band of frequency: the table of `ScenePower::natural`.
//!
//! ```text
//! cargo run --release --example scene_power -- FOLDER
//! ```
//!
//! Takes every image of a folder. Prints, for each zone, the mean light and the powers of each plane.

use std::path::PathBuf;

use metalith::imaging::ScenePower;
use metalith::imaging::scene::{images_in, read_far_scene};
use metalith::{Error, Result};
use ndarray::Array3;

/// Power is by pixels: the field does not matter.
const FIELD_DEG: f64 = 80.0;

fn main() -> Result<()> {
    let folder = std::env::args_os().nth(1).map(PathBuf::from);
    let folder =
        folder.ok_or_else(|| Error::refused("example/arguments", "no folder", "give a folder of photographs"))?;
    let power = |path: &PathBuf| {
        let scene = read_far_scene(path, FIELD_DEG)?;
        let size = (scene.view.rows, scene.view.columns, 3);
        let picture = Array3::from_shape_fn(size, |(y, x, c)| f64::from(scene.planes[c][[y, x]]));
        Ok(ScenePower::of(&picture))
    };
    let all = images_in(&folder)?.iter().map(power).collect::<Result<Vec<_>>>()?;
    let mean = ScenePower::mean(&all)
        .ok_or_else(|| Error::refused("example/arguments", "no photographs", "give a folder that has some"))?;
    for (zone, light, planes) in mean.by_zone() {
        println!("{}: light {light:.4}", zone.name());
        for bands in planes {
            let powers: Vec<String> = bands.iter().map(|p| format!("{p:.2e}")).collect();
            println!("[{}],", powers.join(", "));
        }
    }
    Ok(())
}
