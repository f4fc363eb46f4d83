//! The files that a command writes: over the files of others only on request, all or none.

use std::ffi::OsString;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::{fs, io, process};

use anyhow::{Context as _, bail};

/// Bytes at the start of a file in which its identity is searched.
const HEAD: u64 = 4096;

/// The files to write, each under a temporary name until all are complete.
#[derive(Default)]
pub(crate) struct Outputs {
    files: Vec<Staged>,
}

/// A complete file that does not have its name yet.
struct Staged {
    partial: PathBuf,
    path: PathBuf,
}

impl Outputs {
    /// Adds a file, whose content `write` puts at the path that it is given.
    pub(crate) fn stage<E: Into<anyhow::Error>>(
        &mut self,
        path: &Path,
        write: impl FnOnce(&Path) -> Result<(), E>,
    ) -> anyhow::Result<()> {
        let partial = beside(path, "partial");
        let unwritten = || format!("cannot write {}", path.display());
        if path.is_dir() {
            bail!("cannot write {}: it is a folder", path.display());
        }
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(unwritten)?;
        }
        self.files.push(Staged { partial: partial.clone(), path: path.to_owned() });
        write(&partial).map_err(Into::into).with_context(unwritten)
    }

    /// Gives all files their names. If one cannot have its name, the files that were there before
    /// get theirs back.
    pub(crate) fn commit(mut self) -> anyhow::Result<()> {
        let mut done: Vec<Replaced> = Vec::new();
        for Staged { partial, path } in &self.files {
            match Replaced::new(partial, path) {
                Ok(replaced) => done.push(replaced),
                Err(error) => {
                    let new: String = done.into_iter().rev().filter_map(Replaced::undo).collect();
                    bail!("cannot write {}: {error}{new}", path.display());
                }
            }
        }
        for Replaced { before, .. } in done {
            let _ = before.map(fs::remove_file);
        }
        self.files.clear();
        Ok(())
    }
}

impl Drop for Outputs {
    fn drop(&mut self) {
        for file in &self.files {
            // Fails for a file that was not written.
            let _ = fs::remove_file(&file.partial);
        }
    }
}

/// A file with new content, and the temporary name of the file that was there before.
struct Replaced {
    path: PathBuf,
    before: Option<PathBuf>,
}

impl Replaced {
    /// Renames `partial` to `path`, under which there is a complete file at every instant.
    fn new(partial: &Path, path: &Path) -> io::Result<Self> {
        let replaced = Self { path: path.to_owned(), before: second_name(path)? };
        fs::rename(partial, path).inspect_err(|_| {
            let _ = replaced.before.as_ref().map(fs::remove_file);
        })?;
        Ok(replaced)
    }

    /// Gives the former file its name back; if that fails, returns the end of a sentence about it.
    fn undo(self) -> Option<String> {
        let Self { path, before } = self;
        let undone = match &before {
            Some(before) => fs::rename(before, &path),
            None => fs::remove_file(&path),
        };
        let before =
            before.map(|before| format!(", its former content is in {}", before.display()));
        undone.err().map(|_| format!("; {} is new{}", path.display(), before.unwrap_or_default()))
    }
}

/// Gives the file at `path`, if there is one, a second, temporary name: a link, or a copy where the
/// file system has no links.
fn second_name(path: &Path) -> io::Result<Option<PathBuf>> {
    let before = beside(path, "old");
    match fs::hard_link(path, &before) {
        Ok(()) => Ok(Some(before)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(_) => match fs::copy(path, &before) {
            Ok(_) => Ok(Some(before)),
            Err(error) => {
                let _ = fs::remove_file(&before);
                Err(error)
            }
        },
    }
}

/// A temporary name in the same folder, with the same extension.
fn beside(path: &Path, mark: &str) -> PathBuf {
    let mut name: OsString = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!(".{}.{mark}", process::id()));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// Checks that an output does not exist, or contains `identity`.
pub(crate) fn check_own(path: &Path, identity: &str) -> anyhow::Result<()> {
    let mut head = Vec::new();
    let file = match fs::File::open(path) {
        Ok(file) => file,
        Err(error) => {
            // Without a folder there is no file either; writing names the reason.
            let kinds = [io::ErrorKind::NotFound, io::ErrorKind::NotADirectory];
            let absent = kinds.contains(&error.kind());
            let what = || format!("cannot read {}", path.display());
            return if absent { Ok(()) } else { Err(error).with_context(what) };
        }
    };
    if path.is_dir() {
        bail!("cannot write {}: it is a folder", path.display());
    }
    file.take(HEAD).read_to_end(&mut head)?;
    let head = String::from_utf8_lossy(&head);
    if head.contains(identity) || in_archive(path).is_some_and(|text| text.contains(identity)) {
        return Ok(());
    }
    bail!("{} exists and was not written by {identity}; --force overwrites it", path.display())
}

/// The design in an FMU.
fn in_archive(path: &Path) -> Option<String> {
    let unpacked = fmu_description::package::Unpacked::open_whole(path).ok()?;
    let names = ["design.toml", "filter.toml"];
    names.iter().find_map(|name| fs::read_to_string(unpacked.resources().join(name)).ok())
}
