//! A variable over time, as much of it as a plot may need.

use results::Envelope;

/// Largest number of points of a curve.
pub(crate) const MOST: usize = 8_000;

/// A variable over time: all rows of a short run, the envelope of a longer one.
#[derive(Clone, Default)]
pub(crate) struct Trace {
    pub(crate) rows: Vec<(f64, f64)>,
    pub(crate) count: usize,
    pub(crate) envelope: Envelope,
}

impl Trace {
    pub(crate) fn push(&mut self, time: f64, value: f64) {
        self.count += 1;
        if self.count <= MOST {
            self.rows.push((time, value));
        }
        self.envelope.push(time, value);
    }
}
