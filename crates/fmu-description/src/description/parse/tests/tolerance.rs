//! Violations of the standard that are read with a warning.

use super::*;

/// Reads a description and returns it with its single warning.
fn warned(xml: &str) -> (ModelDescription, Warning) {
    let (description, warnings) = ModelDescription::read(xml).unwrap();
    let [warning] = warnings.as_slice() else { panic!("{warnings:#?}") };
    (description, warning.clone())
}

/// Returns the type of a variable with this element, and the single warning.
fn kind(element: &str) -> (Kind, Warning) {
    let variable = format!(
        "<ScalarVariable name='x' valueReference='0'\nvariability='discrete'>{element}</ScalarVariable>"
    );
    let (description, warning) = warned(&with(&variable, ""));
    (description.variables[0].kind.clone(), warning)
}

#[test]
fn a_correct_description_gives_no_warning() {
    let xml = with(X, "").replace(
        "guid=",
        "xmlns:xsi='http://www.w3.org/2001/XMLSchema-instance' \
         xsi:noNamespaceSchemaLocation='fmi2ModelDescription.xsd' guid=",
    );
    assert_eq!(ModelDescription::read(xml).unwrap().1, []);
}

#[test]
fn a_warning_states_position_expectation_content_assumption_and_section() {
    let xml = "<fmiModelDescription fmiVersion='2.0' modelName='M' guid='1'>\n\
               <ModelVariables>\n  <ScalarVariable name='x' valueReference='0'>\n\
               <Real max='INF'/></ScalarVariable></ModelVariables><ModelStructure/></fmiModelDescription>";
    assert_eq!(
        warned(xml).1.to_string(),
        "line 4, column 1: <Real>, attribute max: expected a finite number, found \"INF\"; \
         read as if it were not there (section 2.2.7)"
    );
}

#[test]
fn versions_of_the_text_are_read_as_2_0() {
    for version in ["2.0.1", "2.0.5", " 2.0 "] {
        let xml = with(X, "").replace("fmiVersion=\"2.0\"", &format!("fmiVersion=\"{version}\""));
        let (description, warning) = warned(&xml);
        assert_eq!((description.fmi_version.as_str(), warning.section), ("2.0", "2.2.1"));
    }
}

#[test]
fn numbers_that_are_infinite_or_empty_count_as_missing() {
    for text in ["NaN", "INF", "-INF", "+INF", "inf", "Infinity", "1.#INF", "-1.#IND", "", " "] {
        for attribute in ["start", "min", "max", "nominal"] {
            let (kind, warning) = kind(&format!("<Real {attribute}='{text}'/>"));
            assert_eq!(kind, Kind::Real(RealType::default()), "{attribute}={text}");
            assert_eq!(warning.actual, format!("{text:?}"));
        }
    }
    let (kind, _) = kind("<Integer start=''/>");
    assert_eq!(kind, Kind::Integer(IntegerType::default()));
}

#[test]
fn integers_with_a_point_and_booleans_in_capitals_are_read() {
    let (integer, _) = kind("<Integer start='-3.0'/>");
    assert_eq!(integer, Kind::Integer(IntegerType { start: Some(-3), ..IntegerType::default() }));
    assert_eq!(kind("<Boolean start='True'/>").0, Kind::Boolean(Some(true)));
    assert_eq!(kind("<Boolean start='FALSE'/>").0, Kind::Boolean(Some(false)));
    assert_eq!(kind("<Boolean start=''/>").0, Kind::Boolean(None));
}

#[test]
fn an_invalid_flag_is_read_as_false() {
    let (description, warning) = warned(&CRANE.replace("\"1\" can", "\"yes\" can").replace(
        "<ModelVariables/>",
        "<ModelVariables><ScalarVariable name='x' valueReference='0'><Real/></ScalarVariable></ModelVariables>",
    ));
    assert!(!description.co_simulation.unwrap().can_interpolate_inputs);
    assert_eq!(warning.section, "4.3.1");
}

#[test]
fn words_in_another_case_are_read_and_unknown_words_count_as_missing() {
    let read = |attribute: &str| {
        let variable = format!(
            "<ScalarVariable name='x' valueReference='0' {attribute}><Real/></ScalarVariable>"
        );
        let (mut description, warning) =
            warned(&with(&variable, "<Outputs><Unknown index='1'/></Outputs>"));
        (description.variables.remove(0), warning.assumed)
    };
    let (variable, assumed) = read("causality='Output'");
    assert_eq!((variable.causality, assumed.as_str()), (Causality::Output, "read as output"));
    // `structuralParameter` belongs to FMI 3.0 only.
    for word in ["inout", "structuralParameter"] {
        let (variable, _) = read(&format!("causality='{word}'"));
        assert_eq!(variable.causality, Causality::Local);
    }
    assert_eq!(read("variability='often'").0.variability, Variability::Continuous);
    assert_eq!(read("initial=' exact '").0.initial, Some(Initial::Exact));
    assert_eq!(read("initial='first'").0.initial, None);
}

#[test]
fn types_that_cannot_be_continuous_are_read_as_fixed_or_discrete() {
    for (causality, expected) in [
        ("parameter", Variability::Fixed),
        ("calculatedParameter", Variability::Fixed),
        ("input", Variability::Discrete),
        ("local", Variability::Discrete),
    ] {
        for variability in ["", "variability='continuous'"] {
            let xml = with(
                &format!(
                    "<ScalarVariable name='n' valueReference='0' causality='{causality}' \
                     {variability}><Integer/></ScalarVariable>"
                ),
                "",
            );
            assert_eq!(warned(&xml).0.variables[0].variability, expected);
        }
    }
}

#[test]
fn declared_types_that_do_not_fit_are_ignored() {
    for element in ["<Real declaredType='Mode'/>", "<Real declaredType='Nothing'/>"] {
        assert_eq!(kind(element).0, Kind::Real(RealType::default()));
    }
    for element in ["<Enumeration/>", "<Enumeration declaredType='Length'/>"] {
        assert_eq!(kind(element).0, Kind::Enumeration(IntegerType::default()));
    }
    assert_eq!(kind("<Boolean declaredType='Nothing'/>").0, Kind::Boolean(None));
}

#[test]
fn unknown_elements_and_attributes_are_skipped() {
    let (kind, warning) = kind("<Real color='red'/>");
    assert_eq!(kind, Kind::Real(RealType::default()));
    assert!(warning.place.contains("color"));
    let (description, warning) = warned(&with(&format!("<Array/>{X}"), ""));
    assert_eq!(
        (description.variables.len(), warning.place.as_str()),
        (1, "<Array> in <ModelVariables>")
    );
}

#[test]
fn elements_in_another_order_and_empty_lists_are_read() {
    let late = with(X, "").replace(
        "</fmiModelDescription>",
        "<DefaultExperiment stopTime='2'/></fmiModelDescription>",
    );
    let (description, warning) = warned(&late);
    assert_eq!(description.default_experiment.unwrap().stop_time, Some(2.0));
    assert!(warning.actual.contains("after ModelStructure"), "{warning}");
    let (description, warning) = warned(&with(X, "<Outputs/>"));
    assert_eq!((description.structure.outputs.len(), warning.place.as_str()), (0, "<Outputs>"));
}

const Y: &str =
    "<ScalarVariable name='y' valueReference='1' causality='output'><Real/></ScalarVariable>";

/// Checks that the only row is that of the output `y`, with unknown dependencies.
fn assert_unknown(description: &ModelDescription) {
    let row = crate::description::Unknown { index: 2, ..Default::default() };
    assert_eq!(description.structure.outputs, [row]);
}

#[test]
fn unlisted_outputs_may_depend_on_anything() {
    let variables = format!("{X}{Y}");
    let (description, warning) = warned(&with(&variables, ""));
    assert_unknown(&description);
    assert!(warning.actual.contains('y'));
    let without = with(&variables, "").replace("<ModelStructure></ModelStructure>", "");
    assert_unknown(&warned(&without).0);
}

#[test]
fn a_list_with_invalid_indices_may_depend_on_anything() {
    for rows in [
        "<Unknown index='0' dependencies=''/><Unknown index='2' dependencies=''/>",
        "<Unknown index='2' dependencies='0'/>",
        "<Unknown index='2' dependencies='3' dependenciesKind='fixed'/>",
        "<Unknown index='2' dependencies='x'/>",
    ] {
        let xml = with(&format!("{X}{Y}"), &format!("<Outputs>{rows}</Outputs>"));
        let (description, warnings) = ModelDescription::read(xml).unwrap();
        assert_unknown(&description);
        assert_eq!(warnings.len(), 2, "{warnings:#?}");
    }
    let xml = with(X, "<InitialUnknowns><Unknown index='9'/></InitialUnknowns>");
    let (description, warnings) = ModelDescription::read(xml).unwrap();
    assert_eq!((description.structure.initial_unknowns.len(), warnings.len()), (0, 2));
}

#[test]
fn kinds_of_dependencies_that_do_not_fit_are_ignored() {
    for attributes in [
        "dependenciesKind='fixed'",
        "dependencies='1' dependenciesKind=''",
        "dependencies='1' dependenciesKind='fixed fixed'",
        "dependencies='1' dependenciesKind='linear'",
    ] {
        let rows = format!("<Outputs><Unknown index='2' {attributes}/></Outputs>");
        let (description, warning) = warned(&with(&format!("{X}{Y}"), &rows));
        let row = &description.structure.outputs[0];
        assert_eq!(row.kinds, None);
        let listed = attributes.contains("dependencies=").then(|| vec![1]);
        assert_eq!(row.dependencies, listed, "{attributes}: {warning}");
    }
}

#[test]
fn a_harmless_duplicate_name_means_the_first_variable() {
    let same = X.to_owned() + X;
    let (description, warning) = warned(&with(&same, ""));
    assert_eq!((description.variables.len(), warning.actual.as_str()), (2, "\"x\""));
    let local = X.to_owned() + &X.replace("\"0\"", "\"1\"");
    assert_eq!(warned(&with(&local, "")).0.variable("x").unwrap().value_reference, 0);
}

#[test]
fn a_missing_model_name_is_replaced_by_the_identifier() {
    let xml = CRANE.replace("modelName=\"Crane\"", "").replace(
        "<ModelVariables/>",
        "<ModelVariables><ScalarVariable name='x' valueReference='0'><Real/></ScalarVariable></ModelVariables>",
    );
    assert_eq!(warned(&xml).0.model_name, "crane");
}
