//! Recognition of the pillars of a layout that no design describes, as simulations recognise them.

use std::collections::BTreeMap;

use super::findings::Findings;
use super::input::CheckInput;
use super::report::{DrcReport, RuleReport};
use super::rule::{Severity, Status};
use metalith_core::{Error, Progress, Result};
use metalith_gds::extract::{ExtractionPlan, LeftOut, MOST_LEFT_OUT, extract_folded};
use metalith_gds::{LayerNumber, Layout, Rect};

/// Identity of the finding that shapes of an element are no pillars.
const RECOGNISED: &str = "element.recognised";

/// Add to the report of a layout how many of the shapes on a layer are pillars: squares and circles in one lens and lenses at an angle
/// are recognised too, and places to the rounding of their corners. Nothing is added where all shapes are on lattices already, or
/// where a design says what should be there.
///
/// # Errors
/// If the user stopped it. A layout without elements has none to recognise.
pub fn add_recognition(
    report: &mut DrcReport,
    layout: &Layout,
    layer: LayerNumber,
    input: &CheckInput<'_>,
    progress: &dyn Progress,
) -> Result<()> {
    // Pillars below several tops are of several layouts, which is a finding of another rule.
    let is_of_several = layout.tops_on(layer).len() > 1;
    if input.design.is_some() || is_of_several || layout.shapes_on(layer) == report.pillars_on_lattices {
        return Ok(());
    }
    let plan = ExtractionPlan {
        listed: 0,
        lenient: true,
        ..ExtractionPlan::discover(layer)
    };
    let found = match extract_folded(layout, &plan, progress).map_err(Error::from) {
        Ok(found) => found,
        Err(Error::Interrupted) => return Err(Error::Interrupted),
        Err(_) => return Ok(()),
    };
    report.elements = found.elements.len();
    report.pillars_on_lattices = found.pillars;
    report.turned_deg = found.turned_deg;
    let Some(left_out) = LeftOut::of(&found, layer) else {
        return Ok(());
    };
    let mut findings = Findings::new(RECOGNISED, layout.unit_nm(), input);
    let unit = |nm: f64| (nm / layout.unit_nm()).round() as i64;
    let first = &left_out.first;
    let [[x0, x1], [y0, y1]] = [0, 1].map(|axis| {
        let half = first.size_nm[axis] / 2.0;
        [unit(first.centre_nm[axis] - half), unit(first.centre_nm[axis] + half)]
    });
    findings.rect(&Rect { x0, y0, x1, y1 }, || first.why.words().to_owned());
    let rule = RuleReport {
        id: RECOGNISED.to_owned(),
        check: "recognised".to_owned(),
        severity: if left_out.is_much {
            Severity::Error
        } else {
            Severity::Note
        },
        words: format!(
            "shapes of an element are pillars, but for less than {} %",
            100.0 * MOST_LEFT_OUT
        ),
        status: Status::Run,
        violations: left_out.count,
        waived: if findings.waived > 0 { left_out.count } else { 0 },
        markers: findings.markers,
        facts: BTreeMap::new(),
    };
    report.rules.insert(0, rule);
    report.not_understood = Some(left_out.words);
    Ok(())
}
