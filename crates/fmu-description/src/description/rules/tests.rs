use super::*;
use crate::description::sample::{self, other, real};
use crate::description::{
    Causality, DependencyKind, Initial, IntegerType, Kind, RealType, ScalarVariable, Unknown,
    Variability,
};
use crate::unit::Unit;

mod fmi3;

/// The problems of the sample after `change`; there must be exactly one, in `section`.
fn only_problem(section: &str, change: impl FnOnce(&mut ModelDescription)) -> String {
    only_problem_of(sample::complete(), section, change)
}

/// The problems of `description` after `change`; there must be exactly one, in `section`.
fn only_problem_of(
    mut description: ModelDescription,
    section: &str,
    change: impl FnOnce(&mut ModelDescription),
) -> String {
    change(&mut description);
    let problems = description.problems();
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert_eq!(problems[0].section, section, "{problems:?}");
    problems[0].to_string()
}

fn variable<'a>(description: &'a mut ModelDescription, name: &str) -> &'a mut ScalarVariable {
    description.variables.iter_mut().find(|variable| variable.name == name).unwrap()
}

fn real_of<'a>(description: &'a mut ModelDescription, name: &str) -> &'a mut RealType {
    match &mut variable(description, name).kind {
        Kind::Real(real) => real,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_correct_description_has_no_problems() {
    assert_eq!(sample::complete().problems(), []);
}

#[test]
fn identity_and_flags_are_checked() {
    only_problem("2.2.1", |description| description.fmi_version = "2.0.5".into());
    only_problem("2.2.1", |description| description.guid.clear());
    only_problem("2.2.1", |description| description.model_name = "a\u{1}".into());
    only_problem("2.2.1", |description| description.version = Some("1\n2".into()));
    only_problem("4.3.1", |description| {
        description.co_simulation.as_mut().unwrap().can_get_and_set_fmu_state = false;
    });
    only_problem("3.3.1", |description| {
        description.model_exchange.as_mut().unwrap().model_identifier = "a-b".into();
    });
    only_problem("2.2.1", |description| {
        (description.model_exchange, description.co_simulation) = (None, None);
    });
    for identifier in ["", "1a", "a.b", "\u{e4}"] {
        let text = only_problem("4.3.1", |description| {
            description.co_simulation.as_mut().unwrap().model_identifier = identifier.into();
        });
        assert!(text.contains(&format!("{identifier:?}")), "{text}");
    }
    for date in [
        "2026-11-20T23:59:59+01:00",
        "2026-11-20T23:59:59.5Z",
        "2026-11-20 23:59:59Z",
        "2026-13-20T23:59:59Z",
        "2026-11-20T24:00:00Z",
        "2026-11-20",
    ] {
        only_problem("2.2.1", |description| {
            description.generation_date_and_time = Some(date.into());
        });
    }
    only_problem("2.2.4", |description| {
        description.log_categories[1].name = "logStatusError".into();
    });
}

#[test]
fn the_default_experiment_is_checked() {
    fn change(description: &mut ModelDescription) -> &mut DefaultExperiment {
        description.default_experiment.as_mut().unwrap()
    }
    only_problem("2.2.5", |description| change(description).tolerance = Some(0.0));
    only_problem("2.2.5", |description| change(description).step_size = Some(-0.1));
    only_problem("2.2.5", |description| change(description).step_size = Some(1000.0));
    only_problem("2.2.5", |description| {
        *change(description) =
            DefaultExperiment { step_size: None, stop_time: Some(-1.0), ..*change(description) };
    });
    only_problem("2.2.5", |description| {
        change(description).start_time = None;
        change(description).stop_time = Some(f64::INFINITY);
    });
}

#[test]
fn units_and_types_are_checked() {
    only_problem("2.2.2", |description| description.units.push(Unit::parse("kg").unwrap()));
    only_problem("2.2.2", |description| {
        description.units[0].base.as_mut().unwrap().factor = 0.0;
    });
    only_problem("2.2.2", |description| {
        description.units[2].display_units[0].factor = f64::NAN;
    });
    only_problem("2.2.2", |description| {
        let twice = description.units[2].display_units[0].clone();
        description.units[2].display_units.push(twice);
    });
    let text = only_problem("2.2.2", |description| {
        real_of(description, "u").unit = Some("furlong".into());
    });
    assert!(text.contains("variable u") && text.contains("furlong"), "{text}");
    only_problem("2.2.2", |description| real_of(description, "u").unit = Some(String::new()));
    only_problem("2.2.3", |description| {
        real_of(description, "u").display_unit = Some("deg".into());
    });
    let text = only_problem("2.2.3", |description| {
        real_of(description, "x").display_unit = Some("grad".into());
    });
    assert!(text.contains("no unit lists"), "{text}");
    let text = only_problem("2.2.3", |description| {
        description.types[0].kind.as_real_mut().unwrap().display_unit = Some("grad".into());
        real_of(description, "x").display_unit = Some("grad".into());
    });
    assert!(text.contains("type Angle"), "{text}");
    only_problem("2.2.3", |description| description.types[2].name = "u".into());
    only_problem("2.2.3", |description| description.types[2].name = "Text".into());
    only_problem("2.2.3", |description| description.types[4].items.push(("auto".into(), 1)));
    only_problem("2.2.3", |description| description.types[4].items.push(("on".into(), 2)));
}

#[test]
fn causality_and_variability_follow_the_table() {
    use Causality::{CalculatedParameter, Independent, Input, Local, Output, Parameter};
    use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
    let allowed = [
        (Parameter, Fixed),
        (Parameter, Tunable),
        (CalculatedParameter, Fixed),
        (CalculatedParameter, Tunable),
        (Input, Discrete),
        (Input, Continuous),
        (Output, Constant),
        (Output, Discrete),
        (Output, Continuous),
        (Local, Constant),
        (Local, Fixed),
        (Local, Tunable),
        (Local, Discrete),
        (Local, Continuous),
        (Independent, Continuous),
    ];
    for causality in [Parameter, CalculatedParameter, Input, Output, Local, Independent] {
        for variability in [Constant, Fixed, Tunable, Discrete, Continuous] {
            let pair = (causality, variability);
            let description = ModelDescription {
                variables: vec![ScalarVariable {
                    initial: None,
                    ..real("x", causality, variability, needs_start(pair).then_some(1.0))
                }],
                ..ModelDescription::default()
            };
            let (version, sections, list) = (Version::V2, &SECTIONS_OF_2, Vec::new());
            let mut problems = Problems { description: &description, version, sections, list };
            variables::check(&mut problems);
            assert_eq!(
                problems.list.is_empty(),
                allowed.contains(&pair),
                "{pair:?} {:?}",
                problems.list
            );
        }
    }
}

fn needs_start((causality, variability): (Causality, Variability)) -> bool {
    matches!(causality, Causality::Parameter | Causality::Input)
        || (causality != Causality::Independent && variability == Variability::Constant)
}

#[test]
fn initial_and_start_follow_the_table() {
    let start = |description: &mut ModelDescription, name: &str, value| {
        real_of(description, name).start = value;
    };
    only_problem("2.2.7", |description| {
        variable(description, "u").initial = Some(Initial::Exact);
    });
    only_problem("2.2.7", |description| start(description, "u", None));
    only_problem("2.2.7", |description| start(description, "body.m", None));
    only_problem("2.2.7", |description| start(description, "c", Some(1.0)));
    only_problem("2.2.7", |description| start(description, "time", Some(0.0)));
    only_problem("2.2.7", |description| start(description, "der(x)", Some(0.0)));
    only_problem("2.2.7", |description| start(description, "pi", None));
    only_problem("2.2.7", |description| {
        variable(description, "v[1,1]").initial = Some(Initial::Approx);
    });
    let text = only_problem("2.2.7", |description| {
        variable(description, "enable").variability = Variability::Continuous;
    });
    assert!(text.contains("enable") && text.contains("only a Real"), "{text}");
    only_problem("2.2.7", |description| {
        let mut second = description.variables[0].clone();
        (second.name, second.value_reference) = ("clock".into(), 99);
        description.variables.push(second);
    });
}

#[test]
fn limits_are_checked() {
    only_problem("2.2.7", |description| real_of(description, "x").start = Some(11.0));
    only_problem("2.2.7", |description| real_of(description, "x").start = Some(-4.0));
    only_problem("2.2.7", |description| real_of(description, "x").nominal = Some(0.0));
    only_problem("2.2.7", |description| real_of(description, "x").max = Some(10.5));
    only_problem("2.2.7", |description| {
        (real_of(description, "body.m").min, real_of(description, "body.m").max) =
            (Some(0.2), Some(f64::INFINITY));
    });
    only_problem("2.2.7", |description| {
        let Kind::Enumeration(mode) = &mut variable(description, "mode").kind else { panic!() };
        mode.start = Some(0);
    });
    only_problem("2.2.7", |description| {
        real_of(description, "x").declared_type = Some("Count".into());
    });
    only_problem("2.2.7", |description| {
        real_of(description, "x").declared_type = Some("Nothing".into());
    });
    only_problem("2.2.7", |description| {
        variable(description, "mode").kind =
            Kind::Enumeration(IntegerType { start: Some(1), ..IntegerType::default() });
    });
}

#[test]
fn names_are_checked() {
    only_problem("2.2.7", |description| variable(description, "c").name = "u".into());
    only_problem("2.2.9", |description| {
        variable(description, "enable").name = "der(enable)".into();
    });
    for name in ["a b", "a-b", "1a", "a.", "a[", "a[x]", "a[]", "'a", "''", "der(a", "a\u{e9}"] {
        let text =
            only_problem("2.2.9", |description| variable(description, "c").name = name.into());
        assert!(text.contains(&format!("{name:?}")), "{text}");
    }
    for name in ["_a9", "a.b[1,2].'q name'", "'it\\'s'", "der(a[3].b,2)", "der(a)"] {
        let mut description = sample::complete();
        variable(&mut description, "c").name = name.into();
        assert_eq!(description.problems(), [], "{name}");
    }
    let mut flat = sample::complete();
    flat.structured_names = false;
    variable(&mut flat, "c").name = "any name - at all".into();
    assert_eq!(flat.problems(), []);
    only_problem("2.2.9", |description| {
        (description.variables[8].name, description.variables[9].name) =
            ("v[1,2]".into(), "v[1,1]".into());
    });
    only_problem("2.2.9", |description| variable(description, "c").name = "v[1,3]".into());
}

#[test]
fn aliases_are_checked() {
    only_problem("2.2.7", |description| variable(description, "v[1,2]").value_reference = 13);
    only_problem("2.2.7", |description| {
        let reference = variable(description, "v[1,1]").value_reference;
        variable(description, "v[1,2]").value_reference = reference;
        real_of(description, "v[1,2]").unit = Some("kg".into());
    });
    let mut description = sample::complete();
    let reference = variable(&mut description, "v[1,1]").value_reference;
    variable(&mut description, "v[1,2]").value_reference = reference;
    assert_eq!(description.problems(), [], "aliases as such are allowed");
    variable(&mut description, "body.m").value_reference = 77;
    variable(&mut description, "u").value_reference = 77;
    assert_eq!(description.problems().len(), 2, "both can be set, both have a start");
    let mut description = sample::complete();
    let kind = |start| Kind::Integer(IntegerType { start, ..IntegerType::default() });
    for (name, start) in [("one", 1), ("two", 2)] {
        let value_reference = 500;
        let kind = kind(Some(start));
        let variable = other(name, Causality::Local, Variability::Constant, kind);
        description.variables.push(ScalarVariable { value_reference, ..variable });
    }
    assert_eq!(description.problems().len(), 1, "constants with two values");
}

#[test]
fn the_lists_of_the_model_structure_are_exact() {
    let row = |index| Unknown { index, dependencies: Some(vec![]), kinds: None };
    let text = only_problem("2.2.8", |description| drop(description.structure.outputs.remove(0)));
    assert!(text.contains("lacks variable x"), "{text}");
    only_problem("2.2.8", |description| description.structure.outputs.push(row(9)));
    only_problem("2.2.8", |description| description.structure.outputs.push(row(11)));
    only_problem("2.2.8", |description| description.structure.outputs.push(row(99)));
    for removed in 0..5 {
        only_problem("2.2.8", |description| {
            drop(description.structure.initial_unknowns.remove(removed));
        });
    }
    only_problem("2.2.8", |description| description.structure.initial_unknowns.swap(1, 2));
    let text = only_problem("2.2.8", |description| {
        description.structure.initial_unknowns.insert(2, row(8));
    });
    assert!(text.contains("twice"), "{text}");
}

#[test]
fn dependencies_are_checked() {
    let set = |rows: &mut Vec<Unknown>, at: usize, dependencies: &[u32]| {
        (rows[at].dependencies, rows[at].kinds) = (Some(dependencies.to_vec()), None);
    };
    let text =
        only_problem("2.2.8", |description| set(&mut description.structure.outputs, 1, &[2]));
    assert!(text.contains("body.m"), "{text}");
    only_problem("2.2.8", |description| set(&mut description.structure.outputs, 1, &[99]));
    only_problem("2.2.8", |description| set(&mut description.structure.outputs, 1, &[6, 5]));
    only_problem("2.2.8", |description| set(&mut description.structure.outputs, 1, &[5, 5]));
    only_problem("2.2.8", |description| {
        set(&mut description.structure.initial_unknowns, 2, &[4]);
    });
    only_problem("2.2.8", |description| {
        description.structure.initial_unknowns[1].kinds =
            Some(vec![DependencyKind::Constant, DependencyKind::Fixed]);
    });
    only_problem("2.2.8", |description| {
        description.structure.derivatives[0].kinds = Some(vec![]);
    });
    only_problem("2.2.8", |description| {
        description.structure.outputs[3].kinds = Some(vec![DependencyKind::Constant; 2]);
    });
}

#[test]
fn states_are_checked() {
    let mut description = sample::complete();
    real_of(&mut description, "der(x)").derivative = None;
    let problems = description.problems();
    assert!(problems[0].text.contains("der(x)"), "{problems:?}");
    only_problem("2.2.7", |description| real_of(description, "v[1,1]").derivative = Some(6));
    only_problem("2.2.7", |description| real_of(description, "v[1,1]").derivative = Some(9));
    only_problem("2.2.7", |description| real_of(description, "v[1,1]").derivative = Some(0));
}
