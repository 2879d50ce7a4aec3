//! Items read, borrowed from the modal variables.

use std::io::{Read, Seek};

use crate::read::OasisReader;
use crate::read::item::{CellReference, Kind, NameEntry, OasisElement, OasisItem, OasisShape, Step};
use crate::read::modal::Named;

impl<R: Read + Seek> OasisReader<R> {
    /// Item read by a step, borrowed.
    #[inline]
    pub(in crate::read) fn view(&self, step: Step) -> OasisItem<'_> {
        let modal = &self.modal;
        match step {
            Step::Cell => OasisItem::Cell(reference(&modal.begun)),
            Step::Element(kind) => OasisItem::Element(self.view_element(kind)),
            Step::Name(table, number) => OasisItem::Name(NameEntry {
                table,
                number,
                name: self.tables.last(),
            }),
            Step::Property { standard } => OasisItem::Property {
                name: reference(&modal.property),
                standard,
                values: &modal.values,
            },
            Step::End => OasisItem::End,
        }
    }

    #[inline]
    fn view_element(&self, kind: Kind) -> OasisElement<'_> {
        let modal = &self.modal;
        let mut at = modal.geometry;
        let (mut layer, mut datatype) = (modal.layer, modal.datatype);
        let shape = match kind {
            Kind::Rectangle => OasisShape::Rectangle {
                size: [modal.width.unwrap_or(0), modal.height.unwrap_or(0)],
            },
            Kind::Polygon => OasisShape::Polygon { points: &modal.polygon },
            Kind::Trapezoid => OasisShape::Polygon { points: &modal.corners },
            Kind::Path => OasisShape::Path {
                points: &modal.path,
                half_width: modal.half_width.unwrap_or(0),
                extensions: modal.extensions.map(|e| e.unwrap_or(0)),
            },
            Kind::Circle => OasisShape::Circle {
                radius: modal.radius.unwrap_or(0),
            },
            Kind::Text => {
                (at, layer, datatype) = (modal.text, modal.text_layer, modal.text_type);
                OasisShape::Text {
                    string: reference(&modal.string),
                }
            }
            Kind::Placement => {
                (at, layer, datatype) = (modal.placement, None, None);
                OasisShape::Placement {
                    cell: reference(&modal.cell),
                    mirrored: modal.mirrored,
                    magnification: modal.magnification,
                    angle_deg: modal.angle_deg,
                }
            }
            Kind::Private(attribute) => OasisShape::Private { attribute },
        };
        let repetition = modal.repetition.as_ref().filter(|_| modal.repeated);
        OasisElement {
            place: self.input.record(),
            shape,
            layer: layer.unwrap_or(0),
            datatype: datatype.unwrap_or(0),
            at,
            copies: repetition.map_or(1, |_| modal.copies),
            reach: repetition.map_or([0; 4], |_| modal.reach),
            repetition,
        }
    }
}

fn reference(named: &Named) -> CellReference<'_> {
    match named.number {
        Some(number) => CellReference::Number(number),
        None => CellReference::Name(&named.name),
    }
}
