//! What is in a hand-off, and whether a received one is whole and unaltered.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use metalith_core::{Error, Result};
use metalith_core::{Progress, WholeFile};

/// Name of the manifest in a hand-off.
pub(super) const NAME: &str = "manifest.json";
/// Longest manifest that is read; one entry takes about 150 bytes.
const LONGEST: u64 = 16 << 20;
const BLOCK: usize = 1 << 20;

/// One file of a hand-off.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    pub bytes: u64,
    /// In hexadecimal.
    pub sha256: String,
}

/// All files of a hand-off with their digests, and what made them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the program that made it.
    pub metalith: String,
    /// The command as it was given.
    pub command: String,
    pub design: String,
    /// SHA-256 of what decides the layout.
    pub design_digest: String,
    pub process: String,
    /// By path in the folder, with `/` between its parts.
    pub files: BTreeMap<String, Entry>,
    /// SHA-256 over all of the above: one number to read out over a telephone.
    pub seal: String,
}

impl Manifest {
    /// The seal that belongs to the contents.
    pub(super) fn sealed(mut self) -> Self {
        self.seal = self.reckoned_seal();
        self
    }

    fn reckoned_seal(&self) -> String {
        let mut hash = Sha256::new();
        let mut line = |parts: &[&str]| {
            for part in parts {
                hash.update((part.len() as u64).to_le_bytes());
                hash.update(part.as_bytes());
            }
        };
        line(&[
            &self.metalith,
            &self.command,
            &self.design,
            &self.design_digest,
            &self.process,
        ]);
        for (name, entry) in &self.files {
            line(&[name, &entry.bytes.to_string(), &entry.sha256]);
        }
        hex(&hash.finalize())
    }

    /// Write it into a hand-off.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        let mut text = serde_json::to_string_pretty(self).expect("plain data serialises");
        text.push('\n');
        WholeFile::write(&folder.join(NAME), text.as_bytes())
    }

    fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let bad = |what: String, line: Option<usize>| Error::Table {
            path: path.clone(),
            line,
            what,
            hint: "ask the sender for the hand-off again".into(),
        };
        let size = std::fs::metadata(&path).map_err(Error::io("read", &path))?.len();
        if size > LONGEST {
            return Err(bad(format!("{size} bytes are no manifest"), None));
        }
        let bytes = std::fs::read(&path).map_err(Error::io("read", &path))?;
        serde_json::from_slice(&bytes).map_err(|e| bad(format!("this is no manifest: {e}"), Some(e.line())))
    }
}

/// What came out of checking a received hand-off. All empty and the seal right: whole and unaltered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verification {
    pub manifest: Manifest,
    /// Whether the seal is that of the contents of the manifest.
    pub seal_holds: bool,
    /// Listed, but not there.
    pub missing: Vec<String>,
    /// There, but not as listed.
    pub altered: Vec<String>,
    /// There, but not listed.
    pub unknown: Vec<String>,
}

impl Verification {
    /// Whole and unaltered.
    pub fn holds(&self) -> bool {
        self.seal_holds && self.missing.is_empty() && self.altered.is_empty() && self.unknown.is_empty()
    }
}

/// Compare a received hand-off with its manifest.
///
/// # Errors
/// If there is no manifest to compare with, or a file cannot be read.
pub fn verify(folder: &Path, progress: &dyn Progress) -> Result<Verification> {
    let manifest = Manifest::read(folder)?;
    let (there, other) = files_below(folder)?;
    let mut result = Verification {
        seal_holds: manifest.seal == manifest.reckoned_seal(),
        missing: Vec::new(),
        altered: Vec::new(),
        unknown: there
            .keys()
            .filter(|name| *name != NAME && !manifest.files.contains_key(*name))
            .cloned()
            .chain(other)
            .collect(),
        manifest,
    };
    progress.begin(
        "comparing",
        result
            .manifest
            .files
            .values()
            .map(|f| f.bytes)
            .fold(0, u64::saturating_add),
    );
    for (name, listed) in &result.manifest.files {
        match there.get(name) {
            None => result.missing.push(name.clone()),
            Some(path) => {
                if entry_of(path, progress)? != *listed {
                    result.altered.push(name.clone());
                }
            }
        }
    }
    Ok(result)
}

/// Size and digest of a file.
///
/// # Errors
/// If it cannot be read, or the user stopped it.
pub(super) fn entry_of(path: &Path, progress: &dyn Progress) -> Result<Entry> {
    let mut file = File::open(path).map_err(Error::io("read", path))?;
    let mut hash = Sha256::new();
    let mut block = vec![0; BLOCK];
    let mut bytes = 0;
    loop {
        let n = file.read(&mut block).map_err(Error::io("read", path))?;
        if n == 0 {
            break;
        }
        if progress.stopped() {
            return Err(Error::Interrupted);
        }
        hash.update(&block[..n]);
        bytes += n as u64;
        progress.advance(n as u64);
    }
    Ok(Entry {
        bytes,
        sha256: hex(&hash.finalize()),
    })
}

/// All files below a folder by their path in it, in order, and the paths of all that is neither file nor
/// folder: links and the like are nothing that a hand-off has, and are not opened.
pub(super) fn files_below(folder: &Path) -> Result<(BTreeMap<String, PathBuf>, Vec<String>)> {
    let mut found = BTreeMap::new();
    let mut other = Vec::new();
    let mut open = vec![(String::new(), folder.to_owned())];
    while let Some((prefix, folder)) = open.pop() {
        for entry in std::fs::read_dir(&folder).map_err(Error::io("read the folder", &folder))? {
            let entry = entry.map_err(Error::io("read the folder", &folder))?;
            let kind = entry.file_type().map_err(Error::io("read", &entry.path()))?;
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            if kind.is_dir() {
                open.push((format!("{name}/"), entry.path()));
            } else if kind.is_file() {
                found.insert(name, entry.path());
            } else {
                other.push(name);
            }
        }
    }
    other.sort();
    Ok((found, other))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// Names that the manifest of a folder lists.
///
/// # Errors
/// If it cannot be read.
pub(super) fn listed(folder: &Path) -> Result<Vec<String>> {
    Ok(Manifest::read(folder)?.files.into_keys().collect())
}
