//! What the master asks of an FMU: the trait [`Slave`], whatever stands behind it.

use fmi2::Experiment;
use fmi2::abi::Status;
use fmi2::description::ModelDescription;

/// An instance of a co-simulation FMU, by the functions of FMI 2.0.5, sections 2.1 and 4.2.
///
/// Arrays that belong together have the same length. Every call either did what was asked
/// (`fmi2OK`, `fmi2Warning`) or is an error.
#[expect(clippy::missing_errors_doc, reason = "said at setup_experiment for all")]
pub trait Slave {
    /// The model description that the instance belongs to.
    fn description(&self) -> &ModelDescription;

    /// `fmi2SetupExperiment`.
    ///
    /// # Errors
    ///
    /// As every function here: [`CallError`] with the status and the FMU's own words.
    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError>;

    /// `fmi2EnterInitializationMode`.
    fn enter_initialization_mode(&mut self) -> Result<(), CallError>;

    /// `fmi2ExitInitializationMode`.
    fn exit_initialization_mode(&mut self) -> Result<(), CallError>;

    /// `fmi2Terminate`.
    fn terminate(&mut self) -> Result<(), CallError>;

    /// `fmi2GetReal`.
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError>;

    /// `fmi2SetReal`.
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError>;

    /// `fmi2GetInteger`, also for enumerations.
    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError>;

    /// `fmi2SetInteger`, also for enumerations.
    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError>;

    /// `fmi2GetBoolean`: 0 is false.
    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError>;

    /// `fmi2SetBoolean`: 0 is false.
    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError>;

    /// `fmi2SetString` of one variable.
    fn set_string(&mut self, reference: u32, value: &str) -> Result<(), CallError>;

    /// `fmi2SetRealInputDerivatives`, all of first order.
    fn set_input_slopes(&mut self, references: &[u32], slopes: &[f64]) -> Result<(), CallError>;

    /// `fmi2GetRealOutputDerivatives`, all of first order.
    fn get_output_slopes(
        &mut self,
        references: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), CallError>;

    /// `fmi2DoStep` from `time` over `size`, both in s.
    fn do_step(&mut self, time: f64, size: f64) -> Result<(), CallError>;
}

/// A call that an FMU refused or failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{function} returned {}{}", name(*.status), quoted(.messages))]
pub struct CallError {
    /// The function of the standard.
    pub function: &'static str,
    /// What it returned; none for a value that the standard does not know.
    pub status: Option<Status>,
    /// What the FMU said to the logger during the call.
    pub messages: Vec<String>,
}

fn name(status: Option<Status>) -> &'static str {
    status.map_or("an unknown status", Status::name)
}

fn quoted(messages: &[String]) -> String {
    if messages.is_empty() {
        " without a message".to_owned()
    } else {
        format!(": {}", messages.join("; "))
    }
}
