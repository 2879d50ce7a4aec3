//! Contents of a layout from any program: `cargo run --release --example read_layout -- FILE.gds [LAYER/DATATYPE]`

use metalith::gds::LayerNumber;
use metalith::{ExtractionPlan, Layout, Silent, extract};

fn main() -> metalith::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().expect("usage: read_layout FILE.gds [LAYER/DATATYPE]");
    let layer = arguments.next().unwrap_or_else(|| "1/0".into());
    let mut numbers = layer
        .split('/')
        .map(|n| n.parse().expect("LAYER/DATATYPE, such as 1/0"));
    let layer = LayerNumber::new(numbers.next().unwrap_or(1), numbers.next().unwrap_or(0));
    let layout = Layout::open(path.as_ref())?;
    println!(
        "{} cells, {} levels, {} shapes flat, {} bytes, unit {} nm",
        layout.cells().len(),
        layout.depth() + 1,
        layout.flat_shapes(),
        layout.bytes(),
        layout.unit_nm()
    );
    let read = extract(&layout, &ExtractionPlan::discover(layer), &Silent)?;
    for l in &read.survey.layers {
        println!(
            "layer {}: {} shapes, {} texts, {:?} nm",
            l.layer, l.shapes, l.texts, l.bounds_nm
        );
    }
    for e in &read.elements {
        let (name, lattice) = (&e.site.name, e.site.lattice);
        let (sites, pitch, pillars) = (lattice.sites(), lattice.pitch_nm(), e.widths.pillars());
        let centre = e.site.centre_nm;
        println!("{name}: {pillars} pillars on {sites} x {sites} sites of {pitch} nm about {centre:?} nm");
    }
    println!(
        "{} pillars, {} other shapes on {layer}",
        read.pillars,
        read.oddities.total()
    );
    Ok(())
}
