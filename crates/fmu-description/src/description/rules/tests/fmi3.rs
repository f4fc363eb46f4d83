//! FMI 3.0.2.

use super::*;
use crate::description::{BinaryType, Dimension, Elements, IntervalVariability};

/// The problems of the sample after `change`; there must be exactly one, in `section`.
fn only_problem(section: &str, change: impl FnOnce(&mut ModelDescription)) -> String {
    only_problem_of(sample::complete_3(), section, change)
}

/// Expects one problem, in `section` and with `text`, if the attributes of `name` change.
fn problem_of(name: &str, section: &str, text: &str, change: impl FnOnce(&mut ScalarVariable)) {
    let actual = only_problem(section, |description| change(variable(description, name)));
    assert!(actual.contains(text), "{actual} has not {text}");
}

fn real_of(variable: &mut ScalarVariable) -> &mut RealType {
    variable.kind.as_real_mut().expect("a float")
}

fn clock_problem(name: &str, text: &str, change: impl FnOnce(&mut crate::description::ClockType)) {
    let actual = only_problem("2.4.4", |description| match &mut variable(description, name).kind {
        Kind::Clock(clock) => change(clock),
        other => panic!("{other:?}"),
    });
    assert!(actual.contains(text), "{actual} has not {text}");
}

#[test]
fn a_correct_description_of_fmi_3_has_no_problems() {
    assert_eq!(sample::complete_3().problems(), []);
}

#[test]
fn identity_and_capabilities_are_checked() {
    only_problem("2.4.1", |description| description.fmi_version = "3.0.2".into());
    only_problem("2.4.1", |description| description.guid.clear());
    only_problem("2.4.1", |description| {
        description.generation_date_and_time = Some("yesterday".into());
    });
    only_problem("2.4.1", |description| {
        (description.model_exchange, description.co_simulation) = (None, None);
        description.scheduled_execution = None;
    });
    only_problem("2.4.2", |description| {
        description.model_exchange.as_mut().unwrap().model_identifier = "a-b".into();
    });
    only_problem("2.4.2", |description| {
        description.co_simulation.as_mut().unwrap().can_get_and_set_fmu_state = false;
    });
    only_problem("4.4", |description| {
        description.co_simulation.as_mut().unwrap().provides_intermediate_update = false;
    });
    only_problem("4.4", |description| {
        description.co_simulation.as_mut().unwrap().has_event_mode = false;
    });
    only_problem("4.4", |description| {
        description.co_simulation.as_mut().unwrap().fixed_internal_step_size = Some(0.0);
    });
}

#[test]
fn definitions_have_the_sections_of_fmi_3() {
    only_problem("2.4.3", |description| description.units[0].display_units[0].factor = 0.0);
    only_problem("2.4.4", |description| description.types[7].items[1].1 = i64::MIN);
    only_problem("2.4.5", |description| {
        description.log_categories[1].name = "logStatusError".into();
    });
    only_problem("2.4.6", |description| {
        description.default_experiment.as_mut().unwrap().tolerance = Some(-1.0);
    });
    only_problem("2.4.7.5.1", |description| variable(description, "u").name = "a b".into());
}

#[test]
fn roles_follow_the_tables() {
    problem_of("A", "2.4.7.4", "a parameter cannot be discrete", |variable| {
        variable.variability = Variability::Discrete;
    });
    problem_of(
        "n",
        "2.4.7.5",
        "initial approx is not allowed for tunable structuralParameter",
        |variable| {
            variable.initial = Some(Initial::Approx);
        },
    );
    problem_of("u", "2.4.7.5", "initial calculated is not allowed", |variable| {
        variable.initial = Some(Initial::Calculated);
    });
    problem_of("alarm", "2.4.7.5", "initial exact is not allowed", |variable| {
        variable.initial = Some(Initial::Exact);
    });
    problem_of("y", "2.4.7.4", "only inputs have canHandleMultipleSetPerTimeInstant", |variable| {
        variable.can_handle_multiple_set_per_time_instant = Some(true);
    });
    problem_of("held", "2.4.7.4", "can have intermediateUpdate", |variable| {
        variable.intermediate_update = true;
    });
    problem_of("indicators", "2.4.7.5", "can have reinit", |variable| {
        real_of(variable).reinit = true;
    });
}

#[test]
fn there_is_exactly_one_independent_variable() {
    let text = only_problem("2.4.7.4", |description| {
        let second = variable(description, "time").clone();
        let name = "other".to_owned();
        description.variables.push(ScalarVariable { name, value_reference: 99, ..second });
    });
    assert!(text.contains("2 variables are independent"), "{text}");
    problem_of("time", "2.4.7.4", "must be a scalar Float", |variable| {
        variable.dimensions = vec![Dimension::Fixed(1)];
    });
}

#[test]
fn start_values_are_there_and_are_numbers_of_the_type() {
    problem_of("u", "2.4.7.5", "needs a start value", |variable| real_of(variable).start = None);
    problem_of("y", "2.4.7.5", "has a start value", |variable| real_of(variable).start = Some(0.0));
    problem_of("A", "2.4.7.5", "start 5e-324 is above max 0.0", |variable| {
        variable.start_elements = Some(Elements::Real(vec![0.0, -1.0, 5e-324, 0.0]));
        real_of(variable).max = Some(0.0);
    });
    problem_of("u8", "2.4.7.5", "256 is no number of type UInt8, 0 to 255", |variable| {
        variable.kind.as_integer_mut().unwrap().start = Some(256);
    });
    problem_of("i8", "2.4.7.5", "start -1", |variable| {
        variable.kind.as_integer_mut().unwrap().start = Some(-1);
    });
    problem_of("mode", "2.4.7.5", "no item of type Mode", |variable| {
        variable.kind.as_integer_mut().unwrap().start = Some(0);
    });
    problem_of("i16", "2.4.7.5", "there is no type \"Nothing\"", |variable| {
        variable.kind.as_integer_mut().unwrap().declared_type = Some("Nothing".into());
    });
    problem_of("blob", "2.4.7.5", "longer than maxSize", |variable| match &mut variable.kind {
        Kind::Binary(variable) => variable.max_size = Some(2),
        other => panic!("{other:?}"),
    });
    problem_of("blob", "2.4.7.5", "longer than maxSize", |variable| {
        variable.dimensions = vec![Dimension::Fixed(2)];
        variable.start_elements = Some(Elements::Binary(vec![vec![1, 2], vec![1, 2, 3]]));
        variable.kind = Kind::Binary(BinaryType { max_size: Some(2), ..BinaryType::default() });
    });
}

#[test]
fn arrays_have_extents_and_as_many_start_values() {
    problem_of("A", "2.4.7.2", "4 start values for 6 elements", |variable| {
        variable.dimensions[1] = Dimension::Fixed(3);
    });
    problem_of("gains", "2.4.7.2", "starts with size 0", |variable| {
        variable.dimensions = vec![Dimension::Fixed(0)];
    });
    problem_of("gains", "2.4.7.2", "refers to 5, which is no constant", |variable| {
        variable.dimensions = vec![Dimension::Variable(5)];
    });
    problem_of("n", "2.4.7.2", "a structural parameter cannot be an array", |variable| {
        variable.dimensions = vec![Dimension::Fixed(1)];
    });
    problem_of("tick", "2.4.7.2", "a Clock cannot be an array", |variable| {
        variable.dimensions = vec![Dimension::Fixed(1)];
    });
    problem_of("der(x)", "2.4.7.5", "of equal dimensions", |variable| {
        variable.dimensions = vec![Dimension::Fixed(2)];
    });
}

#[test]
fn only_aliases_share_a_value_reference() {
    problem_of("u16", "2.4.7.4", "variables u8 and u16 have the value reference 6", |variable| {
        variable.value_reference = 6;
    });
    problem_of("phi", "2.4.7.3", "alias phi: there is no variable x", |variable| {
        variable.value_reference = 17;
    });
    problem_of("phi", "2.4.7.3", "there is no variable u", |variable| {
        variable.alias_of = Some("u".into());
    });
}

#[test]
fn clocks_and_clocked_variables_are_checked() {
    clock_problem("alarm", "only a periodic clock has intervalDecimal", |clock| {
        clock.interval_decimal = Some(1.0);
    });
    clock_problem("tick", "intervalDecimal is not positive", |clock| {
        clock.interval_decimal = Some(0.0);
    });
    clock_problem("tick", "needs a periodic clock with supportsFraction", |clock| {
        clock.supports_fraction = false;
    });
    clock_problem("tick", "intervalCounter needs resolution", |clock| clock.resolution = None);
    clock_problem("tick", "shiftDecimal is negative", |clock| clock.shift_decimal = Some(-1.0));
    clock_problem("alarm", "shiftCounter needs intervalCounter", |clock| {
        clock.shift_counter = Some(1);
    });
    clock_problem("alarm", "only input clocks have a priority", |clock| clock.priority = Some(1));
    clock_problem("tick", "needs a priority for ScheduledExecution", |clock| clock.priority = None);
    problem_of("tick", "2.4.7.4", "a clock must be discrete", |variable| {
        (variable.causality, variable.variability) = (Causality::Local, Variability::Tunable);
        match &mut variable.kind {
            Kind::Clock(clock) => clock.priority = None,
            other => panic!("{other:?}"),
        }
    });
    problem_of("sum", "2.4.7.4", "clocks refers to u, which is no Clock", |variable| {
        variable.clocks = vec![18];
    });
    problem_of("y", "2.4.7.4", "only discrete and tunable variables can be clocked", |variable| {
        variable.clocks = vec![25];
    });
    problem_of("held", "2.4.7.4", "previous must refer to another discrete variable", |variable| {
        variable.previous = Some(18);
    });
    problem_of(
        "held",
        "2.4.7.4",
        "only discrete clocked variables can have previous",
        |variable| {
            variable.clocks.clear();
        },
    );
    let changing = IntervalVariability::Changing;
    let mut description = sample::complete_3();
    if let Kind::Clock(clock) = &mut variable(&mut description, "alarm").kind {
        clock.interval_variability = changing;
    }
    assert_eq!(description.problems(), []);
}

#[test]
fn the_structure_lists_what_it_must() {
    let row = |index| Unknown { index, ..Unknown::default() };
    for (text, change) in [
        (
            "Output lacks variable y",
            (|description: &mut ModelDescription| {
                description.structure.outputs.pop();
            }) as fn(&mut ModelDescription),
        ),
        ("InitialUnknown lacks variable sum", |description| {
            description.structure.initial_unknowns.remove(1);
        }),
        ("ClockedState lacks variable held", |description| {
            description.structure.clocked_states.clear();
        }),
        ("Output, x: a dependency on y cannot be stated", |description| {
            let y = description.variables.len().try_into().unwrap();
            description.structure.outputs[0].dependencies = Some(vec![y]);
        }),
        ("Output, y: dependenciesKind is not as long", |description| {
            description.structure.outputs[3].kinds = Some(vec![DependencyKind::Fixed]);
        }),
        ("dependenciesKind may be dependent or constant only", |description| {
            description.structure.initial_unknowns[2].kinds =
                Some(vec![DependencyKind::Tunable, DependencyKind::Dependent]);
        }),
        ("Output, alarm: only for a float", |description| {
            description.structure.outputs[1].kinds =
                Some(vec![DependencyKind::Dependent, DependencyKind::Constant]);
        }),
    ] {
        let actual = only_problem("2.4.8", change);
        assert!(actual.contains(text), "{actual} has not {text}");
    }
    let actual =
        only_problem("2.4.8", |description| description.structure.event_indicators.push(row(6)));
    assert!(actual.contains("EventIndicator, i8"), "{actual}");
    // Clocked variables are allowed in `InitialUnknown`, but not required.
    let mut description = sample::complete_3();
    let held = description.variables.iter().position(|variable| variable.name == "held").unwrap();
    description.structure.initial_unknowns.push(row(u32::try_from(held).unwrap() + 1));
    assert_eq!(description.problems(), []);
}
