//! Choice of elements that are simulated, and of their figures that hold for copies too.
//!
//! Pillars that are the same up to a symmetry do the same to light that is turned with them. Field angles are those of the chip:
//! a copy is asked for the same ones, which for the element that is simulated come from other sides.

use serde::Serialize;

use super::ElementCheck;
use metalith_design::array::{PillarArray, Symmetry};
use metalith_design::{Design, Element, FieldAngle};

/// Most elements that are simulated because their pillars are not as intended, where none may be so.
const MOST_FAULTY: usize = 4;

/// A field angle of the design, as it is asked of a copy of the element that is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CopyAngle {
    pub element: Element,
    /// Counted from where that element looks.
    pub field: FieldAngle,
}

/// A field angle of an element that is simulated; where only copies are asked for it, the first of them.
pub(super) type AskedAngle = (FieldAngle, Option<CopyAngle>);

/// An element that is simulated.
pub(super) struct Chosen {
    /// Number in the array.
    pub index: usize,
    pub element: Element,
    /// Number of elements that it stands for, itself among them.
    pub copies: usize,
    /// Field angles of the design, then field angles of its copies.
    pub angles: Vec<AskedAngle>,
}

impl Chosen {
    fn new(design: &Design, index: usize, element: Element) -> Self {
        Self {
            index,
            element,
            copies: 1,
            angles: design.verify.field_angles.iter().map(|field| (*field, None)).collect(),
        }
    }

    /// Field angles of the design that are asked of a copy and are none of these, turned as the copy is.
    fn missing(&self, design: &Design, copy: &Element, symmetry: Symmetry) -> Vec<AskedAngle> {
        let mut missing: Vec<AskedAngle> = Vec::new();
        for field in &design.verify.field_angles {
            let own = turned(symmetry.inverse(), *field);
            if !self.angles.iter().chain(&missing).any(|(known, _)| *known == own) {
                let copy = CopyAngle {
                    element: *copy,
                    field: *field,
                };
                missing.push((own, Some(copy)));
            }
        }
        missing
    }

    /// Symmetry that turns it into another element, pillars and wedge, and the field angles that are then to be
    /// simulated besides: of several symmetries, the one that leaves fewest. `None` if no symmetry does, or the other
    /// has another lens.
    fn turned_into(&self, design: &Design, array: &PillarArray, other: usize) -> Option<(Symmetry, Vec<AskedAngle>)> {
        let [from, to] = [self.index, other].map(|k| &array.placed[k]);
        if from.class != to.class {
            return None;
        }
        let [own, others] = [from, to].map(|placed| design.lens_of(&placed.element));
        if !(std::ptr::eq(own, others) || own == others) {
            return None;
        }
        let wedge = |e: &Element| [e.wedge.sin_x, e.wedge.sin_y];
        let group = array.classes[from.class].group.members().iter();
        let all = group.map(|kept| to.symmetry.after(*kept).after(from.symmetry.inverse()));
        all.filter(|s| s.vector(wedge(&from.element)) == wedge(&to.element))
            .map(|s| (s, self.missing(design, &to.element, s)))
            .min_by_key(|(_, missing)| missing.len())
    }
}

/// Choose the elements that are simulated: one of all that are alike by a symmetry which turns their light too, and of
/// those that are not as intended the first, or all where some may be so; each individually where what is made of them
/// is not `symmetric`. Elements are told which one they are simulated as.
pub(super) fn choose(
    design: &Design,
    array: &PillarArray,
    elements: &mut [ElementCheck],
    symmetric: bool,
) -> Vec<Chosen> {
    let most_faulty = match design.verify.limits.wrong_widths_max {
        0 => MOST_FAULTY,
        // They may pass: all limits are held to each of them.
        _ => usize::MAX,
    };
    let (mut chosen, mut faulty): (Vec<Chosen>, usize) = (Vec::new(), 0);
    for index in 0..elements.len() {
        let is_right = elements[index].widths.faults() == 0;
        // Those that are not as intended are nobody's copies, and nobody is theirs.
        let right = |one: &Chosen| is_right && symmetric && elements[one.index].copy_of.is_some();
        let mut all = chosen.iter().enumerate().filter(|(_, one)| right(one));
        let copy = all.find_map(|(k, one)| Some((k, one.turned_into(design, array, index)?)));
        let check = &mut elements[index];
        if let Some((k, (symmetry, missing))) = copy {
            chosen[k].angles.extend(missing);
            chosen[k].copies += 1;
            (check.copy_of, check.turned) = (Some(k), Some(symmetry));
            continue;
        }
        if is_right {
            (check.copy_of, check.turned) = (Some(chosen.len()), Some(Symmetry::IDENTITY));
        }
        faulty += usize::from(!is_right);
        if is_right || faulty <= most_faulty {
            chosen.push(Chosen::new(design, index, check.element));
        }
    }
    chosen
}

/// A field angle after a symmetry.
pub(super) fn turned(symmetry: Symmetry, field: FieldAngle) -> FieldAngle {
    // No negative zeros: they are shown.
    let [x_deg, y_deg] = symmetry.vector([field.x_deg, field.y_deg]).map(|deg| deg + 0.0);
    FieldAngle { x_deg, y_deg }
}

/// Place to which a symmetry takes (x, y), in words.
pub(super) fn place_words(symmetry: Symmetry) -> String {
    let ((ax, ay), (bx, by)) = (symmetry.point(1, 0), symmetry.point(0, 1));
    let name = |of_x: i64, of_y: i64| match (of_x, of_y) {
        (1, _) => "x",
        (-1, _) => "-x",
        (_, 1) => "y",
        _ => "-y",
    };
    format!("({}, {})", name(ax, bx), name(ay, by))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PillarCheck;
    use metalith_core::Silent;

    fn checks(array: &PillarArray, faults: u64) -> Vec<ElementCheck> {
        let check = |placed: &metalith_design::array::PlacedElement| ElementCheck {
            element: placed.element,
            widths: PillarCheck {
                wrong: faults,
                ..PillarCheck::default()
            },
            copy_of: None,
            turned: None,
        };
        array.placed.iter().map(check).collect()
    }

    fn read(name: &str, changes: &[(&str, &str)]) -> (Design, PillarArray) {
        let path = metalith_testing::design(name);
        let design = Design::parse(&path, &metalith_testing::changed(name, changes)).unwrap();
        let array = PillarArray::build(&design, &Silent).unwrap();
        (design, array)
    }

    /// Every element and field angle of the design has figures: the light that arrives there is that of the element that is
    /// simulated, turned as the element is.
    fn all_are_covered(design: &Design, array: &PillarArray) -> Vec<(usize, usize)> {
        let mut elements = checks(array, 0);
        let chosen = choose(design, array, &mut elements, true);
        for check in &elements {
            let (one, symmetry) = (&chosen[check.copy_of.unwrap()], check.turned.unwrap());
            for asked in &design.verify.field_angles {
                let arrives = |element: &Element, field: FieldAngle| {
                    let field_rad = [field.x_deg, field.y_deg].map(f64::to_radians);
                    element.wedge.arriving(0.53, field_rad).unwrap()
                };
                let light = arrives(&check.element, *asked);
                let own = one.angles.iter().map(|(field, _)| arrives(&one.element, *field));
                let same = own.filter(|own| symmetry.vector(*own) == light).count();
                assert_eq!(same, 1, "{} from {asked:?}", check.element.label());
            }
        }
        chosen.iter().map(|c| (c.copies, c.angles.len())).collect()
    }

    #[test]
    fn copies_of_a_grid_are_seen_from_all_sides() {
        // Corners, edges, middle; of the first two 15 degrees along x are three and two further angles.
        let (design, array) = read("mini_3x3", &[]);
        assert_eq!(all_are_covered(&design, &array), [(4, 3), (4, 4), (1, 2)]);
        // In the middle of the field all are alike, and so they are for a field that is symmetric.
        let angles = "field_x_deg = [0, 15]         # from the viewing direction of an element\nfield_y_deg = [0, 0]";
        let (design, array) = read("mini_3x3", &[(angles, "field_x_deg = [0]")]);
        assert_eq!(all_are_covered(&design, &array), [(4, 1), (4, 1), (1, 1)]);
        let cross = "field_x_deg = [0, 8, -8, 0, 0]\nfield_y_deg = [0, 0, 0, 8, -8]";
        let (design, array) = read("mini_3x3", &[(angles, cross)]);
        assert_eq!(all_are_covered(&design, &array), [(4, 5), (4, 5), (1, 5)]);
    }

    /// Two lenses with x^2 + x^3 of which one is rotated: from 8 degrees along x the rotated one is the other from another side.
    #[test]
    fn a_rotated_lens_is_asked_for_its_own_light() {
        let elements = r"
[[element]]
x_um = -80
y_um = 0
[[element]]
x_um = 80
y_um = 0
rotation_deg = 90
[[element]]
x_um = 0
y_um = 120
steering_x_deg = 0.000000001
";
        let term = "[[phase.term]]\nsource = \"polynomial\"\npowers_x = [2, 3]\npowers_y = [0, 0]\n\
                    coefficients_rad = [6.0, 5.0]\n\n[array]";
        let (design, array) = read(
            "tio2_532",
            &[
                ("field_x_deg = [0, 5]", "field_x_deg = [8]"),
                ("field_y_deg = [0, 0]", "field_y_deg = [0]"),
                ("elements = [1, 1]\nspacing_um = 150\n", ""),
                ("[array]", term),
                ("[mapping]", &format!("{elements}\n[mapping]")),
                ("size_um = [200, 200]", "size_um = [400, 400]"),
            ],
        );
        // The third has the pillars of the first, but looks elsewhere by a hair.
        assert_eq!(array.classes.len(), 1);
        assert_eq!(all_are_covered(&design, &array), [(2, 2), (1, 1)]);
        let mut elements = checks(&array, 0);
        let chosen = choose(&design, &array, &mut elements, true);
        let (own, copy) = chosen[0].angles[1];
        assert_eq!((own.x_deg, own.y_deg.abs()), (0.0, 8.0));
        let copy = copy.unwrap();
        assert_eq!((copy.element.index, copy.field.x_deg), ((2, 0), 8.0));
    }

    #[test]
    fn elements_that_are_not_as_intended_or_stand_alone_are_no_copies() {
        let (design, array) = read("mini_3x3", &[]);
        let mut elements = checks(&array, 1);
        assert_eq!(choose(&design, &array, &mut elements, true).len(), MOST_FAULTY);
        assert!(elements.iter().all(|e| e.copy_of.is_none()));
        let mut elements = checks(&array, 0);
        let chosen = choose(&design, &array, &mut elements, false);
        assert!(chosen.len() == 9 && chosen.iter().all(|c| c.angles.len() == 2));
    }

    #[test]
    fn symmetries_have_words() {
        let words = |mirrored, quarter_turns| {
            place_words(Symmetry {
                mirrored,
                quarter_turns,
            })
        };
        assert_eq!(words(false, 1), "(-y, x)");
        assert_eq!(words(true, 0), "(x, -y)");
        assert_eq!(words(true, 2), "(-x, y)");
        assert_eq!(words(true, 1), "(y, x)");
    }
}
