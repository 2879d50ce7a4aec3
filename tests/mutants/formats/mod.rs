//! Every format of an input file but layouts: good files, and the reader that a user reaches them by.

mod designs;
mod kept;
mod measured;
mod metrology;
mod networks;
mod pictures;
mod settings;
mod studies;

use std::fs;
use std::path::{Path, PathBuf};

use metalith_testing::root;

use crate::damage::Ending;

/// Part of a file that may be damaged.
#[derive(Clone, Copy)]
pub(crate) enum Kind {
    Bytes,
    /// Lines and values too.
    Text,
    /// A text that is JSON.
    Json,
    /// Ends with the SHA-256 of what comes before.
    Sealed,
    /// A text that ends with such a digest in words.
    Ended(&'static Ending),
    /// Chunks of a PNG, each with its checksum.
    Png,
    /// Values of the header too, which is JSON with its length before it.
    Safetensors,
}

/// One format.
pub(crate) struct Format {
    pub name: &'static str,
    /// Path at which a file of it is read.
    pub file: PathBuf,
    pub kind: Kind,
    /// Files that are read.
    pub corpus: Vec<Vec<u8>>,
    /// Reads the file; why it was refused.
    pub read: Box<dyn Fn() -> Result<(), String>>,
}

impl Format {
    fn new<T, E: std::fmt::Display>(
        name: &'static str,
        file: PathBuf,
        kind: Kind,
        corpus: Vec<Vec<u8>>,
        read: impl Fn(&Path) -> Result<T, E> + 'static,
    ) -> Self {
        let path = file.clone();
        Self {
            name,
            file,
            kind,
            corpus,
            read: Box::new(move || read(&path).map(drop).map_err(|e| e.to_string())),
        }
    }
}

/// A group of formats whose files stand in one folder.
type Group = fn(&Path) -> Vec<Format>;

/// All groups, by the names of their folders.
pub(crate) const GROUPS: [(&str, Group); 8] = [
    ("designs", designs::all),
    ("settings", settings::all),
    ("pictures", pictures::all),
    ("measured", measured::all),
    ("kept", kept::all),
    ("studies", studies::all),
    ("metrology", metrology::all),
    ("networks", networks::all),
];

/// The formats of a group; their files are put below `folder`.
pub(crate) fn of_group((name, group): (&str, Group), folder: &Path) -> Vec<Format> {
    let own = folder.join(name);
    fs::create_dir_all(&own).unwrap();
    group(&own)
}

fn file(name: &str) -> Vec<u8> {
    fs::read(root().join(name)).unwrap()
}

/// The files of a folder of the project that end so.
fn files(folder: &str, ending: &str) -> Vec<Vec<u8>> {
    let mut paths: Vec<_> = fs::read_dir(root().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == ending))
        .collect();
    paths.sort();
    paths.iter().map(|p| fs::read(p).unwrap()).collect()
}

fn copy(from: &str, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(root().join(from)).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
        }
    }
}

/// The example of a document that holds these words.
fn example(document: &str, words: &str) -> Vec<u8> {
    let text = fs::read_to_string(root().join(document)).unwrap();
    let blocks = text.split("```toml\n").skip(1).map(|b| b.split("```").next().unwrap());
    let found = blocks.into_iter().find(|b| b.contains(words));
    found
        .unwrap_or_else(|| panic!("{document} has no example with {words}"))
        .into()
}
