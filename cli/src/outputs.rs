//! Writes the files of a command, all or none, and checks whether an existing file has the same design or results.

use std::ffi::OsString;
use std::io::{ErrorKind, Read as _};
use std::path::{Path, PathBuf};
use std::{fs, io, process};

use anyhow::{Context as _, bail, ensure};
use results::is_stream;

/// Number of bytes at the start of a file in which the identity of its design or results is searched.
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
    /// Adds a file: creates its folder, and calls `write` with the temporary path for its content. Returns an error if
    /// `path` is a folder, a pipe or a device, or if the content cannot be written.
    pub(crate) fn stage<E: Into<anyhow::Error>>(
        &mut self,
        path: &Path,
        write: impl FnOnce(&Path) -> Result<(), E>,
    ) -> anyhow::Result<()> {
        let partial = beside(path, "partial");
        let unwritten = || format!("cannot write {}", path.display());
        check_kind(path)?;
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(unwritten)?;
        }
        self.files.push(Staged { partial: partial.clone(), path: path.to_owned() });
        write(&partial).map_err(Into::into).with_context(unwritten)
    }

    /// Renames all files to their paths. If a file cannot be renamed, restores the former files and returns an error.
    pub(crate) fn commit(mut self) -> anyhow::Result<()> {
        let mut replacements: Vec<Replacement> = Vec::new();
        for Staged { partial, path } in &self.files {
            match Replacement::new(partial, path) {
                Ok(replacement) => replacements.push(replacement),
                Err(error) => {
                    let replacements = replacements.into_iter().rev();
                    let new: String = replacements.filter_map(Replacement::undo).collect();
                    bail!("cannot write {}: {error}{new}", path.display());
                }
            }
        }
        for Replacement { former, .. } in replacements {
            let _ = former.map(fs::remove_file);
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

/// A file with new content, and the temporary name of the former file, if a former file existed.
struct Replacement {
    path: PathBuf,
    former: Option<PathBuf>,
}

impl Replacement {
    /// Renames `partial` to `path`; an existing file is complete at every instant.
    fn new(partial: &Path, path: &Path) -> io::Result<Self> {
        let replacement = Self { path: path.to_owned(), former: second_name(path)? };
        fs::rename(partial, path).inspect_err(|_| {
            let _ = replacement.former.as_ref().map(fs::remove_file);
        })?;
        Ok(replacement)
    }

    /// Restores the former file, or removes the new file if there was no former file. On failure returns a clause for
    /// the error message.
    fn undo(self) -> Option<String> {
        let Self { path, former } = self;
        let undone = match &former {
            Some(former) => fs::rename(former, &path),
            None => fs::remove_file(&path),
        };
        let former =
            former.map(|former| format!(", its former content is in {}", former.display()));
        undone.err().map(|_| format!("; {} is new{}", path.display(), former.unwrap_or_default()))
    }
}

/// Writes `bytes` to `path`, completely or not at all; creates its folder if necessary. Writes directly to a pipe or a
/// device.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    files::whole::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// Gives the file at `path` a second, temporary name, by a link, or by a copy where the file system has no links;
/// `None` if there is no file.
fn second_name(path: &Path) -> io::Result<Option<PathBuf>> {
    let mut former = beside(path, "old");
    // A killed process with the same number may have left such a name, even as a link to this file.
    for number in 2.. {
        if former.symlink_metadata().is_err() {
            break;
        }
        former = beside(path, &format!("old{number}"));
    }
    match fs::hard_link(path, &former) {
        Ok(()) => Ok(Some(former)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(_) => match fs::copy(path, &former) {
            Ok(_) => Ok(Some(former)),
            Err(error) => {
                let _ = fs::remove_file(&former);
                Err(error)
            }
        },
    }
}

/// Returns a temporary path in the same folder, with the same extension, the number of this process and `mark`.
fn beside(path: &Path, mark: &str) -> PathBuf {
    let mut name: OsString = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!(".{}.{mark}", process::id()));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// Checks that `path` is neither a folder nor a pipe or a device, which a file would replace.
fn check_kind(path: &Path) -> anyhow::Result<()> {
    let shown = path.display();
    ensure!(!path.is_dir(), "cannot write {shown}: it is a folder");
    ensure!(!is_stream(path), "cannot write {shown}: it is a pipe or a device, expected a file");
    Ok(())
}

/// Checks that the output `path` may be overwritten: the file does not exist, or `identity` is in the first [`HEAD`]
/// bytes or in the design in an FMU. A folder, a pipe, a device or a file that cannot be read is an error.
pub(crate) fn check_identity(path: &Path, identity: &str) -> anyhow::Result<()> {
    check_kind(path)?;
    let mut head = Vec::new();
    let file = match fs::File::open(path) {
        Ok(file) => file,
        // The folder does not exist: the error of the later write says so.
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            return Ok(());
        }
        Err(error) => return Err(error).with_context(|| format!("cannot read {}", path.display())),
    };
    file.take(HEAD).read_to_end(&mut head)?;
    let head = String::from_utf8_lossy(&head);
    if head.contains(identity) || design_in_fmu(path).is_some_and(|text| text.contains(identity)) {
        return Ok(());
    }
    bail!("{} exists and was not written by {identity}; --force overwrites it", path.display())
}

/// Returns the text of the design, or of the Kalman filter, in the resources of an FMU; `None` for other files.
fn design_in_fmu(path: &Path) -> Option<String> {
    let unpacked = fmu_description::package::Unpacked::open_whole(path).ok()?;
    let names = ["design.toml", "filter.toml"];
    names.iter().find_map(|name| fs::read_to_string(unpacked.resources().join(name)).ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn a_pipe_or_a_device_is_not_replaced_by_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let staged = Outputs::default().stage(&path, |path| fs::write(path, "new"));
        for error in [staged.unwrap_err(), check_identity(&path, "design").unwrap_err()] {
            assert!(error.to_string().contains("it is a pipe or a device"), "{error}");
        }
        assert!(files::whole::write(&path, b"new").is_err());
        assert!(is_stream(&path) && fs::read_dir(folder.path()).unwrap().count() == 1);
    }

    #[test]
    fn the_second_name_that_a_killed_process_left_neither_empties_nor_replaces_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second] = ["a.toml", "b.toml"].map(|name| folder.path().join(name));
        fs::write(&first, "former").unwrap();
        let left = beside(&first, "old");
        fs::hard_link(&first, &left).unwrap();
        let mut outputs = Outputs::default();
        for path in [&first, &second] {
            outputs.stage(path, |path| fs::write(path, "new")).unwrap();
        }
        fs::create_dir(&second).unwrap();
        outputs.commit().unwrap_err();
        for path in [&first, &left] {
            assert_eq!(fs::read_to_string(path).unwrap(), "former");
        }
        let mut outputs = Outputs::default();
        outputs.stage(&first, |path| fs::write(path, "new")).unwrap();
        outputs.commit().unwrap();
        assert_eq!(fs::read_to_string(&first).unwrap(), "new");
        assert_eq!(fs::read_to_string(&left).unwrap(), "former");
    }
}
