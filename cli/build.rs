//! Passes the hash of the commit, and the path of the clone, to the build of the command.

use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let version = env!("CARGO_PKG_VERSION");
    let commit = commit().map_or(String::new(), |commit| format!(" ({commit})"));
    println!("cargo::rustc-env=ASO_FTC_VERSION={version}{commit}");
    if let Some(clone) = clone() {
        println!("cargo::rustc-env=ASO_FTC_CLONE={}", clone.display());
    }
}

/// Returns hash and date of the commit; `None` outside of a clone, as in a packed crate, or without git.
fn commit() -> Option<String> {
    if git(&["rev-parse", "--show-prefix"])? != "cli/" {
        return None;
    }
    // HEAD and the branch that it names; a branch without a file of its own shows in the log of HEAD.
    let branch = git(&["symbolic-ref", "-q", "HEAD"]);
    for name in ["HEAD", "logs/HEAD"].into_iter().chain(branch.as_deref()) {
        let path = PathBuf::from(git(&["rev-parse", "--git-path", name])?);
        if path.exists() {
            println!("cargo::rerun-if-changed={}", path.display());
        }
    }
    git(&["show", "-s", "--abbrev=8", "--format=%h %cs", "HEAD"])
}

/// Returns what git prints in the folder of this crate.
fn git(words: &[&str]) -> Option<String> {
    let output = Command::new("git").args(words).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// Returns the folder of the clone that this crate is built in; `None` if paths are remapped.
fn clone() -> Option<PathBuf> {
    let flags = std::env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?;
    let is_clone = root.join("fmu-plant/Cargo.toml").is_file();
    (is_clone && !flags.contains("--remap-path-prefix")).then(|| root.to_owned())
}
