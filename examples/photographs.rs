//! Photographs through a chip and its camera: a table of scores by method and zone, and the forecast beside them.
//!
//! ```text
//! cargo run --release --example photographs -- DESIGN LAYOUT CAMERA FOLDER FIELD_DEG tikhonov,hqs [separate]
//! ```
//!
//! Takes every image of a folder; they must be of one size. PSNR is that of the mean squared error over the
//! photographs, SSIM the mean. The row `frame` is the frame itself, its pixels laid where they look and divided by those of a
//! white scene. The forecasts are made without any picture, for the spectra of these
//! photographs and for those of natural scenes; a second table compares them photograph by photograph.

use std::path::PathBuf;

use metalith::imaging::scene::{images_in, read_far_scene};
use metalith::imaging::{ForecastScene, ImagingSystem, NaturalForecast, ScenePower, Zone, ZoneScore, scores};
use metalith::restoration::RestorationMethod;
use metalith::sensor::Camera;
use metalith::{Design, Error, Result, Silent};

/// Scores of all photographs by one way.
struct Row {
    way: String,
    found: Vec<Vec<ZoneScore>>,
}

/// A photograph, its PSNR of linear light (dB), and the forecast of it.
struct Compared {
    name: String,
    found: f64,
    forecast: f64,
}

impl Compared {
    fn miss(&self) -> f64 {
        self.forecast - self.found
    }
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [design, layout, camera, folder, field, methods, more @ ..] = &arguments[..] else {
        let usage = "DESIGN LAYOUT CAMERA FOLDER FIELD_DEG METHOD,METHOD [separate]";
        return Err(Error::refused("example/photographs", "too few arguments", usage));
    };
    let field_deg = field
        .parse()
        .map_err(|_| Error::refused("example/photographs", "the field is no number", "give degrees"))?;
    let methods: Vec<RestorationMethod> = methods.split(',').map(str::parse).collect::<Result<_>>()?;
    let separate = more.iter().any(|a| a == "separate");
    let design = Design::read(design.as_ref())?;
    let camera = Camera::read(camera.as_ref())?;
    let photographs = images_in(folder.as_ref())?;
    let read = |path: &PathBuf| read_far_scene(path, field_deg);
    let system = ImagingSystem::open(
        &design,
        layout.as_ref(),
        &camera,
        None,
        &read(&photographs[0])?,
        &Silent,
    )?;
    let (simulation, operator) = (system.simulation(), system.restoration());
    let forecast_scene = ForecastScene::new(&system, &operator);
    let forecast = forecast_scene.forecast(&system, &operator, &Silent)?;
    let mut rows: Vec<Row> = Vec::new();
    let mut powers = Vec::new();
    let mut pairs = Vec::new();
    let mut keep = |way: String, found: Vec<ZoneScore>| match rows.iter_mut().find(|r| r.way == way) {
        Some(row) => row.found.push(found),
        None => rows.push(Row {
            way,
            found: vec![found],
        }),
    };
    for path in &photographs {
        let scene = read(path)?;
        let frame = system.record(&simulation, &scene, 1)?;
        let truth = system.truth(&scene);
        let power = ScenePower::of(&truth);
        keep("frame".into(), scores(&system.unrestored(&operator, &frame), &truth)?);
        for method in &methods {
            for joint in [true, false] {
                if joint || separate {
                    let error = &forecast_scene.operator_error;
                    let picture = system.restore(&operator, error, &frame, *method, joint, &Silent)?;
                    let found = scores(&picture, &truth)?;
                    let words = if joint { "joint" } else { "each alone" };
                    if joint && *method == RestorationMethod::Tikhonov {
                        pairs.push(Compared {
                            name: scene.name.clone(),
                            found: found[0].psnr_linear_db,
                            forecast: forecast.psnr_linear_db(&power)[0],
                        });
                    }
                    eprintln!("{}: {}, {words}: {:.2} dB", scene.name, method.name(), found[0].psnr_db);
                    keep(format!("{}, {words}", method.name()), found);
                }
            }
        }
        powers.push(power);
    }
    let zones: Vec<&str> = Zone::ALL.iter().map(|z| z.name()).collect();
    println!(
        "{}: {} photographs; zones: {}\n",
        design.name,
        photographs.len(),
        zones.join(", ")
    );
    println!("| way | PSNR (dB) | SSIM | PSNR of linear light (dB) |\n| --- | --- | --- | --- |");
    for row in &rows {
        println!(
            "| {} | {} | {} | {} |",
            row.way,
            row.cell(2, |s| 10f64.powf(-0.1 * s.psnr_db), |v| -10.0 * v.log10()),
            row.cell(3, |s| s.ssim, |v| v),
            row.cell(2, |s| 10f64.powf(-0.1 * s.psnr_linear_db), |v| -10.0 * v.log10()),
        );
    }
    let theirs = ScenePower::mean(&powers).expect("there are photographs");
    let natural: Vec<NaturalForecast> = system
        .natural_scenes()
        .into_iter()
        .map(|s| forecast.natural(s))
        .collect();
    let mut forecasts = vec![("their spectra".to_owned(), forecast.psnr_linear_db(&theirs))];
    forecasts.extend(natural.iter().map(|n| (n.scenes.words(), n.psnr_linear_db.clone())));
    for (of, db) in forecasts {
        let db: Vec<String> = db.iter().map(|db| format!("{db:.2}")).collect();
        println!("| forecast for {of}, tikhonov, joint | | | {} |", db.join(", "));
    }
    compared(&pairs, &natural);
    Ok(())
}

/// Prints PSNR of linear light of each photograph, by Tikhonov and all elements, with its forecast.
fn compared(pairs: &[Compared], natural: &[NaturalForecast]) {
    if pairs.is_empty() {
        return;
    }
    println!("\n| photograph | found (dB) | forecast from its spectrum (dB) | less found |\n| --- | --- | --- | --- |");
    for of in pairs {
        println!(
            "| {} | {:.2} | {:.2} | {:+.2} |",
            of.name,
            of.found,
            of.forecast,
            of.miss()
        );
    }
    let count = pairs.len() as f64;
    let mean = pairs.iter().map(Compared::miss).sum::<f64>() / count;
    let absolute = pairs.iter().map(|of| of.miss().abs()).sum::<f64>() / count;
    let worst = pairs.iter().map(|of| of.miss().abs()).fold(0.0, f64::max);
    println!("\nForecast less found (dB): mean {mean:+.2}, mean absolute {absolute:.2}, worst {worst:.2}.");
    for natural in natural {
        let (low, high) = (natural.low_db[0], natural.high_db[0]);
        let inside = pairs.iter().filter(|of| (low..=high).contains(&of.found)).count();
        println!(
            "Forecast for {}: {low:.1} to {high:.1} dB; {inside} of {} photographs are within it.",
            natural.scenes.words(),
            pairs.len()
        );
    }
}

impl Row {
    /// A mean over the photographs in each zone.
    fn cell(&self, digits: usize, of: impl Fn(&ZoneScore) -> f64, back: impl Fn(f64) -> f64) -> String {
        let zone = |z: usize| {
            let sum: f64 = self.found.iter().map(|scores| of(&scores[z])).sum();
            format!("{:.digits$}", back(sum / self.found.len() as f64))
        };
        (0..Zone::ALL.len()).map(zone).collect::<Vec<_>>().join(", ")
    }
}
