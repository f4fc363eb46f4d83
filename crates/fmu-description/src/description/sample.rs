//! A model description for tests that uses every element and attribute and breaks no rule.

use super::{
    Causality, CoSimulation, DefaultExperiment, DependencyKind, Initial, IntegerType, Kind,
    LogCategory, ModelDescription, ModelExchange, ModelStructure, RealType, ScalarVariable,
    SimpleType, Unknown, Variability,
};
use crate::unit::Unit;

pub(crate) fn complete() -> ModelDescription {
    let text = |text: &str| Some(text.to_owned());
    ModelDescription {
        fmi_version: "2.0".to_owned(),
        model_name: "Sample.<Model> & \"quotes\"".to_owned(),
        guid: "{a guid}".to_owned(),
        description: text("first line\nsecond\tline \u{3b1}\u{1f600}"),
        author: text("A. Author"),
        version: text("1.0"),
        copyright: text("\u{a9} A. Author"),
        license: text("MIT"),
        generation_tool: text("a tool"),
        generation_date_and_time: text("2026-11-20T23:59:59Z"),
        structured_names: true,
        number_of_event_indicators: Some(2),
        model_exchange: Some(all_exchange_capabilities()),
        co_simulation: Some(all_capabilities()),
        units: ["kg", "N", "rad", "rad/s", "degC", "1"]
            .map(|name| Unit::parse(name).unwrap())
            .to_vec(),
        types: types(),
        log_categories: vec![
            LogCategory { name: "logStatusError".to_owned(), description: text("errors") },
            LogCategory { name: "logEvents".to_owned(), description: None },
        ],
        default_experiment: Some(DefaultExperiment {
            start_time: Some(-1.0),
            stop_time: Some(100.0),
            tolerance: Some(1e-9),
            step_size: Some(0.001),
        }),
        variables: variables(),
        structure: structure(),
        ..ModelDescription::default()
    }
}

fn all_exchange_capabilities() -> ModelExchange {
    ModelExchange {
        model_identifier: "sample_me".to_owned(),
        needs_execution_tool: true,
        completed_integrator_step_not_needed: true,
        can_be_instantiated_only_once_per_process: true,
        can_not_use_memory_management_functions: true,
        can_get_and_set_fmu_state: true,
        can_serialize_fmu_state: true,
        provides_directional_derivative: true,
        source_files: vec!["all.c".to_owned(), "a & b.c".to_owned()],
        ..ModelExchange::default()
    }
}

fn all_capabilities() -> CoSimulation {
    CoSimulation {
        model_identifier: "sample".to_owned(),
        needs_execution_tool: true,
        can_handle_variable_communication_step_size: true,
        can_interpolate_inputs: true,
        max_output_derivative_order: 2,
        can_run_asynchronuously: true,
        can_be_instantiated_only_once_per_process: true,
        can_not_use_memory_management_functions: true,
        can_get_and_set_fmu_state: true,
        can_serialize_fmu_state: true,
        provides_directional_derivative: true,
        source_files: vec!["all.c".to_owned(), "a & b.c".to_owned()],
        ..CoSimulation::default()
    }
}

fn types() -> Vec<SimpleType> {
    let plain = |name: &str, kind| SimpleType {
        name: name.to_owned(),
        description: None,
        kind,
        items: Vec::new(),
    };
    let angle = RealType {
        quantity: Some("Angle".to_owned()),
        unit: Some("rad".to_owned()),
        display_unit: Some("deg".to_owned()),
        min: Some(-10.0),
        max: Some(10.0),
        nominal: Some(0.1),
        relative_quantity: Some(true),
        ..RealType::default()
    };
    let count = IntegerType { min: Some(0), max: Some(i32::MAX.into()), ..IntegerType::default() };
    let mode = IntegerType { quantity: Some("Mode".to_owned()), ..IntegerType::default() };
    vec![
        SimpleType {
            description: Some("an angle".to_owned()),
            ..plain("Angle", Kind::Real(angle))
        },
        plain("Count", Kind::Integer(count)),
        plain("Flag", Kind::Boolean(None)),
        plain("Text", Kind::String(None)),
        SimpleType {
            items: vec![("off".to_owned(), -1), ("on".to_owned(), 1)],
            ..plain("Mode", Kind::Enumeration(mode))
        },
    ]
}

/// A Real variable with causality, variability and start value, and the value reference 0.
pub(crate) fn real(
    name: &str,
    causality: Causality,
    variability: Variability,
    start: Option<f64>,
) -> ScalarVariable {
    let kind = Kind::Real(RealType { start, ..RealType::default() });
    other(name, causality, variability, kind)
}

pub(crate) fn other(
    name: &str,
    causality: Causality,
    variability: Variability,
    kind: Kind,
) -> ScalarVariable {
    ScalarVariable {
        name: name.to_owned(),
        causality,
        variability,
        kind,
        ..ScalarVariable::default()
    }
}

/// The state `x`, with every attribute of a Real except `derivative`.
fn state() -> ScalarVariable {
    let kind = Kind::Real(RealType {
        declared_type: Some("Angle".to_owned()),
        quantity: Some("Angle".to_owned()),
        unit: Some("rad".to_owned()),
        display_unit: Some("deg".to_owned()),
        min: Some(-3.5),
        max: Some(10.0),
        nominal: Some(0.1),
        start: Some(0.25),
        derivative: None,
        reinit: true,
        relative_quantity: Some(false),
    });
    ScalarVariable {
        initial: Some(Initial::Exact),
        description: Some("a state".to_owned()),
        ..other("x", Causality::Output, Variability::Continuous, kind)
    }
}

fn variables() -> Vec<ScalarVariable> {
    use Causality::{CalculatedParameter, Independent, Input, Local, Output, Parameter};
    use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
    let count = IntegerType {
        declared_type: Some("Count".to_owned()),
        min: Some(0),
        max: Some(7),
        ..IntegerType::default()
    };
    let mode = IntegerType {
        declared_type: Some("Mode".to_owned()),
        quantity: Some("Mode".to_owned()),
        start: Some(-1),
        ..IntegerType::default()
    };
    let speed = Kind::Real(RealType { derivative: Some(7), ..RealType::default() });
    let label = Kind::String(Some("two\nlines <&> \"'\r\t".to_owned()));
    let mut variables = vec![
        real("time", Independent, Continuous, None),
        real("body.m", Parameter, Fixed, Some(0.1 + 0.2)),
        real("body.'F #1'", Parameter, Tunable, Some(-1e-5)),
        real("c", CalculatedParameter, Fixed, None),
        real("u", Input, Continuous, Some(5e-324)),
        other("enable", Input, Discrete, Kind::Boolean(Some(false))),
        state(),
        other("der(x)", Local, Continuous, speed),
        real("v[1,1]", Output, Continuous, None),
        real("v[1,2]", Output, Discrete, None),
        other("mode", Local, Discrete, Kind::Enumeration(mode)),
        other("count", Output, Discrete, Kind::Integer(count)),
        other("label", Parameter, Fixed, label),
        real("pi", Local, Constant, Some(f64::MAX)),
    ];
    variables[10].initial = Some(Initial::Exact);
    for (reference, variable) in (0..).zip(&mut variables) {
        variable.value_reference = reference;
    }
    variables
}

fn structure() -> ModelStructure {
    let row = |index: u32, dependencies: &[u32]| Unknown {
        index,
        dependencies: Some(dependencies.to_vec()),
        kinds: None,
    };
    let constant = Some(vec![DependencyKind::Constant, DependencyKind::Dependent]);
    ModelStructure {
        outputs: vec![
            Unknown { kinds: Some(vec![DependencyKind::Tunable]), ..row(7, &[7]) },
            row(9, &[]),
            Unknown { index: 10, dependencies: None, kinds: None },
            row(12, &[1, 6]),
        ],
        derivatives: vec![Unknown { kinds: constant.clone(), ..row(8, &[5, 7]) }],
        initial_unknowns: vec![
            row(4, &[2, 3]),
            Unknown { kinds: constant, ..row(8, &[5, 7]) },
            row(9, &[]),
            Unknown { index: 10, dependencies: None, kinds: None },
            row(12, &[11]),
        ],
        ..ModelStructure::default()
    }
}

/// Like [`complete`], for FMI 3.0: `sample/fmi3.xml`.
pub(crate) fn complete_3() -> ModelDescription {
    let (description, warnings) =
        ModelDescription::read(include_str!("sample/fmi3.xml")).expect("readable");
    assert_eq!(warnings, []);
    description
}
