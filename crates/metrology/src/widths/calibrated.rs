//! What was found as `model.toml`, which later designs are simulated and compensated with.

use std::collections::BTreeMap;

use metalith_attribution::{RefitFinding, RefitModel};
use metalith_optics::{CalibratedModel, DeclaredQuantity, DeclaredTerm, DoseResponse, Perturbation};

use super::model::WidthModel;
use super::set::WidthSite;
use super::terms::{
    BIAS, BORDER, CHIP_RADIAL, CHIP_X, CHIP_Y, DOSE, FIELD_RADIAL, FIELD_X, FIELD_Y, PER_WIDTH_NM, PROXIMITY, RANGE,
    REACH, WIDTH, WIDTH_SQUARE,
};
use crate::diagnosis::{Diagnosis, NotInModel};

/// Coordinates in a write field, from -1 to 1, of a place on the chip: expressions have no remainder, the arc tangent of a
/// tangent is one.
const IN_FIELD: [&str; 2] = [
    "2/pi*atan(tan(pi*((X + x - x0)/size - 0.5)))",
    "2/pi*atan(tan(pi*((Y + y - y0)/size - 0.5)))",
];

/// The model of what was found; effects that it cannot hold are added to the diagnosis.
pub(crate) fn calibrated(model: &WidthModel<'_>, found: &RefitFinding, diagnosis: &mut Diagnosis) -> CalibratedModel {
    let mut perturbation = Perturbation::default();
    let geometry = &mut perturbation.geometry;
    let (theta, terms) = (&found.theta, &model.terms);
    let mut dose = None;
    let mut declare = |name: &str, expression: String, values: &[(&str, f64)]| {
        geometry.declared.push(DeclaredTerm {
            name: name.into(),
            quantity: DeclaredQuantity::WidthNm,
            expression,
            values: values
                .iter()
                .map(|(n, v)| ((*n).to_owned(), *v))
                .collect::<BTreeMap<_, _>>(),
        });
    };
    let middle = [
        ("x0", terms.middle_um[0]),
        ("y0", terms.middle_um[1]),
        ("half", terms.half_um),
    ];
    let field = terms
        .field
        .map_or([("x0", 0.0), ("y0", 0.0), ("size", 1.0)], |(size, [x, y])| {
            [("x0", x), ("y0", y), ("size", size)]
        });
    let with = |base: &[(&'static str, f64)], own: &[(&'static str, f64)]| [base, own].concat();
    let [u, v] = IN_FIELD;
    let mut plain = (0.0, None);
    for &e in &found.chosen {
        let effect = &model.effects()[e];
        match effect.name.as_str() {
            "bias" => plain.0 = theta[BIAS],
            "proximity" => plain.1 = Some(theta[PROXIMITY]),
            "dose_slope" => dose = Some(theta[DOSE]),
            "width_slope" => declare(
                "width_slope",
                "slope*(w - pivot)".into(),
                &[("slope", theta[WIDTH] / PER_WIDTH_NM), ("pivot", terms.pivot_nm)],
            ),
            "width_square" => declare(
                "width_square",
                "square*(w - pivot)^2".into(),
                &[
                    ("square", theta[WIDTH_SQUARE] / PER_WIDTH_NM.powi(2)),
                    ("pivot", terms.pivot_nm),
                ],
            ),
            "chip_slope" => declare(
                "chip_slope",
                "(a*(X + x - x0) + b*(Y + y - y0))/half".into(),
                &with(&middle, &[("a", theta[CHIP_X]), ("b", theta[CHIP_Y])]),
            ),
            "chip_radial" => declare(
                "chip_radial",
                "a*((X + x - x0)^2 + (Y + y - y0)^2)/half^2".into(),
                &with(&middle, &[("a", theta[CHIP_RADIAL])]),
            ),
            "field_slope" => declare(
                "field_slope",
                format!("a*{u} + b*{v}"),
                &with(&field, &[("a", theta[FIELD_X]), ("b", theta[FIELD_Y])]),
            ),
            "field_radial" => declare(
                "field_radial",
                format!("a*(({u})^2 + ({v})^2)"),
                &with(&field, &[("a", theta[FIELD_RADIAL])]),
            ),
            "field_border" => declare(
                "field_border",
                format!("a*exp(-size/2*(1 - max(abs({u}), abs({v})))/reach)"),
                &with(&field, &[("a", theta[BORDER]), ("reach", theta[REACH])]),
            ),
            other => diagnosis.not_in_model.push(NotInModel {
                effect: other.into(),
                why: not_held(other).into(),
            }),
        }
    }
    geometry.cd_bias_nm = plain.0;
    if let Some(nm) = plain.1 {
        geometry.cd_bias_density_nm = nm;
        let stated = model.set.stated_range_um;
        let fitted = found.intervals[RANGE].is_some().then_some(theta[RANGE]);
        geometry.cd_bias_density_range_um = fitted.or(stated);
    }
    let mut out = CalibratedModel::new(diagnosis.set.clone(), diagnosis.sentence(), perturbation);
    out.dose = dose.map(|nm_per_percent| {
        let fitted = model.set.sites.iter().filter(|s| s.fitted);
        let (low, high) = fitted.fold((0.0_f64, 0.0_f64), |(a, b), s: &WidthSite| {
            (a.min(s.dose_percent), b.max(s.dose_percent))
        });
        DoseResponse {
            nm_per_percent,
            measured_percent: [low, high],
        }
    });
    out
}

/// Why `model.toml` does not hold an effect.
fn not_held(effect: &str) -> &'static str {
    match effect {
        "orientation" => "a pillar of the model has one bias along both axes",
        "loading" => "the model has no open area of a whole region; its bias is of a loading of zero",
        _ => "a bias of a group holds for what was measured, not for a chip to come",
    }
}
