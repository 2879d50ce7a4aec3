//! Grids: the lattice of the element, the grid of the database, and the steps of the beam.

use super::body::Body;
use super::context::Context;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::rule::{NO_DESIGN, NotRun, Rule, RuleOutcome, from_design};
use super::tolerance::{EQUAL_NM, ROUNDING_NM};
use metalith_core::document::{Limits, Section};
use metalith_gds::{LayerNumber, Point};
use metalith_pillars::{PillarId, PillarRows};

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    let nm = || Limits::new(0.001..=1e6, "nm");
    Some(match check {
        "on_lattice" => Box::new(OnLattice {
            pitch_nm: (!from_design(s)).then(|| s.float("pitch_nm", nm())),
        }),
        "grid" => Box::new(GridRule {
            layers: context.some_layers(s),
            step_nm: s.float("nm", nm()),
        }),
        "exposure_grid" => Box::new(ExposureGrid {
            step_nm: s.float("beam_step_nm", nm()),
        }),
        _ => return None,
    })
}

/// Squares in an element are on its sites.
struct OnLattice {
    /// Pitch (nm); `None` for the pitch of the design.
    pitch_nm: Option<f64>,
}

impl Rule for OnLattice {
    fn words(&self) -> String {
        match self.pitch_nm {
            Some(nm) => format!("pillars of an element stand on one lattice of {nm} nm"),
            None => "pillars of an element stand on one lattice, of the pitch of the design".into(),
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        if flat.elements.is_empty() {
            return Err(NotRun::Skipped(flat.no_elements.clone()));
        }
        let wanted = self.pitch_nm.or(flat.design.map(|d| f64::from(d.cell.pitch_nm)));
        let wanted = wanted.ok_or_else(|| NotRun::Skipped(NO_DESIGN.into()))?;
        for e in &flat.elements {
            let pitch = e.site.lattice.pitch_nm();
            if f64::from(pitch) != wanted {
                found.plain(&format!("{} {pitch}", e.site.name), || {
                    format!("{} has a pitch of {pitch} nm, not {wanted}", e.site.name)
                });
            }
        }
        for r in &flat.off_lattice {
            found.rect(r, || "a square between the sites of its element".into());
        }
        Ok(())
    }
}

/// Vertices are on multiples of a step.
struct GridRule {
    layers: Vec<LayerNumber>,
    step_nm: f64,
}

impl GridRule {
    fn off(&self, p: Point, unit_nm: f64) -> bool {
        let off = |v: i64| {
            let steps = v as f64 * unit_nm / self.step_nm;
            (steps - steps.round()).abs() * self.step_nm > EQUAL_NM
        };
        off(p.x) || off(p.y)
    }

    /// The violation; with the remedy where the database unit of the design is finer than the grid.
    fn words_off(&self, what: &str, flat: &FlatLayout<'_>) -> String {
        let unit_nm = flat.design.map(|design| design.cell.database_unit.nm());
        let remedy = match unit_nm.filter(|&unit_nm| unit_nm < self.step_nm && unit_nm < 1.0) {
            Some(unit_nm) => {
                format!(
                    ": the database unit of the design is {unit_nm} nm; if the writer can, set `nm = {unit_nm}` in this rule"
                )
            }
            None => String::new(),
        };
        format!("a {what} off the grid of {} nm{remedy}", self.step_nm)
    }
}

impl Rule for GridRule {
    fn words(&self) -> String {
        format!("vertices are on a grid of {} nm", self.step_nm)
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        // Every place in database units is on the grid if the unit is a multiple of its step.
        let per_step = flat.unit_nm / self.step_nm;
        if (per_step - per_step.round()).abs() < ROUNDING_NM && per_step >= 0.5 {
            return Ok(());
        }
        for layer in &self.layers {
            if *layer == flat.pillars {
                self.pillars(flat, found);
            }
            let Some(loose) = flat.loose(*layer) else { continue };
            for k in 0..loose.rects.len() {
                let r = loose.rect(k);
                if self.off(Point::new(r.x0, r.y0), flat.unit_nm) || self.off(Point::new(r.x1, r.y1), flat.unit_nm) {
                    found.rect(&r, || self.words_off("corner", flat));
                }
            }
            for p in &loose.polygons {
                if p.iter().any(|&v| self.off(v, flat.unit_nm)) {
                    found.at(p, || self.words_off("vertex", flat));
                }
            }
        }
        Ok(())
    }
}

impl GridRule {
    fn pillars(&self, flat: &FlatLayout<'_>, found: &mut Findings) {
        for (k, e) in flat.elements.iter().enumerate() {
            e.widths.each_pillar(|row, column, _| {
                let r = flat.pillar(k, row, column);
                let tilted = match flat.body(k, row, column) {
                    Body::Tilted(ring) => ring.iter().any(|p| self.off(*p, flat.unit_nm)),
                    _ => false,
                };
                let ends = [Point::new(r.x0, r.y0), Point::new(r.x1, r.y1)];
                if tilted || ends.iter().any(|p| self.off(*p, flat.unit_nm)) {
                    found.rect(&r, || self.words_off("corner", flat));
                }
            });
        }
    }
}

/// The writer fills a pillar with whole steps of its beam, and goes from pillar to pillar in whole steps.
struct ExposureGrid {
    step_nm: f64,
}

impl ExposureGrid {
    fn remainder(&self, nm: f64) -> f64 {
        let steps = nm / self.step_nm;
        (steps - steps.round()) * self.step_nm
    }
}

impl Rule for ExposureGrid {
    fn words(&self) -> String {
        format!("pitch and widths are whole steps of a beam of {} nm", self.step_nm)
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        if flat.elements.is_empty() {
            return Err(NotRun::Skipped(flat.no_elements.clone()));
        }
        if flat.shape.axis_edges_nm(PillarId(1)).is_empty() {
            let why = "rotated rectangles have no edges along the steps of the beam".to_owned();
            return Err(NotRun::Skipped(why));
        }
        let (mut squares, mut sum) = (0u64, 0.0);
        let mut count = |width_nm: f64, pillars: u64| {
            squares += pillars;
            sum += pillars as f64 * self.remainder(width_nm).powi(2);
        };
        for (k, e) in flat.elements.iter().enumerate() {
            let pitch = f64::from(e.site.lattice.pitch_nm());
            if self.remainder(pitch).abs() > ROUNDING_NM {
                found.plain(&format!("{} pitch", e.site.name), || {
                    format!(
                        "{}: a pitch of {pitch} nm is no multiple of {} nm",
                        e.site.name, self.step_nm
                    )
                });
            }
            let row = e.site.lattice.row_nm();
            if row != pitch && self.remainder(row).abs() > ROUNDING_NM {
                found.plain(&format!("{} rows", e.site.name), || {
                    format!(
                        "{}: rows {row} nm apart are no multiple of {} nm",
                        e.site.name, self.step_nm
                    )
                });
            }
            let histogram = e.widths.histogram();
            let edges = |number: usize| {
                let edges_nm = flat.shape.axis_edges_nm(PillarId(number as u16));
                edges_nm.into_iter().map(f64::from).collect::<Vec<_>>()
            };
            let is_off = |nm: &f64| self.remainder(*nm).abs() > ROUNDING_NM;
            let off: Vec<bool> = (0..histogram.len())
                .map(|w| w > 0 && edges(w).iter().any(is_off))
                .collect();
            for (w, &pillars) in histogram.iter().enumerate().skip(1) {
                edges(w).into_iter().for_each(|nm| count(nm, pillars));
            }
            if !off.iter().any(|&o| o) {
                continue;
            }
            e.widths.each_pillar(|row, column, w| {
                if off[usize::from(w)] {
                    found.rect(&flat.pillar(k, row, column), || {
                        format!(
                            "{} is no multiple of {} nm",
                            flat.shape.words(PillarId(w)),
                            self.step_nm
                        )
                    });
                }
            });
        }
        if let Some(loose) = flat.loose(flat.pillars) {
            for k in 0..loose.rects.len() {
                let r = loose.rect(k);
                let width = r.width() as f64 * flat.unit_nm;
                count(width, 1);
                if self.remainder(width).abs() > EQUAL_NM {
                    found.rect(&r, || format!("{width} nm wide is no multiple of {} nm", self.step_nm));
                }
            }
        }
        let rms = if squares == 0 {
            0.0
        } else {
            (sum / squares as f64).sqrt()
        };
        found.facts.push(("rms change of width if snapped [nm]".into(), rms));
        Ok(())
    }
}
