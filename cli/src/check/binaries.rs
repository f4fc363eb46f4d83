//! Checks of the shared libraries of all platforms, without loading them.

use std::collections::BTreeSet;
use std::io;

use fmu_description::call_order::{Function, InterfaceType, State, allowed};
use fmu_description::{ModelDescription, Version, abi1, abi3};
use object::{Architecture, BinaryFormat, ImportFlags, NameOrOrdinal, Object as _};

use super::finding::Severity::{Error, Note, Warning};
use super::finding::{Finding, Findings, Part, Tool};

const SECTION: &str = "2.3";

/// A folder of `binaries` with the file format, processor and extension of its libraries.
struct Platform {
    folder: &'static str,
    format: BinaryFormat,
    machine: Architecture,
    suffix: &'static str,
}

const fn platform(
    folder: &'static str,
    format: BinaryFormat,
    machine: Architecture,
    suffix: &'static str,
) -> Platform {
    Platform { folder, format, machine, suffix }
}

const PLATFORMS: [Platform; 18] = {
    use Architecture::{Aarch64, Arm, I386, X86_64};
    use BinaryFormat::{Elf, MachO, Pe};
    [
        platform("win32", Pe, I386, ".dll"),
        platform("win64", Pe, X86_64, ".dll"),
        platform("linux32", Elf, I386, ".so"),
        platform("linux64", Elf, X86_64, ".so"),
        platform("darwin32", MachO, I386, ".dylib"),
        platform("darwin64", MachO, X86_64, ".dylib"),
        platform("aarch32-windows", Pe, Arm, ".dll"),
        platform("aarch32-linux", Elf, Arm, ".so"),
        platform("aarch32-darwin", MachO, Arm, ".dylib"),
        platform("x86-windows", Pe, I386, ".dll"),
        platform("x86_64-windows", Pe, X86_64, ".dll"),
        platform("aarch64-windows", Pe, Aarch64, ".dll"),
        platform("x86-linux", Elf, I386, ".so"),
        platform("x86_64-linux", Elf, X86_64, ".so"),
        platform("aarch64-linux", Elf, Aarch64, ".so"),
        platform("x86-darwin", MachO, I386, ".dylib"),
        platform("x86_64-darwin", MachO, X86_64, ".dylib"),
        platform("aarch64-darwin", MachO, Aarch64, ".dylib"),
    ]
};

/// A function that reads the bytes of a file of the FMU, by the file's name in the archive.
pub(crate) type Read<'a> = dyn Fn(&str) -> io::Result<Vec<u8>> + 'a;

/// The files of an FMU.
struct Archive<'a> {
    read: &'a Read<'a>,
    names: &'a [String],
}

/// Checks the folder `binaries` of an FMU with the files `names`.
pub(crate) fn check(
    read: &Read<'_>,
    names: &[String],
    description: &ModelDescription,
) -> Vec<Finding> {
    let mut findings = Findings::about(Part::Binaries);
    let folders: BTreeSet<&str> = names
        .iter()
        .filter_map(|name| name.strip_prefix("binaries/")?.split_once('/').map(|(top, _)| top))
        .collect();
    let version = description.version();
    for name in folders {
        // FMI 3.0 has platform tuples only.
        let named = |platform: &&Platform| {
            platform.folder.eq_ignore_ascii_case(name)
                && (version != Version::V3 || name.contains('-'))
        };
        let Some(platform) = PLATFORMS.iter().find(named) else {
            let what = if version == Version::V3 {
                "expected a platform tuple, as x86_64-windows, x86_64-linux, aarch64-darwin"
            } else {
                "expected the name of a platform, as win64, linux64, darwin64, aarch64-linux"
            };
            let why = "Importers do not look there, unless a library does.";
            findings.add(Note, format!("binaries/{name}"), what, why, SECTION);
            continue;
        };
        let folder = platform.folder;
        if folder != name {
            let what = format!("expected {folder}, with these upper and lower case letters");
            let why = "Importers do not find the library where upper and lower case differ.";
            findings.add(Error, format!("binaries/{name}"), what, why, SECTION);
            findings.stopping(&[Tool::Platform(folder)]);
            continue;
        }
        for (interfaces, identifier) in interfaces(description) {
            let path = format!("binaries/{name}/{identifier}{}", platform.suffix);
            if !names.contains(&path) {
                missing(path, platform, names, &mut findings);
                continue;
            }
            let before = findings.all.len();
            let required = required(version, &interfaces, &identifier);
            library(&Archive { read, names }, &path, platform, &required, &mut findings);
            for finding in &mut findings.all[before..] {
                finding.stops = match version {
                    Version::V2 => stops(finding, platform, &interfaces),
                    Version::V1 | Version::V3 => stops_platform(finding, platform),
                };
            }
        }
    }
    findings.all
}

/// Returns the functions that a library must export. FMI 1.0: functions of co-simulation, prefixed with the model
/// identifier; FMI 2.0: functions of `interfaces`; FMI 3.0: all.
fn required(version: Version, interfaces: &[InterfaceType], identifier: &str) -> Vec<String> {
    match version {
        // The functions of model exchange of FMI 1.0 are not checked.
        Version::V1 if !interfaces.contains(&InterfaceType::CoSimulation) => Vec::new(),
        Version::V1 => abi1::FUNCTIONS.map(|name| format!("{identifier}_{name}")).to_vec(),
        Version::V2 => required_functions(interfaces).map(str::to_owned).collect(),
        Version::V3 => abi3::functions().map(str::to_owned).collect(),
    }
}

/// Returns the platform if the finding is an error, which stops all importers there, other than missing functions.
fn stops_platform(finding: &Finding, platform: &Platform) -> Vec<Tool> {
    if finding.severity == Error && !finding.what.starts_with("lacks ") {
        return vec![Tool::Platform(platform.folder)];
    }
    Vec::new()
}

/// Adds a finding for a missing library: an error that lists other files in its folder, or a note if the folder is
/// empty.
fn missing(path: String, platform: &Platform, names: &[String], findings: &mut Findings) {
    let folder = format!("binaries/{}/", platform.folder);
    let files = names.iter().filter(|name| name.starts_with(&folder) && !name.ends_with('/'));
    let files: Vec<&str> = files.take(5).map(String::as_str).collect();
    if files.is_empty() {
        let why = "It is the same as no folder for this platform.";
        return findings.add(Note, folder, "an empty folder", why, SECTION);
    }
    let what = format!("expected this library, found {}", files.join(", "));
    findings.add(Error, path, what, "Importers look for modelIdentifier.", SECTION);
    findings.stopping(&[Tool::Platform(platform.folder)]);
}

/// The functions that FMI Library requires only if a capability flag is true.
const BY_FLAG: [&str; 7] = [
    "fmi2GetFMUstate",
    "fmi2SetFMUstate",
    "fmi2FreeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SerializeFMUstate",
    "fmi2DeSerializeFMUstate",
    "fmi2GetDirectionalDerivative",
];

/// Returns the tools that a finding about a library of FMI 2.0 stops; none unless it is an error. If the FMU supports
/// co-simulation, missing functions of model exchange stop no tool.
fn stops(finding: &Finding, platform: &Platform, interfaces: &[InterfaceType]) -> Vec<Tool> {
    if finding.severity != Error {
        return Vec::new();
    }
    let Some(lacking) = finding.what.strip_prefix("lacks ") else {
        return vec![Tool::Platform(platform.folder)];
    };
    let simulation = [InterfaceType::CoSimulation];
    let called = if interfaces.contains(&simulation[0]) { &simulation[..] } else { interfaces };
    let called: BTreeSet<_> = required_functions(called).collect();
    let lacking: Vec<_> =
        lacking.split(", ").filter(|function| called.contains(function)).collect();
    match lacking.iter().all(|function| BY_FLAG.contains(function)) {
        _ if lacking.is_empty() => Vec::new(),
        true => vec![Tool::Fmpy],
        false => vec![Tool::Fmpy, Tool::FmiLibrary],
    }
}

/// Returns each library: the interface types that it serves, and its name. Omits the type Scheduled Execution, since in
/// FMI 3.0 a library exports the same functions for all types.
fn interfaces(description: &ModelDescription) -> Vec<(Vec<InterfaceType>, String)> {
    use InterfaceType::{CoSimulation, ModelExchange};
    let exchange = description.model_exchange.as_ref().map(|flags| flags.model_identifier.clone());
    let simulation = description.co_simulation.as_ref().map(|flags| flags.model_identifier.clone());
    let mut libraries: Vec<_> = match (simulation, exchange) {
        (Some(one), Some(other)) if one == other => vec![(vec![CoSimulation, ModelExchange], one)],
        (one, other) => [(CoSimulation, one), (ModelExchange, other)]
            .into_iter()
            .filter_map(|(interface, name)| Some((vec![interface], name?)))
            .collect(),
    };
    if let Some(flags) = &description.scheduled_execution
        && libraries.iter().all(|(_, name)| *name != flags.model_identifier)
    {
        libraries.push((Vec::new(), flags.model_identifier.clone()));
    }
    libraries
}

fn library(
    archive: &Archive<'_>,
    path: &str,
    platform: &Platform,
    required: &[String],
    findings: &mut Findings,
) {
    let bytes = match (archive.read)(path) {
        Ok(bytes) => bytes,
        Err(error) => return findings.add(Error, path, error.to_string(), "", ""),
    };
    let Some(bytes) = slice_of(&bytes, platform.machine) else {
        let what = format!("expected a part for {:?} in it", platform.machine);
        return findings.add(Error, path, what, "It does not load.", SECTION);
    };
    let file = match object::File::parse(bytes) {
        Ok(file) => file,
        Err(error) => {
            let what = format!("expected a shared library, found a file that is none: {error}");
            return findings.add(Error, path, what, "It does not load.", SECTION);
        }
    };
    let (format, machine) = (file.format(), file.architecture());
    if (format, machine) != (platform.format, platform.machine) {
        let what = format!(
            "expected {:?} for {:?}, found {format:?} for {machine:?}",
            platform.format, platform.machine
        );
        return findings.add(Error, path, what, "The system refuses to load it.", SECTION);
    }
    functions(&file, path, required, findings);
    needs(&file, path, archive.names, findings);
    versions(&file, path, findings);
}

/// Returns the part for `machine` of a universal macOS file, `None` without such a part; any other file as a whole.
fn slice_of(bytes: &[u8], machine: Architecture) -> Option<&[u8]> {
    use object::read::macho::{FatArch as _, MachOFatFile32, MachOFatFile64};
    if let Ok(fat) = MachOFatFile32::parse(bytes) {
        let part = fat.arches().iter().find(|part| part.architecture() == machine)?;
        return part.data(bytes).ok();
    }
    if let Ok(fat) = MachOFatFile64::parse(bytes) {
        let part = fat.arches().iter().find(|part| part.architecture() == machine)?;
        return part.data(bytes).ok();
    }
    Some(bytes)
}

/// Functions of FMI 2.0 that need no instance.
const ALWAYS: [&str; 3] = ["fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2Instantiate"];

/// Returns the functions of FMI 2.0 that a library for `interfaces` must export: [`ALWAYS`], and all that an importer
/// may call in some state.
fn required_functions(interfaces: &[InterfaceType]) -> impl Iterator<Item = &'static str> {
    let is_callable = |function: &Function| {
        let in_state = |interface, state: &State| allowed(interface, *function, *state);
        interfaces.iter().any(|one| State::EVERY.iter().any(|state| in_state(*one, state)))
    };
    let names = Function::EVERY.iter().copied().filter(is_callable).map(Function::name);
    ALWAYS.into_iter().chain(names)
}

fn functions(file: &object::File<'_>, path: &str, required: &[String], findings: &mut Findings) {
    let mut exported = BTreeSet::new();
    let Ok(exports) = file.exports() else {
        return findings.add(Error, path, "expected a readable list of exports", "", "2.1");
    };
    for export in exports.flatten() {
        if let NameOrOrdinal::Name(name) = export.name() {
            let name = String::from_utf8_lossy(name);
            // On macOS, the export list has C names with a leading underscore.
            let plain = name.strip_prefix('_').filter(|rest| {
                rest.starts_with("fmi") || required.iter().any(|function| function == rest)
            });
            exported.insert(plain.unwrap_or(&name).to_owned());
        }
    }
    let missing: BTreeSet<&str> =
        required.iter().filter(|name| !exported.contains(*name)).map(String::as_str).collect();
    if missing.is_empty() {
        return;
    }
    let step = ["fmi2DoStep", "fmi3DoStep"].into_iter().find(|name| missing.contains(name));
    let prefixed = step.and_then(|step| exported.iter().find(|name| name.ends_with(step)));
    if let Some(prefixed) = prefixed {
        let what = format!("expected functions without prefix, found {prefixed}");
        let why = "Importers look for the plain names; prefixes are for source code.";
        return findings.add(Error, path, what, why, "2.1.1");
    }
    let second = missing.iter().any(|function| function.starts_with("fmi2"));
    let missing: Vec<_> = missing.into_iter().collect();
    let what = format!("lacks {}", missing.join(", "));
    let why = if second {
        "FMPy needs all functions; FMI Library all but those for states and directional derivatives."
    } else {
        "The standard demands all functions; importers may refuse to load it."
    };
    findings.add(Error, path, what, why, "2.1.1");
}

/// Prefixes of the names, in lower case, of libraries of the operating system, separated by white space.
const SYSTEM: &str = "libc.so libm.so libmvec.so libpthread.so libdl.so librt.so libutil.so \
    libresolv.so libgcc_s.so ld-linux linux-vdso libstdc++.so \
    /usr/lib/ /system/ kernel32 kernelbase ntdll user32 advapi32 \
    ws2_32 ole32 oleaut32 shell32 shlwapi gdi32 comdlg32 comctl32 msvcrt.dll bcrypt crypt32 \
    userenv dbghelp psapi version.dll winmm rpcrt4 secur32 iphlpapi setupapi imm32 powrprof \
    netapi32 mpr.dll wsock32 api-ms-win- ext-ms-win- ucrtbase opengl32 normaliz cfgmgr32 \
    wintrust dhcpcsvc wininet winhttp winspool wldap32 wtsapi32 urlmon dnsapi ncrypt gdiplus \
    pdh.dll";

/// Whether a library whose name in lower case is `lower` belongs to the operating system.
fn is_of_system(lower: &str) -> bool {
    SYSTEM.split_ascii_whitespace().any(|prefix| lower.starts_with(prefix))
}

fn needs(file: &object::File<'_>, path: &str, names: &[String], findings: &mut Findings) {
    let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
    for library in file.import_libraries().into_iter().flatten().flatten() {
        let name = String::from_utf8_lossy(library.name()).into_owned();
        let lower = name.to_ascii_lowercase();
        if is_of_system(&lower) {
            continue;
        }
        let last = name.rsplit('/').next().unwrap_or(&name);
        let beside = format!("{folder}/{last}");
        if names.iter().any(|name| name.eq_ignore_ascii_case(&beside)) {
            continue;
        }
        let what = format!("needs {name}, which is neither beside it nor part of the system");
        let why = match lower.as_str() {
            _ if lower.starts_with("vcruntime") || lower.starts_with("msvcp") => {
                "It loads only where the redistributable of Visual C++ is installed; /MT avoids that."
            }
            _ if lower.starts_with("libpython") => "It loads only where this Python is installed.",
            _ => {
                "It loads only where that is installed; list it in documentation/externalDependencies.txt."
            }
        };
        findings.add(Warning, path, what, why, SECTION);
    }
}

/// Adds a note with the newest version of glibc that a library for Linux needs, if the library needs glibc.
fn versions(file: &object::File<'_>, path: &str, findings: &mut Findings) {
    let versions = file.imports().into_iter().flatten().flatten().filter_map(|import| {
        let ImportFlags::Elf { version: Some(version), .. } = import.flags() else { return None };
        let text = std::str::from_utf8(version).ok()?.strip_prefix("GLIBC_")?;
        let numbers: Vec<u32> = text.split('.').map_while(|part| part.parse().ok()).collect();
        Some((numbers, text.to_owned()))
    });
    let newest = versions.reduce(|most, other| if most.0 < other.0 { other } else { most });
    if let Some((_, version)) = newest {
        let what = format!("needs glibc {version} or later");
        findings.add(Note, path, what, "It does not load on older systems.", "");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The files of glibc 2.36; GCC links libmvec with -Ofast.
    #[test]
    fn the_libraries_of_glibc_belong_to_the_system() {
        for name in ["libc.so.6", "libm.so.6", "libmvec.so.1", "libresolv.so.2", "librt.so.1"] {
            assert!(is_of_system(name), "{name}");
        }
        assert!(!is_of_system("libmumps.so.5"));
    }

    /// FMI 3.0.2, section 2.5.1.4.1: four architectures and three systems.
    #[test]
    fn libraries_of_each_platform_tuple_are_checked() {
        let of_interface = |interface: &str| {
            let text = format!(
                r#"<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="t">
<{interface} modelIdentifier="M"/><ModelVariables>
<Float64 name="time" valueReference="0" causality="independent"/>
</ModelVariables><ModelStructure/></fmiModelDescription>"#
            );
            ModelDescription::parse(text).unwrap()
        };
        let descriptions =
            ["CoSimulation", "ModelExchange", "ScheduledExecution"].map(of_interface);
        for architecture in ["aarch32", "aarch64", "x86", "x86_64"] {
            for (system, suffix) in [("darwin", ".dylib"), ("linux", ".so"), ("windows", ".dll")] {
                let name = format!("binaries/{architecture}-{system}/M{suffix}");
                for description in &descriptions {
                    let names = std::slice::from_ref(&name);
                    let findings = check(&|_: &str| Ok(b"no library".to_vec()), names, description);
                    let what = findings.iter().map(|finding| finding.what.as_str());
                    let what = what.collect::<Vec<_>>().join("; ");
                    assert!(what.starts_with("expected a shared library, found"), "{what}");
                }
            }
        }
    }
}
