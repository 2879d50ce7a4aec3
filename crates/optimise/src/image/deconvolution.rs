//! The merit `deconvolution`: the error to be expected of images after inverse filtering, over
//! wavelengths and field angles.

use std::ops::Range;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use crate::image::buffer_pool::BufferPool;
use crate::image::image_error::Spectrum;
use crate::image::imaging::{Imaging, OpticalTransfer};
use crate::image::pupil::Pupil;
use crate::image::views::{Views, window_offset_um};
use crate::merit::focus::Lens;
use crate::rings::mapping::Mapping;
use metalith_cell::CellModel;
use metalith_core::{Error, Progress, Result};

/// Expected image error as a function of the phases of the rings. Larger merits are better: the merit is
/// less the mean square error, in units of the variance of the scene.
pub struct Deconvolution {
    pub(crate) views: Views,
    pub(crate) rings: usize,
    pub(crate) mapping: Mapping,
    pub(crate) spectrum: Spectrum,
    /// `[angle][wavelength]`.
    pub(crate) pupils: Vec<Vec<Pupil>>,
    /// Transmission over its full value by whole width, one for each wavelength.
    pub(crate) tables: Vec<Vec<Complex64>>,
    pub(crate) buffers: BufferPool,
}

/// Wavelengths of one channel at one angle, by index.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Channel {
    pub angle: usize,
    pub lengths: Vec<usize>,
}

impl Deconvolution {
    /// Build the kernels of all views.
    ///
    /// # Errors
    /// If the views are empty or do not fit `memory_bytes`, the cell does not cover them, or the user
    /// stopped.
    pub fn new(
        lens: &Lens,
        views: Views,
        cell: &dyn CellModel,
        mapping: Mapping,
        memory_bytes: u64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (angles, lengths) = (views.angles_rad.len(), views.wavelengths_um.len());
        if angles == 0 || views.channels == 0 || lengths < 2 * views.channels || !views.window.pixels.is_multiple_of(2)
        {
            return Err(Error::refused(
                "optimise/views-unsuitable",
                format!(
                    "{lengths} wavelengths in {} channels at {angles} angles",
                    views.channels
                ),
                "give at least two wavelengths a channel (a smaller `step_nm` of [optimise.views], or none), one angle, and an \
                 even number of pixels",
            ));
        }
        let widest = usize::from(mapping.max_width_nm()) + 1;
        let tables = views
            .wavelengths_um
            .par_iter()
            .map(|&wavelength| {
                let full = cell.full_transmission(wavelength)?;
                let pure = cell.transmissions(wavelength, widest as u16)?;
                Ok(pure.into_iter().map(|t| t / full).collect())
            })
            .collect::<Result<Vec<_>>>()?;
        progress.begin("kernels of all views", (angles * lengths) as u64);
        let used = std::sync::atomic::AtomicU64::new(0);
        let pupils = views
            .angles_rad
            .par_iter()
            .map(|&angle| {
                let offset = window_offset_um(lens, angle, views.window.side_um());
                views
                    .wavelengths_um
                    .par_iter()
                    .map(|&wavelength| {
                        progress.check_stopped()?;
                        let pupil = Pupil::new(lens, wavelength, angle, views.window, offset)?;
                        let bytes = pupil.bytes();
                        let so_far = used.fetch_add(bytes, std::sync::atomic::Ordering::Relaxed) + bytes;
                        if so_far > memory_bytes {
                            return Err(Error::refused(
                                "optimise/too-much-memory",
                                format!(
                                    "the kernels of {} views take more than {memory_bytes} bytes",
                                    angles * lengths
                                ),
                                "take fewer wavelengths or angles or a smaller window, or raise `memory_mb`",
                            ));
                        }
                        progress.advance(1);
                        Ok(pupil)
                    })
                    .collect()
            })
            .collect::<Result<Vec<Vec<_>>>>()?;
        Ok(Self {
            rings: lens.rings.len(),
            spectrum: Spectrum::new(&views.scene, &views.noise, views.window),
            views,
            mapping,
            pupils,
            tables,
            buffers: BufferPool::default(),
        })
    }

    /// Views that the merit is taken over.
    pub fn views(&self) -> &Views {
        &self.views
    }

    /// Bytes that all kernels take.
    pub fn bytes(&self) -> u64 {
        self.pupils.iter().flatten().map(Pupil::bytes).sum()
    }

    /// Transfer function of each view, `[angle][wavelength]`, with pillars of `widths_nm[k]` in ring `k`.
    /// Shape of each: `[j][i]`, frequencies (i, j) / window from zero to the pixels' Nyquist.
    fn transfers(&self, widths_nm: &[f64]) -> Vec<Vec<OpticalTransfer>> {
        (0..self.pupils.len())
            .into_par_iter()
            .map(|angle| {
                (0..self.tables.len())
                    .into_par_iter()
                    .map(|length| {
                        let t = self.transmissions(length, widths_nm);
                        let (pupil, buffers) = (&self.pupils[angle][length], self.buffers.take());
                        let mut imaging = Imaging::new(pupil, self.views.window, buffers);
                        let transfer = imaging.transfer(&t.0, &t.1);
                        self.buffers.put_back(imaging);
                        transfer
                    })
                    .collect()
            })
            .collect()
    }

    /// Expected peak signal-to-noise ratio of restored images (dB), white being one: over all views, and at
    /// each angle.
    pub fn expected_psnr(&self, widths_nm: &[f64]) -> (f64, Vec<f64>) {
        let transfers = self.transfers(widths_nm);
        let mut errors = vec![0.0; self.pupils.len()];
        for channel in self.channels(|all| all.collect()) {
            let blurs = channel
                .lengths
                .iter()
                .map(|&l| &transfers[channel.angle][l][..])
                .collect::<Vec<_>>();
            errors[channel.angle] += self.error(&blurs, 0.0, None) / self.views.channels as f64;
        }
        let decibel = |e: f64| -10.0 * e.log10();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        (decibel(mean), errors.into_iter().map(decibel).collect())
    }

    /// Mean square error of one channel: each wavelength with its own filter, and all with one.
    pub(crate) fn error(&self, blurs: &[&[Complex32]], scale: f64, mut slopes: Option<&mut [Vec<Complex64>]>) -> f64 {
        let shared = self.views.shared_filter;
        let own = (1.0 - shared) / blurs.len() as f64;
        let mut sum = shared * self.spectrum.error(blurs, scale * shared, slopes.as_deref_mut());
        for i in 0..blurs.len() {
            let slope = slopes.as_deref_mut().map(|s| &mut s[i..=i]);
            sum += own * self.spectrum.error(&blurs[i..=i], scale * own, slope);
        }
        sum
    }

    /// Every channel at every angle, with the wavelengths that `choose` takes from all of it.
    pub(crate) fn channels(&self, mut choose: impl FnMut(Range<usize>) -> Vec<usize>) -> Vec<Channel> {
        let (count, channels) = (self.tables.len(), self.views.channels);
        (0..self.pupils.len() * channels)
            .map(|i| {
                let channel = i % channels;
                Channel {
                    angle: i / channels,
                    lengths: choose(channel * count / channels..(channel + 1) * count / channels),
                }
            })
            .collect()
    }

    pub(crate) fn transmissions(&self, length: usize, widths_nm: &[f64]) -> (Vec<f32>, Vec<f32>) {
        let table = &self.tables[length];
        widths_nm
            .iter()
            .map(|&w| {
                let (low, part) = bracket(table, w);
                let t = table[low] + (table[low + 1] - table[low]) * part;
                (t.re as f32, t.im as f32)
            })
            .unzip()
    }
}

/// The whole width below one, and how far it is to the next.
pub(crate) fn bracket(table: &[Complex64], width_nm: f64) -> (usize, f64) {
    let low = (width_nm.max(0.0) as usize).min(table.len() - 2);
    (low, width_nm - low as f64)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::rings::mapping::tests::published;
    use crate::{PixelWindow, Rings, Start};
    use metalith_cell::PublishedCell;
    use metalith_core::Silent;
    use metalith_pillars::Lattice;

    pub(crate) fn small() -> (Lens, Deconvolution) {
        let rings = Rings::new(Lattice::covering(60_000, 350).unwrap(), 60_000).unwrap();
        let lens = Lens {
            rings,
            distance_um: 144.0,
        };
        let views = Views {
            wavelengths_um: vec![0.45, 0.5, 0.6, 0.65],
            angles_rad: vec![0.0, 0.26],
            channels: 2,
            window: PixelWindow {
                pixels: 20,
                pixel_um: 2.93,
            },
            ..Views::default()
        };
        let cell = PublishedCell::new(350);
        let problem = Deconvolution::new(&lens, views, &cell, published(), 1 << 28, &Silent).unwrap();
        (lens, problem)
    }

    /// A sharp lens promises better images than phases at random.
    #[test]
    fn a_lens_is_better_than_a_diffuser() {
        let (lens, problem) = small();
        let psnr = |start: Start| {
            let waves = start.waves(&lens, 1);
            let widths = waves.iter().map(|&t| problem.mapping.width_nm(t).0).collect::<Vec<_>>();
            problem.expected_psnr(&widths).0
        };
        assert!(psnr(Start::Hyperbolic { wavelength_um: 0.55 }) > psnr(Start::Random) + 1.0);
    }

    #[test]
    fn memory_is_bounded() {
        let (lens, problem) = small();
        let cell = PublishedCell::new(350);
        let views = problem.views.clone();
        let built = Deconvolution::new(&lens, views, &cell, published(), problem.bytes() / 2, &Silent);
        assert!(built.is_err());
    }
}
