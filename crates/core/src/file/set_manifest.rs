//! The list of the files of a result, with their digests.

use std::fmt::Write;
use std::fs;
use std::path::{Component, Path};

use super::{file_digest, read_at_most};
use crate::error::{Error, Result};
use crate::text::{hex, is_printable};

/// Ending of the hidden list of a set.
pub(super) const MANIFEST: &str = ".sha256";

/// Longest list that is read (bytes).
const LONGEST: u64 = 1 << 24;

/// Largest file whose digest is listed (bytes): reading a layout of gigabytes again would cost more than making it.
const LARGEST_DIGESTED: u64 = 1 << 26;

/// Longest name of a file that file systems hold (bytes): a longer one in a list would fill a message.
const LONGEST_NAME: usize = 255;

/// Beginnings of lines that `sha256sum -c` takes for comments.
const UNDIGESTED: &str = "# without digest: ";
const STALE: &str = "# removed: ";
const UNLISTED: &str = "# no list stays";

/// Digest of a file, as a list has it.
pub(super) struct Wanted<'a>(&'a str);

impl Wanted<'_> {
    pub(super) fn is_of(&self, path: &Path) -> bool {
        file_digest(path).is_ok_and(|found| hex(&found) == self.0)
    }
}

/// Names of the files of a set, each with its SHA-256 unless it is large, and names of files that it makes stale.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct SetManifest {
    files: Vec<(String, Option<String>)>,
    stale: Vec<String>,
    /// False if the list goes when the files are in their places.
    pub(super) is_listed: bool,
}

impl SetManifest {
    /// List of the files with these names in a folder.
    pub(super) fn of(folder: &Path, names: &[String], stale: &[&str], is_listed: bool) -> Result<Self> {
        let listed = |name: &String| {
            let path = folder.join(name);
            let bytes = fs::metadata(&path).map_err(Error::io("read", &path))?.len();
            let digest = (is_listed && bytes <= LARGEST_DIGESTED)
                .then(|| file_digest(&path))
                .transpose()?;
            Ok((name.clone(), digest.map(|d| hex(&d))))
        };
        Ok(Self {
            files: names.iter().map(listed).collect::<Result<_>>()?,
            stale: stale.iter().map(|&name| name.to_owned()).collect(),
            is_listed,
        })
    }

    /// List in a file; none if there is no such file. Lines that are no lines of a list are passed over.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(super) fn read(path: &Path) -> Result<Option<Self>> {
        if !super::folder::is_there(path)? {
            return Ok(None);
        }
        let bytes = match read_at_most(path, LONGEST, "a list of files") {
            // Without locks another run may have taken it away.
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            found => found?,
        };
        let mut list = Self {
            is_listed: true,
            ..Self::default()
        };
        for line in String::from_utf8_lossy(&bytes).lines() {
            if line == UNLISTED {
                list.is_listed = false;
            } else if let Some(name) = line.strip_prefix(UNDIGESTED).filter(|name| is_plain(name)) {
                list.files.push((name.to_owned(), None));
            } else if let Some(name) = line.strip_prefix(STALE).filter(|name| is_plain(name)) {
                list.stale.push(name.to_owned());
            } else if let Some((digest, name)) = line.split_once("  ").filter(|(_, name)| is_plain(name)) {
                list.files.push((name.to_owned(), Some(digest.to_owned())));
            }
        }
        Ok(Some(list))
    }

    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        for (name, digest) in &self.files {
            let _ = match digest {
                Some(digest) => writeln!(text, "{digest}  {name}"),
                None => writeln!(text, "{UNDIGESTED}{name}"),
            };
        }
        if !self.is_listed {
            text += UNLISTED;
            text.push('\n');
        }
        self.stale.iter().for_each(|name| text += &format!("{STALE}{name}\n"));
        text
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|(name, _)| name.as_str())
    }

    pub(super) fn stale(&self) -> impl Iterator<Item = &str> {
        self.stale.iter().map(String::as_str)
    }

    /// Digest of the file with this name, if it is listed.
    pub(super) fn digest(&self, name: &str) -> Option<Wanted<'_>> {
        let (_, digest) = self.files.iter().find(|(listed, _)| listed == name)?;
        digest.as_deref().map(Wanted)
    }
}

/// True for the name of a file in a folder, and no way out of it, that one line of a list can hold.
pub(super) fn is_plain(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    matches!((parts.next(), parts.next()), (Some(Component::Normal(only)), None) if only == name)
        && name.len() <= LONGEST_NAME
        && name.chars().all(|c| is_printable(c) && c != '\\')
}
