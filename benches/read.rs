//! Reading and extraction of one 140 um lens, flat and by reference, from memory.
//!
//! Full-size files and the peers are timed by `scripts/time_readers.py`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use metalith::extract::ElementSite;
use metalith::gds::{LayerNumber, ReadLimits};
use metalith::{ExtractionPlan, Lattice, Layout, Silent, extract};

const SITES: usize = 400;

fn lens(referenced: bool) -> (Vec<u8>, ElementSite) {
    let lattice = Lattice::new(350, SITES).expect("a lattice");
    let mut gds = metalith_testing::gds::Gds::library();
    if referenced {
        for w in 0..100 {
            gds.cell(&format!("W{w}")).square(1, 0, 0, 100 + 2 * w).end_cell();
        }
    }
    gds.cell("TOP");
    for iy in 0..SITES {
        for ix in 0..SITES {
            let w = (ix * 7 + iy * 13) % 100;
            let (x, y) = (lattice.whole_nm(0, ix) as i32, lattice.whole_nm(0, iy) as i32);
            if referenced {
                gds.sref(&format!("W{w}"), x, y);
            } else {
                gds.square(1, x, y, 100 + 2 * w as i32);
            }
        }
    }
    gds.end_cell();
    let site = ElementSite {
        name: "lens".into(),
        centre_nm: [0, 0],
        lattice,
        within_nm: None,
    };
    (gds.end(), site)
}

fn read(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("read");
    group
        .throughput(Throughput::Elements((SITES * SITES) as u64))
        .sample_size(10);
    for (name, referenced) in [("flat", false), ("sref", true)] {
        let (bytes, site) = lens(referenced);
        let bytes: std::sync::Arc<[u8]> = bytes.into();
        let open = || Layout::from_bytes(name, bytes.clone(), ReadLimits::default()).expect("a layout");
        group.bench_function(format!("{name}, counted"), |b| b.iter(open));
        let given = ExtractionPlan::given(LayerNumber::new(1, 0), vec![site]);
        group.bench_function(format!("{name}, extracted"), |b| {
            b.iter(|| extract(&open(), &given, &Silent).expect("pillars"));
        });
        let discover = ExtractionPlan::discover(LayerNumber::new(1, 0));
        group.bench_function(format!("{name}, discovered and extracted"), |b| {
            b.iter(|| extract(&open(), &discover, &Silent).expect("pillars"));
        });
    }
    group.finish();
}

criterion_group!(benches, read);
criterion_main!(benches);
