//! A camera cut into wavelengths that are simulated, and narrow parts of its channels between them.

use metalith_core::{Error, Result, lagrange_weight};

use crate::{Camera, Channel, Illuminant};

/// Width of a part of a channel (nm): weights and the place of the chief ray are linear within it.
const PART_NM: f64 = 1.0;
/// Most parts of a channel, and most wavelengths that are simulated; beyond them both become wider.
const MOST_PARTS: f64 = 2000.0;
const MOST_WAVELENGTHS: usize = 100;
/// Share of the weight of a channel that is left out at each of its ends.
const LEFT_OUT: f64 = 1e-3;
/// Share of a narrow band that is left out: with a thousandth, the image of a point in the light of an LED of 33 nm
/// errs by 9e-4 of the peak behind a wedge of 15 degrees, with this by 2e-4 (lens of 60 um).
const LEFT_OUT_OF_NARROW: f64 = 1e-4;
/// Largest move of the edge of an image that is out of focus from one wavelength of a narrow band to the next, relative
/// to what a sensor resolves: a pixel, or the finest image of the lens. Behind a lens of 140 um in pixels of 0.5 um,
/// LEDs of 18 and 33 nm make spots that are wrong by 5e-4 and 2e-4 of the peak with 0.4, where twice as much made them
/// wrong by up to 5e-2.
const MOVED: f64 = 0.4;

/// Places within a part at which its weight is taken.
const WITHIN: usize = 8;

/// The wavelengths that a camera is simulated at, common to all its channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// Wavelengths (nm), rising.
    pub wavelengths_nm: Vec<f64>,
    /// Channels in the order of the camera's.
    pub channels: Vec<ChannelSampling>,
    /// Rule by which images of a point between these wavelengths follow from those at them.
    pub blend: Blend,
}

/// Rule by which the image of a point at a wavelength follows from its images at others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// A mean of the two next to it.
    Linear,
    /// The cubic through the four next to it, in narrow bands. Behind a lens of 60 um a mean errs by 1 % of the peak
    /// for an LED of 18 nm, with wavelengths 7 nm apart; a cubic by less than a thousandth.
    Cubic,
}

/// Steps between simulated wavelengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WavelengthSteps {
    /// Largest step (nm).
    pub most_nm: f64,
    /// Share of a wavelength in a narrow band by which the edge of an image moves by [`MOVED`] pixels, and by as many of the finest
    /// images of the lens in light of 1 um.
    image: [f64; 2],
}

impl From<f64> for WavelengthSteps {
    /// Steps of at most so much (nm), whatever the lens.
    fn from(most_nm: f64) -> Self {
        Self {
            most_nm,
            image: [f64::INFINITY; 2],
        }
    }
}

impl WavelengthSteps {
    /// The largest distance of wavelengths that polychromatic figures and pictures are simulated with (nm): eight intervals over a
    /// channel of 100 nm. How much this weighs is reported for each channel.
    pub const USUAL_NM: f64 = 12.5;

    /// Steps behind lenses of these radii and focal lengths (um), in pixels of this size (um): the closest that any of
    /// the lenses needs.
    ///
    /// The focus of a metalens moves by the share that the wavelength does, and the edge of the light about it by that share of the
    /// radius.
    #[must_use]
    pub fn behind(self, lenses: impl IntoIterator<Item = [f64; 2]>, pixel_um: f64) -> Self {
        let each = |[pixel, finest]: [f64; 2], [radius_um, focal_length_um]: [f64; 2]| {
            [
                pixel.min(MOVED * pixel_um / radius_um),
                finest.min(MOVED * focal_length_um / (2.0 * radius_um * radius_um)),
            ]
        };
        Self {
            image: lenses.into_iter().fold(self.image, each),
            ..self
        }
    }

    /// Step in a narrow band that begins at a wavelength (nm).
    fn narrow_nm(&self, first_nm: f64) -> f64 {
        let [pixel, finest] = self.image;
        first_nm * pixel.max(finest * first_nm * 1e-3)
    }
}

impl Blend {
    /// Wavelengths that an image is made of.
    fn wavelengths(self) -> usize {
        match self {
            Self::Linear => 2,
            Self::Cubic => 4,
        }
    }
}

/// Lagrange's weight of the value at `i` in the polynomial through those at 0, 1, 2, ... of so many, at a place `u`.
pub fn lagrange(i: usize, count: usize, u: f64) -> f64 {
    lagrange_weight(u, i as f64, (0..count).filter(|j| *j != i).map(|j| j as f64))
}

impl Sampling {
    /// Wavelengths, by their indices, that an image at a place among them ([`ChannelPart::place`]) is a weighted sum
    /// of, with their weights. They are equally far apart; where too few are, next to a gap, they are fewer.
    pub fn blended(&self, place: f64) -> Vec<(usize, f64)> {
        let nm = &self.wavelengths_nm;
        let last = nm.len() - 1;
        let low = (place.max(0.0) as usize).min(last);
        if low == last {
            return vec![(last, 1.0)];
        }
        let step = nm[low + 1] - nm[low];
        let alike = |i: &usize| (nm[i + 1] - nm[*i] - step).abs() < SLACK_NM;
        let first = (0..low).rev().take_while(alike).last().unwrap_or(low);
        let end = (low + 1..last).take_while(alike).last().unwrap_or(low) + 1;
        let count = self.blend.wavelengths().min(end + 1 - first);
        // As many on one side as on the other, unless they end there.
        let start = (low + 1).saturating_sub(count / 2).clamp(first, end + 1 - count);
        let u = place - start as f64;
        (0..count).map(|i| (start + i, lagrange(i, count, u))).collect()
    }

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
    /// Ends (nm).
    pub nm: [f64; 2],
    /// Weight of its light in the channel, in any scale: photons times efficiency.
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

    /// True if it counts any light of an illuminant.
    pub(crate) fn counts_any(&self, illuminant: &Illuminant) -> bool {
        self.parts(illuminant).iter().any(|p| p.weight > 0.0)
    }
}

impl Camera {
    /// Wavelengths for all channels, within `range_nm`: at most so far apart, and closer where a channel counts
    /// light of a narrow band, a quarter of it and what the lens asks for, for images of a point change within it. Between wavelengths
    /// that are closer images follow a cubic.
    ///
    /// # Errors
    /// If a channel counts no light in this range.
    pub fn sampling(&self, range_nm: [f64; 2], steps: impl Into<WavelengthSteps>) -> Result<Sampling> {
        let steps = steps.into();
        let step_nm = steps.most_nm;
        let mut channels = Vec::new();
        for channel in &self.channels {
            let all = channel.parts(&self.illuminant);
            let total: f64 = all.iter().map(|p| p.weight).sum();
            let left_out = if width_nm(&all) < STEPS_IN_A_BAND * step_nm {
                LEFT_OUT_OF_NARROW
            } else {
                LEFT_OUT
            };
            let mut before = 0.0;
            let mut parts = Vec::new();
            for part in all {
                // A part is kept unless all before its end, or all after its start, is next to nothing.
                let after = total - before;
                before += part.weight;
                let inside = part.nm[0] >= range_nm[0] - SLACK_NM && part.nm[1] <= range_nm[1] + SLACK_NM;
                if inside && before > left_out * total && after > left_out * total {
                    parts.push(part);
                }
            }
            let kept: f64 = parts.iter().map(|p| p.weight).sum();
            if kept <= 0.0 {
                let [short, long] = range_nm.map(|nm| (nm * 10.0).round() / 10.0);
                return Err(Error::refused(
                    "camera/channel-without-light",
                    format!(
                        "channel `{}` of the camera counts no light from {short} to {long} nm",
                        channel.name
                    ),
                    "use a channel or an illuminant in that range: it is the band of the design (`band_nm` of [cell], or about its \
                     wavelengths), as far as its materials are known",
                ));
            }
            channels.push(ChannelSampling {
                name: channel.name.clone(),
                parts,
                counted: kept / total,
            });
        }
        let narrowest = channels.iter().map(|c| width_nm(&c.parts)).fold(f64::MAX, f64::min);
        let closer = (narrowest / STEPS_IN_A_BAND).max(CLOSEST_NM);
        let blend = if closer < step_nm { Blend::Cubic } else { Blend::Linear };
        let first_nm = channels.iter().filter_map(|c| c.parts.first()).map(|p| p.nm[0]);
        let of_image_nm = match blend {
            Blend::Cubic => steps.narrow_nm(first_nm.fold(f64::MAX, f64::min)),
            Blend::Linear => f64::INFINITY,
        };
        Ok(placed(channels, step_nm.min(closer).min(of_image_nm), blend))
    }
}

/// Number of steps in the narrowest channel.
const STEPS_IN_A_BAND: f64 = 4.0;
/// Wavelengths are at least so far apart (nm), unless less is asked for or the lens makes other images within it.
const CLOSEST_NM: f64 = 5.0;

/// Width of a flat band with the same sum and sum of squares as these parts (nm); nothing of parts without weight.
fn width_nm(parts: &[ChannelPart]) -> f64 {
    let sum = |of: &dyn Fn(&ChannelPart) -> f64| parts.iter().map(of).sum::<f64>();
    let density = |p: &ChannelPart| p.weight / (p.nm[1] - p.nm[0]);
    let squares = sum(&|p| p.weight * density(p));
    if squares > 0.0 {
        sum(&|p| p.weight).powi(2) / squares
    } else {
        0.0
    }
}

/// Rounding of ends of bands (nm).
const SLACK_NM: f64 = 1e-6;

/// Choose the wavelengths, and find the place of each part among them.
fn placed(mut channels: Vec<ChannelSampling>, step_nm: f64, blend: Blend) -> Sampling {
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
        blend,
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
        // A cubic comes back from its values at wavelengths, and the gap between both diodes is in none of the sums.
        assert_eq!(found.blend, Blend::Cubic);
        let cubic = |nm: f64| ((nm - 530.0) * 1e-2).powi(3) - (nm - 400.0) * 1e-2;
        for part in &found.channels[0].parts {
            let middle = 0.5 * (part.nm[0] + part.nm[1]);
            let terms = found.blended(part.place);
            assert_eq!(terms.len(), 4);
            let spread = found.wavelengths_nm[terms[3].0] - found.wavelengths_nm[terms[0].0];
            assert!(spread < 4.0 * 12.5, "{part:?}");
            let sum: f64 = terms.iter().map(|(i, w)| w * cubic(found.wavelengths_nm[*i])).sum();
            assert!((sum - cubic(middle)).abs() < ROUNDING, "{part:?}: {sum}");
        }
    }

    /// The larger the lens, the closer the wavelengths of a narrow band; those of daylight stay.
    #[test]
    fn wavelengths_of_a_narrow_band_are_as_close_as_the_lens_asks_for() {
        let daylight = Camera::three_bands(0.5);
        let lamp = Camera {
            illuminant: Illuminant::Leds(vec![Led {
                centre_nm: 455.0,
                width_nm: 18.0,
                power: 1.0,
            }]),
            channels: daylight.channels[..1].to_vec(),
            ..daylight.clone()
        };
        let steps = |radius_um: f64, focal_um: f64, pixel_um: f64| {
            WavelengthSteps::from(12.5).behind([[radius_um, focal_um]], pixel_um)
        };
        let apart = |camera: &Camera, steps: WavelengthSteps| {
            let found = camera.sampling([300.0, 1000.0], steps).unwrap();
            found.wavelengths_nm[1] - found.wavelengths_nm[0]
        };
        let first_nm = lamp.sampling([300.0, 1000.0], 12.5).unwrap().wavelengths_nm[0];
        for (radius_um, focal_um, pixel_um) in [(70.0, 336.0, 0.5), (500.0, 2400.0, 5.86)] {
            let finest_um = f64::max(pixel_um, first_nm * 1e-3 * focal_um / (2.0 * radius_um));
            let found = apart(&lamp, steps(radius_um, focal_um, pixel_um));
            let moved = radius_um * found / first_nm / finest_um;
            assert!(
                moved < MOVED + ROUNDING && moved > 0.9 * MOVED,
                "{radius_um} {pixel_um}: {moved}"
            );
            assert_eq!(
                apart(&daylight, steps(radius_um, focal_um, pixel_um)),
                apart(&daylight, 12.5.into())
            );
        }
        // A small lens changes nothing.
        assert_eq!(apart(&lamp, steps(30.0, 144.0, 5.86)), apart(&lamp, 12.5.into()));
    }

    /// Daylight is the mean of two, and at the end of a band the last alone is in force.
    #[test]
    fn broad_light_is_blended_by_two() {
        let found = Camera::three_bands(5.86).sampling([300.0, 1000.0], 12.5).unwrap();
        assert_eq!(found.blend, Blend::Linear);
        assert_eq!(found.blended(3.25), [(3, 0.75), (4, 0.25)]);
        assert_eq!(found.blended(24.0), [(24, 1.0)]);
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
