//! Information of each candidate measurement on each parameter: its normal equations by the simulator and the noise of the bench.

use metalith_core::{Progress, Result};
use nalgebra::DMatrix;
use ndarray::Array2;

use crate::bench_file::BenchFile;
use crate::candidates::{Candidates, sem_sites};
use metalith_attribution::Measurements;
use metalith_calibrate::Effect;
use metalith_calibrate::{Bench, BenchSampling};
use metalith_calibrate::{CellSource, RigorousCells};
use metalith_calibrate::{Data, Nuisances};
use metalith_calibrate::{FitProblem, Surrogate};
use metalith_calibrate::{MeasuredSet, Measurement, PerMeasurement};
use metalith_calibrate::{Simulator, WIDTH_ROOM_NM};

/// Measurements that are simulated at once: each holds an image for two sizes of every parameter.
const TOGETHER: usize = 12;

/// A measurement, exposed as it would be, and what it tells.
pub(crate) struct MeasurementInformation {
    /// Candidate with its scale set to the exposure, and its predicted frame.
    pub measurement: Measurement,
    /// Inner products of flux of each LED, black level, every parameter, and the residual, as
    /// [`metalith_attribution::NormalEquations`] has them.
    pub form: DMatrix<f64>,
    /// Pixels that count.
    pub pixels: f64,
}

/// Information of all candidates.
pub(crate) struct Information {
    pub measurements: Vec<MeasurementInformation>,
    /// Prior knowledge of flux and black level.
    pub prior: DMatrix<f64>,
    /// Information of the widths by SEM, if the bench offers them.
    pub widths: Option<DMatrix<f64>>,
    /// Number of shared nuisances, which stand first.
    pub shared: usize,
}

/// The effects that are tried on a set.
pub(crate) type EffectsOf<'a> = dyn Fn(&MeasuredSet) -> Result<Vec<Box<dyn Effect>>> + 'a;

/// Cells for a set, for simulators that follow one another.
pub(crate) fn cells_of(set: &MeasuredSet, sampling: BenchSampling, cache: Option<std::path::PathBuf>) -> CellSource {
    let bench = Bench::new(set, sampling);
    let (low, high) = bench.widths_nm();
    let widths = (low - WIDTH_ROOM_NM, high + WIDTH_ROOM_NM);
    CellSource::Rigorous(Box::new(RigorousCells::new(
        set.stack.cell.clone(),
        bench.wavelengths_nm(),
        widths,
        cache,
    )))
}

/// Simulate every candidate, and weigh what it tells with its noise; the cells come back for later use.
///
/// # Errors
/// If a cell cannot be solved, or the user stopped it.
pub(crate) fn information(
    candidates: &Candidates,
    bench: &BenchFile,
    sampling: BenchSampling,
    effects: &EffectsOf<'_>,
    mut cells: CellSource,
    progress: &dyn Progress,
) -> Result<(Information, CellSource)> {
    let mut out = Information {
        measurements: Vec::new(),
        prior: DMatrix::zeros(0, 0),
        widths: None,
        shared: bench.leds.len() + 1,
    };
    for batch in candidates.measurements.chunks(TOGETHER) {
        let mut set = candidates.set.clone();
        set.measurements = PerMeasurement::from(batch.to_vec());
        if let Some(offer) = bench.sem.filter(|_| out.measurements.is_empty()) {
            set.sem = sem_sites(&set, offer);
        }
        let simulator = Simulator::new(Bench::new(&set, sampling), cells, effects(&set)?);
        let nothing = vec![0.0; simulator.slots.len()];
        let surrogate = Surrogate::beside(&simulator, &nothing, false, progress)?;
        let exposed = exposed(&set, &surrogate, bench.peak);
        let data = Data::new(&exposed);
        let problem = FitProblem::new(&simulator, surrogate, &data);
        let slots: Vec<usize> = (0..nothing.len()).collect();
        let fit = problem.at(&slots, nothing, Nuisances::stated(&data));
        if out.measurements.is_empty() {
            out.prior = fit.nuisances.prior(&data, fit.equations.size());
            out.widths = bench.sem.map(|_| fit.equations.references.clone());
        }
        for ((c, measurement), form) in exposed.measurements.iter_enumerated().zip(&fit.equations.measurements) {
            out.measurements.push(MeasurementInformation {
                measurement: measurement.clone(),
                form: form.clone(),
                pixels: data.points(c) as f64,
            });
        }
        cells = simulator.cells;
    }
    Ok((out, cells))
}

/// The set with each measurement exposed so that its brightest pixel reaches a share of saturation, and showing what it would.
pub(crate) fn exposed(set: &MeasuredSet, surrogate: &Surrogate, peak: f64) -> MeasuredSet {
    let camera = set.camera;
    let room = (peak * camera.saturation_dn - camera.black_level_dn).max(1.0);
    let mut out = set.clone();
    for (measurement, grid) in out.measurements.iter_mut().zip(surrogate.base.iter()) {
        let light: Array2<f32> = grid.pixels([0.0; 2]);
        let brightest = light.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        // To three digits, as a person would note it.
        measurement.scale_dn = three_digits(room / f64::from(brightest));
        let filter = camera.filter.pixels_of(set.leds[measurement.led].channel);
        measurement.dn = light.mapv(|v| (camera.black_level_dn + measurement.scale_dn * f64::from(v).max(0.0)) as f32);
        measurement.noise = filter.map(|pixels| {
            let signal = |v: f32| f64::from(v) - camera.black_level_dn;
            Array2::from_shape_fn(measurement.dn.dim(), |at| {
                if pixels.has(at) {
                    camera.variance_dn2(signal(measurement.dn[at]), measurement.frames) as f32
                } else {
                    f32::INFINITY
                }
            })
        });
    }
    out
}

fn three_digits(v: f64) -> f64 {
    let unit = 10f64.powi(v.log10().floor() as i32 - 2);
    // By way of its text: no digits that nobody asked for.
    let rounded = (v / unit).round() * unit;
    format!("{rounded:.6e}").parse().unwrap_or(rounded)
}
