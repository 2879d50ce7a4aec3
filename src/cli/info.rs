//! `metalith info`: what a layout holds.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use metalith::Result;
use metalith::gds::inventory::{FormatInventory, Inventory, LayerInventory};
use metalith::report::{count, counted, exact};
use metalith::text::printable;

use super::reading::FileArgs;
use super::standard_input::InputFile;
use super::{Outcome, Terminal, print_json, print_text};

/// Cells, texts, elements and faults that the summary lists; `--json` has the first thousand of each.
const SHOWN: usize = 12;

/// Characters of a text that the summary shows.
const LONGEST_TEXT: usize = 80;

/// Decimals of a micrometre in the summary: a hundredth of a nanometre.
const DECIMALS: usize = 5;

/// Say what a layout holds: its cells, layers, texts, lattices of pillars, and the details of its format.
#[derive(Args)]
#[command(
    after_help = "Counts and boxes are arithmetic on the cells: a file is counted whatever number of shapes its arrays describe. \
    A text is listed once, in the coordinates of its cell.\n\n\
    Exit codes: 0 described, also where shapes are no pillars, which the first line then says; 2 bad input. `check` and \
    `psf --extract-only` exit 1 there.\n\n\
    Examples:\n  metalith info from_elsewhere.oas\n  metalith info lens.gds --json | jq .layers"
)]
pub(crate) struct InfoArgs {
    /// The layout, of any program; `-` for standard input.
    layout: PathBuf,

    #[command(flatten)]
    reading: FileArgs,

    /// Print everything as JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &InfoArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let file = InputFile::of(&args.layout)?;
    let layout = args.reading.open_counted(&file, terminal)?;
    let found = layout.inventory(terminal)?;
    terminal.clear();
    if args.json {
        print_json(&serde_json::to_value(&found).expect("an inventory is plain data"));
    } else {
        print_text(text(&found).trim_end());
    }
    Ok(Outcome::Fine)
}

/// The summary.
fn text(found: &Inventory) -> String {
    let mut out = String::new();
    for left_out in found.lattices.iter().filter_map(|lattices| lattices.left_out.as_ref()) {
        let _ = writeln!(out, "{}", left_out.words);
    }
    head(found, &mut out);
    layers(found, &mut out);
    lattices(found, &mut out);
    texts(found, &mut out);
    faults(found, &mut out);
    out
}

fn head(found: &Inventory, out: &mut String) {
    let path = found.path.display().to_string();
    let format = match &found.format {
        FormatInventory::Gds { version, modified } => {
            let version = version.map_or_else(|| "without a version".to_owned(), |v| format!("version {v}"));
            let modified = modified
                .as_ref()
                .map(|date| format!(", written {date}"))
                .unwrap_or_default();
            format!("GDSII {version}{modified}")
        }
        FormatInventory::Dxf { version, unit } => {
            let version = version.as_ref().map_or_else(
                || "DXF without a version".to_owned(),
                |version| format!("DXF {}", printable(version)),
            );
            format!("{version}, {unit}")
        }
        FormatInventory::Oasis {
            compressed_blocks,
            table_offsets_in_end,
            strict_tables,
            checksum,
        } => format!(
            "OASIS 1.0, {}, {} tables of names with offsets at the {}, {}",
            counted(*compressed_blocks as usize, "compressed block"),
            if *strict_tables { "strict" } else { "loose" },
            if *table_offsets_in_end { "end" } else { "start" },
            checksum.map_or_else(|| "no checksum".to_owned(), |scheme| format!("checksum {scheme}")),
        ),
    };
    let _ = writeln!(out, "{}: {format}", printable(&path));
    let _ = writeln!(
        out,
        "{} bytes{}, database unit {} nm, user unit {} nm{}",
        count(found.bytes),
        if found.gzip { " in gzip" } else { "" },
        exact(found.database_unit_nm),
        exact(found.database_unit_nm * found.units_per_user_unit),
        if found.library.is_empty() {
            String::new()
        } else {
            format!(", library {}", found.library)
        }
    );
    let copies = if found.references > 0 {
        format!(
            ", {} to {} in {}",
            counted(found.references as usize, "reference"),
            counted(found.copies as usize, "copy"),
            counted(found.depth as usize + 1, "level"),
        )
    } else {
        String::new()
    };
    let _ = writeln!(
        out,
        "{}{copies}; {}: {}",
        counted(found.cell_count as usize, "cell"),
        counted(found.tops.len(), "top cell"),
        some(found.tops.iter().map(String::as_str), found.tops.len(), ", "),
    );
    if found.with_properties > 0 {
        let _ = writeln!(
            out,
            "{} with properties",
            counted(found.with_properties as usize, "element")
        );
    }
    if found.has_notes {
        let _ = writeln!(
            out,
            "notes of KLayout or gdsfactory in the cell $$$CONTEXT_INFO$$$, which is no layout"
        );
    }
}

/// A length in nanometres, exact to a hundredth.
fn length(nm: f64) -> String {
    trimmed(&format!("{nm:.2}"))
}

/// A length in micrometres of one in nanometres.
fn um(nm: f64) -> String {
    trimmed(&format!("{:.DECIMALS$}", nm * 1e-3))
}

/// A number without zeros at the end of its decimals.
fn trimmed(number: &str) -> String {
    match number.trim_end_matches('0').trim_end_matches('.') {
        "-0" => "0".to_owned(),
        other => other.to_owned(),
    }
}

/// The first of some words, and how many more there are.
fn some<'a>(words: impl Iterator<Item = &'a str>, all: usize, between: &str) -> String {
    let mut text = words.take(SHOWN).collect::<Vec<_>>().join(between);
    if all > SHOWN {
        let _ = write!(text, "{between}{} more", count((all - SHOWN) as u64));
    }
    text
}

/// A column of the table of layers.
type Column = (&'static str, fn(&LayerInventory) -> u64);

const COLUMNS: [Column; 8] = [
    ("shapes", |l| l.shapes),
    ("squares", |l| l.kinds.squares),
    ("rectangles", |l| l.kinds.rectangles),
    ("rotated", |l| l.kinds.rotated_rectangles),
    ("circles", |l| l.kinds.circles),
    ("polygons", |l| l.kinds.polygons),
    ("paths", |l| l.kinds.paths),
    ("texts", |l| l.texts),
];

fn layers(found: &Inventory, out: &mut String) {
    if found.layers.is_empty() {
        let _ = writeln!(out, "\nno shapes and no texts");
        return;
    }
    // Kinds that no layer has take no column.
    let columns: Vec<Column> = COLUMNS
        .into_iter()
        .filter(|(name, of)| *name == "shapes" || found.layers.iter().any(|layer| of(layer) > 0))
        .collect();
    let _ = write!(out, "\n{:<12}", "layer");
    for (name, _) in &columns {
        let _ = write!(out, "{name:>14}");
    }
    let _ = writeln!(out, "  sides (nm); box (um): left, bottom, right, top");
    for layer in &found.layers {
        let _ = write!(out, "{:<12}", layer.layer.to_string());
        for (_, of) in &columns {
            let _ = write!(out, "{:>14}", count(of(layer)));
        }
        let sides = match layer.sides_nm {
            Some([a, b]) if a == b => length(a),
            Some([a, b]) => format!("{} to {}", length(a), length(b)),
            None => "-".into(),
        };
        let bounds = match layer.bounds_nm {
            Some(b) => b.map(um).join(", "),
            None if layer.shapes > 0 => "not computed".into(),
            None => "-".into(),
        };
        let _ = writeln!(out, "  {sides}; {bounds}");
    }
}

fn lattices(found: &Inventory, out: &mut String) {
    for lattice in &found.lattices {
        let under = if found.tops.len() > 1 {
            format!(" below {}", lattice.top)
        } else {
            String::new()
        };
        let _ = writeln!(
            out,
            "\n{} of {}{} on {}{under}{}",
            counted(lattice.element_count, "element"),
            lattice
                .pillar_count
                .map_or_else(String::new, |n| format!("{} ", count(n))),
            lattice.pillars,
            lattice.layer,
            lattice
                .turned_deg
                .map_or_else(String::new, |deg| format!(", at an angle of {} deg", exact(deg))),
        );
        for element in lattice.elements.iter().take(SHOWN) {
            let _ = writeln!(
                out,
                "  {} lattice of {} nm, {} x {} sites around ({}, {}) um",
                element.lattice,
                exact(element.pitch_nm),
                count(element.columns as u64),
                count(element.rows as u64),
                um(element.centre_nm[0] as f64),
                um(element.centre_nm[1] as f64),
            );
        }
        if lattice.element_count > SHOWN {
            let _ = writeln!(out, "  and {} more", count((lattice.element_count - SHOWN) as u64));
        }
    }
    if let Some(why) = &found.lattices_left_out {
        let _ = writeln!(out, "\nlattices were not looked for: {why}");
    } else if found.lattices.is_empty() && !found.layers.is_empty() {
        let _ = writeln!(out, "\nno lattice of pillars");
    }
}

fn texts(found: &Inventory, out: &mut String) {
    if found.texts.is_empty() {
        return;
    }
    let _ = writeln!(out, "\n{}", counted(found.text_count as usize, "text"));
    for text in found.texts.iter().take(SHOWN) {
        let [x, y] = text.at_nm.map(um);
        let mut string: String = text.string.chars().take(LONGEST_TEXT).collect();
        if string.len() < text.string.len() {
            string.push_str("...");
        }
        let _ = writeln!(out, "  {} \"{string}\" at ({x}, {y}) um in {}", text.layer, text.cell);
    }
    if found.texts.len() > SHOWN {
        let _ = writeln!(out, "  --json lists {}", counted(found.texts.len(), "text"));
    }
}

fn faults(found: &Inventory, out: &mut String) {
    let mut lines = Vec::new();
    for reference in &found.dangling {
        lines.push(format!(
            "byte {}: {} refers to {}, which the file does not have",
            reference.byte, reference.from, reference.to
        ));
    }
    for reference in &found.circular {
        lines.push(format!(
            "byte {}: the reference from {} to {} leads round in a circle",
            reference.byte, reference.from, reference.to
        ));
    }
    lines.extend(found.doubled.iter().map(|name| format!("a second cell {name}")));
    for departure in &found.departures {
        lines.push(format!(
            "byte {}: {}; {}",
            departure.byte, departure.what, departure.taken
        ));
    }
    let hidden = found.departure_count - found.departures.len() as u64;
    let all = lines.len() + hidden as usize;
    if all == 0 {
        let _ = writeln!(out, "\nno faults, no departures from the format");
        return;
    }
    let _ = writeln!(out, "\n{}", counted(all, "fault"));
    for line in lines.iter().take(SHOWN) {
        let _ = writeln!(out, "  {line}");
    }
    if all > SHOWN.min(lines.len()) {
        let _ = writeln!(out, "  and {} more", count((all - SHOWN.min(lines.len())) as u64));
    }
}
