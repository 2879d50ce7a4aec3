//! What the adjoint of a propagator has to be.

use metalith_wave::{Aperture, PlaneWave, Propagator, Scratch};
use ndarray::Array2;
use num_complex::{Complex32, Complex64};

fn dot(a: &Array2<Complex32>, b: &Array2<Complex32>) -> Complex64 {
    let double = |z: Complex32| Complex64::new(z.re.into(), z.im.into());
    a.iter().zip(b).map(|(a, b)| double(*a).conj() * double(*b)).sum()
}

/// The adjoint of a propagator to 12 x 12 samples, of some values there: held to the field of an aperture. Scratch that has been used
/// gives the same bits as fresh one.
pub(crate) fn checked(propagator: &dyn Propagator, lens: &dyn Aperture, wave: &PlaneWave) -> Array2<Complex32> {
    // Sums over 1e4 products in single precision.
    const ROUNDING: f64 = 1e-5;
    let given = Array2::from_shape_fn((12, 12), |(iy, ix)| {
        Complex32::cis((ix * ix) as f32 * 0.37 - (iy * iy) as f32 * 0.61) * (1.0 + ix as f32 * 0.1)
    });
    let n = lens.lattice().sites();
    let mut sites = Array2::zeros((n, n));
    for (iy, mut row) in sites.rows_mut().into_iter().enumerate() {
        lens.fill_row(iy, row.as_slice_mut().unwrap());
    }
    let scratch = &mut Scratch::default();
    let field = propagator.field(lens, wave, scratch).unwrap().values;
    // A scratch that no field has made room in: a period may have more places along x than along y.
    let back = propagator.adjoint(&given, wave, &mut Scratch::default()).unwrap();
    assert_eq!(back, propagator.adjoint(&given, wave, scratch).unwrap());
    assert_eq!(field, propagator.field(lens, wave, scratch).unwrap().values);
    let (left, right) = (dot(&given, &field), dot(&back, &sites));
    let norm = |a: &Array2<Complex32>| dot(a, a).re.sqrt();
    assert!(
        (left - right).norm() < ROUNDING * norm(&given) * norm(&field),
        "{left} is not {right}"
    );
    back
}
