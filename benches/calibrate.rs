//! A calibration's parts on a small session: `cargo bench --bench calibrate`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use metalith::Silent;
use metalith::calibrate::{BenchSampling, MeasuredSet, Session, Settings, Synthesizer};

fn calibration(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    metalith_testing::session::small_set(folder.path());
    let like = MeasuredSet::read(folder.path(), &metalith::extract::PillarsAt::STATED, &Silent).expect("a set");
    let settings = Settings {
        sampling: BenchSampling {
            spectrum: 0.34,
            ..BenchSampling::default()
        },
        only: ["cd_bias", "defocus", "zero_order"].map(String::from).to_vec(),
        compare_fidelities: false,
        refine: false,
        ..Settings::default()
    };
    let synthesizer = Synthesizer::new(&like, &settings).expect("a synthesizer");
    let mut group = c.benchmark_group("calibrate");
    group.sample_size(10);
    // Cells are solved once and kept: the time is that of light through pillars to eight measurements.
    group.bench_function("images of a chip", |b| {
        b.iter(|| black_box(synthesizer.with_effect("cd_bias", &[-8.0], &Silent)).expect("measurements"));
    });
    let exposed = synthesizer
        .with_effect("defocus", &[5.0], &Silent)
        .expect("measurements");
    let set = synthesizer.draw(&exposed, 1);
    let session = Session::new(&set, settings).expect("a session");
    let simulations = session.simulate(&Silent).expect("simulations");
    group.bench_function("a diagnosis with known simulations", |b| {
        b.iter(|| black_box(session.diagnose(&simulations, &Silent)).expect("a diagnosis"));
    });
    group.finish();
}

criterion_group!(benches, calibration);
criterion_main!(benches);
