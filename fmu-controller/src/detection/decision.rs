//! The decision: whether there is a fault, since when, and which one.

use serde::{Deserialize, Serialize};

use aso_controller::design::detection::DetectionDesign;

/// The value of `time` and `onset` before an alarm.
const NEVER: f64 = -1.0;

/// The decision on faults, which stays until a reset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Decision {
    pub(crate) detected: bool,
    /// Position of the fault from 1; 0 without an alarm, -1 if the alarms fit no fault or several.
    pub(crate) isolated: i32,
    /// Time of the first alarm in s.
    pub(crate) time: f64,
    /// The estimated time in s at which the fault started.
    pub(crate) onset: f64,
}

impl Default for Decision {
    fn default() -> Self {
        Self { detected: false, isolated: 0, time: NEVER, onset: NEVER }
    }
}

impl Decision {
    /// Records an alarm at `time` of a fault that started at `onset`, both in s. Later alarms change nothing.
    pub(super) fn alarm(&mut self, time: f64, onset: f64) {
        if !self.detected {
            *self = Self { detected: true, time, onset, ..*self };
        }
    }

    /// Sets `isolated` to the fault for which the tests that react to it are exactly those that have alarmed; -1 if no
    /// fault or several faults fit. Does nothing before an alarm.
    pub(crate) fn isolate(
        &mut self,
        detection: &DetectionDesign,
        has_alarmed: impl Fn(usize) -> bool,
    ) {
        if !self.detected {
            return;
        }
        let fits = |fault: &usize| {
            let mut tests = detection.tests.iter().enumerate();
            tests.all(|(at, test)| test.reacts[*fault] == has_alarmed(at))
        };
        let mut fitting = (0..detection.faults.len()).filter(fits);
        self.isolated = match (fitting.next(), fitting.next()) {
            (Some(fault), None) => i32::try_from(fault + 1).unwrap_or(-1),
            _ => -1,
        };
    }
}
