//! Design rules and differences on one 140 um lens, from memory. Full-size figures and KLayout beside:
//! `scripts/compare_klayout_drc.py METALITH FOLDER --time 1000000`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use metalith::diff::{DiffPlan, diff};
use metalith::drc::{self, CheckInput, Deck};
use metalith::gds::ReadLimits;
use metalith::{Layout, Silent};

const SITES: i32 = 400;

/// A flat lens on its lattice, or with every second row shifted by half a pitch, so that there is none.
fn lens(on_lattice: bool) -> Vec<u8> {
    let mut gds = metalith_testing::gds::Gds::library();
    gds.cell("TOP");
    for iy in 0..SITES {
        for ix in 0..SITES {
            let w = 100 + 2 * ((ix * 7 + iy * 13) % 70);
            let shift = if on_lattice {
                0
            } else {
                (iy * iy * 37 + ix * ix * 11) % 40
            };
            gds.square(1, 350 * ix + shift, 350 * iy, w);
        }
    }
    gds.end_cell();
    gds.end()
}

fn check(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("check");
    group
        .throughput(Throughput::Elements((SITES * SITES) as u64))
        .sample_size(10);
    let deck = Deck::standard();
    for (name, on_lattice) in [("on a lattice", true), ("on no lattice", false)] {
        let layout = Layout::from_bytes(name, lens(on_lattice), ReadLimits::default()).expect("a layout");
        group.bench_function(name, |b| {
            b.iter(|| drc::check(&layout, &deck, &CheckInput::default(), &Silent).expect("a report"));
        });
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("lens.gds");
    std::fs::write(&path, lens(true)).expect("a writable folder");
    let layout = Layout::open(&path).expect("a layout");
    group.bench_function("diff with itself", |b| {
        b.iter(|| diff(&layout, &layout, &DiffPlan::default(), &Silent).expect("a comparison"));
    });
    group.finish();
}

criterion_group!(benches, check);
criterion_main!(benches);
