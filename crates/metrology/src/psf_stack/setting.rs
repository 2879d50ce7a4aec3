//! Parameters of all effects, and what they are for one object.

use metalith_attribution::{RefitEffect, RefitParameter, RefitScope};
use metalith_core::Zernike;

use super::sampling::{Method, Sampling};
use super::set::StackSet;

/// First Zernike polynomial (Noll), and their number: astigmatism, coma, trefoil, spherical aberration.
pub(super) const FIRST_ZERNIKE: u32 = 5;
pub(super) const ZERNIKES: usize = 7;

/// Slots of the bench.
pub(super) const FOCUS: usize = 0;
pub(super) const SPACING: usize = 1;
const PIXEL: usize = 2;
const DEPTH: usize = 3;
const SHIFT: usize = 4;
const ROTATION: usize = 6;
const MASK_SCALE: usize = 7;
const ZERNIKE: usize = 8;
const BLUR: usize = ZERNIKE + ZERNIKES;
const UNMODULATED: usize = BLUR + 3;
const APERTURE: usize = UNMODULATED + 1;
const FALLOFF: usize = APERTURE + 1;
const MASK_BLUR: usize = FALLOFF + 3;
const MASK_DISTANCE: usize = MASK_BLUR + 1;
const BENCH: usize = MASK_DISTANCE + 1;

/// Slots of an object, after those of the bench.
const OWN_FOCUS: usize = 0;
const OWN_DEPTH: usize = 1;
const OWN_SHIFT: usize = 2;
const OWN_ROTATION: usize = 4;
const OWN_ZERNIKE: usize = 5;
const OWN: usize = OWN_ZERNIKE + ZERNIKES;

/// Largest variance of the blur of a mask, over the square of its pitch.
const MOST_MASK_BLUR: f64 = 25.0;

/// Number of the way of leaving objects out, after planes.
pub(super) const BY_OBJECT: usize = 1;

/// Everything that changes the light of one object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Setting {
    pub focus_um: f64,
    pub spacing: f64,
    pub pixel: f64,
    pub blur_um2: [f64; 2],
    /// From the objects to the lens, where both are stated in one plane.
    pub mask_distance_um: f64,
    pub pupil: PupilSetting,
}

/// What changes the light that leaves the object or the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PupilSetting {
    pub depth: f64,
    pub shift_um: [f64; 2],
    pub rotation_deg: f64,
    pub mask_scale: f64,
    pub zernike_nm: [f64; ZERNIKES],
    pub unmodulated: f64,
    pub aperture: f64,
    /// Logarithm of the amplitude of the illumination: a fall to the rim, and rises along x and y.
    pub falloff: [f64; 3],
    /// Variance of the blur of the phase of a mask.
    pub mask_blur_um2: f64,
}

impl Setting {
    /// Setting of an object for parameter values.
    pub(super) fn of(theta: &[f64], object: usize) -> Self {
        let own = &theta[BENCH + OWN * object..BENCH + OWN * (object + 1)];
        Self {
            focus_um: theta[FOCUS] + own[OWN_FOCUS],
            spacing: theta[SPACING],
            pixel: theta[PIXEL],
            blur_um2: [theta[BLUR] + theta[BLUR + 1], theta[BLUR] + theta[BLUR + 2]],
            mask_distance_um: theta[MASK_DISTANCE],
            pupil: PupilSetting {
                depth: theta[DEPTH] + own[OWN_DEPTH],
                shift_um: [0, 1].map(|k| theta[SHIFT + k] + own[OWN_SHIFT + k]),
                rotation_deg: theta[ROTATION] + own[OWN_ROTATION],
                mask_scale: theta[MASK_SCALE],
                zernike_nm: std::array::from_fn(|k| theta[ZERNIKE + k] + own[OWN_ZERNIKE + k]),
                unmodulated: theta[UNMODULATED],
                aperture: theta[APERTURE],
                falloff: [0, 1, 2].map(|k| theta[FALLOFF + k]),
                mask_blur_um2: theta[MASK_BLUR],
            },
        }
    }
}

/// Parameters and effects of a set, with the scope of each effect and the steps of each parameter.
pub(crate) struct Effects {
    pub parameters: Vec<RefitParameter>,
    pub effects: Vec<RefitEffect>,
    pub scopes: Vec<RefitScope>,
    /// Step of a derivative of each parameter.
    pub steps: Vec<f64>,
    /// Step and number, on either side, of values that a fit may start from; by effect.
    pub scans: Vec<Option<(f64, i32)>>,
}

struct Builder<'a> {
    out: Effects,
    sampling: &'a Sampling,
}

impl Builder<'_> {
    /// A parameter whose derivative takes a step, within a range on either side of zero.
    fn parameter(&mut self, name: String, unit: &'static str, step: f64, range: f64) {
        self.out.parameters.push(RefitParameter {
            name,
            unit,
            neutral: 0.0,
            start: 0.0,
            range: (-range, range),
            shown: |v| v,
        });
        self.out.steps.push(step);
    }

    fn effect(&mut self, name: String, slots: Vec<usize>, scope: RefitScope, scan: Option<(f64, i32)>) {
        self.out.effects.push(RefitEffect {
            name,
            slots,
            after: Vec::new(),
            across: None,
        });
        self.out.scopes.push(scope);
        self.out.scans.push(scan);
    }

    /// Slots that the bench and each object have, with names that end alike.
    fn common(&mut self, end: &str, parts: [bool; 2]) {
        let s = self.sampling;
        let depth_um = s.depth_of_focus_um;
        if parts[0] {
            self.parameter(format!("focus_offset{end}"), "um", 0.02 * depth_um, 60.0 * depth_um);
        }
        if parts[1] {
            self.parameter(format!("phase_depth{end}"), "", 0.002, 0.5);
            for axis in ["x", "y"] {
                self.parameter(
                    format!("mask_shift{end} {axis}"),
                    "um",
                    0.25 * s.dx_um,
                    0.3 * s.aperture_um,
                );
            }
            self.parameter(format!("mask_rotation{end}"), "degree", 0.1, 20.0);
        }
    }

    fn zernikes(&mut self, end: &str) {
        let nm = self.sampling.middle_um * 1e3;
        for k in 0..ZERNIKES {
            let z = Zernike::noll(FIRST_ZERNIKE + k as u32);
            self.parameter(
                format!("Z{}{end}", FIRST_ZERNIKE + k as u32),
                "nm",
                2e-3 * nm / f64::from(z.n),
                1.0 * nm,
            );
        }
    }

    fn wavefront(&mut self, [before, after]: [&str; 2], first: usize, scope: RefitScope) {
        let step = 0.06 * self.sampling.middle_um * 1e3;
        for (name, slots) in [
            ("astigmatism", 0..2),
            ("coma", 2..4),
            ("trefoil", 4..6),
            ("spherical", 6..7),
        ] {
            let slots = slots.map(|k| first + k).collect();
            self.effect(format!("{before}{name}{after}"), slots, scope, Some((step, 1)));
        }
    }
}

/// The effects of a set.
pub(super) fn effects(set: &StackSet, sampling: &Sampling) -> Effects {
    let out = Effects {
        parameters: Vec::new(),
        effects: Vec::new(),
        scopes: Vec::new(),
        steps: Vec::new(),
        scans: Vec::new(),
    };
    let mut b = Builder { out, sampling };
    let (depth_um, fine_um) = (sampling.depth_of_focus_um, sampling.spot_um);
    b.common("", [true, false]);
    b.parameter("plane_spacing".into(), "", 0.005, 0.6);
    b.parameter("pixel_scale".into(), "", 0.002, 0.3);
    b.common("", [false, true]);
    b.parameter("mask_scale".into(), "", 0.002, 0.1);
    b.zernikes("");
    for name in ["blur", "blur_x", "blur_y"] {
        b.parameter(name.into(), "um", 0.01 * fine_um * fine_um, 400.0 * fine_um * fine_um);
        if let Some(p) = b.out.parameters.last_mut() {
            (p.range.0, p.start) = (0.0, 0.02 * fine_um * fine_um);
            p.shown = f64::sqrt;
        }
    }
    b.parameter("unmodulated_light".into(), "", 0.002, 0.9);
    b.parameter("aperture_scale".into(), "", 0.005, 0.07);
    if let Some(p) = b.out.parameters.last_mut() {
        // A smaller opening needs no more samples.
        p.range.0 = -0.4;
    }
    b.parameter("illumination_falloff".into(), "", 0.02, 4.0);
    for axis in ["x", "y"] {
        b.parameter(format!("illumination_decentre {axis}"), "", 0.02, 4.0);
    }
    let masks = || set.objects.iter().filter_map(|o| o.transmission.as_ref());
    let pitch_um = masks().map(|t| t.sample_um).fold(0.0, f64::max);
    let variance = pitch_um * pitch_um;
    b.parameter("mask_blur".into(), "um", 0.02 * variance, MOST_MASK_BLUR * variance);
    if let Some(p) = b.out.parameters.last_mut() {
        (p.range.0, p.start) = (0.0, 0.1 * variance);
        p.shown = f64::sqrt;
    }
    let at_lens = set.bench.lens.filter(|l| l.distance_um == 0.0);
    let focal_um = at_lens.map_or(1.0, |l| l.focal_um);
    b.parameter("mask_distance".into(), "um", 0.02 * focal_um, 2.0 * focal_um);
    let (any_mask, any_depth) = (masks().next().is_some(), masks().any(|t| t.has_depth));
    let several = set.planes.iter().any(|p| p.number != set.planes[0].number);
    let every = RefitScope::Every { way: BY_OBJECT };
    let focus = Some((2.0 * depth_um, 8));
    let shift = Some((0.06 * sampling.aperture_um, 2));
    b.effect("focus_offset".into(), vec![FOCUS], every, focus);
    if several {
        b.effect(
            "plane_spacing".into(),
            vec![SPACING],
            RefitScope::Bench,
            Some((0.05, 6)),
        );
    }
    if at_lens.is_some() && sampling.method == Method::FourierSum {
        let scan = Some((0.25 * focal_um, 4));
        b.effect("mask_distance".into(), vec![MASK_DISTANCE], RefitScope::Bench, scan);
    }
    b.effect("pixel_scale".into(), vec![PIXEL], RefitScope::Bench, Some((0.03, 4)));
    if any_depth {
        b.effect("phase_depth".into(), vec![DEPTH], every, Some((0.05, 4)));
    }
    if any_mask {
        b.effect("mask_shift".into(), vec![SHIFT, SHIFT + 1], every, shift);
        b.effect("mask_rotation".into(), vec![ROTATION], every, Some((2.0, 4)));
        b.effect("mask_scale".into(), vec![MASK_SCALE], every, Some((0.02, 3)));
        b.effect("unmodulated_light".into(), vec![UNMODULATED], RefitScope::Bench, None);
        b.out.parameters[UNMODULATED].range.0 = 0.0;
    }
    b.wavefront(["lens_", ""], ZERNIKE, every);
    for (k, name) in ["blur", "blur_x", "blur_y"].into_iter().enumerate() {
        b.effect(name.into(), vec![BLUR + k], RefitScope::Bench, None);
    }
    b.effect("aperture_scale".into(), vec![APERTURE], RefitScope::Bench, None);
    b.effect("illumination_falloff".into(), vec![FALLOFF], RefitScope::Bench, None);
    let sides = vec![FALLOFF + 1, FALLOFF + 2];
    b.effect("illumination_decentre".into(), sides, RefitScope::Bench, None);
    if any_depth {
        b.effect("mask_blur".into(), vec![MASK_BLUR], RefitScope::Bench, None);
    }
    for (group, object) in set.objects.iter().enumerate() {
        let end = end_of(&object.name);
        let first = BENCH + OWN * group;
        b.common(&end, [true, true]);
        b.zernikes(&end);
        if set.objects.len() < 2 {
            continue;
        }
        let one = RefitScope::One { way: BY_OBJECT, group };
        b.effect(format!("focus_offset{end}"), vec![first + OWN_FOCUS], one, focus);
        if let Some(t) = &object.transmission {
            if t.has_depth {
                b.effect(
                    format!("phase_depth{end}"),
                    vec![first + OWN_DEPTH],
                    one,
                    Some((0.05, 4)),
                );
            }
            let slots = vec![first + OWN_SHIFT, first + OWN_SHIFT + 1];
            b.effect(format!("mask_shift{end}"), slots, one, shift);
            b.effect(
                format!("mask_rotation{end}"),
                vec![first + OWN_ROTATION],
                one,
                Some((2.0, 4)),
            );
        }
        b.wavefront(["", &end], first + OWN_ZERNIKE, one);
    }
    b.out
}

/// End of the names of the effects of one object.
pub(super) fn end_of(object: &str) -> String {
    let letters = object.chars().map(|c| if c.is_alphanumeric() { c } else { '_' });
    format!("_of_{}", letters.collect::<String>())
}

/// Number of parameters of a set.
pub(super) fn slots(set: &StackSet) -> usize {
    BENCH + OWN * set.objects.len()
}
