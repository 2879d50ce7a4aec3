//! Rules that a hand-off breaks, each with its cure.

use metalith_drc::{RuleReport, Severity};
use metalith_report::exact;
use serde::Serialize;

use super::process::Process;

/// Checks whose limits belong to the process of a lab.
const LIMITS: [&str; 8] = [
    "width_min",
    "width_max",
    "aspect_max",
    "gap_min",
    "gap_aspect_max",
    "fill",
    "fill_gradient",
    "write_time",
];

/// Sizes of fields that are named.
const SIZES: usize = 3;

/// A rule that a layout breaks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BrokenRule {
    pub rule: String,
    /// The requirement, with its limit.
    pub requirement: String,
    /// Violations that no waiver covers.
    pub violations: u64,
    /// File of the deck.
    pub deck: String,
    /// True if its limit is a guess that no lab has confirmed: it fails nothing.
    pub assumed: bool,
    /// Remedy.
    pub cure: String,
}

impl BrokenRule {
    /// The rule if it is broken, of a deck in this file whose limits are assumed or confirmed.
    pub(super) fn of(
        rule: &RuleReport,
        deck: &str,
        deck_is_assumed: bool,
        process: &Process,
        pitch_nm: Option<f64>,
    ) -> Option<Self> {
        let assumed = deck_is_assumed && LIMITS.contains(&rule.check.as_str());
        let broken = rule.severity > Severity::Note && rule.open() > 0;
        broken.then(|| Self {
            rule: rule.id.clone(),
            requirement: rule.words.clone(),
            violations: rule.open(),
            deck: deck.to_owned(),
            assumed,
            cure: cure(&rule.check, &rule.id, deck, assumed, process, pitch_nm),
        })
    }
}

fn cure(check: &str, id: &str, deck: &str, assumed: bool, process: &Process, pitch_nm: Option<f64>) -> String {
    let geometry = match check {
        "width_min" | "width_max" | "aspect_max" => "change the widths of the mapping or the height of the pillars",
        "gap_min" | "gap_aspect_max" => "use narrower pillars or a larger pitch",
        "fill" | "fill_gradient" => "change pitch or widths, or correct the dose by density",
        "write_time" => "use a higher current or a smaller layout",
        "field_cut" | "field_in_lens" => return field_cure(check, process, pitch_nm),
        "overlap" | "duplicate" => return "remove shapes that are drawn twice: they are exposed twice".into(),
        "on_lattice" => return format!("draw pillars on the pitch of rule `{id}` in {deck}, or use rules without it"),
        "width_library" => return format!("use widths of rule `{id}` in {deck}, or use rules without it"),
        "square" | "circle" | "rectangle" => {
            return "draw pillars of one shape, or use rules for the other shape".into();
        }
        "recognised" => return "draw pillars of one kind on lattices, or name their layer by --layer".into(),
        "exposure_grid" | "grid" => return "round places and sizes to the step of the rule".into(),
        "active_area" => return "move the layout into the area, or make the chip larger".into(),
        "mark_keep_out" => return "move the marks away from the pillars".into(),
        "layers_known" => return format!("remove the layers, or name them in [layers] of {deck}"),
        _ => return "checks/ has the places: change the layout there, or accept them by --waivers".into(),
    };
    if assumed {
        format!("ask the lab for its limit and write it into rule `{id}` of a copy of {deck}, or {geometry}")
    } else {
        format!("{geometry}, or accept the places by --waivers")
    }
}

/// Sizes of fields whose borders run between pillars.
fn field_cure(check: &str, process: &Process, pitch_nm: Option<f64>) -> String {
    let most_um = process.writer.field_um;
    let Some(pitch_um) = pitch_nm.map(|nm| nm * 1e-3).filter(|um| *um > 0.0 && *um < most_um) else {
        return format!(
            "choose fields whose borders run between shapes, of at most {} um",
            exact(most_um)
        );
    };
    let largest = (most_um / pitch_um).floor();
    let sizes = (0..SIZES)
        .map(|k| largest - k as f64)
        .filter(|n| *n >= 1.0)
        .map(|n| exact((n * pitch_um * 1e6).round() / 1e6));
    let sizes: Vec<String> = sizes.collect();
    if check == "field_in_lens" {
        return format!("use lenses of at most {} um, or a larger field", exact(most_um));
    }
    format!(
        "set `field_used_um` in [writer] of the process and `field_um` of the rule to a multiple of the pitch of {} nm: {} um \
         (an even number of pitches for lenses with an even number of columns, an odd number for others)",
        exact(pitch_um * 1e3),
        sizes.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_fields_are_multiples_of_the_pitch() {
        let words = field_cure("field_cut", &Process::standard(), Some(450.0));
        assert!(words.contains("499.95, 499.5, 499.05 um"), "{words}");
    }
}
