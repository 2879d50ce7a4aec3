//! The library around the pillars: cells, shapes, labels and references of which a layout has few.

use crate::LayerNumber;
use crate::record::{data, kind};
use crate::write::real8;

/// A GDSII library in memory.
#[derive(Clone, Debug)]
pub struct GdsLibrary {
    pub name: String,
    /// Database unit in user units, and in metres.
    pub units: [f64; 2],
    /// Date of everything: year, month, day, hour, minute, second.
    pub date: [i16; 6],
    pub cells: Vec<GdsCell>,
}

/// A cell of a library; cells come before those that refer to them.
#[derive(Clone, Debug)]
pub struct GdsCell {
    pub name: String,
    pub elements: Vec<GdsElement>,
}

/// An element of a cell, in database units.
#[derive(Clone, Debug, PartialEq)]
pub enum GdsElement {
    /// A polygon whose first corner is repeated at its end.
    Polygon { layer: LayerNumber, corners: Vec<[i32; 2]> },
    Text {
        layer: LayerNumber,
        text: String,
        at: [i32; 2],
    },
    /// One copy of a cell.
    Reference {
        cell: String,
        orientation: Option<Orientation>,
        at: [i32; 2],
    },
    /// Copies of a cell in columns and rows: the first place, and the places one step beyond the last column and the last row.
    Array {
        cell: String,
        columns: i16,
        rows: i16,
        places: [[i32; 2]; 3],
    },
}

/// Mirror and rotation of a copy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    /// True if it is mirrored at the x axis, before it is rotated.
    pub mirrored: bool,
    /// Rotation (degrees); without it there is no such record.
    pub angle_deg: Option<f64>,
}

/// A record that is longer than the 16 bits of its length: its type and the bytes of its body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLong {
    pub kind: u8,
    pub bytes: usize,
}

/// Release of the format in the HEADER record: the one that all programs read.
const RELEASE: i16 = 3;

impl GdsLibrary {
    /// An empty library.
    pub fn new(name: impl Into<String>, units: [f64; 2], date: [i16; 6]) -> Self {
        Self {
            name: name.into(),
            units,
            date,
            cells: Vec::new(),
        }
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// If a polygon or a text is too long for a record.
    pub fn encode(&self) -> Result<Vec<u8>, TooLong> {
        let mut out = Records(Vec::new());
        // Of the last change, and of the last access.
        let dates = [self.date, self.date].concat();
        out.numbers(kind::HEADER, &[RELEASE])?;
        out.numbers(kind::BGNLIB, &dates)?;
        out.text(kind::LIBNAME, &self.name)?;
        out.record(kind::UNITS, data::REAL8, &self.units.map(real8).concat())?;
        for cell in &self.cells {
            out.numbers(kind::BGNSTR, &dates)?;
            out.text(kind::STRNAME, &cell.name)?;
            for element in &cell.elements {
                out.element(element)?;
            }
            out.plain(kind::ENDSTR)?;
        }
        out.plain(kind::ENDLIB)?;
        Ok(out.0)
    }
}

/// Records one after the other.
struct Records(Vec<u8>);

/// Data type of records without a body.
const NO_DATA: u8 = 0;

/// Bits of STRANS: mirrored at the x axis.
const MIRRORED: [u8; 2] = [0x80, 0];

impl Records {
    fn element(&mut self, element: &GdsElement) -> Result<(), TooLong> {
        match element {
            GdsElement::Polygon { layer, corners } => {
                self.plain(kind::BOUNDARY)?;
                self.layer(*layer, kind::DATATYPE)?;
                self.places(corners)?;
            }
            GdsElement::Text { layer, text, at } => {
                self.plain(kind::TEXT)?;
                self.layer(*layer, kind::TEXTTYPE)?;
                self.places(&[*at])?;
                self.text(kind::STRING, text)?;
            }
            GdsElement::Reference { cell, orientation, at } => {
                self.plain(kind::SREF)?;
                self.text(kind::SNAME, cell)?;
                if let Some(Orientation { mirrored, angle_deg }) = orientation {
                    let bits = if *mirrored { MIRRORED } else { [0, 0] };
                    self.record(kind::STRANS, data::BITS, &bits)?;
                    if let Some(angle_deg) = angle_deg {
                        self.record(kind::ANGLE, data::REAL8, &real8(*angle_deg))?;
                    }
                }
                self.places(&[*at])?;
            }
            GdsElement::Array {
                cell,
                columns,
                rows,
                places,
            } => {
                self.plain(kind::AREF)?;
                self.text(kind::SNAME, cell)?;
                self.numbers(kind::COLROW, &[*columns, *rows])?;
                self.places(places)?;
            }
        }
        self.plain(kind::ENDEL)
    }

    fn layer(&mut self, layer: LayerNumber, datatype: u8) -> Result<(), TooLong> {
        self.record(kind::LAYER, data::INT2, &layer.layer.to_be_bytes())?;
        self.record(datatype, data::INT2, &layer.datatype.to_be_bytes())
    }

    fn places(&mut self, places: &[[i32; 2]]) -> Result<(), TooLong> {
        let bytes: Vec<u8> = places.iter().flatten().flat_map(|v| v.to_be_bytes()).collect();
        self.record(kind::XY, data::INT4, &bytes)
    }

    fn numbers(&mut self, kind: u8, numbers: &[i16]) -> Result<(), TooLong> {
        let bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_be_bytes()).collect();
        self.record(kind, data::INT2, &bytes)
    }

    /// A text, padded to an even length.
    fn text(&mut self, kind: u8, text: &str) -> Result<(), TooLong> {
        let mut bytes = text.as_bytes().to_vec();
        if !bytes.len().is_multiple_of(2) {
            bytes.push(0);
        }
        self.record(kind, data::ASCII, &bytes)
    }

    fn plain(&mut self, kind: u8) -> Result<(), TooLong> {
        self.record(kind, NO_DATA, &[])
    }

    fn record(&mut self, kind: u8, data: u8, body: &[u8]) -> Result<(), TooLong> {
        let length = u16::try_from(body.len() + 4).map_err(|_| TooLong {
            kind,
            bytes: body.len(),
        })?;
        self.0.extend(length.to_be_bytes());
        self.0.extend([kind, data]);
        self.0.extend(body);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DATE: [i16; 6] = [2027, 1, 31, 12, 34, 56];

    /// Bytes of the same library as gds21 writes it.
    fn by_gds21(library: &GdsLibrary) -> Vec<u8> {
        let [year, month, day, hour, minute, second] = library.date;
        let mut bytes = Vec::new();
        let dates: gds21::GdsDateTimes = {
            let text = format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}");
            let date: chrono::NaiveDateTime = text.parse().unwrap();
            gds21::GdsDateTimes {
                modified: date,
                accessed: date,
            }
        };
        let mut whole = gds21::GdsLibrary::new(library.name.clone());
        whole.dates = dates.clone();
        whole.units = gds21::GdsUnits::new(library.units[0], library.units[1]);
        for cell in &library.cells {
            whole.structs.push(gds21::GdsStruct {
                name: cell.name.clone(),
                dates: dates.clone(),
                elems: cell.elements.iter().map(element).collect(),
            });
        }
        whole.write(&mut bytes).unwrap();
        bytes
    }

    fn element(element: &GdsElement) -> gds21::GdsElement {
        let point = |[x, y]: [i32; 2]| gds21::GdsPoint::new(x, y);
        match element.clone() {
            GdsElement::Polygon { layer, corners } => gds21::GdsBoundary {
                layer: layer.layer as i16,
                datatype: layer.datatype as i16,
                xy: corners.into_iter().map(point).collect(),
                ..Default::default()
            }
            .into(),
            GdsElement::Text { layer, text, at } => gds21::GdsTextElem {
                layer: layer.layer as i16,
                texttype: layer.datatype as i16,
                string: text,
                xy: point(at),
                ..Default::default()
            }
            .into(),
            GdsElement::Reference { cell, orientation, at } => gds21::GdsStructRef {
                name: cell,
                xy: point(at),
                strans: orientation.map(|o| gds21::GdsStrans {
                    reflected: o.mirrored,
                    angle: o.angle_deg,
                    ..Default::default()
                }),
                ..Default::default()
            }
            .into(),
            GdsElement::Array {
                cell,
                columns,
                rows,
                places,
            } => gds21::GdsArrayRef {
                name: cell,
                cols: columns,
                rows,
                xy: places.map(point),
                ..Default::default()
            }
            .into(),
        }
    }

    proptest! {
        #[test]
        fn bytes_are_those_of_gds21(
            corners in prop::collection::vec([any::<i32>(), any::<i32>()], 1..60),
            name in "[A-Za-z0-9_?$]{1,33}",
            unit in prop::sample::select(vec![1e-3, 0.5e-3, 0.25e-3, 1e-4, 0.7]),
            layer in 0u16..256,
            mirrored: bool,
            turns in 0u8..4,
            count in any::<[i16; 2]>(),
        ) {
            let layer = LayerNumber::new(layer, 255 - layer);
            let orientation = Orientation { mirrored, angle_deg: (turns > 0).then(|| 90.0 * f64::from(turns)) };
            let mut library = GdsLibrary::new(name.clone(), [unit, unit * 1e-6], DATE);
            let elements = vec![
                GdsElement::Text { layer, text: name.clone(), at: corners[0] },
                GdsElement::Reference { cell: name.clone(), orientation: Some(orientation), at: corners[0] },
                GdsElement::Reference { cell: name.clone(), orientation: None, at: corners[0] },
                GdsElement::Array { cell: name.clone(), columns: count[0], rows: count[1], places: [corners[0]; 3] },
                GdsElement::Polygon { layer, corners },
            ];
            library.cells.push(GdsCell { name, elements });
            prop_assert_eq!(library.encode().unwrap(), by_gds21(&library));
        }
    }

    #[test]
    fn a_record_has_sixteen_bits_of_length() {
        let corners = vec![[0, 0]; 8192];
        let mut library = GdsLibrary::new("L", [1e-3, 1e-9], DATE);
        let elements = vec![GdsElement::Polygon {
            layer: LayerNumber::new(1, 0),
            corners,
        }];
        library.cells.push(GdsCell {
            name: "C".into(),
            elements,
        });
        let too_long = TooLong {
            kind: kind::XY,
            bytes: 8 * 8192,
        };
        assert_eq!(library.encode(), Err(too_long));
    }
}
