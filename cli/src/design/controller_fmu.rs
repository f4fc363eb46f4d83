//! The controller FMU of a design, made from a packed one: other resources, described anew.

use std::fs;
use std::path::Path;

use anyhow::{Context, bail};
use fmu_description::ModelDescription;
use fmu_description::documentation::page;
use fmu_description::package::{Package, Unpacked};

use crate::pack::{FRAGMENT, describe};

/// The files that make a controller FMU another one.
pub(crate) struct Content<'a> {
    /// `resources/design.toml`.
    pub(crate) design: &'a str,
    /// The plant file, for the documentation.
    pub(crate) plant: &'a str,
}

/// A controller FMU that is not written yet.
pub(crate) struct ControllerFmu {
    pub(crate) description: ModelDescription,
    package: Package,
}

impl ControllerFmu {
    /// Puts `content` into the FMU `base` and lets its library describe itself.
    pub(crate) fn new(base: &Path, content: &Content<'_>) -> anyhow::Result<Self> {
        let unpacked = Unpacked::open_whole(base)
            .with_context(|| format!("cannot open {}, the packed controller", base.display()))?;
        let design = unpacked.resources().join("design.toml");
        if !design.is_file() {
            bail!(
                "{} has no resources/design.toml; expected an AsoController.fmu as `aso-ftc pack` \
                 makes it",
                base.display()
            );
        }
        fs::write(&design, content.design)?;
        let identifier = unpacked.description.co_simulation.as_ref();
        let identifier = identifier.map(|interface| interface.model_identifier.clone());
        let library = unpacked.library(&identifier.unwrap_or_default())?;
        let (xml, description) = describe(&library, &unpacked.resources(), &base.display())?;
        let mut package = Package::new(xml);
        let documentation = unpacked.folder().join("documentation");
        let fragment = fs::read_to_string(documentation.join(FRAGMENT)).unwrap_or_default();
        fs::write(documentation.join("index.html"), page(&description, &fragment))?;
        fs::write(documentation.join("plant.toml"), content.plant)?;
        for entry in fs::read_dir(unpacked.folder())? {
            let path = entry?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            match name.as_str() {
                fmu_description::package::DESCRIPTION => {}
                _ if path.is_dir() => package.add_folder(&name, &path)?,
                _ => package.add(name, fs::read(&path)?),
            }
        }
        Ok(Self { description, package })
    }

    /// Writes it to `path`, with `report` in its documentation: whole or not at all.
    pub(crate) fn write(mut self, path: &Path, report: &str) -> anyhow::Result<()> {
        self.package.add("documentation/report.html", report);
        self.package.write(path).with_context(|| format!("cannot write {}", path.display()))
    }
}
