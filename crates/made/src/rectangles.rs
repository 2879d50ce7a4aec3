//! Rotated rectangles as made: light of both hands, and what of it reaches the sensor.

use std::collections::HashMap;

use num_complex::Complex64;

use super::cells::SolvedWidths;
use super::{CellBank, CellChange, MadeElement};
use metalith_cell::{HandTables, Handedness, PolarisedLight, PolarisedTables, RotationSamples};
use metalith_core::{Result, RotatedRectangles};

/// Which light arrives at rotated rectangles, which of it they focus, and what reaches the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RotatedLight {
    /// The hand that is focused.
    pub focused: Handedness,
    pub polarised: PolarisedLight,
}

/// Classes of rectangles by the shorter edge as made (nm) and the number of their rotation; a width of zero is a site without pillar.
#[derive(Clone, Copy)]
pub(super) struct RotatedClasses<'a> {
    pub widths_nm: &'a [f64],
    pub numbers: &'a [u16],
}

impl<'a> RotatedClasses<'a> {
    pub fn of(element: &'a MadeElement) -> Self {
        Self {
            widths_nm: element.widths_nm(),
            numbers: element.rotations(),
        }
    }
}

/// What each class does to light of both hands, from the tables of a bank; after them a site without pillar, and one that light passes
/// as it is.
pub(super) fn hands(
    bank: &CellBank,
    change: &CellChange,
    pillars: RotatedRectangles,
    classes: RotatedClasses<'_>,
    (wavelength_um, orders): (f64, usize),
    focused: Handedness,
) -> Result<HandTables> {
    let drawn_nm = f64::from(pillars.width_nm);
    // Both edges are off by the same.
    let mut places: HashMap<u64, Vec<usize>> = HashMap::new();
    for (class, width_nm) in classes.widths_nm.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        places.entry((width_nm - drawn_nm).to_bits()).or_default().push(class);
    }
    let (keys, members): (Vec<u64>, Vec<Vec<usize>>) = places.into_iter().unzip();
    let biases: Vec<f64> = keys.into_iter().map(f64::from_bits).collect();
    let (samples, bare) = bank.rectangles(change, orders, &biases, wavelength_um)?;
    let bare_hands = bare.hands(pillars, &[0], focused);
    let count = classes.widths_nm.len();
    let room = |of_bare: &Vec<Complex64>, passes: Complex64| {
        let mut room = vec![of_bare[0]; count + 2];
        room[count + 1] = passes;
        room
    };
    let mut all = HandTables {
        focused,
        converted: bare_hands.converted.each_ref().map(|t| room(t, Complex64::ZERO)),
        unconverted: bare_hands.unconverted.each_ref().map(|t| room(t, Complex64::ONE)),
    };
    for (samples, members) in samples.iter().zip(&members) {
        let numbers: Vec<u16> = members.iter().map(|class| classes.numbers[*class]).collect();
        let own = samples.hands(pillars, &numbers, focused);
        let tables = all.converted.iter_mut().zip(own.converted);
        for (to, from) in tables.chain(all.unconverted.iter_mut().zip(own.unconverted)) {
            members.iter().zip(from).for_each(|(class, t)| to[*class] = t);
        }
    }
    Ok(all)
}

/// What of that reaches the sensor: one table for all light that interferes with no other.
pub(super) fn passed(hands: HandTables, light: PolarisedLight) -> SolvedWidths {
    let mut solved = SolvedWidths {
        pillars: Vec::new(),
        bare: Vec::new(),
        unseen: Vec::new(),
        share: 1.0,
        rim: None,
    };
    let passed = PolarisedTables::Hands(hands).passed(light);
    for mut table in passed.into_iter().map(|p| p.table) {
        solved.unseen.extend(table.pop());
        solved.bare.extend(table.pop());
        solved.pillars.push(table);
    }
    solved
}

/// Samples of a rectangle with edges that are off by so much (nm), and of a site without one.
pub(super) type SampledRectangles = (Vec<RotationSamples>, RotationSamples);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BankRange, perturbed};
    use metalith_cell::{Analyser, BAND_ORDERS, CellStack, Polarisation};
    use metalith_core::{PillarShape, Silent};
    use metalith_rcwa::{Material, Orders};

    /// What cubics leave between the nodes of edges and height, of transmissions near one.
    const BETWEEN: f64 = 5e-3;

    const PILLARS: RotatedRectangles = RotatedRectangles {
        width_nm: 100,
        length_nm: 250,
        steps: 180,
    };

    fn of_height(height_nm: f64) -> CellChange {
        CellChange {
            height_nm,
            ..CellChange::default()
        }
    }

    #[test]
    fn rectangles_between_the_nodes_are_those_solved_exactly_in_the_light_they_are_in() {
        let um = 0.526;
        let stated = CellStack {
            film: Material::named("tio2_siefke_2016").unwrap(),
            shape: PillarShape::Rectangle(PILLARS.into()),
            ..CellStack::paper(354.0, 600.0).unwrap()
        };
        let range = BankRange {
            widths_nm: [-1.0, 2.0],
            changes: [of_height(-4.0), of_height(4.0)],
            colours: vec![(um, BAND_ORDERS)],
        };
        let bank = CellBank::solve(&stated, range.clone(), &Silent).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cells.bank");
        bank.write(&path).unwrap();
        let bank = CellBank::read(&path, &stated, range).unwrap();
        let classes = RotatedClasses {
            widths_nm: &[100.4, 0.0, 101.3, 100.4],
            numbers: &[17, 0, 90, 140],
        };
        let change = of_height(1.3);
        let hand = Handedness::Left;
        let found = hands(&bank, &change, PILLARS, classes, (um, BAND_ORDERS), hand).unwrap();
        let orders = Orders::new(BAND_ORDERS).unwrap();
        for (class, (width_nm, number)) in classes.widths_nm.iter().zip(classes.numbers).enumerate() {
            if *width_nm == 0.0 {
                continue;
            }
            let edges = [*width_nm, width_nm + 150.0];
            let exact = RotationSamples::solve(&perturbed(&stated, &change), edges, um, orders).unwrap();
            let exact = exact.hands(PILLARS, &[*number], hand);
            for k in 0..2 {
                assert!((found.converted[k][class] - exact.converted[k][0]).norm() < BETWEEN);
                assert!((found.unconverted[k][class] - exact.unconverted[k][0]).norm() < BETWEEN);
            }
        }
        // Without a pillar nothing is converted, and all that passes is in the other table; so is light that sees none.
        let all = passed(found.clone(), PolarisedLight::default());
        assert_eq!(all.pillars.len(), 2);
        assert_eq!([all.bare[0], all.unseen[0]], [Complex64::ZERO; 2]);
        assert_eq!([all.pillars[1][1], all.unseen[1]], [all.bare[1], Complex64::ONE]);
        assert!(all.bare[1].norm() > 1.0);
        let behind = PolarisedLight {
            arriving: Some(Polarisation::Circular(hand)),
            analyser: Some(Analyser::Circular),
        };
        assert_eq!(passed(found, behind).pillars, all.pillars[..1]);
        let outside = RotatedClasses {
            widths_nm: &[120.0],
            numbers: &[1],
        };
        assert!(hands(&bank, &change, PILLARS, outside, (um, BAND_ORDERS), hand).is_err());
    }
}
