//! CPU time of writing the pillars of a design, for `scripts/peers_layout.py`:
//! `cargo run --release --example write_layout -- DESIGN.toml OUT.gds folded|sref|flat|compact|smallest`
//!
//! The widths of all pillars are there before the clock starts, as those of the peers are. One line of JSON.

use metalith::cpu_time::cpu_seconds;
use metalith::layout::{LayoutFormat, OasisEncoding, write_pillars_as};
use metalith::{Design, Hierarchy, PillarArray, Silent};

fn main() -> metalith::Result<()> {
    let arguments = std::env::args().collect::<Vec<_>>();
    let [_, design, out, hierarchy] = arguments.as_slice() else {
        panic!("usage: write_layout DESIGN.toml OUT.gds folded|sref|flat|compact|smallest");
    };
    let oasis = |encoding| (Hierarchy::Folded, LayoutFormat::Oasis(encoding));
    let (hierarchy, format) = match hierarchy.as_str() {
        "folded" => (Hierarchy::Folded, LayoutFormat::Gds),
        "sref" => (Hierarchy::Sref, LayoutFormat::Gds),
        "compact" => oasis(OasisEncoding::Compact),
        "smallest" => oasis(OasisEncoding::Smallest),
        _ => (Hierarchy::Flat, LayoutFormat::Gds),
    };
    let design = Design::read(design.as_ref())?;
    let array = PillarArray::build(&design, &Silent)?;
    let before = cpu_seconds();
    let written = write_pillars_as(&design, &array, hierarchy, format, out.as_ref(), &Silent)?;
    let cpu_s = before.zip(cpu_seconds()).map(|(a, b)| b - a);
    println!(
        "{{\"cpu_s\": {:.3}, \"bytes\": {}, \"pillars\": {}}}",
        cpu_s.unwrap_or(f64::NAN),
        written.bytes,
        array.pillars()
    );
    Ok(())
}
