//! The settings that an FMU can change for its whole process: environment, working directory, rounding mode, locale
//! and process group.
#![expect(unsafe_code, reason = "the locale of C")]

use std::collections::BTreeMap;
use std::ffi::{CStr, OsString};
use std::hint::black_box;

use rustix::process::getpgrp;

/// Process-wide settings, which all libraries of a process share.
pub(crate) struct Surroundings {
    environment: BTreeMap<OsString, OsString>,
    /// Working directory, rounding mode, locale and process group: names and values.
    others: [(&'static str, String); 4],
}

impl Surroundings {
    /// Returns the present settings of this process.
    pub(crate) fn now() -> Self {
        let folder = std::env::current_dir();
        let folder =
            folder.map_or_else(|error| error.to_string(), |folder| folder.display().to_string());
        // SAFETY: with null the function only returns the name of the locale.
        let locale = unsafe { libc::setlocale(libc::LC_ALL, std::ptr::null()).as_ref() };
        // SAFETY: a terminated string, which lives until the locale changes.
        let locale = locale.map(|name| unsafe { CStr::from_ptr(name) }.to_string_lossy());
        Self {
            environment: std::env::vars_os().collect(),
            others: [
                ("working directory", folder),
                ("rounding mode", rounding().to_owned()),
                ("locale", locale.unwrap_or_default().into_owned()),
                ("process group", getpgrp().as_raw_pid().to_string()),
            ],
        }
    }

    /// Returns a phrase for each setting that differs in `later`.
    pub(crate) fn changes(&self, later: &Self) -> Vec<String> {
        let others =
            self.others.iter().zip(&later.others).filter(|(earlier, later)| earlier != later);
        let others = others
            .map(|((what, before), (_, after))| format!("the {what} from {before} to {after}"));
        let names = self.environment.keys().chain(later.environment.keys());
        let mut names: Vec<_> = names
            .filter(|name| self.environment.get(*name) != later.environment.get(*name))
            .map(|name| name.to_string_lossy().into_owned())
            .collect();
        names.sort();
        names.dedup();
        let variables = match names.len() {
            0 => None,
            1 => Some(format!("the environment variable {}", names[0])),
            _ => Some(format!("the environment variables {}", names.join(", "))),
        };
        others.chain(variables).collect()
    }
}

/// Returns the rounding mode of this thread.
fn rounding() -> &'static str {
    let small = black_box(f64::EPSILON / 1024.0);
    let one = black_box(1.0_f64);
    match (one + small > 1.0, -one - small < -1.0, one - small < 1.0) {
        (false, false, false) => "to nearest",
        (true, ..) => "upward",
        (_, true, _) => "downward",
        _ => "toward zero",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_named_with_both_values() {
        let before = Surroundings::now();
        assert!(before.changes(&Surroundings::now()).is_empty());
        let mut after = Surroundings::now();
        after.others[1].1 = "upward".to_owned();
        after.environment.insert("FMU_CHANGE".into(), "1".into());
        assert_eq!(before.others[1].1, "to nearest");
        assert_eq!(
            before.changes(&after),
            ["the rounding mode from to nearest to upward", "the environment variable FMU_CHANGE"]
        );
    }
}
