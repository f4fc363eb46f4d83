//! Designs the controllers for actuators that are gone.

use control::allocation::{Actuators, allocate, equilibrium};
use control::aso::Gains;
use control::controller::controller;
use control::eigen::eigenvalues;
use control::faults::FaultChannel;
use control::robustness::{Loop, least_sensitive};
use control::stability::instability;
use control::{Error, sampled};
use nalgebra::{DMatrix, DVector};

use crate::matrix::{pairs, rows};
use crate::plant::fixed_mode::described_in;
use crate::plant::rest::{Rest, beyond_limits, commands, unreachable_mode};
use crate::report::reconfiguration::{
    ReconfigurationReport, Reconfigured, ServedByFallback, WithoutActuator, WithoutSeveral,
};
use crate::solve::fallback::Fallback;
use crate::solve::gain::{FeedbackProblem, GainChoice, Refusal};
use crate::solve::gains::feedback;
use crate::solve::solution::Solution;
use crate::solve::tracking::decay;
use plant_file::PlantFile;
use plant_file::faults::EntryPoint;
use plant_file::reconfiguration::ReconfigurationRequest;
use plant_file::requirements::Requirement;
use plant_file::signals::Signal;

/// Size of the effect that the other actuators cannot produce, relative to the lost effect, below which the allocation
/// counts as exact.
const EXACT: f64 = 1e-9;
/// Deviation of the kept measurements, relative to the size of C and x, that counts as none.
const KEPT: f64 = 1e-9;
/// Largest number of pairs of actuators for which the report has the loop with the fall-back.
const MOST_PAIRS: usize = 64;

/// The gains of `[[reconfigurations]]`, `[[combinations]]` and `[fallback]` of the design file.
#[derive(Default)]
pub(crate) struct Reconfigurations {
    pub(crate) single: Vec<Reconfiguration>,
    pub(crate) combinations: Vec<Combination>,
    pub(crate) fallback: Option<Fallback>,
}

/// The controller for an actuator that is gone.
pub(crate) struct Reconfiguration {
    pub(crate) actuator: usize,
    pub(crate) stuck_at: f64,
    /// The gains; None if the fall-back is in force while this actuator is gone.
    pub(crate) gains: Option<ReconfiguredGains>,
    /// The states of the fault model that restart at 0 when the actuator is gone.
    pub(crate) restart: Vec<usize>,
    /// Threshold of the estimated loss, and the time in s above it after which the actuator counts as gone.
    pub(crate) decision: Option<(f64, f64)>,
}

/// The controller for several actuators that are gone.
pub(crate) struct Combination {
    /// The actuators that are gone, ascending.
    pub(crate) gone: Vec<usize>,
    pub(crate) gains: ReconfiguredGains,
}

/// The gains while actuators are gone.
#[expect(clippy::struct_field_names, reason = "the names of the design file")]
pub(crate) struct ReconfiguredGains {
    pub(crate) k_x: DMatrix<f64>,
    pub(crate) k_f: DMatrix<f64>,
    /// A column for each actuator that is gone: the commands that answer a unit of the stuck command's
    /// deviation from the operating point.
    pub(crate) k_s: DMatrix<f64>,
}

/// Designs the controllers for each of the requested actuators that is gone, and for several of them; no report if the
/// file asks for none. Where there is no controller, the report has the reason and what the fall-back does.
pub(crate) fn reconfigurations(
    file: &PlantFile<'_>,
    designed: &Solution,
    fallback: Option<Fallback>,
) -> Result<(Reconfigurations, Option<ReconfigurationReport>), Error> {
    let Some(request) = &file.reconfiguration else {
        return Ok((Reconfigurations { fallback, ..Reconfigurations::default() }, None));
    };
    let requirement = &file.feedback.requirement;
    let (mut single, mut combinations) = (Vec::new(), Vec::new());
    let (mut without, mut several, mut by_fallback) = (Vec::new(), Vec::new(), Vec::new());
    for gone in request.cases() {
        let case = Without { designed, request, gone };
        let (gains, outcome) = match case.design(requirement)? {
            Ok((gains, report)) => (Some(gains), Ok(report)),
            Err(reason) => (None, Err(reason)),
        };
        if let (None, Some(fallback)) = (&gains, &fallback) {
            by_fallback.push(case.served(fallback)?);
        }
        if let [actuator] = case.gone[..] {
            let signal = &designed.linear.actuators[actuator];
            let stuck_at = request.stuck_at(actuator);
            if gains.is_some() || fallback.is_some() {
                let decision = request.decision.filter(|_| case.is_estimated(actuator));
                let restart = case.restarted();
                single.push(Reconfiguration { actuator, stuck_at, gains, restart, decision });
            }
            let (actuator, unit) = (signal.name.clone(), signal.unit.clone());
            without.push(WithoutActuator { actuator, unit, stuck_at, outcome });
        } else {
            let actuators = case.names();
            several.push(WithoutSeveral { actuators, outcome });
            combinations.extend(gains.map(|gains| Combination { gone: case.gone, gains }));
        }
    }
    if let Some(fallback) = fallback.as_ref().filter(|_| request.together == 1) {
        for gone in request.sets(2).into_iter().take(MOST_PAIRS) {
            by_fallback.push(Without { designed, request, gone }.served(fallback)?);
        }
    }
    let report = ReconfigurationReport {
        by_estimate: request.decision.map(|(loss, time)| [loss, time]),
        without,
        several,
        by_fallback,
    };
    Ok((Reconfigurations { single, combinations, fallback }, Some(report)))
}

/// A case in which actuators are gone.
struct Without<'a> {
    designed: &'a Solution,
    request: &'a ReconfigurationRequest,
    /// The actuators that are gone, ascending.
    gone: Vec<usize>,
}

/// Feedbacks that meet the same requirement.
struct Feedbacks {
    /// At least one feedback in the first list; the second list is used only if its loops are better.
    all: [Vec<DMatrix<f64>>; 2],
    /// The feedbacks of the standard methods, if there is a choice.
    standard: Vec<DMatrix<f64>>,
}

impl Without<'_> {
    /// Returns the gains and the report, or the reason why there are none.
    fn design(
        &self,
        requirement: &Requirement,
    ) -> Result<Result<(ReconfiguredGains, Reconfigured), String>, Error> {
        let Solution { linear, plant, extended, gains, domain, .. } = self.designed;
        let n = extended.states;
        if let Some(mode) = unreachable_mode(linear, &self.without_columns(&linear.b))? {
            let reason =
                format!("the plant cannot be stabilised: the other actuators do not move {mode}");
            return Ok(Err(reason));
        }
        let authority = self.authority();
        let actuators = Actuators { b: &linear.b, gone: &self.gone, authority: &authority };
        let allocation = allocate(&actuators)?;
        let (feedbacks, method) = if allocation.residual < EXACT {
            let method = "Control allocation: the other actuators have the effect of all, with the least \
                          effort relative to their limits; the loop keeps its eigenvalues.";
            let feedback = &allocation.matrix * gains.k_x.columns(0, n);
            (Feedbacks { all: [vec![feedback], vec![]], standard: vec![] }, method.to_owned())
        } else {
            match self.redesigned(requirement) {
                Ok((feedbacks, method)) => {
                    (feedbacks, format!("Designed again for the other actuators. {method}"))
                }
                Err(reason) => return Ok(Err(reason)),
            }
        };
        let (ReconfiguredGains { k_x, k_f, k_s }, rest) = self.chosen(&feedbacks, &authority)?;
        let instability = instability(&self.known_loop(&k_x, &k_f)?.dynamics(), *domain)?;
        if instability >= 0.0 {
            return Ok(Err(format!(
                "the loop without it is not stable: {instability:.3e} beyond the limit"
            )));
        }
        let b_r = self.without_columns(&plant.b);
        let fed_back = plant.a.view((0, 0), (n, n)) + b_r.rows(0, n) * k_x.columns(0, n);
        let commands = commands(&linear.actuators, &rest.u, &self.stuck());
        let report = Reconfigured {
            method,
            residual: allocation.residual,
            eigenvalues: pairs(&eigenvalues(&fed_back)?),
            gain_norm: k_x.norm(),
            intact_gain_norm: gains.k_x.norm(),
            k_x: rows(&k_x),
            k_f: rows(&k_f),
            k_s: rows(&k_s),
            beyond_limits: beyond_limits(&linear.actuators, &commands, &self.gone),
            commands,
            measurements: rest.measurements,
            kept: rest.is_held,
        };
        Ok(Ok((ReconfiguredGains { k_x, k_f, k_s }, report)))
    }

    /// Returns the gains of the feedback whose loop has the lowest peaks of S, with the equilibrium. The observer of
    /// the intact plant stays.
    fn chosen(
        &self,
        feedbacks: &Feedbacks,
        authority: &[f64],
    ) -> Result<(ReconfiguredGains, Rest), Error> {
        let order = self.designed.plant.a.nrows();
        let with = |feedback: &DMatrix<f64>| {
            let (k_f, k_s, rest) = self.static_commands(feedback, authority)?;
            let k_x = feedback.clone().resize_horizontally(order, 0.0);
            Ok::<_, Error>((ReconfiguredGains { k_x, k_f, k_s }, rest))
        };
        let of =
            |feedbacks: &[DMatrix<f64>]| feedbacks.iter().map(with).collect::<Result<Vec<_>, _>>();
        let [mut first, second] = [of(&feedbacks.all[0])?, of(&feedbacks.all[1])?];
        if first.len() + second.len() == 1 {
            return Ok(first.swap_remove(0));
        }
        let closed =
            |(gains, _): &(ReconfiguredGains, Rest)| self.known_loop(&gains.k_x, &gains.k_f);
        let loops = |all: &[_]| all.iter().map(closed).collect::<Result<Vec<_>, Error>>();
        let references = loops(&of(&feedbacks.standard)?)?;
        let best = least_sensitive([&loops(&first)?, &loops(&second)?], &references);
        first.extend(second);
        Ok(first.swap_remove(best))
    }

    /// Returns the loop in which the observer knows that the actuators are gone.
    fn known_loop(&self, k_x: &DMatrix<f64>, k_f: &DMatrix<f64>) -> Result<Loop, Error> {
        let Solution { plant, gains, domain, .. } = self.designed;
        let mut reduced = plant.clone();
        reduced.b = self.without_columns(&plant.b);
        let reduced_gains = Gains { k_x: k_x.clone(), k_f: k_f.clone(), ..gains.clone() };
        let controller = controller(&reduced, &reduced_gains, *domain)?;
        Loop::new(reduced.commanded(*domain), controller)
    }

    /// Examines the loop with the fall-back in this case; the observer knows that the actuators are gone.
    fn served(&self, fallback: &Fallback) -> Result<ServedByFallback, Error> {
        let none = DMatrix::zeros(fallback.k_x.nrows(), self.designed.gains.k_f.ncols());
        let whole = self.known_loop(&fallback.k_x, fallback.k_f.as_ref().unwrap_or(&none))?;
        let decay = decay(&whole.dynamics(), self.designed.domain)?;
        let linear = &self.designed.linear;
        let reached = unreachable_mode(linear, &self.without_columns(&linear.b))?.is_none();
        let stable = reached && decay > 0.0;
        let decay = if stable { decay } else { decay.min(0.0) };
        Ok(ServedByFallback { actuators: self.names(), decay, stable })
    }

    fn names(&self) -> Vec<String> {
        let actuators = &self.designed.linear.actuators;
        self.gone.iter().map(|at| actuators[*at].name.clone()).collect()
    }

    /// Returns the actuators that are gone, with the commands at which they are stuck.
    fn stuck(&self) -> Vec<(usize, f64)> {
        self.gone.iter().map(|&at| (at, self.request.stuck_at(at))).collect()
    }

    fn without_columns(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let mut b = b.clone();
        self.gone.iter().for_each(|at| b.column_mut(*at).fill(0.0));
        b
    }

    /// Returns the distance of each command from its nearest limit, relative to the largest such distance and at least
    /// 0.001; 1 for all if one has no limits.
    fn authority(&self) -> Vec<f64> {
        let distance = |signal: &Signal| {
            let operating = signal.operating.unwrap_or(0.0);
            signal.limits.map(|[low, high]| (operating - low).min(high - operating))
        };
        let distances: Vec<_> = self.designed.linear.actuators.iter().map(distance).collect();
        let largest = distances.iter().flatten().copied().fold(0.0, f64::max);
        if largest <= 0.0 || distances.iter().any(Option::is_none) {
            return vec![1.0; distances.len()];
        }
        distances.iter().flatten().map(|distance| (distance / largest).max(1e-3)).collect()
    }

    /// Returns feedbacks of the other actuators that meet the requirement of the plant file, and the method, or the
    /// reason why there are none.
    fn redesigned(&self, requirement: &Requirement) -> Result<(Feedbacks, String), String> {
        let Solution { linear, plant, extended, domain, .. } = self.designed;
        let n = extended.states;
        let gone = &self.gone;
        let requirement = match requirement {
            Requirement::Weights { states, channels } => Requirement::Weights {
                states: states.clone(),
                channels: channels.clone().remove_rows_at(gone).remove_columns_at(gone),
            },
            Requirement::HInfinity { bound, region, channel } => {
                let mut channel = channel.clone();
                if !channel.weights.is_empty() {
                    for actuator in gone.iter().rev() {
                        channel.weights.remove(linear.c.nrows() + actuator);
                    }
                }
                Requirement::HInfinity { bound: *bound, region: *region, channel }
            }
            other => other.clone(),
        };
        let problem = FeedbackProblem {
            a: &plant.a.view((0, 0), (n, n)).into(),
            b: &plant.b.rows(0, n).into_owned().remove_columns_at(gone),
            c: &linear.c,
            states: n,
            f_a: &plant.f_a.rows(0, n).into(),
        };
        let requirement = linear.with_delays(&requirement, problem.a.nrows());
        match feedback(&requirement, &problem, *domain) {
            Ok(result) => {
                let with_zeros = |gain: DMatrix<f64>, at: &usize| gain.insert_row(*at, 0.0);
                let method = result.method.clone();
                let complete = |gain: DMatrix<f64>| gone.iter().fold(gain, with_zeros);
                let GainChoice { candidates, standard } = result.into_choice();
                let all = candidates.map(|results| {
                    results.into_iter().map(|result| complete(result.gain)).collect()
                });
                let standard = standard.into_iter().flatten().map(complete).collect();
                Ok((Feedbacks { all, standard }, method))
            }
            Err(Refusal::Control(error)) => Err(not_met(&error.to_string())),
            Err(Refusal::Conflict(message)) => Err(not_met(&message)),
            Err(Refusal::Fixed(mode)) => {
                let sampled = linear.domain == *domain;
                let name = |at: usize| linear.states[at].name.clone();
                let mode = described_in(&mode, *domain, sampled, name);
                Err(not_met(&format!("no feedback of the other actuators moves {mode}")))
            }
        }
    }

    /// Returns K_f, K_s and the equilibrium that they lead to.
    ///
    /// The estimated faults of an actuator that is gone are the deviation of its effect from the assumed command. Fault
    /// and stuck command act through the same column of B, so that the other actuators answer both by the same
    /// commands.
    fn static_commands(
        &self,
        k_x: &DMatrix<f64>,
        authority: &[f64],
    ) -> Result<(DMatrix<f64>, DMatrix<f64>, Rest), Error> {
        let Solution { linear, extended, domain, .. } = self.designed;
        let output = linear.c.select_rows(&self.request.keep);
        let mut reduced = extended.clone();
        reduced.plant.b = self.without_columns(&extended.plant.b);
        let mut k_f = sampled::compensation_gain(&reduced, *domain)?;
        let modelled = sampled::compensation_gain(extended, *domain)?;
        let (n, m) = linear.b.shape();
        let (at_rest, gone) = (linear.a_at_rest(), &self.gone);
        let actuators = Actuators { b: &linear.b, gone, authority };
        let mut k_s = DMatrix::zeros(m, self.gone.len());
        let (mut x, mut u, mut is_kept) = (DVector::zeros(n), DVector::zeros(m), true);
        for (position, (actuator, stuck_at)) in self.stuck().into_iter().enumerate() {
            let b_g: DVector<f64> = linear.b.column(actuator).into();
            let unit = equilibrium(&at_rest, &actuators, &output, &b_g)?;
            let answer = &unit.u - k_x * &unit.x;
            for channel in self.faults_of(actuator) {
                // The intact gain compensates the mean of the modelled fault over a sample.
                let intact = modelled.row(actuator);
                let columns = [Some(channel.estimate), channel.rate];
                for column in columns.into_iter().flatten() {
                    let part = intact[column] / intact[channel.estimate];
                    let part = if column == channel.estimate { 1.0 } else { part };
                    k_f.set_column(column, &(&answer * part));
                }
            }
            k_s.set_column(position, &answer);
            let deviation = stuck_at - linear.actuators[actuator].operating.unwrap_or(0.0);
            x += &unit.x * deviation;
            u += &unit.u * deviation;
            is_kept &= unit.left <= KEPT * linear.c.norm() * unit.x.norm();
        }
        Ok((k_f, k_s, Rest::of(linear, &x, u, is_kept)))
    }

    /// Returns the channels of the faults of an actuator.
    fn faults_of(&self, gone: usize) -> impl Iterator<Item = FaultChannel> + '_ {
        let Solution { linear, extended, .. } = self.designed;
        let acts = move |point: &EntryPoint| match point {
            EntryPoint::Actuator(actuator) | EntryPoint::Loss { actuator, .. } => *actuator == gone,
            _ => false,
        };
        let faults = linear.faults.iter().zip(&extended.channels);
        faults.filter(move |(fault, _)| acts(&fault.entry_point)).map(|(_, channel)| *channel)
    }

    /// Returns the states of the fault model that restart: the states of the faults of the actuators that are gone.
    fn restarted(&self) -> Vec<usize> {
        let faults = self.gone.iter().flat_map(|gone| self.faults_of(*gone));
        faults.flat_map(|channel| [Some(channel.estimate), channel.rate]).flatten().collect()
    }

    /// Whether the loss of effectiveness of an actuator is estimated.
    fn is_estimated(&self, gone: usize) -> bool {
        self.designed.linear.faults.iter().any(|fault| {
            matches!(fault.entry_point, EntryPoint::Loss { actuator, .. } if actuator == gone)
        })
    }
}

fn not_met(message: &str) -> String {
    format!("the requirement on the feedback cannot be met without it: {message}")
}
