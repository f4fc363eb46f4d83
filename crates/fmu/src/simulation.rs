//! A model run in Rust, without an importer.

use std::path::Path;

use crate::Experiment;
use crate::interface::{Interface, new_model};
use crate::model::{Failure, Model, Step};
use crate::stepper::Stepper;

/// Runs a model step by step, as its FMU does in co-simulation: for the unit tests of the model, and for
/// programs in Rust that need no FMU.
///
/// The program reads and sets the fields of the model directly. The page of the [crate] has an example.
pub struct Simulation<M: Model> {
    model: M,
    interface: Interface<M>,
    stepper: Stepper,
    experiment: Experiment,
    time: f64,
    is_started: bool,
}

impl<M: Model> Simulation<M> {
    /// Creates the model as `fmi2Instantiate` does, with the folder `resources`.
    ///
    /// # Errors
    ///
    /// The failure of [`Model::new`]; [`Failure::Error`] if the variables cannot be described.
    pub fn new(resources: &Path) -> Result<Self, Failure> {
        let mut model = new_model::<M>(resources)?;
        let (interface, description) = Interface::new(&mut model)?;
        let stepper = Stepper::new(&interface, description.default_experiment);
        let experiment = Experiment::default();
        Ok(Self { model, interface, stepper, experiment, time: 0.0, is_started: false })
    }

    /// The model.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// The model, for setting parameters before the start and inputs between steps. The next call of
    /// [`Model::update`] or [`Simulation::step`] computes the outputs.
    pub fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }

    /// The time reached in s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Initializes the model: checks the parameters and computes the initial values. The first step does
    /// so with the start time 0 if this function was not called.
    ///
    /// # Errors
    ///
    /// The failures of [`Model::check`] and [`Model::initialize`].
    pub fn start(&mut self, experiment: Experiment) -> Result<(), Failure> {
        self.model.check()?;
        self.model.initialize(&experiment)?;
        self.time = experiment.start_time;
        self.experiment = experiment;
        self.is_started = true;
        Ok(())
    }

    /// Advances the model by a communication step of `size` s.
    ///
    /// # Errors
    ///
    /// The failures of [`Model::step`] or, if the model has no step of its own, the failures of its equations;
    /// [`Failure::Discard`] for a step that is too long ([`Model::step`] states how long it may be); in the first step
    /// the failures of [`Simulation::start`].
    pub fn step(&mut self, size: f64) -> Result<(), Failure> {
        if !self.is_started {
            self.start(Experiment::default())?;
        }
        let step = Step { start: self.time, size };
        let Self { model, interface, stepper, experiment, .. } = self;
        stepper.check_size(size)?;
        match model.step(&step) {
            Err(Failure::Unsolved) => stepper.run(model, interface, &step, experiment.tolerance)?,
            result => result?,
        }
        self.time = step.end();
        interface.clear_input_derivatives(model);
        Ok(())
    }
}
