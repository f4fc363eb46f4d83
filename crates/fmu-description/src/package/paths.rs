//! Allowed paths of the entries of an archive.

use crate::description::Version;

/// Characters that Windows does not allow in a file name.
const RESERVED: [char; 7] = ['<', '>', ':', '"', '|', '?', '*'];
/// Names of the devices of Windows that have no number.
const DEVICES: [&str; 4] = ["con", "prn", "aux", "nul"];

/// Folders at the root of an FMU.
const FOLDERS: [&str; 6] =
    ["documentation", "sources", "binaries", "resources", "extra", "terminalsAndIcons"];

/// Maximum length of a path in bytes.
const LENGTH: usize = 1024;
/// Maximum number of parts of a path.
const DEPTH: usize = 64;

/// Normalises a path: forward slashes, without the parts `.`. Parts `..` stay unchanged. Empty for the root
/// folder.
pub(super) fn normalised(path: &str) -> String {
    let path = path.replace('\\', "/");
    let (inner, end) = path.strip_suffix('/').map_or((path.as_str(), ""), |inner| (inner, "/"));
    let parts: Vec<&str> = inner.split('/').filter(|part| *part != ".").collect();
    if parts.is_empty() {
        return String::new();
    }
    parts.join("/") + end
}

/// Returns the violated rule if `path` could lead out of the folder into which it is unpacked, has control
/// characters, or is too long or too deep.
pub(super) fn unsafe_to_unpack(path: &str) -> Option<&'static str> {
    if path.contains('\\') {
        return Some("forward slashes between folders");
    }
    let inner = path.strip_suffix('/').unwrap_or(path);
    let leads_out = |part: &str| matches!(part, "" | "." | "..");
    if inner.split('/').any(leads_out) {
        return Some("a relative path without . and ..");
    }
    if path.contains(|character: char| character == ':' || character.is_control()) {
        return Some("a path without drive letter and control characters");
    }
    if path.len() > LENGTH || path.split('/').count() > DEPTH {
        return Some("a path of at most 1024 bytes and 64 levels");
    }
    None
}

/// Whether Windows reserves the name, in lower case without extension, for a device.
fn is_device(stem: &str) -> bool {
    let port = stem.strip_prefix("com").or_else(|| stem.strip_prefix("lpt"));
    DEVICES.contains(&stem) || port.is_some_and(|port| matches!(port.as_bytes(), [b'1'..=b'9']))
}

/// Returns the violated rule if an FMU that is written must not contain `path`.
pub(super) fn unsuitable(path: &str, version: Version) -> Option<&'static str> {
    if let Some(rule) = unsafe_to_unpack(path) {
        return Some(rule);
    }
    if !path.is_ascii() || path.contains(RESERVED) || path.ends_with('/') {
        return Some("the path of a file in ASCII, without any of < > : \" | ? *");
    }
    let breaks_windows = |part: &str| {
        let stem = part.split('.').next().unwrap_or(part).to_ascii_lowercase();
        part.ends_with(['.', ' ']) || is_device(&stem)
    };
    if path.split('/').any(breaks_windows) {
        return Some("names that Windows allows: no trailing dot or blank, no device");
    }
    let inside = path.split_once('/').is_some_and(|(folder, _)| FOLDERS.contains(&folder));
    if !inside && version == Version::V3 {
        return Some(
            "a file in documentation, sources, binaries, resources, extra or terminalsAndIcons",
        );
    }
    if !inside && path != "model.png" {
        return Some(
            "model.png, or a file in documentation, sources, binaries, resources, extra or \
             terminalsAndIcons",
        );
    }
    None
}
