//! GDSII records of a drawing, streamed.

use std::io::{self, Write};

use metalith_core::LayerNumber;

use super::super::real::encode;
use super::super::record::{data, kind};

/// Points of one XY record: outlines of more have several.
const POINTS: usize = 8190;

/// Copies along an axis of an AREF.
pub(super) const MOST_COPIES: u32 = i16::MAX as u32;

/// A reference: what is placed, how and where. The places are the first, and for an array the two far corners.
#[derive(Clone, Copy)]
pub(super) struct Placed<'a> {
    pub cell: &'a [u8],
    pub mirrored: bool,
    pub magnification: f64,
    pub angle_deg: f64,
    pub copies: [u32; 2],
    pub places: &'a [[i32; 2]],
}

/// Writer of records.
pub(super) struct Records<W> {
    to: W,
    pub bytes: u64,
}

impl<W: Write> Records<W> {
    pub(super) fn new(to: W) -> Self {
        Self { to, bytes: 0 }
    }

    fn put(&mut self, kind: u8, data: u8, body: &[u8]) -> io::Result<()> {
        let length = (body.len() + 4) as u16;
        self.bytes += u64::from(length);
        self.to.write_all(&length.to_be_bytes())?;
        self.to.write_all(&[kind, data])?;
        self.to.write_all(body)
    }

    fn bare(&mut self, kind: u8) -> io::Result<()> {
        self.put(kind, 0, &[])
    }

    fn text(&mut self, kind: u8, text: &[u8]) -> io::Result<()> {
        let mut body = text.to_vec();
        body.resize(body.len() + body.len() % 2, 0);
        self.put(kind, data::ASCII, &body)
    }

    fn points(&mut self, points: &[[i32; 2]]) -> io::Result<()> {
        for part in points.chunks(POINTS) {
            let body: Vec<u8> = part.iter().flatten().flat_map(|v| v.to_be_bytes()).collect();
            self.put(kind::XY, data::INT4, &body)?;
        }
        Ok(())
    }

    fn on(&mut self, of: u8, layer: LayerNumber, datatype: u8) -> io::Result<()> {
        self.bare(of)?;
        self.put(kind::LAYER, data::INT2, &layer.layer.to_be_bytes())?;
        self.put(datatype, data::INT2, &layer.datatype.to_be_bytes())
    }

    /// The head of a library in nanometres.
    pub(super) fn begin(&mut self) -> io::Result<()> {
        self.put(kind::HEADER, data::INT2, &[2, 88])?;
        self.put(kind::BGNLIB, data::INT2, &[0; 24])?;
        self.text(kind::LIBNAME, b"DXF")?;
        let units = [encode(1e-3), encode(1e-9)].concat();
        self.put(kind::UNITS, data::REAL8, &units)
    }

    pub(super) fn end(&mut self) -> io::Result<()> {
        self.bare(kind::ENDLIB)?;
        self.to.flush()
    }

    pub(super) fn begin_cell(&mut self, name: &[u8]) -> io::Result<()> {
        self.put(kind::BGNSTR, data::INT2, &[0; 24])?;
        self.text(kind::STRNAME, name)
    }

    pub(super) fn end_cell(&mut self) -> io::Result<()> {
        self.bare(kind::ENDSTR)
    }

    /// A polygon, its first corner not repeated.
    pub(super) fn polygon(&mut self, layer: LayerNumber, corners: &mut Vec<[i32; 2]>) -> io::Result<()> {
        corners.push(corners[0]);
        self.on(kind::BOUNDARY, layer, kind::DATATYPE)?;
        self.points(corners)?;
        self.bare(kind::ENDEL)
    }

    pub(super) fn path(&mut self, layer: LayerNumber, width: i32, points: &[[i32; 2]]) -> io::Result<()> {
        self.on(kind::PATH, layer, kind::DATATYPE)?;
        self.put(kind::WIDTH, data::INT4, &width.to_be_bytes())?;
        self.points(points)?;
        self.bare(kind::ENDEL)
    }

    pub(super) fn label(&mut self, layer: LayerNumber, at: [i32; 2], text: &[u8]) -> io::Result<()> {
        self.on(kind::TEXT, layer, kind::TEXTTYPE)?;
        self.points(&[at])?;
        self.text(kind::STRING, text)?;
        self.bare(kind::ENDEL)
    }

    pub(super) fn reference(&mut self, placed: &Placed<'_>) -> io::Result<()> {
        let array = placed.places.len() > 1;
        self.bare(if array { kind::AREF } else { kind::SREF })?;
        self.text(kind::SNAME, placed.cell)?;
        self.put(kind::STRANS, data::BITS, &[u8::from(placed.mirrored) << 7, 0])?;
        self.put(kind::MAG, data::REAL8, &encode(placed.magnification))?;
        self.put(kind::ANGLE, data::REAL8, &encode(placed.angle_deg))?;
        if array {
            let body = placed.copies.map(|n| (n as u16).to_be_bytes()).concat();
            self.put(kind::COLROW, data::INT2, &body)?;
        }
        self.points(placed.places)?;
        self.bare(kind::ENDEL)
    }
}
