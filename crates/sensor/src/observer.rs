//! The CIE 1931 standard observer, by a published fit.

/// Colour matching functions x, y, z at a wavelength (nm): sums of lobes, each a Gaussian with one width below and one
/// above its peak, by Wyman, Sloan and Shirley, Journal of Computer Graphics Techniques 2 (2), 1 (2013), table 1. The
/// fit errs by up to 0.01 of functions whose area is 107 nm.
pub fn observer(nm: f64) -> [f64; 3] {
    let lobe = |a: f64, centre: f64, below: f64, above: f64| {
        let sigma = if nm < centre { below } else { above };
        a * (-0.5 * ((nm - centre) / sigma).powi(2)).exp()
    };
    [
        lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) - lobe(0.065, 501.1, 20.4, 26.2),
        lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
        lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8),
    ]
}
