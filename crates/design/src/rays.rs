//! Rays of the phase of a lens: where they land, and where they meet.

use crate::LensSpec;

/// Rays along a diameter: over a thousand rays within the lens, and a small part of a second for any map.
const ACROSS: u32 = 41;

/// Radius over the distance that phases without jumps are differenced over: optimised phases have steps from ring to ring, which
/// send no light elsewhere on average.
const SMOOTHED: f64 = 64.0;

/// Sine beyond which a ray does not leave the pillars.
const GRAZING: f64 = 1.0;

/// Rays of a lens at one wavelength: places (um) and slopes where they leave.
pub(crate) struct Rays {
    radius_um: f64,
    /// Places, and slopes: the tangent of the angle to the axis along x and y; none for a ray that does not leave.
    rays: Vec<([f64; 2], Option<[f64; 2]>)>,
}

impl Rays {
    /// Rays of the phase that an element has, without its wedge. `pitch_um`: distance over which a phase with jumps is differenced.
    pub(crate) fn of(lens: &LensSpec, element: (i32, i32), wavelength_um: f64, pitch_um: f64) -> Self {
        let radius_um = lens.radius_um();
        let terms: Vec<_> = lens.terms.iter().filter(|term| term.is_of(element)).collect();
        let has_jumps = terms.iter().any(|term| term.is_wrapped());
        let step_um = if has_jumps { pitch_um } else { radius_um / SMOOTHED };
        let turns = |x: f64, y: f64| {
            let known = lens.phase.turns(x * x + y * y);
            let (jumps, smooth) = terms.iter().fold((0.0, known), |(jumps, smooth), term| {
                let turns = term.turns(x, y);
                if term.is_wrapped() {
                    (jumps + turns, smooth)
                } else {
                    (jumps, smooth + turns)
                }
            });
            [smooth, jumps]
        };
        let slope = |a: [f64; 2], b: [f64; 2]| {
            let jump = b[1] - a[1];
            wavelength_um * (b[0] - a[0] + jump - jump.round()) / step_um
        };
        let half = 0.5 * step_um;
        let spacing_um = 2.0 * radius_um / f64::from(ACROSS);
        let at = |k: u32| (f64::from(k) + 0.5) * spacing_um - radius_um;
        let places = (0..ACROSS).flat_map(|iy| (0..ACROSS).map(move |ix| [at(ix), at(iy)]));
        let inside = places.filter(|[x, y]| x.hypot(*y) + half <= radius_um);
        let rays = inside.map(|[x, y]| {
            let sine = [
                slope(turns(x - half, y), turns(x + half, y)),
                slope(turns(x, y - half), turns(x, y + half)),
            ];
            let sine2 = sine[0] * sine[0] + sine[1] * sine[1];
            let leaves = sine2 < GRAZING;
            ([x, y], leaves.then(|| sine.map(|s| s / (1.0 - sine2).sqrt())))
        });
        Self {
            radius_um,
            rays: rays.collect(),
        }
    }

    /// Distance from the axis at which rays land in a plane (um), mean over the lens, in parts of its radius. A ray that lands
    /// farther away than a radius, or does not leave, counts as one.
    pub(crate) fn missed(&self, distance_um: f64) -> f64 {
        let miss = self.rays.iter().map(|(place, slope)| match slope {
            Some(slope) => {
                let lands = [0, 1].map(|axis| place[axis] + distance_um * slope[axis]);
                (lands[0].hypot(lands[1]) / self.radius_um).min(1.0)
            }
            None => 1.0,
        });
        miss.sum::<f64>() / self.rays.len().max(1) as f64
    }

    /// Distance at which rays pass nearest to the axis (um), least squares; none if they have no slope.
    pub(crate) fn meet_um(&self) -> Option<f64> {
        let sums = self.rays.iter().filter_map(|(place, slope)| Some((place, (*slope)?)));
        let (along, across) = sums.fold((0.0, 0.0), |(along, across), (place, slope)| {
            (
                along - place[0] * slope[0] - place[1] * slope[1],
                across + slope[0] * slope[0] + slope[1] * slope[1],
            )
        });
        (across > 0.0).then(|| along / across)
    }
}
