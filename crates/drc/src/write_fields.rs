//! Write fields: a shape that a field boundary cuts is exposed in two parts, with a stitching error of some nanometres.

use super::context::Context;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::rule::{NotRun, Rule, RuleOutcome};
use super::tolerance::ROUNDING_NM;
use metalith_core::document::{Limits, Section};
use metalith_gds::Rect;
use metalith_gds::extract::{ExtractedElement, StoredPillars};
use metalith_pillars::PillarRows;
use metalith_report::exact;

/// Multiples of the pitch that are tried on either side of the size of a field that cuts pillars.
const SIZES_TRIED: u32 = 8;

/// Fields of one size, in a grid about the centre of each element or of the layout.
struct FieldRule {
    size_nm: f64,
    offset_nm: [f64; 2],
    about_elements: bool,
    want: BoundaryRule,
}

#[derive(PartialEq)]
enum BoundaryRule {
    NoCut,
    NoBoundary,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, _context: &Context) -> Option<Box<dyn Rule>> {
    let want = match check {
        "field_cut" => BoundaryRule::NoCut,
        "field_in_lens" => BoundaryRule::NoBoundary,
        _ => return None,
    };
    let offset = s
        .optional_array("offset_um", Limits::new(-1e5..=1e5, "um"))
        .unwrap_or([0.0; 2]);
    Some(Box::new(FieldRule {
        size_nm: 1e3 * s.float("field_um", Limits::new(1.0..=1e5, "um")),
        offset_nm: offset.map(|v| v * 1e3),
        about_elements: s.choice("about", &[("elements", true), ("layout", false)], Some(true)),
        want,
    }))
}

impl FieldRule {
    /// Boundaries between two places of an axis (nm), the middle of a field being at `centre`.
    fn boundaries(&self, axis: usize, centre: f64, from: f64, to: f64) -> impl Iterator<Item = f64> + use<> {
        let first = centre + self.offset_nm[axis] + self.size_nm / 2.0;
        let size = self.size_nm;
        let (low, high) = (
            ((from - first) / size).floor() as i64,
            ((to - first) / size).ceil() as i64,
        );
        (low..=high)
            .map(move |k| first + k as f64 * size)
            .filter(move |&b| b > from && b < to)
    }

    fn centre(&self, centre_nm: [i64; 2]) -> [f64; 2] {
        if self.about_elements {
            centre_nm.map(|c| c as f64)
        } else {
            [0.0; 2]
        }
    }

    /// Rows or columns whose pillars could reach over a boundary, with the boundary's distance from them: pillars are at most a
    /// pitch wide, and on a hexagonal lattice more lines than the nearest are within half of that.
    fn reaching(&self, flat: &FlatLayout<'_>, element: usize, axis: usize) -> Vec<(usize, f64)> {
        let lattice = flat.elements[element].site.lattice;
        self.lines(flat, element, axis, i64::from(!lattice.is_square()))
    }

    /// Rows or columns nearest to boundaries, and so many on either side, with the boundary's distance from them.
    fn lines(&self, flat: &FlatLayout<'_>, element: usize, axis: usize, beside: i64) -> Vec<(usize, f64)> {
        let site = &flat.elements[element].site;
        let (lattice, centre) = (site.lattice, self.centre(site.centre_nm));
        let (pitch, step) = (f64::from(lattice.pitch_nm()), lattice.steps_nm()[axis]);
        let first = site.centre_nm[axis] as f64 + lattice.place_nm(axis, 0);
        let (most, last) = (lattice.sites() - 1, first + (lattice.sites() - 1) as f64 * step);
        self.boundaries(axis, centre[axis], first - pitch / 2.0, last + pitch / 2.0)
            .flat_map(|b| {
                let nearest = ((b - first) / step).round().clamp(0.0, most as f64);
                (-beside..=beside)
                    .map(move |k| nearest + k as f64)
                    .filter(move |line| (0.0..=most as f64).contains(line))
                    .map(move |line| (line as usize, (b - first - line * step).abs()))
            })
            .collect()
    }

    /// True if no boundary comes nearer to the middle of a row or column than half the widest pillar of the element.
    fn is_between_pillars(&self, flat: &FlatLayout<'_>) -> bool {
        flat.elements.iter().enumerate().all(|(k, e)| {
            let numbers = e.widths.histogram().len();
            let halves = (0..numbers as u16).map(|number| flat.half_nm(number));
            let widest = halves.fold([0.0, 0.0], |most, half| [0, 1].map(|a| f64::max(most[a], half[a])));
            (0..2).all(|axis| {
                let mut lines = self.reaching(flat, k, axis).into_iter();
                lines.all(|(_, distance)| distance >= widest[axis] - ROUNDING_NM)
            })
        })
    }

    /// The nearest smaller and larger size of which no boundary cuts a pillar on a lattice (um): multiples of a step of the
    /// lattice.
    fn sizes_between_pillars(&self, flat: &FlatLayout<'_>) -> Vec<f64> {
        let Some(first) = flat.elements.first() else {
            return Vec::new();
        };
        let pitch = first.site.lattice.pitch_nm().nm();
        let steps = self.size_nm / pitch;
        let with = |steps: f64| Self {
            size_nm: steps * pitch,
            offset_nm: self.offset_nm,
            about_elements: self.about_elements,
            want: BoundaryRule::NoCut,
        };
        let fits = |steps: &f64| *steps >= 1.0 && with(*steps).is_between_pillars(flat);
        let below = (0..SIZES_TRIED).map(|k| steps.floor() - f64::from(k)).find(fits);
        let above = (0..SIZES_TRIED).map(|k| steps.ceil() + f64::from(k)).find(fits);
        let um = |steps: f64| steps * pitch * 1e-3;
        below.into_iter().chain(above).map(um).collect()
    }

    /// The violation, with sizes that have none.
    fn words_cut(&self, flat: &FlatLayout<'_>) -> String {
        let sizes = self.sizes_between_pillars(flat);
        let sizes: Vec<String> = sizes.into_iter().map(exact).collect();
        if sizes.is_empty() {
            return "cut by a field boundary".into();
        }
        format!(
            "cut by a field boundary: fields of {} um, multiples of the pitch, cut no pillar",
            sizes.join(" or ")
        )
    }

    fn cut_on_lattices(&self, flat: &FlatLayout<'_>, found: &mut Findings) {
        let mut said: Option<String> = None;
        for (k, e) in flat.elements.iter().enumerate() {
            let columns = self.reaching(flat, k, 0);
            let rows = self.reaching(flat, k, 1);
            let (n, mut room) = (e.site.lattice.sites(), Vec::new());
            let cut = |w: u16, axis: usize, distance: f64| w != 0 && distance < flat.half_nm(w)[axis] - ROUNDING_NM;
            let mut words = || said.get_or_insert_with(|| self.words_cut(flat)).clone();
            for &(column, distance) in &columns {
                for row in (0..n).filter(|&row| cut(e.widths.number(column, row), 0, distance)) {
                    found.rect(&flat.pillar(k, row, column), &mut words);
                }
            }
            for &(row, distance) in &rows {
                let line = e.widths.row(row, 0..n, &mut room).iter();
                for (column, &w) in line.enumerate().filter(|(_, w)| cut(**w, 1, distance)) {
                    if !columns.iter().any(|&(c, d)| c == column && cut(w, 0, d)) {
                        found.rect(&flat.pillar(k, row, column), &mut words);
                    }
                }
            }
        }
    }

    /// Shapes off every lattice, by the fields of the nearest element.
    fn cut_loose(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        let Some(loose) = flat.loose(flat.pillars) else {
            return Ok(());
        };
        flat.work
            .spend(loose.len().saturating_mul(1 + flat.elements.len() as u64))?;
        for r in loose.bounds() {
            let nm = |v: i64| v as f64 * flat.unit_nm;
            let middle = [nm(r.x0 + r.x1) / 2.0, nm(r.y0 + r.y1) / 2.0];
            let nearest = flat.elements.iter().min_by(|a, b| {
                let far = |e: &ExtractedElement<StoredPillars>| {
                    let c = e.site.centre_nm;
                    (c[0] as f64 - middle[0]).hypot(c[1] as f64 - middle[1])
                };
                far(a).total_cmp(&far(b))
            });
            let centre = nearest.map_or([0.0; 2], |e| self.centre(e.site.centre_nm));
            let cut = self.boundaries(0, centre[0], nm(r.x0), nm(r.x1)).next().is_some()
                || self.boundaries(1, centre[1], nm(r.y0), nm(r.y1)).next().is_some();
            if cut {
                found.rect(&r, || "cut by a field boundary".into());
            }
        }
        Ok(())
    }
}

impl Rule for FieldRule {
    fn words(&self) -> String {
        let um = self.size_nm * 1e-3;
        match self.want {
            BoundaryRule::NoCut => format!("no pillar is cut by a boundary of the {um} um fields"),
            BoundaryRule::NoBoundary => format!("no boundary of the {um} um fields runs through a lens"),
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        if flat.elements.is_empty() && (self.about_elements || self.want == BoundaryRule::NoBoundary) {
            return Err(NotRun::Skipped(flat.no_elements.clone()));
        }
        if self.want == BoundaryRule::NoCut {
            self.cut_on_lattices(flat, found);
            return self.cut_loose(flat, found);
        }
        for (k, e) in flat.elements.iter().enumerate() {
            // Small lenses stand in the middle of the lattice of the largest.
            let n = e.site.lattice.sites();
            let columns = self.lines(flat, k, 0, 0).into_iter();
            let columns = columns.filter(|&(column, _)| (0..n).any(|row| e.widths.number(column, row) != 0));
            let rows = self.lines(flat, k, 1, 0).into_iter();
            let rows = rows.filter(|&(row, _)| (0..n).any(|column| e.widths.number(column, row) != 0));
            let lines = columns.count() + rows.count();
            if lines > 0 {
                let half = e.site.lattice.place_nm(0, 0).abs() + e.site.lattice.pitch_nm().nm() / 2.0;
                let unit = |nm: f64| flat.units(nm).round() as i64;
                let c = e.site.centre_nm.map(|c| c as f64);
                let lens = Rect {
                    x0: unit(c[0] - half),
                    y0: unit(c[1] - half),
                    x1: unit(c[0] + half),
                    y1: unit(c[1] + half),
                };
                found.rect(&lens, || {
                    format!("{lines} field boundaries run through {}", e.site.name)
                });
            }
        }
        Ok(())
    }
}
