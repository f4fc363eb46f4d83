//! Reads files. A file to which several elements refer is read once, except a file with a signal dictionary.

use std::collections::HashMap;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use fmu_description::limits::in_force;
use fmu_description::package::{PackageError, TemporaryFolder, Unpacked, unpack_archive};

use crate::error::{SspError, missing};
use crate::read::{read_ssb, read_ssd};
use crate::source::{Base, Target};
use crate::structure::{ParameterMapping, ParameterSet, SignalDictionary, Source};
use crate::tree::{Document, File};

/// Name of the default SSD in an SSP (section 3).
const DEFAULT: &str = "SystemStructure.ssd";
/// Largest accepted XML file in bytes.
const CAPACITY: u64 = 64 << 20;

/// Why the target of a reference cannot be used.
pub(super) enum Missing {
    /// The reference is wrong; the sentence belongs to the position of the reference.
    Reference(String),
    /// The target cannot be read, or its content is wrong; the error names the target.
    Content(SspError),
}

impl Missing {
    /// Converts to an error; `here` adds the position of the reference to a sentence.
    pub(super) fn or(self, here: impl Fn(String) -> SspError) -> SspError {
        match self {
            Missing::Reference(sentence) => here(sentence),
            Missing::Content(error) => error,
        }
    }
}

/// The files read so far, by path.
#[derive(Default)]
pub(crate) struct Files {
    documents: HashMap<PathBuf, Rc<Document>>,
    pub(super) values: HashMap<PathBuf, Rc<ParameterSet>>,
    pub(super) mappings: HashMap<PathBuf, Rc<ParameterMapping>>,
    fmu_indices: HashMap<PathBuf, usize>,
    archives: HashMap<PathBuf, PathBuf>,
    /// The folders of the unpacked archives, removed on drop.
    pub(crate) folders: Vec<TemporaryFolder>,
    pub(crate) fmus: Vec<Unpacked>,
    /// Names of the FMUs for messages.
    pub(crate) shown: Vec<PathBuf>,
    /// Warnings about the files; each names the file.
    pub(crate) warnings: Vec<String>,
}

impl Files {
    /// Returns the SSD at the user's path: an SSD file, or in a folder or SSP the SSD called `fragment`, by default
    /// `SystemStructure.ssd`.
    pub(super) fn document(&mut self, target: &Target) -> Result<Rc<Document>, SspError> {
        let is_ssd = target.path.extension().is_some_and(|extension| extension == "ssd");
        if target.path.is_dir() {
            let name = target.fragment.as_deref().unwrap_or(DEFAULT);
            let inner = Target::new(target.path.join(name), target.shown.join(name));
            return self.document(&inner);
        }
        let outside = Base { folder: PathBuf::new(), shown: PathBuf::new(), archive: None };
        self.referred(target, &outside, !is_ssd)
    }

    /// Returns the SSD that a component refers to: the file `target` or, if this is an `archive`, the SSD in it called
    /// `fragment`, by default `SystemStructure.ssd`. `base` is the base of the file that contains the component.
    pub(super) fn referred(
        &mut self,
        target: &Target,
        base: &Base,
        archive: bool,
    ) -> Result<Rc<Document>, SspError> {
        if !archive {
            return self.ssd(target, base.of_file(target));
        }
        let folder = self.unpacked(target)?;
        let base = Base::archive(&folder, &target.shown);
        let shown = target.shown.display().to_string();
        let name = target.fragment.as_deref().unwrap_or(DEFAULT);
        if name.contains('/') {
            return Err(missing(shown, "the name of an SSD at the root of the SSP", name));
        }
        let inner = Target::new(folder.join(name), target.shown.join(name));
        if !inner.path.is_file() {
            return Err(missing(shown, format!("{name} at its root"), definitions_in(&folder)));
        }
        self.ssd(&inner, base)
    }

    fn ssd(&mut self, target: &Target, base: Base) -> Result<Rc<Document>, SspError> {
        if let Some(known) = self.documents.get(&target.path) {
            return Ok(known.clone());
        }
        let shown = target.shown.clone();
        let structure = self.read(target, read_ssd)?;
        let definitions = structure.definitions.clone();
        let file = Rc::new(File { shown, base, definitions });
        let document = Rc::new(Document { structure, file });
        self.documents.insert(target.path.clone(), document.clone());
        Ok(document)
    }

    /// Returns the folder of an unpacked SSP; unpacks the SSP on the first call and adds the warnings of this SSP.
    fn unpacked(&mut self, target: &Target) -> Result<PathBuf, SspError> {
        if let Some(known) = self.archives.get(&target.path) {
            return Ok(known.clone());
        }
        let unpacked = unpack_archive(&target.path);
        let (folder, warnings) = unpacked.map_err(|error| with_shown_path(error, target))?;
        self.warn(&target.shown, warnings);
        let place = folder.path().to_owned();
        self.folders.push(folder);
        self.archives.insert(target.path.clone(), place.clone());
        Ok(place)
    }

    fn warn(&mut self, shown: &Path, sentences: impl IntoIterator<Item = String>) {
        let sentences = sentences.into_iter();
        self.warnings.extend(sentences.map(|text| format!("{}: {text}", shown.display())));
    }

    /// Returns the index of the FMU `target`, an archive or a folder; opens the FMU on the first call and adds its
    /// warnings.
    pub(crate) fn fmu(&mut self, target: &Target) -> Result<usize, SspError> {
        if let Some(known) = self.fmu_indices.get(&target.path) {
            return Ok(*known);
        }
        let path = &target.path;
        let unpacked = if path.is_dir() { Unpacked::in_folder(path) } else { Unpacked::open(path) };
        let unpacked = unpacked.and_then(|fmu| {
            // If a library has to be built from source code, all files are unpacked.
            let is_built =
                !path.is_dir() && fmu.has_sources() && super::check_library(&fmu).is_err();
            if is_built { Unpacked::open_whole(path) } else { Ok(fmu) }
        });
        let unpacked = unpacked.map_err(|error| with_shown_path(error, target))?;
        self.warn(&target.shown, unpacked.archive_warnings.clone());
        self.warn(&target.shown, unpacked.warnings.iter().map(ToString::to_string));
        self.fmus.push(unpacked);
        self.shown.push(target.shown.clone());
        self.fmu_indices.insert(path.clone(), self.fmus.len() - 1);
        Ok(self.fmus.len() - 1)
    }

    /// Returns the content of `source`: inline, from `cache`, or from a file that `parse` reads. `component` is the
    /// base of URIs relative to the component.
    pub(super) fn content<T: Clone>(
        &mut self,
        source: &Source<T>,
        file: &File,
        component: Option<&Base>,
        cache: impl Fn(&mut Self) -> &mut HashMap<PathBuf, Rc<T>>,
        parse: impl Fn(&[u8]) -> Result<(T, Vec<String>), SspError>,
    ) -> Result<Rc<T>, Missing> {
        let (uri, base) = match source {
            Source::Inline(content) => return Ok(Rc::new(content.clone())),
            Source::File { uri, in_component: false } => (uri, Some(&file.base)),
            Source::File { uri, in_component: true } => (uri, component),
        };
        let sentence = "a system has no component that sourceBase could mean";
        let base = base.ok_or_else(|| Missing::Reference(sentence.to_owned()))?;
        let target = base.resolve(uri).map_err(Missing::Reference)?;
        if let Some(known) = cache(self).get(&target.path) {
            return Ok(known.clone());
        }
        let content = Rc::new(self.read(&target, parse).map_err(Missing::Content)?);
        cache(self).insert(target.path, content.clone());
        Ok(content)
    }

    /// Reads and parses a file; adds the warnings about the file.
    pub(crate) fn read<T>(
        &mut self,
        target: &Target,
        read: impl Fn(&[u8]) -> Result<(T, Vec<String>), SspError>,
    ) -> Result<T, SspError> {
        let failed = |source| {
            let (action, path) = ("read", target.shown.clone());
            SspError::File { action, path, source }
        };
        let file = fs::File::open(&target.path).map_err(failed)?;
        let mut bytes = Vec::new();
        file.take(in_force(CAPACITY).saturating_add(1)).read_to_end(&mut bytes).map_err(failed)?;
        let (content, warnings) = read(&bytes).map_err(|error| error.in_file(&target.shown))?;
        self.warn(&target.shown, target.warning.clone());
        self.warn(&target.shown, warnings);
        Ok(content)
    }

    /// Returns a signal dictionary and the name of its file.
    pub(super) fn dictionary(
        &mut self,
        source: &Source<SignalDictionary>,
        file: &File,
    ) -> Result<(SignalDictionary, PathBuf), Missing> {
        match source {
            Source::Inline(dictionary) => Ok((dictionary.clone(), file.shown.clone())),
            Source::File { uri, .. } => {
                let target = file.base.resolve(uri).map_err(Missing::Reference)?;
                let read = self.read(&target, read_ssb).map_err(Missing::Content)?;
                Ok((read, target.shown))
            }
        }
    }
}

/// Replaces the path of an unpacked copy in the error by the name that the user knows; adds this name if there is no
/// path.
fn with_shown_path(error: PackageError, target: &Target) -> SspError {
    let path = target.shown.clone();
    let is_itself = |named: &Path| named == target.path;
    let error = match error {
        PackageError::File { action, path: named, source } if is_itself(&named) => {
            PackageError::File { action, path, source }
        }
        PackageError::Archive { source, .. } => PackageError::Archive { path, source },
        PackageError::Limit { limit, unit, help, .. } => {
            PackageError::Limit { path, limit, unit, help }
        }
        PackageError::Description { source, .. } => PackageError::Description { path, source },
        error => return SspError::In { file: path, reason: Box::new(error.into()) },
    };
    error.into()
}

/// Lists up to ten SSD files at the root of an unpacked SSP; without any, names the default SSD in a folder there.
fn definitions_in(folder: &Path) -> String {
    let names = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_ssd = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "ssd");
    let names = names.map(|entry| PathBuf::from(entry.file_name())).filter(is_ssd);
    let mut names: Vec<String> = names.map(|name| name.display().to_string()).collect();
    names.sort();
    names.truncate(10);
    if !names.is_empty() {
        return names.join(", ");
    }
    let inner = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut inner = inner.map(|entry| Path::new(&entry.file_name()).join(DEFAULT));
    let inner = inner.find(|path| folder.join(path).is_file());
    inner.map_or_else(
        || "no SSD".to_owned(),
        |path| format!("{}, which is in a folder", path.display()),
    )
}
