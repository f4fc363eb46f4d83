//! The trait [`ModelExchange`]: the functions that an integrator calls.

use serde::{Deserialize, Serialize};

use crate::{CallError, Slave, absent};

/// An instance of a model-exchange FMU (FMI 2.0.5, section 3.2; FMI 3.0, section 3), whose states the importer
/// integrates. Where the versions differ, the functions are named after FMI 3.0.
///
/// [`Slave`] has the functions that both interfaces share; its `do_step` and its input and output derivatives return
/// [`Failure::Missing`](crate::Failure::Missing).
#[expect(clippy::missing_errors_doc, reason = "CallError as for every function of Slave")]
pub trait ModelExchange: Slave {
    /// Returns the number of continuous states: the number of entries of `ModelStructure/Derivatives`, or
    /// `fmi3GetNumberOfContinuousStates`. Call it after initialization mode.
    fn number_of_continuous_states(&mut self) -> Result<usize, CallError> {
        Ok(self.description().structure.derivatives.len())
    }

    /// Returns the number of event indicators: `numberOfEventIndicators` (0 if not stated), or
    /// `fmi3GetNumberOfEventIndicators`. Call it after initialization mode.
    fn number_of_event_indicators(&mut self) -> Result<usize, CallError> {
        Ok(self.description().number_of_event_indicators.unwrap_or(0) as usize)
    }

    /// Whether [`ModelExchange::completed_integrator_step`] must be called after every step.
    fn needs_completed_integrator_step(&self) -> bool {
        true
    }

    /// Starts a communication step: [`Slave::get_boolean`] forgets the ticks of clocks before this step.
    fn begin_communication_step(&mut self) {}

    /// `fmi2SetTime`: sets the time in s.
    fn set_time(&mut self, time: f64) -> Result<(), CallError>;

    /// `fmi2SetContinuousStates`.
    fn set_continuous_states(&mut self, states: &[f64]) -> Result<(), CallError>;

    /// `fmi2GetContinuousStates`.
    fn get_continuous_states(&mut self, states: &mut [f64]) -> Result<(), CallError>;

    /// `fmi2GetDerivatives`: the derivatives of the continuous states with respect to time.
    fn get_derivatives(&mut self, derivatives: &mut [f64]) -> Result<(), CallError>;

    /// `fmi2GetEventIndicators`: a state event is a change between z > 0 and z <= 0.
    fn get_event_indicators(&mut self, indicators: &mut [f64]) -> Result<(), CallError>;

    /// `fmi2GetNominalsOfContinuousStates`. The default returns [`Failure::Missing`](crate::Failure::Missing).
    fn get_nominals_of_continuous_states(&mut self, nominals: &mut [f64]) -> Result<(), CallError> {
        let _ = nominals;
        Err(absent("fmi2GetNominalsOfContinuousStates"))
    }

    /// `fmi2CompletedIntegratorStep`. `never_back` is `noSetFMUStatePriorToCurrentPoint`.
    fn completed_integrator_step(&mut self, never_back: bool) -> Result<CompletedStep, CallError>;

    /// `fmi2EnterEventMode`.
    fn enter_event_mode(&mut self) -> Result<(), CallError>;

    /// `fmi2NewDiscreteStates`, `fmi3UpdateDiscreteStates`: one iteration of an event.
    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError>;

    /// `fmi2EnterContinuousTimeMode`.
    fn enter_continuous_time_mode(&mut self) -> Result<(), CallError>;
}

/// The result of [`ModelExchange::completed_integrator_step`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CompletedStep {
    /// `enterEventMode`: a step event.
    pub enter_event_mode: bool,
    /// `terminateSimulation`.
    pub terminate_simulation: bool,
}

/// The result of [`ModelExchange::update_discrete_states`] and [`Events::update_discrete_states`](crate::Events).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "the flags of the standard, one for one")]
pub struct EventInfo {
    /// `newDiscreteStatesNeeded`: call [`ModelExchange::update_discrete_states`] again.
    pub discrete_states_need_update: bool,
    /// `terminateSimulation`.
    pub terminate_simulation: bool,
    /// `nominalsOfContinuousStatesChanged`.
    pub nominals_changed: bool,
    /// `valuesOfContinuousStatesChanged`.
    pub values_changed: bool,
    /// `nextEventTime` in s, if defined.
    pub next_event_time: Option<f64>,
}
