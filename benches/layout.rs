//! One full-size lens, 6.4 million pillars: widths from the design, and bytes in each hierarchy.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use metalith::array::PillarRule;
use metalith::phase::{ElementPhase, LensPhase};
use metalith::{Design, Hierarchy, PillarArray, Silent, write_pillars};

fn one_lens() -> Design {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("designs/prototype_3x3.toml");
    let mut design = Design::read(&path).expect("a shipped design is sound");
    design.array.count = (1, 1);
    design
}

fn layout(criterion: &mut Criterion) {
    let design = one_lens();
    let array = PillarArray::build(&design, &Silent).expect("nothing stops it");
    let folder = tempfile::tempdir().expect("there is a folder for temporary files");
    let mut group = criterion.benchmark_group("layout");
    group.sample_size(10).throughput(Throughput::Elements(array.pillars()));
    let lens = LensPhase::new(array.lattice, design.lens.diameter_nm, &design.lens.phase);
    let rule = PillarRule::new(&design.cell, &design.mapping);
    let wedge = design.elements()[0].wedge;
    group.bench_function("widths", |b| {
        b.iter(|| rule.widths(&ElementPhase::new(&lens, &wedge), None));
    });
    for (name, hierarchy) in [
        ("folded", Hierarchy::Folded),
        ("sref", Hierarchy::Sref),
        ("flat", Hierarchy::Flat),
    ] {
        let path = folder.path().join(name);
        group.bench_function(name, |b| {
            b.iter(|| write_pillars(&design, &array, hierarchy, &path, &Silent).expect("there is room"));
        });
    }
    group.finish();
}

criterion_group!(benches, layout);
criterion_main!(benches);
