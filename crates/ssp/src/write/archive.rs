//! Writes the ZIP archive of an SSP (SSP 1.0.1, section 3).

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

use fmu_description::package::{Unpacked, pack, write_archive};

use crate::error::SspError;

/// Maximum size of an archive without Zip64, which leaves room for the directory of the archive.
const CAPACITY: usize = 1 << 31;

/// The files below `resources`, by path in the archive.
#[derive(Default)]
pub(super) struct Archive {
    entries: BTreeMap<String, Vec<u8>>,
}

impl Archive {
    /// Adds a file to `resources` and returns its path in the archive. If `name` is in use, appends a number to it.
    /// Replaces characters that a URI would have to encode, because some importers do not decode URIs.
    pub(super) fn add(&mut self, name: &str, bytes: Vec<u8>) -> String {
        let plain = |character: char| {
            let is_plain = character.is_ascii_alphanumeric() || "._-".contains(character);
            if is_plain { character } else { '_' }
        };
        let name: String = name.chars().map(plain).collect();
        let (stem, extension) = name.rsplit_once('.').unwrap_or((&name, ""));
        let is_used =
            |path: &str| self.entries.keys().any(|known| known.eq_ignore_ascii_case(path));
        let first = format!("resources/{name}");
        let further = (2..).map(|number| format!("resources/{stem}_{number}.{extension}"));
        let path = std::iter::once(first).chain(further).find(|path| !is_used(path));
        let path = path.unwrap_or_default();
        self.entries.insert(path.clone(), bytes);
        path
    }

    /// Adds the FMU at `path`: copies an archive, packs a folder.
    pub(super) fn add_fmu(&mut self, path: &Path, fmu: &Unpacked) -> Result<String, SspError> {
        let name = &fmu.description.model_name;
        if path.is_dir() {
            let mut entries = BTreeMap::new();
            collect(fmu.folder(), "", &mut entries)?;
            return Ok(self.add(&format!("{name}.fmu"), zip(path, slices(&entries))?));
        }
        let stem = path.file_stem().map_or(name.clone(), |stem| stem.to_string_lossy().into());
        Ok(self.add(&format!("{stem}.fmu"), fs::read(path).map_err(failed("read", path))?))
    }

    /// Writes the archive with `ssd` as its system structure, atomically.
    pub(super) fn write(&self, ssd: &str, target: &Path) -> Result<(), SspError> {
        let ssd = std::iter::once(("SystemStructure.ssd", ssd.as_bytes()));
        let bytes = zip(target, ssd.chain(slices(&self.entries)))?;
        Ok(write_archive(target, &bytes)?)
    }
}

fn failed(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> SspError {
    let path = path.to_owned();
    move |source| SspError::File { action, path, source }
}

/// Collects all files in `folder` recursively; symbolic links are skipped.
fn collect(
    folder: &Path,
    prefix: &str,
    entries: &mut BTreeMap<String, Vec<u8>>,
) -> Result<(), SspError> {
    for item in fs::read_dir(folder).map_err(failed("read", folder))? {
        let item = item.map_err(failed("read", folder))?;
        let kind = item.file_type().map_err(failed("read", &item.path()))?;
        let name = format!("{prefix}{}", item.file_name().to_string_lossy());
        if kind.is_dir() {
            collect(&item.path(), &format!("{name}/"), entries)?;
        } else if kind.is_file() {
            let bytes = fs::read(item.path()).map_err(failed("read", &item.path()))?;
            entries.insert(name, bytes);
        }
    }
    Ok(())
}

fn slices(entries: &BTreeMap<String, Vec<u8>>) -> impl Iterator<Item = (&str, &[u8])> + Clone {
    entries.iter().map(|(path, bytes)| (path.as_str(), bytes.as_slice()))
}

/// Packs the entries in the given order. FMUs are stored, because they are compressed already.
fn zip<'a>(
    target: &Path,
    entries: impl Iterator<Item = (&'a str, &'a [u8])> + Clone,
) -> Result<Vec<u8>, SspError> {
    let sizes = entries.clone().map(|(_, bytes)| bytes.len());
    let total = sizes.fold(0, usize::saturating_add);
    if total > CAPACITY {
        return Err(SspError::Limit { limit: CAPACITY, what: "bytes in an archive", help: "" });
    }
    let is_fmu =
        |path: &str| Path::new(path).extension().is_some_and(|extension| extension == "fmu");
    Ok(pack(target, entries, is_fmu)?)
}
