//! The rule that a program writes no file that it reads.

use std::path::{Path, PathBuf};
use std::{fmt, fs};

/// An output that is an input or another output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputConflict(String);

impl fmt::Display for OutputConflict {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl std::error::Error for OutputConflict {}

/// Checks that no output is an input or another output: not the same file by another path, by a
/// link, or by a name in other case. Each path comes with the option or argument that names it.
/// Pipes and devices may be named twice.
///
/// # Errors
///
/// [`OutputConflict`], which names both.
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

/// Whether the path leads to a pipe or a device.
fn is_stream(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

fn same_file(one: &Path, other: &Path) -> bool {
    let name = |path: &Path| resolved(path).to_string_lossy().to_lowercase();
    name(one) == name(other) || same_by_link(one, other)
}

/// The path without links and relative parts; the file itself need not exist.
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

#[cfg(unix)]
fn same_by_link(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let number =
        |path: &Path| fs::metadata(path).map(|metadata| (metadata.dev(), metadata.ino())).ok();
    number(one).is_some_and(|first| number(other) == Some(first))
}

#[cfg(not(unix))]
fn same_by_link(_: &Path, _: &Path) -> bool {
    false
}
