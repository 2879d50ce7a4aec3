//! What no effect explains, put as effects that a file could declare: patterns over the field, the wavelength or the group.
//!
//! A proposal is a guess with a size. It becomes a finding only where a selection takes it, once it is declared.

use metalith_attribution::{RefitFinding, RefitModel, RefitPlan, try_beside};
use metalith_core::{Progress, Result};
use metalith_report::sig;
use serde::Serialize;

use crate::declared::{DeclaredEffect, OF_HEIGHTS, OF_SPECTRA, Pattern, Stages};
use crate::heights::HeightModel;
use crate::spectra::SpectrumModel;

/// Most patterns that are proposed.
const MOST: usize = 3;

/// Least share of the fitted mean square that a proposed pattern removes.
const WORTH_PROPOSING: f64 = 0.02;

/// A pattern that explains a part of what effects leave.
#[derive(Clone, Debug, Serialize)]
pub struct Proposal {
    pub name: String,
    /// What the residual varies over.
    pub over: String,
    pub expression: String,
    /// Size of the pattern; of each group if these differ.
    pub size: Vec<f64>,
    pub unit: String,
    /// Root mean square of measurements left out, before and with it.
    pub held_out: [f64; 2],
    /// Share of the fitted mean square that it removes.
    pub removes: f64,
}

impl Proposal {
    /// One line for a person.
    pub fn sentence(&self) -> String {
        let sizes: Vec<String> = self.size.iter().map(|v| sig(*v, 3)).collect();
        format!(
            "proposed: `{}` = `{}` over {}, a = {}; left out {} before, {} with it",
            self.name,
            self.expression,
            self.over,
            format!("{} {}", sizes.join(", "), self.unit).trim(),
            sig(self.held_out[0], 4),
            sig(self.held_out[1], 4)
        )
    }
}

/// A model to which effects of a file can be added, and the patterns that its residual may have.
pub(crate) trait Declares: RefitModel {
    fn declare(&mut self, effects: &[DeclaredEffect]) -> Result<()>;

    /// Patterns, with a typical size and a largest one.
    fn patterns(&self) -> (Vec<Pattern>, [f64; 2]);

    fn stages(&self) -> &'static Stages;
}

fn pattern(name: &'static str, over: &'static str, stage: &'static str, expression: String) -> Pattern {
    Pattern {
        name,
        over,
        stage,
        expression,
        by_group: false,
    }
}

impl Declares for HeightModel<'_> {
    fn declare(&mut self, effects: &[DeclaredEffect]) -> Result<()> {
        HeightModel::declare(self, effects)
    }

    fn patterns(&self) -> (Vec<Pattern>, [f64; 2]) {
        let (half_um, [middle, half]) = self.extent();
        let field = |name, shape: &str| {
            let shape = shape.replace('x', &format!("(x / {half_um:.4})"));
            let shape = shape.replace('y', &format!("(y / {half_um:.4})"));
            pattern(name, "the field", "measured", format!("a * {shape}"))
        };
        let height = |name, shape: &str| {
            let shape = shape.replace('h', &format!("((h - {middle:.1}) / {half:.1})"));
            pattern(name, "the height", "printed", format!("a * {shape}"))
        };
        let mut out = vec![
            field("twist", "x * y"),
            field("cubic_x", "x^3"),
            field("cubic_y", "y^3"),
            height("height_square", "h^2"),
            height("height_cube", "h^3"),
        ];
        out.push(Pattern {
            by_group: true,
            ..pattern(
                "gain_by_group",
                "the group",
                "measured",
                format!("a * (h - {middle:.1}) / {half:.1}"),
            )
        });
        (out, [10.0, 1e4])
    }

    fn stages(&self) -> &'static Stages {
        &OF_HEIGHTS
    }
}

impl Declares for SpectrumModel<'_> {
    fn declare(&mut self, effects: &[DeclaredEffect]) -> Result<()> {
        SpectrumModel::declare(self, effects)
    }

    fn patterns(&self) -> (Vec<Pattern>, [f64; 2]) {
        let [from, to] = self.range_nm();
        let wave = |name, stage, half_waves: u32| {
            let expression = format!("a * cos({half_waves} * pi * (wavelength - {from}) / {})", to - from);
            pattern(name, "the wavelength", stage, expression)
        };
        let mut out = vec![
            wave("added_1", "added", 1),
            wave("added_2", "added", 2),
            wave("added_3", "added", 3),
            wave("added_4", "added", 4),
            wave("factor_1", "factor", 1),
            wave("factor_2", "factor", 2),
            wave("factor_3", "factor", 3),
            wave("factor_4", "factor", 4),
        ];
        let of_group = |name, stage| Pattern {
            by_group: true,
            ..pattern(name, "the group", stage, "a".into())
        };
        out.extend([
            of_group("added_by_group", "added"),
            of_group("factor_by_group", "factor"),
        ]);
        (out, [0.01, 1.0])
    }

    fn stages(&self) -> &'static Stages {
        &OF_SPECTRA
    }
}

/// Patterns of what a finding leaves, those first that predict most of what was left out, with the text of a file that declares
/// them. Patterns that an effect in use rules out, or that predict worse, are left out.
///
/// # Errors
/// If the user stopped it.
pub(crate) fn propose<M: Declares>(
    model: &mut M,
    plan: &RefitPlan,
    found: &RefitFinding,
    progress: &dyn Progress,
) -> Result<(Vec<Proposal>, String)> {
    let (patterns, sizes) = model.patterns();
    let stages = model.stages();
    let known: Vec<String> = model.effects().iter().map(|e| e.name.clone()).collect();
    let mut candidates = Vec::new();
    for own in patterns.into_iter().filter(|p| known.iter().all(|name| name != p.name)) {
        if let Some(effect) = DeclaredEffect::pattern(stages, &own, sizes) {
            candidates.push((own, effect));
        }
    }
    let effects: Vec<DeclaredEffect> = candidates.iter().map(|(_, e)| e.clone()).collect();
    model.declare(&effects)?;
    let numbers: Vec<usize> = (known.len()..known.len() + effects.len()).collect();
    let tried = try_beside(model, plan, found, &numbers, progress)?;
    let mut good: Vec<_> = tried
        .into_iter()
        .zip(&candidates)
        .filter(|(t, _)| t.rejected.is_none() && t.score > WORTH_PROPOSING)
        .collect();
    good.sort_by(|(a, _), (b, _)| b.gain.value.total_cmp(&a.gain.value));
    good.truncate(MOST);
    let last = &found.ladder[found.ladder.len() - 1];
    let worst = |own: &[Option<f64>]| own.iter().flatten().copied().fold(0.0, f64::max);
    let text: Vec<String> = good.iter().map(|(t, (_, effect))| effect.text(&t.values)).collect();
    let proposals = good.into_iter().map(|(t, (own, _))| Proposal {
        name: own.name.into(),
        over: own.over.into(),
        expression: own.expression.clone(),
        unit: model.parameters()[model.effects()[t.effect].slots[0]].unit.into(),
        held_out: [worst(&last.held_out), worst(&t.errors.held_out)],
        removes: t.score,
        size: t.values,
    });
    Ok((proposals.collect(), text.join("\n")))
}
