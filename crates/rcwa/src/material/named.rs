//! Materials that can be named: published fits, each with its source and its range.

use super::dispersion::Dispersion;
use super::table;

/// A named material: name, source, formula.
pub(super) struct NamedMaterial {
    pub name: &'static str,
    pub source: &'static str,
    pub form: fn() -> Dispersion,
}

/// Materials that a design can name. Each is the published fit, in its published range.
pub(super) const KNOWN: &[NamedMaterial] = &[
    NamedMaterial {
        name: "sin_luke_2015",
        source: "silicon nitride, LPCVD film: Luke et al., Opt. Lett. 40, 4823 (2015)",
        form: || Dispersion::Sellmeier {
            terms: vec![(3.0249, 0.135_340_6), (40314.0, 1239.842)],
            range_um: (0.310, 5.504),
        },
    },
    NamedMaterial {
        name: "sin_philipp_1973",
        source: "silicon nitride: Philipp, J. Electrochem. Soc. 120, 295 (1973)",
        form: || Dispersion::Sellmeier {
            terms: vec![(2.8939, 0.139_67)],
            range_um: (0.207, 1.24),
        },
    },
    NamedMaterial {
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
    NamedMaterial {
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
    NamedMaterial {
        name: "alumina_zhukovsky_2015",
        source: "amorphous alumina film, ALD: Cauchy fit, to 1e-5 in n, of the data of Zhukovsky et al., \
                 Phys. Rev. Lett. 115, 177402 (2015)",
        form: || Dispersion::Cauchy {
            coefficients: vec![1.611_862_08, 5.221_481_2e-3, 5.521_611e-5, 1.888_894e-6],
            range_um: (0.30, 1.0),
        },
    },
    NamedMaterial {
        name: "sin_poor_vogt_2015",
        source: "silicon nitride, n = 1.91 at 633 nm: film 1 of Vogt, thesis, Leibniz Universitaet Hannover (2015)",
        form: || film(include_str!("films/sin_poor.csv")),
    },
    NamedMaterial {
        name: "sin_rich_vogt_2015",
        source: "silicon nitride, n = 2.13 at 633 nm: film 3 of Vogt, thesis, Leibniz Universitaet Hannover (2015)",
        form: || film(include_str!("films/sin_rich.csv")),
    },
    NamedMaterial {
        name: "a_si_pierce_1972",
        source: "amorphous silicon, evaporated film: Pierce and Spicer, Phys. Rev. B 5, 3017 (1972), as sampled in Palik's \
                 Handbook of Optical Constants of Solids (1985)",
        form: || film(include_str!("films/a_si.csv")),
    },
    NamedMaterial {
        name: "c_si_salzberg_1957",
        source: "crystalline silicon: Salzberg and Villa, J. Opt. Soc. Am. 47, 244 (1957), formula by Tatian, Appl. Opt. 23, \
                 4477 (1984)",
        form: || Dispersion::Sellmeier {
            terms: vec![
                (10.668_429_3, 0.301_516_485),
                (0.003_043_474_8, 1.134_751_15),
                (1.541_334_08, 1104.0),
            ],
            range_um: (1.357, 11.04),
        },
    },
    NamedMaterial {
        name: "tio2_siefke_2016",
        source: "titanium dioxide, ALD film: Siefke et al., Adv. Opt. Mater. 4, 1780 (2016)",
        form: || film(include_str!("films/tio2_ald.csv")),
    },
    NamedMaterial {
        name: "tio2_rutile_devore_1951",
        source: "rutile, ordinary ray: Devore, J. Opt. Soc. Am. 41, 416 (1951)",
        // n^2 = 5.913 + 0.2441 / (L^2 - 0.0803), as a constant and one resonance.
        form: || Dispersion::Sellmeier {
            terms: vec![
                (5.913 - 1.0 - 0.2441 / 0.0803, 0.0),
                (0.2441 / 0.0803, 0.0803_f64.sqrt()),
            ],
            range_um: (0.43, 1.53),
        },
    },
    NamedMaterial {
        name: "gan_barker_1973",
        source: "gallium nitride, ordinary ray: Barker and Ilegems, Phys. Rev. B 7, 743 (1973)",
        form: || Dispersion::Sellmeier {
            terms: vec![(2.60, 0.0), (1.75, 0.256), (4.1, 17.86)],
            range_um: (0.35, 10.0),
        },
    },
    NamedMaterial {
        name: "nb2o5_lemarchand_2013",
        source: "niobium pentoxide, sputtered film: Lemarchand (2013), measured as in Gao et al., Opt. Express 20, 15734 (2012)",
        form: || film(include_str!("films/nb2o5.csv")),
    },
    NamedMaterial {
        name: "air",
        source: "n = 1",
        form: || Dispersion::Constant { n: 1.0, k: 0.0 },
    },
];

/// A film that is known by measured samples, not by a formula.
fn film(table: &str) -> Dispersion {
    let samples = table::parse(table).expect("the program's own tables are right");
    Dispersion::Table { samples }
}

/// Formulas and words of the field, in small letters and without signs, each with the material that is meant.
const WORDS: [(&str, &str); 22] = [
    ("sin", "sin_luke_2015"),
    ("si3n4", "sin_luke_2015"),
    ("siliconnitride", "sin_luke_2015"),
    ("tio2", "tio2_siefke_2016"),
    ("titania", "tio2_siefke_2016"),
    ("titaniumdioxide", "tio2_siefke_2016"),
    ("rutile", "tio2_rutile_devore_1951"),
    ("asi", "a_si_pierce_1972"),
    ("amorphoussilicon", "a_si_pierce_1972"),
    ("si", "c_si_salzberg_1957"),
    ("csi", "c_si_salzberg_1957"),
    ("silicon", "c_si_salzberg_1957"),
    ("gan", "gan_barker_1973"),
    ("galliumnitride", "gan_barker_1973"),
    ("nb2o5", "nb2o5_lemarchand_2013"),
    ("sio2", "fused_silica_malitson_1965"),
    ("fusedsilica", "fused_silica_malitson_1965"),
    ("quartz", "fused_silica_malitson_1965"),
    ("al2o3", "alumina_zhukovsky_2015"),
    ("alumina", "alumina_zhukovsky_2015"),
    ("sapphire", "alumina_malitson_dodge_1972"),
    ("vacuum", "air"),
];

fn plain(name: &str) -> String {
    let letters = name.chars().filter(char::is_ascii_alphanumeric);
    letters.map(|c| c.to_ascii_lowercase()).collect()
}

/// See [`super::Material::own_name`].
pub(super) fn own_name(name: &str) -> Option<&'static str> {
    let word = plain(name);
    let own = KNOWN.iter().map(|known| known.name).find(|own| plain(own) == word);
    own.or_else(|| WORDS.iter().find(|(known, _)| *known == word).map(|(_, own)| *own))
}

/// All names, those first that share most pairs of letters with a name.
pub(super) fn nearest_first(name: &str) -> Vec<&'static str> {
    let pairs = |text: &str| {
        plain(text)
            .as_bytes()
            .windows(2)
            .map(<[u8]>::to_vec)
            .collect::<Vec<_>>()
    };
    let asked = pairs(name);
    let shared = |text: &str| {
        let own = pairs(text);
        asked.iter().filter(|pair| own.contains(pair)).count()
    };
    let words = |own: &str| {
        WORDS
            .iter()
            .filter(|(_, of)| *of == own)
            .map(|(word, _)| shared(word))
            .max()
    };
    let mut names: Vec<_> = KNOWN.iter().map(|known| known.name).collect();
    names.sort_by_key(|own| std::cmp::Reverse(shared(own).max(words(own).unwrap_or(0))));
    names
}
