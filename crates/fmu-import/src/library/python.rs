//! The shared library of Python, which FMUs of PythonFMU expect in their process.
#![cfg_attr(unix, expect(unsafe_code, reason = "the symbols of the process"))]

use std::path::PathBuf;
use std::process::Command;

use super::preload;

/// The Python interpreter that is asked for its shared libraries.
const PYTHON: &str = "python3";

/// The Python program that prints the shared libraries of its interpreter, the likeliest first.
const QUESTION: &str = r#"
import os, sys, sysconfig
get = sysconfig.get_config_var
version = get("LDVERSION") or "%d.%d" % sys.version_info[:2]
names = [get("INSTSONAME"), get("LDLIBRARY"), f"libpython{version}.so.1.0", f"libpython{version}.dylib"]
folders = [get("LIBDIR"), os.path.join(get("LIBDIR") or "", get("MULTIARCH") or ""),
           os.path.join(sys.base_prefix, "lib"), get("PYTHONFRAMEWORKPREFIX")]
for folder in folders:
    for name in names:
        path = os.path.join(folder or "", name or "")
        if os.path.isfile(path) and not path.endswith(".a"):
            print(path)
"#;

/// Returns whether the symbol belongs to the C interface of Python.
pub(super) fn defines(symbol: &str) -> bool {
    symbol.trim_start_matches('_').starts_with("Py")
}

/// Loads the library of Python, visible to all libraries loaded later, and logs its path as a warning. On failure
/// returns why none can be loaded.
pub(super) fn provide(fmu: &str) -> Result<(), String> {
    if is_visible() {
        return Err("the Python in the process lacks it".to_owned());
    }
    let (installed, mut why) = match installed() {
        Ok(libraries) => (libraries, None),
        Err(reason) => (Vec::new(), Some(reason)),
    };
    for library in loaded().into_iter().chain(installed) {
        match preload(library.as_os_str()) {
            Ok(()) => {
                tracing::warn!(
                    target: "fmu", instance = fmu,
                    "its library expects Python in the process: {} is loaded; --preload selects another, \
                     PYTHONPATH adds folders of packages",
                    library.display()
                );
                return Ok(());
            }
            Err(error) => why = Some(error.to_string()),
        }
    }
    Err(why.unwrap_or_else(|| format!("the {PYTHON} in PATH has no shared library")))
}

/// Returns whether the C interface of Python is visible to all libraries of this process.
fn is_visible() -> bool {
    #[cfg(unix)]
    // SAFETY: the symbol is not used.
    let visible = unsafe {
        libloading::os::unix::Library::this().get::<*const ()>(b"Py_IsInitialized\0").is_ok()
    };
    #[cfg(not(unix))]
    let visible = false;
    visible
}

/// Returns the path of a library of Python that this process has loaded without making it visible to others.
fn loaded() -> Option<PathBuf> {
    let maps = std::fs::read_to_string("/proc/self/maps").ok()?;
    let paths = maps.lines().filter_map(|line| line.find('/').map(|start| &line[start..]));
    let is_python =
        |path: &&str| path.rsplit('/').next().is_some_and(|name| name.starts_with("libpython3."));
    paths.into_iter().find(is_python).map(PathBuf::from)
}

/// Asks the Python in PATH for its shared libraries.
fn installed() -> Result<Vec<PathBuf>, String> {
    let output = Command::new(PYTHON).args(["-c", QUESTION]).output();
    let output = output.map_err(|error| format!("{PYTHON} cannot be started: {error}"))?;
    let text = String::from_utf8_lossy(&output.stdout);
    Ok(text.lines().map(PathBuf::from).collect())
}
