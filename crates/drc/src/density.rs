//! Fill factor of pillars, which determines the backscattered dose.

use super::context::Context;
use super::findings::Findings;
use super::flat::FlatLayout;
use super::rule::{NotRun, Rule, RuleOutcome};
use metalith_core::WidthRows;
use metalith_core::document::{Limits, Section};
use metalith_gds::{Point, Rect};

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

/// The windows of one element, a whole number of sites wide, one of them in the middle.
struct Windows {
    sites: usize,
    first: i64,
    count: usize,
    /// Share of area that is pillar, row by row; none where a site is empty.
    fill: Vec<Option<f64>>,
}

impl Windows {
    fn of(flat: &FlatLayout<'_>, element: usize, window_um: f64) -> Self {
        let e = &flat.elements[element];
        let pitch = e.site.lattice.pitch_um();
        let (n, sites) = (e.site.lattice.sites(), ((window_um / pitch) as usize).max(1));
        // Windows on each side of the middle one.
        let beside = (n as i64 - sites as i64).max(-1).div_euclid(2 * sites as i64);
        let first = (n as i64 - sites as i64) / 2 - beside * sites as i64;
        let count = if n < sites { 0 } else { (2 * beside + 1) as usize };
        // Squared widths of the pillars of each window (nm^2); none where a site is empty.
        let mut areas: Vec<Option<u64>> = vec![Some(0); count * count];
        let mut room = Vec::new();
        for k in 0..count * sites {
            let row = e.widths.row(
                first as usize + k,
                first as usize..first as usize + count * sites,
                &mut room,
            );
            let windows = &mut areas[k / sites * count..][..count];
            for (area, part) in windows.iter_mut().zip(row.chunks(sites)) {
                let full = part.iter().all(|&w| w != 0);
                let more: u64 = part.iter().map(|&w| flat.shape.square_nm2(w)).sum();
                *area = area.filter(|_| full).map(|area| area + more);
            }
        }
        let share = |area: u64| area as f64 * flat.shape.area_share() / (sites as f64 * pitch * 1e3).powi(2);
        let fill = areas.into_iter().map(|area| area.map(share)).collect();
        Self {
            sites,
            first,
            count,
            fill,
        }
    }

    /// The area of window `k`.
    fn place(&self, flat: &FlatLayout<'_>, element: usize, k: usize) -> Rect {
        let site = &flat.elements[element].site;
        let pitch = i64::from(site.lattice.pitch_nm());
        let corner = |axis: usize, at: usize| {
            let first = self.first + (at * self.sites) as i64;
            site.centre_nm[axis] + site.lattice.coordinate_nm(0) + first * pitch - pitch / 2
        };
        let unit = |nm: i64| flat.units(nm as f64).round() as i64;
        let (x, y) = (corner(0, k % self.count), corner(1, k / self.count));
        let size = self.sites as i64 * pitch;
        let mut r = Rect::EMPTY;
        r.include(Point::new(unit(x), unit(y)));
        r.include(Point::new(unit(x + size), unit(y + size)));
        r
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
                        let right = (k % all.count + 1 < all.count).then_some(k + 1);
                        for other in right.into_iter().chain(Some(k + all.count)) {
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
            return Err(NotRun::Skipped(format!(
                "no element holds a full window of {} um",
                self.window_um
            )));
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
