//! Builds the libraries of crates with cargo and lists their dependencies.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::ffi::OsString;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail};
use cargo_metadata::camino::Utf8PathBuf;
use cargo_metadata::{
    Artifact, CrateType, DependencyKind, Message, Metadata, MetadataCommand, Package, PackageId,
    TargetKind,
};

/// The cargo profile `fmu`, for workspaces without a profile of this name.
const PROFILE: &str = include_str!("fmu-profile.toml");

/// The library of a crate, with the list of the packages that it contains.
pub(super) struct Library {
    pub(super) file: PathBuf,
    pub(super) package: Package,
    /// The packages in the library, sorted by name and version.
    pub(super) dependencies: Vec<Package>,
    pub(super) toolchain: Toolchain,
}

/// The compiler that built the library, and whose standard library is a part of it.
#[derive(Clone)]
pub(super) struct Toolchain {
    pub(super) release: String,
    pub(super) sysroot: PathBuf,
    host: String,
}

/// Builds the libraries of the crates in `folders`, in this order. Cargo builds the crates of one workspace together,
/// so that it compiles them in parallel; `locked` is `--locked` of cargo. The dependencies include the dependencies on
/// the targets `others`, for which the libraries are built elsewhere.
///
/// # Errors
///
/// Returns an error if a folder has no crate or the crate is not a `cdylib` (both errors name the folder), or if a
/// crate does not compile.
pub(super) fn build(
    folders: &[PathBuf],
    locked: bool,
    others: &[&str],
) -> anyhow::Result<Vec<Library>> {
    let sources = folders.iter().map(|folder| {
        Source::new(folder, locked).with_context(|| format!("cannot pack {}", folder.display()))
    });
    let sources = sources.collect::<anyhow::Result<Vec<_>>>()?;
    let mut artifacts: HashMap<&Utf8PathBuf, Vec<Artifact>> = HashMap::new();
    for source in &sources {
        if let Entry::Vacant(entry) = artifacts.entry(source.workspace()) {
            let members = sources.iter().filter(|member| member.workspace() == source.workspace());
            entry.insert(compile(source, members, locked)?);
        }
    }
    sources
        .iter()
        .map(|source| source.library(&artifacts[source.workspace()], others, locked))
        .collect()
}

/// A crate whose library is to be built.
struct Source {
    folder: PathBuf,
    metadata: Metadata,
    package: Package,
    toolchain: Toolchain,
}

impl Source {
    fn new(folder: &Path, locked: bool) -> anyhow::Result<Self> {
        let folder = std::path::absolute(folder)?;
        let manifest = folder.join("Cargo.toml");
        let manifest = manifest.display();
        if !folder.join("Cargo.toml").is_file() {
            bail!("there is no {manifest}: expected the folder of a crate that uses fmu");
        }
        let toolchain = Toolchain::of(&folder)?;
        let metadata = metadata(&folder, &toolchain.host, locked)?;
        let Some(package) = metadata.root_package() else {
            bail!("{manifest} is a workspace: expected the folder of one of its crates");
        };
        if !package.targets.iter().any(|target| target.crate_types.contains(&CrateType::CDyLib)) {
            bail!("{manifest}: expected a library with crate-type = [\"cdylib\"] under [lib]");
        }
        let package = package.clone();
        Ok(Self { folder, metadata, package, toolchain })
    }

    fn workspace(&self) -> &Utf8PathBuf {
        &self.metadata.workspace_root
    }

    /// Returns the built library, from the artifacts of the workspace.
    fn library(
        &self,
        artifacts: &[Artifact],
        others: &[&str],
        locked: bool,
    ) -> anyhow::Result<Library> {
        let Self { folder, metadata, package, toolchain } = self;
        let mut dependencies = dependencies(metadata, package, artifacts);
        let everywhere: HashSet<_> =
            normal_dependencies(metadata, package).into_iter().map(|package| &package.id).collect();
        for target in others {
            let metadata = self::metadata(folder, target, locked)?;
            let more = normal_dependencies(&metadata, package)
                .into_iter()
                .filter(|package| !everywhere.contains(&package.id));
            let more: Vec<_> =
                more.filter(|other| !dependencies.contains(other)).cloned().collect();
            dependencies.extend(more);
        }
        dependencies
            .sort_by(|one, other| (&one.name, &one.version).cmp(&(&other.name, &other.version)));
        let file = artifacts
            .iter()
            .filter(|artifact| artifact.package_id == package.id)
            .flat_map(|artifact| &artifact.filenames)
            .find(|file| file.extension() == Some(std::env::consts::DLL_EXTENSION))
            .with_context(|| {
                format!("{}: cargo made no library for this platform", folder.display())
            })?;
        Ok(Library {
            file: file.into(),
            package: package.clone(),
            dependencies,
            toolchain: toolchain.clone(),
        })
    }
}

impl Toolchain {
    fn of(folder: &Path) -> anyhow::Result<Self> {
        let answer = |arguments: &[&str]| {
            let output = Command::new(program("RUSTC", "rustc"))
                .current_dir(folder)
                .args(arguments)
                .output()
                .context("cannot run rustc")?;
            if !output.status.success() {
                bail!("rustc: {}", String::from_utf8_lossy(&output.stderr));
            }
            Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
        };
        let version = answer(&["-vV"])?;
        let field = |name: &str| {
            let line = version.lines().find_map(|line| line.strip_prefix(name));
            line.map(str::to_owned).with_context(|| format!("rustc -vV shows no {name:?}"))
        };
        Ok(Self {
            release: field("release: ")?,
            host: field("host: ")?,
            sysroot: answer(&["--print", "sysroot"])?.into(),
        })
    }
}

/// Returns the program in the environment variable `variable`, as cargo does, or `name`.
fn program(variable: &str, name: &str) -> OsString {
    std::env::var_os(variable).unwrap_or_else(|| name.into())
}

/// Returns cargo's metadata of the crate in `folder` and of its dependencies on the target `host`.
fn metadata(folder: &Path, host: &str, locked: bool) -> anyhow::Result<Metadata> {
    let mut options = vec!["--filter-platform".to_owned(), host.to_owned()];
    options.extend(locked.then(|| "--locked".to_owned()));
    let mut command = MetadataCommand::new();
    command.cargo_path(program("CARGO", "cargo")).current_dir(folder).other_options(options);
    command.exec().map_err(|error| match error {
        cargo_metadata::Error::CargoMetadata { stderr } => anyhow::anyhow!("{}", stderr.trim()),
        other => other.into(),
    })
}

/// Builds the libraries of `members`, crates of the workspace of `source`, with the profile `fmu`;
/// returns all artifacts.
///
/// The libraries contain no local path, so that the same sources give the same bytes. Only code written by a build
/// script can contain the path of the target folder. The flag that replaces this path has a cost: cargo builds
/// everything again after the folder is moved. The flag is therefore added, in a second build, only if a library
/// contains the path; a marker file records this for later calls.
fn compile<'a>(
    source: &Source,
    members: impl Iterator<Item = &'a Source>,
    locked: bool,
) -> anyhow::Result<Vec<Artifact>> {
    let ids: Vec<_> = members.flat_map(|member| ["-p", &member.package.id.repr]).collect();
    let target = &source.metadata.target_directory;
    let marker = target.join("libraries/target-is-remapped");
    let mut flags = remappings(&source.metadata);
    if !marker.exists() {
        let artifacts = call_cargo(source, &ids, locked, &flags)?;
        if !contain(&artifacts, target.as_str())? {
            return Ok(artifacts);
        }
        std::fs::write(&marker, "").with_context(|| format!("cannot write {marker}"))?;
    }
    flags.push(format!("--remap-path-prefix={target}=target"));
    call_cargo(source, &ids, locked, &flags)
}

/// Whether a library among the artifacts contains `text`.
fn contain(artifacts: &[Artifact], text: &str) -> anyhow::Result<bool> {
    let is_library =
        |artifact: &&Artifact| artifact.target.crate_types.contains(&CrateType::CDyLib);
    for file in artifacts.iter().filter(is_library).flat_map(|artifact| &artifact.filenames) {
        let bytes = std::fs::read(file).with_context(|| format!("cannot read {file}"))?;
        if bytes.windows(text.len()).any(|part| part == text.as_bytes()) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Builds the packages `ids` of the workspace of `source` with compiler flags; returns all artifacts.
fn call_cargo(
    source: &Source,
    ids: &[&str],
    locked: bool,
    flags: &[String],
) -> anyhow::Result<Vec<Artifact>> {
    let metadata = &source.metadata;
    let root = &metadata.workspace_root;
    let target = metadata.target_directory.join("libraries");
    let mut command = Command::new(program("CARGO", "cargo"));
    // Depends on the workspace, not on the crates to pack, so that a crate always has the same flags.
    let alone = metadata.workspace_members.len() == 1;
    command.current_dir(&source.folder).arg(if alone { "rustc" } else { "build" }).args(ids);
    command.args(["--lib", "--profile", "fmu", "--message-format", "json-render-diagnostics"]);
    command.args(locked.then_some("--locked")).arg("--target-dir").arg(&target);
    if !has_profile(root.as_std_path())? {
        for (name, value) in profile()? {
            command.args(["--config", &format!("profile.fmu.{name}={value}")]);
        }
    }
    // Cargo passes paths relative to the workspace to rustc; a macro of another crate may use absolute paths.
    if alone {
        command.args(["--", &format!("--remap-path-prefix={root}=.")]);
    }
    command.env("CARGO_ENCODED_RUSTFLAGS", flags.join("\u{1f}"));
    let mut cargo = command
        .stdout(Stdio::piped())
        .spawn()
        .context("cannot run cargo, which builds the FMUs")?;
    let mut artifacts = Vec::new();
    if let Some(output) = cargo.stdout.take() {
        for message in Message::parse_stream(BufReader::new(output)) {
            if let Message::CompilerArtifact(artifact) = message? {
                artifacts.push(artifact);
            }
        }
    }
    let status = cargo.wait()?;
    if !status.success() {
        bail!("cargo could not build it: {status}");
    }
    Ok(artifacts)
}

/// Returns compiler flags that replace local paths in the library: the folder of cargo, and packages outside of the
/// workspace.
fn remappings(metadata: &Metadata) -> Vec<String> {
    let cargo_home = std::env::var_os("CARGO_HOME")
        .map(PathBuf::from)
        .or_else(|| std::env::home_dir().map(|home| home.join(".cargo")));
    let remap = |path: &dyn std::fmt::Display, to: &str| format!("--remap-path-prefix={path}={to}");
    let mut flags = Vec::from_iter(cargo_home.map(|home| remap(&home.display(), "cargo")));
    for package in &metadata.packages {
        let folder = package.manifest_path.parent();
        let elsewhere = folder.filter(|folder| !folder.starts_with(&metadata.workspace_root));
        if package.source.is_none() {
            flags.extend(elsewhere.map(|folder| remap(&folder, &package.name)));
        }
    }
    flags
}

/// Returns the settings of [`PROFILE`].
fn profile() -> anyhow::Result<toml::Table> {
    let mut file: toml::Table = PROFILE.parse()?;
    let profile = file.get_mut("profile").and_then(|profiles| profiles.get_mut("fmu"));
    let settings = profile.and_then(|profile| profile.as_table_mut()).map(std::mem::take);
    settings.context("fmu-profile.toml has no profile.fmu")
}

/// Whether the manifest of the workspace states the profile `fmu`.
fn has_profile(root: &Path) -> anyhow::Result<bool> {
    let manifest = root.join("Cargo.toml");
    let manifest: toml::Table = std::fs::read_to_string(manifest)?.parse()?;
    Ok(manifest.get("profile").is_some_and(|profiles| profiles.get("fmu").is_some()))
}

/// Returns the packages in the library: the dependencies of `root` that were built.
fn dependencies(metadata: &Metadata, root: &Package, artifacts: &[Artifact]) -> Vec<Package> {
    let built: HashSet<&PackageId> =
        artifacts.iter().map(|artifact| &artifact.package_id).collect();
    normal_dependencies(metadata, root)
        .into_iter()
        .filter(|package| built.contains(&package.id))
        .cloned()
        .collect()
}

/// Returns the direct and indirect dependencies of `root`, without procedural macros and without dependencies of build
/// scripts and tests.
fn normal_dependencies<'a>(metadata: &'a Metadata, root: &Package) -> Vec<&'a Package> {
    let nodes = metadata.resolve.iter().flat_map(|resolve| &resolve.nodes);
    let nodes: Vec<_> = nodes.collect();
    let (mut open, mut packages) = (vec![&root.id], Vec::<&Package>::new());
    while let Some(id) = open.pop() {
        let dependencies = nodes.iter().filter(|node| node.id == *id).flat_map(|node| &node.deps);
        for dependency in dependencies {
            let normal =
                dependency.dep_kinds.iter().any(|kind| kind.kind == DependencyKind::Normal);
            let package = &metadata[&dependency.pkg];
            let known = packages.iter().any(|known| known.id == package.id);
            if normal && !known && !is_macro(package) {
                open.push(&dependency.pkg);
                packages.push(package);
            }
        }
    }
    packages
}

fn is_macro(package: &Package) -> bool {
    package.targets.iter().any(|target| target.kind.contains(&TargetKind::ProcMacro))
}
