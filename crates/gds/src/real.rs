//! The format's real numbers: sign, exponent of 16 in excess 64, 56 bits of fraction.

/// Value of an 8-byte real. Every bit pattern has one, at most 7.3e75.
pub(super) fn decode(bytes: [u8; 8]) -> f64 {
    let bits = u64::from_be_bytes(bytes);
    let fraction = (bits & ((1 << 56) - 1)) as f64 / (1u64 << 56) as f64;
    let exponent = i32::from((bits >> 56) as u8 & 0x7F) - 64;
    let value = fraction * 16f64.powi(exponent);
    if bits >> 63 == 1 { -value } else { value }
}

#[cfg(test)]
mod tests {
    use super::decode;

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
