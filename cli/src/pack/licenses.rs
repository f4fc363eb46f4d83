//! The licences in `documentation/licenses` of an FMU: texts of the crate and its dependencies.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use cargo_metadata::Package as Crate;
use fmu_description::package::Package;

use super::binaries::files;
use super::library::Library;
use super::read;

/// Start of the names, in lower case, of files with licences and copyright notices.
const NAMES: [&str; 6] = ["license", "licence", "unlicense", "copying", "copyright", "notice"];
/// Path of the notices of the standard library in the compiler's folder.
const STANDARD_LIBRARY: &str = "share/doc/rust/COPYRIGHT-library.html";

/// Adds `license.txt`, with the licence of the crate and a list of the packages in the library, and
/// a folder with the texts of each package that has some.
pub(super) fn add(package: &mut Package, library: &Library) -> anyhow::Result<()> {
    let mut entry = line(&library.package).into_bytes();
    for path in texts(&library.package)? {
        entry.push(b'\n');
        entry.extend(read(&path)?);
    }
    let head = "\nThe library contains the packages below. The texts that come with a package are in \
                the folder of its name.\n\n";
    entry.extend(head.bytes());
    for dependency in &library.dependencies {
        entry.extend(line(dependency).bytes());
        let folder = format!("{}-{}", dependency.name, dependency.version);
        for path in texts(dependency)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            package.add(format!("documentation/licenses/{folder}/{name}"), read(&path)?);
        }
    }
    let release = &library.toolchain.release;
    entry.extend(format!("rust {release} (standard library): MIT OR Apache-2.0\n").bytes());
    let notices = library.toolchain.sysroot.join(STANDARD_LIBRARY);
    if notices.is_file() {
        let path = format!("documentation/licenses/rust-{release}/COPYRIGHT-library.html");
        package.add(path, read(&notices)?);
    }
    package.add("documentation/licenses/license.txt", entry);
    Ok(())
}

/// Returns a line with the name, the version and the licence of a package.
fn line(package: &Crate) -> String {
    let license = match (&package.license, &package.license_file) {
        (Some(license), _) => license,
        (None, Some(_)) => "see its text",
        (None, None) => "no licence is stated",
    };
    format!("{} {}: {license}\n", package.name, package.version)
}

/// Returns the files with licence texts: the file that the manifest states, and the files of the first folder with
/// licence texts, from the folder of the package upwards to its workspace. For a vendored or registry package only its
/// own folder is searched, since the folders above belong to other packages.
fn texts(package: &Crate) -> anyhow::Result<Vec<PathBuf>> {
    let stated = package.license_file().map(PathBuf::from).filter(|path| path.is_file());
    let is_from_registry =
        package.source.as_ref().is_some_and(|source| !source.repr.starts_with("git+"));
    let manifest = package.manifest_path.as_std_path();
    // `cargo vendor` writes this file, also for packages from git.
    let is_alone = is_from_registry || manifest.with_file_name(".cargo-checksum.json").is_file();
    let levels = if is_alone { 1 } else { usize::MAX };
    for folder in manifest.ancestors().skip(1).take(levels) {
        let manifest = folder.join("Cargo.toml");
        if !manifest.is_file() {
            continue;
        }
        let unread = || format!("cannot read {}", manifest.display());
        let manifest: toml::Table = fs::read_to_string(&manifest).with_context(unread)?.parse()?;
        let mut files = license_files(folder)?;
        files.extend(stated.clone());
        files.sort();
        files.dedup();
        if !files.is_empty() || manifest.contains_key("workspace") {
            return Ok(files);
        }
    }
    Ok(Vec::new())
}

/// Returns the files in `folder` with names of licences, and the files in a folder `LICENSES`.
fn license_files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut licenses = Vec::new();
    for path in files(folder)? {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        if path.is_dir() && name == "licenses" {
            licenses.extend(files(&path)?.into_iter().filter(|path| path.is_file()));
        } else if path.is_file() && NAMES.iter().any(|start| name.starts_with(start)) {
            licenses.push(path);
        }
    }
    Ok(licenses)
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    #[test]
    fn a_vendored_package_has_no_licence_of_the_project_around_it() {
        let project = tempfile::tempdir().unwrap();
        let folder = project.path().join("vendor/small");
        fs::create_dir_all(&folder).unwrap();
        for (file, text) in [("Cargo.toml", "[workspace]"), ("LICENSE", "of the project")] {
            fs::write(project.path().join(file), text).unwrap();
        }
        fs::write(folder.join("Cargo.toml"), "").unwrap();
        let texts_of = |source: Value| {
            let package = json!({
                "name": "small", "version": "1.0.0", "id": "small", "source": source,
                "dependencies": [], "targets": [], "features": {},
                "manifest_path": folder.join("Cargo.toml"),
            });
            texts(&serde_json::from_value(package).unwrap()).unwrap()
        };
        let registry = "registry+https://github.com/rust-lang/crates.io-index";
        assert!(texts_of(json!(registry)).is_empty());
        assert_eq!(texts_of(Value::Null), [project.path().join("LICENSE")]);
        fs::write(folder.join(".cargo-checksum.json"), "{}").unwrap();
        assert!(texts_of(json!("git+https://example.org/small#0123456789abcdef")).is_empty());
    }
}
