//! Shards: made whole or not at all, and known by what they say of themselves.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use metalith_core::{Error, Progress, Result, WholeFile};
use serde::{Deserialize, Serialize};

use crate::bench::{Bench, JudgedDraw, Quiet};
use crate::plan::{Plan, Shard};
use crate::record::DrawRecord;

/// Folder of the shards within that of the study.
pub(crate) const FOLDER: &str = "shards";

/// First line of a shard.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    plan: String,
    shard: u64,
    first: u64,
    end: u64,
}

/// How far a study is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Status {
    pub shards: u64,
    pub draws: u64,
    pub finished: u64,
    /// Numbers of the shards that are not there.
    pub missing: Vec<u64>,
    /// Files that cannot be used, with the reason.
    pub unusable: Vec<(PathBuf, String)>,
}

impl Plan {
    /// Where a shard is, or will be.
    pub fn shard_path(&self, number: u64) -> PathBuf {
        self.folder.join(FOLDER).join(format!("{number:06}.jsonl"))
    }

    fn header(&self, shard: Shard) -> Header {
        Header {
            plan: self.key.clone(),
            shard: shard.number,
            first: shard.first,
            end: shard.end,
        }
    }
}

/// Judges the draws of shards, one after the other.
pub struct Run<'p> {
    plan: &'p Plan,
    bench: Bench,
}

impl<'p> Run<'p> {
    /// For the draws of a plan; layouts and tables are read when a draw asks for them.
    ///
    /// # Errors
    /// If a file of the study has changed.
    pub fn open(plan: &'p Plan) -> Result<Self> {
        Ok(Self {
            plan,
            bench: Bench::open(plan)?,
        })
    }

    /// Make one shard, if it is not there.
    ///
    /// # Errors
    /// If tables of cells cannot be used (none are made here), a draw cannot be simulated, the file cannot be written or is of another plan, or the user stopped it.
    pub fn shard(&self, number: u64, progress: &dyn Progress) -> Result<()> {
        let shard = self.plan.shard(number)?;
        let path = self.plan.shard_path(number);
        if finished(self.plan, shard)? {
            return Ok(());
        }
        let mut file = WholeFile::create(&path)?;
        let fault = Error::io("write", &path);
        let mut text = line(&self.plan.header(shard));
        progress.begin(&format!("shard {number}"), shard.end - shard.first);
        for k in shard.first..shard.end {
            text.push_str(&line(&self.bench.draw(k, &Quiet(progress))?.record));
            progress.advance(1);
        }
        file.write_all(text.as_bytes()).map_err(fault)?;
        file.commit()
    }

    /// What a draw looks like in full.
    pub(crate) fn judged(&self, k: u64, progress: &dyn Progress) -> Result<JudgedDraw> {
        self.bench.draw(k, &Quiet(progress))
    }

    /// What draws are made by.
    pub(crate) fn drawer(&self) -> &crate::draw::Drawer {
        &self.bench.drawer
    }
}

fn line(value: &impl Serialize) -> String {
    let mut text = serde_json::to_string(value).expect("plain data serialises");
    text.push('\n');
    text
}

/// Make one shard of the study in a folder; nothing is read but the manifest if it is there.
///
/// # Errors
/// As [`Run::open`] and [`Run::shard`].
pub fn run_shard(plan: &Plan, number: u64, progress: &dyn Progress) -> Result<()> {
    if finished(plan, plan.shard(number)?)? {
        return Ok(());
    }
    Run::open(plan)?.shard(number, progress)
}

/// Whether a shard is there.
///
/// # Errors
/// If what is there belongs to another plan, or is no shard.
fn finished(plan: &Plan, shard: Shard) -> Result<bool> {
    let path = plan.shard_path(shard.number);
    let Some(file) = open(&path)? else { return Ok(false) };
    let mut first = String::new();
    BufReader::new(file)
        .read_line(&mut first)
        .map_err(Error::io("read", &path))?;
    match refusal(plan, shard, &first) {
        None => Ok(true),
        Some(why) => Err(refused(&path, &why)),
    }
}

fn refused(path: &Path, why: &str) -> Error {
    Error::invalid(
        format!("{} {why}", path.display()),
        "remove the file if it came here by mistake; its shard is then made again",
    )
}

fn open(path: &Path) -> Result<Option<fs::File>> {
    match fs::File::open(path) {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Error::io("read", path)(error)),
    }
}

/// Why a file with this first line is not that shard.
fn refusal(plan: &Plan, shard: Shard, first_line: &str) -> Option<String> {
    match serde_json::from_str::<Header>(first_line) {
        Err(_) => Some("is no shard of a study".into()),
        Ok(header) if header.plan != plan.key => Some("is a part of another plan".into()),
        Ok(header) if header != plan.header(shard) => Some(format!(
            "holds draws {} to {} as shard {}, of a plan that was cut otherwise",
            header.first,
            header.end.saturating_sub(1),
            header.shard
        )),
        Ok(_) => None,
    }
}

/// How far a study is.
///
/// # Errors
/// If its folder cannot be read.
pub fn status(plan: &Plan) -> Result<Status> {
    let mut status = Status {
        shards: plan.shards(),
        draws: plan.draws,
        finished: 0,
        missing: Vec::new(),
        unusable: Vec::new(),
    };
    for number in 0..plan.shards() {
        match finished(plan, plan.shard(number)?) {
            Ok(true) => status.finished += 1,
            Ok(false) => status.missing.push(number),
            Err(error) => {
                status.missing.push(number);
                status.unusable.push((plan.shard_path(number), error.to_string()));
            }
        }
    }
    Ok(status)
}

/// The draws of one file, whatever its name.
///
/// # Errors
/// If it is of another plan, or a line is not a draw of it.
pub(crate) fn read(plan: &Plan, path: &Path) -> Result<Vec<DrawRecord>> {
    let text = fs::read_to_string(path).map_err(Error::io("read", path))?;
    let mut lines = text.lines();
    let header: Header = lines
        .next()
        .and_then(|l| serde_json::from_str(l).ok())
        .ok_or_else(|| refused(path, "is no shard of a study"))?;
    if header.plan != plan.key {
        return Err(refused(path, "is a part of another plan"));
    }
    let mut draws = Vec::new();
    for (k, line) in lines.enumerate() {
        let record: DrawRecord = serde_json::from_str(line).map_err(|e| Error::Table {
            path: path.to_owned(),
            line: Some(k + 2),
            what: format!("this is no draw: {e}"),
            hint: "remove the file; its shard is then made again".into(),
        })?;
        draws.push(record);
    }
    let wanted = header.first..header.end;
    if !draws.iter().map(|d| d.draw).eq(wanted) {
        return Err(refused(path, "does not hold the draws that its first line names"));
    }
    Ok(draws)
}
