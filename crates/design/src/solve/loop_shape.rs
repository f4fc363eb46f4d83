//! Gains of feedback and observer that give the loop the shape of the plant file.

use control::aso::{FaultyPlant, Gains};
use control::bandwidth::NaturalUnits;
use control::controller::complete_controller;
use control::faults::FaultEntry;
use control::robustness::{Point, held_plant};
use control::stability::instability;
use control::tuning::{Term, Transfer, Tuned, Tuning, WeightedPeak};
use control::weight::{Weight, bilinear_frequency};
use control::{Domain, Error, StateSpace, lmi};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::plant::linear::LinearPlant;
use crate::report::number::rounded;
use crate::solve::gain::{GainResult, unique};
use plant_file::loop_shape::LoopShape;
use plant_file::signals::same_unit;

/// |S| below this is not asked for at low frequencies; |T| below this part of its peak at high ones.
const FLOOR: f64 = 0.01;
/// Starts that are tuned: those of the lowest gamma.
const TUNED: usize = 4;
/// The tuned loop may decay this part as fast as that of its start.
const DECAY: f64 = 0.1;
/// The same with integral action: how slowly a set point is followed, no term shows.
const DECAY_OF_INTEGRALS: f64 = 0.9;
/// Smallest size of a gain, relative to the sizes of its row and its column.
const SMALLEST: f64 = 0.1;
/// Part of half the sampling rate up to which the roll-off is asked for.
const BELOW_NYQUIST: f64 = 0.8;

/// What the gains are tuned for.
pub(crate) struct LoopProblem<'a, G: Fn(&DMatrix<f64>, &DMatrix<f64>) -> Gains + Sync> {
    pub(crate) shape: &'a LoopShape,
    pub(crate) linear: &'a LinearPlant,
    /// The model in the observer.
    pub(crate) plant: &'a FaultyPlant,
    pub(crate) filter: Option<&'a [f64]>,
    pub(crate) domain: Domain,
    /// The gains of the controller from those of feedback and observer.
    pub(crate) gains: G,
}

/// The tuned gains, and why gamma is above 1, if it is.
pub(crate) struct Shaped {
    pub(crate) feedback: GainResult,
    pub(crate) observer: GainResult,
    pub(crate) warning: Option<String>,
}

/// Units in which the channels are comparable: sizes of commands, inverse sizes of measurements.
struct Units {
    commands: DMatrix<f64>,
    measurements: DMatrix<f64>,
}

impl<G: Fn(&DMatrix<f64>, &DMatrix<f64>) -> Gains + Sync> LoopProblem<'_, G> {
    /// Tunes the gains from the best of `starts`, pairs of feedback and observer.
    pub(crate) fn tuned(&self, starts: &[[DMatrix<f64>; 2]]) -> Result<Shaped, Error> {
        let (units, plant) = self.scaled_plant()?;
        let ending = lmi::ending();
        let is_over = || ending.as_ref().is_some_and(|ending| ending());
        let terms = self.terms()?;
        let has_integrals = starts
            .iter()
            .any(|[feedback, observer]| (self.gains)(feedback, observer).integral.is_some());
        let decay = if has_integrals { DECAY_OF_INTEGRALS } else { DECAY };
        let tune = |[feedback, observer]: &[DMatrix<f64>; 2], is_start: bool| {
            let (of_feedback, of_observer) = (feedback.shape(), observer.shape());
            let controller = |parameters: &DVector<f64>| {
                let [feedback, observer] = divided(parameters, of_feedback, of_observer);
                self.controller(&units, &feedback, &observer)
            };
            let start = joined(feedback, observer);
            let closed = control::robustness::Loop::new(plant.clone(), controller(&start)?)?;
            let excess = instability(&closed.dynamics(), self.domain)?;
            let tuning = Tuning {
                plant: plant.clone(),
                controller: &controller,
                terms: terms.clone(),
                instability: decay * excess.min(0.0),
                rate: self.shape.bandwidth,
                is_over: &is_over,
            };
            if is_start {
                let peak = tuning.peak(&start)?;
                return Ok(Tuned { parameters: start, peak });
            }
            tuning.tuned(&start, &joined(&sizes(feedback), &sizes(observer)))
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
        let best =
            tuned.into_iter().min_by(|one, other| one.peak.gamma.total_cmp(&other.peak.gamma));
        let Some(Tuned { parameters, peak }) = best else {
            return Err(refusal.unwrap_or(Error::Overflow { what: "the loop of each start" }));
        };
        let [feedback, observer] = &starts[0];
        let [feedback, observer] = divided(&parameters, feedback.shape(), observer.shape());
        let summary = summary(&terms, &peak);
        let method = format!("Loop shaping: {summary}.");
        Ok(Shaped {
            feedback: unique(feedback, method.clone()),
            observer: unique(observer, method),
            warning: (peak.gamma > 1.0).then(|| {
                let help = self.help(terms[peak.term].transfer, peak.frequency);
                format!("{summary}; expected at most 1: {help} helps")
            }),
        })
    }

    /// The entry that allows more of what limits gamma at a frequency in rad/s.
    fn help(&self, transfer: Transfer, frequency: f64) -> &'static str {
        match transfer {
            Transfer::Sensitivity(_) if frequency < self.shape.bandwidth => "a lower `bandwidth`",
            Transfer::Complementary(_) if frequency > self.shape.roll_off => "a higher `roll_off`",
            Transfer::Sensitivity(_) | Transfer::Complementary(_) => "a higher `peak`",
            Transfer::Effort => "a higher `effort`",
        }
    }

    /// The controller with its filter and its integrals, in `units`.
    fn controller(
        &self,
        units: &Units,
        feedback: &DMatrix<f64>,
        observer: &DMatrix<f64>,
    ) -> Result<StateSpace, Error> {
        let gains = (self.gains)(feedback, observer);
        let controller =
            complete_controller(self.plant, &gains, self.filter, self.domain)?.commands;
        let (to, from) = (inverse(&units.commands), inverse(&units.measurements));
        Ok(StateSpace {
            b: &controller.b * &from,
            c: &to * &controller.c,
            d: &to * &controller.d * &from,
            ..controller
        })
    }

    /// The plant of the verdict in units in which its channels are comparable: those of the file where they are equal.
    fn scaled_plant(&self) -> Result<(Units, StateSpace), Error> {
        let plant = self.linear.judged()?;
        let LinearPlant { actuators, measurements, .. } = self.linear;
        let (m, p) = (actuators.len(), measurements.len());
        let units = if same_unit(actuators) && same_unit(measurements) {
            Units { commands: DMatrix::identity(m, m), measurements: DMatrix::identity(p, p) }
        } else {
            let natural = NaturalUnits::new(&plant, self.shape.bandwidth)?;
            Units {
                commands: DMatrix::from_diagonal(&natural.inputs),
                measurements: DMatrix::from_diagonal(&natural.outputs),
            }
        };
        let plant = match self.domain {
            Domain::Continuous => plant,
            Domain::Sampled { period } => held_plant(&plant, period)?,
        };
        let (b, c) = (&plant.b * &units.commands, &units.measurements * &plant.c);
        Ok((units, StateSpace { b, c, ..plant }))
    }

    /// S and T at commands and measurements, and K S, with their weights.
    fn terms(&self) -> Result<Vec<Term>, Error> {
        let LoopShape { bandwidth, peak, roll_off, effort, .. } = *self.shape;
        let LinearPlant { actuators, measurements, models, .. } = self.linear;
        let (m, p) = (actuators.len(), measurements.len());
        let integrals =
            models.iter().filter(|model| !matches!(model.entry, FaultEntry::Sensor(_))).count();
        let flat = Weight::constant(1.0 / peak);
        let mapped = |frequency: f64| bilinear_frequency(frequency, self.domain);
        // (s / peak + w) / (s + FLOOR w), w = bandwidth.
        let crossing = mapped(bandwidth) * (FLOOR * peak).sqrt();
        let shaped = Weight::lead_lag(1.0 / FLOOR, crossing, 1.0 / peak, 1)?;
        let nyquist = match self.domain {
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
        if let Some(effort) = effort {
            let weight = Weight::constant(1.0 / effort);
            terms.push(Term { transfer: Transfer::Effort, weight });
        }
        Ok(terms)
    }
}

/// Gamma, with the term and the frequency that limit it.
fn summary(terms: &[Term], peak: &WeightedPeak) -> String {
    let name = match terms[peak.term].transfer {
        Transfer::Sensitivity(Point::Input) => "S at the input",
        Transfer::Sensitivity(Point::Output) => "S at the output",
        Transfer::Complementary(Point::Input) => "T at the input",
        Transfer::Complementary(Point::Output) => "T at the output",
        Transfer::Effort => "K S",
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

/// The parameters of two gains.
fn joined(feedback: &DMatrix<f64>, observer: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_iterator(
        feedback.len() + observer.len(),
        feedback.iter().chain(observer.iter()).copied(),
    )
}

/// The gains of two shapes from their parameters.
fn divided(
    parameters: &DVector<f64>,
    feedback: (usize, usize),
    observer: (usize, usize),
) -> [DMatrix<f64>; 2] {
    let (first, second) = parameters.as_slice().split_at(feedback.0 * feedback.1);
    [
        DMatrix::from_column_slice(feedback.0, feedback.1, first),
        DMatrix::from_column_slice(observer.0, observer.1, second),
    ]
}

/// The size of each entry, at least a part of that which its row and its column have on average.
fn sizes(gain: &DMatrix<f64>) -> DMatrix<f64> {
    let all = gain.norm().max(f64::MIN_POSITIVE);
    DMatrix::from_fn(gain.nrows(), gain.ncols(), |row, column| {
        let average = gain.row(row).norm() * gain.column(column).norm() / all;
        gain[(row, column)].abs().max(SMALLEST * average).max(1e-9 * all)
    })
}
