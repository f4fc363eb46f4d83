//! Configuration mode and reconfiguration mode: the importer changes the extents of arrays (sections
//! 2.3.6 and 2.3.7).

use super::super::Instance;
use crate::interface::Native;
use crate::interface::{Interface, Slot};
use crate::model::{Failure, Model};
use crate::stepper::Stepper;
use fmu_description::call_order::{InterfaceType, State};
use fmu_description::{Causality, Variability};

impl<M: Model> Instance<M> {
    /// Returns the slots of the structural parameters.
    fn structural_slots(&self) -> impl Iterator<Item = &Slot<M, u64>> {
        let all = u64::slots(&self.interface.typed).iter();
        all.filter(|slot| slot.causality == Causality::StructuralParameter)
    }

    /// Returns the values of the structural parameters.
    pub(super) fn structural_parameters(&mut self) -> Vec<u64> {
        let all = u64::slots(&self.interface.typed).iter();
        let structural = all.filter(|slot| slot.causality == Causality::StructuralParameter);
        let model = &mut self.core.model;
        structural.map(|slot| *(slot.field)(model)).collect()
    }

    /// `fmi3EnterConfigurationMode`: enters configuration mode or, after initialization, reconfiguration mode. An error
    /// without structural parameters, and for reconfiguration mode without tunable ones.
    pub(crate) fn enter_configuration_mode(&mut self) -> Result<(), Failure> {
        if self.structural_slots().next().is_none() {
            return Err(Failure::Error("this FMU has no structural parameters".to_owned()));
        }
        if self.core.state == State::Instantiated {
            self.core.state = State::ConfigurationMode;
            return Ok(());
        }
        if self.structural_slots().all(|slot| slot.variability != Variability::Tunable) {
            let message = "no structural parameter of this FMU is tunable: set them before \
                           fmi3EnterInitializationMode";
            return Err(Failure::Error(message.to_owned()));
        }
        self.core.state = State::ReconfigurationMode;
        Ok(())
    }

    /// `fmi3ExitConfigurationMode`: resizes the arrays of the model, and lays the variables out again.
    pub(crate) fn exit_configuration_mode(&mut self) -> Result<(), Failure> {
        self.core.model.resize()?;
        self.core.state = match (self.core.state, self.core.interface_type) {
            (State::ConfigurationMode, _) => State::Instantiated,
            (_, InterfaceType::ModelExchange) => State::EventMode,
            (_, InterfaceType::CoSimulation) => State::StepComplete,
        };
        (self.core.stale, self.core.unchecked) = (true, true);
        self.fit_layout()
    }

    /// Lays the variables out again if the structural parameters have other values than at the last layout. Does
    /// nothing in FMI 2.0 and in configuration and reconfiguration mode.
    pub(in super::super) fn fit_layout(&mut self) -> Result<(), Failure> {
        let Some(lay_out) = self.lay_out else { return Ok(()) };
        // In these modes arrays still have their former extents, and no function accesses them.
        let is_open =
            matches!(self.core.state, State::ConfigurationMode | State::ReconfigurationMode);
        if is_open || self.session.as_ref().is_none_or(|session| session.structural.is_empty()) {
            return Ok(());
        }
        let structural = self.structural_parameters();
        if self.session()?.structural == structural { Ok(()) } else { lay_out(self, structural) }
    }

    /// Lays the variables out for these values of the structural parameters. An error if the model then has other
    /// variables than before.
    pub(super) fn lay_out(&mut self, structural: Vec<u64>) -> Result<(), Failure> {
        let (mut interface, description) = Interface::new(&mut self.core.model)?;
        let (table, _) = interface.convert(&description, self.core.interface_type)?;
        interface.guid = self.interface.guid;
        let inputs = interface.interpolated.len();
        let session = self.session_mut()?;
        if !table.has_variables_of(&session.table) {
            let message = "after the structural parameters were set, the model has other variables than \
                           in its description";
            return Err(Failure::Error(message.to_owned()));
        }
        session.table = table;
        session.structural = structural;
        if let Some(intermediate) = &mut session.intermediate {
            intermediate.resize(inputs);
        }
        self.stepper = Stepper::new(&interface, description.default_experiment);
        self.interface = interface;
        self.direction = None;
        Ok(())
    }
}
