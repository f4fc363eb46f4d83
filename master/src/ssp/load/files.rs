//! Every file once, however often it is referred to.

use std::collections::HashMap;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use fmi2::package::{TemporaryFolder, Unpacked, unpack_archive};

use crate::ssp::error::SspError;
use crate::ssp::read::{read_ssb, read_ssd, read_ssm, read_ssv};
use crate::ssp::source::{Base, Target};
use crate::ssp::structure::{ParameterMapping, ParameterSet, SignalDictionary, Source};
use crate::ssp::tree::{Document, File};

/// Name of the default SSD in an SSP (section 3).
const DEFAULT: &str = "SystemStructure.ssd";
/// Largest XML file that is read.
const CAPACITY: u64 = 64 << 20;

/// Why something that an SSD refers to is not there.
pub(super) enum Missing {
    /// The reference itself is wrong; the sentence belongs to the place where it stands.
    Reference(String),
    /// What it refers to is wrong.
    Content(SspError),
}

impl Missing {
    /// The error, with `here` for a sentence about the reference.
    pub(super) fn or(self, here: impl Fn(String) -> SspError) -> SspError {
        match self {
            Missing::Reference(sentence) => here(sentence),
            Missing::Content(error) => error,
        }
    }
}

/// What has been read so far, by path.
#[derive(Default)]
pub(super) struct Files {
    documents: HashMap<PathBuf, Rc<Document>>,
    values: HashMap<PathBuf, Rc<ParameterSet>>,
    mappings: HashMap<PathBuf, Rc<ParameterMapping>>,
    fmu_indices: HashMap<PathBuf, usize>,
    archives: HashMap<PathBuf, PathBuf>,
    folders: Vec<TemporaryFolder>,
    pub(super) fmus: Vec<Unpacked>,
}

impl Files {
    /// What must live as long as the files are used.
    pub(super) fn finish(self) -> (Vec<Unpacked>, Vec<TemporaryFolder>) {
        (self.fmus, self.folders)
    }

    /// The SSD at a path that the user gave, or the one called `fragment` in an SSP.
    pub(super) fn document(&mut self, target: &Target) -> Result<Rc<Document>, SspError> {
        let is_ssd = target.path.extension().is_some_and(|extension| extension == "ssd");
        if target.path.is_dir() {
            let name = target.fragment.as_deref().unwrap_or(DEFAULT);
            let inner = Target {
                path: target.path.join(name),
                shown: target.shown.join(name),
                fragment: None,
            };
            return self.document(&inner);
        }
        let outside = Base { folder: PathBuf::new(), shown: PathBuf::new(), archive: None };
        self.referred(target, &outside, !is_ssd)
    }

    /// The SSD that a component refers to.
    pub(super) fn referred(
        &mut self,
        target: &Target,
        base: &Base,
        archive: bool,
    ) -> Result<Rc<Document>, SspError> {
        if !archive {
            return self.ssd(target, base.below(target));
        }
        let folder = self.unpacked(&target.path)?;
        let base = Base::archive(&folder, &target.shown);
        let name = target.fragment.as_deref().unwrap_or(DEFAULT);
        if name.contains('/') {
            let (expected, found) = ("the name of an SSD at the root of the SSP", name.to_owned());
            let what = target.shown.display().to_string();
            return Err(SspError::Missing { what, expected: expected.to_owned(), found });
        }
        let inner =
            Target { path: folder.join(name), shown: target.shown.join(name), fragment: None };
        if !inner.path.is_file() {
            let found = definitions_in(&folder);
            let what = target.shown.display().to_string();
            return Err(SspError::Missing { what, expected: format!("{name} at its root"), found });
        }
        self.ssd(&inner, base)
    }

    fn ssd(&mut self, target: &Target, base: Base) -> Result<Rc<Document>, SspError> {
        if let Some(known) = self.documents.get(&target.path) {
            return Ok(known.clone());
        }
        let shown = target.shown.clone();
        let structure = read_file(target, read_ssd)?;
        let definitions = structure.definitions.clone();
        let file = Rc::new(File { shown, base, definitions });
        let document = Rc::new(Document { structure, file });
        self.documents.insert(target.path.clone(), document.clone());
        Ok(document)
    }

    /// The folder of an SSP.
    fn unpacked(&mut self, path: &Path) -> Result<PathBuf, SspError> {
        if let Some(known) = self.archives.get(path) {
            return Ok(known.clone());
        }
        let folder = unpack_archive(path)?;
        let place = folder.path().to_owned();
        self.folders.push(folder);
        self.archives.insert(path.to_owned(), place.clone());
        Ok(place)
    }

    /// Index of the FMU, an archive or a folder.
    pub(super) fn fmu(&mut self, target: &Target) -> Result<usize, SspError> {
        if let Some(known) = self.fmu_indices.get(&target.path) {
            return Ok(*known);
        }
        let path = &target.path;
        let unpacked = if path.is_dir() { Unpacked::in_folder(path) } else { Unpacked::open(path) };
        let unpacked = unpacked.map_err(|error| SspError::In {
            file: target.shown.clone(),
            reason: Box::new(error.into()),
        })?;
        self.fmus.push(unpacked);
        self.fmu_indices.insert(path.clone(), self.fmus.len() - 1);
        Ok(self.fmus.len() - 1)
    }

    pub(super) fn values(
        &mut self,
        source: &Source<ParameterSet>,
        file: &File,
        component: Option<&Base>,
    ) -> Result<Rc<ParameterSet>, Missing> {
        cached(&mut self.values, source, file, component, read_ssv)
    }

    pub(super) fn mapping(
        &mut self,
        source: &Source<ParameterMapping>,
        file: &File,
        component: Option<&Base>,
    ) -> Result<Rc<ParameterMapping>, Missing> {
        cached(&mut self.mappings, source, file, component, read_ssm)
    }

    /// The dictionary and the name of the file that it stands in.
    pub(super) fn dictionary(
        source: &Source<SignalDictionary>,
        file: &File,
    ) -> Result<(SignalDictionary, PathBuf), Missing> {
        match source {
            Source::Inline(dictionary) => Ok((dictionary.clone(), file.shown.clone())),
            Source::File { uri, .. } => {
                let target = file.base.resolve(uri).map_err(Missing::Reference)?;
                let read = read_file(&target, read_ssb).map_err(Missing::Content)?;
                Ok((read, target.shown))
            }
        }
    }
}

fn cached<T: Clone>(
    known: &mut HashMap<PathBuf, Rc<T>>,
    source: &Source<T>,
    file: &File,
    component: Option<&Base>,
    read: fn(&[u8]) -> Result<T, SspError>,
) -> Result<Rc<T>, Missing> {
    let (uri, in_component) = match source {
        Source::Inline(content) => return Ok(Rc::new(content.clone())),
        Source::File { uri, in_component } => (uri, *in_component),
    };
    let base = match (in_component, component) {
        (false, _) => &file.base,
        (true, Some(base)) => base,
        (true, None) => {
            let sentence = "a system has no component that sourceBase could mean";
            return Err(Missing::Reference(sentence.to_owned()));
        }
    };
    let target = base.resolve(uri).map_err(Missing::Reference)?;
    if let Some(known) = known.get(&target.path) {
        return Ok(known.clone());
    }
    let content = Rc::new(read_file(&target, read).map_err(Missing::Content)?);
    known.insert(target.path, content.clone());
    Ok(content)
}

fn read_file<T>(target: &Target, read: fn(&[u8]) -> Result<T, SspError>) -> Result<T, SspError> {
    let failed = |source| {
        let (action, path) = ("read", target.shown.clone());
        SspError::File { action, path, source }
    };
    let file = fs::File::open(&target.path).map_err(failed)?;
    let mut bytes = Vec::new();
    file.take(CAPACITY + 1).read_to_end(&mut bytes).map_err(failed)?;
    read(&bytes).map_err(|error| error.in_file(&target.shown))
}

/// The SSD files at the root of an unpacked SSP.
fn definitions_in(folder: &Path) -> String {
    let names = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_ssd = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "ssd");
    let names = names.map(|entry| PathBuf::from(entry.file_name())).filter(is_ssd);
    let mut names: Vec<String> = names.map(|name| name.display().to_string()).collect();
    names.sort();
    names.truncate(10);
    if names.is_empty() { "no SSD".to_owned() } else { names.join(", ") }
}
