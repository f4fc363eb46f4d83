//! Forwards the output of a worker to the standard error of this process, up to a limit.

use std::io::{self, PipeReader, PipeWriter, Read as _, Write as _};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Maximum number of bytes of output forwarded for one worker.
const MAX_BYTES: u64 = 1 << 20;
/// Time limit for the last output of a worker that has ended. A process that left the worker's group may hold the pipe
/// open for ever.
const DRAIN_LIMIT: Duration = Duration::from_millis(500);

/// A thread that forwards the data of a pipe until its last writer closes it.
pub(super) struct Output {
    ended: Receiver<()>,
}

impl Output {
    /// Starts the thread; returns the thread and the write end of the pipe, which becomes the worker's standard error.
    pub(super) fn new(instance: &str) -> io::Result<(Self, PipeWriter)> {
        let (reader, writer) = io::pipe()?;
        let (sender, ended) = channel();
        let instance = instance.to_owned();
        let run = move || {
            forward(reader, &instance);
            // Fails if the `Output` was dropped.
            let _ = sender.send(());
        };
        std::thread::Builder::new().name("output".to_owned()).spawn(run)?;
        Ok((Self { ended }, writer))
    }

    /// Waits for the last output of a worker that has ended.
    pub(super) fn finish(&self) {
        // Fails after the limit, and if the thread has finished already.
        let _ = self.ended.recv_timeout(DRAIN_LIMIT);
    }
}

/// Copies the pipe to standard error. Beyond the limit, bytes are still read, so that the worker does not block, but
/// only counted.
fn forward(mut reader: PipeReader, instance: &str) {
    let (mut room, mut lost) = (MAX_BYTES, 0_u64);
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
            tracing::warn!("{instance} printed more than {MAX_BYTES} bytes: the rest is not shown");
        }
        // Fails if standard error is closed.
        let _ = io::stderr().write_all(&bytes[..printed]);
        room -= printed as u64;
        lost += (count - printed) as u64;
    }
    if lost > 0 {
        tracing::warn!("{instance} printed {lost} more bytes, which are not shown");
    }
}
