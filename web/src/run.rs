//! A run of a closed loop: the plant and the controller of `models`, connected by equal names.

use std::collections::VecDeque;

use controller::AsoController;
use fmu::description::{Experiment, Kind};
use master::{AlgorithmRequest, KeptState, Port, Probe, Simulation, System, Value, choose};

use crate::linked::LinkedSlave;
use crate::models::{COLUMNS, Plant, design};
use crate::settings::{Settings, told};
use crate::text;

/// Number of values in a row.
pub const WIDTH: usize = COLUMNS.len() + 1;

/// A run may have fewer steps than this.
const MOST_STEPS: f64 = 1e8;

/// Number of states that [`Run::back`] can return to.
const SAVED: usize = 240;

/// A run of the closed loop.
pub struct Run {
    simulation: Simulation,
    probe: Probe,
    /// The saved states, oldest first, with the number of steps. Their slots are consecutive modulo [`SAVED`].
    saved: VecDeque<(KeptState, u64)>,
    /// Number of steps made.
    steps: u64,
}

impl Run {
    /// Starts a run with communication steps of `step` s until `stop` s. `settings` has a setting in each
    /// line, see [`Settings::parse`].
    ///
    /// # Errors
    ///
    /// The reason, as a sentence: a setting that is unknown or out of its range, or a failure of a
    /// model.
    pub fn new(settings: &str, step: f64, stop: f64) -> Result<Self, String> {
        if !(step > 0.0 && stop > 0.0 && stop / step < MOST_STEPS) {
            return Err(format!(
                "a step of {step} s until {stop} s: expected both above 0, and fewer than {MOST_STEPS:e} steps"
            ));
        }
        let mut system = System::default();
        let plant = LinkedSlave::new(model::<Plant>()?);
        let plant = plant.map_err(|failure| failure.to_string())?;
        let controller = LinkedSlave::new(AsoController::of_design(design()));
        let controller = controller.map_err(|failure| failure.to_string())?;
        let settings = Settings::parse(settings)?;
        system.add("plant", Box::new(plant)).map_err(told)?;
        system.add("controller", Box::new(controller)).map_err(told)?;
        system.connect_equal_names().map_err(told)?;
        for (name, value) in &settings.values {
            let port = system.port(name).map_err(told)?;
            let parsed = parsed(&system, port, name, value)?;
            system.set_port_value(port, parsed, value).map_err(told)?;
        }
        let request = AlgorithmRequest { step: Some(step), ..AlgorithmRequest::default() };
        let algorithm = choose(&system, &request, stop).map_err(told)?.algorithm;
        let ports = COLUMNS.iter().map(|name| system.port(name)).collect::<Result<Vec<_>, _>>();
        let probe = Probe::new(&system, &ports.map_err(told)?);
        let scenario = settings.scenario(&system, step)?;
        let experiment = Experiment { start_time: 0.0, stop_time: Some(stop), tolerance: None };
        let simulation = Simulation::with_scenario(system, &algorithm, &experiment, scenario);
        let simulation = simulation.map_err(told)?;
        Ok(Self { simulation, probe, saved: VecDeque::new(), steps: 0 })
    }

    /// The time in s.
    pub fn time(&self) -> f64 {
        self.simulation.time()
    }

    /// Number of steps made.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Sets an input without connection or a tunable parameter between two steps.
    ///
    /// # Errors
    ///
    /// The reason, as a sentence: an unknown variable, or a value that it does not take.
    pub fn set(&mut self, name: &str, value: &str) -> Result<(), String> {
        let system = self.simulation.system();
        let port = system.port(name).map_err(told)?;
        let parsed = parsed(system, port, name, value)?;
        system.set_value(port, &parsed).map_err(told)
    }

    /// Whether the stop time is reached.
    pub fn is_finished(&self) -> bool {
        self.simulation.is_finished()
    }

    /// Makes one communication step.
    ///
    /// # Errors
    ///
    /// The reason, as a sentence: the failure of a model.
    pub fn step(&mut self) -> Result<(), String> {
        self.steps += 1;
        self.simulation.step().map_err(told)
    }

    /// Returns the time in s and the values of [`COLUMNS`].
    ///
    /// # Errors
    ///
    /// The reason, as a sentence: the failure of a model.
    pub fn row(&mut self) -> Result<[f64; WIDTH], String> {
        let mut row = [0.0; WIDTH];
        row[0] = self.simulation.time();
        let values = &mut row[1..];
        let time = self.simulation.time();
        let read = self.probe.read(self.simulation.system(), time, values);
        read.map(|()| row).map_err(told)
    }

    /// Saves the present state for [`Run::back`]; if [`SAVED`] states are kept, drops the oldest.
    ///
    /// # Errors
    ///
    /// The reason, as a sentence: a model cannot save its state.
    pub fn save(&mut self) -> Result<(), String> {
        if self.saved.len() == SAVED {
            self.saved.pop_front();
        }
        let slot = self.saved.back().map_or(0, |(newest, _)| (newest.slot() + 1) % SAVED);
        self.saved.push_back((self.simulation.keep(slot).map_err(told)?, self.steps));
        Ok(())
    }

    /// Returns to the state saved last, and drops this state.
    ///
    /// # Errors
    ///
    /// The reason, as a sentence: no state is saved, or a model refuses it.
    pub fn back(&mut self) -> Result<(), String> {
        let (saved, steps) = self.saved.pop_back().ok_or("no earlier state is kept")?;
        self.simulation.return_to(&saved).map_err(told)?;
        self.steps = steps;
        Ok(())
    }
}

/// Parses `text` as a value of the variable `name` at `port`.
fn parsed(system: &System, port: Port, name: &str, text: &str) -> Result<Value, String> {
    let (value, expected) = match system.variable(port).kind {
        Kind::Real(_) => (text::number(text).map(Value::Real), "a number"),
        Kind::Boolean(_) => (text.parse().ok().map(Value::Boolean), "true or false"),
        _ => (text.parse().ok().map(Value::Integer), "an integer"),
    };
    value.ok_or_else(|| format!("{name}={text}: expected {expected}"))
}

/// Creates a model that needs no resources.
fn model<M: fmu::Model>() -> Result<M, String> {
    M::new("".as_ref()).map_err(|failure| failure.to_string())
}
