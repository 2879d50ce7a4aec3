//! Cells solved on one thread: `cargo bench --bench cell`.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use metalith::cell::CellStack;
use metalith::rcwa::{Incidence, Orders, Side, solve};

fn stack() -> CellStack {
    CellStack::paper(350.0, 700.0).expect("known materials")
}

fn cells(c: &mut Criterion) {
    let mut group = c.benchmark_group("cell");
    group.sample_size(20);
    let upright = stack();
    let leaning = CellStack {
        taper: 1.0_f64.to_radians(),
        ..stack()
    };
    for along_axis in [9, 13, 17] {
        let orders = Orders::new(along_axis).expect("odd");
        group.bench_function(BenchmarkId::new("normal", along_axis), |b| {
            b.iter(|| black_box(upright.transmission(200.0, 0.452, orders)).expect("a cell"));
        });
    }
    let orders = Orders::new(13).expect("odd");
    group.bench_function(BenchmarkId::new("leaning, six slices", 13), |b| {
        b.iter(|| black_box(leaning.transmission(180.0, 0.452, orders)).expect("a cell"));
    });
    let layers = upright.layers(200.0, 0.452).expect("a stack");
    let oblique = Incidence::in_air(0.452, Side::Below, 0.26, 0.0);
    group.bench_function(BenchmarkId::new("oblique along x, s and p", 13), |b| {
        b.iter(|| black_box(solve(&layers, &oblique, orders)).expect("a cell"));
    });
    group.finish();
}

criterion_group!(benches, cells);
criterion_main!(benches);
