//! The signals by which a user or a system ends the command.

/// The number of SIGINT.
pub(crate) const INTERRUPT: u8 = 2;

/// Calls `react` in a thread with the number of each signal by which a user or a system ends the command. Only the
/// first call has an effect. Returns an error if the system refuses the thread or a handler.
#[cfg(unix)]
pub(crate) fn on_signal(react: impl Fn(u8) + Send + 'static) -> anyhow::Result<()> {
    Ok(fmu_import::crash::on_ending_signal(move |signal| react(u8::try_from(signal).unwrap_or(0)))?)
}

/// Calls `react` in a thread with [`INTERRUPT`] at each Ctrl-C and Ctrl-Break, and when the console is closed. A second
/// call is an error.
#[cfg(not(unix))]
pub(crate) fn on_signal(react: impl Fn(u8) + Send + 'static) -> anyhow::Result<()> {
    Ok(ctrlc::set_handler(move || react(INTERRUPT))?)
}
