//! The closed loop of the paper: both models, connected by equal names.

use controller::AsoController;
use fmu::description::Experiment;
use master::{AlgorithmRequest, Checkpoint, Probe, Simulation, System, choose};
use plant::FrictionPendulum;

use crate::LinkedSlave;

/// The design that the controller FMU contains.
const DESIGN: &str = include_str!("../../fmu-controller/resources/design.toml");

/// The variables of a row, after the time.
pub const COLUMNS: [&str; 8] = [
    "plant.x_p",
    "plant.theta",
    "plant.v_p",
    "plant.omega",
    "plant.f_fric",
    "plant.regime",
    "controller.u",
    "controller.f_hat",
];

/// A run of the closed loop.
pub struct Paper {
    simulation: Simulation,
    probe: Probe,
    saved: Option<Checkpoint>,
}

impl Paper {
    /// Starts a run with communication steps of `step` s until `stop` s; `settings` are lines
    /// `fmu.variable=value`.
    ///
    /// # Errors
    ///
    /// A sentence: an unknown variable, a value out of its range, or a failure of a model.
    pub fn new(settings: &str, step: f64, stop: f64) -> Result<Self, String> {
        let mut system = System::default();
        let plant = LinkedSlave::new(model::<FrictionPendulum>()?);
        let plant = plant.map_err(|failure| failure.to_string())?;
        let controller = AsoController::from_design(DESIGN).and_then(LinkedSlave::new);
        let controller = controller.map_err(|failure| failure.to_string())?;
        let told = |error: master::SystemError| error.to_string();
        system.add("plant", Box::new(plant)).map_err(told)?;
        system.add("controller", Box::new(controller)).map_err(told)?;
        system.connect_equal_names().map_err(told)?;
        for line in settings.lines().filter(|line| !line.trim().is_empty()) {
            let (name, value) = line
                .split_once('=')
                .ok_or_else(|| format!("{line:?}: expected fmu.variable=value"))?;
            let port = system.port(name.trim()).map_err(told)?;
            system.set_port(port, value.trim()).map_err(told)?;
        }
        let request = AlgorithmRequest { step: Some(step), ..AlgorithmRequest::default() };
        let algorithm = choose(&system, &request, stop).map_err(told)?.algorithm;
        let ports = COLUMNS.iter().map(|name| system.port(name)).collect::<Result<Vec<_>, _>>();
        let probe = Probe::new(&system, &ports.map_err(told)?);
        let experiment = Experiment { start_time: 0.0, stop_time: Some(stop), tolerance: None };
        let simulation = Simulation::new(system, &algorithm, &experiment).map_err(told)?;
        Ok(Self { simulation, probe, saved: None })
    }

    /// Whether the stop time is reached.
    pub fn is_finished(&self) -> bool {
        self.simulation.is_finished()
    }

    /// Makes one communication step.
    ///
    /// # Errors
    ///
    /// A sentence: the failure of a model.
    pub fn step(&mut self) -> Result<(), String> {
        self.simulation.step().map_err(|error| error.to_string())
    }

    /// Returns the time in s and the values of [`COLUMNS`].
    ///
    /// # Errors
    ///
    /// A sentence: the failure of a model.
    pub fn row(&mut self) -> Result<[f64; 9], String> {
        let mut row = [0.0; 9];
        row[0] = self.simulation.time();
        let values = &mut row[1..];
        let time = self.simulation.time();
        let read = self.probe.read(self.simulation.system(), time, values);
        read.map(|()| row).map_err(|error| error.to_string())
    }

    /// Saves the present state, for [`Paper::back`].
    ///
    /// # Errors
    ///
    /// A sentence: a model cannot serialise its state.
    pub fn save(&mut self) -> Result<(), String> {
        self.saved = Some(self.simulation.checkpoint().map_err(|error| error.to_string())?);
        Ok(())
    }

    /// Returns to the state of [`Paper::save`].
    ///
    /// # Errors
    ///
    /// A sentence: no state is saved, or a model refuses it.
    pub fn back(&mut self) -> Result<(), String> {
        let saved = self.saved.as_ref().ok_or("no state is saved")?;
        self.simulation.restore(saved).map_err(|error| error.to_string())
    }
}

/// A model that needs no resources.
fn model<M: fmu::Model>() -> Result<M, String> {
    M::new("".as_ref()).map_err(|failure| failure.to_string())
}
