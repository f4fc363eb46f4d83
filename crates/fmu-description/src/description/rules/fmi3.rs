//! The rules of FMI 3.0.2.

mod arrays;
mod clocks;
mod structure;
mod variables;

use super::{Interface, Problems, check_date, interfaces, is_c_identifier};
use crate::description::{CoSimulation, Kind};

pub(super) use structure::check as check_structure;
pub(super) use variables::check as check_variables;

/// Checks version, instantiation token, date and interfaces by the rules of FMI 3.0.
pub(super) fn check_identity(problems: &mut Problems<'_>) {
    const ROOT: &str = "2.4.1";
    let description = problems.description;
    let version = &description.fmi_version;
    problems.demand(version == "3.0", ROOT, || {
        format!("fmiVersion is {version:?}, it must be \"3.0\" for every 3.0.x")
    });
    let token = &description.guid;
    problems.demand(!token.is_empty(), ROOT, || "instantiationToken is empty".to_owned());
    check_date(problems);
    let interfaces: Vec<_> = interfaces(description).collect();
    problems.demand(!interfaces.is_empty(), ROOT, || {
        "none of ModelExchange, CoSimulation and ScheduledExecution is there".to_owned()
    });
    for Interface { name, identifier, has_state, serializes, .. } in interfaces {
        problems.demand(is_c_identifier(identifier), "2.4.2", || {
            format!("{name}: modelIdentifier {identifier:?} is no C identifier")
        });
        problems.demand(has_state || !serializes, "2.4.2", || {
            format!("{name}: canSerializeFMUState is true without canGetAndSetFMUState")
        });
    }
    if let Some(flags) = &description.co_simulation {
        check_co_simulation(flags, problems);
    }
}

fn check_co_simulation(flags: &CoSimulation, problems: &mut Problems<'_>) {
    const SECTION: &str = "4.4";
    let returns = flags.can_return_early_after_intermediate_update;
    problems.demand(flags.provides_intermediate_update || !returns, SECTION, || {
        "canReturnEarlyAfterIntermediateUpdate is true without providesIntermediateUpdate"
            .to_owned()
    });
    let variables = &problems.description.variables;
    let clocked = variables.iter().any(|variable| matches!(variable.kind, Kind::Clock(_)));
    problems.demand(flags.has_event_mode || !clocked, SECTION, || {
        "there are clocks, and hasEventMode is false".to_owned()
    });
    if let Some(step) = flags.fixed_internal_step_size {
        problems.demand(step > 0.0 && step.is_finite(), SECTION, || {
            format!("fixedInternalStepSize is {step:?}, not positive and finite")
        });
    }
}
