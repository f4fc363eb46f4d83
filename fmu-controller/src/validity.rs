//! The check of the measurements: which of them the controller uses.
//!
//! A continuous controller uses a measurement that is in its range at the start of a communication step, and its input
//! derivative if the measurement is then in its range at the end of the step, too. A sampled controller uses a
//! measurement that is in its range at the sample. The last value that was used replaces a measurement that is not
//! used.
//!
//! If it replaces a measurement for longer than `longest_hold`, the controller rests: commands and estimates are those
//! of the operating point, without faults; integrals are 0; an actuator that is gone has the command at which it is
//! stuck. A detection keeps its decision, and its residuals and statistics are 0. As soon as no measurement is replaced
//! for too long, the controller continues like one that starts at the operating point: y_f starts from the
//! measurements, and the detection tests after `detect_from`.

use serde::{Deserialize, Serialize};

use crate::signals::Values;
use aso_controller::Design;
use aso_controller::clock::clock_rounding;
use aso_controller::design::HOLD_ROUNDING;
use aso_controller::sample::measurements::Validity;

/// The measurements as the importer sets them, and their holds: lists with an element for each measurement.
#[derive(Clone, Default, Serialize, Deserialize)]
pub(crate) struct MeasurementCheck {
    /// The measurements and their derivatives with respect to time.
    pub(crate) y: Vec<f64>,
    pub(crate) y_slopes: Vec<f64>,
    /// The smallest and the largest valid values.
    low: Vec<f64>,
    high: Vec<f64>,
    /// For each measurement the last value that was used.
    last: Vec<f64>,
    /// The measurements at a sample.
    sampled: Vec<f64>,
    /// The number of samples for which a sampled controller has used the last value, and the most for which it may.
    held: Vec<u32>,
    most_held: Vec<u32>,
    /// The time in s since which a continuous controller uses the last value, and the longest duration in s.
    held_since: Vec<Option<f64>>,
    longest: Vec<f64>,
    /// Whether the last value replaces any measurement.
    pub(crate) is_held: bool,
    /// Whether the last value replaces a measurement for too long, so that the controller rests.
    pub(crate) is_lost: bool,
}

impl MeasurementCheck {
    /// The check of the measurements of `design`; `None` if none has a range or a longest hold.
    pub(crate) fn new(design: &Design) -> Option<Self> {
        if !design.checks_measurements() {
            return None;
        }
        let signals = &design.measurements;
        let count = signals.len();
        let bound = |side: usize| signals.iter().map(|signal| signal.bounds()[side]).collect();
        let most = |period| signals.iter().map(move |signal| signal.most_held(period));
        let most = design.sample_time.into_iter().flat_map(most);
        let longest = signals.iter().map(|signal| signal.longest_hold.unwrap_or(f64::INFINITY));
        Some(Self {
            y: vec![0.0; count],
            y_slopes: vec![0.0; count],
            low: bound(0),
            high: bound(1),
            last: vec![0.0; count],
            sampled: vec![0.0; count],
            held: vec![0; count],
            most_held: most.map(|most| most.unwrap_or(u32::MAX)).collect(),
            held_since: vec![None; count],
            longest: longest.collect(),
            is_held: false,
            is_lost: false,
        })
    }

    /// Ends all holds, and sets the last values to the operating point.
    pub(crate) fn start(&mut self, design: &Design) {
        for (last, signal) in self.last.iter_mut().zip(&design.measurements) {
            *last = signal.operating.unwrap_or_default();
        }
        self.held.fill(0);
        self.held_since.fill(None);
        (self.is_held, self.is_lost) = (false, false);
    }

    /// Checks the measurements of a sample, `offset` s after they were given, and sets those of `values`.
    pub(crate) fn take_sample(&mut self, values: &mut Values, offset: f64) {
        for (k, sampled) in self.sampled.iter_mut().enumerate() {
            *sampled = self.y[k] + self.y_slopes[k] * offset;
        }
        let validity = Validity { low: &self.low, high: &self.high, most_held: &self.most_held };
        self.is_held = validity.take(&self.sampled, &mut self.last, &mut self.held);
        self.is_lost = validity.is_lost(&self.held);
        for k in 0..self.y.len() {
            (values.y[k], values.y_slopes[k]) = match self.held[k] {
                0 => (self.y[k], self.y_slopes[k]),
                _ => (self.last[k], 0.0),
            };
        }
    }

    /// Checks the measurements of a continuous controller for the communication step from `start`, in s, with the size
    /// `size`, in s; sets the measurements of `values` to those that are used.
    pub(crate) fn take_step(&mut self, values: &mut Values, start: f64, size: f64) {
        for k in 0..self.y.len() {
            let (mut y, mut slope) = (self.y[k], self.y_slopes[k]);
            if self.is_in_range(k, y) {
                self.held_since[k] = None;
                if !self.is_in_range(k, y + slope * size) {
                    slope = 0.0;
                }
                self.last[k] = y + slope * size;
            } else {
                self.held_since[k] = self.held_since[k].or(Some(start));
                (y, slope) = (self.last[k], 0.0);
            }
            (values.y[k], values.y_slopes[k]) = (y, slope);
        }
        let mut held = self.held_since.iter().zip(&self.longest);
        self.is_held = self.held_since.iter().any(Option::is_some);
        let rounding = clock_rounding(start);
        self.is_lost = held.any(|(since, longest)| {
            since.is_some_and(|since| start - since >= longest * (1.0 - HOLD_ROUNDING) - rounding)
        });
    }

    /// Sets the measurements of `values` between steps, without a decision: a value in its range, otherwise the last
    /// one.
    pub(crate) fn show(&self, values: &mut Values) {
        for k in 0..self.y.len() {
            (values.y[k], values.y_slopes[k]) = if self.is_in_range(k, self.y[k]) {
                (self.y[k], self.y_slopes[k])
            } else {
                (self.last[k], 0.0)
            };
        }
    }

    /// Sets the measurements of `values` to the components of a direction. A measurement that is not used has the
    /// component 0, in initialization mode that of its operating point in `initial`.
    pub(crate) fn take_direction(
        &self,
        direction: &Self,
        initial: Option<&Design>,
        values: &mut Values,
    ) {
        let initial = initial.filter(|design| design.has_operating_point());
        for k in 0..self.y.len() {
            (values.y[k], values.y_slopes[k]) = if self.is_in_range(k, self.y[k]) {
                (direction.y[k], direction.y_slopes[k])
            } else {
                let operating = initial.and_then(|design| design.measurements[k].operating);
                (operating.unwrap_or_default(), 0.0)
            };
        }
    }

    /// Whether `value` is in the range of measurement `k`; false for NaN and infinity.
    fn is_in_range(&self, k: usize, value: f64) -> bool {
        (self.low[k]..=self.high[k]).contains(&value)
    }
}
