use std::fs;
use std::path::Path;

use super::*;
use tempfile::TempDir;

mod fmi3;
mod hostile;
mod raw;

const XML: &str = r#"<fmiModelDescription fmiVersion="2.0" modelName="M" guid="{1}">
<CoSimulation modelIdentifier="M"/><ModelVariables/><ModelStructure/></fmiModelDescription>"#;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn library_entry() -> String {
    format!("binaries/{}/M{}", platforms()[0], std::env::consts::DLL_SUFFIX)
}

fn package() -> Package {
    let mut package = Package::new(XML.to_owned());
    package.add("resources/z.bin", vec![0; 100_000]);
    package.add(library_entry(), "not really a library");
    package.add("documentation/index.html", "<p>");
    package.add("model.png", "");
    package
}

fn written(package: &Package) -> Vec<u8> {
    let folder = folder();
    let target = folder.path().join("new/folder/M.fmu");
    package.write(&target).unwrap();
    fs::read(target).unwrap()
}

#[test]
fn the_same_content_gives_the_same_bytes() {
    let mut other = Package::new(XML.to_owned());
    other.add("model.png", "");
    other.add("documentation/index.html", "<p>");
    other.add(library_entry(), "not really a library");
    other.add("resources/z.bin", vec![0; 100_000]);
    assert_eq!(written(&package()), written(&other));
}

/// Offsets of APPNOTE.TXT, sections 4.3.7 and 4.3.12.
#[test]
fn every_header_satisfies_section_2_3() {
    let bytes = written(&package());
    let entries = raw::directory(&bytes);
    let names: Vec<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
    let library = library_entry();
    assert_eq!(
        names,
        [DESCRIPTION, &library, "documentation/index.html", "model.png", "resources/z.bin"]
    );
    for entry in &entries {
        assert_eq!(entry.version_needed, 20, "{}", entry.name);
        assert_eq!(entry.flags, 0, "no data descriptor, encryption or non-ASCII name");
        assert_eq!(entry.method, 8, "deflate");
        assert_eq!((entry.time, entry.date), (0, 0x21), "1980-01-01 00:00");
        assert_eq!(entry.extra_length, 0, "no Zip64");
        let mode = if entry.name.starts_with("binaries") { 0o100_755 } else { 0o100_644 };
        assert_eq!(entry.external_attributes >> 16, mode, "{}", entry.name);
        assert_eq!(entry.made_by_system, 3, "UNIX");
        assert!(raw::local_header_agrees(&bytes, entry), "{}", entry.name);
    }
}

#[test]
fn a_packed_fmu_is_unpacked_with_the_same_content() {
    let folder = folder();
    let target = folder.path().join("M.fmu");
    package().write(&target).unwrap();
    let unpacked = Unpacked::open(&target).unwrap();
    assert_eq!(unpacked.description.model_name, "M");
    assert_eq!(fs::read(unpacked.resources().join("z.bin")).unwrap(), vec![0; 100_000]);
    let library = unpacked.library("M").unwrap();
    assert_eq!(library, unpacked.folder().join(library_entry()));
    assert!(library.is_absolute());
    assert_eq!(fs::read(library).unwrap(), b"not really a library");
    let temporary = unpacked.folder().to_owned();
    drop(unpacked);
    assert!(!temporary.exists());
}

#[test]
fn an_unpacked_fmu_can_be_used_changed_and_packed_again() {
    let folder = folder();
    let (first, second) = (folder.path().join("A.fmu"), folder.path().join("B.fmu"));
    package().write(&first).unwrap();
    let unpacked = Unpacked::open(&first).unwrap();
    let in_place = Unpacked::in_folder(unpacked.folder()).unwrap();
    assert_eq!(in_place.description, unpacked.description);
    fs::create_dir_all(in_place.resources().join("deep/er")).unwrap();
    fs::write(in_place.resources().join("deep/er/table.csv"), "1").unwrap();
    let mut again = Package::new(XML.to_owned());
    for part in ["resources", "binaries"] {
        again.add_folder(part, &unpacked.folder().join(part)).unwrap();
    }
    drop(in_place);
    assert!(unpacked.folder().exists(), "a folder that was given is kept");
    again.write(&second).unwrap();
    let unpacked = Unpacked::open(&second).unwrap();
    assert_eq!(fs::read(unpacked.resources().join("deep/er/table.csv")).unwrap(), b"1");
    assert!(unpacked.library("M").is_ok());
}

#[test]
fn the_error_for_a_missing_library_lists_the_existing_ones() {
    let folder = folder();
    let target = folder.path().join("M.fmu");
    let mut package = Package::new(XML.to_owned());
    package.add("binaries/vax-vms/M.exe", "");
    package.add("binaries/vax-vms/other.exe", "");
    package.write(&target).unwrap();
    let error = Unpacked::open(&target).unwrap().library("M").unwrap_err().to_string();
    assert!(error.contains(&library_entry()), "{error}");
    assert!(error.contains("M.exe, ") && error.contains("other.exe"), "{error}");
}

#[test]
fn folders_for_libraries_are_those_of_the_standard() {
    assert_eq!(folders("linux", "x86_64")[0], "linux64");
    assert_eq!(folders("windows", "x86_64")[0], "win64");
    assert_eq!(folders("macos", "x86_64")[0], "darwin64");
    assert_eq!(folders("linux", "aarch64"), ["aarch64-linux"]);
    assert_eq!(folders("linux", "arm"), ["aarch32-linux"]);
    assert_eq!(folders("macos", "aarch64"), ["aarch64-darwin", "darwin64"]);
    assert_eq!(folders("plan9", "mips"), [""; 0]);
}

#[test]
fn entries_that_an_fmu_must_not_have_are_not_written() {
    let folder = folder();
    for path in [
        "../x",
        "/resources/x",
        "resources/../../x",
        "resources/./x",
        "resources//x",
        "resources\\x",
        "C:/x",
        "resources/C:x",
        "resources/\u{e4}",
        "resources/a?",
        "resources/a.",
        "resources/nul.txt",
        "resources/COM1",
        "resources/",
        "resources",
        "icons/a.png",
        "readme.txt",
        "",
        DESCRIPTION,
        "model.PNG",
        "Resources/x",
        "MODEL.png",
        "resources/Z.BIN",
    ] {
        let mut package = package();
        package.add(path, "");
        let error = package.write(&folder.path().join("M.fmu")).unwrap_err();
        assert!(
            matches!(error, PackageError::Entry { ref entry, .. } if entry == path),
            "{path}: {error}"
        );
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn an_incomplete_fmu_is_not_written() {
    let folder = folder();
    let empty = Package::new(XML.to_owned());
    let mut without_index = Package::new(XML.to_owned());
    without_index.add("sources/a.c", "");
    without_index.add("documentation/other.html", "");
    let mut other_case = Package::new(XML.to_owned());
    other_case.add("sources/a.c", "");
    other_case.add("documentation/Index.html", "");
    for (package, target, said) in [
        (empty, "M.fmu", "binaries or sources"),
        (without_index, "M.fmu", "index.html"),
        (other_case, "M.fmu", "documentation/index.html"),
        (package(), "M.zip", ".fmu"),
    ] {
        let error = package.write(&folder.path().join(target)).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_failed_write_leaves_no_file() {
    let folder = folder();
    let target = folder.path().join("M.fmu");
    fs::create_dir(&target).unwrap();
    fs::write(target.join("in the way"), "").unwrap();
    assert!(matches!(package().write(&target), Err(PackageError::File { .. })));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn a_written_file_can_be_read_by_other_users() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = folder();
    let target = folder.path().join("M.fmu");
    package().write(&target).unwrap();
    let plain = folder.path().join("plain");
    fs::write(&plain, "").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&target), mode(&plain));
}

fn opened(bytes: &[u8]) -> Result<Unpacked, PackageError> {
    let folder = folder();
    let path = folder.path().join("M.fmu");
    fs::write(&path, bytes).unwrap();
    Unpacked::open(&path)
}

#[test]
fn archives_that_lead_out_of_their_folder_are_refused() {
    for name in [
        "../x",
        "/x",
        "a/../../x",
        "a\\..\\x",
        "..\\x",
        "\\x",
        "C:/x",
        "C:\\x",
        "a//x",
        "..",
        "./..",
        "./../x",
        "a/./../../x",
        "a\u{0}b",
    ] {
        let bytes = raw::archive(&[(DESCRIPTION, XML, 0o100_644), (name, "", 0o100_644)]);
        let error = opened(&bytes).unwrap_err();
        assert!(
            matches!(error, PackageError::Entry { ref entry, .. } if entry == name),
            "{name}: {error}"
        );
    }
    let link = raw::archive(&[(DESCRIPTION, XML, 0o100_644), ("resources", "/etc", 0o120_777)]);
    let error = opened(&link).unwrap_err();
    assert!(error.to_string().contains("not a link"), "{error}");
}

#[test]
fn backslashes_and_dots_in_paths_are_read_and_named_in_a_warning() {
    let library = library_entry();
    let backslashes = format!(".\\{}", library.replace('/', "\\"));
    let dotted = format!("./{DESCRIPTION}");
    let unpacked = opened(&raw::archive(&[
        ("./", "", 0o40_755),
        (&dotted, XML, 0o100_644),
        (&backslashes, "a library", 0o100_755),
        ("resources\\deep\\", "", 0o40_755),
        ("resources/plain.txt", "", 0o100_644),
    ]))
    .unwrap();
    assert_eq!(fs::read(unpacked.library("M").unwrap()).unwrap(), b"a library");
    assert!(unpacked.resources().join("deep").is_dir());
    let names = [DESCRIPTION, &library, "resources/deep/", "resources/plain.txt"];
    assert_eq!(unpacked.entries(), names);
    assert_eq!(
        unpacked.archive_warnings,
        ["4 entries have a path with backslashes or . in the archive, for example \"./\": skipped"]
    );
    let twice = [(DESCRIPTION, XML, 0o100_644), (dotted.as_str(), XML, 0o100_644)];
    let error = opened(&raw::archive(&twice)).unwrap_err();
    assert!(matches!(error, PackageError::Archive { .. }), "{error}");
    let both = [(DESCRIPTION, XML, 0o100_644), ("a", "", 0o100_644), ("a\\b", "", 0o100_644)];
    let error = opened(&raw::archive(&both)).unwrap_err();
    assert!(matches!(error, PackageError::Entry { .. }), "{error}");
}

#[test]
fn of_several_entries_with_one_name_the_last_is_used_with_a_warning() {
    let plain = [(DESCRIPTION, XML, 0o100_644), ("resources/", "", 0o40_755)];
    let plain = opened(&raw::archive(&plain)).unwrap();
    assert!(plain.resources().is_dir() && plain.archive_warnings.is_empty());
    let file = |content| ("resources/a.txt", content, 0o100_644);
    let twice = raw::archive(&[(DESCRIPTION, XML, 0o100_644), file("first"), file("last")]);
    let twice = opened(&twice).unwrap();
    assert_eq!(fs::read(twice.resources().join("a.txt")).unwrap(), b"last");
    assert_eq!(
        twice.archive_warnings,
        ["several entries of the archive have the same name; the last one of each is used"]
    );
}

#[test]
fn a_folder_sources_with_empty_folders_is_no_source_code() {
    let description = (DESCRIPTION, XML, 0o100_644);
    let code = raw::archive(&[description, ("sources/a.c", "", 0o100_644)]);
    assert!(opened(&code).unwrap().has_sources());
    let empty = opened(&raw::archive(&[description, ("sources/", "", 0o40_755)])).unwrap();
    assert!(!empty.has_sources());
    let error = empty.library("M").unwrap_err().to_string();
    assert!(!error.contains("source code"), "{error}");
    let sources = empty.folder().join("sources");
    fs::create_dir_all(sources.join("inner/core")).unwrap();
    assert!(!Unpacked::in_folder(empty.folder()).unwrap().has_sources());
    fs::write(sources.join("inner/core/a.c"), "").unwrap();
    assert!(Unpacked::in_folder(empty.folder()).unwrap().has_sources());
}

#[test]
fn the_option_that_builds_source_code_is_proposed_if_the_fmu_states_how() {
    let code = ("sources/a.c", "", 0o100_644);
    let build = ("sources/buildDescription.xml", "", 0o100_644);
    let listed = XML
        .replace("\"M\"/>", "\"M\"><SourceFiles><File name=\"a.c\"/></SourceFiles></CoSimulation>");
    for (description, entries, proposed) in [
        (XML, &[code][..], false),
        (XML, &[code, build][..], true),
        (listed.as_str(), &[code][..], true),
    ] {
        let entries = [&[(DESCRIPTION, description, 0o100_644)][..], entries].concat();
        let error = opened(&raw::archive(&entries)).unwrap().library("M").unwrap_err().to_string();
        assert!(
            error.contains("source code") && error.contains("--compile") == proposed,
            "{error}"
        );
    }
}

#[test]
fn files_that_are_no_fmus_are_refused_with_the_reason() {
    let absent = Unpacked::open(Path::new("/nowhere/M.fmu")).unwrap_err();
    assert!(matches!(absent, PackageError::File { action: "open", .. }), "{absent}");
    let text = opened(b"just text").unwrap_err();
    assert!(matches!(text, PackageError::Archive { .. }), "{text}");
    let pointer = opened(b"version https://git-lfs/spec/v1\noid sha256:0\nsize 1\n").unwrap_err();
    assert!(
        std::error::Error::source(&pointer).unwrap().to_string().contains("`git lfs pull`"),
        "{pointer}"
    );
    let nested = opened(&raw::archive(&[("M/modelDescription.xml", XML, 0o100_644)])).unwrap_err();
    assert_eq!(
        nested.to_string(),
        "expected modelDescription.xml at the root of the FMU, found M/modelDescription.xml, \
         which is in a folder"
    );
    let broken = opened(&raw::archive(&[(DESCRIPTION, "<a", 0o100_644)])).unwrap_err();
    assert!(matches!(broken, PackageError::Description { .. }), "{broken}");
    let whole = written(&package());
    for length in [whole.len() - 1, whole.len() / 2, 10] {
        assert!(opened(&whole[..length]).is_err());
    }
}

#[test]
fn a_damaged_file_is_detected_by_its_checksum() {
    let mut bytes = raw::archive(&[(DESCRIPTION, XML, 0o100_644)]);
    let at = bytes.windows(3).position(|part| part == b"\"M\"").unwrap() + 1;
    bytes[at] = b'N';
    assert!(matches!(opened(&bytes), Err(PackageError::File { action: "unpack", .. })));
}

#[test]
fn no_more_is_unpacked_than_the_limit() {
    let folder = folder();
    let path = folder.path().join("M.fmu");
    package().write(&path).unwrap();
    let total = 100_000 + XML.len() + "not really a library".len() + "<p>".len();
    let total = u64::try_from(total).unwrap();
    let unpack = |name: &str, capacity| {
        let mut archive = archive::Archive::open(&path).unwrap();
        archive.unpack_up_to(&folder.path().join(name), capacity, |_| true)
    };
    unpack("out", total).unwrap();
    let error = unpack("less", total - 1).unwrap_err();
    assert!(matches!(error, PackageError::Limit { unit: "unpacked bytes", .. }), "{error}");
}
