//! Files of one result that appear together, whole or not at all.

use std::fs::{self, Metadata};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::folder::{is_there, remove_tree, rename};
use super::folder_lock::FolderLock;
use super::set_manifest::{MANIFEST, SetManifest, is_plain};
use super::{AtomicFile, part};
use crate::error::{Error, Result};
use crate::progress::{Progress, Silent};

/// Endings of the hidden folders of a set.
const UNFINISHED: &str = ".unfinished";
const DECIDED: &str = ".publish";

/// Time in which another run puts its files into place where nothing tells whether it lives: they are complete, and only names
/// change. After it the run is taken for a killed one.
const PATIENCE: Duration = Duration::from_secs(10);

impl FolderLock {
    /// Write the files of a result, `set`, into this folder: all of them or none. `write` is given the folder to write them into,
    /// which holds nothing else; what it returns is returned. Files that the set had before and has no more are removed, and
    /// so are those named in `stale`, which speak of an earlier result.
    ///
    /// In the folder there are, while this goes on or after a run was killed:
    ///
    /// | name | what |
    /// | --- | --- |
    /// | `.SET.HOST-PROCESS-NUMBER.unfinished` | files under way; the next run removes them |
    /// | `.SET.publish` | complete files on their way to their places |
    /// | `.SET.sha256` | names and digests of the files that are in their places, as `sha256sum -c` reads them |
    ///
    /// Renaming `.unfinished` to `.publish` decides: before, the old files are untouched; after, whatever is left to do is done by the
    /// next run or reader. All old files go before the first new one comes: at no moment do files of two results lie
    /// side by side.
    ///
    /// # Errors
    /// What `write` returns; if one of the files of [`FolderLock::keeping`], or of another result, would be replaced or removed; if
    /// the disk refuses; if another process without a lock wrote the same files meanwhile.
    pub fn publish<T>(&self, set: &str, stale: &[&str], write: impl FnOnce(&Path) -> Result<T>) -> Result<T> {
        self.put(set, stale, true, write)
    }

    /// Variant of [`FolderLock::publish`] for files whose names or whose folder a person chose: no list stays beside them, and no
    /// file goes but those that are written anew or named in `stale`.
    ///
    /// # Errors
    /// As [`FolderLock::publish`].
    pub fn replace<T>(&self, set: &str, stale: &[&str], write: impl FnOnce(&Path) -> Result<T>) -> Result<T> {
        self.put(set, stale, false, write)
    }

    fn put<T>(&self, set: &str, stale: &[&str], is_listed: bool, write: impl FnOnce(&Path) -> Result<T>) -> Result<T> {
        let set = FileSet::of(self.folder(), set)?;
        let mut unfinished = Unfinished::new(&set)?;
        let written = write(&unfinished.0)
            .and_then(|value| {
                let new = set.complete(&unfinished.0, stale, is_listed)?;
                let replaced = set.replaced_by(&new)?;
                let mut paths = replaced.iter().map(|name| self.folder().join(name));
                paths.try_for_each(|path| self.inputs().check_output(&path))?;
                set.check_not_of_others(&replaced, &unfinished.0)?;
                Ok(value)
            })
            .map_err(|error| set.in_its_place(error, &unfinished.0))?;
        let mut own = set.identities(&unfinished.0)?;
        own.retain(|(path, _)| is_listed || *path != set.manifest);
        finish_decided(self)?;
        // A run leaves nothing in it that its list does not name.
        if self.is_held() && is_there(&set.decided)? {
            return Err(Error::refused(
                "file/foreign-remains",
                format!(
                    "{} holds what no run of this program has put there",
                    set.decided.display()
                ),
                "remove this hidden folder, and try again",
            ));
        }
        rename(&unfinished.0, &set.decided).map_err(|error| set.not_decided(error))?;
        // From here on the new ones stand: nothing is thrown away.
        unfinished.0 = PathBuf::new();
        part::flush_folder_of(&set.decided).map_err(Error::io("flush the folder of", &set.decided))?;
        set.finish()?;
        set.check_own(&own)?;
        Ok(written)
    }
}

/// Finish what a killed run has left in the folder of a file that is to be read.
///
/// # Errors
/// If the folder does not let it, or the user stops the run while it waits for another.
pub fn settled(path: &Path, progress: &dyn Progress) -> Result<()> {
    let folder = part::folder_of(path);
    // A folder that may not be listed, or is not there, is found out about when the file is read.
    let left = hidden_folders(folder).unwrap_or_default();
    if left.iter().any(|name| name.ends_with(DECIDED)) {
        FolderLock::wait(folder, progress, || ())?;
    }
    Ok(())
}

/// Names and contents of the lists of all results in a folder; none of a folder that may not be listed.
fn lists_in(folder: &Path) -> Result<Vec<(String, SetManifest)>> {
    let mut lists = Vec::new();
    for entry in entries(folder).unwrap_or_default() {
        let name = entry.to_string_lossy();
        if name.starts_with('.')
            && name.ends_with(MANIFEST)
            && let Some(list) = SetManifest::read(&folder.join(&entry))?
        {
            lists.push((name.into_owned(), list));
        }
    }
    Ok(lists)
}

/// Refuse a file that is not the one that was written with the others of its result: one that was altered, or one of another run.
/// A file that no list of a result names is taken as it is.
///
/// # Errors
/// If it is another file, cannot be read, or as [`settled`].
pub fn check_unaltered(path: &Path) -> Result<()> {
    settled(path, &Silent)?;
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return Ok(());
    };
    for (list, manifest) in lists_in(part::folder_of(path))? {
        if manifest.digest(name).is_some_and(|wanted| !wanted.is_of(path)) {
            return Err(Error::refused(
                "file/altered",
                format!(
                    "{} is not the file that {list} beside it lists: it was altered, or is of another run",
                    path.display()
                ),
                format!("make the files again; if the change is meant, remove {list}"),
            ));
        }
    }
    Ok(())
}

/// Finish what killed runs have left in the folder of a lock, and remove what they had begun.
///
/// # Errors
/// If the disk refuses.
pub(super) fn settle(turn: &FolderLock) -> Result<()> {
    finish_decided(turn)?;
    // A folder that may be written and not listed is written all the same.
    let left = hidden_folders(turn.folder()).unwrap_or_default();
    let mut unfinished = left.iter().filter(|name| turn.is_held() && is_of_run(name));
    unfinished.try_for_each(|name| remove_tree(&turn.folder().join(name)))
}

/// Finish what other runs have decided.
fn finish_decided(turn: &FolderLock) -> Result<()> {
    for name in hidden_folders(turn.folder()).unwrap_or_default() {
        let set = name.strip_prefix('.').and_then(|name| name.strip_suffix(DECIDED));
        let Some(set) = set.and_then(|set| FileSet::of(turn.folder(), set).ok()) else {
            continue;
        };
        if !turn.is_held() {
            wait_for_other(&set.decided)?;
        }
        set.finish()?;
    }
    Ok(())
}

/// True for the name of a hidden folder that a run makes: `.SET.HOST-PROCESS-NUMBER.unfinished`.
fn is_of_run(name: &str) -> bool {
    let middle = name.strip_suffix(UNFINISHED).and_then(|name| name.rsplit_once('.'));
    middle.is_some_and(|(_, run)| {
        let mut numbers = run.rsplit('-');
        let is_number = |text: Option<&str>| text.is_some_and(|text| text.parse::<u32>().is_ok());
        is_number(numbers.next()) && is_number(numbers.next()) && numbers.next().is_some()
    })
}

/// Wait for another run, which may be a killed one, to put its files into place.
pub(super) fn wait_for_other(decided: &Path) -> Result<()> {
    let begun = Instant::now();
    while is_there(decided)? && begun.elapsed() < PATIENCE {
        std::thread::sleep(super::folder_lock::PAUSE);
    }
    Ok(())
}

fn entries(folder: &Path) -> io::Result<Vec<std::ffi::OsString>> {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name())).collect()
}

/// Names of the hidden folders in a folder that are those of sets.
fn hidden_folders(folder: &Path) -> io::Result<Vec<String>> {
    let names = entries(folder)?.into_iter().filter_map(|name| name.into_string().ok());
    let is_one = |name: &String| {
        name.starts_with('.')
            && (name.ends_with(DECIDED) || name.ends_with(UNFINISHED))
            && fs::symlink_metadata(folder.join(name)).is_ok_and(|found| found.is_dir())
    };
    Ok(names.filter(is_one).collect())
}

/// Hidden folder of the files under way, if it is not renamed; removed with what it holds.
struct Unfinished(PathBuf);

impl Unfinished {
    fn new(set: &FileSet) -> Result<Self> {
        part::new_of_run(&set.folder.join(format!(".{}", set.name)), UNFINISHED, |path| {
            fs::create_dir(path)
        })
        .map(|(path, ())| Self(path))
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Name and paths of a set.
struct FileSet {
    name: String,
    folder: PathBuf,
    decided: PathBuf,
    manifest: PathBuf,
}

/// One operation of the way to the places. It can be done again; a run may end between any two.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Remove(PathBuf),
    Rename(PathBuf, PathBuf),
    RemoveFolder(PathBuf),
}

impl Step {
    fn perform(&self) -> Result<()> {
        match self {
            Self::Remove(path) => AtomicFile::discard(path),
            Self::Rename(from, to) => match fs::rename(from, to) {
                // Without locks another run may have done it.
                Err(error) if error.kind() != io::ErrorKind::NotFound => Err(Error::io("rename to", to)(error)),
                _ => Ok(()),
            },
            // One that is not empty is that of another run, which has come in between.
            Self::RemoveFolder(path) => match fs::remove_dir(path) {
                Err(error) if !matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::DirectoryNotEmpty) => {
                    Err(Error::io("remove", path)(error))
                }
                _ => Ok(()),
            },
        }
    }
}

impl FileSet {
    fn of(folder: &Path, name: &str) -> Result<Self> {
        if !is_plain(name) {
            return Err(unusual(&folder.join(name)));
        }
        let hidden = |ending: &str| folder.join(format!(".{name}{ending}"));
        Ok(Self {
            name: name.to_owned(),
            folder: folder.to_owned(),
            decided: hidden(DECIDED),
            manifest: hidden(MANIFEST),
        })
    }

    /// List the written files in their folder, when all are there and can take their places.
    fn complete(&self, unfinished: &Path, stale: &[&str], is_listed: bool) -> Result<SetManifest> {
        let mut names = Vec::new();
        for name in entries(unfinished).map_err(Error::io("read", unfinished))? {
            let target = self.folder.join(&name);
            let name = name.into_string().ok().filter(|name| is_plain(name));
            names.push(name.ok_or_else(|| unusual(&target))?);
            if target.is_dir() {
                return Err(Error::refused(
                    "file/is-a-folder",
                    format!("{} is a folder", target.display()),
                    "name a file in it, or another file",
                ));
            }
        }
        names.sort();
        let manifest = SetManifest::of(unfinished, &names, stale, is_listed)?;
        let list = unfinished.join(self.manifest.file_name().expect("it has a name"));
        AtomicFile::write(&list, manifest.text().as_bytes())?;
        Ok(manifest)
    }

    /// An error of writing, by the path that the user knows.
    fn in_its_place(&self, error: Error, unfinished: &Path) -> Error {
        match error {
            Error::Io { action, path, source } => Error::Io {
                action,
                path: match path.strip_prefix(unfinished) {
                    Ok(rest) if rest.as_os_str().is_empty() => self.folder.clone(),
                    Ok(rest) => self.folder.join(rest),
                    Err(_) => path,
                },
                source,
            },
            other => other,
        }
    }

    /// Reason why the new files do not count.
    fn not_decided(&self, error: Error) -> Error {
        match is_there(&self.decided) {
            Ok(true) => self.replaced(),
            _ => error,
        }
    }

    fn replaced(&self) -> Error {
        Error::refused(
            "file/changed-meanwhile",
            format!(
                "another process wrote the files of `{}` in {} at the same time",
                self.name,
                self.folder.display()
            ),
            "let one program at a time write into this folder, and try again",
        )
    }

    /// Do what is left to do.
    fn finish(&self) -> Result<()> {
        let done = || -> Result<()> {
            self.steps()?.iter().try_for_each(Step::perform)?;
            part::flush_folder_of(&self.manifest).map_err(Error::io("flush the folder of", &self.manifest))
        };
        done().map_err(|error| match error {
            // The error of a full disk says that nothing was replaced.
            Error::Io { action, path, source } => Error::Io {
                action,
                path,
                source: io::Error::other(format!(
                    "{source}; the new files are complete in {}, and the next run into this folder puts them into their places",
                    self.decided.display()
                )),
            },
            other => other,
        })
    }

    /// List of the files that make place for new ones, besides those of their names.
    fn old(&self, new: &SetManifest) -> Result<SetManifest> {
        if new.is_listed {
            Ok(SetManifest::read(&self.manifest)?.unwrap_or_default())
        } else {
            Ok(SetManifest::default())
        }
    }

    /// Names of all files that new ones replace or remove.
    fn replaced_by(&self, new: &SetManifest) -> Result<Vec<String>> {
        let old = self.old(new)?;
        Ok(old
            .names()
            .chain(new.stale())
            .chain(new.names())
            .map(str::to_owned)
            .collect())
    }

    /// Refuse to replace or remove files that the list of another result names, unless they stay the same: that result would be mixed.
    /// A result whose list goes too goes as a whole.
    fn check_not_of_others(&self, replaced: &[String], unfinished: &Path) -> Result<()> {
        let lists = lists_in(&self.folder)?.into_iter();
        let stays = |list: &str| self.folder.join(list) != self.manifest && !replaced.iter().any(|name| name == list);
        for (list, other) in lists.filter(|(list, _)| stays(list)) {
            let is_mixed = |name: &&String| {
                other.names().any(|listed| listed == *name)
                    && self.folder.join(name).exists()
                    && !other
                        .digest(name)
                        .is_some_and(|digest| digest.is_of(&unfinished.join(name)))
            };
            if let Some(name) = replaced.iter().find(is_mixed) {
                return Err(Error::refused(
                    "file/of-another-result",
                    format!(
                        "{} is of another result, whose files {list} beside it lists",
                        self.folder.join(name).display()
                    ),
                    format!("write into another folder, or remove the other result and {list}"),
                ));
            }
        }
        Ok(())
    }

    /// Everything that is left to do.
    fn steps(&self) -> Result<Vec<Step>> {
        let list = self.decided.join(self.manifest.file_name().expect("it has a name"));
        let clear = Step::RemoveFolder(self.decided.clone());
        let Some(new) = SetManifest::read(&list)? else {
            return Ok(if is_there(&self.decided)? {
                vec![clear]
            } else {
                Vec::new()
            });
        };
        let old = self.old(&new)?;
        let mut coming = Vec::new();
        for name in new.names() {
            let from = self.decided.join(name);
            if is_there(&from)? {
                coming.push((from, self.folder.join(name)));
            }
        }
        let is_in_place =
            |name: &str| new.names().any(|n| n == name) && !coming.iter().any(|(from, _)| from.ends_with(name));
        let mut steps = Vec::new();
        for name in old.names().chain(new.stale()).chain(new.names()) {
            let step = Step::Remove(self.folder.join(name));
            let is_old = fs::symlink_metadata(self.folder.join(name)).is_ok_and(|found| !found.is_dir());
            if is_old && !is_in_place(name) && !steps.contains(&step) {
                steps.push(step);
            }
        }
        let last = if new.is_listed {
            steps.push(Step::Remove(self.manifest.clone()));
            Step::Rename(list, self.manifest.clone())
        } else {
            Step::Remove(list)
        };
        steps.extend(coming.into_iter().map(|(from, to)| Step::Rename(from, to)));
        steps.push(last);
        steps.push(clear);
        Ok(steps)
    }

    /// What tells the files of this run from others.
    fn identities(&self, unfinished: &Path) -> Result<Vec<(PathBuf, Metadata)>> {
        let names = entries(unfinished).map_err(Error::io("read", unfinished))?;
        let identity = |name| {
            let path = unfinished.join(&name);
            let found = fs::symlink_metadata(&path).map_err(Error::io("read", &path))?;
            Ok((self.folder.join(name), found))
        };
        names.into_iter().map(identity).collect()
    }

    /// Succeeds if the files of this run are in their places: where there are no locks, another may have come between.
    fn check_own(&self, own: &[(PathBuf, Metadata)]) -> Result<()> {
        let is_own = |(path, found): &(PathBuf, Metadata)| {
            fs::symlink_metadata(path).is_ok_and(|there| part::same(&there, found))
        };
        if own.iter().all(is_own) {
            Ok(())
        } else {
            Err(self.replaced())
        }
    }
}

fn unusual(path: &Path) -> Error {
    Error::refused(
        "file/unusual-name",
        format!("{} has a name that a list of files cannot hold", path.display()),
        "name a file without line breaks, control characters, backslashes and bytes that are no text",
    )
}

#[cfg(all(test, unix))]
mod tests;
