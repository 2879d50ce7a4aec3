//! The outline of an alignment cross, for whoever writes or draws one.

/// Corners of a cross about its middle, counter-clockwise from the lower left of its lower arm, by half the
/// length `l` and half the width `w` of its arms.
pub fn cross_corners<T: Copy + std::ops::Neg<Output = T>>(l: T, w: T) -> [(T, T); 12] {
    [
        (-w, -l),
        (w, -l),
        (w, -w),
        (l, -w),
        (l, w),
        (w, w),
        (w, l),
        (-w, l),
        (-w, w),
        (-l, w),
        (-l, -w),
        (-w, -w),
    ]
}
