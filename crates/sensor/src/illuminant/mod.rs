//! The light of the scene.

mod d65;

use serde::Serialize;

use crate::Spectrum;

/// Spectral power of the light of a scene; the scale of each is its own.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Illuminant {
    /// CIE standard illuminant D65, daylight.
    D65,
    /// CIE standard illuminant A, an incandescent lamp.
    A,
    /// Light of the same power at every wavelength.
    EqualEnergy,
    /// A measured spectrum.
    File(Spectrum),
    /// Light-emitting diodes, each with a Gaussian spectrum.
    Leds(Vec<Led>),
}

/// One light-emitting diode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Led {
    /// Wavelength of the greatest power (nm).
    pub centre_nm: f64,
    /// Full width at half of it (nm).
    pub width_nm: f64,
    /// Power of all its light, against the others.
    pub power: f64,
}

/// Beyond so many full widths from its centre a diode gives no light: the Gaussian is 1e-11 there.
const LED_REACH: f64 = 3.0;

impl Illuminant {
    /// Spectral power at a wavelength (nm).
    pub fn power(&self, nm: f64) -> f64 {
        match self {
            Self::D65 => d65::power(nm),
            Self::A => incandescent(nm),
            Self::EqualEnergy => 1.0,
            Self::File(curve) => curve.at(nm),
            Self::Leds(leds) => leds.iter().map(|led| led.power(nm)).sum(),
        }
    }

    /// Name of it, as in a camera file.
    pub fn name(&self) -> &'static str {
        match self {
            Self::D65 => "d65",
            Self::A => "a",
            Self::EqualEnergy => "equal_energy",
            Self::File(_) => "file",
            Self::Leds(_) => "leds",
        }
    }
}

impl Led {
    fn power(&self, nm: f64) -> f64 {
        let widths = (nm - self.centre_nm) / self.width_nm;
        if widths.abs() > LED_REACH {
            return 0.0;
        }
        // Half of the peak at half a width; the area of exp(-4 ln 2 u^2) is sqrt(pi / (4 ln 2)).
        let four_ln2 = 4.0 * std::f64::consts::LN_2;
        self.power / self.width_nm * (four_ln2 / std::f64::consts::PI).sqrt() * (-four_ln2 * widths * widths).exp()
    }
}

/// CIE standard illuminant A, 100 at 560 nm (CIE 015:2018, eq. 4.1): Planck's law at 2848 K with the second constant
/// of 1931, which is 2856 K with that of today.
fn incandescent(nm: f64) -> f64 {
    const SECOND_NM_K: f64 = 1.435e7;
    const KELVIN: f64 = 2848.0;
    let planck = |nm: f64| (SECOND_NM_K / (KELVIN * nm)).exp() - 1.0;
    100.0 * (560.0 / nm).powi(5) * planck(560.0) / planck(nm)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chromaticity for the CIE 1931 standard observer.
    fn chromaticity(illuminant: &Illuminant) -> [f64; 2] {
        let mut xyz = [0.0; 3];
        for nm in (360..=830).map(f64::from) {
            let p = illuminant.power(nm);
            for (sum, v) in xyz.iter_mut().zip(crate::observer(nm)) {
                *sum += p * v;
            }
        }
        let sum: f64 = xyz.iter().sum();
        [xyz[0] / sum, xyz[1] / sum]
    }

    #[test]
    fn illuminants_have_the_chromaticity_of_the_cie() {
        /// The fit errs by up to 0.01 of a colour matching function whose area is 107 nm, over some 100 nm.
        const FIT: f64 = 0.002;
        for (illuminant, want) in [
            (Illuminant::D65, [0.3127, 0.3290]),
            (Illuminant::A, [0.44757, 0.40745]),
            (Illuminant::EqualEnergy, [1.0 / 3.0, 1.0 / 3.0]),
        ] {
            let got = chromaticity(&illuminant);
            println!("{}: {got:?}", illuminant.name());
            assert!(
                (0..2).all(|a| (got[a] - want[a]).abs() < FIT),
                "{illuminant:?}: {got:?}, not {want:?}"
            );
        }
    }

    #[test]
    fn illuminant_a_has_the_values_of_its_table() {
        // CIE 015:2018, table 5, six digits.
        const PRINTED: f64 = 1e-3;
        for (nm, want) in [(400.0, 14.7080), (560.0, 100.0), (700.0, 198.261), (780.0, 241.675)] {
            assert!((incandescent(nm) - want).abs() < PRINTED, "{nm}: {}", incandescent(nm));
        }
    }

    #[test]
    fn a_diode_has_its_width_and_its_power() {
        let led = Led {
            centre_nm: 530.0,
            width_nm: 25.0,
            power: 2.0,
        };
        let leds = Illuminant::Leds(vec![
            led,
            Led {
                centre_nm: 640.0,
                ..led
            },
        ]);
        assert!((leds.power(542.5) / leds.power(530.0) - 0.5).abs() < 1e-9);
        let all: f64 = (4000..7500).map(|i| leds.power(f64::from(i) * 0.1) * 0.1).sum();
        // What is cut off beyond three widths is 1e-12.
        assert!((all - 4.0).abs() < 1e-9, "{all}");
    }
}
