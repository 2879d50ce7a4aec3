//! A set of kind `widths`: tables of drawn and measured widths.

use std::path::Path;

use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};
use metalith_core::text::quoted;
use metalith_core::{Progress, Result, Silent};

use super::fill::Surroundings;
use super::regions::{Regions, fill, layout_fill};
use super::rows::{Columns, RowReader};
use super::screening;
use super::table::Table;

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
    /// What was found in the table before any fit.
    pub remarks: Vec<String>,
}

impl WidthSet {
    /// Read a set from its `measurement.toml`.
    ///
    /// # Errors
    /// All mistakes of the text and of the tables that it names; if the user stopped it.
    pub fn read(path: &Path, progress: &dyn Progress) -> Result<Self> {
        let text = load(path)?;
        let read = Document::read(path, &text, |root| sections(path, root, Table::read, progress))?;
        progress.check_stopped()?;
        Ok(read)
    }

    /// The keys of the `measurement.toml` of such a set.
    pub fn keys() -> KeyTable {
        explore(&[], |root, path| {
            sections(path, root, |_, _, _| Some(Table::without_rows()), &Silent)
        })
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
    /// Area fraction around it, averaged with exp(-r^2 / range^2) (um), where the set states one.
    pub fn fill(&self, range_um: f64) -> Option<f64> {
        self.surroundings.as_ref().map(|around| around.fill(range_um))
    }

    /// Mean of the repeats (nm).
    pub fn mean_nm(&self) -> f64 {
        self.measured_nm.iter().sum::<f64>() / self.measured_nm.len() as f64
    }
}

/// Reads the table that a key names.
type TableReader = fn(&Path, &Section<'_, '_>, &str) -> Option<Table>;

fn sections(path: &Path, root: &Section<'_, '_>, read: TableReader, progress: &dyn Progress) -> WidthSet {
    root.integer("schema", 1..=1, "");
    root.choice("kind", &[("widths", ())], None);
    let mut set = WidthSet {
        title: root.text("title"),
        sites: Vec::new(),
        places: 0,
        field: None,
        groups: None,
        stated_range_um: None,
        remarks: Vec::new(),
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
    let table = s.has("file").then(|| read(&file, &s, "file")).flatten();
    s.finish();
    let Some(table) = table else {
        // What else is wrong is found as soon as there is a table.
        root.accept_unread();
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
    let regions = fill(root, &folder, &mut set, columns.fill.is_some());
    if let (Some(drawn), false) = (columns.drawn, columns.measured.is_empty()) {
        let reader = RowReader {
            table: &table,
            columns: &columns,
            drawn,
            by: by.as_ref(),
            regions: regions.rectangles(),
        };
        reader.read(&s, &mut set, nominal_dose);
        check_dose(&nominal, nominal_dose, &table, columns.dose);
        set.remarks = screening::remarks(&mut set.sites);
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

/// Record a nominal dose that is far from all doses of the table: a bias at this dose would be an extrapolation.
fn check_dose(s: &Section<'_, '_>, nominal: Option<f64>, table: &Table, column: Option<usize>) {
    let doses = column.map_or_else(Vec::new, |c| table.numbers(c));
    let (low, high) = doses.iter().fold((f64::MAX, 0f64), |(a, b), d| (a.min(*d), b.max(*d)));
    if let Some(dose) = nominal.filter(|dose| !doses.is_empty() && !(low / 2.0..=2.0 * high).contains(dose)) {
        s.fault(
            "nominal",
            format!("it is {dose}, and the doses of the table are from {low} to {high}"),
            "give it in the unit of the column `dose`, or leave it out",
        );
    }
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
