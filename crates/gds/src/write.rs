//! The two elements that a layout has millions of, as templates: all bytes ready but for the place.

use crate::LayerNumber;
use crate::pillar_records::BOUNDARY_BYTES;

/// The bytes of a real number, as records MAG and ANGLE have it.
pub fn real8(value: f64) -> [u8; 8] {
    crate::real::encode(value)
}

/// Offset at which the points of a BOUNDARY without optional record begin.
const POINTS: usize = 20;

/// A square on one layer: a BOUNDARY with five points and no optional record.
#[derive(Clone, Copy, Debug)]
pub struct SquareRecord([u8; BOUNDARY_BYTES]);

impl SquareRecord {
    /// The template for squares on a layer.
    pub fn on(layer: LayerNumber) -> Self {
        let mut record = [0; BOUNDARY_BYTES];
        let [l1, l0] = layer.layer.to_be_bytes();
        let [d1, d0] = layer.datatype.to_be_bytes();
        let (boundary, end) = ([0, 4, 0x08, 0], [0, 4, 0x11, 0]);
        record[..4].copy_from_slice(&boundary);
        record[4..10].copy_from_slice(&[0, 6, 0x0d, 2, l1, l0]);
        record[10..16].copy_from_slice(&[0, 6, 0x0e, 2, d1, d0]);
        record[16..20].copy_from_slice(&[0, 44, 0x10, 3]);
        record[60..].copy_from_slice(&end);
        Self(record)
    }

    /// Append the square of an even width about a centre, both in database units, corners counter-clockwise from the lower left.
    #[inline]
    pub fn append(&self, out: &mut Vec<u8>, x: i32, y: i32, width: u32) {
        let half = (width / 2) as i32;
        let (left, low, right, high) = (x - half, y - half, x + half, y + half);
        let corners = [left, low, right, low, right, high, left, high, left, low];
        let mut record = self.0;
        for (bytes, corner) in record[POINTS..60].chunks_exact_mut(4).zip(corners) {
            bytes.copy_from_slice(&corner.to_be_bytes());
        }
        out.extend_from_slice(&record);
    }
}

/// A polygon on one layer: a BOUNDARY without optional record.
#[derive(Clone, Debug)]
pub struct PolygonRecord {
    record: Vec<u8>,
    /// Closed, about the place that it is written at.
    corners: Vec<[i32; 2]>,
}

impl PolygonRecord {
    /// The template for a polygon of these corners (database units), the first not repeated, on a layer.
    ///
    /// # Panics
    /// If there are more than 8190 corners: the format has no longer record.
    pub fn on(layer: LayerNumber, corners: &[[i32; 2]]) -> Self {
        assert!(corners.len() <= 8190, "a polygon of {} corners", corners.len());
        let closed: Vec<[i32; 2]> = corners.iter().chain(corners.first()).copied().collect();
        let mut record = SquareRecord::on(layer).0[..POINTS - 4].to_vec();
        record.extend(((4 + 8 * closed.len()) as u16).to_be_bytes());
        record.extend([0x10, 3]);
        record.resize(POINTS + 8 * closed.len(), 0);
        record.extend([0, 4, 0x11, 0]);
        Self {
            record,
            corners: closed,
        }
    }

    /// Append the polygon about a place in database units.
    #[inline]
    pub fn append(&self, out: &mut Vec<u8>, x: i32, y: i32) {
        let start = out.len() + POINTS;
        out.extend_from_slice(&self.record);
        for (bytes, [dx, dy]) in out[start..].chunks_exact_mut(8).zip(&self.corners) {
            bytes[..4].copy_from_slice(&(x + dx).to_be_bytes());
            bytes[4..].copy_from_slice(&(y + dy).to_be_bytes());
        }
    }
}

/// A plain reference (SREF) to one cell: not mirrored, magnified or turned.
#[derive(Clone, Debug)]
pub struct ReferenceRecord {
    record: Vec<u8>,
    place: usize,
}

impl ReferenceRecord {
    /// The template for references to a cell.
    ///
    /// # Panics
    /// If its name has more than 65,530 bytes; the format says 32.
    pub fn to(cell: &str) -> Self {
        assert!(cell.len() <= 65_530, "a cell name of {} bytes", cell.len());
        let mut record = vec![0, 4, 0x0a, 0];
        // Strings are padded to an even length.
        let length = (cell.len() + cell.len() % 2 + 4) as u16;
        record.extend(length.to_be_bytes());
        record.extend([0x12, 6]);
        record.extend(cell.bytes());
        record.resize(4 + usize::from(length), 0);
        record.extend([0, 12, 0x10, 3]);
        let place = record.len();
        record.extend([0; 8]);
        record.extend([0, 4, 0x11, 0]);
        Self { record, place }
    }

    /// Append the reference at a place in database units.
    #[inline]
    pub fn append(&self, out: &mut Vec<u8>, x: i32, y: i32) {
        let start = out.len() + self.place;
        out.extend_from_slice(&self.record);
        out[start..start + 4].copy_from_slice(&x.to_be_bytes());
        out[start + 4..start + 8].copy_from_slice(&y.to_be_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gds21::{GdsBoundary, GdsElement, GdsLibrary, GdsPoint, GdsStruct, GdsStructRef};
    use proptest::prelude::*;

    /// The bytes of one element as gds21 writes it.
    fn by_gds21(element: GdsElement) -> Vec<u8> {
        let encode = |elems| {
            let mut library = GdsLibrary::new("L");
            library.structs.push(GdsStruct {
                elems,
                ..GdsStruct::new("C")
            });
            let mut bytes = Vec::new();
            library.write(&mut bytes).unwrap();
            bytes
        };
        let (empty, full) = (encode(vec![]), encode(vec![element]));
        let tail = 8;
        full[empty.len() - tail..full.len() - tail].to_vec()
    }

    proptest! {
        #[test]
        fn squares_are_those_of_gds21(x in -2_000_000_000..2_000_000_000, y in -2_000_000_000..2_000_000_000, half in 1u16..30_000, layer in 0i16..256, datatype in 0i16..256) {
            let mut ours = Vec::new();
            SquareRecord::on(LayerNumber::new(layer as u16, datatype as u16)).append(&mut ours, x, y, 2 * u32::from(half));
            let h = i32::from(half);
            let corners = [(x - h, y - h), (x + h, y - h), (x + h, y + h), (x - h, y + h), (x - h, y - h)];
            let boundary = GdsBoundary {
                layer,
                datatype,
                xy: corners.map(|(x, y)| GdsPoint::new(x, y)).to_vec(),
                ..Default::default()
            };
            prop_assert_eq!(ours, by_gds21(boundary.into()));
        }

        #[test]
        fn polygons_are_those_of_gds21(x in -2_000_000_000..2_000_000_000, y in -2_000_000_000..2_000_000_000, corners in prop::collection::vec([-30_000i32..30_000, -30_000i32..30_000], 3..60)) {
            let mut ours = Vec::new();
            PolygonRecord::on(LayerNumber::new(1, 2), &corners).append(&mut ours, x, y);
            let place = |[dx, dy]: &[i32; 2]| GdsPoint::new(x + dx, y + dy);
            let boundary = GdsBoundary {
                layer: 1,
                datatype: 2,
                xy: corners.iter().chain(&corners[..1]).map(place).collect(),
                ..Default::default()
            };
            prop_assert_eq!(ours, by_gds21(boundary.into()));
        }

        #[test]
        fn references_are_those_of_gds21(x: i32, y: i32, name in "[A-Za-z0-9_?$]{1,32}") {
            let mut ours = Vec::new();
            ReferenceRecord::to(&name).append(&mut ours, x, y);
            let reference = GdsStructRef { name, xy: GdsPoint::new(x, y), ..Default::default() };
            prop_assert_eq!(ours, by_gds21(reference.into()));
        }
    }
}
