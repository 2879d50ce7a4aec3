//! Prior statistics of a scene.

/// Mean and standard deviation of a natural image, its brightest white being one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scene {
    /// Mean of the light.
    pub mean: f64,
    /// Standard deviation of the light.
    pub contrast: f64,
}

impl Default for Scene {
    /// Statistics of photographs (van der Schaaf and van Hateren, Vision Research 36, 2759 (1996)).
    fn default() -> Self {
        Self {
            mean: 0.4,
            contrast: 0.22,
        }
    }
}

impl Scene {
    /// Power of natural scenes over that at low frequencies: it falls with the square of the frequency (Field, J. Opt.
    /// Soc. Am. A 4, 2379 (1987)), levelling off below one period of the longest structure. `f2` is the square of the
    /// frequency in units of that one.
    pub fn power(f2: f64) -> f64 {
        1.0 / (1.0 + f2)
    }
}
