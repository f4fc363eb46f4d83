//! The threads of the server: one accepts connections, one requests samples from the run, and one per connection
//! answers the request.

use std::io;
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::answer::Answer;
use crate::request;
use crate::routes::Site;

/// Largest number of simultaneous connections; a further one is closed at once.
const CONNECTIONS: usize = 24;
/// Time limit for receiving a request.
const REQUEST_TIME: Duration = Duration::from_secs(2);
/// Time limit for sending an answer.
const ANSWER_TIME: Duration = Duration::from_secs(5);
/// Pause after a connection that could not be accepted, for example because there are too many open files.
const REST: Duration = Duration::from_millis(50);
/// Shortest interval between samples while a page is open.
const SAMPLE: Duration = Duration::from_millis(10);
/// Interval between two checks whether a page is open.
const IDLE: Duration = Duration::from_millis(100);
/// Shortest interval between samples, as a multiple of the wall-clock time that a sample costs the run.
const COSTS: u32 = 50;

/// Starts the threads of the server, which end after the view is closed.
pub(crate) fn start(listener: TcpListener, site: Arc<Site>) -> io::Result<()> {
    let sampled = site.clone();
    thread::Builder::new()
        .name("live samples".to_owned())
        .spawn(move || call_for_samples(&sampled))?;
    thread::Builder::new().name("live view".to_owned()).spawn(move || accept(&listener, &site))?;
    Ok(())
}

/// Moves the events of the run into the store, and calls for samples while a page is open.
fn call_for_samples(site: &Site) {
    let shared = &site.shared;
    while !shared.closed.load(Ordering::Acquire) {
        // The lock of the store is released after this statement.
        let is_watched = shared.store().is_watched();
        if is_watched {
            shared.call_for_sample();
            thread::sleep(SAMPLE.max(COSTS * shared.sample_duration().min(Duration::from_secs(1))));
        } else {
            thread::sleep(IDLE);
        }
    }
}

fn accept(listener: &TcpListener, site: &Arc<Site>) {
    let open = Arc::new(AtomicUsize::new(0));
    loop {
        let accepted = listener.accept();
        if site.shared.closed.load(Ordering::Acquire) {
            return;
        }
        let Ok((stream, _)) = accepted else {
            thread::sleep(REST);
            continue;
        };
        let connection = OpenConnection::new(&open);
        if open.load(Ordering::Relaxed) > CONNECTIONS {
            continue;
        }
        let site = site.clone();
        // If the thread cannot start, the connection is closed.
        let _ = thread::Builder::new().name("live page".to_owned()).spawn(move || {
            serve(stream, &site);
            drop(connection);
        });
    }
}

/// Counts an open connection until it is dropped.
struct OpenConnection(Arc<AtomicUsize>);

impl OpenConnection {
    fn new(open: &Arc<AtomicUsize>) -> Self {
        open.fetch_add(1, Ordering::Relaxed);
        Self(open.clone())
    }
}

impl Drop for OpenConnection {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Answers the only request of a connection; closes a broken connection without an answer.
fn serve(mut stream: TcpStream, site: &Site) {
    let answer = match request::read(&mut stream, Instant::now() + REQUEST_TIME) {
        Ok(request) => site.answer(&request),
        Err(Some((status, reason))) => Answer::refusal(status, reason),
        Err(None) => return,
    };
    // The page may be closed.
    let _ = answer.write(&mut stream, Instant::now() + ANSWER_TIME);
}
