//! An FMU in C that misbehaves on request, mostly towards its process.
//!
//! Unlike the strict FMUs of [`c_fmu`](crate::c_fmu), this FMU accepts any call at any time: a test can select another
//! misbehaviour between two steps. It has long strings and a long state.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::root;

/// The misbehaviour for each value of the FMU's Integer `trouble`, as in `enum trouble` of
/// `troubles.c`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
#[repr(i32)]
pub enum Trouble {
    None,
    CrashInStep,
    Abort,
    Leave,
    Hang,
    Flood,
    BreakHeap,
    CrashInGet,
    Print,
    OverwriteShared,
    DivideByZero,
    CloseFiles,
    Refuse,
    HangInFree,
    CrashInFree,
    OverflowStack,
    StopEarly,
    HangWithChild,
    AnswerWrongTurn,
    LeaveWithChild,
    TakeMemory,
    PrintFlood,
}

/// The folder of the unpacked FMU, compiled once for this process.
///
/// # Panics
///
/// If there is no C compiler.
#[must_use]
pub fn troubles() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let name = format!("troubles-{}", std::process::id());
        let (folder, sources) = (root().join("target/test-fmus").join(name), root());
        let sources = sources.join("tests/troubles");
        let platform = fmu_description::package::platforms().first().copied().unwrap_or("none");
        let library = folder.join("binaries").join(platform);
        let failed = |what: &str| panic!("{} cannot be {what}", folder.display());
        std::fs::create_dir_all(&library).unwrap_or_else(|_| failed("made"));
        let description = "modelDescription.xml";
        let copied = std::fs::copy(sources.join(description), folder.join(description));
        copied.unwrap_or_else(|_| panic!("{description} cannot be copied"));
        // These options keep the compiler from removing the intended crashes.
        let status = Command::new("cc")
            .args(["-std=c11", "-O1", "-fno-delete-null-pointer-checks", "-Wall", "-Wextra"])
            .args(["-fno-optimize-sibling-calls", "-pthread", "-shared", "-fPIC", "-o"])
            .arg(library.join(format!("Troubles{}", std::env::consts::DLL_SUFFIX)))
            .arg(sources.join("troubles.c"))
            .status();
        assert!(status.is_ok_and(|status| status.success()), "cc fails for troubles.c");
        folder
    })
}
