//! Rays of the phase of a lens: where they land and where they meet, and the warning about them.

use metalith_core::{Warning, numerical_aperture};

use crate::phase::{RadialPhase, TermForm};
use crate::{Design, LensSpec};

/// Share of the radius that rays of a lens may miss the middle of the sensor by: lenses for a long depth of focus or many wavelengths
/// miss it by a part of this, a phase that is ten times too flat by 0.6.
const MOST_MISSED: f64 = 0.4;

/// Depths of focus (wavelength over the square of the numerical aperture) between sensor and focus: at one, an ideal lens has no light
/// on its axis.
const MOST_DEPTHS_APART: f64 = 0.75;

/// Share of what rays miss at the sensor that they miss where they meet, if they have a focus.
const MEETING_SHARE: f64 = 0.25;

/// Distance from the middle of the sensor to the light of a phase, in parts of the radius of the lens, beyond which it may be a mistake.
const MOST_ASIDE: f64 = 0.1;

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

    /// Middle of the places where rays land in a plane (um from the axis), mean; the axis if none leaves.
    pub(crate) fn lands_um(&self, distance_um: f64) -> [f64; 2] {
        let all = self.rays.iter().filter_map(|(place, slope)| Some((place, (*slope)?)));
        let (sum, count) = all.fold(([0.0; 2], 0.0), |(sum, count): ([f64; 2], f64), (place, slope)| {
            (
                [0, 1].map(|axis| sum[axis] + place[axis] + distance_um * slope[axis]),
                count + 1.0,
            )
        });
        sum.map(|along| along / count.max(1.0))
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

/// Warning about a phase that sends its light elsewhere than to the middle of the sensor, or focuses it in another plane, at each
/// wavelength.
pub(crate) fn warning(design: &Design) -> Option<Warning> {
    let pitch_um = f64::from(design.cell.pitch_nm) * 1e-3;
    let mut seen: Vec<&LensSpec> = Vec::new();
    let mut worst: Option<Focus> = None;
    for element in design.elements() {
        let lens = design.lens_of(&element);
        let is_flat = lens.terms.is_empty() && lens.phase == RadialPhase::Flat;
        if is_flat || seen.iter().any(|known| std::ptr::eq(*known, lens)) {
            continue;
        }
        seen.push(lens);
        let lights = design.verify.wavelengths_um.iter().copied().chain(lens.focused_um());
        let best = lights
            .map(|um| Focus::of(lens, element.index, um, pitch_um))
            .min_by(|a, b| a.missed.total_cmp(&b.missed))?;
        if worst.as_ref().is_none_or(|worst| worst.missed < best.missed) {
            worst = Some(best);
        }
    }
    worst?.warning()
}

/// Focus of the rays of a lens at one wavelength.
struct Focus {
    wavelength_um: f64,
    radius_um: f64,
    sensor_um: f64,
    /// Distance from the middle of the sensor at which rays land, in parts of the radius: mean.
    missed: f64,
    /// Middle of the places where rays of a map land on the sensor (um); the axis for other phases, which state how they steer.
    lands_um: [f64; 2],
    /// Distance at which rays meet (um), and what they miss the axis by there, as `missed`.
    meet: Option<(f64, f64)>,
}

impl Focus {
    fn of(lens: &LensSpec, element: (i32, i32), wavelength_um: f64, step_um: f64) -> Self {
        let has_map = lens.terms.iter().any(|term| matches!(term.form, TermForm::Map(_)));
        let rays = Rays::of(lens, element, wavelength_um, step_um);
        Self {
            wavelength_um,
            radius_um: lens.radius_um(),
            sensor_um: lens.focal_length_um,
            missed: rays.missed(lens.focal_length_um),
            lands_um: if has_map {
                rays.lands_um(lens.focal_length_um)
            } else {
                [0.0; 2]
            },
            meet: rays.meet_um().map(|um| (um, rays.missed(um))),
        }
    }

    /// Distance at which rays meet (um), and its distance from the sensor in depths of focus; none if they meet at the sensor or
    /// nowhere: phases for a long depth of focus meet nowhere.
    fn elsewhere(&self) -> Option<(f64, f64)> {
        let (meet_um, there) = self.meet?;
        let sine = numerical_aperture(self.radius_um, self.sensor_um);
        let depths = (meet_um - self.sensor_um).abs() * sine * sine / self.wavelength_um;
        (there < MEETING_SHARE * self.missed && depths > MOST_DEPTHS_APART).then_some((meet_um, depths))
    }

    fn warning(&self) -> Option<Warning> {
        if self.missed > MOST_MISSED {
            return Some(Warning::new(
                "phase/out-of-focus",
                format!(
                    "rays of the phase miss the middle of the sensor, {} um away, by {:.0} % of the radius of the lens on average, at each \
                     wavelength of [verify]",
                    self.sensor_um,
                    self.missed * 100.0
                ),
                "check units, sign, order and pitch of the phase, and `focal_length_um` of [lens]; a hologram is meant to do this",
            ));
        }
        if let Some((meet_um, depths)) = self.elsewhere() {
            return Some(Warning::new(
                "phase/other-focal-length",
                format!(
                    "rays of the phase at {} nm meet {meet_um:.1} um from the pillars, and the sensor is {} um away: {depths:.1} depths of focus",
                    (self.wavelength_um * 1e6).round() / 1e3,
                    self.sensor_um,
                ),
                "use one focal length in [lens] and [phase]; check the pitch of a map",
            ));
        }
        let [x_um, y_um] = self.lands_um;
        (x_um.hypot(y_um) > MOST_ASIDE * self.radius_um).then(|| {
            Warning::new(
                "phase/beside-the-axis",
                format!(
                    "the phase sends its light {:.1} um beside the middle of the sensor, to ({x_um:.1}, {y_um:.1}) um",
                    x_um.hypot(y_um)
                ),
                "check centre and order of rows of the phase; steer an element by a wedge of [array]",
            )
        })
    }
}
