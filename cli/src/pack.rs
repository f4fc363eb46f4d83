//! `aso-ftc pack`: builds the library of a crate that uses `fmu` and packs it into an FMU.

mod binaries;
mod library;
mod licenses;
#[cfg(feature = "sbom")]
mod sbom;
mod ssp;
mod symbols;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use fmu_description::documentation::page;
use fmu_description::package::Package;
use fmu_description::{ModelDescription, Version, terminals};

use figure::rasterise;

use crate::{models, outputs};

/// The equations of a model, from which the packer makes index.html. The FMU also contains these equations, so that
/// index.html can be made again for another design.
const FRAGMENT: &str = fmu_description::documentation::FRAGMENT;
/// The drawing of a model, from which the packer makes the picture `model.png`.
const DRAWING: &str = "model.svg";

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Crates to pack [default: plant and controller]
    ///
    /// Folders of crates that end in `fmu::export!`, in or outside of this workspace; without one, the
    /// plant and the controller of the clone.
    ///
    /// The FMU contains, besides the library: `resources` and `extra`; `documentation`, with an
    /// index.html made from the description and `documentation/model.html` unless there is one;
    /// `model.png`, or a picture made from `documentation/model.svg`; in FMI 3.0 the terminals of
    /// `terminalsAndIcons/terminalsAndIcons.xml`, or one with all inputs and outputs; the licences of
    /// the crate and of its dependencies.
    #[arg(value_name = "PATH")]
    crates: Vec<PathBuf>,
    /// Folder for the FMUs
    #[arg(long, value_name = "FOLDER", default_value = "dist", help_heading = "Results")]
    out: PathBuf,
    /// Versions of FMI: 2, 3 or both
    ///
    /// `2` writes MODEL.fmu of FMI 2.0, `3` writes MODEL.fmi3.fmu of FMI 3.0, `both` writes both. The
    /// library is the same; on Linux the functions of the other version are hidden in it, because some
    /// importers choose the version by the functions that they find.
    #[arg(long, value_name = "VERSION", default_value = "2", help_heading = "Results")]
    #[arg(hide_possible_values = true)]
    fmi: Versions,
    /// Also write InvertedPendulum.ssp
    ///
    /// It has both FMUs of this workspace, connected, with a stop time of 100 s.
    #[arg(long, conflicts_with = "crates", help_heading = "Results")]
    ssp: bool,
    /// Also write a bill of materials for each FMU
    ///
    /// Needs a command built with the feature `sbom`.
    #[arg(long, help_heading = "Results")]
    sbom: bool,
    /// Also write the model descriptions
    ///
    /// Those of FMI 2.0 and 3.0, into the folder modelDescription of the workspace.
    #[arg(long, conflicts_with = "crates", help_heading = "Results")]
    update_descriptions: bool,
    /// Pack the libraries in this folder
    ///
    /// As FOLDER/win64/MODEL.dll, instead of the one built here.
    #[arg(long, value_name = "FOLDER", help_heading = "Libraries")]
    binaries: Option<PathBuf>,
}

/// The versions of FMI to pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Versions {
    /// FMI 2.0.
    #[value(name = "2")]
    Two,
    /// FMI 3.0.
    #[value(name = "3")]
    Three,
    /// Both, in two archives.
    Both,
}

impl Versions {
    fn list(self) -> &'static [Version] {
        match self {
            Versions::Two => &[Version::V2],
            Versions::Three => &[Version::V3],
            Versions::Both => &[Version::V2, Version::V3],
        }
    }
}

/// Builds and packs the crates stated or, without one, the models of the clone; prints the FMUs and the SSP written.
pub(crate) fn pack(options: &Options) -> anyhow::Result<()> {
    if options.sbom && !cfg!(feature = "sbom") {
        bail!(
            "--sbom: this aso-ftc is built without bills of materials; \
             `cargo run --release --features sbom -- pack --sbom` builds one that writes them"
        );
    }
    let packing = PackOptions {
        out: &options.out,
        binaries: options.binaries.as_deref(),
        sbom: options.sbom,
        locked: options.crates.is_empty(),
        versions: options.fmi,
    };
    for fmu in pack_crates(&options.crates, &packing)? {
        println!("{}", fmu.path.display());
    }
    if !options.crates.is_empty() {
        return Ok(());
    }
    let root = models::clone()?;
    let fmus = pack_models(&root, &packing)?;
    for fmu in &fmus {
        println!("{}", fmu.path.display());
    }
    if options.update_descriptions {
        update_descriptions(&root)?;
    }
    if options.ssp {
        let version = packing.versions.list()[0];
        let of_version = |fmu: &PackedFmu| fmu.description.version() == version;
        let fmus: Vec<_> = fmus.into_iter().filter(of_version).collect();
        println!("{}", ssp::write(&fmus, &options.out)?.display());
    }
    Ok(())
}

struct PackOptions<'a> {
    /// Folder for the FMUs.
    out: &'a Path,
    /// Folder with libraries that were built elsewhere; `None` to build the library for this platform.
    binaries: Option<&'a Path>,
    #[cfg_attr(not(feature = "sbom"), expect(dead_code, reason = "refused without the feature"))]
    sbom: bool,
    /// `--locked` of cargo.
    locked: bool,
    versions: Versions,
}

pub(crate) struct PackedFmu {
    pub(crate) path: PathBuf,
    description: ModelDescription,
}

/// Returns the folder with the FMUs. In a clone, packs its models into `dist`. Outside of a clone, this is the folder
/// beside the command or, without one, `dist` with the models of the clone that the command was built in.
pub(crate) fn folder_of_models(dist: &Path) -> anyhow::Result<PathBuf> {
    if models::clone_upwards()?.is_none()
        && let Some(folder) = models::beside()
    {
        println!("FMUs: {}", folder.display());
        return Ok(folder);
    }
    let (out, versions) = (dist, Versions::Two);
    let packing = PackOptions { out, binaries: None, sbom: false, locked: true, versions };
    pack_models(&models::clone()?, &packing)?;
    Ok(dist.to_owned())
}

fn pack_models(root: &Path, packing: &PackOptions<'_>) -> anyhow::Result<Vec<PackedFmu>> {
    pack_crates(&models::CRATES.map(|model| root.join(model)), packing)
}

/// Writes the model descriptions of both versions of FMI to the folder modelDescription.
fn update_descriptions(root: &Path) -> anyhow::Result<()> {
    let folders = models::CRATES.map(|model| root.join(model));
    let libraries = library::build(&folders, true, &[])?;
    for ((model, folder), library) in models::CRATES.iter().zip(&folders).zip(&libraries) {
        for &version in Versions::Both.list() {
            let resources = folder.join("resources");
            let (xml, description) =
                fmu_import::described_as(&library.file, &resources, model, version)?;
            let name = format!("{}.xml", file_stem(&description));
            let target = root.join("modelDescription").join(name);
            outputs::write(&target, xml.as_bytes())?;
        }
    }
    Ok(())
}

/// Returns the name of the archive and of the committed description without extension: `MODEL`, in FMI 3.0
/// `MODEL.fmi3`.
fn file_stem(description: &ModelDescription) -> String {
    let name = &description.model_name;
    if description.version() == Version::V3 { format!("{name}.fmi3") } else { name.clone() }
}

/// Builds the libraries of crates and packs each, once for each version of FMI.
fn pack_crates(folders: &[PathBuf], packing: &PackOptions<'_>) -> anyhow::Result<Vec<PackedFmu>> {
    let others = packing.binaries.map_or(Ok(Vec::new()), binaries::targets)?;
    let libraries = library::build(folders, packing.locked, &others)?;
    let mut fmus: Vec<PackedFmu> = Vec::new();
    for (folder, library) in folders.iter().zip(&libraries) {
        for &version in packing.versions.list() {
            let fmu = pack_version(folder, packing, library, version, &fmus)
                .with_context(|| format!("cannot pack {}", folder.display()))?;
            fmus.push(fmu);
        }
    }
    Ok(fmus)
}

/// Packs a crate for a version of FMI. It is an error if one of the FMUs `before` has the same path.
fn pack_version(
    folder: &Path,
    packing: &PackOptions<'_>,
    library: &library::Library,
    version: Version,
    before: &[PackedFmu],
) -> anyhow::Result<PackedFmu> {
    let resources = folder.join("resources");
    let (xml, description) =
        fmu_import::described_as(&library.file, &resources, &library.package.name, version)?;
    let path = packing.out.join(format!("{}.fmu", file_stem(&description)));
    if before.iter().any(|fmu| fmu.path == path) {
        let path = path.display();
        bail!("{path} is the FMU of another of these crates; --out names another folder");
    }
    let mut package = Package::new(xml).for_version(version);
    let libraries = match packing.binaries {
        Some(folder) => binaries::collect(folder, &description)?,
        None => vec![native_library(library, &description)?],
    };
    for (path, mut bytes) in libraries {
        symbols::hide_unneeded(&mut bytes, version, resources.is_dir());
        package.add(binaries::path_in(version, path), bytes);
    }
    for name in ["resources", "extra"] {
        let path = folder.join(name);
        if path.is_dir() {
            package.add_folder(name, &path)?;
        }
    }
    add_documentation(&mut package, folder, &description)?;
    add_picture(&mut package, folder, version)?;
    if version == Version::V3 {
        add_terminals(&mut package, folder, &description)?;
    }
    licenses::add(&mut package, library)?;
    package.write(&path)?;
    #[cfg(feature = "sbom")]
    if packing.sbom {
        let bill = sbom::bill(&description, library, packing.binaries.is_some())?;
        outputs::write(&path.with_extension("cdx.json"), &bill)?;
    }
    Ok(PackedFmu { path, description })
}

/// Returns path in the FMU and bytes of the library that was built here. Returns an error if FMI has no name for this
/// platform.
fn native_library(
    library: &library::Library,
    description: &ModelDescription,
) -> anyhow::Result<(String, Vec<u8>)> {
    let platform = fmu_description::package::platforms_of(description.version());
    let suffix = std::env::consts::DLL_SUFFIX;
    let platform = platform.first().context("FMI has no name for this platform")?;
    let path = format!("binaries/{platform}/{}{suffix}", description.model_name);
    Ok((path, read(&library.file)?))
}

fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

/// Adds the terminals that the author defined, or a terminal with all inputs and outputs. A terminal with an unknown
/// variable is an error.
fn add_terminals(
    package: &mut Package,
    folder: &Path,
    description: &ModelDescription,
) -> anyhow::Result<()> {
    let file = folder.join(terminals::PATH);
    if !file.is_file() {
        package.add(terminals::PATH, terminals::render(description));
        return Ok(());
    }
    let bytes = read(&file)?;
    let all = terminals::read(&bytes).with_context(|| file.display().to_string())?;
    for (terminal, member) in
        all.iter().flat_map(|terminal| terminal.members.iter().map(move |m| (terminal, m)))
    {
        if description.variable(&member.variable).is_none() {
            bail!(
                "{}: terminal {}: expected the name of a variable of {}, found `{}`",
                file.display(),
                terminal.name,
                description.model_name,
                member.variable
            );
        }
    }
    package.add(terminals::PATH, bytes);
    Ok(())
}

/// Adds the author's documentation except the drawing, and an entry page if there is none.
fn add_documentation(
    package: &mut Package,
    folder: &Path,
    description: &ModelDescription,
) -> anyhow::Result<()> {
    let folder = folder.join("documentation");
    let mut fragment = Vec::new();
    let mut has_page = false;
    if folder.is_dir() {
        for item in fs::read_dir(&folder)? {
            let path = item?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            match name.as_str() {
                FRAGMENT => {
                    fragment = read(&path)?;
                    package.add(format!("documentation/{name}"), fragment.clone());
                }
                DRAWING => {}
                _ if path.is_dir() => {
                    package.add_folder(&format!("documentation/{name}"), &path)?;
                }
                _ => {
                    has_page |= name == "index.html";
                    package.add(format!("documentation/{name}"), read(&path)?);
                }
            }
        }
    }
    if !has_page {
        let page = page(description, &String::from_utf8_lossy(&fragment));
        package.add("documentation/index.html", page);
    }
    Ok(())
}

/// Adds `model.png` or, without this file, a picture made from the drawing, if there is one. In FMI 3.0 the picture is
/// the icon (section 2.5.1.5).
fn add_picture(package: &mut Package, folder: &Path, version: Version) -> anyhow::Result<()> {
    let target = if version == Version::V3 { "terminalsAndIcons/icon.png" } else { "model.png" };
    let picture = folder.join("model.png");
    let drawing = folder.join("documentation").join(DRAWING);
    if picture.is_file() {
        let bytes = read(&picture)?;
        if !bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            bail!("{}: expected a PNG file", picture.display());
        }
        package.add(target, bytes);
    } else if drawing.is_file() {
        let svg = read(&drawing)?;
        let bytes = rasterise(&String::from_utf8_lossy(&svg))
            .with_context(|| format!("{}", drawing.display()))?;
        package.add(target, bytes);
    }
    Ok(())
}
