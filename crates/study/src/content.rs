//! An opened FMU, for instances in this process or in separate processes.

use fmu_description::ModelDescription;
use fmu_import::{Fmu, isolate};

/// An opened FMU.
#[derive(Clone)]
pub(crate) enum Content {
    /// The library of the FMU is loaded into this process.
    Loaded(Fmu),
    /// Each instance runs in a separate process.
    Isolated(isolate::Package),
}

impl Content {
    pub(crate) fn description(&self) -> &ModelDescription {
        match self {
            Content::Loaded(fmu) => fmu.description(),
            Content::Isolated(package) => package.description(),
        }
    }

    /// Returns whether several runs of this process can use the FMU: the FMU can be instantiated several times per
    /// process, or the instances run in separate processes.
    pub(crate) fn is_reusable(&self) -> bool {
        let description = self.description();
        let (simulation, exchange) = (description.stepped(), description.model_exchange.as_ref());
        let once = simulation.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process)
            || exchange.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process);
        !once || matches!(self, Content::Isolated(_))
    }
}
