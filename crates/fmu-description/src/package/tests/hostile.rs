//! Malicious and unusual archives.

use std::io::{self, Read as _, Write as _};

use zip::write::SimpleFileOptions;

use super::*;

const FILE: u32 = 0o100_644;

/// The error for an archive with `entries` besides the description.
fn refused(entries: &[(&str, &str, u32)]) -> PackageError {
    let all: Vec<_> = [(DESCRIPTION, XML, FILE)].iter().chain(entries).copied().collect();
    opened(&raw::archive(&all)).unwrap_err()
}

/// Packs deflated files with this number of zeros, by the crate that also reads archives.
fn zeros(files: &[(&str, u64)]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(io::Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default();
    archive.start_file(DESCRIPTION, options).unwrap();
    archive.write_all(XML.as_bytes()).unwrap();
    for (name, size) in files {
        archive.start_file(*name, options).unwrap();
        io::copy(&mut io::repeat(0).take(*size), &mut archive).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn a_bomb_is_refused_by_its_ratio_before_anything_is_written() {
    let bomb = zeros(&[("resources/zeros", 90 << 20)]);
    assert!(bomb.len() < 100_000);
    let error = opened(&bomb).unwrap_err();
    assert!(
        matches!(error, PackageError::Limit { unit: "unpacked bytes", limit, .. }
        if limit == (64 << 20) + 100 * bomb.len() as u64),
        "{error}"
    );
    let harmless = zeros(&[("resources/zeros", 60 << 20)]);
    assert!(opened(&harmless).is_ok());
}

/// Offsets of APPNOTE.TXT, sections 4.3.7 and 4.3.12: all fields that state the size.
#[test]
fn a_bomb_that_states_a_wrong_size_is_stopped_at_the_limit() {
    let mut bomb = zeros(&[("resources/zeros", 1 << 20)]);
    let size = (1_u32 << 20).to_le_bytes();
    let places: Vec<usize> = (0..bomb.len() - 4).filter(|at| bomb[*at..at + 4] == size).collect();
    assert!(!places.is_empty());
    for at in places {
        bomb[at..at + 4].copy_from_slice(&10_u32.to_le_bytes());
    }
    let folder = folder();
    let path = folder.path().join("M.fmu");
    fs::write(&path, &bomb).unwrap();
    let mut archive = archive::Archive::open(&path).unwrap();
    let error = archive.unpack_up_to(folder.path(), 1000, |name| name != DESCRIPTION).unwrap_err();
    let written = fs::metadata(folder.path().join("resources/zeros")).unwrap().len();
    assert!(written <= 1001, "{written} bytes: {error}");
}

/// As in Fifield's bomb: two names in the list, one file in the archive.
#[test]
fn entries_that_share_their_bytes_are_refused() {
    let entries =
        [(DESCRIPTION, XML, FILE), ("resources/a", "text", FILE), ("resources/b", "text", FILE)];
    let mut bytes = raw::archive(&entries);
    let find = |name: &[u8], bytes: &[u8]| {
        let actual = bytes.windows(name.len()).enumerate().filter(|(_, part)| *part == name);
        actual.map(|(at, _)| at).collect::<Vec<_>>()
    };
    let (first, second) = (find(b"resources/a", &bytes), find(b"resources/b", &bytes));
    let offset: [u8; 4] = bytes[first[1] - 4..first[1]].try_into().unwrap();
    bytes[second[1] - 4..second[1]].copy_from_slice(&offset);
    let error = opened(&bytes).unwrap_err();
    assert!(format!("{error:?}").contains("overlap"), "{error:?}");
}

#[test]
fn too_many_entries_and_too_long_a_list_are_refused() {
    let names: Vec<String> = (0..100_001).map(|number| format!("resources/{number}")).collect();
    let files: Vec<(&str, u64)> = names.iter().map(|name| (name.as_str(), 0)).collect();
    let error = opened(&zeros(&files)).unwrap_err();
    assert!(matches!(error, PackageError::Limit { unit: "entries", .. }), "{error}");

    let names: Vec<String> = (0..60_000).map(|number| format!("{number:0>600}")).collect();
    let entries: Vec<_> = names.iter().map(|name| (name.as_str(), "", FILE)).collect();
    let error = opened(&raw::archive(&entries)).unwrap_err();
    assert!(matches!(error, PackageError::Archive { .. }), "{error}");
}

#[test]
fn a_file_and_a_folder_of_one_name_are_refused() {
    for entries in [
        [("resources/x", "", FILE), ("resources/x/y", "", FILE)],
        [("resources/x/y/z", "", FILE), ("resources/x", "", FILE)],
        [("resources/x/", "", 0o40_755), ("resources/x", "", FILE)],
    ] {
        let error = refused(&entries);
        assert!(matches!(error, PackageError::Entry { ref entry, .. } if entry == "resources/x"));
        assert!(error.to_string().contains("not both"), "{error}");
    }
}

#[test]
fn paths_that_are_too_long_or_too_deep_are_refused() {
    for path in ["x".repeat(1025), "x/".repeat(70) + "y"] {
        let error = refused(&[(&path, "", FILE)]);
        assert!(error.to_string().contains("at most 1024 bytes and 64 levels"), "{error}");
    }
}

#[test]
fn a_description_in_the_wrong_case_is_named() {
    let error = opened(&raw::archive(&[("modeldescription.XML", XML, FILE)])).unwrap_err();
    assert_eq!(
        error.to_string(),
        "expected modelDescription.xml at the root of the FMU, found modeldescription.XML, which \
         differs in upper and lower case"
    );
}

#[test]
fn binaries_in_the_wrong_case_are_named() {
    let wrong = library_entry().replace("binaries", "Binaries");
    let all = [(DESCRIPTION, XML, FILE), (wrong.as_str(), "", FILE)];
    let unpacked = opened(&raw::archive(&all)).unwrap();
    if cfg!(target_os = "linux") {
        let error = unpacked.library("M").unwrap_err().to_string();
        assert!(error.contains(&format!("found {wrong}")), "{error}");
        let folder = Unpacked::in_folder(unpacked.folder()).unwrap();
        assert_eq!(folder.library("M").unwrap_err().to_string(), error);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn names_that_differ_in_case_only_are_two_files() {
    let all = [(DESCRIPTION, XML, FILE), ("resources/a", "1", FILE), ("resources/A", "2", FILE)];
    let unpacked = opened(&raw::archive(&all)).unwrap();
    let read = |name: &str| fs::read_to_string(unpacked.resources().join(name)).unwrap();
    assert_eq!((read("a"), read("A")), ("1".to_owned(), "2".to_owned()));
}

#[test]
fn to_run_an_fmu_only_needed_files_are_unpacked() {
    let folder = folder();
    let target = folder.path().join("M.fmu");
    let mut package = package();
    for other in [
        "binaries/plan9/M.so",
        "sources/all.c",
        "extra/org.example/data",
        "terminalsAndIcons/icon.png",
    ] {
        package.add(other, "x");
    }
    let foreign = if platforms().contains(&"win64") { "linux64" } else { "win64" };
    package.add(format!("binaries/{foreign}/Foreign.dll"), "x");
    // The name of a single library would not matter.
    package.add(format!("binaries/{}/Second{}", platforms()[0], std::env::consts::DLL_SUFFIX), "x");
    package.write(&target).unwrap();
    let files = |unpacked: &Unpacked| {
        let mut again = Package::new(String::new());
        again.add_folder("", unpacked.folder()).unwrap();
        let text = format!("{again:?}");
        ["index.html", "all.c", "model.png", "icon.png", "Foreign.dll", "plan9", "data", "z.bin"]
            .map(|name| text.contains(name))
    };
    let needed = Unpacked::open(&target).unwrap();
    assert_eq!(files(&needed), [false, false, false, false, false, true, true, true]);
    assert!(needed.library("M").is_ok());
    let error = needed.library("Other").unwrap_err().to_string();
    assert!(error.contains(foreign), "the whole archive is known: {error}");
    assert_eq!(files(&Unpacked::open_whole(&target).unwrap()), [true; 8]);
}

#[test]
fn warnings_about_the_description_are_returned() {
    let xml = XML.replace("fmiVersion=\"2.0\"", "fmiVersion=\"2.0.4\"");
    let unpacked = opened(&raw::archive(&[(DESCRIPTION, &xml, FILE)])).unwrap();
    assert_eq!(unpacked.warnings.len(), 1);
    assert!(unpacked.warnings[0].to_string().contains("2.0.4"));
}
