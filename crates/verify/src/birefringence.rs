//! Assumptions on the polarisation of light at upright rectangles, and on the library that they are chosen from.

use metalith_cell::{FocusedLight, UPRIGHT_ORDERS};
use metalith_design::Design;
use metalith_report::{fixed, sig};

use super::Verification;

/// Rows of the table of assumptions: what, its size for the design, and how it is known.
pub(super) fn rows(row: &mut impl FnMut(&str, String, &str), design: &Design, found: &Verification) {
    let axis = design.axis();
    let focused = FocusedLight::Linear(axis);
    let light = design.verify.light();
    let follows = found.distinct.iter().flat_map(|d| &d.orders);
    let follows: Vec<_> = follows.map(|o| fixed(o.first * 100.0, 1)).collect();
    row(
        &format!(
            "Light arrives {}; pillars give what is polarised along x and along y each its own phase",
            light.arriving_at(focused)
        ),
        format!(
            "{} % of all light that arrives follows the phase of light along {axis}, in all figures of the layout; {}",
            follows.join(", "),
            light.detector(focused)
        ),
        "Jones matrices along both axes, which do not convert polarisation; `polarisation` in [verify] states the arriving light",
    );
    if let Some(library) = &design.mapping.pillar_library {
        let errors = library.errors();
        let [x, y] = errors.phase;
        row(
            "Each site has the pillar of the library that is nearest to both phases",
            format!(
                "off by {} and {} rad rms (x, y) over all pairs of phases, {} and {} at most",
                sig(x.rms_rad, 2),
                sig(y.rms_rad, 2),
                sig(x.worst_rad, 2),
                sig(y.worst_rad, 2)
            ),
            "phases and amplitudes from the file of the library; with smaller steps `metalith cells` makes a finer one",
        );
    }
    row(
        &format!("Cells are solved with {UPRIGHT_ORDERS} diffraction orders an axis, cells of a band with fewer"),
        "0.003 rms in t, 0.006 at most, for fifteen sizes of three materials".into(),
        "against 41 orders: docs/method/cells.md",
    );
}
