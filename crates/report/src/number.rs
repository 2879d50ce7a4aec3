//! Formatting of numbers for readers: fixed rules, the same on every machine.

pub use metalith_core::text::count;
pub use metalith_core::text::counted;
use metalith_core::text::grouped;

/// `x` to a given number of significant digits: `0.01234`, `12.3`, `5.77×10⁷`, `1.2×10⁻⁷`. From 0.0001 to below ten million it
/// is written without a power of ten, and all digits before its point are given, even if there are more: `6,411,448`.
pub fn sig(x: f64, digits: usize) -> String {
    let digits = digits.max(1);
    if !x.is_finite() {
        return not_finite(x);
    }
    if x == 0.0 {
        return "0".into();
    }
    // The exponent after rounding: 9.996 to three digits is 10.0.
    let written = format!("{:.*e}", digits - 1, x);
    let (mantissa, exponent) = written.split_once('e').expect("an exponent");
    let exponent: i32 = exponent.parse().expect("a whole exponent");
    if (-4..7).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        fixed(x, decimals)
    } else {
        format!("{}×10{}", mantissa.replace('-', "−"), superscript(exponent))
    }
}

/// `x` as it was given: up to nine significant digits, no zeros behind the last that counts. For values
/// that a person chose, such as `550` or `0.05`.
pub fn exact(x: f64) -> String {
    let text = sig(x, 9);
    match text.split_once('×') {
        Some((mantissa, power)) if mantissa.contains('.') => {
            format!("{}×{power}", mantissa.trim_end_matches('0').trim_end_matches('.'))
        }
        None if text.contains('.') => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        _ => text,
    }
}

/// `x` to a given number of decimals, thousands grouped, a true minus sign and no minus zero.
pub fn fixed(x: f64, decimals: usize) -> String {
    if !x.is_finite() {
        return not_finite(x);
    }
    let written = format!("{:.*}", decimals, x.abs());
    let (whole, fraction) = written.split_once('.').unwrap_or((&written, ""));
    let negative = x < 0.0 && written.bytes().any(|b| b.is_ascii_digit() && b != b'0');
    let mut text = String::new();
    if negative {
        text.push('−');
    }
    text.push_str(&grouped(whole));
    if !fraction.is_empty() {
        text.push('.');
        text.push_str(fraction);
    }
    text
}

/// `10⁻³` and the like.
pub(crate) fn power_of_ten(exponent: i32) -> String {
    format!("10{}", superscript(exponent))
}

fn not_finite(x: f64) -> String {
    match x {
        x if x.is_nan() => "n/a",
        x if x > 0.0 => "∞",
        _ => "−∞",
    }
    .into()
}

fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            c => char::from_u32('⁰' as u32 + c as u32 - '0' as u32).expect("a digit"),
        })
        .collect()
}

/// Shortest exact text of a coordinate in a drawing, to a hundredth.
pub(crate) fn short(x: f64) -> String {
    let mut text = format!("{x:.2}");
    while text.ends_with('0') {
        text.pop();
    }
    if text.ends_with('.') {
        text.pop();
    }
    if text == "-0" {
        text.remove(0);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_people_write_them() {
        for (x, digits, text) in [
            (0.012_34, 3, "0.0123"),
            (9.996, 3, "10.0"),
            (57_702_924.0, 8, "5.7702924×10⁷"),
            (6_411_448.0, 3, "6,411,448"),
            (-1.234e-7, 2, "−1.2×10⁻⁷"),
            (0.0, 4, "0"),
            (f64::NAN, 4, "n/a"),
        ] {
            assert_eq!(sig(x, digits), text);
        }
        for (x, text) in [
            (550.0, "550"),
            (0.05, "0.05"),
            (-1e-9, "−1×10⁻⁹"),
            (1_200_000.0, "1,200,000"),
            (0.0, "0"),
        ] {
            assert_eq!(exact(x), text);
        }
        assert_eq!(fixed(-0.001, 2), "0.00");
        assert_eq!(fixed(-1234.5, 1), "−1,234.5");
        assert_eq!(count(57_702_924), "57,702,924");
        assert_eq!(
            [0, 1, 1_200].map(|n| counted(n, "term")),
            ["0 terms", "1 term", "1,200 terms"]
        );
        assert_eq!(short(-0.001), "0");
        assert_eq!(short(120.50), "120.5");
    }
}
