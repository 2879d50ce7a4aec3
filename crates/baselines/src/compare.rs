//! Scores of cameras over photographs.

use metalith_core::cpu_time::{cpu_seconds, since};
use metalith_core::srgb::encoded;
use metalith_core::{Error, Progress, Result};
use metalith_imaging::scene::SceneImage;
use metalith_imaging::{Frame, LightStatement, Zone, ZoneScore, scores};
use metalith_prior::PerceptualDistance;
use ndarray::Array3;
use serde::{Deserialize, Serialize};

use crate::baseline_camera::{BaselineCamera, Method};

/// Scores of one way of making pictures, in all zones.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MethodScores {
    /// Method; `None` for the bare frame.
    pub way: Option<Method>,
    /// Over the photographs: PSNR of the mean squared error, mean of SSIM.
    pub mean: Vec<ZoneScore>,
    /// One less the learned perceptual distance (LPIPS) of sRGB values, mean over the photographs; none without its weights.
    pub one_less_lpips: Option<f64>,
    /// CPU time for a picture (s), if the system reports it; `None` for a bare frame.
    pub cpu_s: Option<f64>,
    /// Scores of each photograph, in their order.
    pub photographs: Vec<Vec<ZoneScore>>,
}

/// A camera, as it was compared.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ComparedCamera {
    /// Name in the table.
    pub name: String,
    /// Description in a sentence.
    pub words: String,
    /// Angle from the left to the right edge of its scenes (degrees).
    pub field_deg: f64,
    /// The bare frame first, if it is a picture.
    pub ways: Vec<MethodScores>,
    /// To simulate a frame (s), if the system tells.
    pub frame_cpu_s: Option<f64>,
    /// Limit of its restorations, in words, if something but its frames limits them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<String>,
    /// Light, time and electrons of its exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light: Option<LightStatement>,
    /// Illuminance (lux), and PSNR of linear light (dB) of the first photograph in it by the first method.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curve: Vec<[f64; 2]>,
    /// The first photograph; it is not kept with the scores.
    #[serde(skip)]
    pub shown: Option<ShownPictures>,
}

/// Pictures of the first photograph.
#[derive(Clone, Debug)]
pub struct ShownPictures {
    /// Linear sRGB.
    pub scene: Array3<f64>,
    pub frame: Frame,
    pub channel_names: Vec<String>,
    /// Pictures by each method, linear sRGB.
    pub pictures: Vec<Array3<f64>>,
}

/// All cameras on the same photographs.
#[derive(Clone, Debug, Serialize)]
pub struct ComparisonResult {
    /// Words for exposure times that differ from camera to camera; none if they are equal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unequal_times: Option<String>,
    /// Names of the photographs.
    pub photographs: Vec<String>,
    /// Rows and columns of each, as all cameras take it.
    pub size: [usize; 2],
    /// Rows and columns that they were given in, if those are finer than a camera is simulated with: they are averaged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub averaged_from: Option<[usize; 2]>,
    /// Name of the camera file: its sensor and its light.
    pub camera: String,
    /// Seed of the noise.
    pub seed: u64,
    pub cameras: Vec<ComparedCamera>,
}

/// Let a camera take photographs and restore them in all its ways. `name` and `words` are those of the table; pictures are judged by a
/// perceptual distance too, if there is one. `curve_lux`: illuminances in which the first photograph is also taken.
///
/// # Errors
/// If there are none, they differ in size, or the user stopped it.
pub fn compare(
    camera: &dyn BaselineCamera,
    (name, words): (&str, &str),
    photographs: &[SceneImage],
    seed: u64,
    perceptual: Option<&PerceptualDistance>,
    curve_lux: &[f64],
    progress: &dyn Progress,
) -> Result<ComparedCamera> {
    let first = photographs.first().ok_or_else(|| {
        Error::refused(
            "compare/no-photographs",
            "there are no photographs",
            "give at least one photograph",
        )
    })?;
    let light = camera.light();
    for note in light.notes() {
        progress.warn(&format!("{name}: {note}"));
    }
    let limits = camera.limits();
    if let Some(limits) = &limits {
        progress.warn(&format!("{name}: {limits}"));
    }
    let ways = camera.methods();
    let mut bare = Judged::default();
    let mut found: Vec<Judged> = ways.iter().map(|_| Judged::default()).collect();
    let mut seconds: Vec<Option<f64>> = vec![Some(0.0); ways.len()];
    let mut frame_s = Some(0.0);
    let mut shown = None;
    let add = |sum: &mut Option<f64>, moment: Option<f64>| *sum = sum.zip(since(moment)).map(|(a, b)| a + b);
    for photograph in photographs {
        let begun = cpu_seconds();
        let frame = camera.record(photograph, seed)?;
        add(&mut frame_s, begun);
        let truth = camera.truth(photograph);
        if let Some(note) = frame.saturation_note(&truth) {
            progress.warn(&format!("{name}, {}: {note}", photograph.name));
        }
        if let Some(picture) = camera.unrestored(&frame) {
            bare.add(&picture, &truth, perceptual)?;
        }
        let mut pictures = Vec::new();
        for (k, way) in ways.iter().enumerate() {
            progress.check_stopped()?;
            let begun = cpu_seconds();
            let picture = camera.restore(&frame, k, progress)?;
            add(&mut seconds[k], begun);
            found[k].add(&picture, &truth, perceptual)?;
            let scores = &found[k].scores;
            let whole = &scores[scores.len() - 1][0];
            progress.note(&format!(
                "{name}, {}, {}: {:.2} dB of sRGB",
                photograph.name,
                way.words(),
                whole.psnr_db
            ));
            if shown.is_none() {
                pictures.push(picture);
            }
        }
        shown.get_or_insert(ShownPictures {
            scene: truth,
            frame,
            channel_names: camera.channel_names(),
            pictures,
        });
    }
    let each = |sum: Option<f64>| sum.map(|s| s / photographs.len() as f64);
    let frames = (!bare.scores.is_empty()).then(|| MethodScores {
        way: None,
        mean: mean(&bare.scores),
        one_less_lpips: bare.one_less(),
        cpu_s: None,
        photographs: bare.scores,
    });
    let restored = ways
        .into_iter()
        .zip(found)
        .zip(seconds)
        .map(|((way, own), s)| MethodScores {
            way: Some(way),
            mean: mean(&own.scores),
            one_less_lpips: own.one_less(),
            cpu_s: each(s),
            photographs: own.scores,
        });
    Ok(ComparedCamera {
        name: name.to_owned(),
        words: words.to_owned(),
        field_deg: first.view.field_deg,
        ways: frames.into_iter().chain(restored).collect(),
        frame_cpu_s: each(frame_s),
        limits,
        curve: curve(camera, &light, first, seed, curve_lux, progress)?,
        light: Some(light),
        shown,
    })
}

/// PSNR of linear light (dB) of a photograph by the first way of a camera, in light of each of these illuminances (lux).
fn curve(
    camera: &dyn BaselineCamera,
    light: &LightStatement,
    photograph: &SceneImage,
    seed: u64,
    curve_lux: &[f64],
    progress: &dyn Progress,
) -> Result<Vec<[f64; 2]>> {
    let Some(own) = light.illuminance_lux else {
        return Ok(Vec::new());
    };
    let truth = camera.truth(photograph);
    let at = |lux: &f64| {
        progress.check_stopped()?;
        let frame = camera.record_in(photograph, lux / own, seed)?;
        let picture = camera.restore(&frame, 0, progress)?;
        Ok([*lux, scores(&picture, &truth)?[0].psnr_linear_db])
    };
    curve_lux.iter().map(at).collect()
}

/// Pictures of one way, judged.
#[derive(Default)]
struct Judged {
    scores: Vec<Vec<ZoneScore>>,
    /// Perceptual distances, if they are known.
    distances: Vec<f64>,
}

impl Judged {
    fn add(
        &mut self,
        picture: &Array3<f64>,
        truth: &Array3<f64>,
        perceptual: Option<&PerceptualDistance>,
    ) -> Result<()> {
        self.scores.push(scores(picture, truth)?);
        if let Some(perceptual) = perceptual {
            let [picture, truth] = [picture, truth].map(|p| p.mapv(encoded));
            self.distances.push(perceptual.between(picture.view(), truth.view())?);
        }
        Ok(())
    }

    fn one_less(&self) -> Option<f64> {
        let mean = self.distances.iter().sum::<f64>() / self.distances.len() as f64;
        (!self.distances.is_empty()).then_some(1.0 - mean)
    }
}

/// Over photographs: PSNR of the mean squared error, mean of SSIM.
fn mean(all: &[Vec<ZoneScore>]) -> Vec<ZoneScore> {
    let over = |z: usize, of: fn(&ZoneScore) -> f64| all.iter().map(|s| of(&s[z])).sum::<f64>() / all.len() as f64;
    let db = |error: f64| -10.0 * error.log10();
    let zone = |(z, zone): (usize, Zone)| ZoneScore {
        zone,
        psnr_db: db(over(z, |s| 10f64.powf(-0.1 * s.psnr_db))),
        psnr_linear_db: db(over(z, |s| 10f64.powf(-0.1 * s.psnr_linear_db))),
        ssim: over(z, |s| s.ssim),
    };
    Zone::ALL.into_iter().enumerate().map(zone).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_of_errors_and_not_of_decibels() {
        let score = |psnr_db: f64, ssim: f64| {
            let of = |zone| ZoneScore {
                zone,
                psnr_db,
                psnr_linear_db: psnr_db,
                ssim,
            };
            Zone::ALL.map(of).to_vec()
        };
        let found = mean(&[score(20.0, 0.5), score(30.0, 0.7)]);
        // Errors of 0.01 and 0.001.
        assert!((found[0].psnr_db + 10.0 * 0.0055f64.log10()).abs() < 1e-9);
        assert!((found[3].ssim - 0.6).abs() < 1e-12);
    }
}
