//! The format's real numbers: sign, exponent of 16 in excess 64, 56 bits of fraction.

/// Value of an 8-byte real. Every bit pattern has one, at most 7.3e75.
pub(super) fn decode(bytes: [u8; 8]) -> f64 {
    let bits = u64::from_be_bytes(bytes);
    let fraction = (bits & ((1 << 56) - 1)) as f64 / (1u64 << 56) as f64;
    let exponent = i32::from((bits >> 56) as u8 & 0x7F) - 64;
    let value = fraction * 16f64.powi(exponent);
    if bits >> 63 == 1 { -value } else { value }
}

/// The 8-byte real of a value: exact from 1e-78 to 7e75, which hold every length and angle of a layout.
pub(super) fn encode(value: f64) -> [u8; 8] {
    if value == 0.0 || !value.is_finite() {
        return [0; 8];
    }
    let (mut fraction, mut exponent) = (value.abs(), 64i32);
    while fraction >= 1.0 && exponent < 127 {
        fraction /= 16.0;
        exponent += 1;
    }
    while fraction < 1.0 / 16.0 && exponent > 0 {
        fraction *= 16.0;
        exponent -= 1;
    }
    // A double has 53 bits: all of them stand in the 56 of the fraction.
    let bits = (fraction * (1u64 << 56) as f64) as u64 & ((1 << 56) - 1);
    let sign = u64::from(value < 0.0) << 63;
    (sign | (exponent as u64) << 56 | bits).to_be_bytes()
}

#[cfg(test)]
mod tests {
    use super::{decode, encode};

    #[test]
    fn reals_come_back() {
        for value in [0.0, 1.0, -1.0, 90.0, 359.999, 1e-6, 0.0625, 16.0, 1e6, 1.0 / 3.0, -2e-9] {
            assert_eq!(decode(encode(value)), value);
        }
        assert_eq!(u64::from_be_bytes(encode(90.0)), 0x425A_0000_0000_0000);
    }

    /// Relative: the patterns are cut to 56 bits, and doubles hold 53.
    const ROUNDING: f64 = 1e-15;

    /// Patterns worked out by hand from the format: 1 = 1/16 x 16^1, 1e-3 and 1e-9 as every writer has them.
    #[test]
    fn known_patterns() {
        let value = |bits: u64| decode(bits.to_be_bytes());
        assert_eq!(value(0), 0.0);
        assert_eq!(value(0x4110_0000_0000_0000), 1.0);
        assert_eq!(value(0xC110_0000_0000_0000), -1.0);
        assert_eq!(value(0x425A_0000_0000_0000), 90.0);
        assert!((value(0x3E41_8937_4BC6_A7F0) - 1e-3).abs() < ROUNDING * 1e-3);
        assert!((value(0x3944_B82F_A09B_5A54) - 1e-9).abs() < ROUNDING * 1e-9);
    }
}
