//! A set of kind `widths`: tables of drawn and measured widths.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use metalith_core::document::{Document, Limits, Section, load};
use metalith_core::text::quoted;
use metalith_core::{LayerNumber, Progress, Result};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractionPlan, extract};
use metalith_optics::RANGES_UM;
use metalith_pillars::PillarId;

use super::fill::{FilledRegion, Surroundings, own_fill, rings_around};
use super::table::{Table, report};

/// A pillar or line that was measured once or several times, at one dose.
#[derive(Clone, Debug)]
pub struct WidthSite {
    pub drawn_nm: f64,
    pub at_um: Option<[f64; 2]>,
    /// Number of its place or pad.
    pub place: usize,
    /// Change of the dose from the nominal one (%).
    pub dose_percent: f64,
    /// Cosine of twice the angle of the measured width from x: 1 along x, -1 along y, 0 if not stated.
    pub along: f64,
    pub(super) surroundings: Option<Surroundings>,
    /// Open area, or fill of the region that it is in.
    pub loading: Option<f64>,
    pub group: usize,
    /// True if it is fitted; if not, it judges.
    pub fitted: bool,
    /// Measured widths of its repeats (nm).
    pub measured_nm: Vec<f64>,
}

/// Write fields of the writer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WriteField {
    pub size_um: f64,
    /// A corner where four fields meet (um).
    pub corner_um: [f64; 2],
}

/// A set of widths.
#[derive(Clone, Debug)]
pub struct WidthSet {
    pub title: String,
    pub sites: Vec<WidthSite>,
    /// Number of places or pads; zero if the table has none.
    pub places: usize,
    pub field: Option<WriteField>,
    /// Name of the groups, and their names.
    pub groups: Option<(String, Vec<String>)>,
    /// Range over which the column of the fill was averaged (um), where it is stated.
    pub stated_range_um: Option<f64>,
}

impl WidthSet {
    /// Read a set from its `measurement.toml`.
    ///
    /// # Errors
    /// All mistakes of the text and of the tables that it names; if the user stopped it.
    pub fn read(path: &Path, progress: &dyn Progress) -> Result<Self> {
        let text = load(path)?;
        let read = Document::read(path, &text, |root| sections(path, root, progress))?;
        progress.check_stopped()?;
        Ok(read)
    }

    /// Root mean square by which repeats differ from their mean, for single measurements (nm); none without repeats.
    pub fn repeat_rms(&self) -> Option<f64> {
        let own = self.sites.iter().map(|s| {
            let mean = s.mean_nm();
            let squares: f64 = s.measured_nm.iter().map(|v| (v - mean).powi(2)).sum();
            (squares, s.measured_nm.len() - 1)
        });
        let (squares, degrees) = own.fold((0.0, 0), |(a, n), (b, m)| (a + b, n + m));
        (degrees > 0).then(|| (squares / degrees as f64).sqrt())
    }
}

impl WidthSite {
    /// Mean of the repeats (nm).
    pub fn mean_nm(&self) -> f64 {
        self.measured_nm.iter().sum::<f64>() / self.measured_nm.len() as f64
    }
}

/// Columns by their place in the table.
struct Columns {
    drawn: Option<usize>,
    /// Columns of measured widths, each with [`WidthSite::along`] where it is of one direction.
    measured: Vec<(usize, Option<f64>)>,
    at: Option<[usize; 2]>,
    pad: Option<usize>,
    dose: Option<usize>,
    orientation: Option<usize>,
    fill: Option<usize>,
    open_area: Option<usize>,
}

impl Columns {
    fn of(root: &Section<'_, '_>, table: &Table) -> Self {
        let s = root.section_or_none("columns");
        let find = |key: &str, default: &str| {
            let stated = s.optional_text(key);
            let found = table.column(stated.as_deref().unwrap_or(default));
            if let (Some(name), None) = (&stated, found) {
                let known = table.names.join(", ");
                s.fault(
                    key,
                    format!("the table has no column `{}`", quoted(name)),
                    format!("columns there: {known}"),
                );
            }
            found
        };
        let (x, y) = (find("x", "x_um"), find("y", "y_um"));
        let measured = [
            ("measured", "measured_nm", None),
            ("measured_x", "measured_x_nm", Some(1.0)),
            ("measured_y", "measured_y_nm", Some(-1.0)),
        ];
        let own = Self {
            drawn: find("drawn", "drawn_nm"),
            measured: measured
                .into_iter()
                .filter_map(|(key, name, along)| Some((find(key, name)?, along)))
                .collect(),
            at: x.zip(y).map(|(x, y)| [x, y]),
            pad: find("pad", "pad"),
            dose: find("dose", "dose"),
            orientation: find("orientation", "orientation"),
            fill: find("fill", "fill"),
            open_area: find("open_area", "open_area"),
        };
        // Rows that agree in all else are repeats: their number says nothing more.
        find("repeat", "repeat");
        s.finish();
        own
    }
}

fn sections(path: &Path, root: &Section<'_, '_>, progress: &dyn Progress) -> WidthSet {
    root.integer("schema", 1..=1, "");
    root.choice("kind", &[("widths", ())], None);
    let mut set = WidthSet {
        title: root.text("title"),
        sites: Vec::new(),
        places: 0,
        field: None,
        groups: None,
        stated_range_um: None,
    };
    let folder = crate::run::folder_of(path, root);
    set.field = root.optional_section("field").map(|s| {
        let own = WriteField {
            size_um: s.float("size_um", Limits::new(1.0..=1e5, "um")),
            corner_um: s
                .optional_array("corner_um", Limits::new(-1e6..=1e6, "um"))
                .unwrap_or([0.0; 2]),
        };
        s.finish();
        own
    });
    let s = root.section("table");
    let file = folder.join(s.text("file"));
    let table = s.has("file").then(|| Table::read(&file, &s, "file")).flatten();
    s.finish();
    let Some(table) = table else {
        // What else is wrong is found as soon as there is a table.
        root.accept_others();
        return set;
    };
    let columns = Columns::of(root, &table);
    for (key, found) in [
        ("drawn_nm", columns.drawn.is_some()),
        ("measured_nm", !columns.measured.is_empty()),
    ] {
        if !found {
            let known = table.names.join(", ");
            s.fault(
                "file",
                format!("the table has no column `{key}`"),
                format!("name it in [columns]; columns there: {known}"),
            );
        }
    }
    let nominal = root.section_or_none("dose");
    let nominal_dose = nominal.optional_float("nominal", Limits::new(1e-6..=1e9, ""));
    nominal.finish();
    let (by, not_fitted) = groups(root, &table);
    let regions = fill(root, &folder, &mut set, &columns, progress);
    if let (Some(drawn), false) = (columns.drawn, columns.measured.is_empty()) {
        rows(&table, &columns, drawn, &s, by, &mut set, &regions, nominal_dose);
    }
    let group = root.section_or_none("groups");
    if let Some((name, known)) = &set.groups {
        for value in &not_fitted {
            match known.iter().position(|k| k == value) {
                Some(g) => set
                    .sites
                    .iter_mut()
                    .filter(|s| s.group == g)
                    .for_each(|s| s.fitted = false),
                None => group.fault(
                    "not_fitted",
                    format!("no {name} is `{}`", quoted(value)),
                    format!("groups here: {}", known.join(", ")),
                ),
            }
        }
    }
    let fitted = set.sites.iter().filter(|s| s.fitted).count();
    if s.sound(&["table.file"]) && fitted < FEWEST {
        s.fault(
            "file",
            format!("{fitted} sites are fitted"),
            format!("give {FEWEST} or more, of different width, place or dose"),
        );
    }
    if let Regions::Layout(layout, layer) = regions {
        layout_fill(&layout, layer, &mut set, root, progress);
    }
    set
}

/// Fewest sites that are fitted: an interval of fewer says nothing.
const FEWEST: usize = 6;

fn groups(root: &Section<'_, '_>, table: &Table) -> (Option<(String, usize)>, Vec<String>) {
    let Some(s) = root.optional_section("groups") else {
        return (None, Vec::new());
    };
    let by = s.text("by");
    let not_fitted = s.texts("not_fitted");
    let column = table.column(&by);
    if column.is_none() && !by.is_empty() {
        let known = table.names.join(", ");
        s.fault(
            "by",
            format!("the table has no column `{}`", quoted(&by)),
            format!("columns there: {known}"),
        );
    }
    s.finish();
    (column.map(|c| (by, c)), not_fitted)
}

/// Where the fill around a place comes from.
enum Regions {
    None,
    Rectangles(Vec<FilledRegion>),
    Layout(PathBuf, LayerNumber),
}

fn fill(root: &Section<'_, '_>, folder: &Path, set: &mut WidthSet, columns: &Columns, _: &dyn Progress) -> Regions {
    let Some(s) = root.optional_section("fill") else {
        return Regions::None;
    };
    set.stated_range_um = s.optional_float("range_um", Limits::new(RANGES_UM, "um"));
    let regions = s.optional_text("regions").map(|file| folder.join(file));
    let layout = s.optional_text("layout").map(|file| folder.join(file));
    let layer = s.optional_array::<2>("layer", Limits::new(0.0..=32767.0, ""));
    if columns.fill.is_some() && (regions.is_some() || layout.is_some()) || regions.is_some() && layout.is_some() {
        s.fault(
            "",
            "the fill comes from more than one source",
            "keep one of: a column, `regions`, `layout`",
        );
    }
    if set.stated_range_um.is_some() && columns.fill.is_none() {
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

/// Widths, places and doses that a table may have.
const WIDTHS_NM: [f64; 2] = [1.0, 1e6];
const PLACES_UM: [f64; 2] = [-1e6, 1e6];
const DOSES: [f64; 2] = [1e-6, 1e9];

/// A row as it was read, by which its repeats are found.
struct Row {
    key: String,
    site: WidthSite,
    dose: Option<f64>,
    group: String,
}

#[allow(clippy::too_many_arguments)]
fn rows(
    table: &Table,
    columns: &Columns,
    drawn: usize,
    s: &Section<'_, '_>,
    by: Option<(String, usize)>,
    set: &mut WidthSet,
    regions: &Regions,
    nominal: Option<f64>,
) {
    let rectangles: &[FilledRegion] = if let Regions::Rectangles(own) = regions {
        own
    } else {
        &[]
    };
    let (mut faults, mut found, mut places) = (Vec::new(), Vec::new(), BTreeMap::new());
    for row in 0..table.rows.len() {
        match of_row(table, row, columns, drawn, by.as_ref().map(|(_, c)| *c), rectangles) {
            Ok(own) => found.extend(own),
            Err(own) => faults.extend(own),
        }
    }
    if !faults.is_empty() {
        report(
            faults,
            s,
            "file",
            "correct these rows, or leave the measured width empty",
        );
        return;
    }
    let mut doses: Vec<f64> = found.iter().filter_map(|r| r.dose).collect();
    doses.sort_by(f64::total_cmp);
    let nominal = nominal.or_else(|| doses.get(doses.len() / 2).copied()).unwrap_or(1.0);
    let mut names: Vec<String> = found.iter().map(|r| r.group.clone()).collect();
    names.sort();
    names.dedup();
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    for row in found {
        if let Some(&at) = known.get(&row.key) {
            set.sites[at].measured_nm.extend(row.site.measured_nm);
            continue;
        }
        known.insert(row.key.clone(), set.sites.len());
        let place = row.key.split('|').next().unwrap_or("").to_owned();
        let next = places.len();
        let place = *places.entry(place).or_insert(next);
        let group = names.iter().position(|n| *n == row.group).unwrap_or(0);
        set.sites.push(WidthSite {
            place,
            group,
            dose_percent: row.dose.map_or(0.0, |dose| 100.0 * (dose / nominal - 1.0)),
            ..row.site
        });
    }
    set.places = if columns.at.is_some() || columns.pad.is_some() {
        places.len()
    } else {
        0
    };
    set.groups = by.map(|(name, _)| (name, names));
}

/// The sites of a row, one for each measured width; all that is wrong with it.
fn of_row(
    table: &Table,
    row: usize,
    columns: &Columns,
    drawn: usize,
    group: Option<usize>,
    regions: &[FilledRegion],
) -> std::result::Result<Vec<Row>, Vec<String>> {
    let fields = &table.rows[row].1;
    let mut faults = Vec::new();
    let mut number = |column: usize, range| {
        table.number(row, column, range).unwrap_or_else(|what| {
            faults.push(what);
            range[0]
        })
    };
    let measured = columns.measured.iter().filter(|(c, _)| !fields[*c].is_empty());
    let measured: Vec<(f64, Option<f64>)> = measured.map(|(c, along)| (number(*c, WIDTHS_NM), *along)).collect();
    if measured.is_empty() {
        return Ok(Vec::new());
    }
    let drawn_nm = number(drawn, WIDTHS_NM);
    let pad = columns.pad.map(|c| fields[c].clone());
    let mut at_um = columns.at.map(|at| at.map(|c| number(c, PLACES_UM)));
    if let (None, Some(pad)) = (at_um, &pad) {
        at_um = regions.iter().find(|r| r.name == *pad).map(|r| r.at_um);
    }
    let dose = columns.dose.map(|c| number(c, DOSES));
    let stated = columns.fill.map(|c| number(c, [0.0, 1.0]));
    let open_area = columns.open_area.map(|c| number(c, [0.0, 1.0]));
    let along = columns.orientation.map_or(0.0, |c| match fields[c].as_str() {
        "x" => 1.0,
        "y" => -1.0,
        _ => (2.0 * number(c, [-360.0, 360.0]).to_radians()).cos(),
    });
    if !faults.is_empty() {
        return Err(faults);
    }
    let surroundings = match (stated, at_um) {
        (Some(fill), _) => Some(Surroundings::Stated(fill)),
        (None, Some(at)) if !regions.is_empty() => Some(Surroundings::of_regions(regions, at)),
        _ => None,
    };
    let loading = open_area.or_else(|| own_fill(regions, at_um?));
    let place = match (columns.at.and(at_um), &pad) {
        (Some([x, y]), _) => format!("{x},{y}"),
        (None, Some(pad)) => pad.clone(),
        _ => String::new(),
    };
    let group = group.map_or_else(String::new, |c| fields[c].clone());
    let rows = measured.into_iter().map(|(nm, of)| {
        let along = of.unwrap_or(along);
        let else_ = format!("{drawn_nm}|{dose:?}|{along}|{stated:?}|{open_area:?}|{group}|{pad:?}");
        Row {
            key: format!("{}|{else_}", place.replace('|', "/")),
            dose,
            group: group.clone(),
            site: WidthSite {
                drawn_nm,
                at_um,
                place: 0,
                dose_percent: 0.0,
                along,
                surroundings: surroundings.clone(),
                loading,
                group: 0,
                fitted: true,
                measured_nm: vec![nm],
            },
        }
    });
    Ok(rows.collect())
}

/// Most pillars of a layout around places.
const MOST_PILLARS: usize = 20_000_000;

/// Surround the places of a set by the pillars of a layout.
fn layout_fill(path: &Path, layer: LayerNumber, set: &mut WidthSet, root: &Section<'_, '_>, progress: &dyn Progress) {
    let s = root.section("fill");
    let fault = |what: String| {
        s.fault(
            "layout",
            what,
            "give the layout that was written, with its pillar layer in `layer`",
        )
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
