//! Loads and unloads the libraries of FMUs, and libraries that FMUs expect in their process.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::OsStr;
use std::mem::ManuallyDrop;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::time::Duration;

use libloading::Library;

use super::python;
use crate::crash::{LOADING, Limit, Place, UNLOADING};
use crate::error::LoadError;

/// Treatment of a library that calls functions that no library defines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Binding {
    /// Load the library with a warning, if the system can bind functions at their first call. A call of an undefined
    /// function then ends the process.
    Lenient,
    /// Refuse the library.
    #[cfg(target_os = "linux")]
    Strict,
}

/// A library to load.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Loading<'a> {
    pub(crate) path: &'a Path,
    /// The name of the FMU for messages.
    pub(crate) fmu: &'a str,
    #[cfg_attr(
        not(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64")),
        expect(dead_code, reason = "other linkers bind all functions at once")
    )]
    pub(crate) binding: Binding,
}

impl Loading<'_> {
    /// Loads the library. If the library lacks a symbol of Python, loads the library of Python and tries again. If
    /// another function is undefined, loads the library with a warning where [`Binding::Lenient`] allows it.
    pub(super) fn load(&self) -> Result<Handle, LoadError> {
        let place = Place::new(self.fmu);
        let open = || {
            place.enter(&LOADING);
            let opened = open(self.path);
            place.leave();
            // The message of the linker repeats the path.
            let prefix = format!("{}: ", self.path.display());
            opened.map_err(|error| reason(&error).replacen(&prefix, "", 1))
        };
        let mut opened = open();
        let mut hint = String::new();
        if let Err(message) = &opened
            && let Some(symbol) = undefined(message)
        {
            if python::defines(symbol) {
                match python::provide(self.fmu) {
                    Ok(()) => opened = open(),
                    Err(why) => {
                        hint = format!(
                            ": the library expects Python in the process, as FMUs of PythonFMU do, and \
                             {why}; --preload loads it, for example --preload libpython3.11.so.1.0"
                        );
                    }
                }
            } else {
                hint.push_str("; --preload loads the library that defines it");
                place.enter(&LOADING);
                let lenient = self.open_leniently(symbol);
                place.leave();
                opened = lenient.map_or(opened, Ok);
            }
        } else if let Err(message) = &opened
            && message == "cannot open shared object file: No such file or directory"
            && self.path.is_file()
        {
            // The linker of glibc reports a library for another processor as missing.
            hint = format!(
                ": the file is there, for another processor than {}",
                std::env::consts::ARCH
            );
        }
        match opened {
            Ok(library) => Ok(Handle { library: ManuallyDrop::new(library), fmu: self.fmu.into() }),
            Err(message) => Err(LoadError::Refused { path: self.path.to_owned(), message, hint }),
        }
    }

    /// Opens a library that calls the undefined function `symbol`, and warns; `None` if the binding is strict, if the
    /// system refuses the library, or if another library of the FMU calls `symbol`.
    #[cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]
    fn open_leniently(&self, symbol: &str) -> Option<Library> {
        use libloading::os::unix::{Library, RTLD_LAZY, RTLD_LOCAL};
        if self.binding == Binding::Strict {
            return None;
        }
        // SAFETY: runs the initialisers of the library, which is what the user asked for.
        let library = unsafe { Library::open(Some(self.path), RTLD_LAZY | RTLD_LOCAL) }.ok()?;
        let handle = library.into_raw();
        // SAFETY: the handle of an open library.
        let (names, library) =
            unsafe { (super::unresolved::replace(handle), Library::from_raw(handle)) };
        // Otherwise another library of the FMU calls `symbol`.
        if !names.iter().any(|name| name == symbol) {
            return None;
        }
        let (names, plural) = (names.join(", "), if names.len() == 1 { "" } else { "s" });
        tracing::warn!(
            target: "fmu", instance = self.fmu,
            "the library lacks the function{plural} {names}, which no loaded library defines: the run ends if \
             the FMU calls it, and FMPy and others refuse to load it; --preload loads a library that defines it"
        );
        Some(library.into())
    }

    #[cfg(not(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64")))]
    fn open_leniently(&self, _: &str) -> Option<Library> {
        None
    }
}

/// Returns the symbol that a message of the dynamic linker names as undefined, if any.
fn undefined(message: &str) -> Option<&str> {
    let symbol = message.split("undefined symbol: ").nth(1)?;
    symbol.split([' ', ',']).next()
}

/// Time limit for the destructors and exit handlers of a library.
const UNLOAD_LIMIT: Duration = Duration::from_secs(1);

/// A loaded library, unloaded on drop.
pub(super) struct Handle {
    library: ManuallyDrop<Library>,
    /// The name of the FMU.
    fmu: String,
}

impl Deref for Handle {
    type Target = Library;

    fn deref(&self) -> &Library {
        &self.library
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        let place = Place::new(&self.fmu);
        let limit = Limit::new(UNLOAD_LIMIT);
        place.enter(&UNLOADING);
        // SAFETY: the library is not used again.
        unsafe { ManuallyDrop::drop(&mut self.library) };
        place.leave();
        drop(limit);
    }
}

/// Returns the message of the operating system, without the prefix that `libloading` adds.
fn reason(error: &libloading::Error) -> String {
    std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string)
}

/// Opens a library and binds all its symbols.
#[cfg(not(windows))]
fn open(path: &Path) -> Result<Library, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: runs the initialisers of the library, which is what the user asked for.
    unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map(Into::into)
}

/// Opens a library. The system searches its dependencies in the folder of the library first.
#[cfg(windows)]
fn open(path: &Path) -> Result<Library, libloading::Error> {
    use libloading::os::windows::{LOAD_WITH_ALTERED_SEARCH_PATH, Library};
    // The flag requires an absolute path with the separators of Windows.
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    // SAFETY: runs the initialisers of the library, which is what the user asked for.
    unsafe { Library::load_with_flags(path, LOAD_WITH_ALTERED_SEARCH_PATH) }.map(Into::into)
}

/// Loads `library` for the lifetime of the process. On Unix its symbols are visible to all libraries
/// loaded later (`RTLD_GLOBAL`).
///
/// # Errors
///
/// [`LoadError::Refused`] if the operating system does not find or does not load the library.
pub fn preload(library: &OsStr) -> Result<(), LoadError> {
    #[cfg(unix)]
    // SAFETY: runs the initialisers of the library, which is what the user asked for.
    let opened = unsafe {
        use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW};
        Library::open(Some(library), RTLD_NOW | RTLD_GLOBAL)
    };
    #[cfg(not(unix))]
    // SAFETY: runs the initialisers of the library, which is what the user asked for.
    let opened = unsafe { Library::new(library) };
    opened.map(std::mem::forget).map_err(|error| LoadError::Refused {
        path: PathBuf::from(library),
        message: reason(&error),
        hint: String::new(),
    })
}

#[cfg(all(test, target_os = "linux", target_env = "gnu"))]
mod tests {
    use std::fs;
    use std::io::Read as _;

    use fmu_description::package::TemporaryFolder;

    use super::*;

    #[test]
    fn a_library_for_another_processor_is_refused_for_that_reason() {
        let mut header = [0; 4096];
        let program = std::env::current_exe().unwrap();
        fs::File::open(program).unwrap().read_exact(&mut header).unwrap();
        // The field `e_machine` of the ELF header; 8 is MIPS.
        header[18..20].copy_from_slice(&8_u16.to_ne_bytes());
        let folder = TemporaryFolder::new().unwrap();
        let path = folder.path().join("model.so");
        fs::write(&path, header).unwrap();
        let loading = Loading { path: &path, fmu: "model", binding: Binding::Lenient };
        let error = loading.load().err().unwrap();
        assert!(error.to_string().contains("for another processor than"), "{error}");
    }
}
