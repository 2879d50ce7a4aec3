//! Modal variables: what a record may leave out because one before it said it.

use super::item::OasisValue;
use crate::repetition::Repetition;

/// A number in a table, or a name.
#[derive(Clone, Debug, Default)]
pub(super) struct Named {
    pub number: Option<u64>,
    pub name: Vec<u8>,
    pub known: bool,
}

impl Named {
    pub(crate) fn forget(&mut self) {
        self.known = false;
    }
}

/// All of them, and the element read last.
#[derive(Debug, Default)]
pub(super) struct Modal {
    pub relative: bool,
    pub placement: [i64; 2],
    pub geometry: [i64; 2],
    pub text: [i64; 2],
    pub layer: Option<u32>,
    pub datatype: Option<u32>,
    pub text_layer: Option<u32>,
    pub text_type: Option<u32>,
    pub width: Option<i64>,
    pub height: Option<i64>,
    pub half_width: Option<i64>,
    pub extensions: [Option<i64>; 2],
    pub trapezoid: Option<u64>,
    pub radius: Option<i64>,
    pub polygon: Vec<[i64; 2]>,
    pub path: Vec<[i64; 2]>,
    pub cell: Named,
    pub string: Named,
    pub property: Named,
    pub values: Vec<OasisValue>,
    pub values_known: bool,
    pub repetition: Option<Repetition>,
    /// Number of copies in the repetition.
    pub copies: u64,
    pub reach: [i64; 4],

    /// Name of the cell that begins; not a modal variable.
    pub begun: Named,
    /// Corners of the trapezoid read last; not a modal variable.
    pub corners: Vec<[i64; 2]>,
    pub magnification: f64,
    pub angle_deg: f64,
    pub mirrored: bool,
    pub repeated: bool,
}

impl Modal {
    /// Resets the variables to the state in which a cell begins. Memory is kept.
    pub(crate) fn forget(&mut self) {
        let kept = std::mem::take(self);
        *self = Self {
            polygon: kept.polygon,
            path: kept.path,
            corners: kept.corners,
            cell: kept.cell,
            string: kept.string,
            property: kept.property,
            values: kept.values,
            begun: kept.begun,
            ..Self::default()
        };
        self.polygon.clear();
        self.path.clear();
        self.cell.forget();
        self.string.forget();
        self.property.forget();
    }
}
