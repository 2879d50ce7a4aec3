//! Materials that can be named: published fits, each with its source and its range.

use super::form::Dispersion;

/// A named material: name, source, formula.
pub(super) struct Known {
    pub name: &'static str,
    pub source: &'static str,
    pub form: fn() -> Dispersion,
}

/// What can be named in a design. Each is the published fit, in its published range.
pub(super) const KNOWN: [Known; 6] = [
    Known {
        name: "sin_luke_2015",
        source: "silicon nitride, LPCVD film: Luke et al., Opt. Lett. 40, 4823 (2015)",
        form: || Dispersion::Sellmeier {
            terms: vec![(3.0249, 0.135_340_6), (40314.0, 1239.842)],
            range_um: (0.310, 5.504),
        },
    },
    Known {
        name: "sin_philipp_1973",
        source: "silicon nitride: Philipp, J. Electrochem. Soc. 120, 295 (1973)",
        form: || Dispersion::Sellmeier {
            terms: vec![(2.8939, 0.139_67)],
            range_um: (0.207, 1.24),
        },
    },
    Known {
        name: "fused_silica_malitson_1965",
        source: "fused silica: Malitson, J. Opt. Soc. Am. 55, 1205 (1965)",
        form: || Dispersion::Sellmeier {
            terms: vec![
                (0.696_166_3, 0.068_404_3),
                (0.407_942_6, 0.116_241_4),
                (0.897_479_4, 9.896_161),
            ],
            range_um: (0.21, 3.71),
        },
    },
    Known {
        name: "alumina_malitson_dodge_1972",
        source: "sapphire, ordinary ray: Malitson and Dodge, J. Opt. Soc. Am. 62, 1405 (1972)",
        form: || Dispersion::Sellmeier {
            terms: vec![
                (1.431_349_3, 0.072_663_1),
                (0.650_547_13, 0.119_324_2),
                (5.341_402_1, 18.028_251),
            ],
            range_um: (0.20, 5.0),
        },
    },
    Known {
        name: "alumina_zhukovsky_2015",
        source: "amorphous alumina film, ALD: Cauchy fit, to 1e-5 in n, of the data of Zhukovsky et al., \
                 Phys. Rev. Lett. 115, 177402 (2015)",
        form: || Dispersion::Cauchy {
            coefficients: vec![1.611_862_08, 5.221_481_2e-3, 5.521_611e-5, 1.888_894e-6],
            range_um: (0.30, 1.0),
        },
    },
    Known {
        name: "air",
        source: "n = 1",
        form: || Dispersion::Constant { n: 1.0, k: 0.0 },
    },
];
