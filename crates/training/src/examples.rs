//! Examples that the network learns from: pieces of photographs, and noise on them.

use metalith_core::text::hex;
use metalith_core::{Error, Result};
use ndarray::{Array3, Axis};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sha2::{Digest, Sha256};

use metalith_prior::parts::over_squares;
use metalith_prior::{COLOURS, with_noise};

/// Least and largest deviation of the noise, of white being one; drawn evenly in its logarithm.
const NOISE: [f32; 2] = [0.01, 0.4];
/// Deviation of the logarithm of how noise differs from corner to corner of a piece, and from colour to colour.
const CORNERS: f32 = 0.5;
const COLOUR: f32 = 0.3;
/// Share of pieces that are darkened, and to what at most.
const DARKENED: f64 = 0.5;
const DARKEST: f32 = 0.4;
/// Share of pieces whose colours are exchanged: there are few photographs.
const EXCHANGED: f64 = 0.3;
/// One picture of so many is held out, and at least one.
const HELD_OUT: usize = 12;

/// True if the picture of this number is held out.
pub(crate) fn is_held_out(number: usize) -> bool {
    number.is_multiple_of(HELD_OUT)
}

/// Photographs to learn from, and others to be judged by.
#[derive(Clone, Debug)]
pub struct Photographs {
    learnt: Vec<Array3<f32>>,
    held_out: Vec<Array3<f32>>,
}

/// A piece of a photograph with noise.
pub(crate) struct Example {
    pub clean: Array3<f32>,
    pub noisy: Array3<f32>,
    /// Deviation of the noise of each value.
    pub deviation: Array3<f32>,
}

impl Photographs {
    /// Pictures `[row, column, colour]` in sRGB values from 0 to 1, each at least `piece` pixels a side.
    ///
    /// # Errors
    /// If there are fewer than two, or one is too small.
    pub fn new(pictures: Vec<(String, Array3<f32>)>, piece: usize) -> Result<Self> {
        let invalid = |what: String| {
            Error::refused(
                "train/too-few-photographs",
                what,
                "give a folder of at least two larger photographs in colour",
            )
        };
        if pictures.len() < 2 {
            return Err(invalid(format!(
                "{} photographs are too few for training",
                pictures.len()
            )));
        }
        if let Some((name, small)) = pictures.iter().find(|(_, p)| p.dim().0.min(p.dim().1) < piece) {
            let (rows, columns, _) = small.dim();
            return Err(invalid(format!(
                "`{name}` has {columns} x {rows} pixels, fewer than a piece of {piece}"
            )));
        }
        let (mut learnt, mut held_out) = (Vec::new(), Vec::new());
        for (i, (_, picture)) in pictures.into_iter().enumerate() {
            if is_held_out(i) {
                held_out.push(picture);
                continue;
            }
            let (rows, columns, _) = picture.dim();
            if rows.min(columns) >= 2 * piece {
                learnt.push(halved(&picture));
            }
            learnt.push(picture);
        }
        Ok(Self { learnt, held_out })
    }

    /// SHA-256 of all pixels.
    pub fn digest(&self) -> String {
        let mut hasher = Sha256::new();
        for picture in self.learnt.iter().chain(&self.held_out) {
            let (rows, columns, _) = picture.dim();
            hasher.update([rows as u64, columns as u64].map(u64::to_le_bytes).concat());
            picture.iter().for_each(|v| hasher.update(v.to_le_bytes()));
        }
        hex(&hasher.finalize())
    }

    /// Example number `k` of a seed: the same whatever was drawn before.
    pub(crate) fn example(&self, piece: usize, seed: u64, k: u64) -> Example {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(k);
        let picture = &self.learnt[random.random_range(0..self.learnt.len())];
        let (rows, columns, _) = picture.dim();
        let (top, left) = (
            random.random_range(0..=rows - piece),
            random.random_range(0..=columns - piece),
        );
        let [across, down, turned]: [bool; 3] = random.random();
        let mut order = [0, 1, 2];
        if random.random_bool(EXCHANGED) {
            let turn = random.random_range(1..3);
            order = std::array::from_fn(|c| (c + turn) % COLOURS);
        }
        let light = if random.random_bool(DARKENED) {
            random.random_range(DARKEST..1.0)
        } else {
            1.0
        };
        let last = piece - 1;
        let clean = Array3::from_shape_fn((piece, piece, COLOURS), |(y, x, c)| {
            let (y, x) = if turned { (x, y) } else { (y, x) };
            let (y, x) = (if down { last - y } else { y }, if across { last - x } else { x });
            light * picture[[top + y, left + x, order[c]]]
        });
        let deviation = deviations(piece, &mut random);
        let noisy = ndarray::Zip::from(&clean).and(&deviation).map_collect(|v, d| {
            let noise: f32 = StandardNormal.sample(&mut random);
            v + d * noise
        });
        Example {
            clean,
            noisy,
            deviation,
        }
    }

    /// Pictures that nothing is learnt from, with noise of one deviation that is always the same.
    pub(crate) fn judged(&self, deviation: f32) -> impl Iterator<Item = (&Array3<f32>, Array3<f32>)> {
        self.held_out
            .iter()
            .enumerate()
            .map(move |(i, clean)| (clean, with_noise(clean, deviation, i as u64)))
    }
}

/// Half of the pieces have noise of one strength, the others noise that changes over the piece and from colour to colour, as
/// that of a restored picture does.
fn deviations(piece: usize, random: &mut ChaCha8Rng) -> Array3<f32> {
    let [low, high] = NOISE.map(f32::ln);
    let strength = random.random_range(low..high);
    if random.random_bool(0.5) {
        return Array3::from_elem((piece, piece, COLOURS), strength.exp());
    }
    let mut normal = |scale: f32| -> f32 { scale * random.sample::<f32, _>(StandardNormal) };
    let corners = [[normal(CORNERS), normal(CORNERS)], [normal(CORNERS), normal(CORNERS)]];
    let colours = [normal(COLOUR), normal(COLOUR), normal(COLOUR)];
    let share = |i: usize| i as f32 / (piece - 1) as f32;
    Array3::from_shape_fn((piece, piece, COLOURS), |(y, x, c)| {
        let (v, u) = (share(y), share(x));
        let along = |row: [f32; 2]| row[0] * (1.0 - u) + row[1] * u;
        let ramp = along(corners[0]) * (1.0 - v) + along(corners[1]) * v;
        (strength + ramp + colours[c]).clamp(low, high).exp()
    })
}

/// Half as many pixels along each axis.
fn halved(picture: &Array3<f32>) -> Array3<f32> {
    let planes: Vec<_> = picture.axis_iter(Axis(2)).map(over_squares).collect();
    Array3::from_shape_fn((picture.dim().0 / 2, picture.dim().1 / 2, planes.len()), |(y, x, c)| {
        planes[c][[y, x]]
    })
}
