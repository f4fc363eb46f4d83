//! The clocks of clocked variables.

use crate::model::Failure;
use crate::variable::Declaration;
use fmu_description::{Kind, ModelDescription};

/// The clocked variables of a model, by name, with the names of their clocks.
pub(crate) struct Clocks(Vec<(String, Vec<String>)>);

impl Clocks {
    pub(super) fn of(variables: &[Declaration]) -> Self {
        let clocked = variables.iter().filter(|variable| !variable.clocks.is_empty());
        Self(clocked.map(|variable| (variable.name.clone(), variable.clocks.clone())).collect())
    }

    /// Whether any variable is clocked.
    pub(crate) fn any(&self) -> bool {
        !self.0.is_empty()
    }

    /// Sets `clocks` of the variables of a description of FMI 3.0. An error for a name that is not the name of a clock.
    pub(super) fn enter(&self, description: &mut ModelDescription) -> Result<(), Failure> {
        for (name, clocks) in &self.0 {
            let index = |clock: &String| {
                let is_clock = |(_, variable): &(u32, &fmu_description::ScalarVariable)| {
                    variable.name == *clock && matches!(variable.kind, Kind::Clock(_))
                };
                let variable = (1..).zip(&description.variables).find(is_clock);
                variable
                    .map(|(index, _)| index)
                    .ok_or_else(|| Failure::Error(format!("variable {name}: {clock} is no clock")))
            };
            let clocks = clocks.iter().map(index).collect::<Result<Vec<_>, _>>()?;
            if let Some(variable) =
                description.variables.iter_mut().find(|variable| variable.name == *name)
            {
                variable.clocks = clocks;
            }
        }
        Ok(())
    }
}
