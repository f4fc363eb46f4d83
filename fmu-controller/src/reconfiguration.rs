//! Reconfiguration: the controller without an actuator that is gone.
//!
//! An actuator is gone if the input `actuator_gone` says so, or if its estimated loss of effectiveness stays above a
//! stated fraction for a stated time; the latter is final until the next initialization. The command of the actuator is
//! then the stuck command `u_stuck`, also in the observer, and the other commands are
//!
//! ```text
//! u = K_x x_hat + K_f f_hat + K_s (u_stuck - u_op)
//! ```
//!
//! with the matrices of the design for the actuators that are gone, all of which are stuck. The estimates of
//! their faults restart at 0; they are then the distance of the real effect from the assumed one.
//!
//! The fall-back is one more set of gains, which serves every actuator failure of the design, so that it need not be
//! known which one has happened:
//!
//! ```text
//! u = K_x x_hat + K_f f_hat
//! ```
//!
//! the second term if the design states K_f. It is in force while the input `fall_back` is true, and while
//! the design has no matrices for the actuators that are gone. The observer then uses the commands u, and
//! estimates f_hat even when the intact controller would hold it. While `fall_back` is true, no estimate
//! decides that an actuator is gone: the loss of an actuator without a fault of its own may look like the
//! loss of another one. In a design without a fall-back, several actuators without matrices for their
//! combination have the matrices of the first one.
//!
//! The decision is made at the start of each communication step, at each event, and at each sample; at
//! initialization no actuator is gone.

use serde::{Deserialize, Serialize};

use crate::loss::Loss;
use aso_controller::Design;
use aso_controller::clock::clock_rounding;

/// Which actuators are gone.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Reconfigurator {
    /// The inputs, one for each actuator.
    pub(crate) reported: Vec<bool>,
    /// For each reconfiguration of the design: the time in s since which its estimated loss has been above the stated
    /// fraction.
    above_since: Vec<Option<f64>>,
    /// The input that asks for the fall-back.
    pub(crate) fall_back: bool,
    /// Bit j: the estimate says that actuator j is gone.
    decided: u64,
    /// Bit j: actuator j is gone.
    pub(crate) gone: u64,
    /// Whether the gains of the fall-back are in force.
    pub(crate) fallen_back: bool,
    /// The output: from 1, the position of the first actuator that is gone; 0 if there is none, -1 in the
    /// fall-back.
    pub(crate) output: i32,
}

impl Reconfigurator {
    /// The state in which no actuator of `design` is gone.
    pub(crate) fn new(design: &Design) -> Self {
        Self {
            reported: vec![false; design.actuators.len()],
            above_since: vec![None; design.reconfigurations.len()],
            fall_back: false,
            decided: 0,
            gone: 0,
            fallen_back: false,
            output: 0,
        }
    }

    /// Clears all decisions; the inputs stay.
    pub(crate) fn start(&mut self) {
        self.above_since.fill(None);
        (self.decided, self.gone, self.output) = (0, 0, 0);
        self.fallen_back = false;
    }

    /// Decides at `time`, in s, which actuators are gone and whether the fall-back is in force. Bit j of the result:
    /// actuator j is gone or back since the last decision.
    pub(crate) fn decide(&mut self, design: &Design, losses: &[Loss], time: f64) -> u64 {
        let gone_before = self.gone;
        self.gone = 0;
        let is_fall_back_set = self.fall_back && design.fallback.is_some();
        for (case, since) in design.reconfigurations.iter().zip(&mut self.above_since) {
            if let (Some(most), Some(least_time)) = (case.loss, case.time) {
                let loss = losses.iter().find(|loss| loss.actuator == case.actuator);
                let above = !is_fall_back_set && loss.is_some_and(|loss| loss.estimate > most);
                *since = since.or(Some(time)).filter(|_| above);
                // The importer adds up its steps with rounding, and the time of the event is rounded.
                let rounding = 1e-9 * least_time + clock_rounding(time);
                let enough = since.is_some_and(|since| time - since >= least_time - rounding);
                self.decided |= u64::from(enough) << case.actuator;
            }
            let gone = self.reported[case.actuator] || self.decided & (1 << case.actuator) != 0;
            self.gone |= u64::from(gone) << case.actuator;
        }
        let uncovered = self.gone != 0 && design.gains_without(self.gone).is_none();
        self.fallen_back = design.fallback.is_some() && (is_fall_back_set || uncovered);
        self.output = match self.gone {
            _ if self.fallen_back => -1,
            0 => 0,
            gone => i32::try_from(gone.trailing_zeros() + 1).unwrap_or_default(),
        };
        gone_before ^ self.gone
    }

    /// The time in s at which the next actuator counts as gone if the estimated losses above their fractions stay
    /// there; `None` if no loss is above its fraction, or all actuators with such losses already count as gone.
    pub(crate) fn next_decision(&self, design: &Design) -> Option<f64> {
        let ends =
            design.reconfigurations.iter().zip(&self.above_since).filter_map(|(case, since)| {
                let pending = self.decided & (1 << case.actuator) == 0;
                Some((*since)? + case.time.filter(|_| pending)?)
            });
        ends.reduce(f64::min)
    }

    /// For each reconfiguration by a loss: the stated fraction less the estimated loss, and whether the loss was above
    /// the fraction at the last decision.
    pub(crate) fn distances<'a>(
        &'a self,
        design: &'a Design,
        losses: &'a [Loss],
    ) -> impl Iterator<Item = (f64, bool)> + 'a {
        let all = design.reconfigurations.iter().zip(&self.above_since);
        all.filter_map(move |(case, since)| {
            let loss = losses.iter().find(|loss| loss.actuator == case.actuator);
            let most = case.loss?;
            Some((most - loss.map_or(0.0, |loss| loss.estimate), since.is_some()))
        })
    }
}
