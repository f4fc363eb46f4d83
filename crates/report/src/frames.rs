//! The frames of a bus trace in the form of candump, by bus and identifier.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::path::Path;

use crate::{Error, name};

/// The flag of an error frame.
const ERROR: u32 = 0x2000_0000;

/// The frames with one identifier on one bus.
pub(crate) struct Message {
    /// Bus and identifier of the message, in the spelling of the trace file.
    pub(crate) name: String,
    /// Number of frames.
    pub(crate) count: usize,
    /// Time of the first frame in s.
    pub(crate) first: f64,
    /// Time of the last frame in s.
    pub(crate) last: f64,
    /// Shortest time between two frames in s; NaN for one frame.
    pub(crate) shortest: f64,
    /// Longest time between two frames in s; NaN for one frame.
    pub(crate) longest: f64,
    /// The time of each frame except the first in s, and the time since the frame before in ms.
    pub(crate) intervals: Vec<(f64, f64)>,
}

impl Message {
    fn new(name: String, time: f64) -> Self {
        let (shortest, longest) = (f64::NAN, f64::NAN);
        let intervals = Vec::new();
        Self { name, count: 1, first: time, last: time, shortest, longest, intervals }
    }

    fn push(&mut self, time: f64) {
        let interval = time - self.last;
        // Both are NaN until the second frame: `min` and `max` then return the interval.
        self.shortest = self.shortest.min(interval);
        self.longest = self.longest.max(interval);
        self.intervals.push((time, 1e3 * interval));
        self.count += 1;
        self.last = time;
    }

    /// Returns the mean time between two frames in s; NaN for one frame.
    #[expect(clippy::cast_precision_loss, reason = "fewer than 2^53 frames")]
    pub(crate) fn mean(&self) -> f64 {
        (self.last - self.first) / (self.count as f64 - 1.0)
    }
}

/// Reads the frames of a trace from time `from` to `to` in s: lines `(time) bus identifier#data`. Returns the messages
/// in the order of bus and identifier. A line that is neither empty nor a frame is an error.
pub(crate) fn read(path: &Path, (from, to): (f64, f64)) -> Result<Vec<Message>, Error> {
    let unreadable = |source| Error::Trace { file: name(path), source };
    let mut messages: BTreeMap<(String, String), Message> = BTreeMap::new();
    for (number, line) in BufReader::new(File::open(path).map_err(unreadable)?).lines().enumerate()
    {
        let line = line.map_err(unreadable)?;
        if line.trim().is_empty() {
            continue;
        }
        let (time, bus, identifier) = parse(&line).ok_or_else(|| {
            let file = name(path);
            Error::Frame { file, line: number + 1, actual: line.chars().take(80).collect() }
        })?;
        if !(from..=to).contains(&time) {
            continue;
        }
        messages
            .entry((bus.to_owned(), identifier.to_owned()))
            .and_modify(|message| message.push(time))
            .or_insert_with(|| Message::new(format!("{bus} {identifier}"), time));
    }
    Ok(messages.into_values().collect())
}

/// Parses a frame: time, bus, and identifier, which is `error` for an error frame. `None` if the line is no frame.
fn parse(line: &str) -> Option<(f64, &str, &str)> {
    let (time, rest) = line.trim_start().strip_prefix('(')?.split_once(')')?;
    let (bus, frame) = rest.trim().split_once(char::is_whitespace)?;
    let (identifier, _) = frame.trim().split_once('#')?;
    // SocketCAN marks error frames by a bit of the identifier.
    let flags = u32::from_str_radix(identifier, 16).ok()?;
    let identifier = if flags & ERROR == 0 { identifier } else { "error" };
    let time: f64 = time.trim().parse().ok()?;
    time.is_finite().then_some((time, bus, identifier))
}
