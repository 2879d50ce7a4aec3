//! Extent of places in the plane.

/// Places are in one line if none is farther off than this share of its length.
const IN_LINE: f64 = 1e-3;

/// Extent of places, in their unit.
#[derive(Clone, Debug)]
pub struct Extent {
    /// Middle of the box around them.
    pub middle: [f64; 2],
    /// Directions in which they differ: both axes, or the one line that they are in. Unit vectors.
    pub directions: Vec<[f64; 2]>,
    /// Half of what they span along each direction.
    pub half_spans: Vec<f64>,
}

impl Extent {
    /// Extent of some places; none for a single place.
    pub fn of(at: &[[f64; 2]]) -> Option<Self> {
        let ends = [0, 1].map(|axis| {
            let along = at.iter().map(|p| p[axis]);
            along.fold((f64::MAX, f64::MIN), |(a, b), c| (a.min(c), b.max(c)))
        });
        let mut own = Self {
            middle: ends.map(|(a, b)| 0.5 * (a + b)),
            directions: directions(at)?,
            half_spans: Vec::new(),
        };
        let half_span = |d: &[f64; 2]| at.iter().map(|p| own.along(p, d).abs()).fold(0.0, f64::max);
        own.half_spans = own.directions.iter().map(half_span).collect();
        Some(own)
    }

    /// Distance of a place from the middle in a direction.
    pub fn along(&self, place: &[f64; 2], direction: &[f64; 2]) -> f64 {
        (place[0] - self.middle[0]) * direction[0] + (place[1] - self.middle[1]) * direction[1]
    }
}

/// Both axes, the one line that all places are in, or none of one place.
fn directions(at: &[[f64; 2]]) -> Option<Vec<[f64; 2]>> {
    let first = at.first()?;
    let apart = |p: &[f64; 2]| [p[0] - first[0], p[1] - first[1]];
    let farthest = at.iter().map(apart).max_by(|a, b| length(a).total_cmp(&length(b)))?;
    let whole = length(&farthest);
    if whole == 0.0 {
        return None;
    }
    // Towards +x, or +y of a line along y.
    let sign = if farthest[0] < 0.0 || farthest[0] == 0.0 && farthest[1] < 0.0 {
        -whole
    } else {
        whole
    };
    // No negative zero: it is shown.
    let line = farthest.map(|c| c / sign + 0.0);
    let is_in_line = |p: &[f64; 2]| {
        let [x, y] = apart(p);
        (x * line[1] - y * line[0]).abs() <= IN_LINE * whole
    };
    Some(if at.iter().all(is_in_line) {
        vec![line]
    } else {
        vec![[1.0, 0.0], [0.0, 1.0]]
    })
}

fn length(v: &[f64; 2]) -> f64 {
    v[0].hypot(v[1])
}
