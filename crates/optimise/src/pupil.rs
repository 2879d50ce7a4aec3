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

use std::f64::consts::{PI, TAU};

use num_complex::{Complex32, Complex64};

use super::PixelWindow;
use super::focus::Lens;
use super::rings::ring_of;
use metalith_core::{Error, Result};
use metalith_wave::kernels::{fft_size, raised_cosine};

/// Cells an axis that a site is spread over.
const SPREAD: usize = 4;
/// Part of the window that is used, 1 / 1.25 of it. The rest keeps aliases of the gridding, which are of
/// exp(-pi SPREAD sqrt(1 - 1 / 1.25)) = 4e-3 of the field at the edge of that part, away from it.
pub const USED: f64 = 0.8;
/// Shape of the spreading kernel exp(SHAPE (sqrt(1 - (z / 2)^2) - 1)), 0.97 pi SPREAD (1 - USED / 2)
/// (Barnett, Magland, af Klinteberg 2019).
const SHAPE: f64 = 0.97 * PI * SPREAD as f64 * (1.0 - 0.5 * USED);
/// Samples a cell of the tabulated spreading kernel.
const SAMPLES: usize = 512;

/// What each ring of unit transmission puts into each cell of directions.
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
    /// The kernel of a lens lit at an angle [rad] in the x-z plane, over a window whose middle is
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
            return Err(Error::invalid(
                format!(
                    "a window of {} um needs a transform of {size} points an axis",
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

/// Where light comes from and goes to.
struct Geometry<'l> {
    lens: &'l Lens,
    wavelength_um: f64,
    sine: f64,
    /// Where the chief ray lands, and how far that is.
    landing_um: f64,
    distance_um: f64,
    side_um: f64,
    offset_um: f64,
    scale: f64,
}

/// One site above the x axis, and with it its mirror image below.
struct Site {
    ring: u32,
    /// Direction in cells.
    q: (f64, f64),
    value: Complex64,
}

impl<'l> Geometry<'l> {
    fn new(lens: &'l Lens, wavelength_um: f64, angle_rad: f64, window: PixelWindow, offset_um: f64) -> Self {
        let pitch2 = lens.rings.lattice().pitch_um().powi(2);
        Self {
            lens,
            wavelength_um,
            sine: angle_rad.sin(),
            landing_um: lens.gap_um * angle_rad.tan(),
            distance_um: lens.gap_um / angle_rad.cos(),
            side_um: window.side_um(),
            offset_um,
            // Root of the area of a sample over that of the lens; the number of samples comes later.
            scale: window.side_um() / (lens.rings.sites() as f64 * pitch2).sqrt(),
        }
    }

    /// Least and greatest direction along x, and greatest along y, in cells.
    fn extent(&self) -> (f64, f64, f64) {
        let radius = 0.5e-3 * f64::from(self.lens.rings.diameter_nm());
        let mut extent = (f64::MAX, f64::MIN, 0.0f64);
        for i in 0..=180 {
            let (sin, cos) = (PI * f64::from(i) / 180.0).sin_cos();
            let q = self.site(radius * cos, radius * sin, 0, false).q;
            extent = (extent.0.min(q.0), extent.1.max(q.0), extent.2.max(q.1.abs()));
        }
        extent
    }

    fn site(&self, x: f64, y: f64, ring: u32, with_value: bool) -> Site {
        let (z, x0) = (self.lens.gap_um, self.landing_um);
        let dx = x0 - x;
        let r2 = dx * dx + y * y + z * z;
        let r = r2.sqrt();
        let q_x = (dx / r - self.sine) / self.wavelength_um;
        // The field is even in y: of a site and its mirror image, one stands for both.
        let q = (q_x * self.side_um, y / r / self.wavelength_um * self.side_um);
        if !with_value {
            return Site {
                ring,
                q,
                value: Complex64::ZERO,
            };
        }
        // R - R0 without cancellation, and the incident wave.
        let path = (x * x - 2.0 * x * x0 + y * y) / (r + self.distance_um) + x * self.sine;
        let turns = path / self.wavelength_um + q_x * self.offset_um;
        let k = TAU / self.wavelength_um;
        let area = self.lens.rings.lattice().pitch_um().powi(2);
        let amplitude = self.scale * area * z / (TAU * r2);
        let value = amplitude * Complex64::new(1.0 / r, -k) * Complex64::cis(TAU * (turns - turns.round()));
        Site { ring, q, value }
    }

    fn for_each(&self, with_value: bool, mut visit: impl FnMut(&Site)) {
        let lattice = self.lens.rings.lattice();
        let half = lattice.sites() / 2;
        for iy in half..lattice.sites() {
            let y = lattice.coordinate_um(iy);
            for ix in 0..lattice.sites() {
                if self.lens.rings.ring_at(ix, iy).is_some() {
                    let ring = ring_of(lattice.half_radius2(ix, iy)) as u32;
                    visit(&self.site(lattice.coordinate_um(ix), y, ring, with_value));
                }
            }
        }
    }
}

/// The kernel that sites are spread with, tabulated from its middle to its end.
struct Spreading {
    table: Vec<f32>,
}

impl Spreading {
    fn new() -> Self {
        let count = SPREAD / 2 * SAMPLES;
        let table = (0..=count + 1)
            .map(|i| spreading(i as f64 / SAMPLES as f64) as f32)
            .collect();
        Self { table }
    }

    /// First cell of those that a place is spread over, and their weights.
    fn weights(&self, at: f64) -> (i32, [f32; SPREAD]) {
        let first = first_cell(at);
        let mut weights = [0.0; SPREAD];
        for (i, weight) in weights.iter_mut().enumerate() {
            let z = ((first + i as f64 - at).abs() * SAMPLES as f64) as f32;
            let low = z as usize;
            let part = z - low as f32;
            *weight = self.table[low] + part * (self.table[low + 1] - self.table[low]);
        }
        (first as i32, weights)
    }

    /// Visit every cell at y >= 0 that a site and its mirror image touch.
    fn spread(&self, site: &Site, first_x: i32, cells: (usize, usize), mut visit: impl FnMut(usize, f32)) {
        let (n_x, w_x) = self.weights(site.q.0);
        let (n_y, w_y) = self.weights(site.q.1);
        for (j, w_y) in w_y.iter().enumerate() {
            let y = n_y + j as i32;
            for y in [y, -y] {
                if (0..cells.1 as i32).contains(&y) {
                    let base = y as usize * cells.0 + (n_x - first_x) as usize;
                    for (i, w_x) in w_x.iter().enumerate() {
                        visit(base + i, w_x * w_y);
                    }
                }
            }
        }
    }
}

/// First cell of those that a place is spread over.
fn first_cell(at: f64) -> f64 {
    (at - 0.5 * SPREAD as f64).ceil()
}

/// exp(SHAPE (sqrt(1 - (z / 2)^2) - 1)) within two cells, zero outside.
fn spreading(z: f64) -> f64 {
    let inside = 1.0 - (2.0 * z / SPREAD as f64).powi(2);
    if inside < 0.0 {
        0.0
    } else {
        (SHAPE * (inside.sqrt() - 1.0)).exp()
    }
}

/// By distance from the middle of the window in samples, 0 to size / 2: one over the squared transform of
/// the spreading kernel, times a fade to zero at the end of the part that is used.
fn intensity_weights(size: usize) -> Vec<f32> {
    /// Midpoint rule; the kernel is smooth but for steps of exp(-SHAPE) at its ends.
    const POINTS: u32 = 400;
    /// Where the fade begins, as part of the window's half.
    const FADE: f64 = 0.9 * USED;
    (0..=size / 2)
        .map(|m| {
            let x = m as f64 / size as f64;
            let step = SPREAD as f64 / f64::from(POINTS);
            let transform = (0..POINTS)
                .map(|i| -0.5 * SPREAD as f64 + (f64::from(i) + 0.5) * step)
                .map(|z| spreading(z) * (TAU * z * x).cos())
                .sum::<f64>()
                * step;
            let faded = raised_cosine((2.0 * x - FADE) / (USED - FADE));
            (faded / transform.powi(2)) as f32
        })
        .collect()
}
