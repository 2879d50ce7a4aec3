//! Predictions of the test model: sums of cosines over a window.

/// Edge of the window in points.
pub(crate) const POINTS: usize = 32;

/// A prediction: a constant and some cosines by their periods over the window along x and y.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Waves {
    pub constant: f64,
    pub waves: Vec<([u32; 2], f64)>,
}

impl Waves {
    pub(crate) fn new(constant: f64, waves: &[([u32; 2], f64)]) -> Self {
        let mut out = Self {
            constant,
            waves: Vec::new(),
        };
        out.add(waves, 1.0);
        out
    }

    pub(crate) fn add(&mut self, waves: &[([u32; 2], f64)], factor: f64) {
        for (periods, amplitude) in waves {
            match self.waves.iter_mut().find(|w| w.0 == *periods) {
                Some(own) => own.1 += factor * amplitude,
                None => self.waves.push((*periods, factor * amplitude)),
            }
        }
    }

    /// Values at the points of a window that is off by so much along x and y.
    pub(crate) fn points(&self, off: [f64; 2]) -> Vec<f64> {
        let mut out = vec![self.constant; POINTS * POINTS];
        for (periods, amplitude) in &self.waves {
            // cos(a + b) = cos a cos b - sin a sin b.
            add_products(&mut out, *amplitude, turned(*periods, off));
        }
        out
    }

    /// Derivatives of the values by the place of the window along an axis.
    pub(crate) fn slopes(&self, off: [f64; 2], axis: usize) -> Vec<f64> {
        let turn = std::f64::consts::TAU / POINTS as f64;
        let mut out = vec![0.0; POINTS * POINTS];
        for (periods, amplitude) in &self.waves {
            // sin(a + b) = sin a cos b + cos a sin b.
            let rate = -turn * f64::from(periods[axis]) * amplitude;
            let [[cx, sx], y] = turned(*periods, off);
            add_products(&mut out, rate, [[sx, cx.iter().map(|c| -c).collect()], y]);
        }
        out
    }
}

/// Cosines and sines of the phase of a wave along x, and along y.
fn turned(periods: [u32; 2], off: [f64; 2]) -> [[Vec<f64>; 2]; 2] {
    let turn = std::f64::consts::TAU / POINTS as f64;
    [0, 1].map(|axis| {
        let at = |i: usize| i as f64 - 0.5 * (POINTS as f64 - 1.0) + off[axis];
        let phase = |i: usize| turn * f64::from(periods[axis]) * at(i);
        [
            (0..POINTS).map(|i| phase(i).cos()).collect(),
            (0..POINTS).map(|i| phase(i).sin()).collect(),
        ]
    })
}

/// Add the first product of a line along x and one along y less the second.
fn add_products(to: &mut [f64], factor: f64, [x, y]: [[Vec<f64>; 2]; 2]) {
    for (row, to) in to.chunks_exact_mut(POINTS).enumerate() {
        let (first, second) = (factor * y[0][row], factor * y[1][row]);
        for ((to, p), q) in to.iter_mut().zip(&x[0]).zip(&x[1]) {
            *to += first * p - second * q;
        }
    }
}
