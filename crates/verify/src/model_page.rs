//! The part of a report that says by which calibrated model chips were made.

use metalith_optics::ModelStatement;
use metalith_report::Page;

/// Section on what the model changes, and what of it is not applied.
pub(super) fn write(page: &mut Page, model: &ModelStatement) {
    page.paragraph(format!(
        "Pillars, apertures, light and sensor follow the calibrated model of {}: {}. {}",
        model.set,
        model.finding,
        if model.applied.is_empty() {
            "The model changes nothing that is simulated here."
        } else {
            "The model adds these changes to the stated values, by the keys of the model file:"
        }
    ));
    if !model.applied.is_empty() {
        page.list(model.applied.iter().map(ToString::to_string));
    }
    for quantity in &model.not_applied {
        page.note(quantity.to_string());
    }
}
