//! Words and columns of a hand-off that follow from the kind of the pillars.

use metalith_pillars::{PillarShape, Rectangles};

/// Words of a hand-off for pillars of a kind, and columns for what a lab measures of them.
pub(super) struct KindWords {
    /// Quantities of the pillars that are measured.
    pub measured: &'static str,
    /// Quantities of a pad that are measured.
    pub sizes: &'static str,
    /// Property that the neighbours of a good site share.
    pub similar: &'static str,
    /// Value that a measurement at a site should give.
    pub expected: &'static str,
    /// Quantity that the shots of the writer snap, and the measure of its change.
    pub snapped: &'static str,
    pub changed: &'static str,
    /// Columns to fill in for each dose.
    pub dose_columns: &'static [&'static str],
    /// Columns of what is drawn where something is measured.
    pub drawn_columns: &'static [&'static str],
    /// Columns of the neighbours of a site, of what is expected there, and to fill in.
    pub site_columns: &'static [&'static str],
}

const SQUARES: KindWords = KindWords {
    measured: "widths",
    sizes: "width",
    similar: "nearly the same width",
    expected: "drawn width",
    snapped: "a width that is no multiple of it",
    changed: "rms change of width",
    dose_columns: &["measured_pad_width_nm"],
    drawn_columns: &["drawn_nm"],
    site_columns: &[
        "neighbours_min_nm",
        "neighbours_max_nm",
        "expected_low_nm",
        "expected_high_nm",
        "measured_x_nm",
        "measured_y_nm",
    ],
};

const CIRCLES: KindWords = KindWords {
    measured: "diameters",
    sizes: "diameter",
    similar: "nearly the same diameter",
    expected: "drawn diameter, along x and along y: where they differ the beam is astigmatic,",
    snapped: "a diameter that is no multiple of it",
    changed: "rms change of diameter",
    dose_columns: &["measured_pad_diameter_nm"],
    ..SQUARES
};

const ROTATED: KindWords = KindWords {
    measured: "widths, lengths and rotations",
    sizes: "width, length",
    similar: "nearly the same rotation",
    expected: "drawn width and length",
    snapped: "a corner that is on no multiple of it",
    changed: "rms shift of corners",
    dose_columns: &["measured_pad_width_nm", "measured_pad_length_nm"],
    drawn_columns: &["drawn_width_nm", "drawn_length_nm", "drawn_rotation_deg"],
    site_columns: &[
        "neighbours_min_deg",
        "neighbours_max_deg",
        "expected_within_nm",
        "measured_width_nm",
        "measured_length_nm",
        "measured_rotation_deg",
    ],
};

const UPRIGHT: KindWords = KindWords {
    measured: "widths along x and y",
    sizes: "widths along x and y",
    similar: "nearly the same edges",
    expected: "drawn edges along x and y",
    snapped: SQUARES.snapped,
    changed: SQUARES.changed,
    dose_columns: &["measured_pad_x_nm", "measured_pad_y_nm"],
    drawn_columns: &["drawn_x_nm", "drawn_y_nm"],
    site_columns: &[
        "neighbours_within_nm",
        "expected_within_nm",
        "measured_x_nm",
        "measured_y_nm",
    ],
};

impl KindWords {
    /// Words and columns of pillars of this kind.
    pub(crate) fn of(shape: PillarShape) -> &'static Self {
        match shape {
            PillarShape::Square | PillarShape::Mixed => &SQUARES,
            PillarShape::Circle => &CIRCLES,
            PillarShape::Rectangle(Rectangles::Rotated(_)) => &ROTATED,
            PillarShape::Rectangle(Rectangles::Upright(_)) => &UPRIGHT,
        }
    }
}
