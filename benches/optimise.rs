//! Cost of an optimisation of the 1 mm lens: the kernel, a sweep of exchange, a step of Adam, a view of
//! the expected image error. The published cell, so that no table is needed.

use criterion::{Criterion, criterion_group, criterion_main};
use metalith::array::PillarRule;
use metalith::cell::PublishedCell;
use metalith::optimise::{
    Exchange, FabricationError, FieldProblem, Lens, Mapping, MeritKind, Objective, PixelWindow, Pupil, Rings, Schedule,
    Start, StepLimit, wavelengths,
};
use metalith::{CellModel, Design, Lattice};

fn optimise(c: &mut Criterion) {
    let design = Design::read("designs/prototype_3x3.toml".as_ref()).expect("a shipped design");
    let rings = || Rings::new(Lattice::covering(1_000_000, 350).unwrap(), 1_000_000).unwrap();
    let lens = Lens {
        rings: rings(),
        distance_um: 2400.0,
    };
    let cell = PublishedCell::new(350);
    let cells: [&dyn CellModel; 1] = [&cell];
    let mapping = Mapping::new(&PillarRule::new(&design.cell, &design.mapping));
    let band = wavelengths(400.0, 700.0, 1.0);
    let rows = || lens.focal_rows(&band, FabricationError::default(), &cells).unwrap();
    let problem = FieldProblem::new(vec![(MeritKind::Log, 1.0, rows())], &cells, mapping, 1 << 30).unwrap();
    let waves = Start::LogAsphere { band_um: (0.4, 0.7) }.waves(&lens, 0);
    let mut group = c.benchmark_group("optimise");
    group.sample_size(10);
    group.bench_function("rings of 6.4 million sites", |b| b.iter(rings));
    group.bench_function("kernel, 301 wavelengths", |b| b.iter(rows));
    group.bench_function("sweep of 1429 rings, limit 0.2 turn", |b| {
        let schedule = Schedule {
            hot_sweeps: 1 << 20,
            cold_sweeps: 0,
            temperature: (1e-3, 1e-3),
        };
        let mut exchange = Exchange::new(&problem, StepLimit::new(0.2).unwrap(), schedule, 1, &waves);
        b.iter(|| exchange.sweep_once());
    });
    group.bench_function("gradient, 301 wavelengths", |b| {
        let mut gradient = vec![0.0; problem.rings()];
        b.iter(|| problem.climb(&waves, 1, 0, &mut gradient));
    });
    group.bench_function("kernel of one view, 160 pixels", |b| {
        let window = PixelWindow {
            pixels: 160,
            pixel_um: 5.86,
        };
        b.iter(|| Pupil::new(&lens, 0.55, 0.26, window, 30.0).unwrap());
    });
    group.finish();
}

criterion_group!(benches, optimise);
criterion_main!(benches);
