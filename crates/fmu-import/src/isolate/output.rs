//! What a worker prints: to this process's standard error, with a limit.

use std::io::{self, PipeReader, PipeWriter, Read as _, Write as _};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Most bytes of one worker that are printed.
const MOST: u64 = 1 << 20;
/// How long the last output of a worker that has ended is waited for. A process that left the
/// worker's group may hold the pipe open for ever.
const ENDING: Duration = Duration::from_millis(500);

/// Passes on what is written to a pipe, until its last writer is gone.
pub(super) struct Output {
    ended: Receiver<()>,
}

impl Output {
    /// Starts to pass on; the second is what the worker gets as its standard error.
    pub(super) fn new(instance: &str) -> io::Result<(Self, PipeWriter)> {
        let (reader, writer) = io::pipe()?;
        let (sender, ended) = channel();
        let instance = instance.to_owned();
        let pass = move || {
            pass_on(reader, &instance);
            // Nobody listens where the worker was given up.
            let _ = sender.send(());
        };
        std::thread::Builder::new().name("output".to_owned()).spawn(pass)?;
        Ok((Self { ended }, writer))
    }

    /// Waits for the rest of a worker that has ended.
    pub(super) fn finish(&self) {
        // Late, or already finished.
        let _ = self.ended.recv_timeout(ENDING);
    }
}

/// What is beyond the limit is read, so that the worker is not held up, and counted.
fn pass_on(mut reader: PipeReader, instance: &str) {
    let (mut room, mut lost) = (MOST, 0_u64);
    let mut bytes = vec![0; 1 << 16];
    loop {
        let count = match reader.read(&mut bytes) {
            Ok(0) => break,
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(_) => break,
        };
        let printed = usize::try_from(room).unwrap_or(count).min(count);
        if printed < count && lost == 0 {
            tracing::warn!("{instance} prints more than {MOST} bytes: the rest is left out");
        }
        // Where standard error is closed nobody is left to read it.
        let _ = io::stderr().write_all(&bytes[..printed]);
        room -= printed as u64;
        lost += (count - printed) as u64;
    }
    if lost > 0 {
        tracing::warn!("{instance} printed {lost} more bytes, which are left out");
    }
}
