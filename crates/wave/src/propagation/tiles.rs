//! An element cut into overlapping tiles: how much power leaves which part of it in which direction.
//!
//! Squared windows of the tiles add up to one everywhere, so that no power is lost or counted twice. Each window bends the light
//! as the way to the plane does (Fresnel): the transform of a tile is then the light that it alone brings to each place of the
//! plane, and what is lost is that tiles interfere, which matters over wavelength * distance / edge of a tile.

use std::f64::consts::PI;

use metalith_pillars::Lattice;
use num_complex::Complex32;

/// Tiling of an element: sine windows that overlap by half add up to one when squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tiling {
    /// Places of the lattice's grid an axis of a tile, a power of two.
    pub side: usize,
    /// Wavelength times distance of the plane (um^2).
    spread_um2: f64,
}

/// Edge of a tile over sqrt(wavelength * distance). Larger tiles have finer maps of light that leaves along the axis, and coarser
/// ones of light that leaves obliquely, which another curvature would bring to the plane. Against the field of lenses of 1 mm
/// and 2.4 mm, squares of 94 um from tiles of 90, 125 and 180 um err by 4.5, 3.2 and 1.9 % along the axis (rms, mean over two
/// elements and three wavelengths) and by 8, 13 and 25 % at 24 degrees where tiles are bent for the axis; bent by [`OBLIQUE`],
/// those of 125 and 180 um by 3.7 and 2.7 %, and by 7 and 8 %.
const BEST_EDGE: f64 = 5.0;
/// Fewer places would not distinguish directions, more would be a separate block.
const SIDES: [f64; 2] = [16.0, 512.0];
/// Over the distance of the plane, the distance that the light of a tile is bent for: the way to the plane of light that leaves at
/// 17 degrees (cosine to the power of -3), between the axis and the end of the field of a lens of 60 degrees.
const OBLIQUE: f64 = 1.15;

impl Tiling {
    /// Tiling for light that lands at a distance from the pillars (um).
    pub(crate) fn at(lattice: &Lattice, wavelength_um: f64, distance_um: f64) -> Self {
        let [x, y] = lattice.steps_um();
        let places = BEST_EDGE * (wavelength_um * distance_um).sqrt() / x.max(y);
        let [least, most] = SIDES.map(f64::log2);
        Self {
            side: 1 << places.log2().round().clamp(least, most) as usize,
            spread_um2: wavelength_um * distance_um,
        }
    }

    /// Step from one tile to the next (places).
    pub(crate) fn hop(self) -> usize {
        self.side / 2
    }

    /// Distance at which two neighbouring directions of a tile land from one another, along each axis (um).
    pub(crate) fn landing_um(self, lattice: &Lattice) -> [f64; 2] {
        lattice
            .steps_um()
            .map(|step| self.spread_um2 / (self.side as f64 * step))
    }

    /// Window of a tile along an axis whose places are `step_um` apart.
    fn window(self, step_um: f64) -> Vec<Complex32> {
        let half = 0.5 * self.side as f64;
        let at = |i: usize| {
            let place = i as f64 + 0.5;
            let bent = PI * ((place - half) * step_um).powi(2) / (OBLIQUE * self.spread_um2);
            let height = (PI * place / self.side as f64).sin();
            Complex32::new((height * bent.cos()) as f32, (height * bent.sin()) as f32)
        };
        (0..self.side).map(at).collect()
    }

    /// Directions of a tile.
    pub(crate) fn directions(self) -> usize {
        self.side * self.side
    }
}

/// A tile with light in it.
pub(super) struct Tile<'a> {
    /// Amplitude of each direction, `[bin along x][bin along y]`; its square times [`power_scale`] is power (um^2).
    pub spectrum: &'a [Complex32],
    /// First site along x and y; may be before the lattice.
    pub first: [i64; 2],
    /// Middle from the element's centre (um).
    pub middle_um: [f64; 2],
}

/// Power (um^2) of a bin whose amplitude is one.
pub(super) fn power_scale(lattice: &Lattice, tiling: Tiling) -> f64 {
    lattice.cell_um2() / tiling.directions() as f64
}

/// Visit the tiles of an element whose rows `fill_row` gives.
pub(super) fn for_tiles(
    lattice: &Lattice,
    tiling: Tiling,
    fill_row: impl Fn(usize, &mut [Complex32]),
    mut visit: impl FnMut(&Tile<'_>),
) {
    let (n, steps) = (lattice.sites(), lattice.steps_um());
    let [_, rows] = lattice.reach();
    let (side, hop) = (tiling.side, tiling.hop());
    let middle_um =
        |axis: usize, first: i64| lattice.place_um(axis, 0) + (first as f64 + 0.5 * (side as f64 - 1.0)) * steps[axis];
    let fft = metalith_fourier::forward::<f32>(side);
    let mut work = vec![Complex32::ZERO; fft.get_inplace_scratch_len()];
    let windows = steps.map(|step| tiling.window(step));
    // Rows of the tiles of one strip; half of them serve the next strip as well.
    let mut strip = vec![Complex32::ZERO; side * n];
    let mut tile = vec![Complex32::ZERO; side * side];
    let mut turned = tile.clone();
    // The first strip begins half a tile before the lattice, so that every site is in two of them.
    for first_row in (-(hop as i64)..n as i64).step_by(hop) {
        strip.copy_within(hop * n.., 0);
        for (k, row) in strip.chunks_exact_mut(n).enumerate().skip(hop) {
            match usize::try_from(first_row + k as i64)
                .ok()
                .filter(|iy| rows.contains(iy))
            {
                Some(iy) => fill_row(iy, row),
                None => row.fill(Complex32::ZERO),
            }
        }
        for first in (-(hop as i64)..n as i64).step_by(hop) {
            if !cut(&strip, n, first, &windows, &mut tile) {
                continue;
            }
            fft.process_with_scratch(&mut tile, &mut work);
            transpose(&tile, side, &mut turned);
            fft.process_with_scratch(&mut turned, &mut work);
            let first = [first, first_row];
            visit(&Tile {
                spectrum: &turned,
                first,
                middle_um: [0, 1].map(|axis| middle_um(axis, first[axis])),
            });
        }
    }
}

/// Directions that the light of a tile leaves in. Frequencies of a lattice are known but for its orders: each is taken for
/// the one whose sines are nearest to where light is meant to go.
pub(super) struct DepartureDirections {
    towards: [f64; 2],
    /// Sines of the bins along x and along y, each moved by whole periods of the grid.
    whole: [Vec<f64>; 2],
    /// Sines half a period away along both axes, on a hexagonal lattice.
    half: Option<[Vec<f64>; 2]>,
}

impl DepartureDirections {
    /// Directions for light that arrives with these sines.
    pub(crate) fn new(
        lattice: &Lattice,
        tiling: Tiling,
        wavelength_um: f64,
        arriving: [f64; 2],
        towards: [f64; 2],
    ) -> Self {
        let steps = lattice.steps_um();
        let moved = |offset: f64| {
            [0, 1].map(|a| {
                let period = wavelength_um / steps[a];
                let sine = |k: usize| {
                    let own = k as f64 / tiling.side as f64 * period + arriving[a] + offset * period;
                    own + ((towards[a] - own) / period).round() * period
                };
                (0..tiling.side).map(sine).collect()
            })
        };
        Self {
            towards,
            whole: moved(0.0),
            half: (!lattice.is_square()).then(|| moved(0.5)),
        }
    }

    /// Sines of a bin along x and one along y.
    #[inline]
    pub(crate) fn sines(&self, kx: usize, ky: usize) -> [f64; 2] {
        let of = |[x, y]: &[Vec<f64>; 2]| [x[kx], y[ky]];
        let away = |s: [f64; 2]| (s[0] - self.towards[0]).powi(2) + (s[1] - self.towards[1]).powi(2);
        let whole = of(&self.whole);
        match self.half.as_ref().map(of) {
            Some(half) if away(half) < away(whole) => half,
            _ => whole,
        }
    }
}

/// Cuts a tile out of a strip of rows of `n` sites, by its windows along x and y. Whether there is light in it.
fn cut(
    strip: &[Complex32],
    n: usize,
    first: i64,
    [along_x, along_y]: &[Vec<Complex32>; 2],
    tile: &mut [Complex32],
) -> bool {
    let mut light = false;
    let rows = strip.chunks_exact(n).zip(tile.chunks_exact_mut(along_x.len()));
    for ((row, out), wy) in rows.zip(along_y) {
        for ((k, to), wx) in out.iter_mut().enumerate().zip(along_x) {
            let at = first + k as i64;
            *to = match usize::try_from(at).ok().and_then(|at| row.get(at)) {
                Some(t) => t * (wx * wy),
                None => Complex32::ZERO,
            };
            light |= *to != Complex32::ZERO;
        }
    }
    light
}

fn transpose(tile: &[Complex32], side: usize, turned: &mut [Complex32]) {
    for (i, row) in tile.chunks_exact(side).enumerate() {
        for (j, value) in row.iter().enumerate() {
            turned[j * side + i] = *value;
        }
    }
}
