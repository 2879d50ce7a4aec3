//! Phases of elements.

use super::*;

#[test]
fn a_lens_of_one_millimetre_has_the_sites_of_the_truth_data() {
    let lattice = Lattice::covering(1_000_000, 350).unwrap();
    let radial = RadialPhase::Hyperbola {
        wavelength_um: 0.55,
        focal_length_um: 2400.0,
    };
    let lens = LensPhase::new(lattice, 1_000_000, &radial);
    let n = lattice.sites();
    let inside = (0..n)
        .flat_map(|iy| (0..n).map(move |ix| (ix, iy)))
        .filter(|&(x, y)| lens.turns(x, y).is_some());
    assert_eq!((n, inside.count()), (2858, 6_411_448));
}

/// Large lenses, whose radii are not tabulated, have the phases of small ones.
#[test]
fn a_computed_phase_is_the_tabulated_one() {
    let radial = RadialPhase::Hyperbola {
        wavelength_um: 0.55,
        focal_length_um: 30.0,
    };
    for diameter_nm in [20_000, 20_400] {
        let lattice = Lattice::covering(diameter_nm, 350).unwrap();
        let table = LensPhase::new(lattice, diameter_nm, &radial);
        let computed = LensPhase::with_entries(lattice, diameter_nm, &radial, 0);
        assert!(matches!(computed.turns, PhaseOfRadius::Computed(_)));
        let n = lattice.sites();
        for (ix, iy) in (0..n * n).map(|k| (k % n, k / n)) {
            assert_eq!(table.turns(ix, iy), computed.turns(ix, iy));
            assert_eq!(table.holds(ix, iy), table.turns(ix, iy).is_some());
        }
    }
}

/// Columns in closed form are the sites that are asked one by one, of lenses without a site too.
#[test]
fn columns_of_a_row_are_its_sites_inside() {
    for diameter_nm in [300, 360, 700, 1_000, 20_000, 20_400] {
        let lattice = Lattice::covering(diameter_nm, 350).unwrap();
        let lens = LensPhase::new(lattice, diameter_nm, &RadialPhase::Flat);
        let n = lattice.sites();
        for iy in 0..n {
            let inside: Vec<usize> = (0..n).filter(|&ix| lens.holds(ix, iy)).collect();
            assert_eq!(
                lens.columns(iy).unwrap().collect::<Vec<_>>(),
                inside,
                "{diameter_nm} nm, row {iy}"
            );
        }
    }
}

#[test]
fn mirrored_elements_have_mirrored_phases_to_the_last_bit() {
    let lattice = Lattice::covering(20_000, 350).unwrap();
    let radial = RadialPhase::Hyperbola {
        wavelength_um: 0.55,
        focal_length_um: 30.0,
    };
    let lens = LensPhase::new(lattice, 20_000, &radial);
    let n = lattice.sites();
    let wedge = |sin_x, sin_y| Wedge {
        wavelength_um: 0.55,
        sin_x,
        sin_y,
    };
    let (s, t) = (0.25881904510252074, 0.49999999999999994);
    let (a, b, c) = (wedge(s, t), wedge(-s, t), wedge(t, s));
    let (a, b, c) = (
        ElementPhase::new(&lens, &a),
        ElementPhase::new(&lens, &b),
        ElementPhase::new(&lens, &c),
    );
    for iy in 0..n {
        for ix in 0..n {
            assert_eq!(a.turns(ix, iy), b.turns(n - 1 - ix, iy));
            assert_eq!(a.turns(ix, iy), c.turns(iy, ix));
        }
    }
}

#[test]
fn odd_lattices_have_a_site_in_the_centre() {
    let lattice = Lattice::new(350, 5).unwrap();
    let radial = RadialPhase::EvenPowers {
        coefficients_rad: vec![1.0],
        normalisation_um: 1.0,
    };
    let lens = LensPhase::new(lattice, 1_500, &radial);
    assert_eq!(lens.turns(2, 2), Some(0.0));
    assert!(lens.turns(3, 2).is_some());
    assert_eq!(lens.turns(0, 0), None);
}

/// Of a hologram the map alone is known up to whole turns; both parts together are the phase.
#[test]
fn parts_of_a_phase_are_told_by_whether_they_jump() {
    // Of turns below a hundred.
    const ROUNDING: f64 = 1e-12;
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs/hologram.toml");
    let design = Design::read(std::path::Path::new(path)).unwrap();
    let lens = LensPhase::of(&design);
    let [plain, hologram] = [0, 1].map(|k| ElementPhase::of(&lens, &design.elements()[k]));
    let mut jumps = false;
    for (ix, iy) in (0..172 * 172).map(|k| (k % 172, k / 172)) {
        let Some([smooth, mapped]) = hologram.parts(ix, iy) else {
            assert_eq!(hologram.turns(ix, iy), None);
            continue;
        };
        assert!((smooth + mapped - hologram.turns(ix, iy).unwrap()).abs() < ROUNDING);
        assert_eq!(plain.parts(ix, iy), Some([smooth, 0.0]));
        let right = hologram.parts(ix + 1, iy).map_or(mapped, |[_, right]| right);
        jumps |= (right - mapped).abs() > 0.5;
    }
    assert!(jumps);
}
