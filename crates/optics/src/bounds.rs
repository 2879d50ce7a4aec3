//! Bounds of the numbers of a perturbation.

use std::fmt;
use std::ops::RangeInclusive;

use metalith_core::text::quoted;

use super::declared::DeclaredTerm;
use super::perturbation::Perturbation;
use super::stitching::{self, Stitching};

/// Most polynomials of a free term: the radial order of Zernike's is then below 8.
const MOST_TERMS: usize = 36;

/// Ranges of an area fraction (um): below, a fraction is that of single pillars; the sum at a site grows with the range.
pub const RANGES_UM: RangeInclusive<f64> = 0.5..=300.0;

/// A number of a perturbation that cannot be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PerturbationFault {
    /// Path of the value, from the perturbation on: `geometry.cd_bias_nm`, `path.tilt_mrad.1` for the second of a list.
    pub key: String,
    /// Fault, without the place.
    pub what: String,
    /// Hint on which values are allowed.
    pub hint: String,
}

/// Text of the fault in one line, with the place.
impl fmt::Display for PerturbationFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`: {}; {}", self.key, self.what, self.hint)
    }
}

fn fault(key: impl Into<String>, what: impl Into<String>, hint: impl Into<String>) -> PerturbationFault {
    PerturbationFault {
        key: key.into(),
        what: what.into(),
        hint: hint.into(),
    }
}

/// The name of a value: the last part of its key that is no place in a list.
fn name(key: &str) -> &str {
    let mut parts = key.rsplit('.');
    parts
        .find(|part| !part.starts_with(|c: char| c.is_ascii_digit()))
        .unwrap_or(key)
}

/// A number outside of what it may be.
fn outside(key: String, value: f64, range: &RangeInclusive<f64>) -> Option<PerturbationFault> {
    (!range.contains(&value)).then(|| {
        let what = format!("`{}` cannot be {value}", name(&key));
        let hint = format!("it must be a number from {} to {}", range.start(), range.end());
        fault(key, what, hint)
    })
}

impl Perturbation {
    /// Every number that is outside of what can be simulated; none for a sound perturbation. The limits are several times
    /// what any process or bench does, and keep work and memory bounded.
    pub fn faults(&self) -> Vec<PerturbationFault> {
        let (g, c, p, l, k) = (&self.geometry, &self.cell, &self.path, &self.light, &self.camera);
        let single: [(&str, f64, RangeInclusive<f64>); 17] = [
            ("geometry.cd_bias_nm", g.cd_bias_nm, -500.0..=500.0),
            ("geometry.cd_bias_density_nm", g.cd_bias_density_nm, -500.0..=500.0),
            ("geometry.missing_pillars", g.missing_pillars, 0.0..=1.0),
            ("geometry.zero_order", g.zero_order, 0.0..=2.0),
            ("geometry.zero_order_phase", g.zero_order_phase, -100.0..=100.0),
            ("cell.height_nm", c.height_nm, -1e4..=1e4),
            ("cell.rim_height_nm", c.rim_height_nm, -1e4..=1e4),
            ("cell.index", c.index, -2.0..=2.0),
            ("cell.taper_deg", c.taper_deg, -30.0..=30.0),
            ("cell.corner_rounding_nm", c.corner_rounding_nm, 0.0..=1e4),
            ("cell.residual_mask_nm", c.residual_mask_nm, 0.0..=1e4),
            ("path.defocus_um", p.defocus_um, -1e5..=1e5),
            ("path.source_per_m", p.source_per_m, -1e4..=1e4),
            ("light.led_width", l.led_width, -1.0..=100.0),
            ("light.source_size", l.source_size, -1.0..=100.0),
            ("camera.pixel_blur_um", k.pixel_blur_um, 0.0..=1e3),
            ("camera.stray_light", k.stray_light, 0.0..=1.0),
        ];
        let lists: [(&str, &[f64], RangeInclusive<f64>); 9] = [
            ("geometry.aperture_offset_um", &g.aperture_offset_um, -1e4..=1e4),
            ("geometry.wavefront_nm", &g.wavefront_nm, -1e5..=1e5),
            ("geometry.transmission", &g.transmission, -10.0..=10.0),
            (
                "geometry.transmission_phase_rad",
                &g.transmission_phase_rad,
                -100.0..=100.0,
            ),
            ("geometry.transmission_range_nm", &g.transmission_range_nm, 0.0..=1e5),
            ("path.tilt_mrad", &p.tilt_mrad, -1000.0..=1000.0),
            ("path.sensor_tilt_mrad", &p.sensor_tilt_mrad, -1000.0..=1000.0),
            ("path.sensor_pivot_um", &p.sensor_pivot_um, -1e6..=1e6),
            ("light.led_shift_nm", &l.led_shift_nm, -500.0..=500.0),
        ];
        let mut faults: Vec<_> = single
            .into_iter()
            .filter_map(|(key, value, range)| outside(key.into(), value, &range))
            .collect();
        for (key, values, range) in lists {
            let of = |(place, value): (usize, &f64)| outside(format!("{key}.{place}"), *value, &range);
            faults.extend(values.iter().enumerate().filter_map(of));
        }
        for (key, terms) in [
            ("geometry.wavefront_nm", &g.wavefront_nm),
            ("geometry.transmission", &g.transmission),
            ("geometry.transmission_phase_rad", &g.transmission_phase_rad),
        ] {
            if terms.len() > MOST_TERMS {
                let what = format!("`{}` has {} terms", name(key), terms.len());
                faults.push(fault(key, what, format!("it has at most {MOST_TERMS}")));
            }
        }
        if let Some(range) = g.cd_bias_density_range_um {
            faults.extend(outside("geometry.cd_bias_density_range_um".into(), range, &RANGES_UM));
        }
        self.boundaries(&mut faults);
        for (part, declared) in [
            ("geometry", &g.declared),
            ("path", &p.declared),
            ("light", &l.declared),
            ("camera", &k.declared),
        ] {
            faults.extend(
                declared
                    .iter()
                    .enumerate()
                    .filter_map(|(n, term)| expression(part, n, term)),
            );
        }
        let [narrow, wide] = g.transmission_range_nm;
        if !(g.transmission.is_empty() && g.transmission_phase_rad.is_empty()) && wide - narrow < 1.0 {
            faults.push(fault(
                "geometry.transmission_range_nm",
                "a transmission has no range of widths",
                "add `transmission_range_nm = [narrowest, widest]`, a nanometre apart or more",
            ));
        }
        faults
    }

    fn boundaries(&self, faults: &mut Vec<PerturbationFault>) {
        let all = &self.geometry.stitching;
        if all.len() > stitching::MOST {
            faults.push(fault(
                "geometry.stitching",
                format!("there are {} boundaries of write fields", all.len()),
                format!("a lens has at most {}", stitching::MOST),
            ));
        }
        let reach = |s: &Stitching| s.by_nm.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        let sound = |s: &Stitching| {
            s.axis < 2 && s.at_um.abs() <= 1e4 && s.by_nm.iter().all(|v| v.is_finite()) && reach(s) <= 1e4
        };
        let wrong = all.iter().enumerate().filter(|(_, s)| !sound(s));
        faults.extend(wrong.map(|(n, _)| {
            fault(
                format!("geometry.stitching.{n}"),
                "this boundary of write fields cannot be",
                "it has an axis of 0 or 1, lies within 10 mm of the middle, and displaces by at most 10 um",
            )
        }));
    }
}

fn expression(part: &str, number: usize, term: &DeclaredTerm) -> Option<PerturbationFault> {
    let wrong = term.compiled().err()?;
    let of = format!("the expression of `{}`, column {}", quoted(&term.name), wrong.at + 1);
    let what = format!("{of}: {}", quoted(&wrong.what));
    Some(fault(
        format!("{part}.declared.{number}.expression"),
        what,
        "correct the expression",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_that_cannot_be_is_named() {
        assert_eq!(Perturbation::default().faults(), Vec::new());
        let mut bad = Perturbation::default();
        bad.geometry.cd_bias_nm = f64::NAN;
        bad.geometry.transmission = vec![0.1];
        bad.path.tilt_mrad[1] = 1e9;
        bad.light.source_size = -3.0;
        let keys: Vec<String> = bad.faults().into_iter().map(|fault| fault.key).collect();
        let wrong = [
            "geometry.cd_bias_nm",
            "light.source_size",
            "path.tilt_mrad.1",
            "geometry.transmission_range_nm",
        ];
        assert_eq!(keys, wrong);
    }
}
