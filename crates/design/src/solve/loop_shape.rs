//! Gains of feedback and observer that give the loop the shape of the plant file.

use control::aso::Gains;
use control::bandwidth::NaturalUnits;
use control::controller::complete_controller;
use control::faults::FaultEntry;
use control::response::frequency_response;
use control::robustness::{Point, held_plant};
use control::stability::instability;
use control::tuning::{Term, Transfer, Tuned, Tuning, WeightedPeak};
use control::weight::{Weight, bilinear_frequency};
use control::{Domain, Error, StateSpace, lmi};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::plant::attainable::rates;
use crate::plant::linear::LinearPlant;
use crate::report::number::rounded;
use crate::solve::gain::{GainResult, unique};
use crate::solve::tracking::LoopModel;
use plant_file::loop_shape::{FLOOR, LoopShape};
use plant_file::references::References;
use plant_file::signals::same_unit;

/// Number of starts to tune: the starts with the lowest gamma, the largest weighted gain over all terms.
const TUNED: usize = 4;
/// Smallest decay rate of the tuned loop, relative to that of its start.
const DECAY: f64 = 0.1;
/// In place of [`DECAY`] with integral action beside a feedforward: no term limits how slowly set points are followed.
const DECAY_OF_INTEGRALS: f64 = 0.9;
/// In place of [`DECAY`] for the estimation errors with integral action, where no term limits how slowly the observer
/// estimates a fault that the integrals compensate.
const DECAY_OF_ESTIMATES: f64 = 0.5;
/// Smallest scale of an entry of a gain in the search, relative to the average of its row and its column.
const SMALLEST: f64 = 0.1;
/// Default of `effort`, relative to the inverse gain of the plant.
const EFFORT: f64 = 100.0;
/// Bandwidth that an unstable mode needs at least, relative to its speed (S. Skogestad, I. Postlethwaite, Multivariable
/// Feedback Control, 2nd edition, Wiley 2005, section 5.9).
const FASTER: f64 = 2.0;
/// Largest frequency at which the roll-off is required, relative to half the sampling rate.
const BELOW_NYQUIST: f64 = 0.8;

/// The loop to shape, and the gains to tune.
pub(crate) struct LoopProblem<'a, G: Fn(&DMatrix<f64>, &DMatrix<f64>) -> Gains + Sync> {
    pub(crate) shape: &'a LoopShape,
    pub(crate) model: LoopModel<'a>,
    /// A and B of the feedback.
    pub(crate) pair: &'a (DMatrix<f64>, DMatrix<f64>),
    /// References that are integrated and do not act on the commands directly.
    pub(crate) references: Option<&'a References>,
    /// The peak of S above which the verdict is red.
    pub(crate) red: f64,
    /// The rows and columns of the entries of feedback and observer that are tuned.
    pub(crate) free: [Vec<(usize, usize)>; 2],
    /// Computes the gains of the controller from the gains of feedback and observer.
    pub(crate) gains: G,
}

/// The tuned gains, and a warning if gamma is above 1.
pub(crate) struct ShapedGains {
    pub(crate) feedback: GainResult,
    pub(crate) observer: GainResult,
    pub(crate) warning: Option<String>,
}

/// Scales with which the channels are comparable: sizes of commands, inverse sizes of measurements and references.
struct Units {
    commands: DMatrix<f64>,
    measurements: DMatrix<f64>,
    references: DMatrix<f64>,
}

impl Units {
    /// A plant with D = 0 in these units.
    fn scaled(&self, plant: &StateSpace) -> StateSpace {
        let (b, c) = (&plant.b * &self.commands, &self.measurements * &plant.c);
        StateSpace { b, c, ..plant.clone() }
    }
}

impl<G: Fn(&DMatrix<f64>, &DMatrix<f64>) -> Gains + Sync> LoopProblem<'_, G> {
    /// Tunes the gains from the best of `starts`, pairs of feedback and observer, and returns the result with the
    /// lowest gamma. An error if no start can be examined.
    pub(crate) fn tuned(&self, starts: &[[DMatrix<f64>; 2]]) -> Result<ShapedGains, Error> {
        let (units, plant) = self.scaled_plant()?;
        let ending = lmi::ending();
        let is_over = || ending.as_ref().is_some_and(|ending| ending());
        let terms = self.terms(self.effort(&plant)?)?;
        let [feedback, observer] = &starts[0];
        let has_integrals = (self.gains)(feedback, observer).integral.is_some();
        let decay =
            if has_integrals && self.references.is_none() { DECAY_OF_INTEGRALS } else { DECAY };
        let tune = |start: &[DMatrix<f64>; 2], examine_only: bool| {
            let sizes = start.each_ref().map(sizes);
            let controller = |parameters: &DVector<f64>| {
                let [feedback, observer] = self.divided(parameters, start);
                self.controller(&units, &feedback, &observer)
            };
            let of_estimates = if has_integrals { DECAY_OF_ESTIMATES } else { DECAY };
            let [of_errors, of_feedback] = self.excesses(has_integrals, start)?;
            let most = |decay, excess| if excess < 0.0 { decay * excess } else { f64::INFINITY };
            let most = [most(of_estimates, of_errors), most(DECAY, of_feedback)];
            let is_allowed = |parameters: &DVector<f64>| {
                let excesses = self.excesses(has_integrals, &self.divided(parameters, start));
                excesses.is_ok_and(|all| all.iter().zip(&most).all(|(one, most)| one <= most))
            };
            let initial = &self.joined(start);
            let mut tuning = Tuning {
                plant: plant.clone(),
                controller: &controller,
                references: self.scaled_h(&units),
                terms: terms.clone(),
                delays: &self.model.linear.delays,
                undelayed: units.scaled(&self.model.linear.undelayed),
                instability: 0.0,
                is_allowed: &is_allowed,
                rate: self.shape.bandwidth,
                is_over: &is_over,
            };
            let excess = instability(&tuning.dynamics(initial)?, self.model.domain)?;
            tuning.instability = decay * excess.min(0.0);
            if examine_only {
                let peak = tuning.peak(initial)?;
                return Ok(Tuned {
                    parameters: initial.clone(),
                    peak,
                    largest: peak.gamma,
                    limits: Vec::new(),
                });
            }
            tuning.tuned(initial, &self.joined(&sizes))
        };
        let mut examined = Vec::new();
        let mut refusal = None;
        for start in starts {
            match tune(start, true) {
                Ok(Tuned { peak, .. }) => examined.push((peak.gamma, start)),
                Err(error) => refusal = Some(error),
            }
        }
        examined.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        examined.truncate(TUNED);
        let tuned: Vec<_> = examined.par_iter().map(|(_, start)| tune(start, false)).collect();
        let tuned = tuned.into_iter().collect::<Result<Vec<_>, Error>>()?;
        let best = tuned.into_iter().min_by(|one, other| one.largest.total_cmp(&other.largest));
        let Some(Tuned { parameters, peak, limits, .. }) = best else {
            return Err(refusal.unwrap_or(Error::Overflow { what: "the loop of each start" }));
        };
        let [feedback, observer] = self.divided(&parameters, &starts[0]);
        let summary = summary(&terms, &peak);
        let method = format!("Loop shaping: {summary}.");
        Ok(ShapedGains {
            feedback: unique(feedback, method.clone()),
            observer: unique(observer, method),
            warning: (peak.gamma > 1.0)
                .then(|| format!("{summary}; expected at most 1{}", self.help(&terms, &limits))),
        })
    }

    /// Returns the parameters of two gains: the entries that are tuned.
    fn joined(&self, gains: &[DMatrix<f64>; 2]) -> DVector<f64> {
        let entries = gains.iter().zip(&self.free);
        let entries = entries.flat_map(|(gain, free)| free.iter().map(|at| gain[*at]));
        DVector::from_vec(entries.collect())
    }

    /// Returns the gains with the tuned entries from `parameters` and the remaining entries from `others`.
    fn divided(&self, parameters: &DVector<f64>, others: &[DMatrix<f64>; 2]) -> [DMatrix<f64>; 2] {
        let mut gains = others.clone();
        let mut parameters = parameters.iter();
        for (gain, free) in gains.iter_mut().zip(&self.free) {
            for (at, parameter) in free.iter().zip(parameters.by_ref()) {
                gain[*at] = *parameter;
            }
        }
        gains
    }

    /// Returns the entries of the plant file that relax all that limits gamma; nothing if the first of `limits`, an |S|
    /// or |T|, is so large that the verdict would be red with other entries, too.
    fn help(&self, terms: &[Term], limits: &[WeightedPeak]) -> String {
        let is_red = |limit: &WeightedPeak| {
            let Term { transfer, weight } = &terms[limit.term];
            let mapped = bilinear_frequency(limit.frequency, self.model.domain);
            !matches!(transfer, Transfer::Effort | Transfer::Tracking)
                && limit.gamma > self.red * weight.magnitude(mapped)
        };
        let mut entries: Vec<_> =
            limits.iter().map(|limit| self.entry(&terms[limit.term], limit.frequency)).collect();
        entries.sort_unstable();
        entries.dedup();
        match entries.as_slice() {
            _ if limits.first().is_some_and(is_red) => String::new(),
            [] => String::new(),
            [entry] => format!(": {entry} helps"),
            [first @ .., last] => format!(": {} and {last} help together", first.join(", ")),
        }
    }

    /// Returns the entry that relaxes a term at a frequency in rad/s.
    fn entry(&self, term: &Term, frequency: f64) -> &'static str {
        match term.transfer {
            Transfer::Effort => "a higher `effort`",
            // A constant weight depends on `peak` alone.
            _ if term.weight.as_constant().is_some() => "a higher `peak`",
            Transfer::Sensitivity(_) if frequency < self.shape.bandwidth => "a lower `bandwidth`",
            Transfer::Complementary(_) if frequency > self.shape.roll_off => "a higher `roll_off`",
            Transfer::Tracking if frequency < self.shape.set_point => "a lower `set_point`",
            Transfer::Sensitivity(_) | Transfer::Complementary(_) | Transfer::Tracking => {
                "a higher `peak`"
            }
        }
    }

    /// Returns the controller with its filter and its integrals, in `units`; its inputs are the measurements, then the
    /// references.
    fn controller(
        &self,
        units: &Units,
        feedback: &DMatrix<f64>,
        observer: &DMatrix<f64>,
    ) -> Result<StateSpace, Error> {
        let gains = (self.gains)(feedback, observer);
        let LoopModel { plant, filter, domain, .. } = self.model;
        let controller = complete_controller(plant, &gains, filter, domain)?.commands;
        let (to, from) = (inverse(&units.commands), inverse(&units.measurements));
        let (p, t) = (from.ncols(), units.references.ncols());
        // The integrals are the last states: r enters them, times the sample time.
        let mut b = (&controller.b * &from).resize_horizontally(p + t, 0.0);
        let first = b.nrows() - t;
        b.view_mut((first, p), (t, t)).copy_from(&(inverse(&units.references) * domain.step()));
        Ok(StateSpace {
            b,
            c: &to * &controller.c,
            d: (&to * &controller.d * &from).resize_horizontally(p + t, 0.0),
            ..controller
        })
    }

    /// Returns H in `units`; without rows if no references are integrated.
    fn scaled_h(&self, units: &Units) -> DMatrix<f64> {
        match self.references {
            Some(References { h, .. }) => &units.references * h * inverse(&units.measurements),
            None => DMatrix::zeros(0, units.measurements.nrows()),
        }
    }

    /// Returns the plant of the verdict, sampled for a sampled design, in units in which its channels are comparable:
    /// the units of the file if all commands have one unit and all measurements have one unit, otherwise natural units.
    fn scaled_plant(&self) -> Result<(Units, StateSpace), Error> {
        let plant = self.model.linear.judged()?;
        let LinearPlant { actuators, measurements, .. } = self.model.linear;
        let (m, p) = (actuators.len(), measurements.len());
        let (commands, measurements) = if same_unit(actuators) && same_unit(measurements) {
            (DMatrix::identity(m, m), DMatrix::identity(p, p))
        } else {
            let natural = NaturalUnits::new(&plant, self.shape.bandwidth)?;
            (DMatrix::from_diagonal(&natural.inputs), DMatrix::from_diagonal(&natural.outputs))
        };
        let references = self.references.map_or_else(
            || DMatrix::zeros(0, 0),
            |References { h, .. }| {
                let rows = h * inverse(&measurements);
                let sizes = rows.row_iter().map(|row| row.norm().recip());
                DMatrix::from_diagonal(&DVector::from_vec(sizes.collect()))
            },
        );
        let units = Units { commands, measurements, references };
        let plant = match self.model.domain {
            Domain::Continuous => plant,
            Domain::Sampled { period } => held_plant(&plant, period)?,
        };
        let plant = units.scaled(&plant);
        Ok((units, plant))
    }

    /// Returns the limit of K S. Unless it is stated: [`EFFORT`] times the largest inverse singular value of `plant` at
    /// the two ends of the range in which |S| is small, and at [`FASTER`] times the speed of each unstable mode, because
    /// such a loop has a K S of about that size. Infinite if the commands cannot move the measurements in every
    /// direction, and for PI and PID controllers, whose filters limit K S.
    fn effort(&self, plant: &StateSpace) -> Result<f64, Error> {
        let (bandwidth, speeds) = match *self.shape {
            LoopShape { effort: Some(effort), .. } => return Ok(effort),
            LoopShape { pid: Some(_), .. } => return Ok(f64::INFINITY),
            LoopShape { bandwidth, .. } => (bandwidth, rates(&plant.a, plant.domain)?),
        };
        let unstable = speeds.iter().filter(|rate| rate.re > 0.0).map(|rate| FASTER * rate.norm());
        let mut effort: f64 = 0.0;
        for frequency in unstable.chain([FLOOR * bandwidth, bandwidth]) {
            let least = match frequency_response(plant, &[frequency]) {
                Ok(points) => points[0].singular_values.last().copied().unwrap_or(f64::INFINITY),
                // An undamped mode needs no command.
                Err(Error::Overflow { .. }) => f64::INFINITY,
                Err(error) => return Err(error),
            };
            effort = effort.max(EFFORT / least);
        }
        Ok(effort)
    }

    /// Returns the instability of the estimation error and that of the state feedback. Without delays they are parts of
    /// the loop, which has another limit: -infinity for the feedback, and for the error without integral action. With
    /// delays, the loop is computed with a better approximation than that of the observer.
    fn excesses(
        &self,
        has_integrals: bool,
        [feedback, observer]: &[DMatrix<f64>; 2],
    ) -> Result<[f64; 2], Error> {
        let LoopModel { linear, plant, domain, .. } = self.model;
        let (has_delays, (a, b)) = (linear.delays.any(), self.pair);
        let of_errors = || (self.gains)(feedback, observer).error_dynamics(plant);
        let of_errors = (has_integrals || has_delays).then(of_errors);
        let of_feedback = has_delays.then(|| a + b * feedback);
        let excess = |dynamics: Option<DMatrix<f64>>| {
            dynamics.map_or(Ok(f64::NEG_INFINITY), |one| instability(&one, domain))
        };
        Ok([excess(of_errors)?, excess(of_feedback)?])
    }

    /// Returns S and T at commands and measurements, K S if `effort` is finite, and the tracking error if references
    /// are integrated, with their weights.
    fn terms(&self, effort: f64) -> Result<Vec<Term>, Error> {
        let LoopShape { bandwidth, set_point, peak, roll_off, .. } = *self.shape;
        let LinearPlant { actuators, measurements, models, .. } = self.model.linear;
        let (m, p) = (actuators.len(), measurements.len());
        let integrals =
            models.iter().filter(|model| !matches!(model.entry, FaultEntry::Sensor(_))).count();
        let flat = Weight::constant(1.0 / peak);
        let mapped = |frequency: f64| bilinear_frequency(frequency, self.model.domain);
        // (s / peak + w) / (s + FLOOR w), w = bandwidth.
        let crossing = |bandwidth| mapped(bandwidth) * (FLOOR * peak).sqrt();
        let shape = |bandwidth| Weight::lead_lag(1.0 / FLOOR, crossing(bandwidth), 1.0 / peak, 1);
        let shaped = shape(bandwidth)?;
        let nyquist = match self.model.domain {
            Domain::Continuous => f64::INFINITY,
            Domain::Sampled { period } => std::f64::consts::PI / period,
        };
        let falling = if roll_off < BELOW_NYQUIST * nyquist {
            let crossing = mapped(roll_off) / FLOOR.sqrt();
            Weight::lead_lag(1.0 / peak, crossing, 1.0 / (FLOOR * peak), 1)?
        } else {
            flat.clone()
        };
        let mut terms = Vec::new();
        for (point, channels, others) in [(Point::Input, m, p), (Point::Output, p, m)] {
            let is_shaped = channels <= others && integrals >= channels;
            let weight = if is_shaped { shaped.clone() } else { flat.clone() };
            terms.push(Term { transfer: Transfer::Sensitivity(point), weight });
            terms.push(Term { transfer: Transfer::Complementary(point), weight: falling.clone() });
        }
        if effort.is_finite() && effort > 0.0 {
            let weight = Weight::constant(1.0 / effort);
            terms.push(Term { transfer: Transfer::Effort, weight });
        }
        if self.references.is_some() {
            terms.push(Term { transfer: Transfer::Tracking, weight: shape(set_point)? });
        }
        Ok(terms)
    }
}

/// Returns gamma in words, with the term and the frequency that limit it.
fn summary(terms: &[Term], peak: &WeightedPeak) -> String {
    let name = match terms[peak.term].transfer {
        Transfer::Sensitivity(Point::Input) => "S at the input",
        Transfer::Sensitivity(Point::Output) => "S at the output",
        Transfer::Complementary(Point::Input) => "T at the input",
        Transfer::Complementary(Point::Output) => "T at the output",
        Transfer::Effort => "K S",
        Transfer::Tracking => "the tracking error",
    };
    let gamma = rounded(peak.gamma);
    if peak.frequency.is_finite() {
        format!("gamma = {gamma}, limited by {name} at {} rad/s", rounded(peak.frequency))
    } else {
        format!("gamma = {gamma}, limited by {name} at high frequencies")
    }
}

fn inverse(units: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_diagonal(&units.diagonal().map(f64::recip))
}

/// Returns the size of each entry, at least [`SMALLEST`] times the average of its row and its column.
fn sizes(gain: &DMatrix<f64>) -> DMatrix<f64> {
    let all = gain.norm().max(f64::MIN_POSITIVE);
    DMatrix::from_fn(gain.nrows(), gain.ncols(), |row, column| {
        let average = gain.row(row).norm() * gain.column(column).norm() / all;
        let size = gain[(row, column)].abs().max(SMALLEST * average);
        if size > 0.0 { size } else { 1e-9 * all }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The gains of a PID controller for nanoseconds: K, `K_d` in s and `K_i` in 1/s.
    #[test]
    fn the_scale_of_a_gain_does_not_depend_on_the_units_of_the_others() {
        let scales = sizes(&DMatrix::from_row_slice(1, 3, &[1.0, 2e-10, 3e9]));
        assert!((scales[(0, 1)] / 2e-10 - 1.0).abs() < 1e-9, "{scales}");
    }
}
