//! FMI 3.0 (sections 2.3.1 and 2.5).

use super::*;
use crate::description::Version;

const XML: &str = r#"<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="{1}">
<CoSimulation modelIdentifier="M"/><ModelVariables/><ModelStructure/></fmiModelDescription>"#;

fn library(platform: &str) -> String {
    format!("binaries/{platform}/M{}", std::env::consts::DLL_SUFFIX)
}

fn packed(entries: &[&str]) -> Result<(TempDir, std::path::PathBuf), PackageError> {
    let mut package = Package::new(XML.to_owned()).for_version(Version::V3);
    for entry in entries {
        package.add(*entry, "content");
    }
    let folder = folder();
    let target = folder.path().join("M.fmu");
    package.write(&target)?;
    Ok((folder, target))
}

#[test]
fn a_library_is_in_the_folder_of_its_platform_tuple() {
    let tuple = platforms_of(Version::V3)[0];
    assert_eq!(tuple.split('-').count(), 2, "{tuple}");
    let (_folder, target) = packed(&[&library(tuple)]).unwrap();
    let unpacked = Unpacked::open(&target).unwrap();
    let actual = unpacked.library("M").unwrap();
    assert!(actual.ends_with(library(tuple)) && actual.is_absolute(), "{}", actual.display());

    let Some(old) = platforms().iter().find(|name| !name.contains('-')) else { return };
    let (_folder, target) = packed(&[&library(old)]).unwrap();
    let error = Unpacked::open(&target).unwrap().library("M").unwrap_err().to_string();
    assert!(error.contains(&library(tuple)) && error.contains(&library(old)), "{error}");
}

#[test]
fn resources_are_an_absolute_path_with_a_separator_at_its_end() {
    let library = library(platforms_of(Version::V3)[0]);
    let (_folder, target) = packed(&[&library, "resources/a.txt"]).unwrap();
    let unpacked = Unpacked::open(&target).unwrap();
    let path = unpacked.resource_path().unwrap().expect("resources");
    assert!(path.ends_with(std::path::MAIN_SEPARATOR), "{path}");
    let file = format!("{path}a.txt");
    assert!(Path::new(&path).is_absolute() && Path::new(&file).is_file(), "{path}");

    let (_folder, target) = packed(&[&library]).unwrap();
    assert_eq!(Unpacked::open(&target).unwrap().resource_path().unwrap(), None);
}

#[test]
fn rules_on_files_of_section_2_5_are_kept() {
    let library = library(platforms_of(Version::V3)[0]);
    for (entries, expected) in [
        (&["model.png"][..], "terminalsAndIcons"),
        (&["sources/a.c"], "sources/buildDescription.xml"),
        (&["documentation/other.html"], "documentation/index.html"),
        (
            &["documentation/index.html", "documentation/licenses/MIT.md"],
            "documentation/licenses/license.txt",
        ),
        (&["terminalsAndIcons/icon.svg"], "terminalsAndIcons/icon.png"),
    ] {
        let entries = [&[library.as_str()], entries].concat();
        let error = packed(&entries).unwrap_err().to_string();
        assert!(error.contains(expected), "{error} has not {expected}");
    }
    packed(&[
        &library,
        "sources/buildDescription.xml",
        "documentation/index.html",
        "documentation/licenses/license.spdx",
        "terminalsAndIcons/terminalsAndIcons.xml",
        "terminalsAndIcons/icon.png",
        "terminalsAndIcons/icon.svg",
    ])
    .unwrap();
}
