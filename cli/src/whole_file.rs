//! Files that are there as a whole or not at all.

use std::path::Path;
use std::{fs, io, process};

/// Writes `bytes` to `path`, whose folder is made where it is missing: into a file beside it, which
/// then takes its name.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.partial", process::id()));
    let partial = Path::new(&name);
    path.parent()
        .map_or(Ok(()), fs::create_dir_all)
        .and_then(|()| fs::write(partial, bytes))
        .and_then(|()| fs::rename(partial, path))
        .inspect_err(|_| {
            // The write has failed already; that its remains cannot be removed adds nothing.
            let _ = fs::remove_file(partial);
        })
}
