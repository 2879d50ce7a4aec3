//! Outlines of lenses that are no circles: polygons about the middle of an element.

use serde::Serialize;

use super::CellSpec;
use super::lens::read_diameter;
use metalith_core::document::{Limits, Section};
use metalith_pillars::Lattice;

/// Smallest and largest diameter of a lens (um).
pub const DIAMETER: Limits = Limits::new(5.0..=100_000.0, "um");

/// Most corners of an outline.
const MOST_CORNERS: usize = 1000;

/// Sharpest corner (degrees): the opening in the metal reaches as many margins beyond it as its half-angle's sine has parts.
const SHARPEST_DEG: f64 = 20.0;

/// A polygon that pillars stand in; its middle is that of the element, which it holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LensOutline {
    /// Corners (nm), counter-clockwise, the first not repeated.
    corners_nm: Vec<(i64, i64)>,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Circle,
    Rectangle,
    Regular,
    Polygon,
}

/// Diameter of the disc that holds all pillars (nm), and their outline if it is no circle.
pub(super) fn read(s: &Section<'_, '_>, cell: &CellSpec) -> (u32, Option<LensOutline>) {
    let kinds = [
        ("circle", Kind::Circle),
        ("rectangle", Kind::Rectangle),
        ("regular", Kind::Regular),
        ("polygon", Kind::Polygon),
    ];
    let corners_um: Vec<[f64; 2]> = match s.choice("aperture", &kinds, Some(Kind::Circle)) {
        Kind::Circle => return (read_diameter(s, cell), None),
        Kind::Regular => {
            let diameter_nm = read_diameter(s, cell);
            let sides = s.integer("aperture_sides", 3..=64, "sides");
            let corner = |k: i64| {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / sides as f64).sin_cos();
                [cos, sin].map(|c| c * f64::from(diameter_nm) * 0.5e-3)
            };
            let outline = LensOutline::rounded((0..sides).map(corner));
            outline.check(s, "aperture_sides");
            return (diameter_nm, Some(outline));
        }
        Kind::Rectangle => {
            let [w, h] = s.array::<2>("aperture_um", DIAMETER).map(|edge| edge / 2.0);
            vec![[-w, -h], [w, -h], [w, h], [-w, h]]
        }
        Kind::Polygon => {
            let place = Limits::new(-50_000.0..=50_000.0, "um");
            let [x, y] = ["corners_x_um", "corners_y_um"].map(|key| s.floats(key, place.clone()));
            if x.len() != y.len() || !(3..=MOST_CORNERS).contains(&x.len()) {
                s.fault(
                    "corners_x_um",
                    format!("{} places along x and {} along y", x.len(), y.len()),
                    format!("give x and y of each corner, 3 to {MOST_CORNERS} of them"),
                );
                return (1_000_000, None);
            }
            x.into_iter().zip(y).map(|(x, y)| [x, y]).collect()
        }
    };
    let key = if s.has("aperture_um") {
        "aperture_um"
    } else {
        "corners_x_um"
    };
    if s.has("diameter_um") {
        s.float("diameter_um", DIAMETER);
        s.fault(
            "diameter_um",
            "a diameter beside an aperture that says its own size",
            "leave it out: it is that of the circle about the aperture",
        );
    }
    let outline = LensOutline::rounded(corners_um.into_iter());
    let diameter_nm = outline.diameter_nm();
    let largest_nm = DIAMETER.range.end() * 1e3;
    if f64::from(diameter_nm) > largest_nm || cell.lattice_covering(diameter_nm).is_err() {
        s.fault_given(
            &["cell.pitch_nm"],
            key,
            format!("an aperture {} um across", f64::from(diameter_nm) * 1e-3),
            format!(
                "make it larger than the pitch and at most {} um across",
                largest_nm * 1e-3
            ),
        );
    }
    outline.check(s, key);
    (diameter_nm, Some(outline))
}

impl LensOutline {
    /// A polygon with these corners (um) on the grid of whole nanometres, counter-clockwise.
    fn rounded(corners_um: impl Iterator<Item = [f64; 2]>) -> Self {
        let nm = |um: f64| (um * 1e3).round() as i64;
        let mut corners_nm: Vec<_> = corners_um.map(|[x, y]| (nm(x), nm(y))).collect();
        if twice_area(&corners_nm) < 0 {
            corners_nm.reverse();
        }
        Self { corners_nm }
    }

    /// Corners about the middle of the element (nm), counter-clockwise, the first not repeated.
    pub fn corners_nm(&self) -> &[(i64, i64)] {
        &self.corners_nm
    }

    /// Least and greatest place along x and along y (nm).
    pub fn ends_nm(&self) -> [[i64; 2]; 2] {
        [0, 1].map(|axis| {
            let places = || self.corners_nm.iter().map(|&(x, y)| [x, y][axis]);
            [places().min().unwrap_or(0), places().max().unwrap_or(0)]
        })
    }

    /// True if a place from the middle of the element (nm) is inside or on the rim.
    pub fn holds(&self, x: i64, y: i64) -> bool {
        is_inside(sides(&self.corners_nm), x, y)
    }

    /// Sides by the rows of a lattice.
    pub(crate) fn rows(&self, lattice: &Lattice) -> OutlineRows {
        let reached = |iy| {
            let y = lattice.whole_nm(1, iy);
            let reaches = |((_, ay), (_, by)): &Side| (*ay.min(by)..=*ay.max(by)).contains(&y);
            sides(&self.corners_nm).filter(reaches).collect()
        };
        OutlineRows((0..lattice.sites()).map(reached).collect())
    }

    /// The outline turned from x towards y about the middle; exact for quarter turns.
    #[must_use]
    pub fn rotated(&self, deg: f64) -> Self {
        let rotation = crate::phase::Rotation::of_deg(deg);
        let turn = |&(x, y): &(i64, i64)| {
            let (x, y) = rotation.after(x as f64, y as f64);
            (x.round() as i64, y.round() as i64)
        };
        Self {
            corners_nm: self.corners_nm.iter().map(turn).collect(),
        }
    }

    /// Corners of the polygon whose sides are farther out by a margin (nm).
    pub fn grown(&self, margin_nm: i64) -> Vec<(i64, i64)> {
        let n = self.corners_nm.len();
        let corner = |k: usize| {
            let [before, here, after] = [k + n - 1, k, k + 1].map(|j| self.corners_nm[j % n]);
            let ([ax, ay], [bx, by]) = (outwards(before, here), outwards(here, after));
            // The bisector, as long as the margin asks for on both sides.
            let scale = margin_nm as f64 / (1.0 + ax * bx + ay * by);
            let at = |c: i64, a: f64, b: f64| (c as f64 + scale * (a + b)).round() as i64;
            (at(here.0, ax, bx), at(here.1, ay, by))
        };
        (0..n).map(corner).collect()
    }

    /// True if no two sides of the outline grown by a margin (nm) meet but at their common corner.
    pub fn grows(&self, margin_nm: i64) -> bool {
        is_simple(&self.grown(margin_nm))
    }

    /// Diameter of the circle about the middle that holds it (nm).
    fn diameter_nm(&self) -> u32 {
        let far = |&(x, y): &(i64, i64)| (x as f64).hypot(y as f64);
        let farthest = self.corners_nm.iter().map(far).fold(0.0, f64::max);
        (2.0 * farthest).ceil() as u32
    }

    fn check(&self, s: &Section<'_, '_>, key: &str) {
        if !is_simple(&self.corners_nm) {
            s.fault(
                key,
                "the outline crosses or touches itself",
                "list its corners as one goes around it, each once",
            );
            return;
        }
        let n = self.corners_nm.len();
        let sharpest = (0..n).map(|k| {
            let [before, here, after] = [k + n - 1, k, k + 1].map(|j| self.corners_nm[j % n]);
            let ([ax, ay], [bx, by]) = (outwards(before, here), outwards(here, after));
            180.0 - (ax * bx + ay * by).clamp(-1.0, 1.0).acos().to_degrees()
        });
        let sharpest = sharpest.fold(180.0, f64::min);
        if sharpest < SHARPEST_DEG {
            s.fault(
                key,
                format!("a corner of {sharpest:.1} degrees"),
                format!("use corners of {SHARPEST_DEG} degrees or more"),
            );
        }
        if !self.holds(0, 0) {
            s.fault(
                key,
                "the middle of the element is outside the outline",
                "count corners from the middle of the element",
            );
        }
    }
}

/// The sides of an outline that each row of a lattice reaches: its sites are held against these alone.
#[derive(Clone, Debug)]
pub(crate) struct OutlineRows(Vec<Vec<Side>>);

impl OutlineRows {
    /// Variant of [`LensOutline::holds`] for a place in row `iy`.
    pub(crate) fn holds(&self, iy: usize, x: i64, y: i64) -> bool {
        is_inside(self.0[iy].iter().copied(), x, y)
    }
}

/// Side of an outline, from corner to corner (nm).
type Side = ((i64, i64), (i64, i64));

/// Sides of a closed polygon.
fn sides(corners: &[(i64, i64)]) -> impl Iterator<Item = Side> {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

/// True if a place is inside a polygon or on its rim, by all its sides or the sides that its row reaches.
fn is_inside(sides: impl Iterator<Item = Side>, x: i64, y: i64) -> bool {
    let mut inside = false;
    for ((ax, ay), (bx, by)) in sides {
        // Twice the area of side and place: its sign says on which side of the line the place is.
        let across = (bx - ax) * (y - ay) - (by - ay) * (x - ax);
        let within = |a: i64, b: i64, p: i64| (a.min(b)..=a.max(b)).contains(&p);
        if across == 0 && within(ax, bx, x) && within(ay, by, y) {
            return true;
        }
        if (ay > y) != (by > y) && (across > 0) == (by > ay) {
            inside = !inside;
        }
    }
    inside
}

/// Twice the area, positive if counter-clockwise.
fn twice_area(corners: &[(i64, i64)]) -> i64 {
    sides(corners).map(|((ax, ay), (bx, by))| ax * by - bx * ay).sum()
}

/// Normal of a side of a counter-clockwise polygon, of length one.
fn outwards((ax, ay): (i64, i64), (bx, by): (i64, i64)) -> [f64; 2] {
    let (x, y) = ((bx - ax) as f64, (by - ay) as f64);
    let length = x.hypot(y).max(1.0);
    [y / length, -x / length]
}

/// True if a polygon goes around once, counter-clockwise, and no two of its sides meet but at their common corner.
fn is_simple(corners: &[(i64, i64)]) -> bool {
    let all: Vec<_> = sides(corners).collect();
    let n = all.len();
    let turn = |(ax, ay): (i64, i64), (bx, by): (i64, i64), (cx, cy): (i64, i64)| {
        ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)).signum()
    };
    let on = |(a, b): Side, p: (i64, i64)| {
        turn(a, b, p) == 0
            && (a.0.min(b.0)..=a.0.max(b.0)).contains(&p.0)
            && (a.1.min(b.1)..=a.1.max(b.1)).contains(&p.1)
    };
    let meet = |(a, b): Side, (c, d): Side| {
        (turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0)
            || on((a, b), c)
            || on((a, b), d)
            || on((c, d), a)
            || on((c, d), b)
    };
    let apart = (0..n).all(|i| {
        (i + 1..n).all(|j| {
            if j == i + 1 || (i == 0 && j == n - 1) {
                // Neighbours have one corner in common; the other ends must be off the other side.
                let (first, second) = if j == i + 1 { (all[i], all[j]) } else { (all[j], all[i]) };
                first.0 != first.1 && second.0 != second.1 && !on(first, second.1) && !on(second, first.0)
            } else {
                !meet(all[i], all[j])
            }
        })
    });
    apart && twice_area(corners) > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(corners_um: &[[f64; 2]]) -> LensOutline {
        LensOutline::rounded(corners_um.iter().copied())
    }

    /// An L: two rectangles that share an edge.
    const L: [[f64; 2]; 6] = [
        [-10.0, -10.0],
        [-10.0, 20.0],
        [5.0, 20.0],
        [5.0, 5.0],
        [20.0, 5.0],
        [20.0, -10.0],
    ];

    #[test]
    fn places_are_inside_an_outline_or_on_its_rim() {
        let l = outline(&L);
        assert!(l.corners_nm()[0] == (20_000, -10_000), "it was clockwise");
        for x in -22..=22 {
            for y in -22..=22 {
                let (x, y) = (1000 * x, 1000 * y);
                let within = |a: i64, b: i64, c: i64, d: i64| (a..=b).contains(&x) && (c..=d).contains(&y);
                let wanted = within(-10_000, 5_000, -10_000, 20_000) || within(-10_000, 20_000, -10_000, 5_000);
                assert_eq!(l.holds(x, y), wanted, "({x}, {y})");
                let (rx, ry) = (-y, x);
                assert_eq!(l.rotated(90.0).holds(rx, ry), wanted);
            }
        }
    }

    #[test]
    fn rows_hold_the_places_that_the_outline_holds() {
        let lattice = Lattice::new(350, 120).unwrap();
        let l = outline(&L).rotated(33.0);
        let rows = l.rows(&lattice);
        for (iy, ix) in (0..120 * 120).map(|k| (k / 120, k % 120)) {
            let [x, y] = [ix, iy].map(|i| lattice.whole_nm(0, i));
            assert_eq!(rows.holds(iy, x, y), l.holds(x, y), "({x}, {y})");
        }
    }

    #[test]
    fn a_grown_outline_is_the_margin_away_from_each_side() {
        let grown = outline(&L).grown(2_000);
        assert!(
            grown.contains(&(22_000, -12_000)) && grown.contains(&(7_000, 7_000)) && grown.contains(&(-12_000, 22_000))
        );
        assert!(outline(&L).grows(2_000));
        // A notch that is narrower than two margins closes.
        let notch = [
            [-20.0, -10.0],
            [20.0, -10.0],
            [20.0, 10.0],
            [1.0, 10.0],
            [1.0, 2.0],
            [-1.0, 2.0],
            [-1.0, 10.0],
            [-20.0, 10.0],
        ];
        assert!(outline(&notch).grows(900) && !outline(&notch).grows(1_100));
    }

    #[test]
    fn an_outline_that_meets_itself_is_told() {
        for corners in [
            &[[0.0, 0.0], [10.0, 10.0], [10.0, 0.0], [0.0, 10.0]][..],
            &[[0.0, 0.0], [10.0, 0.0], [10.0, 0.0], [0.0, 10.0]],
            &[[0.0, 0.0], [10.0, 0.0], [5.0, 0.0], [0.0, 10.0]],
            &[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [5.0, 0.0], [0.0, 10.0]],
        ] {
            assert!(!is_simple(&outline(corners).corners_nm), "{corners:?}");
        }
        assert!(is_simple(&outline(&L).corners_nm));
    }
}
