//! CIE standard illuminant D65.

/// Relative spectral power from 300 nm to 830 nm at 10 nm, 100 at 560 nm (CIE 015:2018, table 6; ISO 11664-2). The CIE
/// tables at 5 and at 1 nm are straight lines between these.
const POWER: [f64; 54] = [
    0.0341, 3.2945, 20.2360, 37.0535, 39.9488, 44.9117, 46.6383, 52.0891, 49.9755, 54.6482, 82.7549, 91.4860, 93.4318,
    86.6823, 104.865, 117.008, 117.812, 114.861, 115.923, 108.811, 109.354, 107.802, 104.790, 107.689, 104.405,
    104.046, 100.000, 96.3342, 95.7880, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268, 80.2146,
    82.2778, 78.2842, 69.7213, 71.6091, 74.3490, 61.6040, 69.8856, 75.0870, 63.5927, 46.4182, 66.8054, 63.3828,
    64.3040, 59.4519, 51.9590, 57.4406, 60.3125,
];

const FIRST_NM: f64 = 300.0;
const STEP_NM: f64 = 10.0;

/// Relative spectral power at a wavelength (nm); nothing beyond the table.
pub(super) fn power(nm: f64) -> f64 {
    let place = (nm - FIRST_NM) / STEP_NM;
    let last = (POWER.len() - 1) as f64;
    if !(0.0..=last).contains(&place) {
        return 0.0;
    }
    let low = (place as usize).min(POWER.len() - 2);
    let share = place - low as f64;
    POWER[low] * (1.0 - share) + POWER[low + 1] * share
}

#[cfg(test)]
mod tests {
    use super::power;

    /// Values of the table at 5 nm, between those that are held.
    #[test]
    fn it_is_the_table_at_5_nm() {
        // The last digit printed.
        const PRINTED: f64 = 6e-4;
        for (nm, want) in [
            (305.0, 1.6643),
            (395.0, 68.7015),
            (445.0, 110.936),
            (505.0, 108.578),
            (565.0, 98.1671),
            (635.0, 83.4939),
            (715.0, 67.9765),
            (765.0, 56.6118),
            (825.0, 58.8765),
            (560.0, 100.0),
            (830.0, 60.3125),
            (299.0, 0.0),
            (831.0, 0.0),
        ] {
            assert!((power(nm) - want).abs() < PRINTED, "{nm}: {}", power(nm));
        }
    }
}
