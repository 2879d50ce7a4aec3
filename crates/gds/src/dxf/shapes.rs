//! Entities as shapes, in units of the drawing.

use super::Fault;
use super::affine::Affine;
use super::curves::{Arc, bulged};
use super::drawing::{Entity, Kind};
use super::hatch;
use super::pairs::Pair;

/// Shapes of an entity.
pub(super) enum Drawn<'a> {
    Polygon(Vec<[f64; 2]>),
    Polygons(Vec<Vec<[f64; 2]>>),
    /// A line without width.
    Open(Vec<[f64; 2]>),
    Path {
        points: Vec<[f64; 2]>,
        width: f64,
    },
    Label {
        at: [f64; 2],
        text: Vec<u8>,
    },
    Insert(Insert<'a>),
    /// Nothing that is read, in words.
    Unread(&'static str),
}

/// A block that is placed.
pub(super) struct Insert<'a> {
    pub name: &'a [u8],
    pub at: [f64; 2],
    pub scale: [f64; 2],
    pub turn_deg: f64,
    pub copies: [u32; 2],
    pub spacing: [f64; 2],
}

/// Pairs of an entity.
pub(super) struct Fields<'p, 'a> {
    pub pairs: &'p [Pair<'a>],
}

impl<'a> Fields<'_, 'a> {
    pub(super) fn text(&self, code: i32) -> Option<&'a [u8]> {
        self.pairs.iter().find(|p| p.code == code).map(|p| p.value)
    }

    fn given(&self, code: i32) -> Result<Option<f64>, Fault> {
        self.pairs.iter().find(|p| p.code == code).map(Pair::number).transpose()
    }

    fn or(&self, code: i32, default: f64) -> Result<f64, Fault> {
        Ok(self.given(code)?.unwrap_or(default))
    }

    fn place(&self, code: i32) -> Result<[f64; 2], Fault> {
        Ok([self.or(code, 0.0)?, self.or(code + 10, 0.0)?])
    }

    fn flags(&self) -> Result<u32, Fault> {
        Ok(self.or(70, 0.0)? as u32)
    }

    /// Change by which coordinates that an entity has in its own plane become those of the drawing: a plane seen from behind is
    /// mirrored.
    pub(super) fn plane(&self) -> Result<Affine, Fault> {
        let behind = self.or(230, 1.0)? < 0.0;
        Ok(Affine::scale([if behind { -1.0 } else { 1.0 }, 1.0]))
    }
}

/// A corner of a polyline, its bulge and its widths.
#[derive(Clone, Copy, Default)]
struct Vertex {
    at: [f64; 2],
    bulge: f64,
    widths: [Option<f64>; 2],
    /// A control point of a curve that other vertices stand for.
    control: bool,
}

/// Shapes of an entity. A unit of the drawing is `unit` database units.
pub(super) fn drawn<'a>(entity: &Entity, fields: &Fields<'_, 'a>, unit: f64) -> Result<Drawn<'a>, Fault> {
    Ok(match entity.kind {
        Kind::LightPolyline | Kind::Polyline => polyline(fields, entity.kind == Kind::LightPolyline, unit)?,
        Kind::Circle => {
            let arc = Arc::of_circle(fields.place(10)?, fields.or(40, 0.0)?, 0.0, std::f64::consts::TAU);
            Drawn::Polygon(arc.corners(unit))
        }
        Kind::Arc => {
            let from = fields.or(50, 0.0)?;
            let sweep = match (fields.or(51, 360.0)? - from).rem_euclid(360.0) {
                0.0 => 360.0,
                sweep => sweep,
            };
            let [from, to] = [from, from + sweep].map(f64::to_radians);
            curve(Arc::of_circle(fields.place(10)?, fields.or(40, 0.0)?, from, to), unit)
        }
        Kind::Ellipse => ellipse(fields, unit)?,
        Kind::Line => Drawn::Open(vec![fields.place(10)?, fields.place(11)?]),
        Kind::Solid | Kind::Face => {
            let order = if entity.kind == Kind::Solid {
                [10, 11, 13, 12]
            } else {
                [10, 11, 12, 13]
            };
            // Three corners have no fourth.
            let corners = order
                .into_iter()
                .filter(|code| fields.text(*code).is_some())
                .map(|code| fields.place(code));
            Drawn::Polygon(corners.collect::<Result<_, _>>()?)
        }
        Kind::Insert => {
            let copies = |code| Ok(fields.or(code, 1.0)?.clamp(1.0, f64::from(u16::MAX)) as u32);
            Drawn::Insert(Insert {
                name: fields.text(2).unwrap_or_default(),
                at: fields.place(10)?,
                scale: [fields.or(41, 1.0)?, fields.or(42, 1.0)?],
                turn_deg: fields.or(50, 0.0)?,
                copies: [copies(70)?, copies(71)?],
                spacing: [fields.or(44, 0.0)?, fields.or(45, 0.0)?],
            })
        }
        Kind::Text => {
            // Long texts have parts before the last.
            let parts = [3, 1].map(|code| fields.pairs.iter().filter(move |p| p.code == code).map(|p| p.value));
            Drawn::Label {
                at: fields.place(10)?,
                text: parts.into_iter().flatten().collect::<Vec<_>>().concat(),
            }
        }
        Kind::Hatch => match hatch::outlines(fields.pairs, unit)? {
            Some(outlines) => Drawn::Polygons(outlines),
            None => Drawn::Unread("hatches with holes, splines or lines"),
        },
        Kind::Unread => Drawn::Unread("entities of other kinds"),
    })
}

fn ellipse<'a>(fields: &Fields<'_, 'a>, unit: f64) -> Result<Drawn<'a>, Fault> {
    let (a, ratio) = (fields.place(11)?, fields.or(40, 1.0)?);
    let [from, to] = [fields.or(41, 0.0)?, fields.or(42, std::f64::consts::TAU)?];
    let turns = if to > from { 0.0 } else { std::f64::consts::TAU };
    // The second axis is to the left of the first, seen from before the plane.
    let left = fields.plane()?.0[0][0] * ratio;
    let arc = Arc {
        middle: fields.place(10)?,
        axes: [a, [-left * a[1], left * a[0]]],
        from,
        to: to + turns,
    };
    Ok(curve(arc, unit))
}

fn curve<'a>(arc: Arc, unit: f64) -> Drawn<'a> {
    let corners = arc.corners(unit);
    if arc.is_closed() {
        Drawn::Polygon(corners)
    } else {
        Drawn::Open(corners)
    }
}

fn polyline<'a>(fields: &Fields<'_, 'a>, light: bool, unit: f64) -> Result<Drawn<'a>, Fault> {
    /// Flags: closed; a mesh or faces; a vertex that the curve does not go through.
    const CLOSED: u32 = 1;
    const MESH: u32 = 16 | 64;
    const CONTROL: u32 = 16;
    let mut vertices: Vec<Vertex> = Vec::new();
    let head = if light {
        fields.pairs
    } else {
        let end = fields.pairs.iter().position(|p| p.code == 0);
        &fields.pairs[..end.unwrap_or(fields.pairs.len())]
    };
    let head = Fields { pairs: head };
    let behind = if light {
        fields.pairs
    } else {
        &fields.pairs[head.pairs.len()..]
    };
    for pair in behind {
        let begins = if light { pair.code == 10 } else { pair.code == 0 };
        if begins {
            vertices.push(Vertex::default());
        }
        let Some(vertex) = vertices.last_mut() else { continue };
        match pair.code {
            10 => vertex.at[0] = pair.number()?,
            20 => vertex.at[1] = pair.number()?,
            40 => vertex.widths[0] = Some(pair.number()?),
            41 => vertex.widths[1] = Some(pair.number()?),
            42 => vertex.bulge = pair.number()?,
            70 if !light => vertex.control = pair.number()? as u32 & CONTROL != 0,
            _ => {}
        }
    }
    if head.flags()? & MESH != 0 {
        return Ok(Drawn::Unread("meshes"));
    }
    vertices.retain(|v| !v.control);
    let common = if light {
        [head.or(43, 0.0)?; 2]
    } else {
        [head.or(40, 0.0)?, head.or(41, 0.0)?]
    };
    let mut widths = vertices
        .iter()
        .flat_map(|v| [0, 1].map(|k| v.widths[k].unwrap_or(common[k])));
    let width = widths.next().unwrap_or(0.0);
    if widths.any(|other| other != width) {
        return Ok(Drawn::Unread("polylines of changing width"));
    }
    let mut closed = head.flags()? & CLOSED != 0;
    let mut points = Vec::new();
    for (k, own) in vertices.iter().enumerate() {
        match vertices.get(k + 1).or(vertices.first().filter(|_| closed)) {
            Some(next) if own.bulge != 0.0 => points.extend(bulged(own.at, next.at, own.bulge, unit)),
            _ => points.push(own.at),
        }
    }
    if width > 0.0 {
        points.extend(points.first().copied().filter(|_| closed));
        return Ok(Drawn::Path { points, width });
    }
    // One that comes back to its start is closed too.
    closed |= points.len() > 3 && points.first() == points.last();
    Ok(if closed {
        Drawn::Polygon(points)
    } else {
        Drawn::Open(points)
    })
}
