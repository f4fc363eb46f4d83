//! Libraries for other platforms, built elsewhere.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use fmu_description::{ModelDescription, Version};

use super::read;
use crate::check::{Severity, binaries};

/// Platforms of FMI, each with its Rust targets, on which dependencies may differ.
const TARGETS: [(&str, &[&str]); 8] = [
    ("linux64", &["x86_64-unknown-linux-gnu"]),
    ("linux32", &["i686-unknown-linux-gnu"]),
    ("win64", &["x86_64-pc-windows-gnu"]),
    ("win32", &["i686-pc-windows-gnu"]),
    ("darwin64", &["x86_64-apple-darwin", "aarch64-apple-darwin"]),
    ("aarch64-linux", &["aarch64-unknown-linux-gnu"]),
    ("aarch64-windows", &["aarch64-pc-windows-gnullvm"]),
    ("aarch64-darwin", &["aarch64-apple-darwin"]),
];

/// Platforms of FMI 2.0, each with the tuple of FMI 3.0.
const TUPLES: [(&str, &str); 5] = [
    ("linux64", "x86_64-linux"),
    ("linux32", "x86-linux"),
    ("win64", "x86_64-windows"),
    ("win32", "x86-windows"),
    ("darwin64", "x86_64-darwin"),
];

/// Returns the targets in [`TARGETS`] of the platforms that have a folder in `folder`.
///
/// # Errors
///
/// Returns an error if the folder cannot be read.
pub(super) fn targets(folder: &Path) -> anyhow::Result<Vec<&'static str>> {
    let platforms = folders(folder)?;
    let has = |name: &str| platforms.iter().any(|path| path.ends_with(name));
    let triples = TARGETS.iter().filter(|(name, _)| has(name)).flat_map(|(_, targets)| *targets);
    Ok(triples.copied().collect())
}

/// Returns the libraries of a model in `folder`, such as `win64/MODEL.dll`: path in the FMU, and
/// bytes.
///
/// # Errors
///
/// Returns an error if a file cannot be read, if there is no library, or if importers may refuse one: built for another
/// platform than its folder, without a function of the standard, or without another library that the library needs.
pub(super) fn collect(
    folder: &Path,
    description: &ModelDescription,
) -> anyhow::Result<Vec<(String, Vec<u8>)>> {
    let model = &description.model_name;
    let mut libraries = Vec::new();
    for platform in folders(folder)? {
        for file in files(&platform)? {
            if file.file_stem().is_some_and(|stem| stem.to_str() == Some(model)) {
                let name =
                    |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
                let names = name(&platform).zip(name(&file));
                let (platform, name) = names.context("a file without a name")?;
                libraries.push((format!("binaries/{platform}/{name}"), read(&file)?));
            }
        }
    }
    if libraries.is_empty() {
        let folder = folder.display();
        bail!(
            "there is no library of {model} in {folder}: expected \
             {folder}/win64/{model}.dll, {folder}/linux64/{model}.so or the like"
        );
    }
    refuse_broken(&libraries, description)
        .with_context(|| format!("the libraries of {model} in {}", folder.display()))?;
    Ok(libraries)
}

/// Returns the path of a library in an FMU of `version`: in FMI 3.0 with the platform tuple (section 2.5.1.4.1),
/// otherwise `path`.
pub(super) fn path_in(version: Version, path: String) -> String {
    let folder = path.split('/').nth(1).unwrap_or_default();
    match TUPLES.iter().find(|(name, _)| *name == folder) {
        Some((name, tuple)) if version == Version::V3 => {
            path.replacen(&format!("/{name}/"), &format!("/{tuple}/"), 1)
        }
        _ => path,
    }
}

/// Returns an error that lists the errors and warnings about the libraries, if there are any.
fn refuse_broken(
    libraries: &[(String, Vec<u8>)],
    description: &ModelDescription,
) -> anyhow::Result<()> {
    let names: Vec<_> = libraries.iter().map(|(path, _)| path.clone()).collect();
    let bytes = |path: &str| {
        let library = libraries.iter().find(|(name, _)| name == path);
        library.map(|(_, bytes)| bytes.clone()).ok_or_else(|| std::io::ErrorKind::NotFound.into())
    };
    let faults: Vec<_> = binaries::check(&bytes, &names, description)
        .into_iter()
        .filter(|finding| finding.severity != Severity::Note)
        .map(|finding| finding.to_string())
        .collect();
    if faults.is_empty() { Ok(()) } else { bail!("{}", faults.join("\n")) }
}

/// Returns the paths of the folders in `folder`, sorted by name.
fn folders(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    Ok(files(folder)?.into_iter().filter(|path| path.is_dir()).collect())
}

/// Returns the paths of the files and folders in `folder`, sorted by name.
pub(super) fn files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let items = fs::read_dir(folder).and_then(|items| {
        let paths = items.map(|item| Ok(item?.path()));
        paths.collect::<std::io::Result<Vec<_>>>()
    });
    let mut paths = items.with_context(|| format!("cannot read {}", folder.display()))?;
    paths.sort();
    Ok(paths)
}
