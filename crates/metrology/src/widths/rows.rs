//! Rows of a table as sites, with their repeats.

use std::collections::{BTreeMap, BTreeSet};

use metalith_core::document::Section;
use metalith_core::text::quoted;

use super::fill::{FilledRegion, Surroundings, own_fill};
use super::screening::Screening;
use super::set::{WidthSet, WidthSite};
use super::table::{Table, report};

/// Columns by their place in the table.
pub(super) struct Columns {
    pub(super) drawn: Option<usize>,
    /// Columns of measured widths, each with [`WidthSite::along`] where it is of one direction.
    pub(super) measured: Vec<(usize, Option<f64>)>,
    at: Option<[usize; 2]>,
    pad: Option<usize>,
    pub(super) dose: Option<usize>,
    orientation: Option<usize>,
    pub(super) fill: Option<usize>,
    open_area: Option<usize>,
}

impl Columns {
    /// Columns as a set names them; a named column that is missing is a fault.
    pub(super) fn of(root: &Section<'_, '_>, table: &Table) -> Self {
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

/// Widths, places and doses that a table may have.
const WIDTHS_NM: [f64; 2] = [1.0, 1e6];
const PLACES_UM: [f64; 2] = [-1e6, 1e6];
const DOSES: [f64; 2] = [1e-6, 1e9];

/// Most names that a message lists.
const MOST_SHOWN: usize = 8;

/// Largest ratio of a measured to a drawn width, and of a drawn to a measured one, of a row that is believed.
const ROW_RATIO: f64 = 5.0;

fn far_from_drawn(place: &str, drawn_nm: f64, measured_nm: f64) -> Option<String> {
    let ratio = measured_nm / drawn_nm;
    let believed = (1.0 / ROW_RATIO..=ROW_RATIO).contains(&ratio);
    (!believed).then(|| format!("{place}: {measured_nm} nm were measured of a drawn width of {drawn_nm} nm"))
}

/// A row as it was read, by which its repeats are found.
struct Row {
    key: String,
    site: WidthSite,
    dose: Option<f64>,
    group: String,
}

/// A table and what its rows are read with.
pub(super) struct RowReader<'a> {
    pub(super) table: &'a Table,
    pub(super) columns: &'a Columns,
    /// Column of the drawn width.
    pub(super) drawn: usize,
    /// Name and column of the groups.
    pub(super) by: Option<&'a (String, usize)>,
    pub(super) regions: &'a [FilledRegion],
}

impl RowReader<'_> {
    /// Read the sites of a set, repeats joined; all faults of the rows at once.
    pub(super) fn read(&self, s: &Section<'_, '_>, set: &mut WidthSet, nominal: Option<f64>) {
        let (table, columns) = (self.table, self.columns);
        let screening = Screening::new(table, self.drawn, &columns.measured);
        if let Some((what, hint)) = screening.wrong_columns() {
            s.fault("file", what, hint);
            return;
        }
        let (mut faults, mut found, mut places) = (Vec::new(), Vec::new(), BTreeMap::new());
        for row in 0..table.rows.len() {
            match self.row(row) {
                Ok(own) => found.extend(own),
                Err(own) => faults.extend(own),
            }
        }
        if !faults.is_empty() {
            report(
                faults,
                s,
                "file",
                "correct these rows, or leave the measured width empty; widths are in nm, places in um, fills from 0 to 1",
            );
            return;
        }
        self.check_places(s, &found);
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
                dose_percent: row.dose.map_or(0.0, |dose| 100.0 * (dose - nominal) / nominal),
                ..row.site
            });
        }
        set.places = if columns.at.is_some() || columns.pad.is_some() {
            places.len()
        } else {
            0
        };
        set.groups = self.by.map(|(name, _)| (name.clone(), names));
    }

    /// Record pads without a region, or places that all lie outside the regions: the fill around them is then not known.
    fn check_places(&self, s: &Section<'_, '_>, found: &[Row]) {
        if self.regions.is_empty() {
            return;
        }
        let hint = "complete the table of regions, or correct the places (um)";
        if self.columns.at.is_some() {
            if !found.is_empty() && found.iter().all(|r| r.site.loading.is_none_or(|fill| fill == 0.0)) {
                s.fault("file", "no place lies in a region of [fill]", hint);
            }
            return;
        }
        let Some(pad) = self.columns.pad else { return };
        let fields = (0..self.table.rows.len()).map(|row| &self.table.rows[row].1[pad]);
        let unknown: BTreeSet<&String> = fields
            .filter(|name| !self.regions.iter().any(|r| r.name == **name))
            .collect();
        if !unknown.is_empty() {
            let shown: Vec<String> = unknown.iter().take(MOST_SHOWN).map(|name| quoted(name)).collect();
            let more = if unknown.len() > MOST_SHOWN { ", ..." } else { "" };
            let what = format!(
                "no region of [fill] has the name of these pads: {}{more}",
                shown.join(", ")
            );
            s.fault("file", what, hint);
        }
    }

    /// The sites of a row, one for each measured width; all that is wrong with it.
    fn row(&self, row: usize) -> Result<Vec<Row>, Vec<String>> {
        let Self {
            table,
            columns,
            regions,
            ..
        } = self;
        let fields = &table.rows[row].1;
        let mut faults = Vec::new();
        let mut number = |column: usize, range| {
            table.number(row, column, range).unwrap_or_else(|what| {
                faults.push(what);
                range[0]
            })
        };
        let measured = columns
            .measured
            .iter()
            .filter(|(c, _)| !table.field(row, *c).is_empty());
        let measured: Vec<(f64, Option<f64>)> = measured.map(|(c, along)| (number(*c, WIDTHS_NM), *along)).collect();
        if measured.is_empty() {
            return Ok(Vec::new());
        }
        let drawn_nm = number(self.drawn, WIDTHS_NM);
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
        if faults.is_empty() {
            let widths = measured.iter().map(|(nm, _)| *nm);
            faults.extend(widths.filter_map(|nm| far_from_drawn(&table.at_line(row), drawn_nm, nm)));
        }
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
        let group = self.by.map_or_else(String::new, |(_, c)| fields[*c].clone());
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
}
