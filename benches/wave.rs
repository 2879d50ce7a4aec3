//! Fields of full-size and small lenses on one thread: `cargo bench --bench wave`.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::f64::consts::TAU;
use std::hint::black_box;

use metalith::wave::{FoldedPropagator, IdealPsf, Pillars, PlaneWave, Propagator, Psf, Scratch, Window};
use metalith::{Accuracy, Lattice, PillarMap};
use num_complex::Complex64;

/// A hyperbolic lens for 550 nm in widths of 100 to 300 nm.
fn lens(sites: usize, radius_um: f64, focal_um: f64) -> PillarMap {
    let lattice = Lattice::new(350, sites).expect("a lattice");
    let mut map = PillarMap::empty(lattice);
    for ((iy, ix), width) in map.number.indexed_iter_mut() {
        let [x, y] = [ix, iy].map(|i| lattice.coordinate_um(i));
        let r2 = x * x + y * y;
        if r2 <= radius_um * radius_um {
            let u = ((focal_um - (r2 + focal_um * focal_um).sqrt()) / 0.55).rem_euclid(1.0);
            *width = 100 + 2 * (100.0 * u) as u16;
        }
    }
    map
}

fn fields(c: &mut Criterion) {
    let table: Vec<Complex64> = (0..=300)
        .map(|w| Complex64::cis(TAU * (f64::from(w) - 100.0) / 200.0))
        .collect();
    let mut group = c.benchmark_group("field");
    group.sample_size(10);
    for (name, sites, radius_um, focal_um, samples) in [
        ("1 mm", 2858, 500.0, 2400.0, 256),
        ("140 um", 400, 70.0, 336.0, 128),
        ("60 um", 172, 30.0, 144.0, 128),
    ] {
        let map = lens(sites, radius_um, focal_um);
        let pillars = Pillars::new(&map, &table).expect("widths up to 300 nm");
        let window = Window::about([0.0, 0.0], 0.35, samples, focal_um);
        let wave = PlaneWave::normal(0.55);
        for accuracy in [Accuracy::Accurate, Accuracy::Fast] {
            let fold = FoldedPropagator::plan(map.lattice, radius_um, 0.55, window, accuracy).expect("a plan");
            let mut scratch = Scratch::default();
            group.bench_function(BenchmarkId::new(name, format!("{accuracy:?}")), |b| {
                b.iter(|| black_box(fold.field(&pillars, &wave, &mut scratch)).expect("a field"));
            });
        }
        let fold = FoldedPropagator::plan(map.lattice, radius_um, 0.55, window, Accuracy::Accurate).expect("a plan");
        let mut scratch = Scratch::default();
        let field = fold.field(&pillars, &wave, &mut scratch).expect("a field");
        group.bench_function(BenchmarkId::new(name, "adjoint"), |b| {
            b.iter(|| black_box(fold.adjoint(&field.values, &wave, &mut scratch)).expect("an adjoint"));
        });
        let matched = IdealPsf::of(&pillars, [0.0, 0.0, focal_um], 0.55, 1.0);
        group.bench_function(BenchmarkId::new(name, "metrics"), |b| {
            b.iter(|| black_box(Psf::of(&field).metrics(&matched, 5.86)));
        });
    }
    group.finish();
}

criterion_group!(benches, fields);
criterion_main!(benches);
