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
        let mut done: Vec<(PathBuf, Option<PathBuf>)> = Vec::new();
        for Staged { partial, path } in &self.files {
            match replace(partial, path) {
                Ok(old) => done.push((path.clone(), old)),
                Err(error) => {
                    for (path, old) in done.into_iter().rev() {
                        // What fails here leaves the old file under its temporary name.
                        let _ = match old {
                            Some(old) => fs::rename(old, path),
                            None => fs::remove_file(path),
                        };
                    }
                    return Err(error).with_context(|| format!("cannot write {}", path.display()));
                }
            }
        }
        for (_, old) in done {
            let _ = old.map(fs::remove_file);
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

/// Renames `partial` to `path`; returns the temporary name of the file that was there.
fn replace(partial: &Path, path: &Path) -> io::Result<Option<PathBuf>> {
    let old = beside(path, "old");
    let before = match fs::rename(path, &old) {
        Ok(()) => Some(old),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(error),
    };
    if let Err(error) = fs::rename(partial, path) {
        if let Some(old) = before {
            let _ = fs::rename(old, path);
        }
        return Err(error);
    }
    Ok(before)
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
    fs::read_to_string(unpacked.resources().join("design.toml")).ok()
}
