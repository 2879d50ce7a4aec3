//! Orders of the lattice of the pillars: the medium into which it diffracts, and the light of the design for which it
//! does.

use std::cmp::Ordering;

use serde::Serialize;

use crate::{CellSpec, Design, FieldAngle};
use metalith_core::Result;
use metalith_pillars::LatticeKind;

/// Medium on one side of the pillars.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Medium {
    /// Orders above the pillars, towards the sensor.
    Ambient,
    /// Orders below the pillars, where light comes from.
    Substrate,
}

impl Medium {
    /// Media on both sides, the side of the sensor first.
    pub const BOTH: [Self; 2] = [Self::Ambient, Self::Substrate];

    /// Words for it in a sentence.
    pub fn words(self) -> &'static str {
        match self {
            Self::Ambient => "the medium over the pillars",
            Self::Substrate => "the substrate",
        }
    }
}

/// Light for which a design is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AskedLight {
    /// Light from the middle of the field of each element, at the wavelengths of `[verify]`.
    Middle,
    /// Light from all field angles of `[verify]` too, and at the shortest wavelength of the band.
    All,
}

/// Light of which the lattice sends some into oblique orders of a medium.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LatticeOrders {
    pub medium: Medium,
    /// Wavelength in vacuum (um).
    pub wavelength_um: f64,
    /// Wavelength (um) below which there are orders in light along the normal, by the index at [`Self::wavelength_um`].
    pub normal_edge_um: f64,
    /// Wavelength (um) below which there are orders in the light of the element and the field angle below, which have
    /// the longest of all.
    pub edge_um: f64,
    /// Steps of that element from the middle, as in its label.
    pub element: (i32, i32),
    /// Counted from where it looks.
    pub field: FieldAngle,
    /// Direction sines of that light as it arrives, in air.
    pub incidence_sin: [f64; 2],
}

impl LatticeOrders {
    /// Words for the wavelength from which on there are none.
    pub fn edge_words(&self) -> String {
        let normal = format!("below {:.1} nm along the normal", self.normal_edge_um * 1e3);
        if self.incidence_sin == [0.0; 2] {
            return normal;
        }
        let ((m, n), FieldAngle { x_deg, y_deg }) = (self.element, self.field);
        format!(
            "{normal}, below {:.1} nm at element ({m}, {n}) from ({x_deg}, {y_deg})°",
            self.edge_um * 1e3
        )
    }

    /// Words for what is found.
    pub fn words(&self) -> String {
        format!(
            "at {:.1} nm the lattice diffracts into {}: orders exist {}",
            self.wavelength_um * 1e3,
            self.medium.words(),
            self.edge_words()
        )
    }

    /// All that was found of each medium in one sentence.
    pub fn summary(found: &[Self]) -> Vec<String> {
        let of_medium = |medium| {
            let own: Vec<_> = found.iter().filter(|o| o.medium == medium).collect();
            let longest = own.iter().max_by(|a, b| a.edge_um.total_cmp(&b.edge_um))?;
            let wavelengths: Vec<_> = own.iter().map(|o| format!("{:.1}", o.wavelength_um * 1e3)).collect();
            Some(format!(
                "the lattice of the pillars diffracts into {} at {} nm: orders exist {}",
                medium.words(),
                wavelengths.join(", "),
                longest.edge_words()
            ))
        };
        Medium::BOTH.into_iter().filter_map(of_medium).collect()
    }
}

impl Design {
    /// Orders other than the zeroth, which forms the image, into which the lattice of the pillars diffracts: one entry
    /// for each medium and wavelength at which it does, wavelengths rising; of several elements and field angles the
    /// one which has orders up to the longest wavelength. An order exists where the light that arrives and a vector of
    /// the lattice together are less than the index.
    ///
    /// # Errors
    /// If a material is not known at a wavelength.
    pub fn lattice_orders(&self, asked: AskedLight) -> Result<Vec<LatticeOrders>> {
        let stack = self.cell_stack()?;
        let mut wavelengths_um = self.verify.wavelengths_um.clone();
        let mut angles = vec![FieldAngle { x_deg: 0.0, y_deg: 0.0 }];
        if asked == AskedLight::All {
            wavelengths_um.push(self.band_of(&stack).0);
            angles.extend(&self.verify.field_angles);
        }
        wavelengths_um.sort_by(f64::total_cmp);
        wavelengths_um.dedup();
        let vectors = vectors_um(&self.cell);
        let elements = self.elements();
        let mut found = Vec::new();
        for medium in Medium::BOTH {
            let material = match medium {
                Medium::Ambient => &stack.ambient,
                Medium::Substrate => &stack.substrate,
            };
            for &wavelength_um in &wavelengths_um {
                let index = material.index(wavelength_um)?.re;
                let normal_edge_um = edge_um(index, [0.0; 2], &vectors);
                let lit = elements.iter().flat_map(|e| angles.iter().map(move |a| (e, *a)));
                let of_light = lit.filter_map(|(element, field)| {
                    let field_rad = [field.x_deg, field.y_deg].map(f64::to_radians);
                    let incidence_sin = element.wedge.arriving(wavelength_um, field_rad)?;
                    Some(LatticeOrders {
                        medium,
                        wavelength_um,
                        normal_edge_um,
                        edge_um: edge_um(index, incidence_sin, &vectors),
                        element: element.index,
                        field,
                        incidence_sin,
                    })
                });
                // The first of equals.
                let longest = of_light.reduce(|a, b| match b.edge_um.total_cmp(&a.edge_um) {
                    Ordering::Greater => b,
                    _ => a,
                });
                found.extend(longest.filter(|o| o.wavelength_um < o.edge_um));
            }
        }
        Ok(found)
    }
}

/// Vectors of the lattice (1/um) that the longest edges belong to, and more.
fn vectors_um(cell: &CellSpec) -> Vec<[f64; 2]> {
    let pitch_um = cell.pitch_nm.nm() * 1e-3;
    // Of staggered rows, those of a rectangle of two rows whose sum is even.
    let (along_y_um, staggered) = match cell.lattice {
        LatticeKind::Square => (pitch_um, false),
        LatticeKind::Hexagonal => (
            2.0 * cell.lattice.row_nm(cell.pitch_nm, cell.database_unit) * 1e-3,
            true,
        ),
    };
    let all = (-2..=2).flat_map(|m: i32| (-2..=2).map(move |n: i32| (m, n)));
    all.filter(|&(m, n)| (m, n) != (0, 0) && !(staggered && (m + n) % 2 != 0))
        .map(|(m, n)| [f64::from(m) / pitch_um, f64::from(n) / along_y_um])
        .collect()
}

/// Longest wavelength (um) at which an order exists in a medium of this index, in light of these direction sines.
fn edge_um(index: f64, [sin_x, sin_y]: [f64; 2], vectors_um: &[[f64; 2]]) -> f64 {
    let edges = vectors_um.iter().map(|[x, y]| {
        let length = x.hypot(*y);
        let along = (sin_x * x + sin_y * y) / length;
        let across = (sin_x * y - sin_y * x) / length;
        (-along + (index * index - across * across).sqrt()) / length
    });
    // No number where the light itself does not travel in the medium.
    edges.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tolerance of sums of a few numbers near one, in um.
    const ROUNDING_UM: f64 = 1e-12;

    fn changed(name: &str, changes: &[(&str, &str)]) -> Design {
        Design::parse(
            &metalith_testing::design(name),
            &metalith_testing::changed(name, changes),
        )
        .unwrap()
    }

    fn of_lattice(lattice: LatticeKind, pitch_nm: u32) -> Vec<[f64; 2]> {
        vectors_um(&CellSpec {
            lattice,
            pitch_nm: pitch_nm.into(),
            ..changed("asi_940", &[]).cell
        })
    }

    #[test]
    fn edges_are_those_of_the_grating_equation() {
        let square = of_lattice(LatticeKind::Square, 500);
        assert!((edge_um(1.5, [0.0; 2], &square) - 0.75).abs() < ROUNDING_UM);
        // Light from a sine of 0.2 meets the order that turns it back later, whichever side it is from.
        for sines in [[0.2, 0.0], [-0.2, 0.0], [0.0, 0.2], [0.0, -0.2]] {
            assert!((edge_um(1.5, sines, &square) - 0.5 * 1.7).abs() < ROUNDING_UM);
        }
        // Along the diagonal each axis has a part of it.
        let diagonal = 0.3 / 2f64.sqrt();
        let wanted = 0.5 * (diagonal + (1.0 - diagonal * diagonal).sqrt());
        assert!((edge_um(1.0, [diagonal, -diagonal], &square) - wanted).abs() < ROUNDING_UM);
        // Rows are 606 nm apart.
        let hexagonal = of_lattice(LatticeKind::Hexagonal, 700);
        let along_rows = 1.0 / (1.0 / 0.7f64).hypot(1.0 / 1.212);
        assert!((edge_um(1.0, [0.0; 2], &hexagonal) - along_rows.max(0.606)).abs() < ROUNDING_UM);
    }

    #[test]
    fn a_pitch_beyond_the_wavelength_diffracts_into_both_media() {
        let wide = ("width_max_nm = 350", "width_max_nm = 700");
        // In [cell] and in [mapping.cell].
        let pitch = ("pitch_nm = 450", "pitch_nm = 1000");
        let design = changed("asi_940", &[pitch, pitch, wide]);
        let middle = design.lattice_orders(AskedLight::Middle).unwrap();
        let media: Vec<_> = middle.iter().map(|o| o.medium).collect();
        assert_eq!(media, Medium::BOTH);
        assert!((middle[0].edge_um - 1.0).abs() < ROUNDING_UM);
        let said = LatticeOrders::summary(&middle);
        insta::assert_snapshot!(said[0], @"the lattice of the pillars diffracts into the medium over the pillars at 940.0 nm: orders exist below 1000.0 nm along the normal");
        // The band begins at 3 % less; light from 10 degrees has orders up to longer wavelengths.
        let all = design.lattice_orders(AskedLight::All).unwrap();
        assert_eq!(all.len(), 4);
        assert!(
            all.iter()
                .all(|o| o.field.x_deg == 10.0 && o.edge_um > o.normal_edge_um)
        );
        assert!(
            changed("asi_940", &[])
                .lattice_orders(AskedLight::All)
                .unwrap()
                .is_empty()
        );
    }

    /// Of the shipped 3 x 3 light that arrives steeply is diffracted in air, light from the middle of a field in the glass alone.
    #[test]
    fn steering_and_field_count() {
        let design = changed("mini_3x3", &[]);
        let media = |asked| -> Vec<_> {
            let found = design.lattice_orders(asked).unwrap();
            found.iter().map(|o| (o.medium, o.wavelength_um)).collect()
        };
        let of = |medium, all: &[f64]| all.iter().map(|um| (medium, *um)).collect::<Vec<_>>();
        let middle = media(AskedLight::Middle);
        assert!(
            middle.iter().all(|(medium, _)| *medium == Medium::Substrate),
            "{middle:?}"
        );
        let air = of(Medium::Ambient, &[0.4, 0.455]);
        assert_eq!(
            media(AskedLight::All),
            [air, of(Medium::Substrate, &[0.4, 0.455, 0.53, 0.66])].concat()
        );
    }
}
