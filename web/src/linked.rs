//! A linked model as a [`Slave`] of the master. States are saved in memory only: functions that serialise a state would
//! be a tenth of the module.

use fmu::description::{Experiment, ModelDescription};
use fmu::{Linked, Model};
use slave::{CallError, Failure, Slave, Status, StepResult};

/// A model in this program, in place of an FMU.
pub struct LinkedSlave<M: Model>(Linked<M>);

impl<M: Model> LinkedSlave<M> {
    /// An instance of `model`.
    ///
    /// # Errors
    ///
    /// The failure of [`Linked::new`].
    pub fn new(model: M) -> Result<Self, fmu::Failure> {
        Linked::new(model).map(Self)
    }

    fn done(&mut self, function: &'static str, status: Status) -> Result<(), CallError> {
        match status {
            Status::OK | Status::Warning => Ok(()),
            status => {
                let messages = self.0.take_messages();
                Err(CallError { function, failure: Failure::Status(status), messages })
            }
        }
    }
}

/// Converts integers of the master to those of FMI 2.0.
fn narrow(function: &'static str, values: &[i64]) -> Result<Vec<i32>, CallError> {
    let refused = |_| {
        let failure = Failure::InvalidAnswer("takes integers of 32 bits only".to_owned());
        CallError { function, failure, messages: Vec::new() }
    };
    values.iter().map(|value| i32::try_from(*value).map_err(refused)).collect()
}

impl<M: Model + Send> Slave for LinkedSlave<M> {
    fn description(&self) -> &ModelDescription {
        self.0.description()
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        let status = self.0.setup_experiment(experiment);
        self.done("fmi2SetupExperiment", status)
    }

    fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        let status = self.0.enter_initialization_mode();
        self.done("fmi2EnterInitializationMode", status)
    }

    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        let status = self.0.exit_initialization_mode();
        self.done("fmi2ExitInitializationMode", status)
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        let status = self.0.terminate();
        self.done("fmi2Terminate", status)
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        let status = self.0.get_real(references, values);
        self.done("fmi2GetReal", status)
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        let status = self.0.set_real(references, values);
        self.done("fmi2SetReal", status)
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i64]) -> Result<(), CallError> {
        let mut integers = vec![0; values.len()];
        let status = self.0.get_integer(references, &mut integers);
        for (value, integer) in values.iter_mut().zip(integers) {
            *value = integer.into();
        }
        self.done("fmi2GetInteger", status)
    }

    fn set_integer(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        let status = self.0.set_integer(references, &narrow("fmi2SetInteger", values)?);
        self.done("fmi2SetInteger", status)
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        let status = self.0.get_boolean(references, values);
        self.done("fmi2GetBoolean", status)
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        let status = self.0.set_boolean(references, values);
        self.done("fmi2SetBoolean", status)
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        let status = self.0.set_real_input_derivatives(references, orders, values);
        self.done("fmi2SetRealInputDerivatives", status)
    }

    fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        let status = self.0.get_real_output_derivatives(references, orders, values);
        self.done("fmi2GetRealOutputDerivatives", status)
    }

    fn do_step(
        &mut self,
        time: f64,
        size: f64,
        _never_back: bool,
    ) -> Result<StepResult, CallError> {
        match self.0.do_step(time, size) {
            Status::Discard => Ok(StepResult::Part {
                reached: self.0.last_successful_time(),
                terminated: self.0.is_terminated(),
            }),
            status => self.done("fmi2DoStep", status).map(|()| StepResult::Whole),
        }
    }

    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        let status = self.0.save_state(slot);
        self.done("fmi2GetFMUstate", status)
    }

    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        let status = self.0.restore_state(slot);
        self.done("fmi2SetFMUstate", status)
    }
}
