//! The proof for people: `proof.html`, with `proof.txt` and `proof.json` beside it.

use std::path::Path;

use super::{NOTHING, Trial, Validation};
use crate::page::round_json;
use metalith_core::{Result, WholeFile};
use metalith_report::{Axis, Cell, Column, HeatMap, ImageGrid, Matrix, Page, Table, Verdict, sig, write_json};

/// Largest share of sets without effect in which one may be claimed.
const MOST_FALSE: f64 = 0.05;

/// Range of residual pictures [sigma].
const SIGMAS: f64 = 6.0;

/// Write the proof to a folder.
///
/// # Errors
/// If a file cannot be written.
pub fn write_validation(folder: &Path, proof: &Validation) -> Result<()> {
    WholeFile::write(&folder.join("proof.txt"), proof.text().as_bytes())?;
    write_json(&folder.join("proof.json"), "calibrate --proof", proof)?;
    let mut page = Page::new(
        "How far calibration can be trusted",
        format!("Synthesizer of `{}`, of our own making", proof.like),
    );
    let share = proof.false_claims as f64 / proof.nulls.max(1) as f64;
    page.verdict(
        if share <= MOST_FALSE {
            Verdict::Pass
        } else {
            Verdict::Fail
        },
        format!(
            "{} false claims in {} sets without effect.",
            proof.false_claims, proof.nulls
        ),
    );
    page.facts(&[
        (
            "Largest gain by chance",
            format!(
                "{} in {} other sets without effect",
                sig(proof.largest_gain_by_chance, 2),
                proof.threshold_nulls
            ),
        ),
        ("Gain that a claim takes", sig(proof.least_gain, 2)),
        (
            "Intervals that hold the truth",
            format!("{} of {}", proof.intervals_inside, proof.intervals),
        ),
    ]);
    page.paragraph(
        "Each twin has its own placement, flux, black level and noise, and is made with wavelengths, samples and orders of the rigorous cell that fits do not use; missing pillars are single ones. What is told apart is what these captures can tell apart, at their noise.",
    );
    page.section("What is taken for what");
    let mut matrix = Matrix::new("What is taken for what", proof.claimed.iter().cloned()).axes("claimed", "true");
    for (truth, shares) in &proof.confusion {
        matrix.row(truth.as_str(), shares.iter().copied());
    }
    page.figure(matrix.caption(
        "Percent of the trials of each truth, sizes together. Members of a set that cannot be told apart share their trial.",
    ));
    limits(&mut page, proof);
    off_list(&mut page, proof);
    page.section("Every trial");
    page.details("Trials", |inner| {
        inner.table(trials(proof));
    });
    page.write(&folder.join("proof.html"))
}

fn limits(page: &mut Page, proof: &Validation) {
    page.section("From which size on");
    let mut table = Table::new([
        Column::text("Effect"),
        Column::text("Named from"),
        Column::text("Value there"),
        Column::text("Interval there"),
        Column::number("Estimated limit", "typical sizes"),
    ])
    .caption("The least size tried from which on an effect was named, alone or in a set; the limit is where its residual would come to what a claim takes.");
    for limit in &proof.limits {
        let at = |t: &&Trial| t.truth == limit.name && Some(t.size) == limit.named_from;
        let first = proof.trials.iter().find(at);
        let unit = first.map_or("", |t| t.unit.as_str());
        table.row([
            Cell::code(&limit.name),
            limit.named_from.map_or_else(
                || "not at twice its typical size".into(),
                |s| format!("{} typical", sig(s, 2)).as_str().into(),
            ),
            first
                .and_then(|t| t.value)
                .map_or_else(Cell::none, |v| format!("{} {unit}", sig(v, 4)).as_str().into()),
            first
                .and_then(|t| t.interval.as_ref())
                .map_or_else(Cell::none, |v| round_json(v).as_str().into()),
            limit.estimate.map_or_else(Cell::none, |e| Cell::sig(e, 2)),
        ]);
    }
    page.table(table);
}

fn off_list(page: &mut Page, proof: &Validation) {
    let odd: Vec<&Trial> = proof.trials.iter().filter(|t| t.off_list).collect();
    if odd.is_empty() {
        return;
    }
    page.section("What is in no list");
    for t in odd {
        page.subsection(&t.truth);
        let said = if t.found.is_empty() {
            String::new()
        } else {
            format!(", {}", t.found.join(", "))
        };
        page.paragraph(format!("Verdict: {}{said}.", t.verdict_name()));
        let Some(left) = &t.left else { continue };
        let strongest = left
            .path_nm
            .iter()
            .max_by(|a, b| (a.1.abs() / a.2).total_cmp(&(b.1.abs() / b.2)));
        if let Some((noll, value, sigma)) = strongest {
            page.paragraph(format!(
                "Strongest term of the free path: Noll {noll}, {} +- {} nm. Free blur: {} um^2 along x, {} along y, {} across.",
                sig(*value, 3),
                sig(*sigma, 1),
                sig(left.blur_um2[0].0, 2),
                sig(left.blur_um2[2].0, 2),
                sig(left.blur_um2[1].0, 2)
            ));
        }
        let r = left.radius_um;
        let map = HeatMap::new(
            format!("{}: free path", t.truth),
            left.path.clone(),
            (Axis::linear("x", "um"), -r, r),
            (Axis::linear("y", "um"), -r, r),
        )
        .values("optical path", "nm")
        .diverging()
        .to_scale()
        .size(380.0, 340.0);
        let mut picture = ImageGrid::new(format!("{}: residual", t.truth), 1)
            .values("residual", "sigma")
            .range(-SIGMAS, SIGMAS)
            .diverging()
            .side(280.0);
        picture.image(left.capture.as_str(), left.residual.clone());
        page.row([
            map.caption("Smooth path over the lens that the residual asks for."),
            picture.caption("What is left of the capture that is predicted worst."),
        ]);
    }
}

fn trials(proof: &Validation) -> Table {
    let mut table = Table::new([
        Column::text("True"),
        Column::number("Size", "typical"),
        Column::text("Value"),
        Column::text("Verdict"),
        Column::text("Claimed"),
        Column::text("Found"),
        Column::text("Interval"),
        Column::text("Holds the truth"),
        Column::number("Held out, before", ""),
        Column::number("after", ""),
    ]);
    for t in proof
        .trials
        .iter()
        .filter(|t| t.truth != NOTHING || !t.found.is_empty())
    {
        let json =
            |v: &Option<serde_json::Value>| v.as_ref().map_or_else(Cell::none, |v| round_json(v).as_str().into());
        table.row([
            Cell::code(&t.truth),
            Cell::sig(t.size, 2),
            t.value
                .map_or_else(Cell::none, |v| format!("{} {}", sig(v, 4), t.unit).as_str().into()),
            t.verdict_name().as_str().into(),
            t.found.join(", ").as_str().into(),
            json(&t.found_value),
            json(&t.interval),
            match t.inside {
                None => Cell::none(),
                Some(true) => "yes".into(),
                Some(false) => "no".into(),
            },
            Cell::sig(t.held_out_before, 4),
            Cell::sig(t.held_out_after, 4),
        ]);
    }
    table
}
