//! The event indicators over one step of an integrator.

use super::Quartic;

/// Event indicators at five points of a step: at 0, 1/4, 1/2, 3/4 and 1 of its length.
///
/// An event happens where an indicator changes between z > 0 and z <= 0 (FMI 2.0.5, section 3.2.2).
#[derive(Clone, Debug, Default)]
pub(super) struct Indicators {
    samples: [Vec<f64>; 5],
    /// Whether each indicator was above 0 after the last event.
    positive: Vec<bool>,
}

impl Indicators {
    pub(super) fn new(count: usize) -> Self {
        Self { samples: std::array::from_fn(|_| vec![1.0; count]), positive: vec![true; count] }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.positive.is_empty()
    }

    /// The place for the indicators at `k` quarters of the step.
    pub(super) fn sample_mut(&mut self, k: usize) -> &mut [f64] {
        &mut self.samples[k]
    }

    /// Records the signs of the indicators at the start as the signs after the last event.
    pub(super) fn keep_signs(&mut self) {
        for (positive, value) in self.positive.iter_mut().zip(&self.samples[0]) {
            *positive = *value > 0.0;
        }
    }

    /// Makes the indicators at the end the indicators at the start of the next step.
    pub(super) fn proceed(&mut self) {
        self.samples.swap(0, 4);
    }

    /// Position and value of the first indicator that is infinite or not a number at one of the five points.
    pub(super) fn first_not_finite(&self) -> Option<(usize, f64)> {
        let of =
            |values: &Vec<f64>| values.iter().copied().enumerate().find(|(_, z)| !z.is_finite());
        self.samples.iter().find_map(of)
    }

    /// The distance of the indicators `values` to an event: the smallest indicator, where each has the sign that makes
    /// it positive before its event. An event has happened where it is negative. NaN if an indicator is NaN, infinity
    /// without indicators.
    pub(super) fn margin(&self, values: &[f64]) -> f64 {
        let margins = values.iter().zip(&self.positive);
        margins.fold(f64::INFINITY, |least, (value, positive)| {
            let margin = if *positive { *value } else { -*value };
            // For an indicator that was above zero, zero is beyond the event.
            let margin = if *positive && margin == 0.0 { -f64::MIN_POSITIVE } else { margin };
            if margin < least || margin.is_nan() { margin } else { least }
        })
    }

    /// The fraction of the step after which the first event is expected, by the polynomials through the
    /// five values of each indicator; `None` if no event is expected.
    pub(super) fn first_crossing(&self) -> Option<f64> {
        let crossing = |(i, positive): (usize, &bool)| {
            let sign = if *positive { 1.0 } else { -1.0 };
            let values = self.samples.each_ref().map(|sample| sign * sample[i]);
            let ends_in_event = *positive && values[4] == 0.0;
            let first = Quartic::interpolate(values).first_negative();
            first.or_else(|| ends_in_event.then_some(1.0))
        };
        self.positive.iter().enumerate().filter_map(crossing).reduce(f64::min)
    }
}
