//! Corners of trapezoids.

/// Corners of a trapezoid in a box of `width` x `height`, clockwise from its lower left. `vertical` says whether its
/// parallel sides are; `a` and `b` are how far the side on the left (bottom) and on the right (top) lean.
pub(crate) fn trapezoid(vertical: bool, width: i64, height: i64, a: i64, b: i64) -> [[i64; 2]; 4] {
    if vertical {
        [
            [0, a.max(0)],
            [0, height + b.min(0)],
            [width, height - b.max(0)],
            [width, -a.min(0)],
        ]
    } else {
        [
            [a.max(0), height],
            [width + b.min(0), height],
            [width - b.max(0), 0],
            [-a.min(0), 0],
        ]
    }
}

/// Corners of a compact trapezoid, clockwise from the lower left of its box of `w` x `h`: one of 26 forms with sides
/// along the eight directions. Forms 16 to 19, 22, 23 and 25 ignore the height, 20 and 21 the width. None if the
/// form does not exist or does not fit its box.
pub fn compact_trapezoid(form: u64, w: i64, h: i64) -> Option<Vec<[i64; 2]>> {
    let fits = match form {
        0..=3 => w >= h,
        4 | 5 => w >= 2 * h,
        6 | 7 => w >= h,
        8..=11 => h >= w,
        12 | 13 => h >= 2 * w,
        14 | 15 => h >= w,
        16..=25 => true,
        _ => false,
    };
    if !fits {
        return None;
    }
    let corners: &[[i64; 2]] = match form {
        0 => &[[0, 0], [0, h], [w - h, h], [w, 0]],
        1 => &[[0, 0], [0, h], [w, h], [w - h, 0]],
        2 => &[[0, 0], [h, h], [w, h], [w, 0]],
        3 => &[[h, 0], [0, h], [w, h], [w, 0]],
        4 => &[[0, 0], [h, h], [w - h, h], [w, 0]],
        5 => &[[h, 0], [0, h], [w, h], [w - h, 0]],
        6 => &[[0, 0], [h, h], [w, h], [w - h, 0]],
        7 => &[[h, 0], [0, h], [w - h, h], [w, 0]],
        8 => &[[0, 0], [0, h], [w, h - w], [w, 0]],
        9 => &[[0, 0], [0, h - w], [w, h], [w, 0]],
        10 => &[[0, 0], [0, h], [w, h], [w, w]],
        11 => &[[0, w], [0, h], [w, h], [w, 0]],
        12 => &[[0, 0], [0, h], [w, h - w], [w, w]],
        13 => &[[0, w], [0, h - w], [w, h], [w, 0]],
        14 => &[[0, 0], [0, h - w], [w, h], [w, w]],
        15 => &[[0, w], [0, h], [w, h - w], [w, 0]],
        16 => &[[0, 0], [0, w], [w, 0]],
        17 => &[[0, 0], [0, w], [w, w]],
        18 => &[[0, 0], [w, w], [w, 0]],
        19 => &[[0, w], [w, w], [w, 0]],
        20 => &[[0, 0], [h, h], [2 * h, 0]],
        21 => &[[0, h], [2 * h, h], [h, 0]],
        22 => &[[0, 0], [0, 2 * w], [w, w]],
        23 => &[[w, 0], [0, w], [w, 2 * w]],
        24 => &[[0, 0], [0, h], [w, h], [w, 0]],
        _ => &[[0, 0], [0, w], [w, w], [w, 0]],
    };
    Some(corners.to_vec())
}
