//! A slave of FMI 2.0 or 3.0 that keeps its values.

use fmu_description::ModelDescription;
use master::{
    Algorithm, CallError, Extrapolation, Method, Readout, Simulation, Slave, StepResult, System,
};

use super::until;

/// A slave without equations: `values[k]` is the value of the references `k`, `k + n`, ... for `n` values. Only the
/// references below `n` can be set.
pub(crate) struct Memory {
    description: ModelDescription,
    values: Vec<f64>,
}

impl Memory {
    pub(crate) fn boxed(description: &str, values: &[f64]) -> Box<Self> {
        let description = ModelDescription::parse(description).unwrap();
        Box::new(Self { description, values: values.to_vec() })
    }
}

impl Slave for Memory {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        for (value, &reference) in values.iter_mut().zip(references) {
            *value = self.values[reference as usize % self.values.len()];
        }
        Ok(())
    }
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        for (&value, &reference) in values.iter().zip(references) {
            self.values[reference as usize] = value;
        }
        Ok(())
    }
    fn do_step(&mut self, _: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
        Ok(StepResult::Whole)
    }
}

/// The values of the names, all of the slave `b`, after a step.
pub(crate) fn after_step(system: System, names: &[&str]) -> Vec<f64> {
    let ports: Vec<_> =
        names.iter().map(|name| system.port(&format!("b.{name}")).unwrap()).collect();
    let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 1.0);
    let mut simulation = Simulation::new(system, &algorithm, &until(1.0)).unwrap();
    simulation.step().unwrap();
    let mut readout = Readout::new(simulation.system(), &ports);
    readout.read(simulation.system(), 1.0).unwrap();
    readout.reals
}
