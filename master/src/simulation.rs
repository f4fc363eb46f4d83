//! The master algorithm: initialisation and fixed communication steps.

use fmi2::Experiment;

use crate::error::SystemError;
use crate::exchange::{Course, Exchange, call};
use crate::order::{Order, by_direct_dependencies};
use crate::system::System;

/// A master algorithm with a fixed communication step H.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// All slaves step from t to t + H with their inputs held at the values of t. First order.
    Jacobi,
    /// The slaves step one after the other, in the order of their direct dependencies.
    ///
    /// An input whose source has made the step already follows the line through the source's
    /// values at t and t + H. One whose source is still to come follows a slope from its value at t:
    /// of the source's output derivative at t and its difference quotient over the last step the
    /// smaller one, zero where their signs differ (the minmod limiter of Roe 1986), or the quotient
    /// alone where the source gives no derivatives. Where both are near each other this is as good
    /// as the derivative; in a transient that is faster than H it keeps the extrapolation from
    /// running away. Second order where all slaves take derivatives; where one does not, its
    /// inputs are held, at t + H if known. (Sequential scheme with polynomial inputs: Kuebler and
    /// Schiehlen 2000, "Two methods of simulator coupling"; limiter: P. L. Roe, Annu. Rev. Fluid
    /// Mech. 18, 1986.)
    #[default]
    GaussSeidel,
    /// As [`Method::GaussSeidel`] with every input held: at t + H if its source has made the step,
    /// else at t. First order.
    GaussSeidelHold,
}

impl Method {
    fn course(self) -> Course {
        if self == Method::GaussSeidel { Course::Sloped } else { Course::Held }
    }
}

/// A system in simulation.
pub struct Simulation {
    system: System,
    method: Method,
    exchange: Exchange,
    order: Order,
    start: f64,
    stop: Option<f64>,
    step: f64,
    /// Steps made, and the time reached with them.
    count: u64,
    time: f64,
    stepped: Vec<bool>,
}

impl Simulation {
    /// Initialises all slaves of `system` at `start`, to be advanced in steps of `step` s.
    ///
    /// The connected values are exchanged in initialization mode until each has passed through
    /// every slave.
    ///
    /// # Errors
    ///
    /// Where `start` or `step` make no sense, an FMU fails, or an output is not finite.
    pub fn new(
        mut system: System,
        method: Method,
        experiment: &Experiment,
        step: f64,
    ) -> Result<Self, SystemError> {
        check_times(&system, experiment, step)?;
        let (start, stop) = (experiment.start_time, experiment.stop_time);
        let mut exchange = Exchange::new(&system);
        let order = by_direct_dependencies(&system);
        let stepped = vec![false; system.slaves.len()];
        for (name, slave) in &mut system.slaves {
            slave
                .setup_experiment(experiment)
                .and_then(|()| slave.enter_initialization_mode())
                .map_err(|source| call(name, start, source))?;
        }
        for _ in 0..=system.slaves.len() {
            for &slave in &order.sequence {
                exchange.write_initial(&mut system, slave, start)?;
            }
        }
        for (name, slave) in &mut system.slaves {
            slave.exit_initialization_mode().map_err(|source| call(name, start, source))?;
        }
        for slave in 0..stepped.len() {
            exchange.read(&mut system, slave, method.course(), start)?;
        }
        exchange.begin_step(step);
        Ok(Self {
            system,
            method,
            exchange,
            order,
            start,
            stop,
            step,
            count: 0,
            time: start,
            stepped,
        })
    }

    /// Time reached in s: start + k H, the last step ending at the stop time.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Whether the stop time is reached.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.stop.is_some_and(|stop| self.time >= stop)
    }

    /// End and size of the next step: H, or what is left where that is less.
    #[expect(clippy::cast_precision_loss, reason = "2^53 steps take longer than anyone waits")]
    fn next(&self) -> (f64, f64) {
        let end = self.start + (self.count + 1) as f64 * self.step;
        let rounding = 1e-6 * self.step;
        match self.stop {
            Some(stop) if end > stop + rounding => (stop, stop - self.time),
            Some(stop) if end > stop - rounding => (stop, self.step),
            _ => (end, self.step),
        }
    }

    /// The order of stepping.
    #[must_use]
    pub fn order(&self) -> &Order {
        &self.order
    }

    /// The system, for reading values between steps.
    pub fn system(&mut self) -> &mut System {
        &mut self.system
    }

    /// One communication step of all slaves.
    ///
    /// # Errors
    ///
    /// Where an FMU does not finish the step or an output is not finite; the simulation then
    /// stands at the begin of the step in some slaves and at its end in others.
    pub fn step(&mut self) -> Result<(), SystemError> {
        let time = self.time;
        let (end, size) = self.next();
        let course = self.method.course();
        self.exchange.begin_step(size);
        self.stepped.fill(false);
        let span = (time, size);
        for position in 0..self.order.sequence.len() {
            let slave = self.order.sequence[position];
            self.exchange.write(&mut self.system, slave, course, span, &self.stepped)?;
            if self.method != Method::Jacobi {
                self.advance(slave, span)?;
                self.stepped[slave] = true;
                self.exchange.read(&mut self.system, slave, course, end)?;
            }
        }
        if self.method == Method::Jacobi {
            for slave in 0..self.stepped.len() {
                self.advance(slave, span)?;
                self.exchange.read(&mut self.system, slave, course, end)?;
            }
        }
        self.count += 1;
        self.time = end;
        Ok(())
    }

    fn advance(&mut self, slave: usize, (time, size): (f64, f64)) -> Result<(), SystemError> {
        let (name, instance) = &mut self.system.slaves[slave];
        instance.do_step(time, size, true).map(|_| ()).map_err(|source| call(name, time, source))
    }

    /// Ends the simulation: `fmi2Terminate` of every slave, all of them even where one fails.
    ///
    /// # Errors
    ///
    /// The first failure.
    pub fn terminate(&mut self) -> Result<(), SystemError> {
        let time = self.time;
        let mut first = Ok(());
        for (name, slave) in &mut self.system.slaves {
            let done = slave.terminate().map_err(|source| call(name, time, source));
            first = first.and(done);
        }
        first
    }
}

/// Whether the run can be made in steps of `step` s, the last one shorter if need be.
fn check_times(system: &System, experiment: &Experiment, step: f64) -> Result<(), SystemError> {
    if !(step > 0.0 && step.is_finite()) {
        let (what, rule) = ("the communication step", "more than 0".to_owned());
        return Err(SystemError::Time { what, value: step, rule });
    }
    let Some(stop) = experiment.stop_time else { return Ok(()) };
    if !(stop > experiment.start_time && stop.is_finite()) {
        let (what, rule) = ("the stop time", "more than the start time".to_owned());
        return Err(SystemError::Time { what, value: stop, rule });
    }
    let steps = (stop - experiment.start_time) / step;
    let shortened = (steps - steps.round()).abs() > 1e-6;
    let rigid = system.slaves.iter().find(|(_, slave)| {
        let flags = slave.description().co_simulation.as_ref();
        flags.is_some_and(|flags| !flags.can_handle_variable_communication_step_size)
    });
    match rigid {
        Some((name, _)) if shortened => {
            let rule = format!(
                "a multiple of the communication step {step} s, as {name} takes equal steps only"
            );
            Err(SystemError::Time { what: "the stop time", value: stop, rule })
        }
        _ => Ok(()),
    }
}
