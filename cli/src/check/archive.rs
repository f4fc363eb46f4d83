//! Checks of the archive (FMI 2.0.5, section 2.3; FMI 3.0.2, section 2.5.1): packing, file names, required files.

use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use anyhow::Context as _;
use fmu_description::package::Unpacked;
use fmu_description::{ModelDescription, Version, terminals};
use zip::CompressionMethod;
use zip::read::ZipFile;

use super::finding::Severity::{Error, Note, Warning};
use super::finding::{Finding, Findings, Part};

const SECTION: &str = "2.3";
const TOP: [&str; 8] = [
    "modelDescription.xml",
    "model.png",
    "documentation",
    "sources",
    "binaries",
    "resources",
    "extra",
    "terminalsAndIcons",
];
/// Names of devices of Windows, without ports such as COM1.
const DEVICES: [&str; 4] = ["con", "prn", "aux", "nul"];
const UTF8: u16 = 1 << 11;
/// Length of a path in bytes above which unpacking may fail: Windows allows 260 characters including the
/// importer's folder.
const LONG: usize = 180;

/// Checks the archive at `path`, which is unpacked. Returns an error if the archive cannot be read.
pub(super) fn check(path: &Path, unpacked: &Unpacked) -> anyhow::Result<Vec<Finding>> {
    let (names, description) = (unpacked.entries(), &unpacked.description);
    let mut findings = Findings::about(Part::Archive);
    if path.extension().is_none_or(|extension| extension != "fmu") {
        let why = "Tools that open files by their extension do not offer it.";
        let place = path.display().to_string();
        findings.add(Error, place, "expected the extension .fmu", why, SECTION);
    }
    let unread = || format!("cannot read {}", path.display());
    let file = File::open(path).with_context(unread)?;
    let mut archive = zip::ZipArchive::new(BufReader::new(file)).with_context(unread)?;
    for index in 0..archive.len() {
        entry(&archive.by_index_raw(index).with_context(unread)?, &mut findings);
    }
    if let Err(error) = archive.validate_header_consistency() {
        let why = "Tools that read an archive front to back see other files than those that use its list.";
        findings.add(Error, "the archive", error.to_string(), why, SECTION);
    }
    case(names, &mut findings);
    top_level(names, description.version(), &mut findings);
    if description.version() != Version::V1 {
        documentation(names, &mut findings);
    }
    sources(names, description, &mut findings);
    if description.version() == Version::V3 {
        build_description(names, &mut findings);
    }
    if let Ok(file) = archive.by_name("model.png") {
        picture(file, &mut findings);
    }
    for warning in &unpacked.archive_warnings {
        if let Some(what) = warning.strip_prefix(terminals::PATH) {
            let what = what.trim_start_matches(": ");
            findings.add(Error, terminals::PATH, what, "", SECTION);
        }
    }
    Ok(findings.all)
}

/// Checks packing and name of one entry.
fn entry<R: std::io::Read>(entry: &ZipFile<'_, R>, findings: &mut Findings) {
    let Ok(name) = entry.name().map(std::borrow::Cow::into_owned) else { return };
    if name.contains('\\') || name.split('/').any(|part| part == ".") {
        let what = "a path with backslashes or parts that are a dot";
        findings.add(Error, &name, what, "Importers on Linux do not find the file.", SECTION);
    }
    if entry.version_needed() > 20 {
        let needed = f64::from(entry.version_needed()) / 10.0;
        let what = format!("needs version {needed:.1} of ZIP, expected at most 2.0");
        let why = "It may be a Zip64 archive, which not every importer reads.";
        findings.add(Error, &name, what, why, SECTION);
    }
    if entry.flags().is_using_data_descriptor() && entry.compression() == CompressionMethod::Stored
    {
        let what = "stored with a data descriptor, expected one with deflate only";
        let why = "Tools that read front to back do not find its end. Archives written as a stream have this.";
        findings.add(Error, &name, what, why, SECTION);
    }
    if !name.is_ascii() && entry.flags().as_u16() & UTF8 == 0 {
        let what = "a name that is not ASCII, without the flag for UTF-8";
        let why = "Importers decode the name in different ways.";
        findings.add(Error, &name, what, why, SECTION);
    }
    if name.contains(['<', '>', '"', '|', '?', '*']) || name.split('/').any(breaks_windows) {
        let why = "It cannot be unpacked on Windows.";
        findings.add(Warning, &name, "a name that Windows does not allow", why, "");
    }
    if name.len() > LONG {
        let what = format!("a path of {} bytes", name.len());
        let why = "With more than 260 in all, Windows may refuse to unpack it.";
        findings.add(Note, &name, what, why, "");
    }
    if entry.unix_mode().is_some_and(|mode| mode & 0o400 == 0) {
        let why = "unzip on UNIX makes a file that nobody can read.";
        findings.add(Warning, &name, "UNIX mode without the right to read", why, "");
    }
}

/// Whether Windows does not allow `part` of a path: it ends with a dot or a space, or is the name of a device.
fn breaks_windows(part: &str) -> bool {
    let stem = part.split('.').next().unwrap_or(part).to_ascii_lowercase();
    let is_port = stem.starts_with("com") || stem.starts_with("lpt");
    let is_port = is_port && matches!(stem.as_bytes()[3..], [b'1'..=b'9']);
    part.ends_with(['.', ' ']) || DEVICES.contains(&stem.as_str()) || is_port
}

fn case(names: &[String], findings: &mut Findings) {
    let mut earlier: HashMap<String, &str> = HashMap::new();
    for name in names {
        if let Some(other) = earlier.insert(name.to_lowercase(), name) {
            let what = format!("differs from {other} in upper and lower case only");
            let why = "On Windows and macOS one overwrites the other.";
            findings.add(Warning, name, what, why, "");
        }
    }
}

fn top_level(names: &[String], version: Version, findings: &mut Findings) {
    let mut entries = HashSet::new();
    // FMI 3.0 has its picture in terminalsAndIcons.
    let allowed = |entry: &&&str| version != Version::V3 || **entry != "model.png";
    let tops: Vec<&str> = TOP.iter().filter(allowed).copied().collect();
    for name in names {
        let top = name.split('/').next().unwrap_or(name);
        if !entries.insert(top) || tops.contains(&top) {
            continue;
        }
        let near = tops.iter().find(|entry| entry.eq_ignore_ascii_case(top));
        let what = match near {
            Some(near) => format!("expected {near}, with these upper and lower case letters"),
            None if top == "icons" => "expected terminalsAndIcons".to_owned(),
            None => format!("expected nothing but {} at the top", tops.join(", ")),
        };
        let why =
            near.map_or("", |_| "Importers do not find it where upper and lower case differ.");
        findings.add(Error, top, what, why, SECTION);
    }
    if !has_file(names, "binaries/") && !has_file(names, "sources/") {
        let what = "expected binaries or sources, found neither";
        findings.add(Error, "the archive", what, "Nobody can run it.", SECTION);
    }
    for name in names {
        let reserved = ["org.modelica", "org.fmi-standard"];
        let inner = name.strip_prefix("extra/").and_then(|rest| rest.split('/').next());
        let Some(inner) = inner.filter(|inner| !inner.is_empty()) else { continue };
        // Layered standards of the FMI project, some of which also apply to FMI 2.0.
        if inner.starts_with("org.fmi-standard.fmi-ls-") {
            continue;
        }
        if reserved.iter().any(|prefix| inner.starts_with(prefix)) || !inner.contains('.') {
            let what = "expected a folder called by a reverse domain name of its own";
            findings.add(Warning, name, what, "", "2.3.1");
        }
    }
}

/// Whether a file (not a folder) has a path that starts with `start`.
fn has_file(names: &[String], start: &str) -> bool {
    names.iter().any(|name| name.starts_with(start) && !name.ends_with('/'))
}

fn documentation(names: &[String], findings: &mut Findings) {
    let has = |path: &str| has_file(names, path);
    if has("documentation/") && !has("documentation/index.html") {
        let what = "expected index.html in it, the entry to the documentation";
        findings.add(Warning, "documentation", what, "Tools have nothing to show.", SECTION);
    }
    if !has("documentation/licenses/license.") {
        let what = "expected documentation/licenses/license.txt or .html, found neither";
        findings.add(Note, "documentation", what, "Users do not know what they may do.", SECTION);
    }
}

/// Checks that sources of FMI 3.0 have a build description.
fn build_description(names: &[String], findings: &mut Findings) {
    if has_file(names, "sources/") && !has_file(names, "sources/buildDescription.xml") {
        let what = "expected buildDescription.xml in it";
        findings.add(Error, "sources", what, "It cannot be built.", SECTION);
    }
}

/// Checks that the files in `SourceFiles` exist in `sources`, in the same upper and lower case.
fn sources(names: &[String], description: &ModelDescription, findings: &mut Findings) {
    let paths: HashSet<String> = names.iter().filter_map(|name| normal(name)).collect();
    let lower: HashSet<String> = paths.iter().map(|name| name.to_lowercase()).collect();
    for (interface, files) in [
        ("ModelExchange", description.model_exchange.as_ref().map(|flags| &flags.source_files)),
        ("CoSimulation", description.co_simulation.as_ref().map(|flags| &flags.source_files)),
    ] {
        for file in files.into_iter().flatten() {
            let path = normal(&format!("sources/{file}"));
            // Some exporters include the folder in the name.
            let with_folder = normal(file).filter(|path| path.starts_with("sources/"));
            if path.iter().chain(&with_folder).any(|path| paths.contains(path)) {
                continue;
            }
            let path = path.filter(|path| path.starts_with("sources/"));
            let Some(path) = path else {
                let what = format!("expected a file in sources, {interface} names {file:?}");
                findings.add(Error, "sources", what, "It cannot be built.", "2.3");
                continue;
            };
            let what =
                format!("expected {path}, which SourceFiles of {interface} names, found none");
            if lower.contains(&path.to_lowercase()) {
                let why = "It is there in other upper and lower case: it cannot be built on Linux.";
                findings.add(Warning, "sources", what, why, "2.3");
            } else {
                let why = "It cannot be built for another platform.";
                findings.add(Error, "sources", what, why, "2.3");
            }
        }
    }
}

/// Normalises a path to slashes without `.` and `..`; `None` if the path leaves the archive.
fn normal(path: &str) -> Option<String> {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

fn picture<R: std::io::Read>(mut file: ZipFile<'_, R>, findings: &mut Findings) {
    use std::io::Read as _;
    let mut start = [0; 8];
    if file.read_exact(&mut start).is_err() || start != *b"\x89PNG\r\n\x1a\n" {
        let why = "Tools show no picture.";
        findings.add(Warning, "model.png", "expected a PNG file", why, SECTION);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_devices_and_of_ports_break_windows() {
        for name in ["CON", "nul.txt", "com1", "LPT9.log", "end.", "end "] {
            assert!(breaks_windows(name), "{name}");
        }
        for name in ["con1", "com", "com0", "com10", "lpt", "compute.c", ".git"] {
            assert!(!breaks_windows(name), "{name}");
        }
    }

    #[test]
    fn an_empty_folder_counts_as_no_binaries() {
        let count = |names: &[&str]| {
            let names: Vec<_> = names.iter().map(|name| (*name).to_owned()).collect();
            let mut findings = Findings::about(Part::Archive);
            top_level(&names, Version::V2, &mut findings);
            findings.all.len()
        };
        assert_eq!(count(&["modelDescription.xml", "binaries/", "binaries/linux64/"]), 1);
        assert_eq!(count(&["modelDescription.xml", "binaries/", "binaries/linux64/m.so"]), 0);
    }

    /// FMI-LS-REF is based on FMI 2.0 and 3.0; FMI 2.0.5, section 2.3.1, reserves the prefix for layered standards.
    #[test]
    fn the_files_of_a_layered_standard_are_in_its_folder_in_fmi_2_and_3() {
        for version in [Version::V2, Version::V3] {
            for (folder, expected) in
                [("org.fmi-standard.fmi-ls-ref", 0), ("org.fmi-standard", 1), ("mine", 1)]
            {
                let names =
                    ["binaries/l/m.so".to_owned(), format!("extra/{folder}/fmi-ls-manifest.xml")];
                let mut findings = Findings::about(Part::Archive);
                top_level(&names, version, &mut findings);
                assert_eq!(findings.all.len(), expected, "{:#?}", findings.all);
            }
        }
    }
}
