//! Colours: series that colour-blind readers can distinguish, and maps of equal perceived steps.

use metalith_core::srgb::encoded;

/// Number of series with a colour and dash of their own; further ones begin again.
pub const SERIES: usize = 7;

/// Map from a share between 0 and 1 to a colour.
///
/// The first and the last are straight in lightness in the Oklab space (B. Ottosson, "A perceptual color space for
/// image processing", 2020), so that equal steps of the value look equally large, also in grey print.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourMap {
    /// Dark violet through teal to light yellow, for what begins at nothing.
    Sequential,
    /// Once round the hues at one lightness, for phases: both ends are the same colour.
    Cyclic,
    /// Blue through near white to red-brown, for what departs from a middle (a share of one half).
    Diverging,
}

impl ColourMap {
    /// sRGB colour of a share; shares outside 0 to 1 count as the nearer end.
    pub fn rgb(self, share: f64) -> [u8; 3] {
        let s = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
        let (lightness, chroma, hue_deg) = match self {
            Self::Sequential => (0.20 + 0.74 * s, 0.10 + 0.07 * s, 300.0 - 192.0 * s),
            Self::Cyclic => (0.72, 0.115, 360.0 * s),
            Self::Diverging => {
                let d = 2.0 * s - 1.0;
                let hue = if d < 0.0 { 255.0 } else { 40.0 };
                (0.97 - 0.55 * d.abs(), 0.17 * d.abs().powf(0.8), hue)
            }
        };
        from_oklch(lightness, chroma, f64::to_radians(hue_deg))
    }
}

/// Oklab in polar form to sRGB, with chroma reduced until the colour can be shown.
fn from_oklch(lightness: f64, chroma: f64, hue: f64) -> [u8; 3] {
    let mut chroma = chroma;
    loop {
        let linear = oklab_to_linear(lightness, chroma * hue.cos(), chroma * hue.sin());
        if chroma < 1e-3 || linear.iter().all(|&c| (-1e-3..=1.001).contains(&c)) {
            return linear.map(|c| (255.0 * encoded(c)).round() as u8);
        }
        chroma *= 0.97;
    }
}

fn oklab_to_linear(lightness: f64, a: f64, b: f64) -> [f64; 3] {
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE lightness of an sRGB colour, by another formula than the one the maps are made with.
    fn cie_lightness([r, g, b]: [u8; 3]) -> f64 {
        let linear = |c: u8| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        };
        let y = 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
        if y > 216.0 / 24389.0 {
            116.0 * y.cbrt() - 16.0
        } else {
            y * 24389.0 / 27.0
        }
    }

    /// Steps of 1/16 may differ this much from the mean in CIE L*: two lightness scales never agree fully.
    const UNEVEN: f64 = 0.45;

    /// CIE L* runs from 0 to 100, and a step of one is just visible: a step of 1/16 must be seen at a glance.
    const LEAST_STEP: f64 = 3.0;

    #[test]
    fn a_turn_ends_where_it_began() {
        assert_eq!(ColourMap::Cyclic.rgb(0.0), ColourMap::Cyclic.rgb(1.0));
        let apart = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).map(|(&a, b)| a.abs_diff(b)).max().unwrap();
        for i in 0..4 {
            let (here, opposite) = (f64::from(i) / 8.0, f64::from(i) / 8.0 + 0.5);
            assert!(apart(ColourMap::Cyclic.rgb(here), ColourMap::Cyclic.rgb(opposite)) > 60);
        }
    }

    #[test]
    fn equal_steps_of_value_are_equal_steps_of_lightness() {
        for (map, shares) in [(ColourMap::Sequential, 0..16), (ColourMap::Diverging, 0..8)] {
            let n = shares.len() as f64;
            let at = |i: i32| cie_lightness(map.rgb(f64::from(i) / 16.0));
            let mean = (at(shares.end) - at(shares.start)) / n;
            assert!(mean > LEAST_STEP, "{map:?}: {mean}");
            for i in shares {
                let step = at(i + 1) - at(i);
                assert!(
                    (step - mean).abs() < UNEVEN * mean,
                    "{map:?} step {i}: {step} of {mean}"
                );
            }
        }
        let (low, high) = (ColourMap::Diverging.rgb(0.0), ColourMap::Diverging.rgb(1.0));
        // Of 100 from black to white: neither sign looks stronger than the other.
        const ENDS: f64 = 6.0;
        assert!((cie_lightness(low) - cie_lightness(high)).abs() < ENDS);
    }
}
