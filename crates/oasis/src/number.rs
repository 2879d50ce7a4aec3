//! Numbers as bytes: integers of seven bits a byte, lowest first; reals; steps in a plane.

/// Append an unsigned integer in its one shortest form.
#[inline]
pub(crate) fn put_unsigned(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Append a signed integer: magnitude above, sign in the lowest bit.
///
/// Magnitudes up to 2^62; coordinates are limited far below.
#[inline]
pub(crate) fn put_signed(out: &mut Vec<u8>, value: i64) {
    put_unsigned(out, value.unsigned_abs() << 1 | u64::from(value < 0));
}

/// Append a step in the plane ("g-delta"): one integer along the eight directions, two otherwise.
#[inline]
pub(crate) fn put_step(out: &mut Vec<u8>, x: i64, y: i64) {
    if x == 0 || y == 0 || x.abs() == y.abs() {
        let direction = match (x.signum(), y.signum()) {
            (1 | 0, 0) => 0,
            (0, 1) => 1,
            (-1, 0) => 2,
            (0, -1) => 3,
            (1, 1) => 4,
            (-1, 1) => 5,
            (-1, -1) => 6,
            _ => 7,
        };
        put_unsigned(out, x.unsigned_abs().max(y.unsigned_abs()) << 4 | direction << 1);
    } else {
        put_unsigned(out, x.unsigned_abs() << 2 | u64::from(x < 0) << 1 | 1);
        put_signed(out, y);
    }
}

/// Largest whole number that a real is written as.
const WHOLE: f64 = 9e15;

/// Append a real number: as a whole number where it is one, in double precision otherwise.
pub(crate) fn put_real(out: &mut Vec<u8>, value: f64) {
    if value.fract() == 0.0 && value.abs() <= WHOLE {
        out.push(u8::from(value < 0.0));
        put_unsigned(out, value.abs() as u64);
    } else {
        out.push(7);
        out.extend(value.to_le_bytes());
    }
}

/// Append a string with its length before it.
pub(crate) fn put_string(out: &mut Vec<u8>, string: &[u8]) {
    put_unsigned(out, string.len() as u64);
    out.extend_from_slice(string);
}

/// The unit vector of one of the eight directions.
#[inline]
pub(crate) fn direction(number: u64) -> [i64; 2] {
    const DIRECTIONS: [[i64; 2]; 8] = [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]];
    DIRECTIONS[(number & 7) as usize]
}
