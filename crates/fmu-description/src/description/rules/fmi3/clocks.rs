//! Rules on clocks and clocked variables (sections 2.4.4 and 2.4.7.4).

use std::collections::HashSet;

use crate::description::rules::Problems;
use crate::description::{
    Causality, ClockType, IntervalVariability, Kind, ScalarVariable, Variability,
};

const TYPES: &str = "2.4.4";
const VARIABLES: &str = "2.4.7.4";

pub(super) fn check(problems: &mut Problems<'_>) {
    let description = problems.description;
    let mut previous = HashSet::new();
    for variable in description.variables.iter().filter(|variable| variable.alias_of.is_none()) {
        if let Kind::Clock(clock) = &variable.kind {
            check_clock(variable, problems);
            check_interval(variable, clock, problems);
            let (input, priority) =
                (variable.causality == Causality::Input, clock.priority.is_some());
            let needed = description.scheduled_execution.is_some() && input;
            problems.demand(priority || !needed, TYPES, || {
                format!("clock {} needs a priority for ScheduledExecution", variable.name)
            });
            problems.demand(input || !priority, TYPES, || {
                format!("clock {}: only input clocks have a priority", variable.name)
            });
        }
        check_clocks(variable, problems);
        if let Some(index) = variable.previous {
            problems.demand(previous.insert(index), VARIABLES, || {
                let name = &variable.name;
                format!("variable {name}: another variable has the same previous")
            });
            check_previous(variable, index, problems);
        }
    }
}

/// Checks the causality and the variability of a clock.
fn check_clock(variable: &ScalarVariable, problems: &mut Problems<'_>) {
    use Causality::{Input, Local, Output};
    let name = &variable.name;
    let role = matches!(variable.causality, Input | Output | Local);
    problems.demand(role, VARIABLES, || {
        format!("clock {name}: a clock must be an input, output or local")
    });
    problems.demand(variable.variability == Variability::Discrete, VARIABLES, || {
        format!("clock {name}: a clock must be discrete")
    });
}

/// Checks the attributes of the interval and the shift of a clock.
fn check_interval(variable: &ScalarVariable, clock: &ClockType, problems: &mut Problems<'_>) {
    use IntervalVariability::{Constant, Fixed, Tunable};
    let name = &variable.name;
    let periodic = matches!(clock.interval_variability, Constant | Fixed | Tunable);
    let has_interval = clock.interval_decimal.is_some();
    let counted = clock.interval_counter.is_some();
    let mut demand = |holds: bool, text: &str| {
        problems.demand(holds, TYPES, || format!("clock {name}: {text}"));
    };
    // Section 2.4.4 requires the interval of every periodic clock; by section 2.2.8.2 the functions
    // `fmi3GetInterval...` return the interval of fixed and tunable clocks.
    let constant = clock.interval_variability == Constant;
    demand(has_interval || !constant, "a constant clock needs intervalDecimal");
    demand(periodic || !has_interval, "only a periodic clock has intervalDecimal");
    let positive = |seconds: f64| seconds > 0.0 && seconds.is_finite();
    demand(clock.interval_decimal.is_none_or(positive), "intervalDecimal is not positive");
    demand(has_interval || clock.shift_decimal.is_none(), "shiftDecimal needs intervalDecimal");
    let not_negative = |seconds: f64| seconds >= 0.0 && seconds.is_finite();
    demand(clock.shift_decimal.is_none_or(not_negative), "shiftDecimal is negative");
    demand(
        !counted || periodic && clock.supports_fraction,
        "intervalCounter needs a periodic clock with supportsFraction",
    );
    demand(clock.interval_counter != Some(0), "intervalCounter is 0");
    demand(!counted || clock.resolution.is_some(), "intervalCounter needs resolution");
    demand(clock.resolution != Some(0), "resolution is 0");
    demand(periodic || clock.resolution.is_none(), "only a periodic clock has resolution");
    demand(counted || clock.shift_counter.is_none(), "shiftCounter needs intervalCounter");
}

/// Checks the attribute `clocks`: the references are clocks, and only a discrete or tunable variable has the attribute.
fn check_clocks(variable: &ScalarVariable, problems: &mut Problems<'_>) {
    let description = problems.description;
    let name = &variable.name;
    for index in &variable.clocks {
        let clock = description.at(*index);
        problems.demand(
            clock.is_some_and(|variable| matches!(variable.kind, Kind::Clock(_))),
            VARIABLES,
            || {
                let other = description.name_of(*index);
                format!("variable {name}: clocks refers to {other}, which is no Clock")
            },
        );
    }
    let fits = matches!(variable.variability, Variability::Discrete | Variability::Tunable);
    problems.demand(fits || variable.clocks.is_empty(), VARIABLES, || {
        format!("variable {name}: only discrete and tunable variables can be clocked")
    });
}

/// Checks the attribute `previous`, the 1-based index `index`, of a clocked variable.
fn check_previous(variable: &ScalarVariable, index: u32, problems: &mut Problems<'_>) {
    let description = problems.description;
    let name = &variable.name;
    let is_allowed = !variable.clocks.is_empty()
        && variable.variability == Variability::Discrete
        && !matches!(variable.kind, Kind::Clock(_));
    problems.demand(is_allowed, VARIABLES, || {
        format!("variable {name}: only discrete clocked variables can have previous")
    });
    let fits = |other: &ScalarVariable| {
        !std::ptr::eq(other, variable)
            && other.kind.element() == variable.kind.element()
            && other.variability == Variability::Discrete
            && other.causality != Causality::Input
    };
    problems.demand(description.at(index).is_some_and(fits), VARIABLES, || {
        let other = description.name_of(index);
        format!(
            "variable {name}: previous must refer to another discrete variable of its type that is \
             no input, it refers to {other}"
        )
    });
}
