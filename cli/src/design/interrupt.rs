//! Signals during a design: the first Ctrl-C leaves out the rest of the optional work; a second one, or another signal
//! that ends programs, ends the command at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use anyhow::Context;
use fmu_import::crash;

use crate::signals::{INTERRUPT, on_signal};

/// Starts to handle signals; returns the flag that the first Ctrl-C sets. A second call returns the same flag.
pub(super) fn listen() -> anyhow::Result<Arc<AtomicBool>> {
    static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    if let Some(flag) = FLAG.get() {
        return Ok(Arc::clone(flag));
    }
    let flag = Arc::clone(FLAG.get_or_init(Arc::default));
    let raised = Arc::clone(&flag);
    let react = move |signal: u8| {
        if signal != INTERRUPT || raised.swap(true, Ordering::Relaxed) {
            crash::leave(128 + signal);
        }
        eprintln!("interrupted: the design leaves out optional work; Ctrl-C again ends it at once");
    };
    on_signal(react).context("Ctrl-C cannot be handled")?;
    Ok(flag)
}
