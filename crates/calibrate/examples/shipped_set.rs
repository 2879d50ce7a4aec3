//! Writes `golden/session`: a small measured set of a synthetic chip whose pillars are 8 nm too narrow and whose sensor is 5 um
//! too far. `cargo run --release -p metalith-calibrate --example shipped_set FOLDER`. The set names `layout.gds`, the pillars
//! of `designs/mini_3x3.toml`, which whoever reads the set writes beside it.

use std::path::Path;

use metalith_calibrate::{MeasuredSet, Sampling, Settings, Synthesizer};
use metalith_core::Silent;
use metalith_gds::extract::GdsPillars;
use metalith_testing::session::{small_set, write_npy};

/// What the chip has, beside noise.
const EFFECTS: [(&str, [f64; 1]); 2] = [("cd_bias", [-8.0]), ("gap", [5.0])];

/// Seed of noise, registration, flux and black level.
const SEED: u64 = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("name the folder to write into")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    small_set(folder);
    let like = MeasuredSet::read(folder, &GdsPillars, &Silent)?;
    let settings = Settings {
        only: EFFECTS.iter().map(|(name, _)| (*name).to_owned()).collect(),
        sampling: Sampling::default(),
        ..Settings::default()
    };
    let synthesizer = Synthesizer::new(&like, &settings)?;
    let chip = EFFECTS
        .iter()
        .map(|(name, number)| (*name, number.as_slice()))
        .collect();
    let images = synthesizer.with_effects(&[chip], &Silent)?.remove(0);
    let set = synthesizer.draw(&images, SEED);
    for capture in &set.captures.raw {
        write_npy(&folder.join(format!("{}.npy", capture.name)), &capture.dn);
    }
    // Who reads the set writes it: it is the layout of a design of this project.
    std::fs::remove_file(folder.join("layout.gds"))?;
    Ok(())
}
