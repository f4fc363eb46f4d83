//! The controller as a model: fields, initialisation, steps, events, derivatives.

mod scheduled;
mod steps;
mod variables;

use std::path::Path;

use fmu::{About, At, Event, Experiment, Failure, Log, Model, ModelExchange, Step, Variable};
use nalgebra::DMatrix;
use num_dual::Dual64;
use serde::{Deserialize, Serialize};

use crate::dense::dense;
use crate::detection::Detector;
use crate::equations::Equations;
use crate::loss::Loss;
use crate::mode::Mode;
use crate::names;
use crate::observer::Observer;
use crate::reconfiguration::Reconfigurator;
use crate::sampled::Sampler;
use crate::shared::Shared;
use crate::signals::{OperatingPoint, Signals, Values};
use crate::validity::MeasurementCheck;
use aso_controller::Design;

/// How far a free command must pass a limit, as a fraction of the actuator's range, or an estimated loss its threshold,
/// to cause an event. Thus no event indicator is zero after an event, and rounding causes no second event.
const HYSTERESIS: f64 = 1e-9;

/// A fault-tolerant controller with an augmented state observer, for a linear plant of any size.
///
/// Fields without a comment have the name of their FMI variable.
#[derive(Clone, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "facts that are independent")]
pub struct AsoController {
    /// The design, which is copied when a parameter is changed, but not with each FMU state.
    pub(crate) design: Shared<Design>,
    pub(crate) x_hat_0: Vec<f64>,
    pub(crate) f_hat_0: Vec<f64>,
    pub(crate) x_i_0: Vec<f64>,
    /// Estimates, measurements and commands as the importer sees them.
    pub(crate) values: Values,
    /// The operating point of `design`; with a schedule, of `current`.
    operating_point: OperatingPoint,
    /// The signals as deviations from the operating point.
    pub(crate) deviations: Signals,
    /// z', the derivative of the estimates; `with_slopes` computes the derivatives.
    pub(crate) z_slopes: Vec<f64>,
    /// f_hat', the derivative of the estimated faults, in a design with a direct term; empty in others.
    pub(crate) f_slopes: Vec<f64>,
    /// u', the derivative of the commands.
    pub(crate) u_slopes: Vec<f64>,
    /// Whether the derivatives z', f_hat', u' and E_hat' belong to the present `deviations` and `mode`.
    #[serde(skip)]
    has_slopes: bool,
    pub(crate) compensate: bool,
    /// The estimated losses of effectiveness E_hat with their derivatives.
    pub(crate) losses: Vec<Loss>,
    /// The decision on which actuators are gone.
    pub(crate) reconfigurator: Reconfigurator,
    /// The mode for which u and z' are computed. Whether the mode compensates is decided at the start, at the end of
    /// each step and at events; in a sampled controller at each sample.
    mode: Mode,
    /// Whether a channel reaches or leaves a limit at events only, as in model exchange.
    frozen: bool,
    /// The samples; `None` for a continuous controller.
    sampler: Option<Sampler>,
    /// The detection of faults; `None` without one.
    detector: Option<Detector>,
    /// The measurements that the importer sets; `values` has the measurements that are used. `None` if all are used.
    measurement_check: Option<MeasurementCheck>,
    /// The clock variable, which the importer ticks. The controller finds its samples by time, not by this clock.
    pub(crate) sample_clock: bool,
    /// The design at the scheduling variable of the last sample, in a continuous controller of the present time; `None`
    /// without a schedule.
    current: Option<Box<Design>>,
    /// The scheduling variable and its slope, if the variable is an input.
    pub(crate) schedule_input: f64,
    pub(crate) schedule_slope: f64,
    /// The value of the scheduling variable for which `current` was computed.
    schedule_value: f64,
    /// `schedule_value` limited to the grid of the schedule.
    pub(crate) schedule_at: f64,
    /// Whether the solver of the crate `fmu` integrates the equations: in co-simulation of a continuous controller with
    /// a schedule.
    is_integrated: bool,
    /// Whether a value outside of the schedule was reported.
    outside_reported: bool,
    log: Log,
    /// The observer, created from `design` in the first step, and again after a state was read from bytes.
    #[serde(skip)]
    observer: Option<Observer>,
    /// Buffer for the time derivatives of the interpolated design and of the signals.
    #[serde(skip)]
    rates: Option<Box<(Design, Signals)>>,
}

impl AsoController {
    /// The controller of a design that [`Design::parse`] has accepted.
    #[must_use]
    pub fn of_design(design: Design) -> Self {
        let operating = design.states.iter().map(|state| state.operating.unwrap_or_default());
        let (mut values, deviations) = (Values::zero(&design), Signals::zero(&design));
        let operating_point = OperatingPoint::of(&design);
        values.r.copy_from_slice(&operating_point.r);
        let start = design.schedule.as_ref().map_or(0.0, |schedule| schedule.range()[0]);
        Self {
            x_hat_0: operating.collect(),
            f_hat_0: vec![0.0; design.faults.len()],
            x_i_0: vec![0.0; design.integrals()],
            z_slopes: vec![0.0; values.z.len()],
            f_slopes: deviations.f_hat.clone(),
            u_slopes: vec![0.0; values.u.len()],
            has_slopes: false,
            compensate: true,
            losses: Loss::all(&design),
            reconfigurator: Reconfigurator::new(&design),
            mode: Mode::default(),
            frozen: false,
            sampler: Sampler::new(&design),
            detector: Detector::new(&design),
            measurement_check: MeasurementCheck::new(&design),
            sample_clock: false,
            schedule_input: start,
            schedule_slope: 0.0,
            schedule_value: start,
            schedule_at: start,
            is_integrated: false,
            outside_reported: false,
            log: Log::default(),
            current: design.unscheduled().map(Box::new),
            observer: None,
            rates: None,
            values,
            operating_point,
            deviations,
            design: Shared::from(design),
        }
    }

    /// The plant of the design: A, B, C, and `F_a`, by which faults act on the states.
    pub fn plant(&self) -> [DMatrix<f64>; 4] {
        [&self.design.a, &self.design.b, &self.design.c, &self.design.f_a].map(dense)
    }
}

impl Model for AsoController {
    const IDENTIFIER: &'static str = "AsoController";

    const PROVIDES_DIRECTIONAL_DERIVATIVE: bool = true;

    fn about(&self) -> About {
        let (stop, step) = (self.design.experiment.stop_time, self.design.step_size());
        About {
            description: self.design.description.clone(),
            ..fmu::about!(start_time: 0.0, stop_time: stop, tolerance: 1e-9, step_size: step)
        }
    }

    fn new(resources: &Path) -> Result<Self, Failure> {
        let file = resources.join("design.toml");
        let path = file.display().to_string();
        let text = std::fs::read_to_string(&file);
        let text = text.map_err(|error| Failure::Error(format!("{path}: {error}")))?;
        let design = Design::parse(&text, &path);
        Ok(Self::of_design(design.map_err(|error| Failure::Error(error.to_string()))?))
    }

    fn variables(&self) -> Vec<Variable<Self>> {
        variables::list(self)
    }

    fn check(&self) -> Result<(), Failure> {
        for (j, actuator) in self.design.actuators.iter().enumerate() {
            if let Some([low, high]) = actuator.limits
                && low >= high
            {
                let [low_name, high_name] = [0, 1].map(|side| names::limit(&self.design, side, j));
                return Err(Failure::Error(format!(
                    "{low_name} = {low}, expected less than {high_name} = {high}"
                )));
            }
        }
        let detection = self.design.detection.as_ref();
        let refused = detection.and_then(|detection| detection.refused_number(&self.design));
        let of_laws = self.design.refused_filter().or_else(|| self.design.refused_sliding_mode());
        of_laws.or(refused).map_or(Ok(()), |refusal| Err(Failure::Error(refusal.to_string())))
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Failure> {
        let time = experiment.start_time;
        let is_sampled = self.sampler.is_some();
        if let Some(check) = &mut self.measurement_check {
            check.start(&self.design);
            if is_sampled {
                check.take_sample(&mut self.values, 0.0);
            } else {
                check.take_step(&mut self.values, time, 0.0);
            }
        }
        self.start();
        self.start_detection(time);
        self.observer = None;
        self.frozen = false;
        self.outside_reported = false;
        self.is_integrated = false;
        self.reconfigurator.start();
        if let Some(sampler) = &mut self.sampler {
            sampler.start(time, &self.values.z);
            self.sample(time, time);
            return Ok(());
        }
        self.mode = self.free_mode(self.is_compensating(time));
        self.values.law = Some(self.mode.law(&self.design));
        self.evaluate(time, 0.0);
        Ok(())
    }

    /// Returns [`Failure::Unsolved`] for a continuous controller with a schedule: its matrices change during the step,
    /// which has no closed form, so the exporter integrates the derivatives.
    fn step(&mut self, step: &Step) -> Result<(), Failure> {
        if self.sampler.is_some() {
            self.sample(step.start, step.end());
            return Ok(());
        }
        if self.design.schedule.is_some() {
            self.is_integrated = true;
            return Err(Failure::Unsolved);
        }
        self.integrate(step)
    }

    /// Stops at the next sample of a sampled controller, which is an event. If no event has taken the sample at the
    /// start of the step, it is taken first. A continuous controller makes the whole step.
    fn step_to_event(&mut self, step: &Step) -> Result<Option<f64>, Failure> {
        if self.sampler.is_none() {
            return self.step(step).map(|()| None);
        }
        self.sample(step.start, step.start);
        Ok(self.sampler.as_ref().and_then(|sampler| sampler.clock.next_until(step.end())))
    }

    fn update(&mut self, time: f64) -> Result<(), Failure> {
        if self.sampler.is_none() {
            if let Some(check) = &self.measurement_check {
                check.show(&mut self.values);
            }
            self.evaluate(time, 0.0);
        }
        Ok(())
    }

    fn differentiate(&self, at: &At, direction: &mut Self) -> Result<(), Failure> {
        let initial = *at == At::Initialization;
        if !initial && self.sampler.is_some() {
            // Between samples nothing changes.
            return Ok(());
        }
        if let (Some(check), Some(of_direction)) =
            (&self.measurement_check, &direction.measurement_check)
        {
            let design = initial.then_some(&*direction.design);
            check.take_direction(of_direction, design, &mut direction.values);
        }
        if initial {
            direction.start();
        }
        direction.design.clear_reconfigurations();
        self.differentiate_schedule(direction);
        let Self { design, current, values, operating_point, deviations, z_slopes, .. } = direction;
        let design = current.as_deref().unwrap_or(design);
        operating_point.read(design);
        if self.is_resting() {
            deviations.u.fill(0.0);
            deviations.f_hat.fill(0.0);
            z_slopes.fill(0.0);
            direction.losses.iter_mut().for_each(|loss| loss.estimate = 0.0);
            if initial {
                values.rest(operating_point);
                values.set_commands(&deviations.u, design, self.mode, operating_point);
            } else {
                values.u.fill(0.0);
            }
            return Ok(());
        }
        deviations.set(values, operating_point, 0.0);
        self.mode.set_limited(design, &mut deviations.u);
        let equations = Equations::<Dual64>::new([self.design_in_force(), design], self.mode);
        let mut signals = (&self.deviations, &mut *deviations);
        if let (Some(sampler), Some(direction)) = (&self.sampler, &mut direction.sampler) {
            sampler.differentiate_first_sample(equations, direction, &mut signals);
        } else {
            equations.evaluate(&mut signals, &mut (&self.z_slopes[..], z_slopes));
        }
        values.set_estimate(&deviations.z, operating_point);
        values.set_commands(&deviations.u, design, self.mode, operating_point);
        let n = design.states.len();
        for loss in &mut direction.losses {
            let u = Dual64::new(self.values.u[loss.actuator], values.u[loss.actuator]);
            let f_hat = loss.fault_of(&self.deviations.f_hat, &self.values.z, n);
            let f_hat = Dual64::new(f_hat, loss.fault_of(&deviations.f_hat, &values.z, n));
            loss.estimate = loss.effectiveness_lost(u, f_hat).eps;
        }
        Ok(())
    }

    fn log(&mut self) -> Option<&mut Log> {
        Some(&mut self.log)
    }

    /// `None`, no model exchange, for a continuous controller with a detection or a check of measurements: the residual
    /// filter is stepped together with the observer in co-simulation only, and measurements are checked at
    /// communication points only.
    fn model_exchange(&self) -> Option<ModelExchange> {
        let is_stepped = self.detector.is_some() || self.measurement_check.is_some();
        if is_stepped && self.sampler.is_none() {
            return None;
        }
        let limited = self.design.actuators.iter().filter(|actuator| actuator.limits.is_some());
        let decisive = self.design.reconfigurations.iter().filter(|case| case.loss.is_some());
        let event_indicators =
            if self.sampler.is_some() { 0 } else { 2 * limited.count() + decisive.count() };
        Some(ModelExchange { event_indicators })
    }

    fn event_indicators(&self, _time: f64, indicators: &mut [f64]) {
        let design = self.design_in_force();
        let equations = Equations::<f64>::new(design, self.mode);
        let decisive = self.reconfigurator.distances(&self.design, &self.losses);
        let limited = self.design.actuators.iter().filter(|actuator| actuator.limits.is_some());
        let (limits, decisions) = indicators.split_at_mut(2 * limited.count());
        for (indicator, (distance, above)) in decisions.iter_mut().zip(decisive) {
            *indicator = distance + if above { -HYSTERESIS } else { HYSTERESIS };
        }
        let mut pairs = limits.chunks_exact_mut(2);
        for (j, actuator) in design.actuators.iter().enumerate() {
            let Some([low, high]) = actuator.range() else { continue };
            let Signals { z, y, r, .. } = &self.deviations;
            let stuck = self.mode.stuck_part(design, j);
            let command = equations.free_command(j, equations.estimate(z), [y, r], stuck);
            let distances = [command - low, high - command];
            for (side, indicator) in pairs.next().into_iter().flatten().enumerate() {
                let beyond = if self.mode.is_at(side, j) { -HYSTERESIS } else { HYSTERESIS };
                *indicator = if self.mode.is_gone(j) {
                    1.0
                } else {
                    distances[side] / (high - low) + beyond
                };
            }
        }
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        if self.sampler.is_some() {
            self.sample(time, time);
            let next_event_time = self.sampler.as_ref().map(|sampler| sampler.clock.next_instant());
            return Ok(Event { next_event_time, ..Event::default() });
        }
        // In a step that the exporter integrates, channels reach and leave limits between the events, too.
        self.frozen = !self.is_integrated;
        let restarted = self.reconfigure(time, None);
        self.interpolate(0.0, time);
        self.deviations.set(&self.values, &self.operating_point, 0.0);
        let mode = self.free_mode(self.is_compensating(time));
        let transferred = self.transfer(mode);
        let Signals { z, y, r, .. } = &self.deviations;
        self.mode = mode.limited(self.design_in_force(), z, [y, r]);
        let waiting = self.compensate && !self.mode.compensating;
        let decision = self.reconfigurator.next_decision(&self.design);
        let next_event_time = waiting.then_some(self.design.t_on).into_iter().chain(decision);
        Ok(Event {
            next_event_time: next_event_time.reduce(f64::min),
            values_of_continuous_states_changed: restarted || transferred,
            ..Event::default()
        })
    }
}

#[cfg(test)]
mod tests;
