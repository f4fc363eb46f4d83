//! Checks that a program does not overwrite its inputs.

use std::path::{Path, PathBuf};
use std::{fmt, fs};

/// The error for an output that is also an input or another output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputConflict(String);

impl fmt::Display for OutputConflict {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl std::error::Error for OutputConflict {}

/// Checks that no output is an input or another output. Each path comes with the option or argument
/// that names it.
///
/// Two paths are the same file if both lead to one file, also by links, or if they differ in case only. An output that
/// is a pipe or a device is not checked.
///
/// # Errors
///
/// [`OutputConflict`] for the first output that is an input or an earlier output. The error names both paths.
pub fn check_distinct(
    inputs: &[(&str, &Path)],
    outputs: &[(&str, &Path)],
) -> Result<(), OutputConflict> {
    let outputs: Vec<_> = outputs.iter().filter(|(_, path)| !is_stream(path)).collect();
    for (index, (output, path)) in outputs.iter().enumerate() {
        let shown = path.display();
        if let Some((input, other)) = inputs.iter().find(|(_, other)| same_file(path, other)) {
            let other = other.display();
            return Err(OutputConflict(format!(
                "{output} {shown} would overwrite {input} {other}; choose another name"
            )));
        }
        if let Some((other, _)) = outputs[..index].iter().find(|(_, other)| same_file(path, other))
        {
            return Err(OutputConflict(format!(
                "{other} and {output} name the same file, {shown}"
            )));
        }
    }
    Ok(())
}

/// Whether the path leads to a pipe or a device; false if nothing is there.
pub(crate) fn is_stream(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

/// Whether both paths lead to one file, ignoring case; the files need not exist.
fn same_file(one: &Path, other: &Path) -> bool {
    let name = |path: &Path| resolved(path).to_string_lossy().to_lowercase();
    name(one) == name(other) || same_by_link(one, other)
}

/// Returns the absolute path without relative parts and without links in the part that exists.
fn resolved(path: &Path) -> PathBuf {
    if let Ok(canonical) = fs::canonicalize(path) {
        return canonical;
    }
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    match (absolute.parent(), absolute.file_name()) {
        (Some(folder), Some(name)) => resolved(folder).join(name),
        _ => absolute,
    }
}

/// Whether both paths are names of one existing file, by hard links.
#[cfg(unix)]
fn same_by_link(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let file_id =
        |path: &Path| fs::metadata(path).map(|metadata| (metadata.dev(), metadata.ino())).ok();
    file_id(one).is_some_and(|first| file_id(other) == Some(first))
}

#[cfg(not(unix))]
fn same_by_link(_: &Path, _: &Path) -> bool {
    false
}
