//! The settings of a run that a resumed run must share.

use fmu_description::Experiment;
use serde::{Deserialize, Serialize};

use crate::algorithm::{Algorithm, Coupling, StepControl};
use crate::error::SystemError;
use crate::system::System;

/// Start time, stop time of the FMUs, and the settings of the algorithm on which the state depends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::simulation) struct Origin {
    /// The stop time in s that the FMUs received in `fmi2SetupExperiment`.
    pub(in crate::simulation) stop_time: Option<f64>,
    /// Names and values of the settings, with units.
    settings: Vec<(String, String)>,
}

impl Origin {
    pub(in crate::simulation) fn new(
        system: &System,
        algorithm: &Algorithm,
        experiment: &Experiment,
    ) -> Self {
        let settings = settings(system, algorithm, experiment).into_iter();
        Self {
            stop_time: experiment.stop_time,
            settings: settings.map(|(name, value)| (name.to_owned(), value)).collect(),
        }
    }

    /// Returns an error if a setting of a `requested` run differs. Settings that the checkpoint does not have are not
    /// compared.
    pub(in crate::simulation) fn expect(&self, requested: &Self) -> Result<(), SystemError> {
        for (name, requested) in &requested.settings {
            let known = self.settings.iter().find(|(known, _)| known == name);
            if let Some((_, saved)) = known.filter(|(_, saved)| saved != requested) {
                let [name, saved, requested] = [name, saved, requested].map(String::clone);
                return Err(SystemError::Resume { name, saved, requested });
            }
        }
        Ok(())
    }
}

/// Returns the settings under their names in the configuration file. Settings that select an
/// algorithm precede the parameters of the algorithm.
fn settings(
    system: &System,
    algorithm: &Algorithm,
    experiment: &Experiment,
) -> Vec<(&'static str, String)> {
    let seconds = |value: f64| format!("{value} s");
    let mut all = vec![
        ("start-time", seconds(experiment.start_time)),
        ("step", seconds(algorithm.step)),
        ("method", algorithm.method.name().to_owned()),
        ("extrapolation", algorithm.extrapolation.name().to_owned()),
        ("coupling", algorithm.coupling.name().to_owned()),
        ("step-control", algorithm.control.name().to_owned()),
        ("every", multiples(system, &algorithm.multiples)),
    ];
    let iterated = algorithm.coupling != Coupling::Once;
    let chosen = algorithm.control != StepControl::Fixed;
    if iterated || chosen {
        all.push(("relative-tolerance", algorithm.relative_tolerance.to_string()));
        all.push(("absolute-tolerance", algorithm.absolute_tolerance.to_string()));
    }
    if iterated {
        all.push(("iterations", algorithm.iterations.to_string()));
    }
    if chosen {
        all.push(("smallest-step", seconds(algorithm.smallest_step)));
        all.push(("largest-step", seconds(algorithm.largest_step)));
        let name = |bond: &crate::algorithm::PowerBond| {
            format!("{} and {}", system.name(bond.first), system.name(bond.second))
        };
        let bonds: Vec<_> = algorithm.bonds.iter().map(name).collect();
        all.push(("power-bonds", bonds.join(", ")));
    }
    all
}

fn multiples(system: &System, multiples: &[u32]) -> String {
    let slaves = system.slaves.iter().zip(multiples).filter(|(_, multiple)| **multiple != 1);
    let all: Vec<_> = slaves.map(|((name, _), multiple)| format!("{name}={multiple}")).collect();
    if all.is_empty() { "none".to_owned() } else { all.join(", ") }
}
