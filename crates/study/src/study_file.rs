//! The file of a study, read with a place for every mistake.

use std::path::{Path, PathBuf};

use metalith_calibrate::{Effect, RENAMED_EFFECTS, Stage, of_any_chip};
use metalith_core::Result;
use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};
use metalith_verify::Sense;
use metalith_wave::Accuracy;

use crate::designs::{self, DesignGrid, design_grid};
use crate::picture::{PictureSpec, picture_spec};

/// Version of the format that is read.
const SCHEMA: i64 = 1;

/// Most draws of a study.
const MOST_DRAWS: i64 = 10_000_000;

/// Any amount, in any unit.
const AMOUNT: Limits = Limits::new(-1e6..=1e6, "");

/// Normal distributions end here: a process with a tail beyond is not described by one (standard deviations).
pub(crate) const TAIL_SD: f64 = 3.0;

/// Tolerance: what varies, what is looked at, and how often.
#[derive(Clone, Debug, PartialEq)]
pub struct Tolerance {
    /// The file it was read from.
    pub path: PathBuf,
    pub design: PathBuf,
    /// The pillar layout; written from the design if left out.
    pub layout: Option<PathBuf>,
    /// The calibrated model that varied quantities depart from.
    pub model: Option<PathBuf>,
    /// Draws at each point of the grid.
    pub draws: u64,
    pub accuracy: Accuracy,
    pub varied: Vec<Varied>,
    pub grids: Vec<Grid>,
    /// Keys of the design that vary.
    pub design_grids: Vec<DesignGrid>,
    /// The picture that each draw takes.
    pub picture: Option<PictureSpec>,
    /// Limits on figures, beside those of the design.
    pub limits: Vec<FigureLimit>,
}

/// An effect of the calibration with a distribution.
#[derive(Clone, Debug, PartialEq)]
pub struct Varied {
    /// Name of the effect.
    pub effect: String,
    /// Distribution of each of its parameters, independently, in the unit of the effect.
    pub distribution: Distribution,
}

/// Source of amounts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distribution {
    /// Mean and standard deviation, without what is beyond three of them or not physical.
    Normal { mean: f64, sd: f64 },
    /// Every amount between two alike.
    Uniform { low: f64, high: f64 },
}

/// An effect at each of some amounts.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    pub effect: String,
    pub values: Vec<f64>,
}

/// A limit on a figure of a draw.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureLimit {
    /// Key of the figure, such as `strehl_530nm_0deg`.
    pub figure: String,
    pub sense: Sense,
    pub limit: f64,
}

/// The effects that a study can vary: those that PSFs of a wavelength and a point show.
pub(crate) fn effects() -> Vec<Box<dyn Effect>> {
    let seen = |e: &dyn Effect| e.stage() != Stage::Source && e.name() != "source_size";
    of_any_chip().into_iter().filter(|e| seen(e.as_ref())).collect()
}

impl Tolerance {
    /// Read the file at `path`.
    ///
    /// # Errors
    /// Every mistake of the file at once, each with line, column and remedy.
    pub fn read(path: &Path) -> Result<Self> {
        let text = load(path)?;
        Document::read(path, &text, |root| Self::sections(path, root))
    }

    /// The keys of a study file.
    pub fn keys() -> KeyTable {
        explore(&[], |root, path| Self::sections(path, root))
    }

    fn sections(path: &Path, root: &Section<'_, '_>) -> Self {
        root.integer("schema", SCHEMA..=SCHEMA, "");
        let known = effects();
        let mut used: Vec<String> = Vec::new();
        let mut once = |section: &Section<'_, '_>, name: &str| {
            if used.iter().any(|u| u == name) {
                let at = if section.has("key") { "key" } else { "effect" };
                section.fault(at, format!("`{name}` varies twice"), "keep one of the two");
            }
            used.push(name.to_owned());
        };
        let varied: Vec<Varied> = root
            .sections("vary")
            .iter()
            .map(|s| vary(s, &known, &mut once))
            .collect();
        let (of_design, of_effects): (Vec<_>, Vec<_>) = root.sections("grid").into_iter().partition(|s| s.has("key"));
        let grids: Vec<Grid> = of_effects.iter().map(|s| grid(s, &known, &mut once)).collect();
        let design_grids: Vec<DesignGrid> = of_design
            .iter()
            .map(|s| {
                let grid = design_grid(s);
                once(s, &grid.key);
                grid
            })
            .collect();
        if varied.is_empty() && grids.is_empty() && design_grids.is_empty() {
            root.fault(
                "vary",
                "nothing varies",
                "add one [[vary]] with `effect` and `distribution` for each quantity",
            );
        }
        let draws = root.integer("draws", 1..=MOST_DRAWS, "draws") as u64;
        let sizes = grids.iter().map(|g| g.values.len() as u64);
        let points = sizes.fold(designs::count(&design_grids), u64::saturating_mul);
        if points.saturating_mul(draws) > MOST_DRAWS as u64 {
            root.fault(
                "draws",
                format!("{draws} draws at each of {points} points of the grid"),
                format!("give fewer draws or values: a study has {MOST_DRAWS} draws at the most"),
            );
        }
        let file = |key: &str| root.optional_file(key);
        let design = root.file("design");
        let layout = file("layout");
        if let (Some(first), Some(_)) = (of_design.first(), &layout) {
            first.fault(
                "key",
                "the design varies, and one layout is given",
                "leave out `layout`: each design writes its own",
            );
        }
        designs::check(&design, root, &of_design, &design_grids);
        Self {
            path: path.to_owned(),
            design,
            layout,
            model: file("model"),
            draws,
            accuracy: root.choice(
                "accuracy",
                &[("fast", Accuracy::Fast), ("accurate", Accuracy::Accurate)],
                Some(Accuracy::Fast),
            ),
            picture: root.optional_section("picture").map(|s| picture_spec(&s)),
            limits: root.sections("limit").iter().map(limit).collect(),
            varied,
            grids,
            design_grids,
        }
    }
}

/// The effect that a section names.
fn effect<'e>(s: &Section<'_, '_>, known: &'e [Box<dyn Effect>]) -> &'e dyn Effect {
    let names: Vec<String> = known.iter().map(|e| e.name()).collect();
    let choices: Vec<(&str, usize)> = names.iter().enumerate().map(|(k, n)| (n.as_str(), k)).collect();
    for (old, new) in RENAMED_EFFECTS {
        s.renamed(old, new);
    }
    known[s.choice("effect", &choices, None)].as_ref()
}

/// Amounts must be what an effect can be.
fn physical(s: &Section<'_, '_>, key: &str, effect: &dyn Effect, amount: f64) {
    let range = effect.parameters()[0].range;
    let parameter = effect.parameter(amount);
    if !(range.0..=range.1).contains(&parameter) {
        s.fault(
            key,
            format!("`{}` cannot be {amount} {}", effect.name(), effect.unit()),
            "give an amount that a chip can have; the table of effects in docs/guide/study.md has the ranges",
        );
    }
}

fn vary(s: &Section<'_, '_>, known: &[Box<dyn Effect>], once: &mut dyn FnMut(&Section<'_, '_>, &str)) -> Varied {
    let effect = effect(s, known);
    if s.sound(&["vary.effect"]) {
        once(s, &effect.name());
    }
    let normal = s.choice("distribution", &[("normal", true), ("uniform", false)], None);
    let distribution = if normal {
        let mean = s.float_or("mean", AMOUNT, 0.0);
        let sd = s.float("sd", Limits::new(1e-9..=1e6, ""));
        physical(s, "mean", effect, mean);
        Distribution::Normal { mean, sd }
    } else {
        let (low, high) = (s.float("low", AMOUNT), s.float("high", AMOUNT));
        if low >= high {
            s.fault_given(
                &["vary.low", "vary.high"],
                "high",
                "the highest amount is not above the lowest",
                "give `low` below `high`",
            );
        }
        physical(s, "low", effect, low);
        physical(s, "high", effect, high);
        Distribution::Uniform { low, high }
    };
    Varied {
        effect: effect.name(),
        distribution,
    }
}

fn grid(s: &Section<'_, '_>, known: &[Box<dyn Effect>], once: &mut dyn FnMut(&Section<'_, '_>, &str)) -> Grid {
    let effect = effect(s, known);
    if s.sound(&["grid.effect"]) {
        once(s, &effect.name());
    }
    let mut values = s.floats("values", AMOUNT);
    if effect.parameters().len() > 1 {
        s.fault(
            "effect",
            format!("`{}` has {} parameters", effect.name(), effect.parameters().len()),
            "give it a distribution with [[vary]]; a grid is over effects of one parameter",
        );
    }
    if values.is_empty() {
        s.fault(
            "values",
            "a grid without values",
            "give the amounts, such as `values = [-5, 0, 5]`",
        );
        values.push(0.0);
    }
    for value in &values {
        physical(s, "values", effect, *value);
    }
    Grid {
        effect: effect.name(),
        values,
    }
}

fn limit(s: &Section<'_, '_>) -> FigureLimit {
    let figure = s.text("figure");
    let (least, most) = (
        s.optional_float("at_least", AMOUNT),
        s.optional_float("at_most", AMOUNT),
    );
    let (sense, limit) = match (least, most) {
        (Some(limit), None) => (Sense::AtLeast, limit),
        (None, Some(limit)) => (Sense::AtMost, limit),
        _ => {
            s.fault(
                "figure",
                "a limit has one side",
                "give `at_least` or `at_most`, not both",
            );
            (Sense::AtLeast, 0.0)
        }
    };
    FigureLimit { figure, sense, limit }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::{Error, FaultKind};

    const GOOD: &str = r#"
schema = 1
design = "d.toml"
draws = 10
[[vary]]
effect = "cd_bias"
distribution = "normal"
sd = 3.0
[[vary]]
effect = "tilt"
distribution = "uniform"
low = -2.0
high = 2.0
[[grid]]
effect = "defocus"
values = [-5, 0, 5]
[[limit]]
figure = "strehl_530nm_0deg"
at_least = 0.6
"#;

    fn read(text: &str) -> Result<Tolerance> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("d.toml"), "").unwrap();
        let path = folder.path().join("tolerance.toml");
        std::fs::write(&path, text).unwrap();
        Tolerance::read(&path)
    }

    /// Fault at a key.
    fn fault(error: &Error, key: &str) -> String {
        let Error::Text(faults) = error else {
            panic!("{error}");
        };
        let at = |f: &&metalith_core::Fault| f.kind == FaultKind::Inconsistent && f.key == key;
        faults
            .faults()
            .iter()
            .find(at)
            .unwrap_or_else(|| panic!("{faults}"))
            .what
            .clone()
    }

    #[test]
    fn a_file_is_read() {
        let read = read(GOOD).unwrap();
        assert_eq!(read.varied[0].distribution, Distribution::Normal { mean: 0.0, sd: 3.0 });
        assert_eq!(read.grids[0].values, [-5.0, 0.0, 5.0]);
        assert_eq!(read.limits[0].sense, Sense::AtLeast);
    }

    #[test]
    fn all_mistakes_are_told_at_once() {
        let bad = GOOD
            .replace("\"cd_bias\"", "\"cd_bia\"")
            .replace("high = 2.0", "high = -3.0")
            .replace("[-5, 0, 5]", "[-500]")
            .replace("at_least", "at_leas");
        let error = read(&bad).unwrap_err();
        for (kind, key) in [
            (FaultKind::UnknownChoice, "vary#0.effect"),
            (FaultKind::Inconsistent, "vary#1.high"),
            (FaultKind::Inconsistent, "grid#0.values"),
            (FaultKind::Inconsistent, "limit#0.figure"),
        ] {
            assert!(error.has_fault(kind, key), "{kind:?} {key}: {error}");
        }
    }

    /// The file with these grids, beside a design that can be read.
    fn of_a_design(grids: &str) -> Result<Tolerance> {
        let folder = tempfile::tempdir().unwrap();
        let design = concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs/mini_3x3.toml");
        let text = std::fs::read_to_string(design).unwrap();
        let text = text.replacen("[mapping]", "[mapping]\naccept = \"heights of a grid\"", 1);
        std::fs::write(folder.path().join("d.toml"), text).unwrap();
        let path = folder.path().join("tolerance.toml");
        std::fs::write(&path, format!("{GOOD}{grids}")).unwrap();
        Tolerance::read(&path)
    }

    #[test]
    fn draws_at_all_points_are_counted() {
        let values: Vec<String> = (0..1000).map(|k| format!("{}", f64::from(k) * 1e-3)).collect();
        let grids: String = ["stray_light", "missing_pillars", "residual_mask", "pixel_blur"]
            .map(|effect| {
                format!(
                    "[[grid]]\neffect = \"{effect}\"\nvalues = [{}]\n",
                    values[..200].join(", ")
                )
            })
            .concat();
        let text = GOOD.replace("draws = 10", "draws = 10000000") + &grids;
        let error = read(&text).unwrap_err();
        // 200^4, and three values of the defocus.
        insta::assert_snapshot!(fault(&error, "draws"), @"10000000 draws at each of 4800000000 points of the grid");
    }

    #[test]
    fn a_design_varies_over_a_grid() {
        let read = of_a_design(
            "[[grid]]\nkey = \"cell.pillar_height_nm\"\nvalues = [650, 700.5]\n\
             [[grid]]\nkey = \"layout.hierarchy\"\nvalues = [\"folded\", \"sref\", \"flat\"]\n",
        )
        .unwrap();
        assert_eq!(read.designs(), 6);
        let words = |k| {
            let setting = read.setting(k).into_iter();
            setting.map(|(k, v)| format!("{k}={v}")).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(words(0), "cell.pillar_height_nm=650 layout.hierarchy=folded");
        assert_eq!(words(3), "cell.pillar_height_nm=700.5 layout.hierarchy=sref");
        assert_eq!(read.grids.len(), 1, "effects have grids beside it");
    }

    #[test]
    fn a_grid_over_what_the_design_cannot_have_is_told_with_its_place() {
        // Its lines follow those of the file before.
        let line = GOOD.lines().count() + 2;
        let mut said = Vec::new();
        for (key, values, column, kind) in [
            ("cell.pillar_heigth_nm", "[650]", 7, FaultKind::Inconsistent),
            ("cell", "[650]", 7, FaultKind::Inconsistent),
            ("verify.pixel_um", "[5]", 7, FaultKind::Inconsistent),
            ("cell.pillar_height_nm", "[650, -1]", 10, FaultKind::Inconsistent),
            ("layout.hierarchy", "[\"deep\"]", 10, FaultKind::Inconsistent),
            ("cell.pillar_height_nm", "[]", 10, FaultKind::Inconsistent),
            ("cell.pillar_height_nm", "[[1]]", 11, FaultKind::WrongType),
        ] {
            let error = of_a_design(&format!("[[grid]]\nkey = \"{key}\"\nvalues = {values}\n")).unwrap_err();
            let Error::Text(faults) = error else {
                panic!("{error:?}");
            };
            // A fault of the values is one line below the key.
            let (line, name) = match column {
                7 => (line, "grid#1.key"),
                _ => (line + 1, "grid#1.values"),
            };
            let at = |f: &&metalith_core::Fault| {
                f.kind == kind && f.key == name && faults.line_column(f.span.start) == (line, column)
            };
            let fault = faults.faults().iter().find(at);
            said.push(fault.unwrap_or_else(|| panic!("{faults}")).what.clone());
        }
        // The limits of a design are in its own words.
        insta::assert_snapshot!(said.join("\n"), @r#"
        in d.toml, there is no `pillar_heigth_nm` in `cell`
        in d.toml, `cell` is a table
        `verify.pixel_um` does not vary: all draws of a study are judged alike; limits stand in [[limit]]
        with `cell.pillar_height_nm = -1` the design has a mistake: `pillar_height_nm` cannot be -1
        with `layout.hierarchy = deep` the design has a mistake: `hierarchy` cannot be "deep"
        a grid without values
        `values` is an array
        "#);
        // Each value is possible, and not both.
        let both = of_a_design(
            "[[grid]]\nkey = \"cell.width_max_nm\"\nvalues = [300, 290]\n\
             [[grid]]\nkey = \"mapping.coefficients.0\"\nvalues = [0.2923, 0.3]\n",
        );
        let both = fault(&both.unwrap_err(), "grid#2.values");
        let setting = both.split(" the design has a mistake: ").next().unwrap();
        insta::assert_snapshot!(setting, @"with `cell.width_max_nm = 290` and `mapping.coefficients.0 = 0.3`");
        let twice = of_a_design(
            "[[grid]]\nkey = \"cell.pitch_nm\"\nvalues = [350]\n[[grid]]\nkey = \"cell.pitch_nm\"\nvalues = [350]\n",
        );
        insta::assert_snapshot!(fault(&twice.unwrap_err(), "grid#2.key"), @"`cell.pitch_nm` varies twice");
        let many: Vec<String> = (0..40).map(|k| (650 + k).to_string()).collect();
        let many = many.join(", ");
        let many = of_a_design(&format!(
            "[[grid]]\nkey = \"cell.pillar_height_nm\"\nvalues = [{many}]\n\
             [[grid]]\nkey = \"lens.focal_length_um\"\nvalues = [{many}]\n"
        ));
        let many = fault(&many.unwrap_err(), "grid#1.values");
        insta::assert_snapshot!(many, @"1600 designs: each combination of these values is one");
    }

    #[test]
    fn what_psfs_of_one_wavelength_do_not_show_cannot_vary() {
        let names: Vec<String> = effects().iter().map(|e| e.name()).collect();
        assert!(names.contains(&"film_height".to_owned()), "{names:?}");
        for lamp in ["led_width", "source_size"] {
            assert!(!names.contains(&lamp.to_owned()), "{names:?}");
        }
        // No other effect may set what such PSFs do not show.
        for effect in effects() {
            let mut perturbation = metalith_optics::Perturbation::default();
            let numbers: Vec<f64> = effect.parameters().iter().map(|p| p.typical).collect();
            effect.apply(&numbers, &mut perturbation);
            assert_ne!(
                perturbation,
                metalith_optics::Perturbation::default(),
                "{}",
                effect.name()
            );
            assert_eq!(perturbation.not_applied(), [], "{}", effect.name());
        }
    }
}
