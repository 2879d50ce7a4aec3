//! Orders of local gratings for one light: solved at chosen grating vectors, smooth between them.

use std::path::Path;

use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use metalith_cell::CellStack;
use metalith_cell::kept::{self, CacheEntry};
use metalith_core::{Error, Progress, Result};

use crate::node::{KEPT, PHASES};
use crate::{COARSE, CoarseCell, GratingVector, Mapping, OrderAmplitudes, Surface};

/// Least distance of solved grating vectors (turns a site). With it gratings that are left out are met to 0.02 to 0.04
/// in amplitude; with 0.045, to 0.03 to 0.08.
const SPACING: f64 = 0.03;

/// Most sites of a solved grating: the time grows with the third power.
const MOST_SITES: usize = 12;

/// Gratings are solved so far outside of the disc that is asked for (turns a site), so that its rim lies between them.
const MARGIN: f64 = 0.02;

/// Smoothing of the surfaces: the cube of a distance of 0.046. Gratings are solved at a few phases, which resonances that
/// pass quickly make uneven. Of 0, 1e-4, 1e-3 and 1e-2 it fits the truth best.
const SMOOTHING: f64 = 1e-4;

const MAGIC: [u8; 8] = *b"MLGRAT\0\x01";

/// The light, and the grating vectors that a table covers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GratingTableSpec {
    pub wavelength_um: f64,
    /// Direction of arrival, sines in air along x and y.
    pub sines: [f64; 2],
    /// Middle of the disc of grating vectors (turns a site along x and y).
    pub middle: [f64; 2],
    /// Its radius (turns a site).
    pub radius: f64,
}

/// Amplitudes of the orders of local gratings over grating vectors.
#[derive(Clone, Debug)]
pub struct GratingTable {
    spec: GratingTableSpec,
    solved: Vec<(GratingVector, OrderAmplitudes)>,
    surface: Surface<{ 2 * KEPT }>,
}

impl GratingTable {
    /// The table of a spec: from the folder `cache` if it is kept there, else solved, and kept there.
    ///
    /// # Errors
    /// If the spec is no light or no disc, a grating cannot be solved, or the user stopped it.
    pub fn obtain(
        spec: &GratingTableSpec,
        stack: &CellStack,
        mapping: &Mapping,
        cache: Option<&Path>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let vectors = chosen(spec)?;
        let kept = CacheEntry::new(cache, "grating", MAGIC, inputs(spec, stack, mapping), "gratings");
        if let Some(amplitudes) = kept.read(|content| decode(content, vectors.len()), progress) {
            progress.advance(vectors.len() as u64);
            return Self::of(spec, vectors.into_iter().zip(amplitudes).collect());
        }
        let solved = solve(spec, stack, mapping, &vectors, progress)?;
        let content: Vec<u8> = solved.iter().flat_map(|(_, amplitudes)| encode(amplitudes)).collect();
        kept.write(&content, progress);
        Self::of(spec, solved)
    }

    /// The table through solved gratings.
    ///
    /// # Errors
    /// If they do not span the plane.
    pub fn of(spec: &GratingTableSpec, solved: Vec<(GratingVector, OrderAmplitudes)>) -> Result<Self> {
        Ok(Self {
            spec: *spec,
            surface: surface(spec, &solved)?,
            solved,
        })
    }

    /// Number of gratings that a table of this spec takes.
    ///
    /// # Errors
    /// If the spec is no light or no disc.
    pub fn gratings(spec: &GratingTableSpec) -> Result<usize> {
        chosen(spec).map(|vectors| vectors.len())
    }

    /// What it was made for.
    pub fn spec(&self) -> &GratingTableSpec {
        &self.spec
    }

    /// Amplitudes of the orders of the grating whose phase turns by `k` at a step along x and y, as
    /// [`GratingVector::solve`]. Beyond the disc those of the nearest grating vector of it.
    pub fn amplitudes(&self, k: [f64; 2]) -> OrderAmplitudes {
        let away = [k[0] - self.spec.middle[0], k[1] - self.spec.middle[1]];
        let scale = (self.spec.radius / away[0].hypot(away[1])).min(1.0);
        // Nothing is away from the middle in the middle itself: 0 / 0 is not less than 1.
        let scale = if scale.is_nan() { 1.0 } else { scale };
        let place = [0, 1].map(|axis| self.spec.middle[axis] + scale * away[axis]);
        unflat(&self.surface.at(place))
    }

    /// Error of the table between its gratings: root mean square difference of the amplitude of the first order, over
    /// all gratings inside the disc and both polarisations, each interpolated from the others.
    ///
    /// # Errors
    /// If the others do not span the plane.
    pub fn left_out(&self) -> Result<f64> {
        let first = (1 - crate::FIRST_KEPT) as usize;
        let mut squares = (0.0, 0_u32);
        for (vector, own) in &self.solved {
            let k = vector.turns_per_site();
            if (k[0] - self.spec.middle[0]).hypot(k[1] - self.spec.middle[1]) > self.spec.radius {
                continue;
            }
            let found = unflat(&self.without(vector)?.surface.at(k));
            for pol in [0, 1] {
                squares.0 += (found[pol][first] - own[pol][first]).norm_sqr();
                squares.1 += 1;
            }
        }
        Ok((squares.0 / f64::from(squares.1.max(1))).sqrt())
    }

    /// The same table without one of its gratings.
    ///
    /// # Errors
    /// If the others do not span the plane.
    pub fn without(&self, vector: &GratingVector) -> Result<Self> {
        let others = self
            .solved
            .iter()
            .filter(|(own, _)| own.turns_per_site() != vector.turns_per_site());
        Self::of(&self.spec, others.copied().collect())
    }
}

/// Solve all gratings of a table, one a thread.
fn solve(
    spec: &GratingTableSpec,
    stack: &CellStack,
    mapping: &Mapping,
    vectors: &[GratingVector],
    progress: &dyn Progress,
) -> Result<Vec<(GratingVector, OrderAmplitudes)>> {
    let cell = CoarseCell::new(stack, spec.wavelength_um, mapping.range_nm())?;
    vectors
        .par_iter()
        .map(|vector| {
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            let amplitudes = vector.solve(&cell, mapping, spec.sines)?;
            progress.advance(1);
            Ok((*vector, amplitudes))
        })
        .collect()
}

/// The grating vectors that are solved: few sites first, none closer to another or to its own mirror image than
/// [`SPACING`].
fn chosen(spec: &GratingTableSpec) -> Result<Vec<GratingVector>> {
    let GratingTableSpec { middle, radius, .. } = spec;
    let numbers = [
        spec.wavelength_um,
        spec.sines[0],
        spec.sines[1],
        middle[0],
        middle[1],
        *radius,
    ];
    if numbers.iter().any(|v| !v.is_finite()) || !(0.0..=1.0).contains(radius) || middle.iter().any(|k| k.abs() > 1.0) {
        return Err(Error::refused(
            "grating/table-spec",
            format!("a table of gratings for {spec:?}"),
            "give finite numbers, and a disc within one turn a site",
        ));
    }
    let distance = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let mut vectors: Vec<GratingVector> = Vec::new();
    let mut taken: Vec<[f64; 2]> = Vec::new();
    for sites in 1..=MOST_SITES {
        let most = 2 * sites as i32;
        for p in -most..=most {
            for q in -most..=most {
                let vector = GratingVector { turns: [p, q], sites };
                let k = vector.turns_per_site();
                let images = images(spec.sines, k);
                let crowded = |image: &[f64; 2]| {
                    // A vector on a line of symmetry is its own image, but for rounding.
                    let own = distance(*image, k);
                    (own > 1e-9 && own < SPACING) || taken.iter().any(|t| distance(*t, *image) < SPACING)
                };
                let inside = distance(k, *middle) <= radius + MARGIN;
                if inside && !images.iter().any(|(image, _)| crowded(image)) {
                    taken.extend(images.iter().map(|(image, _)| *image));
                    vectors.push(vector);
                }
            }
        }
    }
    Ok(vectors)
}

/// A grating vector and its mirror images that are the same to light of this direction; whether s and p change
/// places.
pub(crate) fn images(sines: [f64; 2], k: [f64; 2]) -> Vec<([f64; 2], bool)> {
    let mut all = vec![(k, false)];
    for axis in [0, 1] {
        if sines[axis] == 0.0 {
            for (mut image, swapped) in all.clone() {
                image[axis] = -image[axis];
                all.push((image, swapped));
            }
        }
    }
    if sines[0] == sines[1] {
        // Along the normal p is x and s is y; else s and p go with the plane of incidence, which is its own image.
        let normal = sines[0] == 0.0;
        for ([x, y], swapped) in all.clone() {
            all.push(([y, x], swapped ^ normal));
        }
    }
    all
}

/// The surface through gratings and their images.
fn surface(spec: &GratingTableSpec, solved: &[(GratingVector, OrderAmplitudes)]) -> Result<Surface<{ 2 * KEPT }>> {
    let (mut places, mut values): (Vec<[f64; 2]>, Vec<_>) = (Vec::new(), Vec::new());
    for (vector, [s, p]) in solved {
        for (image, swapped) in images(spec.sines, vector.turns_per_site()) {
            let known = |place: &[f64; 2]| (place[0] - image[0]).hypot(place[1] - image[1]) < 1e-9;
            if !places.iter().any(known) {
                places.push(image);
                values.push(flat(if swapped { [p, s] } else { [s, p] }));
            }
        }
    }
    Surface::through(&places, &values, SMOOTHING)
}

fn flat(both: [&[Complex64; KEPT]; 2]) -> [Complex64; 2 * KEPT] {
    std::array::from_fn(|i| both[i / KEPT][i % KEPT])
}

fn unflat(values: &[Complex64; 2 * KEPT]) -> OrderAmplitudes {
    [0, 1].map(|pol| std::array::from_fn(|m| values[pol * KEPT + m]))
}

/// The inputs as text: equal if and only if the table is the same.
fn inputs(spec: &GratingTableSpec, stack: &CellStack, mapping: &Mapping) -> Vec<u8> {
    #[derive(Serialize)]
    struct Inputs<'a> {
        solver: u32,
        coarse: usize,
        phases: usize,
        spacing: f64,
        most_sites: usize,
        margin: f64,
        spec: &'a GratingTableSpec,
        stack: &'a CellStack,
        widths_nm: &'a [u16],
    }
    serde_json::to_vec(&Inputs {
        solver: kept::solver_of(stack.shape),
        coarse: COARSE,
        phases: PHASES,
        spacing: SPACING,
        most_sites: MOST_SITES,
        margin: MARGIN,
        spec,
        stack,
        widths_nm: mapping.samples_nm(),
    })
    .expect("plain data serialises")
}

/// Re and Im of each order, s then p (f64, little-endian).
fn encode(amplitudes: &OrderAmplitudes) -> Vec<u8> {
    let numbers = amplitudes.iter().flatten().flat_map(|a| [a.re, a.im]);
    numbers.flat_map(f64::to_le_bytes).collect()
}

/// The amplitudes of so many gratings; none if the bytes are not of so many, or not finite.
fn decode(content: &[u8], gratings: usize) -> Option<Vec<OrderAmplitudes>> {
    const EACH: usize = 2 * KEPT * 16;
    if content.len() != gratings * EACH {
        return None;
    }
    let (numbers, _) = content.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|b| f64::from_le_bytes(*b)).collect();
    if numbers.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let at = |i: usize| Complex64::new(numbers[2 * i], numbers[2 * i + 1]);
    let one = |g: usize| [0, 1].map(|pol| std::array::from_fn(|m| at((2 * g + pol) * KEPT + m)));
    Some((0..gratings).map(one).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(sines: [f64; 2], middle: [f64; 2]) -> GratingTableSpec {
        GratingTableSpec {
            wavelength_um: 0.53,
            sines,
            middle,
            radius: 0.14,
        }
    }

    #[test]
    fn chosen_gratings_are_few_and_cover_the_disc() {
        // Half the spacing of a square grid, and the gap that rationals of few sites leave about simple ones.
        const GAP: f64 = 0.08;
        for (sines, middle, most) in [
            ([0.0, 0.0], [0.0, 0.0], 24),
            ([0.2, 0.0], [0.165, 0.0], 50),
            ([0.2, 0.2], [0.165, 0.165], 50),
            ([0.3, 0.2], [0.3, 0.165], 90),
        ] {
            let spec = spec(sines, middle);
            let vectors = chosen(&spec).unwrap();
            assert!(vectors.len() <= most, "{} for {spec:?}", vectors.len());
            let places: Vec<_> = vectors.iter().flat_map(|v| images(sines, v.turns_per_site())).collect();
            for i in 0..60 {
                for j in 0..60 {
                    let [x, y] = [i, j].map(|v| 0.14 * (f64::from(v) / 30.0 - 1.0));
                    if x.hypot(y) < 0.14 {
                        let k = [middle[0] + x, middle[1] + y];
                        let gap = places.iter().map(|(p, _)| (p[0] - k[0]).hypot(p[1] - k[1]));
                        let gap = gap.fold(f64::INFINITY, f64::min);
                        assert!(gap < GAP, "{k:?}: {gap}");
                    }
                }
            }
        }
    }

    #[test]
    fn impossible_tables_are_refused() {
        for (sines, middle) in [([f64::NAN, 0.0], [0.0; 2]), ([0.0; 2], [7.0, 0.0])] {
            assert!(GratingTable::gratings(&spec(sines, middle)).is_err());
        }
        let wide = GratingTableSpec {
            radius: 3.0,
            ..spec([0.0; 2], [0.0; 2])
        };
        assert!(GratingTable::gratings(&wide).is_err());
    }

    #[test]
    fn kept_amplitudes_come_back() {
        let one = |g: usize| [0, 1].map(|p| std::array::from_fn(|m| Complex64::new(g as f64, (p * KEPT + m) as f64)));
        let all: Vec<OrderAmplitudes> = (0..3).map(one).collect();
        let bytes: Vec<u8> = all.iter().flat_map(encode).collect();
        assert_eq!(decode(&bytes, 3), Some(all));
        assert_eq!(decode(&bytes, 2), None);
        let mut broken = bytes;
        broken[..8].copy_from_slice(&f64::NAN.to_le_bytes());
        assert_eq!(decode(&broken, 3), None);
    }
}
