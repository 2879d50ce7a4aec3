//! The folder of a study: what it is, cut into shards.

use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use metalith_cell::CellStack;
use metalith_cell::cache_file::solver_of;
use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Error, LayerNumber, Progress, Quiet, Result};
use metalith_design::array::PillarArray;
use metalith_layout::write_pillars;
use metalith_optics::{BankRange, CellBank};
use metalith_sensor::Camera;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::bench::{Files, StudyBench};
use crate::manifest::{MANIFEST, Manifest, absolute, another_plan, is_planned, manifest};
use crate::picture::SceneChoice;
use crate::record::LimitStatement;
use crate::sharding::{Sharding, parts_per_shard};
use crate::study_file::Tolerance;

/// Version of the format of the manifest.
const SCHEMA: u32 = 2;

/// Source of the pillars of a study.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// A file that the tolerance names.
    Given(PathBuf),
    /// The file that was written from the design, by its name in the folder of the study.
    Written(String),
}

/// Where the pillars of a given layout are, if not where its design says.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PillarPlace {
    pub layer: Option<LayerNumber>,
    /// Cell to start from.
    pub top: Option<String>,
}

impl PillarPlace {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// The manifest of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    schema: u32,
    /// SHA-256 of all that decides the answers, in hexadecimal: key of the random numbers.
    pub key: String,
    /// The file of the study, absolute.
    pub tolerance: PathBuf,
    /// Layouts of the designs: one, or one for each combination of values of keys of the design.
    pub layouts: Vec<Layout>,
    #[serde(default, skip_serializing_if = "PillarPlace::is_default")]
    pub place: PillarPlace,
    /// Tables of cells of each design, by their names in the folder of the study; designs of one pillar share them.
    pub cells: Vec<String>,
    /// Name and unit of what varies; those of a grid first.
    pub quantities: Vec<(String, String)>,
    pub limits: Vec<LimitStatement>,
    /// All draws, at all points of the grid.
    pub draws: u64,
    pub draws_per_shard: u64,
    /// Wall time of the first draw on the machine and threads of the plan, of the slowest design (s).
    pub seconds_per_draw: f64,
    /// Pillars, of all designs, whose tables were solved, for every width and wavelength.
    pub stacks: usize,
    /// The folder of the study.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Settings of a plan of a study.
#[derive(Clone, Debug, Default)]
pub struct PlanSettings {
    /// Draws of a shard; as many as take ten minutes if left out.
    pub draws_per_shard: Option<u64>,
    pub place: PillarPlace,
}

impl Plan {
    /// Division of the work into shards.
    pub fn cut(&self) -> Sharding {
        Sharding {
            key: self.key.clone(),
            part: "draw",
            parts: self.draws,
            per_shard: self.draws_per_shard,
            folder: self.folder.clone(),
            files_of: None,
        }
    }

    /// Files that results are made from beside the shards: manifest, tolerance, design, layouts, tables, model, camera, scene.
    ///
    /// # Errors
    /// If the tolerance cannot be read.
    pub fn inputs(&self) -> Result<Vec<PathBuf>> {
        let tolerance = Tolerance::read(&self.tolerance)?;
        let files = self.files();
        let mut all = vec![self.folder.join(MANIFEST), self.tolerance.clone(), tolerance.design];
        all.extend(files.layouts.into_iter().chain(files.cells).chain(tolerance.model));
        if let Some(picture) = tolerance.picture {
            all.push(picture.camera);
            if let SceneChoice::File(path) = picture.scene {
                all.push(path);
            }
        }
        Ok(all)
    }

    /// Paths of the layouts and the tables.
    pub(crate) fn files(&self) -> Files {
        let layouts = self.layouts.iter().map(|l| layout_path(l, &self.folder));
        let cells = self.cells.iter().map(|name| self.folder.join(name));
        Files {
            layouts: layouts.collect(),
            place: self.place.clone(),
            cells: cells.collect(),
        }
    }
}

manifest!(Plan, |plan| plan.draws_per_shard > 0);

/// Name of the file of one design of a study: `layout.gds` if it is the only one, else `layout_2.gds`.
fn named(stem: &str, ending: &str, number: u64, designs: u64) -> String {
    if designs == 1 {
        format!("{stem}.{ending}")
    } else {
        format!("{stem}_{number}.{ending}")
    }
}

fn layout_path(layout: &Layout, folder: &Path) -> PathBuf {
    match layout {
        Layout::Given(path) => path.clone(),
        Layout::Written(name) => folder.join(name),
    }
}

/// Plan a study into a folder: layouts, tables of cells, the first draw of each design to know its time, manifest. A folder
/// that holds the plan of the same study keeps it.
///
/// # Errors
/// If a file cannot be used, the folder holds another study, or the user stopped it.
pub fn plan(tolerance_path: &Path, folder: &Path, settings: PlanSettings, progress: &dyn Progress) -> Result<Plan> {
    let tolerance_path = absolute(tolerance_path)?;
    let tolerance = Tolerance::read(&tolerance_path)?;
    let place = settings.place;
    if tolerance.layout.is_none() && !place.is_default() {
        return Err(Error::refused(
            "study/layout-not-given",
            "a layer or a top cell is given, and the layout is written from the design",
            "leave out --layer and --top, or name a layout by `layout` in the tolerance file",
        ));
    }
    fs::create_dir_all(folder).map_err(Error::io("create the folder", folder))?;
    let known = is_planned(folder);
    let layouts = layouts(&tolerance, folder, known, progress)?;
    let paths: Vec<PathBuf> = layouts.iter().map(|l| layout_path(l, folder)).collect();
    if known && !paths.iter().all(|path| path.exists()) {
        return Err(another_plan(folder));
    }
    let key = key(&tolerance, &paths, &place, progress)?;
    if let Some(known) = Plan::known_in(folder, &hex(&key))? {
        return Ok(known);
    }
    let designs = tolerance.designs();
    // Where each design would keep its own tables.
    let own = (0..designs).map(|d| folder.join(named("cells", "bank", d, designs)));
    let files = Files {
        layouts: paths,
        place: place.clone(),
        cells: own.collect(),
    };
    let bench = StudyBench::new(tolerance, key, files)?;
    let draws = bench.drawer.count();
    let mut plan = Plan {
        schema: SCHEMA,
        key: hex(&key),
        tolerance: tolerance_path,
        layouts,
        place,
        cells: Vec::new(),
        quantities: bench.drawer.names(),
        limits: Vec::new(),
        draws,
        draws_per_shard: 1,
        seconds_per_draw: 0.0,
        stacks: 0,
        folder: folder.to_owned(),
    };
    for design in 0..designs {
        plan.take(design, designs, &bench, progress)?;
    }
    plan.draws_per_shard = parts_per_shard(settings.draws_per_shard, plan.seconds_per_draw, draws);
    plan.write_in(folder)?;
    Ok(plan)
}

/// The layout of each design, written if it is not there.
fn layouts(tolerance: &Tolerance, folder: &Path, known: bool, progress: &dyn Progress) -> Result<Vec<Layout>> {
    if let Some(path) = &tolerance.layout {
        return Ok(vec![Layout::Given(absolute(path)?)]);
    }
    let designs = tolerance.designs();
    let each = (0..designs).map(|number| {
        let name = named("layout", "gds", number, designs);
        let path = folder.join(&name);
        if !known {
            let design = tolerance.design(number, progress)?;
            // Others differ by the values of a grid.
            if number == 0 {
                design
                    .warnings()?
                    .iter()
                    .for_each(|warning| progress.warn(&warning.to_string()));
            }
            let array = PillarArray::build(&design, progress)?;
            write_pillars(&design, &array, design.layout.hierarchy, &path, progress)?;
        }
        Ok(Layout::Written(name))
    });
    each.collect()
}

impl Plan {
    /// Solve the tables of one design, or find those that an earlier one has, and judge its first draw.
    fn take(&mut self, design: u64, designs: u64, bench: &StudyBench, progress: &dyn Progress) -> Result<()> {
        let name = named("cells", "bank", design, designs);
        let shared = Cell::new(None);
        let bank = |stated: &CellStack, range: BankRange| {
            // A file of other cells says so.
            let found = self.cells.iter().enumerate().rev().find_map(|(k, name)| {
                let read = CellBank::read(&self.folder.join(name), stated, range.clone());
                read.ok().map(|bank| (k, bank))
            });
            if let Some((k, bank)) = found {
                shared.set(Some(k));
                return Ok(bank);
            }
            let bank = CellBank::solve(stated, range, progress)?;
            bank.write(&self.folder.join(&name))?;
            Ok(bank)
        };
        bench.take(design, &bank, progress)?;
        if let Some(k) = shared.get() {
            self.cells.push(self.cells[k].clone());
        } else {
            self.stacks += bench.stacks();
            self.cells.push(name);
        }
        progress.begin("timing the first draw", 1);
        let begun = Instant::now();
        let first = bench.draw(design * (self.draws / designs), &Quiet(progress))?;
        self.seconds_per_draw = self.seconds_per_draw.max(begun.elapsed().as_secs_f64());
        for limit in &bench.tolerance.limits {
            if !first.record.figures.contains_key(&limit.figure) {
                let known: Vec<&str> = first.record.figures.keys().map(String::as_str).collect();
                return Err(Error::refused(
                    "study/unknown-figure",
                    format!("there is no figure `{}` to limit", limit.figure),
                    format!("this design has: {}", known.join(", ")),
                ));
            }
        }
        let limits = bench.limits(&first.found);
        if design > 0 && limits != self.limits {
            let setting = bench.tolerance.setting(design).into_iter();
            let setting: Vec<String> = setting.map(|(key, value)| format!("{key} = {value}")).collect();
            return Err(Error::refused(
                "study/limits-differ",
                format!(
                    "with {} other limits count than with the first values of the grid",
                    setting.join(", ")
                ),
                "make a study of each of these designs",
            ));
        }
        self.limits = limits;
        Ok(())
    }
}

/// SHA-256 of everything that decides the answers; how a study is cut is no part of it.
pub(crate) fn key(
    tolerance: &Tolerance,
    layouts: &[PathBuf],
    place: &PillarPlace,
    progress: &dyn Progress,
) -> Result<[u8; 32]> {
    let mut hash = Sha256::new();
    let mut add = |what: &str, bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(what);
        hash.update(bytes);
    };
    let mut files = vec![tolerance.path.clone(), tolerance.design.clone()];
    files.extend(layouts.iter().cloned());
    files.extend(tolerance.model.clone());
    if let Some(picture) = &tolerance.picture {
        files.extend(Camera::read(&picture.camera)?.files);
        if let SceneChoice::File(path) = &picture.scene {
            files.push(path.clone());
        }
    }
    for number in 0..tolerance.designs() {
        let design = tolerance.design(number, progress)?;
        let solver = solver_of(design.cell.shape);
        add("version", format!("{} {solver}", env!("CARGO_PKG_VERSION")).as_bytes());
        // A design names further files: its digest covers what they say.
        add("design", design.optics_digest()?.as_bytes());
        // Nothing of [verify] varies over the grid.
        if let (0, Some(camera)) = (number, &design.verify.camera) {
            files.extend(metalith_verify::camera_files(camera)?);
        }
    }
    for path in files {
        add("file", &file_digest(&path)?);
    }
    if let Some(layer) = place.layer {
        add("layer", layer.to_string().as_bytes());
    }
    if let Some(top) = &place.top {
        add("top", top.as_bytes());
    }
    Ok(hash.finalize().into())
}

/// Division of a study that is still to be planned into a folder.
pub fn planned_later(tolerance: &Tolerance, draws_per_shard: u64, folder: &Path) -> Sharding {
    let values = tolerance.grids.iter().map(|grid| grid.values.len() as u64);
    let draws = tolerance.draws * tolerance.designs() * values.product::<u64>();
    Sharding {
        key: String::new(),
        part: "draw",
        parts: draws,
        per_shard: draws_per_shard.clamp(1, draws),
        folder: folder.to_owned(),
        files_of: None,
    }
}

/// A plan of nothing, for tests of what is done with plans.
#[cfg(test)]
pub(crate) fn test_plan(folder: &Path, layout: Layout, draws: u64, draws_per_shard: u64) -> Plan {
    Plan {
        schema: SCHEMA,
        key: hex(&[0; 32]),
        tolerance: "tolerance.toml".into(),
        layouts: vec![layout],
        place: PillarPlace::default(),
        cells: vec!["cells.bank".into()],
        quantities: Vec::new(),
        limits: Vec::new(),
        draws,
        draws_per_shard,
        seconds_per_draw: 1.0,
        stacks: 1,
        folder: folder.to_owned(),
    }
}
