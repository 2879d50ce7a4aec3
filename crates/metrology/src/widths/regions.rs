//! Fill around places: from a table of rectangles, or from the layout that was written.

use std::path::{Path, PathBuf};

use metalith_core::document::{Limits, Section};
use metalith_core::{LayerNumber, Progress, Result};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, extract};
use metalith_optics::RANGES_UM;
use metalith_pillars::PillarId;

use super::fill::{FilledRegion, rings_around};
use super::set::WidthSet;
use super::table::{Table, report};

/// Where the fill around a place comes from.
pub(super) enum Regions {
    None,
    Rectangles(Vec<FilledRegion>),
    Layout(PathBuf, LayerNumber),
}

impl Regions {
    /// The rectangles, where the fill is of some.
    pub(super) fn rectangles(&self) -> &[FilledRegion] {
        if let Self::Rectangles(own) = self { own } else { &[] }
    }
}

/// What a set says of the fill; `has_column` if the table states it.
pub(super) fn fill(root: &Section<'_, '_>, folder: &Path, set: &mut WidthSet, has_column: bool) -> Regions {
    let Some(s) = root.optional_section("fill") else {
        return Regions::None;
    };
    set.stated_range_um = s.optional_float("range_um", Limits::new(RANGES_UM, "um"));
    let regions = s.optional_text("regions").map(|file| folder.join(file));
    let layout = s.optional_text("layout").map(|file| folder.join(file));
    let layer = s.optional_array::<2>("layer", Limits::new(0.0..=32767.0, ""));
    if has_column && (regions.is_some() || layout.is_some()) || regions.is_some() && layout.is_some() {
        s.fault(
            "",
            "the fill comes from more than one source",
            "keep one of: a column, `regions`, `layout`",
        );
    }
    if set.stated_range_um.is_some() && !has_column {
        s.fault(
            "range_um",
            "the table has no column of the fill",
            "leave it out: the range is fitted",
        );
    }
    let found = match (regions, layout) {
        (Some(path), _) => Regions::Rectangles(rectangles(&path, &s)),
        (None, Some(path)) => {
            let [layer, datatype] = layer.unwrap_or([1.0, 0.0]).map(|n| n as u16);
            Regions::Layout(path, LayerNumber::new(layer, datatype))
        }
        (None, None) => Regions::None,
    };
    s.finish();
    found
}

/// Columns of a table of regions.
const REGION: [(&str, [f64; 2]); 5] = [
    ("x_um", [-1e6, 1e6]),
    ("y_um", [-1e6, 1e6]),
    ("width_um", [1e-3, 1e6]),
    ("height_um", [1e-3, 1e6]),
    ("fill", [0.0, 1.0]),
];

fn rectangles(path: &Path, s: &Section<'_, '_>) -> Vec<FilledRegion> {
    let Some(table) = Table::read(path, s, "regions") else {
        return Vec::new();
    };
    let hint = "columns: name, x_um, y_um (middle), width_um, height_um, fill";
    let mut faults = Vec::new();
    let places = REGION.map(|(name, _)| table.column(name));
    for ((name, _), place) in REGION.iter().zip(places) {
        if place.is_none() {
            faults.push(format!("{}: there is no column `{name}`", path.display()));
        }
    }
    let mut out = Vec::new();
    for row in 0..table.rows.len() {
        let mut numbers = [0.0; 5];
        for (k, (_, range)) in REGION.iter().enumerate() {
            match places[k].map(|place| table.number(row, place, *range)) {
                Some(Ok(v)) => numbers[k] = v,
                Some(Err(what)) => faults.push(what),
                None => {}
            }
        }
        let [x, y, width, height, fill] = numbers;
        out.push(FilledRegion {
            name: table
                .column("name")
                .map_or_else(String::new, |k| table.rows[row].1[k].clone()),
            at_um: [x, y],
            size_um: [width, height],
            fill,
        });
    }
    report(faults, s, "regions", hint);
    out
}

/// Most pillars of a layout around places.
const MOST_PILLARS: usize = 20_000_000;

/// Surround the places of a set by the pillars of a layout.
pub(super) fn layout_fill(
    path: &Path,
    layer: LayerNumber,
    set: &mut WidthSet,
    root: &Section<'_, '_>,
    progress: &dyn Progress,
) {
    let s = root.section("fill");
    let fault = |what: String| {
        s.fault(
            "layout",
            what,
            "give the layout that was written, with its pillar layer in `layer`",
        );
    };
    let read = || -> Result<_> {
        Ok(extract(
            &Layout::open(path)?,
            &ExtractionPlan::discover(layer),
            progress,
        )?)
    };
    let found = match read() {
        Ok(found) => found,
        Err(error) => return fault(error.to_string()),
    };
    if found.pillars > MOST_PILLARS as u64 {
        return fault(format!("the layout has more than {MOST_PILLARS} pillars"));
    }
    let mut pillars = Vec::new();
    let mut means: Vec<([f64; 2], f64, f64)> = Vec::new();
    for element in &found.elements {
        let lattice = element.site.lattice;
        let centre = element.site.centre_nm.map(|nm| 1e-3 * nm as f64);
        let first = pillars.len();
        for ((iy, ix), &number) in element.widths.number.indexed_iter().filter(|(_, n)| **n > 0) {
            let at = [centre[0] + lattice.place_um(0, ix), centre[1] + lattice.place_um(1, iy)];
            pillars.push((at, 1e-6 * found.shape.area_nm2(PillarId(number))));
        }
        let area: f64 = pillars[first..].iter().map(|(_, area)| area).sum();
        let cells = (pillars.len() - first).max(1) as f64 * lattice.cell_um2();
        means.push((centre, element.widths.circle_um(), area / cells));
    }
    let places: Vec<[f64; 2]> = set.sites.iter().filter_map(|s| s.at_um).collect();
    if places.len() < set.sites.len() {
        return fault("the table has no places: columns x_um and y_um".into());
    }
    for (site, around) in set.sites.iter_mut().zip(rings_around(&places, &pillars)) {
        let at = site.at_um.unwrap_or_default();
        let inside = means
            .iter()
            .find(|(c, radius, _)| (c[0] - at[0]).hypot(c[1] - at[1]) <= *radius);
        site.loading = site.loading.or(inside.map(|(.., mean)| *mean));
        site.surroundings = Some(around);
    }
}
