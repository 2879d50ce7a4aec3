//! Record of one draw: amounts, figures and limits.

use std::collections::BTreeMap;

use metalith_core::document::Scalar;
use metalith_verify::{Check, Sense, Verification};
use serde::{Deserialize, Serialize};

use crate::study_file::FigureLimit;

/// One draw, as one line of JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DrawRecord {
    pub draw: u64,
    /// Amounts in the order and units of the plan's quantities.
    pub amounts: Vec<f64>,
    /// Values of the keys of the design that vary.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub design: BTreeMap<String, Scalar>,
    /// Figures by key; the worst over the elements of the array. `None` where it is not a number.
    pub figures: BTreeMap<String, Option<f64>>,
    /// Value reached for each limit of the plan, in its order; `None` where it is not a number.
    pub reached: Vec<Option<f64>>,
    /// True if all limits hold.
    pub passed: bool,
}

/// One limit of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LimitStatement {
    /// Key in the design file, or of the figure.
    pub key: String,
    pub limit: f64,
    /// True if it is the least that is allowed, not the most.
    pub at_least: bool,
}

impl LimitStatement {
    /// Statement of a limit of the design.
    pub(crate) fn of_check(check: &Check) -> Self {
        Self {
            key: check.key.into(),
            limit: check.limit,
            at_least: check.sense == Sense::AtLeast,
        }
    }

    /// Statement of a limit of the study.
    pub(crate) fn of_figure(limit: &FigureLimit) -> Self {
        Self {
            key: limit.figure.clone(),
            limit: limit.limit,
            at_least: limit.sense == Sense::AtLeast,
        }
    }

    /// True if what was reached holds it; what is not a number does not.
    pub fn holds(&self, reached: Option<f64>) -> bool {
        reached.is_some_and(|r| self.margin(r) >= 0.0)
    }

    /// Margin: distance of the value reached from the limit, positive on the right side.
    pub fn margin(&self, reached: f64) -> f64 {
        if self.at_least {
            reached - self.limit
        } else {
            self.limit - reached
        }
    }
}

/// The figures of a verification, each the worst over the elements.
pub(crate) fn figures(found: &Verification) -> BTreeMap<String, Option<f64>> {
    let mut figures: BTreeMap<String, f64> = BTreeMap::new();
    let mut worst = |key: String, value: f64, most: bool| {
        let place = figures.entry(key).or_insert(value);
        // What is not a number is worse than all.
        let worse = if most { value > *place } else { value < *place };
        if worse || value.is_nan() {
            *place = value;
        }
    };
    let reported = found.camera.as_ref().map(|c| c.frequencies().reported());
    for (k, element) in found.distinct.iter().enumerate() {
        let all = element.spots.iter();
        for (spot, field) in all.flat_map(|spot| found.asked(k, spot).into_iter().map(move |field| (spot, field))) {
            let nm = spot.wavelength_um * 1e3;
            let (x, y) = (field.x_deg, field.y_deg);
            let at = if y == 0.0 {
                format!("{nm:.0}nm_{x}deg")
            } else {
                format!("{nm:.0}nm_{x}_{y}deg")
            };
            let mtf = spot.judged().mtf();
            worst(format!("strehl_{at}"), spot.judged().metrics.strehl, false);
            worst(
                format!("energy_1_pixel_{at}"),
                spot.judged().metrics.energy_1_pixel,
                false,
            );
            worst(format!("mtf_half_nyquist_{at}"), mtf[0], false);
            worst(format!("mtf_nyquist_{at}"), mtf[1], false);
            worst(format!("centroid_shift_um_{at}"), spot.centroid_shift_um(), true);
        }
        for white in &element.white {
            for contrast in &white.contrast {
                // Curves are sampled finely; these two are what is looked at.
                if reported.is_some_and(|two| two.contains(&contrast.lp_mm)) {
                    let key = format!("polychromatic_mtf_{}lpmm_{}", contrast.lp_mm, white.channel);
                    worst(key, contrast.mtf[0].min(contrast.mtf[1]), false);
                }
            }
            worst(
                format!("polychromatic_energy_2_pixels_{}", white.channel),
                white.energy_2_pixels,
                false,
            );
        }
    }
    figures.into_iter().map(|(k, v)| (k, finite(v))).collect()
}

/// JSON has no number for what is none.
pub(crate) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
