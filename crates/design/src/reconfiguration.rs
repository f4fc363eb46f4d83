//! Designs the controller without an actuator that is gone.

use control::allocation::{allocate, equilibrium};
use control::aso::Gains;
use control::controller::{closed_loop, controller};
use control::eigen::eigenvalues;
use control::faults::FaultChannel;
use control::rank::uncontrollable_modes;
use control::stability::{instability, is_clearly_stable};
use control::{Domain, Error, sampled};
use nalgebra::{DMatrix, DVector};

use super::designed::ControllerDesign;
use super::fixed_mode::described;
use super::gains::{FeedbackProblem, Refusal, feedback};
use super::plant_file::PlantFile;
use super::reconfiguration_limits::ReconfigurationRequest;
use super::reconfiguration_report::{ReconfigurationReport, Reconfigured, WithoutActuator};
use super::report::{pairs, rows};
use super::requirements::Requirement;
use super::robust_report::{Level, Number};
use super::signals::{EntryPoint, Signal};

/// Relative size of the effect that the other actuators cannot produce below which the allocation counts
/// as exact.
const EXACT: f64 = 1e-9;
/// Deviation of the kept measurements, relative to the size of C and x, that counts as none.
const KEPT: f64 = 1e-9;

/// The controller without an actuator: the entry of the design file.
pub(crate) struct Reconfiguration {
    pub(crate) actuator: usize,
    pub(crate) stuck_at: f64,
    pub(crate) k_x: DMatrix<f64>,
    pub(crate) k_f: DMatrix<f64>,
    /// The commands that answer a unit of the stuck command's deviation from the operating point.
    pub(crate) k_s: DVector<f64>,
    /// The states of the fault model that restart at 0.
    pub(crate) restart: Vec<usize>,
    /// Loss and time, in s, of the decision by the estimate.
    pub(crate) decision: Option<(f64, f64)>,
}

/// The controllers without each of the requested actuators, and the report on them.
pub(crate) fn reconfigurations(
    file: &PlantFile<'_>,
    designed: &ControllerDesign,
) -> Result<(Vec<Reconfiguration>, Option<ReconfigurationReport>), Error> {
    let Some(request) = &file.reconfiguration else {
        return Ok((Vec::new(), None));
    };
    let (mut found, mut reports) = (Vec::new(), Vec::new());
    for (&actuator, &stuck_at) in request.actuators.iter().zip(&request.stuck_at) {
        let without = Without { designed, request, actuator, stuck_at };
        let outcome = without.design(&file.feedback.requirement)?;
        reports.push(WithoutActuator {
            actuator: designed.linear.actuators[actuator].name.clone(),
            unit: designed.linear.actuators[actuator].unit.clone(),
            stuck_at,
            outcome: match outcome {
                Ok((own, report)) => {
                    found.push(own);
                    Ok(report)
                }
                Err(reason) => Err(reason),
            },
        });
    }
    let by_estimate = request.decision.map(|(loss, time)| [loss, time]);
    Ok((found, Some(ReconfigurationReport { by_estimate, without: reports })))
}

/// One actuator that is gone.
struct Without<'a> {
    designed: &'a ControllerDesign,
    request: &'a ReconfigurationRequest,
    actuator: usize,
    stuck_at: f64,
}

impl Without<'_> {
    /// The matrices and the report, or the reason why there are none.
    fn design(
        &self,
        requirement: &Requirement,
    ) -> Result<Result<(Reconfiguration, Reconfigured), String>, Error> {
        let ControllerDesign { linear, plant, extended, gains, domain, .. } = self.designed;
        let n = extended.states;
        let b_r = self.without_column(&linear.b);
        if let Some(reason) = self.unstabilisable(&b_r)? {
            return Ok(Err(reason));
        }
        let authority = self.authority();
        let allocation = allocate(&linear.b, &[self.actuator], &authority)?;
        let (k_x, method) = if allocation.residual < EXACT {
            let method = "Control allocation: the other actuators have the effect of all, with the least \
                          effort relative to their limits; the loop keeps its eigenvalues.";
            (&allocation.matrix * gains.k_x.columns(0, n), method.to_owned())
        } else {
            match self.redesigned(requirement) {
                Ok((gain, method)) => {
                    (gain, format!("Designed again for the other actuators. {method}"))
                }
                Err(reason) => return Ok(Err(reason)),
            }
        };
        let (k_f, k_s, rest) = self.static_commands(&k_x, &authority)?;
        let k_x = k_x.resize_horizontally(plant.a.nrows(), 0.0);
        let mut reduced = plant.clone();
        reduced.b = self.without_column(&plant.b);
        let own = Gains { k_x: k_x.clone(), k_f: k_f.clone(), ..gains.clone() };
        let ones = vec![1.0; plant.b.ncols()];
        let whole = closed_loop(&reduced, &controller(&reduced, &own, *domain)?, &ones)?;
        let instability = instability(&whole, *domain)?;
        if instability >= 0.0 {
            return Ok(Err(format!(
                "the loop without it is not stable: {instability:.3e} beyond the limit"
            )));
        }
        let fed_back = plant.a.view((0, 0), (n, n)) + reduced.b.rows(0, n) * k_x.columns(0, n);
        let report = Reconfigured {
            method,
            residual: allocation.residual,
            eigenvalues: pairs(&eigenvalues(&fed_back)?),
            gain_norm: k_x.norm(),
            intact_gain_norm: gains.k_x.norm(),
            k_x: rows(&k_x),
            k_f: rows(&k_f),
            k_s: k_s.iter().copied().collect(),
            commands: self.commands(&rest.u),
            beyond_limits: self.beyond_limits(&rest.u),
            measurements: rest.measurements,
            kept: rest.kept,
        };
        let restart = self.restarted();
        let Self { actuator, stuck_at, .. } = *self;
        let decision = self.request.decision.filter(|_| self.is_estimated());
        Ok(Ok((Reconfiguration { actuator, stuck_at, k_x, k_f, k_s, restart, decision }, report)))
    }

    fn without_column(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let mut b = b.clone();
        b.column_mut(self.actuator).fill(0.0);
        b
    }

    /// Names a mode that is not stable and that the other actuators do not reach.
    fn unstabilisable(&self, b_r: &DMatrix<f64>) -> Result<Option<String>, Error> {
        let linear = &self.designed.linear;
        for mode in uncontrollable_modes(&linear.a, b_r)? {
            if !is_clearly_stable(mode.eigenvalue, &linear.a, Domain::Continuous)? {
                let mode = described(&mode, |at| linear.states[at].name.clone());
                return Ok(Some(format!(
                    "the plant cannot be stabilised: the other actuators do not move {mode}"
                )));
            }
        }
        Ok(None)
    }

    /// The distance of each command from its nearest limit, relative to the largest such distance; 1
    /// without limits.
    fn authority(&self) -> Vec<f64> {
        let distance = |own: &Signal| {
            let operating = own.operating.unwrap_or(0.0);
            own.limits.map(|[low, high]| (operating - low).min(high - operating))
        };
        let distances: Vec<_> = self.designed.linear.actuators.iter().map(distance).collect();
        let largest = distances.iter().flatten().copied().fold(0.0, f64::max);
        if largest <= 0.0 || distances.iter().any(Option::is_none) {
            return vec![1.0; distances.len()];
        }
        distances.iter().flatten().map(|own| (own / largest).max(1e-3)).collect()
    }

    /// A feedback of the other actuators that meets the requirement of the plant file.
    fn redesigned(&self, requirement: &Requirement) -> Result<(DMatrix<f64>, String), String> {
        let ControllerDesign { linear, plant, extended, domain, .. } = self.designed;
        let n = extended.states;
        let gone = self.actuator;
        let requirement = match requirement {
            Requirement::Weights { states, channels } => Requirement::Weights {
                states: states.clone(),
                channels: channels.clone().remove_row(gone).remove_column(gone),
            },
            Requirement::HInfinity { bound, region, channel } => {
                let mut channel = channel.clone();
                if !channel.weights.is_empty() {
                    channel.weights.remove(linear.c.nrows() + gone);
                }
                Requirement::HInfinity { bound: *bound, region: *region, channel }
            }
            other => other.clone(),
        };
        let problem = FeedbackProblem {
            a: &plant.a.view((0, 0), (n, n)).into(),
            b: &plant.b.rows(0, n).into_owned().remove_column(gone),
            c: &linear.c,
            f_a: &plant.f_a.rows(0, n).into(),
        };
        match feedback(&requirement, &problem, *domain) {
            Ok(found) => Ok((found.gain.insert_row(gone, 0.0), found.method)),
            Err(Refusal::Control(error)) => Err(not_met(&error.to_string())),
            Err(Refusal::Conflict(message)) => Err(not_met(&message)),
            Err(Refusal::Fixed(mode)) => {
                let mode = described(&mode, |at| linear.states[at].name.clone());
                Err(not_met(&format!("no feedback of the other actuators moves {mode}")))
            }
        }
    }

    /// K_f, K_s and the equilibrium that they lead to.
    ///
    /// The faults of the actuator that is gone are what it does beside the assumed command; they and the
    /// assumed command act through its column of B, so both have the same commands as answer.
    fn static_commands(
        &self,
        k_x: &DMatrix<f64>,
        authority: &[f64],
    ) -> Result<(DMatrix<f64>, DVector<f64>, Rest), Error> {
        let ControllerDesign { linear, extended, domain, .. } = self.designed;
        let kept = linear.c.select_rows(&self.request.keep);
        let b_g: DVector<f64> = linear.b.column(self.actuator).into();
        let unit = equilibrium((&linear.a, &linear.b, &kept), &b_g, &[self.actuator], authority)?;
        let k_s = &unit.u - k_x * &unit.x;
        let mut reduced = extended.clone();
        reduced.plant.b = self.without_column(&extended.plant.b);
        let mut k_f = sampled::compensation_gain(&reduced, *domain)?;
        let modelled = sampled::compensation_gain(extended, *domain)?;
        for (at, channel) in self.own_faults() {
            // The intact gain has the mean of the modelled fault over a sample.
            let intact = modelled.row(self.actuator);
            let columns = [Some(channel.estimate), channel.rate];
            for column in columns.into_iter().flatten() {
                let part = intact[column] / intact[channel.estimate];
                let part = if at == column { 1.0 } else { part };
                k_f.set_column(column, &(&k_s * part));
            }
        }
        let deviation = self.stuck_at - linear.actuators[self.actuator].operating.unwrap_or(0.0);
        let measured = &linear.c * &unit.x * deviation;
        let named = |(signal, value): (&Signal, &f64)| Number {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            value: *value,
        };
        let rest = Rest {
            u: &unit.u * deviation,
            measurements: linear.measurements.iter().zip(measured.iter()).map(named).collect(),
            kept: unit.left <= KEPT * linear.c.norm() * unit.x.norm(),
        };
        Ok((k_f, k_s, rest))
    }

    /// The faults of this actuator: their first column, and their channels.
    fn own_faults(&self) -> impl Iterator<Item = (usize, FaultChannel)> + '_ {
        let ControllerDesign { linear, extended, .. } = self.designed;
        let own = |point: &EntryPoint| match point {
            EntryPoint::Actuator(actuator) | EntryPoint::Loss { actuator, .. } => {
                *actuator == self.actuator
            }
            _ => false,
        };
        let faults = linear.faults.iter().zip(&extended.channels);
        faults
            .filter(move |(fault, _)| own(&fault.entry_point))
            .map(|(_, channel)| (channel.estimate, *channel))
    }

    fn restarted(&self) -> Vec<usize> {
        self.own_faults().flat_map(|(_, own)| [Some(own.estimate), own.rate]).flatten().collect()
    }

    fn is_estimated(&self) -> bool {
        self.designed.linear.faults.iter().any(|fault| match fault.entry_point {
            EntryPoint::Loss { actuator, .. } => actuator == self.actuator,
            _ => false,
        })
    }

    /// The commands of the equilibrium; that of the actuator that is gone is where it is stuck.
    fn commands(&self, deviations: &DVector<f64>) -> Vec<Number> {
        let actuators = self.designed.linear.actuators.iter().zip(deviations.iter());
        let one = |(at, (own, deviation)): (usize, (&Signal, &f64))| Number {
            name: own.name.clone(),
            unit: own.unit.clone(),
            value: if at == self.actuator {
                self.stuck_at
            } else {
                own.operating.unwrap_or(0.0) + deviation
            },
        };
        actuators.enumerate().map(one).collect()
    }

    /// The other actuators whose commands of the equilibrium are beyond their limits.
    fn beyond_limits(&self, deviations: &DVector<f64>) -> Vec<String> {
        let actuators = self.designed.linear.actuators.iter().zip(self.commands(deviations));
        let beyond = |(at, (own, command)): (usize, (&Signal, Number))| {
            let [low, high] = own.limits.filter(|_| at != self.actuator)?;
            (command.value < low || command.value > high).then(|| own.name.clone())
        };
        actuators.enumerate().filter_map(beyond).collect()
    }
}

/// The equilibrium without the actuator.
struct Rest {
    /// Deviations of the commands from the operating point.
    u: DVector<f64>,
    /// Deviations of the measurements from the operating point.
    measurements: Vec<Number>,
    /// Whether the measurements that must be kept are at the operating point.
    kept: bool,
}

fn not_met(message: &str) -> String {
    format!("the requirement on the feedback cannot be met without it: {message}")
}

impl ReconfigurationReport {
    /// What actuators that are gone contribute to the verdict.
    pub(crate) fn reasons(&self) -> Vec<(Level, String)> {
        let amber = |own: &WithoutActuator| {
            let name = &own.actuator;
            let text = match &own.outcome {
                Err(reason) => format!("without {name} there is no controller: {reason} (amber)"),
                Ok(found) if !found.beyond_limits.is_empty() => format!(
                    "without {name} the operating point needs commands beyond the limits of {} (amber)",
                    found.beyond_limits.join(", ")
                ),
                Ok(_) => return None,
            };
            Some((Level::Amber, text))
        };
        self.without.iter().filter_map(amber).collect()
    }
}
