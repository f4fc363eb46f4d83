//! The reconfiguration of a controller: gains without actuators that are gone, and the fall-back.
//! `fmu-controller/src/reconfiguration.rs` has the equations.

use aso_controller::design::{self, Design, Loss};
use nalgebra::DMatrix;

use super::constants::Constants;
use super::parts::{Signal, dense};
use super::symbols::{Kind, Matrix};
use crate::Error;

/// The gains of a controller for failed actuators, and the conditions on which an actuator counts as gone.
pub(super) struct Reconfiguration {
    /// The actuators that may be gone.
    pub(super) cases: Vec<Case>,
    /// The gains, first those of the intact plant, last the fall-back, if there is one.
    pub(super) sets: Vec<GainSet>,
    /// Whether the fall-back compensates faults; `None` without a fall-back.
    pub(super) fallback: Option<bool>,
}

/// An actuator that may be gone.
pub(super) struct Case {
    /// The position of the actuator.
    pub(super) actuator: usize,
    /// The command at which the failed actuator is stuck.
    pub(super) stuck_at: f64,
    /// For each state of the fault model whether its estimate restarts at 0 when the actuator fails or comes back.
    pub(super) restarts: Vec<bool>,
    /// The decision by an estimated loss; `None` if only an input reports the actuator.
    pub(super) decision: Option<Decision>,
}

/// The condition under which an estimated loss decides that an actuator is gone.
#[derive(Clone, Copy)]
pub(super) struct Decision {
    /// The position of the loss.
    pub(super) loss: usize,
    /// The fraction of the command that the loss must exceed.
    pub(super) fraction: f64,
    /// The number of successive samples for which the loss must exceed the fraction.
    pub(super) samples: u32,
}

/// Gains for one set of actuators that are gone, or gains of the fall-back.
pub(super) struct GainSet {
    /// For each actuator whether it is gone; all false in the set of the fall-back.
    pub(super) gone: Vec<bool>,
    k_x: DMatrix<f64>,
    k_f: DMatrix<f64>,
    /// `K_s`, actuators x actuators; the columns of actuators that are not gone are 0.
    k_s: DMatrix<f64>,
}

impl Reconfiguration {
    /// The reconfiguration of a design file with these losses, sampled every `period` s; `None` if it has neither cases
    /// nor a fall-back. An error if the time of a case is beyond 2^32 samples.
    pub(super) fn of(file: &Design, losses: &[Loss], period: f64) -> Result<Option<Self>, Error> {
        if !file.is_reconfigurable() {
            return Ok(None);
        }
        let Design { reconfigurations, combinations, fallback, actuators, faults, .. } = file;
        let m = actuators.len();
        let gone = |names: &[String]| -> Vec<_> {
            actuators.iter().map(|actuator| names.contains(&actuator.name)).collect()
        };
        // Moves the columns of `k_s`, one for each stuck actuator in order, to the places of these actuators.
        let scatter = |k_s: &DMatrix<f64>, gone: &[bool]| {
            let mut all = DMatrix::zeros(m, m);
            let places = gone.iter().enumerate().filter_map(|(j, gone)| gone.then_some(j));
            for (column, place) in k_s.column_iter().zip(places) {
                all.set_column(place, &column);
            }
            all
        };
        let (k_x, k_f) = (dense(&file.k_x), dense(&file.k_f));
        let none = vec![false; m];
        let mut sets = vec![GainSet { gone: none.clone(), k_x, k_f, k_s: DMatrix::zeros(m, m) }];
        let mut cases = Vec::new();
        for case in reconfigurations {
            cases.push(Case {
                actuator: case.actuator,
                stuck_at: case.stuck_at,
                restarts: faults.iter().map(|fault| case.restart.contains(&fault.name)).collect(),
                decision: decision(case, losses, period)?,
            });
            if let (Some(k_x), Some(k_f), Some(k_s)) = (&case.k_x, &case.k_f, &case.k_s) {
                let gone = gone(std::slice::from_ref(&case.gone));
                let k_s = scatter(&DMatrix::from_column_slice(m, 1, k_s), &gone);
                sets.push(GainSet { gone, k_x: dense(k_x), k_f: dense(k_f), k_s });
            }
        }
        for combination in combinations {
            let gone = gone(&combination.gone);
            let k_s = scatter(&dense(&combination.k_s), &gone);
            sets.push(GainSet {
                gone,
                k_x: dense(&combination.k_x),
                k_f: dense(&combination.k_f),
                k_s,
            });
        }
        if let Some(design::Fallback { k_x, k_f }) = fallback {
            let no_compensation = || DMatrix::zeros(m, faults.len());
            let k_f = k_f.as_ref().map_or_else(no_compensation, dense);
            sets.push(GainSet { gone: none, k_x: dense(k_x), k_f, k_s: DMatrix::zeros(m, m) });
        }
        let fallback = fallback.as_ref().map(|design| design.k_f.is_some());
        Ok(Some(Self { cases, sets, fallback }))
    }

    /// A matrix in each set of gains; `None` if all sets have the same matrix.
    pub(super) fn matrices(&self, matrix: Matrix) -> Option<Vec<&DMatrix<f64>>> {
        match matrix {
            Matrix::KX => Some(self.sets.iter().map(|set| &set.k_x).collect()),
            Matrix::KF => Some(self.sets.iter().map(|set| &set.k_f).collect()),
            _ => None,
        }
    }

    /// The number of sets of gains without the fall-back: of the intact plant, then without certain actuators.
    pub(super) fn regular_sets(&self) -> usize {
        self.sets.len() - usize::from(self.fallback.is_some())
    }

    /// For each actuator, the position of the set of gains without this actuator alone; 0 if there is no such set.
    pub(super) fn single_sets(&self, actuators: usize) -> Vec<usize> {
        let single = |j: usize| {
            let is_single =
                |set: &GainSet| set.gone.iter().enumerate().all(|(k, gone)| *gone == (k == j));
            self.sets.iter().position(is_single).unwrap_or(0)
        };
        (0..actuators).map(single).collect()
    }

    /// The bytes of the constants that are no real numbers.
    pub(super) fn integer_bytes(&self, actuators: usize, faults: usize) -> usize {
        let singles = if self.fallback.is_none() { 4 * actuators } else { 0 };
        let of_cases = self.cases.len() * (12 + faults);
        self.sets.len() * actuators + if self.cases.is_empty() { 0 } else { singles + of_cases }
    }

    /// The largest number of actuators that are gone in a set.
    pub(super) fn most_gone(&self) -> usize {
        let count = |set: &GainSet| set.gone.iter().filter(|gone| **gone).count();
        self.sets.iter().map(count).max().unwrap_or(0)
    }

    /// The real numbers of gains and cases, for a check of their range.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> {
        let matrices = self.sets.iter().flat_map(|set| [&set.k_x, &set.k_f, &set.k_s]);
        let of_cases = self
            .cases
            .iter()
            .flat_map(|case| [Some(case.stuck_at), case.decision.map(|limit| limit.fraction)]);
        matrices.flat_map(|matrix| matrix.iter().copied()).chain(of_cases.flatten())
    }

    /// The tables of real numbers: gains from stuck actuators, commands of stuck actuators, fractions of losses.
    pub(super) fn tables(&self, actuators: &[Signal]) -> Vec<Constants> {
        let k_s = self.sets.iter().map(|set| &set.k_s);
        let meaning = "gains from the commands of stuck actuators";
        let case = |j: usize| self.cases.iter().find(|case| case.actuator == j);
        let stuck = |j: usize| case(j).map_or(0.0, |case| case.stuck_at);
        let vector = |name, meaning, value: &dyn Fn(usize) -> f64| {
            let values = (0..actuators.len()).map(value).collect();
            Constants::vector(name, meaning, Kind::Actuator, values)
        };
        let mut all = vec![
            Constants::matrices("K_s", meaning, [Kind::Actuator; 2], Some(Kind::GainSet), k_s),
            vector("stuck_at", "commands of stuck actuators, and their deviations", &stuck),
            vector("u_stuck", "", &|j| stuck(j) - actuators[j].operating),
        ];
        if !self.cases.is_empty() {
            let fraction =
                |case: &Case| case.decision.map_or(f64::INFINITY, |limit| limit.fraction);
            let most = self.cases.iter().map(fraction);
            let meaning = "losses above which an actuator counts as gone";
            all.push(Constants::vector("most_lost", meaning, Kind::Case, most.collect()));
        }
        all
    }
}

/// The decision about an actuator by its estimated loss; `None` if the case states no limit, or if no fault describes
/// the loss. An error if the time is beyond 2^32 samples.
fn decision(
    case: &design::Reconfiguration,
    losses: &[Loss],
    period: f64,
) -> Result<Option<Decision>, Error> {
    let (Some(fraction), Some(time)) = (case.loss, case.time) else { return Ok(None) };
    let of_actuator = |loss: &Loss| loss.actuator == case.actuator;
    let Some(loss) = losses.iter().position(of_actuator) else { return Ok(None) };
    // The smallest whole number of samples that last for `time`, with the tolerance of the FMU.
    let least = time * (1.0 - 1e-9);
    let mut samples = (least / period).floor().max(0.0);
    let most = f64::from(u32::MAX);
    while samples * period < least && samples <= most {
        samples += 1.0;
    }
    if samples > most {
        return Err(Error(format!(
            "reconfiguration without {}: {time} s are more than 2^32 samples; a counter of the code has 32 bits",
            case.gone
        )));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole number")]
    Ok(Some(Decision { loss, fraction, samples: samples as u32 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 7 s have more than 2^53 samples of 3e-16 s: their number and the next one are the same double.
    #[test]
    fn a_time_of_more_samples_than_a_double_counts_is_refused() {
        let case = design::Reconfiguration {
            gone: "u".to_owned(),
            actuator: 0,
            stuck_at: 0.0,
            k_x: None,
            k_f: None,
            k_s: None,
            restart: Vec::new(),
            restarted: Vec::new(),
            loss: Some(0.5),
            time: Some(7.0),
        };
        let losses = [Loss { fault: 0, actuator: 0, least_command: 1.0 }];
        let refused = decision(&case, &losses, 3e-16).err().unwrap().to_string();
        assert!(refused.contains("7 s are more than 2^32 samples"), "{refused}");
    }
}
