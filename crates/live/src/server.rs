//! The threads of the server: one accepts connections, one calls the run for samples, one for each
//! connection.

use std::io;
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::answer::Answer;
use crate::request;
use crate::routes::Site;

/// Largest number of connections at the same time; more are closed at once.
const CONNECTIONS: usize = 24;
/// Time for a request and for its answer.
const REQUEST_TIME: Duration = Duration::from_secs(2);
const ANSWER_TIME: Duration = Duration::from_secs(5);
/// Pause after a connection that could not be accepted, for example because there are too many open files.
const REST: Duration = Duration::from_millis(50);
/// Interval between samples while a page is open, and between two looks whether one is.
const SAMPLE: Duration = Duration::from_millis(10);
const IDLE: Duration = Duration::from_millis(100);
/// A sample is due after this multiple of the time that one takes.
const COSTS: u32 = 50;

/// Starts the threads. They end when the view is closed.
pub(crate) fn start(listener: TcpListener, site: Arc<Site>) -> io::Result<()> {
    let keeper = site.clone();
    thread::Builder::new().name("live samples".to_owned()).spawn(move || keep(&keeper))?;
    thread::Builder::new().name("live view".to_owned()).spawn(move || accept(&listener, &site))?;
    Ok(())
}

/// Takes the events of the run, and calls for samples while a page is open.
fn keep(site: &Site) {
    let shared = &site.shared;
    while !shared.closed.load(Ordering::Acquire) {
        let is_watched = shared.store().is_watched();
        if is_watched {
            shared.call_for_sample();
            thread::sleep(SAMPLE.max(COSTS * shared.cost().min(Duration::from_secs(1))));
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
        let place = Place::take(&open);
        if open.load(Ordering::Relaxed) > CONNECTIONS {
            continue;
        }
        let site = site.clone();
        // Without a thread the connection is closed.
        let _ = thread::Builder::new().name("live page".to_owned()).spawn(move || {
            serve(stream, &site);
            drop(place);
        });
    }
}

/// A place among the open connections.
struct Place(Arc<AtomicUsize>);

impl Place {
    fn take(open: &Arc<AtomicUsize>) -> Self {
        open.fetch_add(1, Ordering::Relaxed);
        Self(open.clone())
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Answers the one request of a connection.
fn serve(mut stream: TcpStream, site: &Site) {
    let answer = match request::read(&mut stream, Instant::now() + REQUEST_TIME) {
        Ok(request) => site.answer(&request),
        Err(Some((status, reason))) => Answer::refusal(status, reason),
        Err(None) => return,
    };
    // The page may have gone.
    let _ = answer.write(&mut stream, Instant::now() + ANSWER_TIME);
}
