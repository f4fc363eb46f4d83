//! Limits on the sizes of files, which protect memory and disk against malicious files.

use std::sync::OnceLock;

/// Environment variable with the value `1` that lifts the limits on size and depth of files.
pub const LIFT: &str = "ASO_FTC_TRUST_FILES";

/// The end of a message about a limit: its purpose, and how to lift it.
pub const HELP: &str = "; this limit protects memory and disk. For files that you trust, the environment variable \
     ASO_FTC_TRUST_FILES=1 lifts it";

/// Returns `limit`, or the largest number if the user has lifted the limits.
#[must_use]
pub fn in_force(limit: u64) -> u64 {
    static LIFTED: OnceLock<bool> = OnceLock::new();
    let lifted = LIFTED.get_or_init(|| std::env::var_os(LIFT).is_some_and(|value| value == "1"));
    if *lifted { u64::MAX } else { limit }
}

/// Whether `count` exceeds `limit`; false if the user has lifted the limits.
#[must_use]
pub fn exceeds(count: usize, limit: usize) -> bool {
    count > limit && in_force(0) == 0
}
