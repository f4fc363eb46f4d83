//! A slave that steps in the background: it wraps another one and records the starts and ends of
//! steps.

use std::sync::{Arc, Mutex};

use fmu_description::Experiment;
use fmu_description::ModelDescription;
use fmu_description::abi::Status;
use master::{Background, CallError, Failure, Slave, StepRequest, StepResult, System};

type Done = Result<(), CallError>;

/// The starts and ends of steps, in order.
pub(crate) type Record = Arc<Mutex<Vec<String>>>;

/// The slave's failure from the time 5 s on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fails {
    Nowhere,
    InSet,
    InBegin,
    InFinish,
}

/// A slave that makes its step when the step is finished.
pub(crate) struct Ahead {
    inner: Box<dyn Slave>,
    name: String,
    fails: Fails,
    record: Record,
    /// The values of the inputs in the current step.
    begun: Option<Vec<f64>>,
    time: f64,
}

/// Puts the slaves of the system for which `fails` returns a value into the background.
pub(crate) fn ahead(mut system: System, fails: impl Fn(&str) -> Option<Fails>) -> (System, Record) {
    let record = Record::default();
    let slaves = std::mem::take(&mut system.slaves).into_iter();
    let wrapped = slaves.map(|(name, inner)| {
        let Some(fails) = fails(&name) else { return (name, inner) };
        let (slave_name, record) = (name.clone(), Arc::clone(&record));
        let slave = Ahead { inner, name: slave_name, fails, record, begun: None, time: 0.0 };
        (name, Box::new(slave) as Box<dyn Slave>)
    });
    system.slaves = wrapped.collect();
    (system, record)
}

impl Ahead {
    fn fail(&self, place: Fails, function: &'static str) -> Done {
        if self.fails == place && self.time >= 5.0 {
            let failure = Failure::Status(Status::Error);
            return Err(CallError { function, failure, messages: Vec::new() });
        }
        Ok(())
    }

    fn note(&self, what: &str) {
        self.record.lock().unwrap().push(format!("{what} {}", self.name));
    }

    /// The wrapped slave, for a call that does not finish a step.
    fn other(&mut self) -> &mut dyn Slave {
        self.begun = None;
        self.inner.as_mut()
    }
}

impl Background for Ahead {
    fn begin_advance(&mut self, request: &StepRequest<'_>) -> Done {
        self.note("begin");
        self.time = request.step.time;
        self.fail(Fails::InBegin, "fmi2DoStep")?;
        self.begun = Some(request.input_values.to_vec());
        Ok(())
    }

    fn finish_advance(&mut self, request: &mut StepRequest<'_>) -> Result<StepResult, CallError> {
        self.note("finish");
        assert_eq!(self.begun.take().as_deref(), Some(request.input_values), "the step begun");
        self.fail(Fails::InFinish, "fmi2DoStep")?;
        self.time = request.step.time + request.step.size;
        self.inner.advance(request)
    }
}

impl Slave for Ahead {
    fn description(&self) -> &ModelDescription {
        self.inner.description()
    }
    fn setup_experiment(&mut self, experiment: &Experiment) -> Done {
        self.other().setup_experiment(experiment)
    }
    fn enter_initialization_mode(&mut self) -> Done {
        self.other().enter_initialization_mode()
    }
    fn exit_initialization_mode(&mut self) -> Done {
        self.other().exit_initialization_mode()
    }
    fn terminate(&mut self) -> Done {
        self.other().terminate()
    }
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Done {
        self.other().get_real(references, values)
    }
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Done {
        self.other().set_real(references, values)
    }
    fn get_integer(&mut self, references: &[u32], values: &mut [i64]) -> Done {
        self.other().get_integer(references, values)
    }
    fn set_integer(&mut self, references: &[u32], values: &[i64]) -> Done {
        self.fail(Fails::InSet, "fmi2SetInteger")?;
        self.other().set_integer(references, values)
    }
    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Done {
        self.other().get_boolean(references, values)
    }
    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Done {
        self.other().set_boolean(references, values)
    }
    fn get_string(&mut self, references: &[u32], values: &mut [String]) -> Done {
        self.other().get_string(references, values)
    }
    fn set_string(&mut self, references: &[u32], values: &[String]) -> Done {
        self.other().set_string(references, values)
    }
    fn set_input_derivatives(&mut self, which: &[u32], orders: &[i32], values: &[f64]) -> Done {
        self.other().set_input_derivatives(which, orders, values)
    }
    fn get_output_derivatives(
        &mut self,
        which: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Done {
        self.other().get_output_derivatives(which, orders, values)
    }
    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        self.other().do_step(time, size, never_back)
    }
    fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Done {
        self.other().directional_derivative(unknowns, knowns, seed, changes)
    }
    fn save_state(&mut self, slot: usize) -> Done {
        self.other().save_state(slot)
    }
    fn restore_state(&mut self, slot: usize) -> Done {
        self.other().restore_state(slot)
    }
    fn in_background(&mut self) -> Option<&mut dyn Background> {
        Some(self)
    }
}
