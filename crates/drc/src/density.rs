//! Fill factor of pillars, which determines the backscattered dose.

use super::context::Context;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::rule::{NotRun, Rule, RuleOutcome};
use metalith_core::document::{Limits, Section};
use metalith_design::Design;
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_gds::{Point, Rect};
use metalith_pillars::{Lattice, PillarId, PillarRows};

struct FillRule {
    window_um: f64,
    want: FillLimit,
}

enum FillLimit {
    Between([f64; 2]),
    Gradient(f64),
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, _context: &Context) -> Option<Box<dyn Rule>> {
    let share = || Limits::new(0.0..=1.0, "of the area");
    let want = match check {
        "fill" => FillLimit::Between(s.array("range", share())),
        "fill_gradient" => FillLimit::Gradient(s.float("max", share())),
        _ => return None,
    };
    Some(Box::new(FillRule {
        window_um: s.float("window_um", Limits::new(1.0..=10_000.0, "um")),
        want,
    }))
}

/// The windows of one element, a whole number of columns and rows wide, one of them in the middle.
struct Windows {
    /// Columns and rows of a window.
    sites: [usize; 2],
    /// The first column and row of the first window.
    first: [usize; 2],
    /// Windows along x and y.
    count: [usize; 2],
    /// Share of area that is pillar, row by row; none where a site is empty.
    fill: Vec<Option<f64>>,
}

impl Windows {
    fn of(flat: &FlatLayout<'_>, element: usize, window_um: f64) -> Self {
        let e = &flat.elements[element];
        let lattice = e.site.lattice;
        let n = lattice.sites();
        let (mut sites, mut first, mut count) = ([0; 2], [0; 2], [0; 2]);
        for (axis, step) in lattice.steps_nm().into_iter().enumerate() {
            let own = ((window_um / (step * 1e-3)) as usize).max(1);
            // Windows on each side of the middle one.
            let beside = (n as i64 - own as i64).max(-1).div_euclid(2 * own as i64);
            sites[axis] = own;
            first[axis] = ((n as i64 - own as i64) / 2 - beside * own as i64).max(0) as usize;
            count[axis] = if n < own { 0 } else { (2 * beside + 1) as usize };
        }
        // Squared widths of the pillars of each window (nm^2); none where a site is empty.
        let mut areas: Vec<Option<u64>> = vec![Some(0); count[0] * count[1]];
        let mut room = Vec::new();
        let rows = if count[0] == 0 { 0 } else { count[1] * sites[1] };
        for k in 0..rows {
            let iy = first[1] + k;
            let row = e.widths.row(iy, first[0]..first[0] + count[0] * sites[0], &mut room);
            let windows = &mut areas[k / sites[1] * count[0]..][..count[0]];
            for (j, (area, part)) in windows.iter_mut().zip(row.chunks(sites[0])).enumerate() {
                let ix = first[0] + j * sites[0];
                let full = (ix..).zip(part).all(|(ix, &w)| w != 0 || !lattice.has(ix, iy));
                let more: u64 = part.iter().map(|&w| flat.shape.box_nm2(PillarId(w))).sum();
                *area = area.filter(|_| full).map(|area| area + more);
            }
        }
        // On a square lattice the square of one number, to the last bit.
        let [wide, high] = [0, 1].map(|axis| sites[axis] as f64 * (lattice.steps_nm()[axis] * 1e-3) * 1e3);
        let share = |area: u64| area as f64 * flat.shape.area_share() / (wide * high);
        let fill = areas.into_iter().map(|area| area.map(share)).collect();
        Self {
            sites,
            first,
            count,
            fill,
        }
    }

    /// True if any of them is full where all sites of an element have pillars.
    fn any_within(&self, phase: &ElementPhase<'_>) -> bool {
        let lattice = phase.lattice();
        (0..self.fill.len()).any(|k| {
            let place = [k % self.count[0], k / self.count[0]];
            let [columns, rows] = [0, 1].map(|axis| {
                let first = self.first[axis] + place[axis] * self.sites[axis];
                first..first + self.sites[axis]
            });
            let full = |iy| columns.clone().all(|ix| !lattice.has(ix, iy) || phase.holds(ix, iy));
            rows.into_iter().all(full)
        })
    }

    /// True if the one in the middle is within a circle about the centres of the pillars (um).
    fn middle_within(&self, lattice: Lattice, radius_um: f64) -> bool {
        let half = |axis: usize| 0.5 * (self.sites[axis] - 1) as f64 * lattice.steps_um()[axis];
        !self.fill.is_empty() && half(0).hypot(half(1)) <= radius_um
    }

    /// The area of window `k`.
    fn place(&self, flat: &FlatLayout<'_>, element: usize, k: usize) -> Rect {
        let site = &flat.elements[element].site;
        let steps = site.lattice.steps_nm();
        let corner = |axis: usize, at: usize| {
            let first = (self.first[axis] + at * self.sites[axis]) as f64;
            site.centre_nm[axis] as f64 + site.lattice.place_nm(axis, 0) + first * steps[axis] - steps[axis] / 2.0
        };
        let unit = |nm: f64| flat.units(nm).round() as i64;
        let (x, y) = (corner(0, k % self.count[0]), corner(1, k / self.count[0]));
        let size = [0, 1].map(|axis| self.sites[axis] as f64 * steps[axis]);
        let mut r = Rect::EMPTY;
        r.include(Point::new(unit(x), unit(y)));
        r.include(Point::new(unit(x + size[0]), unit(y + size[1])));
        r
    }
}

impl FillRule {
    /// True if an element would hold a full window if none of its pillars were missing: by the sites of the design, or
    /// else by the circle about the pillars that there are.
    fn could_run(&self, flat: &FlatLayout<'_>) -> bool {
        let lens = flat.design.map(LensPhase::of);
        let designed = flat.design.map_or_else(Vec::new, Design::elements);
        (0..flat.elements.len()).any(|k| {
            let windows = Windows::of(flat, k, self.window_um);
            let own = &flat.elements[k];
            match (&lens, designed.get(k)) {
                (Some(lens), Some(element)) => windows.any_within(&ElementPhase::of(lens, element)),
                _ => windows.middle_within(own.site.lattice, own.widths.circle_um()),
            }
        })
    }
}

impl Rule for FillRule {
    fn words(&self) -> String {
        let window = self.window_um;
        match self.want {
            FillLimit::Between([a, b]) => format!("{a} to {b} of every window of {window} um inside a lens is pillar"),
            FillLimit::Gradient(max) => {
                format!("the fill of neighbouring windows of {window} um differs by at most {max}")
            }
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        if flat.elements.is_empty() {
            return Err(NotRun::Skipped(flat.no_elements.clone()));
        }
        let (mut windows, mut low, mut high, mut steepest) = (0u64, f64::INFINITY, 0.0f64, 0.0f64);
        for element in 0..flat.elements.len() {
            let all = Windows::of(flat, element, self.window_um);
            for k in 0..all.fill.len() {
                let Some(fill) = all.fill[k] else { continue };
                windows += 1;
                (low, high) = (low.min(fill), high.max(fill));
                match self.want {
                    FillLimit::Between([a, b]) if fill < a || fill > b => {
                        found.rect(&all.place(flat, element, k), || {
                            format!("{fill:.4} of the area is pillar")
                        });
                    }
                    FillLimit::Gradient(max) => {
                        let across = all.count[0];
                        let right = (k % across + 1 < across).then_some(k + 1);
                        for other in right.into_iter().chain(Some(k + across)) {
                            let Some(&Some(beside)) = all.fill.get(other) else {
                                continue;
                            };
                            steepest = steepest.max((fill - beside).abs());
                            if (fill - beside).abs() > max {
                                let mut both = all.place(flat, element, k);
                                both.unite(&all.place(flat, element, other));
                                found.rect(&both, || format!("fill from {fill:.4} to {beside:.4}"));
                            }
                        }
                    }
                    FillLimit::Between(_) => {}
                }
            }
        }
        if windows == 0 {
            let window = self.window_um;
            return Err(if self.could_run(flat) {
                NotRun::Skipped(format!(
                    "no element holds a full window of {window} um: pillars are missing"
                ))
            } else {
                NotRun::NotApplicable(format!("no element is large enough for a window of {window} um"))
            });
        }
        match self.want {
            FillLimit::Between(_) => found
                .facts
                .extend([("least fill".into(), low), ("largest fill".into(), high)]),
            FillLimit::Gradient(_) => found.facts.push(("largest step of fill".into(), steepest)),
        }
        Ok(())
    }
}
