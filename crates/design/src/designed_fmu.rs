//! Creates the FMUs of a design from packed ones: replaces resources and description.

use std::fs;
use std::path::Path;

use fmu_description::ModelDescription;
use fmu_description::documentation::{FRAGMENT, page};
use fmu_description::package::{Package, Unpacked};
use fmu_description::terminals;
use fmu_import::described_as;

use crate::Error;

/// The files that turn a packed FMU into the FMU of a design.
pub(crate) struct Content<'a> {
    /// The name of the model in the packed FMU.
    pub(crate) model: &'static str,
    /// The files in `resources`, by name.
    pub(crate) resources: &'a [(&'static str, &'a [u8])],
    /// The plant file, for the documentation.
    pub(crate) plant: &'a str,
}

/// An FMU of a design that has not been written yet.
pub struct DesignedFmu {
    pub(crate) description: ModelDescription,
    package: Package,
}

impl DesignedFmu {
    /// Inserts `content` into the packed FMU `base`, whose library then generates the model description. Refuses an FMU
    /// of another model.
    pub(crate) fn new(base: &Path, content: &Content<'_>) -> Result<Self, Error> {
        let unpacked = Unpacked::open_whole(base).map_err(|error| {
            let what = format!("cannot open {}, the packed FMU", base.display());
            Error::from(error).within(what)
        })?;
        let (model, expected) = (&unpacked.description.model_name, content.model);
        if model != expected {
            return Err(Error::Invalid(format!(
                "{} is the FMU of {model}; expected {expected}.fmu as `aso-ftc pack` makes it",
                base.display()
            )));
        }
        for (name, bytes) in content.resources {
            let path = unpacked.resources().join(name);
            fs::create_dir_all(unpacked.resources()).map_err(Error::file("write", &path))?;
            write(&path, bytes)?;
        }
        let identifier = unpacked.description.co_simulation.as_ref();
        let identifier = identifier.map(|interface| interface.model_identifier.clone());
        let library = unpacked.library(&identifier.unwrap_or_default())?;
        let (name, version) = (base.display().to_string(), unpacked.description.version());
        let (xml, description) = described_as(&library, &unpacked.resources(), &name, version)?;
        let mut package = Package::new(xml);
        let documentation = unpacked.folder().join("documentation");
        let fragment = fs::read_to_string(documentation.join(FRAGMENT)).unwrap_or_default();
        write(&documentation.join("index.html"), page(&description, &fragment).as_bytes())?;
        write(&documentation.join("plant.toml"), content.plant.as_bytes())?;
        let folder = unpacked.folder();
        let terminals_file = folder.join(terminals::PATH);
        if terminals_file.is_file() {
            write(&terminals_file, terminals::render(&description).as_bytes())?;
        }
        for entry in fs::read_dir(folder).map_err(Error::file("read", folder))? {
            let path = entry.map_err(Error::file("read", folder))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            match name.as_str() {
                fmu_description::package::DESCRIPTION => {}
                _ if path.is_dir() => package.add_folder(&name, &path)?,
                _ => package.add(name, fs::read(&path).map_err(Error::file("read", &path))?),
            }
        }
        Ok(Self { description, package })
    }

    /// Writes the FMU to `path`, atomically, with `report` in its documentation.
    ///
    /// # Errors
    ///
    /// [`Error`] if the archive cannot be written.
    pub fn write(mut self, path: &Path, report: &str) -> Result<(), Error> {
        self.package.add("documentation/report.html", report);
        self.package
            .write(path)
            .map_err(|error| Error::from(error).within(format!("cannot write {}", path.display())))
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    fs::write(path, bytes).map_err(Error::file("write", path))
}
