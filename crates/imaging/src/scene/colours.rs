//! Colours of a picture as light in linear sRGB: profiles of ICC, and what PNG says instead of one.

use metalith_core::srgb;
use nalgebra::{Matrix3, Vector3};
use ndarray::Array3;

/// Chromaticities of red, green, blue and white.
pub(super) type Primaries = [[f64; 2]; 4];

/// White of daylight (D65), and of the space between profiles (D50).
const D65: [f64; 2] = [0.3127, 0.3290];
const D50: [f64; 3] = [0.9642, 1.0, 0.8249];

const SRGB: Primaries = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65];
const DISPLAY_P3: Primaries = [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65];
const BT_2020: Primaries = [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65];

/// Largest difference from sRGB, of light and of values, within which colours are sRGB: profiles of it round their numbers.
const SAME: f64 = 3e-3;

/// The gamma that PNG states for sRGB, and how much less is still meant by it.
const GAMMA_OF_SRGB: f64 = 0.45455;
const SAME_GAMMA: f64 = 0.005;

/// Most entries of a curve.
const MOST_ENTRIES: usize = 1 << 16;

/// Word on what to do with colours that are not read.
const TO_SRGB: &str = "convert the picture to sRGB";

/// Light of a stored value.
#[derive(Clone, Debug, PartialEq)]
enum Curve {
    Srgb,
    Power(f64),
    /// Light at equal steps from 0 to 1.
    Table(Vec<f64>),
    /// `(a x + b)^g + e` from `d` on, `c x + f` below: g, a, b, c, d, e, f.
    Parametric([f64; 7]),
}

impl Curve {
    fn light(&self, value: f64) -> f64 {
        match self {
            Self::Srgb => srgb::linear(value),
            Self::Power(power) => value.max(0.0).powf(*power),
            Self::Table(table) => {
                let at = value.clamp(0.0, 1.0) * (table.len() - 1) as f64;
                let low = (at as usize).min(table.len() - 2);
                let part = at - low as f64;
                (1.0 - part) * table[low] + part * table[low + 1]
            }
            Self::Parametric([g, a, b, c, d, e, f]) => {
                if value >= *d {
                    (a * value + b).max(0.0).powf(*g) + e
                } else {
                    c * value + f
                }
            }
        }
    }

    fn is_srgb(&self) -> bool {
        *self == Self::Srgb
            || (0..=64)
                .map(|k| f64::from(k) / 64.0)
                .all(|v| (self.light(v) - srgb::linear(v)).abs() < SAME)
    }
}

/// Light of the values of a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Colours {
    curves: [Curve; 3],
    /// To linear sRGB.
    matrix: Matrix3<f64>,
}

impl Colours {
    /// Those of sRGB, if a picture says nothing else.
    fn srgb() -> Self {
        Self::new([const { Curve::Srgb }; 3], Matrix3::identity())
    }

    /// With those that are sRGB as these.
    fn new(curves: [Curve; 3], matrix: Matrix3<f64>) -> Self {
        let curves = curves.map(|curve| if curve.is_srgb() { Curve::Srgb } else { curve });
        let near = (matrix - Matrix3::identity()).amax() < SAME;
        Self {
            curves,
            matrix: if near { Matrix3::identity() } else { matrix },
        }
    }

    /// True if stored values are values in sRGB.
    pub(super) fn is_srgb(&self) -> bool {
        *self == Self::srgb()
    }

    /// Linear light with primaries; none that make a triangle leave it as it is.
    pub(super) fn linear(primaries: Option<Primaries>) -> Self {
        let matrix = primaries.and_then(to_srgb).unwrap_or_else(Matrix3::identity);
        Self::new([const { Curve::Power(1.0) }; 3], matrix)
    }

    /// Linear sRGB of stored values; what it has not is the nearest that it has.
    pub(super) fn light(&self, stored: &Array3<f64>) -> Array3<f64> {
        let mut out = stored.clone();
        for mut pixel in out.rows_mut() {
            let own = Vector3::from_fn(|k, _| self.curves[k].light(pixel[k]));
            let light = self.matrix * own;
            (0..3).for_each(|k| pixel[k] = light[k].max(0.0));
        }
        out
    }

    /// Colours that a PNG says, the most exact of its words.
    pub(super) fn of_png(info: &png::Info<'_>) -> Result<Self, String> {
        if let Some(points) = &info.coding_independent_code_points {
            return Self::of_code_points(points.color_primaries, points.transfer_function);
        }
        if let Some(profile) = &info.icc_profile {
            return Self::of_profile(profile);
        }
        if info.srgb.is_some() {
            return Ok(Self::srgb());
        }
        let gamma = info.gamma().map(|g| f64::from(g.into_value())).filter(|g| *g > 0.0);
        let curve = match gamma {
            Some(gamma) if (gamma - GAMMA_OF_SRGB).abs() >= SAME_GAMMA => Curve::Power(1.0 / gamma),
            _ => Curve::Srgb,
        };
        let primaries = info
            .chromaticities()
            .map(|c| [c.red, c.green, c.blue, c.white].map(|(x, y)| [x, y].map(|v| f64::from(v.into_value()))));
        let matrix = match primaries {
            Some(primaries) => to_srgb(primaries).ok_or("its chromaticities (cHRM) are no colours")?,
            None => Matrix3::identity(),
        };
        Ok(Self::new([curve.clone(), curve.clone(), curve], matrix))
    }

    /// Colours by numbers of ITU-T H.273.
    fn of_code_points(primaries: u8, transfer: u8) -> Result<Self, String> {
        let primaries = match primaries {
            1 | 2 => SRGB,
            9 => BT_2020,
            12 => DISPLAY_P3,
            other => return Err(format!("its primaries (cICP) have the number {other}: {TO_SRGB}")),
        };
        let curve = match transfer {
            // Cameras of BT.709 and BT.2020 are shown as sRGB is.
            1 | 2 | 6 | 13 | 14 | 15 => Curve::Srgb,
            4 => Curve::Power(2.2),
            5 => Curve::Power(2.8),
            8 => Curve::Power(1.0),
            16 | 18 => {
                return Err(format!(
                    "its values (cICP) are those of a bright display, PQ or HLG: {TO_SRGB}"
                ));
            }
            other => {
                return Err(format!(
                    "its transfer function (cICP) has the number {other}: {TO_SRGB}"
                ));
            }
        };
        let matrix = to_srgb(primaries).unwrap_or_else(Matrix3::identity);
        Ok(Self::new([curve.clone(), curve.clone(), curve], matrix))
    }

    /// Colours of an ICC profile (ICC.1:2022) of three curves and a matrix, or of one curve of grey.
    pub(super) fn of_profile(profile: &[u8]) -> Result<Self, String> {
        let damaged = || format!("its colour profile is damaged: {TO_SRGB}");
        let (Some(b"acsp"), Some(space)) = (profile.get(36..40), profile.get(16..20)) else {
            return Err(damaged());
        };
        let tags = Tags::of(profile).ok_or_else(damaged)?;
        match space {
            b"GRAY" => {
                let curve = tags.curve(b"kTRC").ok_or_else(damaged)?;
                Ok(Self::new([curve.clone(), curve.clone(), curve], Matrix3::identity()))
            }
            b"RGB " => {
                let columns = [b"rXYZ", b"gXYZ", b"bXYZ"].map(|name| tags.colour(name));
                let curves = [b"rTRC", b"gTRC", b"bTRC"].map(|name| tags.curve(name));
                let ([Some(r), Some(g), Some(b)], [Some(cr), Some(cg), Some(cb)]) = (columns, curves) else {
                    return Err(format!(
                        "its colour profile has tables of colours, which are not read: {TO_SRGB}"
                    ));
                };
                let matrix = from_white(Vector3::from(D50)) * Matrix3::from_columns(&[r, g, b]);
                Ok(Self::new([cr, cg, cb], white_kept(matrix).ok_or_else(damaged)?))
            }
            _ => {
                let space = metalith_core::text::printable_bytes(space);
                Err(format!(
                    "its colour profile is for {}, not for RGB or grey: {TO_SRGB}",
                    space.trim_end()
                ))
            }
        }
    }
}

/// Tags of a profile: name, place and length of each.
struct Tags<'a> {
    profile: &'a [u8],
    entries: Vec<([u8; 4], usize, usize)>,
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

/// A number with sixteen bits behind the point.
fn fixed(bytes: &[u8], at: usize) -> Option<f64> {
    Some(f64::from(word(bytes, at)? as i32) / 65536.0)
}

impl<'a> Tags<'a> {
    const MOST: u32 = 256;

    fn of(profile: &'a [u8]) -> Option<Self> {
        let count = word(profile, 128).filter(|n| *n <= Self::MOST)? as usize;
        let entry = |k: usize| {
            let at = 132 + 12 * k;
            let name = profile.get(at..at + 4)?.try_into().ok()?;
            Some((name, word(profile, at + 4)? as usize, word(profile, at + 8)? as usize))
        };
        let entries = (0..count).map(entry).collect::<Option<_>>()?;
        Some(Self { profile, entries })
    }

    fn tag(&self, name: &[u8; 4]) -> Option<&'a [u8]> {
        let &(_, at, length) = self.entries.iter().find(|(own, ..)| own == name)?;
        self.profile.get(at..at.checked_add(length)?)
    }

    fn colour(&self, name: &[u8; 4]) -> Option<Vector3<f64>> {
        let tag = self.tag(name).filter(|tag| tag.starts_with(b"XYZ "))?;
        Some(Vector3::new(fixed(tag, 8)?, fixed(tag, 12)?, fixed(tag, 16)?))
    }

    fn curve(&self, name: &[u8; 4]) -> Option<Curve> {
        let tag = self.tag(name)?;
        if tag.starts_with(b"curv") {
            let count = word(tag, 8).map(|n| n as usize).filter(|n| *n <= MOST_ENTRIES)?;
            let entries = tag.get(12..12 + 2 * count)?.chunks_exact(2);
            let entries: Vec<f64> = entries.map(|b| f64::from(u16::from_be_bytes([b[0], b[1]]))).collect();
            return Some(match entries[..] {
                [] => Curve::Power(1.0),
                [power] => Curve::Power(power / 256.0),
                _ => Curve::Table(entries.iter().map(|v| v / 65535.0).collect()),
            });
        }
        let tag = Some(tag).filter(|tag| tag.starts_with(b"para"))?;
        let kind = word(tag, 8)? >> 16;
        let count = [1, 3, 4, 5, 7].get(kind as usize)?;
        let p = (0..*count)
            .map(|k| fixed(tag, 12 + 4 * k))
            .collect::<Option<Vec<f64>>>()?;
        Some(match (kind, &p[..]) {
            (0, [g]) => Curve::Power(*g),
            (1, [g, a, b]) => Curve::Parametric([*g, *a, *b, 0.0, -b / a, 0.0, 0.0]),
            (2, [g, a, b, c]) => Curve::Parametric([*g, *a, *b, 0.0, -b / a, *c, *c]),
            (3, [g, a, b, c, d]) => Curve::Parametric([*g, *a, *b, *c, *d, 0.0, 0.0]),
            (_, [g, a, b, c, d, e, f]) => Curve::Parametric([*g, *a, *b, *c, *d, *e, *f]),
            _ => return None,
        })
    }
}

/// A colour of unit luminance.
fn tristimulus([x, y]: [f64; 2]) -> Vector3<f64> {
    Vector3::new(x / y, 1.0, (1.0 - x - y) / y)
}

/// Linear values to X, Y, Z, white having a luminance of one; none if the colours make no triangle.
fn to_xyz([r, g, b, white]: Primaries) -> Option<Matrix3<f64>> {
    let colours = Matrix3::from_columns(&[r, g, b].map(tristimulus));
    let parts = colours.try_inverse()? * tristimulus(white);
    let matrix = colours * Matrix3::from_diagonal(&parts);
    Some(matrix).filter(|m| m.iter().all(|v| v.is_finite()))
}

/// X, Y, Z beside a white to linear sRGB, adapted by Bradford's cones.
fn from_white(white: Vector3<f64>) -> Matrix3<f64> {
    let cones = Matrix3::new(
        0.8951, 0.2664, -0.1614, -0.7502, 1.7135, 0.0367, 0.0389, -0.0685, 1.0296,
    );
    let inverse = |m: Matrix3<f64>| m.try_inverse().unwrap_or_else(Matrix3::identity);
    let gains = (cones * tristimulus(D65)).component_div(&(cones * white));
    let srgb = to_xyz(SRGB).unwrap_or_else(Matrix3::identity);
    inverse(srgb) * inverse(cones) * Matrix3::from_diagonal(&gains) * cones
}

fn to_srgb(primaries: Primaries) -> Option<Matrix3<f64>> {
    white_kept(from_white(tristimulus(primaries[3])) * to_xyz(primaries)?)
}

/// A matrix with rows scaled so that white stays white: stated numbers are rounded.
fn white_kept(mut matrix: Matrix3<f64>) -> Option<Matrix3<f64>> {
    for mut row in matrix.row_iter_mut() {
        let sum = row.sum();
        row /= sum;
    }
    Some(matrix).filter(|m| m.iter().all(|v| v.is_finite()))
}

#[cfg(test)]
pub(in crate::scene) mod tests {
    use super::*;

    /// A profile of curves and colours, as programs write it.
    pub(in crate::scene) fn profile(colours: [[f64; 3]; 3], curve: &[u8]) -> Vec<u8> {
        let mut out = vec![0; 128];
        out[16..20].copy_from_slice(b"RGB ");
        out[36..40].copy_from_slice(b"acsp");
        let (first, length) = (132 + 12 * 6, 20);
        out.extend(6u32.to_be_bytes());
        for (k, name) in [b"rXYZ", b"gXYZ", b"bXYZ"].iter().enumerate() {
            out.extend(name.iter());
            out.extend([first + length * k, length].map(|v| (v as u32).to_be_bytes()).concat());
        }
        for name in [b"rTRC", b"gTRC", b"bTRC"] {
            out.extend(name);
            out.extend(
                [first + 3 * length, curve.len()]
                    .map(|v| (v as u32).to_be_bytes())
                    .concat(),
            );
        }
        for colour in colours {
            out.extend(b"XYZ \0\0\0\0");
            out.extend(colour.iter().flat_map(|v| ((v * 65536.0).round() as i32).to_be_bytes()));
        }
        out.extend(curve);
        out
    }

    /// Numbers of the profile that telephones write for Display P3.
    pub(in crate::scene) const P3: [[f64; 3]; 3] = [
        [0.51512, 0.2412, -0.00105],
        [0.29198, 0.69225, 0.04189],
        [0.1571, 0.06657, 0.78407],
    ];

    /// The curve of sRGB by parameters.
    pub(in crate::scene) fn curve_of_srgb() -> Vec<u8> {
        let numbers = [2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045];
        let numbers = numbers
            .iter()
            .flat_map(|v| ((v * 65536.0f64).round() as i32).to_be_bytes());
        b"para\0\0\0\0\0\x03\0\0".iter().copied().chain(numbers).collect()
    }

    fn light(colours: &Colours, stored: [f64; 3]) -> [f64; 3] {
        let out = colours.light(&Array3::from_shape_vec((1, 1, 3), stored.to_vec()).unwrap());
        [0, 1, 2].map(|k| out[[0, 0, k]])
    }

    #[test]
    fn profiles_of_srgb_are_srgb() {
        let srgb = [
            [0.43607, 0.22249, 0.01392],
            [0.38515, 0.71687, 0.09708],
            [0.14307, 0.06061, 0.7141],
        ];
        assert!(Colours::of_profile(&profile(srgb, &curve_of_srgb())).unwrap().is_srgb());
        let table: Vec<u8> = (0..1024)
            .flat_map(|k| ((65535.0 * srgb::linear(f64::from(k) / 1023.0)).round() as u16).to_be_bytes())
            .collect();
        let table = [&b"curv\0\0\0\0\0\0\x04\0"[..], &table].concat();
        assert!(Colours::of_profile(&profile(srgb, &table)).unwrap().is_srgb());
        assert!(to_srgb(SRGB).is_some_and(|m| (m - Matrix3::identity()).amax() < SAME));
    }

    /// Red of Display P3 in linear sRGB, by its chromaticities, by its profile, and by published numbers.
    #[test]
    fn display_p3_is_wider_than_srgb() {
        /// Digits of the published numbers, and of the profile.
        const TOLERANCE: f64 = 5e-4;
        let by_profile = Colours::of_profile(&profile(P3, &curve_of_srgb())).unwrap();
        let by_points = Colours::of_code_points(12, 13).unwrap();
        for colours in [&by_profile, &by_points] {
            let [r, g, b] = light(colours, [1.0, 0.0, 0.0]);
            assert!((r - 1.22494).abs() < TOLERANCE && g == 0.0 && b == 0.0, "{r}");
            let [r, g, b] = light(colours, [0.5; 3]);
            let grey = srgb::linear(0.5);
            assert!([r, g, b].iter().all(|v| (v - grey).abs() < TOLERANCE), "{r} {g} {b}");
        }
        assert!((by_profile.matrix - by_points.matrix).amax() < TOLERANCE);
    }

    #[test]
    fn curves_have_their_forms() {
        let curve = |bytes: &[u8]| Colours::of_profile(&profile(P3, bytes)).map(|c| c.curves[0].clone());
        assert_eq!(curve(b"curv\0\0\0\0\0\0\0\0").unwrap(), Curve::Power(1.0));
        assert_eq!(
            curve(b"curv\0\0\0\0\0\0\0\x01\x02\x33").unwrap(),
            Curve::Power(563.0 / 256.0)
        );
        let table = curve(b"curv\0\0\0\0\0\0\0\x03\0\0\x10\0\xff\xff").unwrap();
        assert_eq!(table.light(0.5), 4096.0 / 65535.0);
        assert_eq!(table.light(2.0), 1.0);
        for damaged in [
            &b"curv\0\0\0\0\xff\xff\xff\xff"[..],
            b"curv",
            b"mft2",
            b"para\0\0\0\0\0\x09\0\0",
            b"",
        ] {
            assert!(curve(damaged).is_err());
        }
        assert!(Colours::of_profile(b"acsp").is_err());
    }
}
