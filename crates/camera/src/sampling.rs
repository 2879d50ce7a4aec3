//! A camera cut into wavelengths that are simulated, and narrow parts of its channels between them.

use metalith_core::{Error, Result};

use crate::{Camera, Channel, Illuminant};

/// Width of a part of a channel (nm): weights and the place of the chief ray are linear within it.
const PART_NM: f64 = 1.0;
/// Most parts of a channel, and most wavelengths that are simulated; beyond them both become wider.
const MOST_PARTS: f64 = 2000.0;
const MOST_WAVELENGTHS: usize = 100;
/// Share of the weight of a channel that is left out at each of its ends.
const LEFT_OUT: f64 = 1e-3;
/// Places within a part at which its weight is taken.
const WITHIN: usize = 8;

/// The wavelengths that a camera is simulated at, common to all its channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// Wavelengths (nm), rising.
    pub wavelengths_nm: Vec<f64>,
    /// In the order of the camera's.
    pub channels: Vec<ChannelSampling>,
}

impl Sampling {
    /// The first and the last wavelength (nm).
    pub fn ends_nm(&self) -> [f64; 2] {
        [
            self.wavelengths_nm[0],
            self.wavelengths_nm[self.wavelengths_nm.len() - 1],
        ]
    }
}

/// One channel among these wavelengths.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelSampling {
    pub name: String,
    /// Parts of the channel in rising order.
    pub parts: Vec<ChannelPart>,
    /// Share of what the channel counts that is in the parts.
    pub counted: f64,
}

impl ChannelSampling {
    /// Mean wavelength of the light that the channel counts (um).
    pub fn mean_um(&self) -> f64 {
        let sums = self.parts.iter().fold((0.0, 0.0), |(a, b), p| {
            (a + p.weight, b + p.weight * 0.5 * (p.nm[0] + p.nm[1]))
        });
        sums.1 / sums.0 * 1e-3
    }
}

/// A narrow part of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelPart {
    /// Its ends (nm).
    pub nm: [f64; 2],
    /// What the channel counts of it, of any scale: photons times efficiency.
    pub weight: f64,
    /// Place of its middle among the wavelengths: `i + s` is share `s` of the way from wavelength `i` to the next.
    pub place: f64,
}

impl Channel {
    /// Parts of the channel with their weights, from the shortest to the longest wavelength that it counts.
    fn parts(&self, illuminant: &Illuminant) -> Vec<ChannelPart> {
        let [low, high] = self.response.ends_nm();
        let count = ((high - low) / PART_NM).ceil().clamp(1.0, MOST_PARTS);
        let width = (high - low) / count;
        (0..count as usize)
            .map(|i| {
                let from = low + width * i as f64;
                let at = |j: usize| from + width * (j as f64 + 0.5) / WITHIN as f64;
                let sum: f64 = (0..WITHIN).map(|j| self.weight(illuminant, at(j))).sum();
                ChannelPart {
                    nm: [from, from + width],
                    weight: sum / WITHIN as f64 * width,
                    place: 0.0,
                }
            })
            .collect()
    }

    /// Whether it counts any light of an illuminant.
    pub(crate) fn counts_any(&self, illuminant: &Illuminant) -> bool {
        self.parts(illuminant).iter().any(|p| p.weight > 0.0)
    }
}

impl Camera {
    /// Wavelengths for all channels, within `range_nm`: at most `step_nm` apart, and closer where a channel counts light of a
    /// narrow band, a quarter of it, for images of a point change within it.
    ///
    /// # Errors
    /// If a channel counts no light in this range.
    pub fn sampling(&self, range_nm: [f64; 2], step_nm: f64) -> Result<Sampling> {
        let mut channels = Vec::new();
        for channel in &self.channels {
            let all = channel.parts(&self.illuminant);
            let total: f64 = all.iter().map(|p| p.weight).sum();
            let mut before = 0.0;
            let mut parts = Vec::new();
            for part in all {
                // A part is kept unless all before its end, or all after its start, is next to nothing.
                let after = total - before;
                before += part.weight;
                let inside = part.nm[0] >= range_nm[0] - SLACK_NM && part.nm[1] <= range_nm[1] + SLACK_NM;
                if inside && before > LEFT_OUT * total && after > LEFT_OUT * total {
                    parts.push(part);
                }
            }
            let kept: f64 = parts.iter().map(|p| p.weight).sum();
            if kept <= 0.0 {
                return Err(Error::invalid(
                    format!(
                        "channel `{}` of the camera counts no light from {} to {} nm",
                        channel.name, range_nm[0], range_nm[1]
                    ),
                    "use a channel or an illuminant in that range: it is where the materials of the cell are known",
                ));
            }
            channels.push(ChannelSampling {
                name: channel.name.clone(),
                parts,
                counted: kept / total,
            });
        }
        let narrowest = channels.iter().map(ChannelSampling::width_nm).fold(f64::MAX, f64::min);
        let closer = (narrowest / STEPS_IN_A_BAND).max(CLOSEST_NM);
        Ok(placed(channels, step_nm.min(closer)))
    }
}

/// Of the narrowest channel.
const STEPS_IN_A_BAND: f64 = 4.0;
/// Wavelengths are at least so far apart (nm), unless less is asked for: an LED of 18 nm behind a lens of 60 um errs by 0.4 % of
/// the peak then.
const CLOSEST_NM: f64 = 5.0;

impl ChannelSampling {
    /// Width of a flat band with the same sum and sum of squares (nm).
    fn width_nm(&self) -> f64 {
        let sum = |of: &dyn Fn(&ChannelPart) -> f64| self.parts.iter().map(of).sum::<f64>();
        let density = |p: &ChannelPart| p.weight / (p.nm[1] - p.nm[0]);
        sum(&|p| p.weight).powi(2) / sum(&|p| p.weight * density(p))
    }
}

/// Rounding of ends of bands (nm).
const SLACK_NM: f64 = 1e-6;

/// Choose the wavelengths, and find the place of each part among them.
fn placed(mut channels: Vec<ChannelSampling>, step_nm: f64) -> Sampling {
    let ends = channels.iter().flat_map(|c| &c.parts).flat_map(|p| p.nm);
    let (low, high) = ends.fold((f64::MAX, f64::MIN), |(a, b), nm| (a.min(nm), b.max(nm)));
    let steps = ((high - low) / step_nm)
        .ceil()
        .clamp(1.0, (MOST_WAVELENGTHS - 1) as f64) as usize;
    let width = (high - low) / steps as f64;
    let mut used = vec![false; steps + 1];
    for part in channels.iter_mut().flat_map(|c| &mut c.parts) {
        let middle = 0.5 * (part.nm[0] + part.nm[1]);
        part.place = ((middle - low) / width).clamp(0.0, steps as f64);
        let below = (part.place as usize).min(steps - 1);
        if part.weight > 0.0 {
            used[below] = true;
            used[below + 1] = true;
        }
    }
    // Wavelengths that no light is near to are left out, and those above them move down.
    let wavelengths_nm = (0..=steps)
        .filter(|i| used[*i])
        .map(|i| low + width * i as f64)
        .collect();
    let index: Vec<usize> = (0..=steps).map(|i| used[..i].iter().filter(|u| **u).count()).collect();
    for channel in &mut channels {
        channel.parts.retain(|p| p.weight > 0.0);
        for part in &mut channel.parts {
            let below = (part.place as usize).min(steps - 1);
            part.place = index[below] as f64 + (part.place - below as f64);
        }
    }
    Sampling {
        wavelengths_nm,
        channels,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Led, Response};

    /// Rounding of sums over some hundred parts.
    const ROUNDING: f64 = 1e-9;

    #[test]
    fn three_bands_share_their_wavelengths() {
        let found = Camera::three_bands(5.86).sampling([300.0, 1000.0], 12.5).unwrap();
        assert_eq!(found.wavelengths_nm.len(), 25);
        assert_eq!((found.wavelengths_nm[0], found.wavelengths_nm[24]), (400.0, 700.0));
        for (channel, low) in found.channels.iter().zip([400.0, 500.0, 600.0]) {
            assert_eq!(channel.parts.len(), 100);
            assert!((channel.counted - 1.0).abs() < ROUNDING);
            // Photons of equal energy: as many as the wavelength is long.
            let total: f64 = channel.parts.iter().map(|p| p.weight).sum();
            assert!((total - 100.0 * (low + 50.0)).abs() < ROUNDING * total);
            for part in &channel.parts {
                let middle = 0.5 * (part.nm[0] + part.nm[1]);
                assert!((part.place - (middle - 400.0) / 12.5).abs() < ROUNDING);
            }
        }
    }

    #[test]
    fn wavelengths_between_diodes_are_not_simulated() {
        let camera = Camera {
            illuminant: Illuminant::Leds(
                [430.0, 640.0]
                    .map(|centre_nm| Led {
                        centre_nm,
                        width_nm: 10.0,
                        power: 1.0,
                    })
                    .to_vec(),
            ),
            channels: vec![Channel {
                name: "mono".into(),
                response: Response::Band {
                    band_nm: [400.0, 700.0],
                    efficiency: 0.5,
                },
            }],
            ..Camera::three_bands(5.86)
        };
        let found = camera.sampling([300.0, 1000.0], 12.5).unwrap();
        assert!(
            found
                .wavelengths_nm
                .iter()
                .all(|nm| (nm - 430.0).abs() < 45.0 || (nm - 640.0).abs() < 45.0)
        );
        for part in &found.channels[0].parts {
            // The wavelengths on both sides of a part are those next to it.
            let (low, share) = (part.place as usize, part.place.fract());
            let [a, b] = [0, 1].map(|k| found.wavelengths_nm[(low + k).min(found.wavelengths_nm.len() - 1)]);
            let middle = 0.5 * (part.nm[0] + part.nm[1]);
            assert!((a + share * (b - a) - middle).abs() < ROUNDING, "{part:?}");
        }
        assert!(found.channels[0].counted > 1.0 - 3.0 * LEFT_OUT);
    }

    #[test]
    fn a_channel_beyond_the_materials_is_refused_and_one_at_their_end_is_cut() {
        let camera = Camera::three_bands(5.86);
        assert!(camera.sampling([300.0, 550.0], 12.5).is_err());
        let cut = camera.sampling([450.0, 700.0], 12.5).unwrap();
        assert!(
            (cut.channels[0].counted
                - (500.0_f64.powi(2) - 450.0_f64.powi(2)) / (500.0_f64.powi(2) - 400.0_f64.powi(2)))
            .abs()
                < ROUNDING
        );
        assert_eq!(cut.wavelengths_nm[0], 450.0);
    }
}
