//! An opened FMU, for instances in this process or in others.

use fmu_description::ModelDescription;
use fmu_import::{Fmu, isolate};

/// An opened FMU.
#[derive(Clone)]
pub(crate) enum Content {
    /// Its library is loaded into this process.
    Loaded(Fmu),
    /// Its instances run in processes of their own.
    Isolated(isolate::Package),
}

impl Content {
    pub(crate) fn description(&self) -> &ModelDescription {
        match self {
            Content::Loaded(fmu) => fmu.description(),
            Content::Isolated(package) => package.description(),
        }
    }

    /// Whether several runs of a process can use it.
    pub(crate) fn is_reusable(&self) -> bool {
        let description = self.description();
        let (simulation, exchange) = (description.stepped(), description.model_exchange.as_ref());
        let once = simulation.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process)
            || exchange.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process);
        !once || matches!(self, Content::Isolated(_))
    }
}
