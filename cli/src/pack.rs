//! `aso-ftc pack`: builds the libraries of the models and packs each into an FMU.
#![expect(clippy::print_stdout, reason = "the result of the command")]

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, bail};
use fmi2::description::ModelDescription;
use fmi2::documentation::page;
use fmi2::package::Package;

use crate::figure::rasterise;

/// The crates that end in an export line.
const MODELS: [&str; 2] = ["fmu-plant", "fmu-controller"];

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder for the FMUs
    #[arg(long, value_name = "FOLDER", default_value = "dist")]
    out: PathBuf,
    /// Also write the model descriptions into the folder modelDescription of the workspace
    #[arg(long)]
    update_descriptions: bool,
}

/// Builds and packs all models.
pub(crate) fn pack(options: &Options) -> anyhow::Result<bool> {
    let root = workspace()?;
    for fmu in pack_into(&root, &options.out)? {
        if options.update_descriptions {
            let name = format!("{}.xml", fmu.description.model_name);
            let target = root.join("modelDescription").join(name);
            std::fs::write(&target, &fmu.xml)
                .with_context(|| format!("cannot write {}", target.display()))?;
        }
        println!("{}", fmu.path.display());
    }
    Ok(true)
}

/// An FMU as packed.
pub(crate) struct Packed {
    pub(crate) path: PathBuf,
    xml: String,
    description: ModelDescription,
}

/// Builds all models of the workspace `root` and packs each into the folder `out`.
pub(crate) fn pack_into(root: &Path, out: &Path) -> anyhow::Result<Vec<Packed>> {
    let libraries = build(root)?;
    MODELS.iter().map(|model| pack_model(root, &libraries, model, out)).collect()
}

/// The folder of this workspace: the nearest one upwards that has the models.
pub(crate) fn workspace() -> anyhow::Result<PathBuf> {
    let here = std::env::current_dir()?;
    here.ancestors()
        .find(|folder| MODELS.iter().all(|model| folder.join(model).join("Cargo.toml").is_file()))
        .map(Path::to_path_buf)
        .with_context(|| {
            let here = here.display();
            format!(
                "{here} is not inside a clone of this project: expected a folder upwards that \
                     has {}",
                MODELS.join(" and ")
            )
        })
}

/// Builds the libraries in the profile `fmu`; the folder they are in.
///
/// Paths of this machine are kept out of them, so that the same sources give the same bytes.
fn build(root: &Path) -> anyhow::Result<PathBuf> {
    let target = root.join("target").join("libraries");
    let cargo_home = std::env::var_os("CARGO_HOME")
        .map(PathBuf::from)
        .or_else(|| std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".cargo")));
    let mut flags = vec![format!("--remap-path-prefix={}=.", root.display())];
    flags.extend(cargo_home.map(|home| format!("--remap-path-prefix={}=cargo", home.display())));
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command
        .current_dir(root)
        .args(["build", "--profile", "fmu", "--locked", "--target-dir"])
        .arg(&target);
    for model in MODELS {
        command.args(["--package", model]);
    }
    command.env("CARGO_ENCODED_RUSTFLAGS", flags.join("\u{1f}"));
    let status = command.status().context("cannot run cargo, which builds the FMUs")?;
    if !status.success() {
        bail!("cargo could not build {}: {status}", MODELS.join(" and "));
    }
    Ok(target.join("fmu"))
}

fn pack_model(root: &Path, libraries: &Path, model: &str, out: &Path) -> anyhow::Result<Packed> {
    let (prefix, suffix) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let library = libraries.join(format!("{prefix}{}{suffix}", model.replace('-', "_")));
    let folder = root.join(model);
    let resources = folder.join("resources");
    let xml = master::describe(&library, &resources)?;
    let description = ModelDescription::parse(xml.as_bytes())
        .with_context(|| format!("the model description of {model}"))?;
    let read = |path: &Path| {
        std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
    };
    let text = read(&folder.join("documentation").join("model.html"))?;
    let drawing = read(&folder.join("documentation").join("model.svg"))?;
    let identifier = &description.model_name;
    let mut package = Package::new(xml.clone());
    package.add(
        format!("binaries/{}/{identifier}{suffix}", fmi2::package::platforms()[0]),
        read(&library)?,
    );
    package.add("documentation/index.html", page(&description, &String::from_utf8_lossy(&text)));
    let licenses = [read(&root.join("LICENSE-MIT"))?, read(&root.join("LICENSE-APACHE"))?];
    let heading = b"At your choice, the MIT License or the Apache License 2.0.\n\n".to_vec();
    let text = [heading, licenses.join(&b"\n\n"[..])].concat();
    package.add("documentation/licenses/license.txt", text);
    package.add("model.png", rasterise(&String::from_utf8_lossy(&drawing))?);
    if resources.is_dir() {
        package.add_folder("resources", &resources)?;
    }
    let path = out.join(format!("{identifier}.fmu"));
    package.write(&path)?;
    Ok(Packed { path, xml, description })
}
