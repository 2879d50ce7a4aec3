//! The kernel of one wavelength and angle over a wide window: every site put on a grid of directions.
//!
//! Around the chief ray the path from a site u to the sensor is expanded to first order in the place x
//! on the sensor: R(u, X0 + x) = R(u, X0) + x grad R. The gradient is the direction of the ray from u to
//! the chief ray's landing, exact for every u; so the field over the window is a Fourier sum over
//! directions q = grad R / wavelength, E(x) = sum of c(u) exp(2 pi i q(u) x). What is left out, x^2 / 2R
//! and its changes with u, is a common phase, a stretch of the window by x^2 (no more than x^2 sin / f),
//! and terms of k u^2 x^2 / R^3.
//!
//! The sum is made by gridding: each site is spread over four by four cells of a grid of spacing
//! 1 / window in q, with a kernel whose transform is divided out after the fast Fourier transform. What a
//! ring puts into a cell is summed once; a step then is a sparse matrix and the transform.

mod geometry;
mod gridding;

use metalith_core::{Error, Result};
use metalith_wave::kernels::fft_size;
use num_complex::Complex32;

use crate::PixelWindow;
use crate::merit::focus::Lens;
use geometry::Geometry;
pub(crate) use gridding::USED;
use gridding::{SPREAD, Spreading, first_cell, intensity_weights};

/// Contribution of each ring of unit transmission to each cell of directions.
///
/// The field is even in y, and so are the cells: only those at zero and above are kept.
pub struct Pupil {
    /// Side of the transform.
    pub size: usize,
    /// First cell along x.
    pub first_x: i32,
    /// Cells along x, and along y from zero on.
    pub cells: (usize, usize),
    /// First ring that touches each cell, and where its run in `weights` begins; one entry more at the end.
    runs: Vec<(u32, u32)>,
    re: Vec<f32>,
    im: Vec<f32>,
    /// Transform of the spreading kernel at each place of the window, from 0 to size / 2, and the fade
    /// to zero beyond the part of the window that is used: factor of the intensity.
    pub weight: Vec<f32>,
}

impl Pupil {
    /// The kernel of a lens lit at an angle (rad) in the x-z plane, over a window whose middle is
    /// `offset_um` along x from where the chief ray lands.
    ///
    /// Intensities are such that their sum over the transform's samples is the share of the incident
    /// power that lands in the window, for transmissions as given by the rigorous cell divided by its full
    /// transmission.
    ///
    /// # Errors
    /// If the transform would be larger than 8192 an axis.
    pub fn new(lens: &Lens, wavelength_um: f64, angle_rad: f64, window: PixelWindow, offset_um: f64) -> Result<Self> {
        let mut geometry = Geometry::new(lens, wavelength_um, angle_rad, window, offset_um);
        let (low, high, top) = geometry.extent();
        let half = SPREAD as i32 / 2;
        let (first_x, last_x) = (low.floor() as i32 - half, high.ceil() as i32 + half);
        let cells = ((last_x - first_x + 1) as usize, (top.ceil() as i32 + half + 1) as usize);
        // Intensities have twice the bandwidth; only frequencies up to the pixels' must be free of aliases.
        let needed = cells.0.max(2 * cells.1) + window.pixels / 2 + 1;
        let size = fft_size(needed);
        if size > 8192 {
            return Err(Error::refused(
                "optimise/window-too-large",
                format!(
                    "a window of {} um needs a transform of {size} points along each axis, which is too large",
                    window.side_um()
                ),
                "use a smaller window or lens",
            ));
        }
        geometry.scale /= size as f64;
        let spreading = Spreading::new();
        let mut pupil = Self {
            size,
            first_x,
            cells,
            runs: Vec::new(),
            re: Vec::new(),
            im: Vec::new(),
            weight: intensity_weights(size),
        };
        pupil.fill(&geometry, &spreading);
        Ok(pupil)
    }

    /// Bytes that the kernel takes.
    pub fn bytes(&self) -> u64 {
        8 * (self.runs.len() + self.re.len()) as u64
    }

    fn fill(&mut self, geometry: &Geometry<'_>, spreading: &Spreading) {
        let (nx, ny) = self.cells;
        let first_x = self.first_x;
        // Rings of the sites whose spread begins at a cell, then of the sites that touch it.
        let base = -(SPREAD as i32) / 2;
        let rows = ny + SPREAD;
        let mut begins = vec![(u32::MAX, 0u32); nx * rows];
        geometry.for_each(false, |site| {
            let x = (first_cell(site.q.0) as i32 - first_x) as usize;
            let y = (first_cell(site.q.1) as i32 - base) as usize;
            let b = &mut begins[y * nx + x];
            *b = (b.0.min(site.ring), b.1.max(site.ring + 1));
        });
        let mut bounds = vec![(u32::MAX, 0u32); nx * ny];
        for y in 0..rows {
            for x in 0..nx {
                let (low, high) = begins[y * nx + x];
                if low >= high {
                    continue;
                }
                for j in 0..SPREAD as i32 {
                    let at = (y as i32 + base + j).unsigned_abs() as usize;
                    for cell in &mut bounds[at * nx + x..at * nx + x + SPREAD] {
                        *cell = (cell.0.min(low), cell.1.max(high));
                    }
                }
            }
        }
        let mut start = 0;
        self.runs = Vec::with_capacity(bounds.len() + 1);
        for (first, end) in bounds {
            let first = first.min(end);
            self.runs.push((first, start));
            start += end - first;
        }
        self.runs.push((0, start));
        self.re = vec![0.0; start as usize];
        self.im = vec![0.0; start as usize];
        geometry.for_each(true, |site| {
            let value = Complex32::new(site.value.re as f32, site.value.im as f32);
            spreading.spread(site, first_x, (nx, ny), |cell, weight| {
                let (first, start) = self.runs[cell];
                let at = (start + site.ring - first) as usize;
                self.re[at] += weight * value.re;
                self.im[at] += weight * value.im;
            });
        });
    }

    /// Cells from the transmissions of the rings, `[y][x]`.
    pub fn forward(&self, t_re: &[f32], t_im: &[f32], cells: &mut [Complex32]) {
        for (cell, pair) in cells.iter_mut().zip(self.runs.windows(2)) {
            let (first, start) = (pair[0].0 as usize, pair[0].1 as usize);
            let count = pair[1].1 as usize - start;
            let (w_re, w_im) = (&self.re[start..start + count], &self.im[start..start + count]);
            let (t_re, t_im) = (&t_re[first..first + count], &t_im[first..first + count]);
            let (mut re, mut im) = (0.0, 0.0);
            for i in 0..count {
                re += w_re[i] * t_re[i] - w_im[i] * t_im[i];
                im += w_re[i] * t_im[i] + w_im[i] * t_re[i];
            }
            *cell = Complex32::new(re, im);
        }
    }

    /// The adjoint of [`Pupil::forward`], added to `t_re`, `t_im`.
    pub fn adjoint(&self, cells: &[Complex32], t_re: &mut [f32], t_im: &mut [f32]) {
        for (cell, pair) in cells.iter().zip(self.runs.windows(2)) {
            let (first, start) = (pair[0].0 as usize, pair[0].1 as usize);
            let count = pair[1].1 as usize - start;
            let (w_re, w_im) = (&self.re[start..start + count], &self.im[start..start + count]);
            let (t_re, t_im) = (&mut t_re[first..first + count], &mut t_im[first..first + count]);
            for i in 0..count {
                t_re[i] += w_re[i] * cell.re + w_im[i] * cell.im;
                t_im[i] += w_re[i] * cell.im - w_im[i] * cell.re;
            }
        }
    }
}
