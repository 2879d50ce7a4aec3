//! The manifest of a hand-off, and verification that a received one is complete and unaltered.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use sha2::{Digest, Sha256};

use metalith_core::file::read_at_most;
use metalith_core::text::{hex, printable, quoted};
use metalith_core::Progress;
use metalith_core::{Error, Result};

/// Name of the manifest in a hand-off.
pub(super) const NAME: &str = "manifest.json";
/// Longest manifest that is read; one entry takes about 150 bytes.
const LONGEST: u64 = 16 << 20;
const BLOCK: usize = 1 << 20;

/// One file of a hand-off.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManifestEntry {
    pub bytes: u64,
    /// Digest in hexadecimal.
    pub sha256: String,
}

/// All files of a hand-off with their digests, and what made them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the program that made it.
    pub metalith: String,
    /// The command as it was given.
    pub command: String,
    pub design: String,
    /// SHA-256 of all inputs that determine the layout.
    pub design_digest: String,
    pub process: String,
    /// Entries by path in the folder, with `/` between its parts.
    #[serde(deserialize_with = "each_once")]
    pub files: BTreeMap<String, ManifestEntry>,
    /// SHA-256 over all of the above: one number to read out over a telephone.
    pub seal: String,
}

/// A map in which no key comes twice: of two entries for one file, readers would take different ones.
fn each_once<'de, D: Deserializer<'de>>(from: D) -> Result<BTreeMap<String, ManifestEntry>, D::Error> {
    struct EachOnce;

    impl<'de> Visitor<'de> for EachOnce {
        type Value = BTreeMap<String, ManifestEntry>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("files with their sizes and digests, each once")
        }

        fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<Self::Value, M::Error> {
            let mut files = BTreeMap::new();
            while let Some((name, entry)) = map.next_entry::<String, ManifestEntry>()? {
                if files.contains_key(&name) {
                    return Err(M::Error::custom(format!("{} is listed twice", quoted(&name))));
                }
                files.insert(name, entry);
            }
            Ok(files)
        }
    }

    from.deserialize_map(EachOnce)
}

impl Manifest {
    /// The seal that belongs to the contents.
    pub(super) fn sealed(mut self) -> Self {
        self.seal = self.computed_seal();
        self
    }

    fn computed_seal(&self) -> String {
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
        metalith_report::write_plain_json(&folder.join(NAME), self)
    }

    fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(NAME);
        let bytes = read_at_most(&path, LONGEST, "the manifest of a hand-off")?;
        serde_json::from_slice(&bytes).map_err(|e| {
            let what = format!("this is not a manifest: {}", printable(&e.to_string()));
            Error::table(&path, Some(e.line()), what, "ask the sender for the hand-off again")
        })
    }
}

/// Result of verifying a received hand-off. If all lists are empty and the seal is right, it is complete and unaltered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct HandoffVerification {
    pub manifest: Manifest,
    /// True if the seal is the seal of the contents of the manifest.
    pub seal_holds: bool,
    /// Listed, but not there.
    pub missing: Vec<String>,
    /// There, but not as listed.
    pub altered: Vec<String>,
    /// There, but not listed: files, folders without files, links and the like.
    pub unknown: Vec<String>,
}

impl HandoffVerification {
    /// True if it is complete and unaltered.
    pub fn holds(&self) -> bool {
        self.seal_holds && self.missing.is_empty() && self.altered.is_empty() && self.unknown.is_empty()
    }
}

/// Compare a received hand-off with its manifest.
///
/// # Errors
/// If there is no manifest to compare with, or a file cannot be read.
pub fn verify(folder: &Path, progress: &dyn Progress) -> Result<HandoffVerification> {
    let manifest = Manifest::read(folder)?;
    let there = files_below(folder)?;
    let mut result = HandoffVerification {
        seal_holds: manifest.seal == manifest.computed_seal(),
        missing: Vec::new(),
        altered: Vec::new(),
        unknown: there
            .files
            .keys()
            .filter(|name| *name != NAME && !manifest.files.contains_key(*name))
            .chain(&there.other)
            .chain(&there.empty)
            .cloned()
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
        match there.files.get(name) {
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
pub(super) fn entry_of(path: &Path, progress: &dyn Progress) -> Result<ManifestEntry> {
    let mut file = File::open(path).map_err(Error::io("read", path))?;
    let mut hash = Sha256::new();
    let mut block = vec![0; BLOCK];
    let mut bytes = 0;
    loop {
        let n = file.read(&mut block).map_err(Error::io("read", path))?;
        if n == 0 {
            break;
        }
        progress.check_stopped()?;
        hash.update(&block[..n]);
        bytes += n as u64;
        progress.advance(n as u64);
    }
    Ok(ManifestEntry {
        bytes,
        sha256: hex(&hash.finalize()),
    })
}

/// Content of a folder, by relative path.
#[derive(Default)]
pub(super) struct FolderContent {
    pub files: BTreeMap<String, PathBuf>,
    /// Entries that are neither file nor folder, such as links: a hand-off has none, and they are not opened.
    pub other: Vec<String>,
    /// Folders with nothing in them, with `/` at the end.
    pub empty: Vec<String>,
}

/// Everything below a folder, in order.
///
/// # Errors
/// If it cannot be read.
pub(super) fn files_below(folder: &Path) -> Result<FolderContent> {
    let mut found = FolderContent::default();
    let mut open = vec![(String::new(), folder.to_owned())];
    while let Some((prefix, folder)) = open.pop() {
        let mut entries = 0;
        for entry in std::fs::read_dir(&folder).map_err(Error::io("read the folder", &folder))? {
            let entry = entry.map_err(Error::io("read the folder", &folder))?;
            entries += 1;
            let kind = entry.file_type().map_err(Error::io("read", &entry.path()))?;
            // A name that is not UTF-8 is shown as one that no manifest lists.
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            if kind.is_dir() {
                open.push((format!("{name}/"), entry.path()));
            } else if kind.is_file() {
                found.files.insert(name, entry.path());
            } else {
                found.other.push(name);
            }
        }
        if entries == 0 && !prefix.is_empty() {
            found.empty.push(prefix);
        }
    }
    found.other.sort();
    found.empty.sort();
    Ok(found)
}

/// Names that the manifest of a folder lists.
///
/// # Errors
/// If it cannot be read.
pub(super) fn listed(folder: &Path) -> Result<BTreeSet<String>> {
    Ok(Manifest::read(folder)?.files.into_keys().collect())
}
