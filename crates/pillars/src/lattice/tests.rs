use super::*;

#[test]
fn a_hexagonal_lattice_has_six_neighbours() {
    // Rows are rounded to whole nanometres.
    const ROUNDED_NM: f64 = 0.44;
    for pitch in [350, 480, 650, 1000] {
        let lattice = Lattice::of_kind_covering(LatticeKind::Hexagonal, 10_000, pitch).unwrap();
        let n = lattice.sites();
        let middle = n / 2;
        assert!(lattice.has(middle, middle) && lattice.radius2_nm2(middle, middle) == 0.0);
        assert!(lattice.place_nm(0, n - 1) * 2.0 >= 10_000.0 - f64::from(pitch));
        let distances: Vec<f64> = (0..n * n)
            .map(|k| (k % n, k / n))
            .filter(|&(ix, iy)| lattice.has(ix, iy) && (ix, iy) != (middle, middle))
            .map(|(ix, iy)| lattice.radius2_nm2(ix, iy).sqrt())
            .filter(|r| *r < 1.4 * f64::from(pitch))
            .collect();
        assert_eq!(distances.len(), 6);
        assert!(
            distances.iter().all(|r| (r - f64::from(pitch)).abs() < ROUNDED_NM),
            "{distances:?}"
        );
        for [dx, dy] in lattice.neighbours() {
            let [ix, iy] = [dx, dy].map(|d| (middle as i64 + d) as usize);
            assert!(lattice.has(ix, iy));
            let r = lattice.radius2_nm2(ix, iy).sqrt();
            assert!((r - f64::from(pitch)).abs() < ROUNDED_NM);
        }
        // As many sites as there are cells in the square.
        let [columns, rows] = lattice.reach();
        assert_eq!(columns, 0..n);
        let sites = rows
            .clone()
            .flat_map(|iy| (0..n).map(move |ix| (ix, iy)))
            .filter(|&(x, y)| lattice.has(x, y));
        let [x, y] = lattice.steps_nm();
        let area = 1e-6 * x * n as f64 * y * rows.len() as f64;
        let share = sites.count() as f64 * lattice.cell_um2() / area;
        assert!((share - 1.0).abs() < 1.0 / n as f64, "{share}");
    }
    assert!(Lattice::of_kind(LatticeKind::Hexagonal, 350, 4).is_err());
    assert!(Lattice::of_kind_covering(LatticeKind::Hexagonal, 0, 350).is_err());
}

#[test]
fn the_nearest_site_is_that_of_all() {
    // Places that are as far from two sites as rounding tells.
    const TIE_UM: f64 = 1e-9;
    for lattice in [
        Lattice::new(350, 6).unwrap(),
        Lattice::of_kind(LatticeKind::Square, 350, 7).unwrap(),
        Lattice::of_kind(LatticeKind::Hexagonal, 700, 9).unwrap(),
    ] {
        let n = lattice.sites();
        let away =
            |[ix, iy]: [usize; 2], [x, y]: [f64; 2]| (lattice.place_um(0, ix) - x).hypot(lattice.place_um(1, iy) - y);
        for k in 0..400 {
            // Within the outermost sites.
            let [x, y] = [(k * 37) % 401, (k * 113) % 401].map(|i| (f64::from(i) / 200.0 - 1.0) * 0.8);
            let at = [x, y];
            let all = (0..n * n)
                .map(|i| [i % n, i / n])
                .filter(|[ix, iy]| lattice.has(*ix, *iy));
            let least = all.map(|site| away(site, at)).fold(f64::INFINITY, f64::min);
            let found = lattice.site_at(at).unwrap();
            assert!(lattice.has(found[0], found[1]));
            assert!(away(found, at) < least + TIE_UM, "{lattice:?} {at:?}: {found:?}");
        }
        assert_eq!(lattice.site_at([0.0, 50.0]), None);
        assert_eq!(lattice.site_at([-50.0, 0.0]), None);
    }
}

#[test]
fn columns_and_rows_within_two_ends() {
    let lattice = Lattice::new(350, 6).unwrap();
    // Places at 175, 525 and 875 nm to either side.
    assert_eq!(lattice.within([[-525, 525], [-174, 2000]]), [1..5, 3..6]);
    assert_eq!(lattice.within([[-100, 100], [900, 1000]]), [3..3, 6..6]);
    assert_eq!(lattice.sides_nm(), [2100, 2100]);
    let hexagonal = Lattice::of_kind_covering(LatticeKind::Hexagonal, 10_000, 1000).unwrap();
    // Columns are 500 nm apart, rows 866 nm, five of them to either side.
    assert_eq!(hexagonal.within([[-500, 1499], [-866, 1000]]), [9..13, 9..12]);
    assert_eq!(hexagonal.sides_nm(), [11_000, 9660]);
}

#[test]
fn places_of_a_square_lattice_are_alike_along_both_axes() {
    for sites in [4, 5] {
        let lattice = Lattice::new(350, sites).unwrap();
        for i in 0..sites {
            assert_eq!(lattice.place_nm(0, i), lattice.place_nm(1, i));
            assert_eq!(lattice.place_units(0, i) as f64, lattice.place_nm(0, i));
        }
        assert_eq!(lattice.reach(), [0..sites, 0..sites]);
        let r2 = lattice.half_radius2(1, 2) * 350 * 350;
        assert_eq!(4.0 * lattice.radius2_nm2(1, 2), r2 as f64);
    }
}

/// Pitches of published lenses: exact on a grid that divides them, else off by half a unit at most; mirror images always.
#[test]
fn places_are_the_nearest_of_the_grid_and_mirror_images() {
    use DatabaseUnit::{Half, Nanometre, Tenth};
    for (kind, pitch, unit, sites, rounding) in [
        (LatticeKind::Square, 350.0, Nanometre, 30, 0.0),
        (LatticeKind::Square, 325.0, Nanometre, 31, 0.0),
        (LatticeKind::Square, 351.0, Half, 30, 0.0),
        (LatticeKind::Square, 433.3, Tenth, 25, 0.0),
        (LatticeKind::Square, 433.3, Nanometre, 24, 0.45),
        (LatticeKind::Hexagonal, 325.0, Nanometre, 63, 0.5),
        (LatticeKind::Hexagonal, 325.0, Half, 63, 0.0),
    ] {
        let pitch = Pitch::of_nm(pitch).unwrap();
        let lattice = Lattice::covering_on_grid(kind, 10_001, pitch, unit).unwrap();
        assert_eq!(lattice.sites(), sites, "{pitch}");
        assert!(
            (lattice.rounding_nm() - rounding).abs() < 1e-9,
            "{pitch}: {}",
            lattice.rounding_nm()
        );
        for (axis, i) in (0..2).flat_map(|axis| (0..sites).map(move |i| (axis, i))) {
            assert_eq!(lattice.place_units(axis, i), -lattice.place_units(axis, sites - 1 - i));
            let off = lattice.drawn_nm(axis, i) - lattice.place_nm(axis, i);
            assert!(off.abs() <= lattice.rounding_nm() + 1e-9);
        }
        let (ix, iy) = (sites - 1, sites / 3);
        let um = lattice.unit_um() * (lattice.units2(ix, iy) as f64).sqrt();
        assert!((um - lattice.radius2_nm2(ix, iy).sqrt() * 1e-3).abs() < 1e-9, "{pitch}");
    }
    let odd = Pitch::of_nm(433.3).unwrap();
    assert!(Lattice::covering_on_grid(LatticeKind::Hexagonal, 10_000, odd, Nanometre).is_err());
}

/// Rows that are not rounded: places, distances and what covers a disc agree, and each place in a file is the nearest.
#[test]
fn rows_of_places_that_are_rounded_one_by_one() {
    let pitch = Pitch::of_nm(433.3).unwrap();
    let lattice = Lattice::hexagonal_by_place(pitch, DatabaseUnit::Nanometre, 41).unwrap();
    assert!(lattice.has_exact_rows());
    let row_nm = 433.3 * 0.75f64.sqrt();
    assert!((lattice.row_nm() - row_nm).abs() < 1e-9);
    for i in 0..41 {
        let exact_nm = (i as f64 - 20.0) * row_nm;
        assert!((lattice.place_nm(1, i) - exact_nm).abs() <= 1.0 / 80.0, "{i}");
        assert!((lattice.drawn_nm(1, i) - exact_nm).abs() <= 0.5 + 1.0 / 80.0, "{i}");
        let radius2 = lattice.units2(i, 20 - i % 2) as f64 * lattice.unit_nm().powi(2);
        assert!((radius2 - lattice.radius2_nm2(i, 20 - i % 2)).abs() < 1e-6, "{i}");
        assert_eq!(lattice.units2(i, 3), lattice.units2(40 - i, 37), "{i}");
    }
    let covering = lattice.covering_disc(10_000).unwrap();
    assert!(covering.has_exact_rows() && covering.most_units2(10_000) > covering.units2(0, covering.sites() / 2) / 4);
    assert!(Lattice::on_grid(LatticeKind::Hexagonal, pitch, DatabaseUnit::Nanometre, 41).is_err());
}
