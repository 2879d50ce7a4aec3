//! A calibration's parts on a small session: `cargo bench --bench calibrate`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use metalith::Silent;
use metalith::calibrate::{MeasuredSet, Sampling, Session, Settings, Synthesizer};

fn calibration(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    metalith_testing::session::small_set(folder.path());
    let like = MeasuredSet::read(folder.path(), &Silent).expect("a set");
    let settings = Settings {
        sampling: Sampling {
            spectrum: 0.34,
            ..Sampling::default()
        },
        only: ["cd_bias", "gap", "zero_order"].map(String::from).to_vec(),
        ladder: false,
        exact: false,
        ..Settings::default()
    };
    let twins = Synthesizer::new(&like, &settings).expect("twins");
    let mut group = c.benchmark_group("calibrate");
    group.sample_size(10);
    // Cells are solved once and kept: what is timed is light through pillars to eight captures.
    group.bench_function("captures of a chip", |b| {
        b.iter(|| black_box(twins.with_effect("cd_bias", &[-8.0], &Silent)).expect("captures"));
    });
    let exposed = twins.with_effect("gap", &[5.0], &Silent).expect("captures");
    let set = twins.draw(&exposed, 1);
    let mut session = Session::new(&set, settings).expect("a session");
    let atlas = session.atlas(&Silent).expect("an atlas");
    group.bench_function("a diagnosis, simulations known", |b| {
        b.iter(|| black_box(session.diagnose(&atlas, &Silent)).expect("a diagnosis"));
    });
    group.finish();
}

criterion_group!(benches, calibration);
criterion_main!(benches);
