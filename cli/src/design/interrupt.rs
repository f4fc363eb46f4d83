//! Ctrl-C during a design: the first one leaves out what can be left out, a second one ends the command.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use anyhow::Context;
use fmu_import::crash;

/// The number of SIGINT.
const INTERRUPT: u8 = 2;

/// Starts to listen; returns the flag that the first Ctrl-C sets.
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
        eprintln!("interrupted: the design ends with what there is; Ctrl-C again ends it at once");
    };
    handle_signals(react).context("Ctrl-C cannot be handled")?;
    Ok(flag)
}

#[cfg(unix)]
fn handle_signals(react: impl Fn(u8) + Send + 'static) -> anyhow::Result<()> {
    Ok(crash::on_ending_signal(move |signal| react(u8::try_from(signal).unwrap_or(0)))?)
}

#[cfg(not(unix))]
fn handle_signals(react: impl Fn(u8) + Send + 'static) -> anyhow::Result<()> {
    Ok(ctrlc::set_handler(move || react(INTERRUPT))?)
}
