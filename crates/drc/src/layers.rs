//! Allowed content and extent of each layer.

use super::context::Context;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::rule::{NotRun, Rule, RuleOutcome};
use metalith_core::document::{Limits, Section};
use metalith_gds::{LayerNumber, Rect};
use metalith_pillars::PillarRows;

enum LayerRule {
    Whitelist(Vec<LayerNumber>),
    /// Exposed shapes lie within an area.
    Area {
        layers: Vec<LayerNumber>,
        within: Within,
    },
    NoText(Vec<LayerNumber>),
}

enum Within {
    /// Left, bottom, right, top (um); with a design, distances from the edge of its chip.
    Edges { um: [f64; 4], edge_um: Option<f64> },
    /// Bounding box of the shapes on a layer.
    Drawn(LayerNumber),
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    Some(Box::new(match check {
        "layers_known" => LayerRule::Whitelist(context.some_layers(s)),
        "active_area" => LayerRule::Area {
            layers: context.some_layers(s),
            within: if s.has("inside") {
                Within::Drawn(context.layer(s, "inside"))
            } else {
                Within::Edges {
                    um: s.array("um", Limits::new(-1e6..=1e6, "um")),
                    edge_um: s.optional_float("edge_um", Limits::new(0.0..=1e6, "um")),
                }
            },
        },
        "no_text_exposed" => LayerRule::NoText(context.some_layers(s)),
        _ => return None,
    }))
}

impl Rule for LayerRule {
    fn words(&self) -> String {
        let list = |l: &[LayerNumber]| l.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        match self {
            Self::Whitelist(layers) => format!("layers {} and no other", list(layers)),
            Self::Area {
                layers,
                within: Within::Drawn(frame),
            } => format!("{} within what is drawn on {frame}", list(layers)),
            Self::Area {
                layers,
                within: Within::Edges { um, edge_um },
            } => {
                let of_design = edge_um.map_or_else(String::new, |edge| {
                    format!("; of a design, {edge} um inside the edge of its chip")
                });
                let [left, bottom, right, top] = um;
                let layers = list(layers);
                format!("{layers} within x {left} to {right}, y {bottom} to {top} um{of_design}")
            }
            Self::NoText(layers) => format!("no text on the exposed layers {}", list(layers)),
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        match self {
            Self::Whitelist(layers) => {
                let mut used: Vec<LayerNumber> = flat.counts.keys().copied().collect();
                used.extend(flat.texts.iter().map(|t| t.layer));
                used.sort_unstable();
                used.dedup();
                for layer in used.iter().filter(|l| !layers.contains(l)) {
                    let shapes = flat.counts.get(layer).copied().unwrap_or(0);
                    found.plain(&layer.to_string(), || format!("layer {layer} with {shapes} shapes"));
                }
                Ok(())
            }
            Self::Area { layers, within } => {
                let Some(area) = within.area(flat) else {
                    return Err(NotRun::Skipped("nothing is drawn on the layer of the frame".into()));
                };
                let out = |r: &Rect| r.x0 < area.x0 || r.y0 < area.y0 || r.x1 > area.x1 || r.y1 > area.y1;
                for layer in layers {
                    for r in flat
                        .loose(*layer)
                        .into_iter()
                        .flat_map(|l| l.bounds())
                        .filter(|r| out(r))
                    {
                        found.rect(&r, || format!("a shape on {layer} outside the active area"));
                    }
                    if *layer == flat.pillars {
                        pillars_out(flat, &out, found);
                    }
                }
                Ok(())
            }
            Self::NoText(layers) => {
                for t in flat.texts.iter().filter(|t| layers.contains(&t.layer)) {
                    found.at(&[t.at], || format!("text \"{}\" on {}", t.string, t.layer));
                }
                Ok(())
            }
        }
    }
}

impl Within {
    /// Area in database units; `None` if nothing is drawn there.
    fn area(&self, flat: &FlatLayout<'_>) -> Option<Rect> {
        let um = match self {
            Self::Drawn(frame) => {
                return flat.loose(*frame)?.bounds().reduce(|mut all, r| {
                    all.unite(&r);
                    all
                });
            }
            Self::Edges { um, edge_um } => match (flat.design, edge_um) {
                (Some(design), Some(edge)) => {
                    let (width, height) = design.layout.chip.size_nm;
                    let [x, y] = [width, height].map(|size| size as f64 * 0.5e-3 - *edge);
                    [-x, -y, x, y]
                }
                _ => *um,
            },
        };
        let [x0, y0, x1, y1] = um.map(|v| flat.units(v * 1e3).round() as i64);
        Some(Rect { x0, y0, x1, y1 })
    }
}

fn pillars_out(flat: &FlatLayout<'_>, out: &impl Fn(&Rect) -> bool, found: &mut Findings) {
    for (k, e) in flat.elements.iter().enumerate() {
        let n = e.site.lattice.sites() - 1;
        let site = |row, column| {
            let half = e.site.lattice.pitch_nm().nm() / 2.0;
            let unit = |nm: f64| flat.units(nm).round() as i64;
            let x = e.site.centre_nm[0] as f64 + e.site.lattice.drawn_nm(0, column);
            let y = e.site.centre_nm[1] as f64 + e.site.lattice.drawn_nm(1, row);
            Rect {
                x0: unit(x - half),
                y0: unit(y - half),
                x1: unit(x + half),
                y1: unit(y + half),
            }
        };
        let mut lens = site(0, 0);
        lens.unite(&site(n, n));
        if !out(&lens) {
            continue;
        }
        e.widths.each_pillar(|row, column, _| {
            let r = flat.pillar(k, row, column);
            if out(&r) {
                found.rect(&r, || "a pillar outside the active area".into());
            }
        });
    }
}
