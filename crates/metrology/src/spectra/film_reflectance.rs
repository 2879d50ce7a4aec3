//! Reflectance and transmission of uniform films by admittances, at any angle in both polarisations.

use num_complex::Complex64;

/// A film: complex index and thickness (nm).
pub(super) type Film = (Complex64, f64);

/// Reflectance of unpolarised light from `ambient` (a real index) at a squared sine of the angle in vacuum, and its transmission
/// into the substrate.
pub(super) fn film_powers(
    ambient: f64,
    films: &[Film],
    substrate: Complex64,
    wavelength_nm: f64,
    sine2: f64,
) -> [f64; 2] {
    let normal = |n: Complex64| (n * n - sine2).sqrt();
    let mut out = [0.0; 2];
    for is_p in [false, true] {
        // Tilted admittances: of s, the normal component of n; of p, n^2 over it.
        let tilted = |n: Complex64| if is_p { n * n / normal(n) } else { normal(n) };
        let mut y = tilted(substrate);
        // Share of the power at the top of the films that reaches the substrate.
        let mut passed = 1.0;
        for &(n, thickness_nm) in films.iter().rev() {
            let (own, phase) = (
                tilted(n),
                normal(n) * (std::f64::consts::TAU * thickness_nm / wavelength_nm),
            );
            // One pass through a film, in a form that does not overflow in thick absorbing ones.
            let pass = (Complex64::i() * phase * 2.0).exp();
            let r = (own - y) / (own + y) * pass;
            let below = y;
            y = own * (Complex64::from(1.0) - r) / (Complex64::from(1.0) + r);
            let ratio = phase.cos() - Complex64::i() * phase.sin() * below / own;
            passed *= below.re / (y.re * ratio.norm_sqr());
        }
        let own = tilted(Complex64::from(ambient));
        let reflected = ((own - y) / (own + y)).norm_sqr();
        out[0] += 0.5 * reflected;
        // A film through which nothing comes overflows.
        let passed = if passed.is_finite() { passed.max(0.0) } else { 0.0 };
        out[1] += 0.5 * (1.0 - reflected) * passed;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_rcwa::{CellLattice, Incidence, Layer, LayerStack, Orders, Side, solve};

    /// A quarter wave of index sqrt(n) on n reflects nothing; a half wave changes nothing.
    #[test]
    fn quarter_and_half_waves_have_their_closed_forms() {
        let glass = Complex64::from(2.25);
        let quarter = (Complex64::from(1.5), 600.0 / (4.0 * 1.5));
        let [r, t] = film_powers(1.0, &[quarter], glass, 600.0, 0.0);
        assert!(r < 1e-15 && (t - 1.0).abs() < 1e-12, "{r} {t}");
        let half = (Complex64::from(1.9), 600.0 / (2.0 * 1.9));
        let bare = (1.25_f64 / 3.25).powi(2);
        assert!((film_powers(1.0, &[half], glass, 600.0, 0.0)[0] - bare).abs() < 1e-12);
    }

    #[test]
    fn films_reflect_what_the_layered_solver_says() {
        let diamond = Complex64::new(2.28, 0.02);
        let films = [(diamond, 290.0), (Complex64::from(1.0), 80.0)];
        let glass = Complex64::from(1.53);
        for (wavelength_nm, sine) in [(450.0, 0.0), (620.0, 0.5), (800.0, 0.88)] {
            let stack = LayerStack {
                pitch_nm: 100.0,
                lattice: CellLattice::Square,
                below: glass,
                layers: vec![Layer::uniform(80.0, films[1].0), Layer::uniform(290.0, diamond)],
                above: Complex64::from(1.0),
            };
            let light = Incidence::of_sines(wavelength_nm * 1e-3, Side::Above, [sine, 0.0]);
            let found = solve(&stack, &light, Orders::new(1).unwrap()).unwrap();
            let order = found.orders.iter().find(|o| o.order == [0, 0]).unwrap();
            let own = film_powers(1.0, &films, glass, wavelength_nm, sine * sine);
            for (own, [s, p]) in own.into_iter().zip([order.reflected, order.transmitted]) {
                assert!((own - 0.5 * (p + s)).abs() < 1e-9, "{wavelength_nm}: {own} {p} {s}");
            }
        }
    }
}
