//! FMI 3.0.

use super::*;
use crate::description::{
    BinaryType, Dimension, Elements, IntervalVariability, ScalarVariable, Unknown,
};

/// A model description around `types`, `variables` and `structure`.
fn around(types: &str, variables: &str, structure: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="{{1}}">
  <CoSimulation modelIdentifier="m" hasEventMode="true" canGetAndSetFMUState="true"
      fixedInternalStepSize="0.5" maxOutputDerivativeOrder="2" providesIntermediateUpdate="true"/>
  <TypeDefinitions>
    <Float64Type name="Length" quantity="Length" unit="m" min="0" max="INF"/>
    <EnumerationType name="Mode"><Item name="off" value="-5000000000"/></EnumerationType>
    {types}
  </TypeDefinitions>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    {variables}
  </ModelVariables>
  <ModelStructure>{structure}</ModelStructure>
</fmiModelDescription>"#
    )
}

fn read(variables: &str, structure: &str) -> (ModelDescription, Vec<String>) {
    let (description, warnings) =
        ModelDescription::read(around("", variables, structure)).expect("readable");
    (description, warnings.iter().map(ToString::to_string).collect())
}

fn variable(text: &str) -> ScalarVariable {
    let (description, warnings) = read(text, "");
    assert_eq!(warnings, Vec::<String>::new());
    description.variables[1].clone()
}

fn refused(variables: &str, structure: &str) -> String {
    ModelDescription::read(around("", variables, structure)).unwrap_err().to_string()
}

#[test]
fn each_type_has_its_own_range_of_start_values_and_limits() {
    for (element, low, high) in [
        ("Int8", i128::from(i8::MIN), i128::from(i8::MAX)),
        ("UInt8", 0, u8::MAX.into()),
        ("Int16", i16::MIN.into(), i16::MAX.into()),
        ("UInt16", 0, u16::MAX.into()),
        ("Int32", i32::MIN.into(), i32::MAX.into()),
        ("UInt32", 0, u32::MAX.into()),
        ("Int64", i64::MIN.into(), i64::MAX.into()),
        ("UInt64", 0, u64::MAX.into()),
    ] {
        for start in [low, high] {
            let variable = variable(&format!(
                r#"<{element} name="i" valueReference="1" start="{start}" min="{low}" max="{high}"/>"#
            ));
            let integer = variable.kind.as_integer().expect(element);
            assert_eq!(
                (integer.start, integer.min, integer.max),
                (Some(start), Some(low), Some(high))
            );
            assert_eq!(variable.kind.element_in(Version::V3), element);
        }
        for wrong in [low - 1, high + 1] {
            let error = refused(
                &format!(r#"<{element} name="i" valueReference="1" start="{wrong}"/>"#),
                "",
            );
            let expected = format!("expected integers from {low} to {high}, found \"{wrong}\"");
            assert!(error.contains(&expected), "{error}");
            // As an `f64`, -2^63 - 1 is rounded to the smallest `Int64`.
            for limit in ["min", "max"] {
                let text = format!(r#"<{element} name="i" valueReference="1" {limit}="{wrong}"/>"#);
                let error = refused(&text, "");
                let expected = format!("expected an integer from {low} to {high}, found");
                assert!(error.contains(&expected), "{error}");
            }
        }
    }
}

#[test]
fn other_types_have_start_values_of_their_own() {
    let kind = |text: &str| variable(text).kind;
    let Kind::Float32(real) = kind(r#"<Float32 name="x" valueReference="1" start="-1.5e-3"/>"#)
    else {
        panic!("Float32")
    };
    assert_eq!(real.start, Some(f64::from(-0.0015_f32)), "the number that the FMU has");
    let text = r#"<Boolean name="x" valueReference="1" start="1"/>"#;
    assert_eq!(kind(text), Kind::Boolean(Some(true)));
    let text = r#"<String name="x" valueReference="1"><Start value="a &lt; b"/></String>"#;
    assert_eq!(kind(text), Kind::String(Some("a < b".into())));
    let text = r#"<Binary name="x" valueReference="1" mimeType="image/png" maxSize="4">
        <Start value="00fFa0"/></Binary>"#;
    let binary = BinaryType {
        mime_type: Some("image/png".into()),
        max_size: Some(4),
        start: Some(vec![0, 0xff, 0xa0]),
        ..BinaryType::default()
    };
    assert_eq!(kind(text), Kind::Binary(binary));
    let text =
        r#"<Enumeration name="x" valueReference="1" declaredType="Mode" start="-5000000000"/>"#;
    let variable = kind(text);
    assert_eq!(variable.as_integer().and_then(|variable| variable.start), Some(-5_000_000_000));
    let (description, _) = read(text, "");
    assert_eq!(description.types[1].items, [("off".to_owned(), -5_000_000_000)]);
}

#[test]
fn a_variable_has_the_defaults_of_its_causality_and_type() {
    for (element, causality, expected) in [
        ("Float64", "local", Variability::Continuous),
        ("Float32", "output", Variability::Continuous),
        ("Int8", "input", Variability::Discrete),
        ("Float64", "parameter", Variability::Fixed),
        ("UInt64", "structuralParameter", Variability::Fixed),
        ("Boolean", "calculatedParameter", Variability::Fixed),
    ] {
        let text = format!(r#"<{element} name="x" valueReference="1" causality="{causality}"/>"#);
        let (description, _) = read(&text, "");
        let variable = &description.variables[1];
        assert_eq!(
            (variable.variability, variable.initial),
            (expected, None),
            "{element} {causality}"
        );
    }
    let limits = |min: &str| {
        let text = format!(r#"<Float64 name="x" valueReference="1" declaredType="Length"{min}/>"#);
        let variable = variable(&text);
        let real = variable.kind.as_real().unwrap();
        (real.min, real.max, real.unit.clone())
    };
    assert_eq!(limits(""), (Some(0.0), None, Some("m".to_owned())));
    assert_eq!(limits(r#" min="-INF""#).0, None, "not the limit of the type");
}

#[test]
fn an_array_has_extents_and_start_values() {
    let (description, warnings) = read(
        r#"<UInt64 name="n" valueReference="1" causality="structuralParameter" start="3"/>
           <Float64 name="A" valueReference="2" causality="parameter" start="1 2 3
               4 5 6"><Dimension start="2"/><Dimension valueReference="1"/></Float64>
           <Int32 name="k" valueReference="3" causality="parameter" start="7">
               <Dimension valueReference="1"/></Int32>
           <String name="s" valueReference="4" causality="parameter"><Dimension start="2"/>
               <Start value=""/><Start value="b"/></String>"#,
        "",
    );
    assert_eq!(warnings, Vec::<String>::new());
    let variable = |name: &str| description.variable(name).unwrap();
    assert_eq!(variable("A").dimensions, [Dimension::Fixed(2), Dimension::Variable(1)]);
    assert_eq!(variable("A").extents(&description), [2, 3]);
    let sizes = ["n", "A", "k", "s"].map(|name| variable(name).size(&description));
    assert_eq!(sizes, [1, 6, 3, 2]);
    let starts = |name: &str| variable(name).start_values(&description, 10).unwrap();
    assert_eq!(starts("n"), Elements::Integer(vec![3]));
    assert_eq!(starts("A"), Elements::Real(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    assert_eq!(starts("k"), Elements::Integer(vec![7, 7, 7]));
    assert_eq!(starts("s"), Elements::String(vec![String::new(), "b".to_owned()]));
    assert_eq!(variable("k").start_values(&description, 2), None);
    assert_eq!(variable("A").kind, Kind::Real(RealType::default()));
}

#[test]
fn value_references_become_indices() {
    let (description, warnings) = read(
        r#"<Float64 name="x" valueReference="10" start="0" initial="exact"><Alias name="y"/></Float64>
           <Float64 name="der(x)" valueReference="20" derivative="10"/>
           <Clock name="tick" valueReference="30" causality="input"
               intervalVariability="constant" intervalDecimal="0.1"/>
           <Float64 name="v" valueReference="40" causality="output" variability="discrete"
               clocks="30" previous="50"/>
           <Float64 name="pre(v)" valueReference="50" variability="discrete" clocks="30"/>"#,
        r#"<Output valueReference="40" dependencies="50 30" dependenciesKind="constant dependent"/>
           <ContinuousStateDerivative valueReference="20" dependencies=""/>
           <ClockedState valueReference="40"/>
           <InitialUnknown valueReference="20" dependencies="10"/>
           <EventIndicator valueReference="10"/>"#,
    );
    assert_eq!(warnings, Vec::<String>::new());
    let names: Vec<_> =
        description.variables.iter().map(|variable| variable.name.as_str()).collect();
    assert_eq!(names, ["time", "x", "y", "der(x)", "tick", "v", "pre(v)"]);
    let variable = |name: &str| description.variable(name).unwrap();
    assert_eq!(variable("der(x)").kind.as_real().unwrap().derivative, Some(2));
    assert_eq!((variable("v").previous, variable("v").clocks.as_slice()), (Some(7), &[5][..]));
    let Kind::Clock(clock) = &variable("tick").kind else { panic!("a clock") };
    assert_eq!(clock.interval_variability, IntervalVariability::Constant);
    assert_eq!(clock.interval_decimal, Some(0.1));
    let row = |index, dependencies: Option<&[u32]>| Unknown {
        index,
        dependencies: dependencies.map(<[u32]>::to_vec),
        kinds: None,
    };
    let structure = &description.structure;
    let kinds = Some(vec![DependencyKind::Constant, DependencyKind::Dependent]);
    assert_eq!(structure.outputs, [Unknown { kinds, ..row(6, Some(&[7, 5])) }]);
    assert_eq!(structure.derivatives, [row(4, Some(&[]))]);
    assert_eq!(structure.clocked_states, [row(6, None)]);
    assert_eq!(structure.initial_unknowns, [row(4, Some(&[2]))]);
    assert_eq!(structure.event_indicators, [row(2, None)]);
}

#[test]
fn an_alias_is_a_variable_after_the_one_that_contains_it() {
    let (description, warnings) = read(
        r#"<Float64 name="x" valueReference="1" causality="output" unit="m" description="length">
             <Alias name="y" displayUnit="mm"/><Alias name="z" description="other"/></Float64>"#,
        r#"<Output valueReference="1"/>"#,
    );
    assert_eq!(warnings, Vec::<String>::new());
    let [_, x, y, z] = &description.variables[..] else { panic!("four variables") };
    assert_eq!((x.alias_of.as_ref(), y.alias_of.as_deref()), (None, Some("x")));
    assert_eq!((y.value_reference, y.causality), (1, Causality::Output));
    assert_eq!(y.kind.as_real().unwrap().display_unit.as_deref(), Some("mm"));
    let descriptions = [x, y, z].map(|variable| variable.description.as_deref());
    assert_eq!(descriptions, [Some("length"), Some("length"), Some("other")]);
    assert_eq!(description.structure.outputs.len(), 1);
}

#[test]
fn an_alias_has_the_start_values_of_its_variable() {
    let (description, _) = read(
        r#"<Float64 name="A" valueReference="1" causality="parameter" start="1 2">
             <Dimension start="2"/><Alias name="B"/></Float64>
           <String name="s" valueReference="2" causality="parameter"><Start value="a"/>
             <Alias name="t"/></String>"#,
        "",
    );
    for (alias, expected) in
        [("B", Elements::Real(vec![1.0, 2.0])), ("t", Elements::String(vec!["a".to_owned()]))]
    {
        let alias = description.variable(alias).unwrap();
        assert!(!alias.has_start(), "it is stated once");
        assert_eq!(alias.start_values(&description, 2), Some(expected));
    }
}

#[test]
fn aliases_of_a_long_description_have_a_limit() {
    let aliases = (0..2000).map(|k| format!("<Alias name=\"a{k}\"/>")).collect::<Vec<_>>().concat();
    let long = "x".repeat(100_000);
    let text =
        format!(r#"<Float64 name="x" valueReference="1" description="{long}">{aliases}</Float64>"#);
    let error = refused(&text, "");
    assert!(error.contains("bytes of aliases"), "{error}");
}

#[test]
fn capabilities_and_versions_are_read() {
    let (description, _) = read("", "");
    let flags = description.co_simulation.as_ref().unwrap();
    assert!(flags.has_event_mode && flags.can_get_and_set_fmu_state);
    assert!(!flags.can_interpolate_inputs && !flags.might_return_early_from_do_step);
    assert_eq!(flags.fixed_internal_step_size, Some(0.5));
    assert_eq!((description.version(), description.guid.as_str()), (Version::V3, "{1}"));
    for version in ["3.0.2", "3.0-beta.2", "3.1"] {
        let xml = around("", "", "").replace("\"3.0\"", &format!("\"{version}\""));
        let description = ModelDescription::parse(xml).unwrap();
        assert_eq!(description.fmi_version, "3.0", "{version}");
    }
}

#[test]
fn a_model_exchange_interface_states_whether_it_needs_completed_steps() {
    for (text, needed) in [("", false), (r#" needsCompletedIntegratorStep="true""#, true)] {
        let xml = around("", "", "");
        let other = format!(r#"<ModelExchange modelIdentifier="m"{text}/><CoSimulation "#);
        let description = ModelDescription::parse(xml.replace("<CoSimulation ", &other)).unwrap();
        let flags = description.model_exchange.unwrap();
        assert_eq!(flags.needs_completed_integrator_step, needed);
        assert_eq!(flags.completed_integrator_step_not_needed, !needed);
    }
}

#[test]
fn a_clock_has_the_attributes_of_its_declared_type() {
    let types = r#"<ClockType name="Periodic" intervalVariability="fixed" intervalDecimal="0.2"
        canBeDeactivated="true" supportsFraction="true" resolution="10"/>"#;
    let variable = r#"<Clock name="c" valueReference="1" causality="input" declaredType="Periodic"
        intervalCounter="2" canBeDeactivated="false"/>"#;
    let (description, warnings) = ModelDescription::read(around(types, variable, "")).unwrap();
    assert_eq!(warnings, []);
    let Kind::Clock(clock) = &description.variables[1].kind else { panic!("a clock") };
    assert_eq!(clock.interval_variability, IntervalVariability::Fixed);
    assert_eq!((clock.interval_decimal, clock.resolution), (Some(0.2), Some(10)));
    assert_eq!((clock.interval_counter, clock.can_be_deactivated), (Some(2), false));
    assert_eq!(clock.declared_type.as_deref(), Some("Periodic"));
}

#[test]
fn a_float32_is_relative_by_its_declared_type_and_so_is_its_alias() {
    let types = r#"<Float32Type name="Rise" unit="K" relativeQuantity="true"/>"#;
    let variables = r#"<Float32 name="x" valueReference="1" declaredType="Rise"><Alias name="y"/>
        </Float32>
        <Float32 name="z" valueReference="2" declaredType="Rise" relativeQuantity="false"/>"#;
    let (description, warnings) = ModelDescription::read(around(types, variables, "")).unwrap();
    assert_eq!(warnings, []);
    let reals = description.variables.iter().filter_map(|variable| variable.kind.as_real());
    let relative: Vec<bool> = reals.map(RealType::is_relative).collect();
    assert_eq!(relative, [false, true, true, false]);
}

/// In `fmi3Type.xsd` the base type has the annotations, and the extended type adds the items.
#[test]
fn annotations_of_an_enumeration_precede_its_items() {
    let (item, annotations) = (r#"<Item name="a" value="1"/>"#, "<Annotations/>");
    for (content, count) in [([annotations, item], 0), ([item, annotations], 1)] {
        let content = content.concat();
        let types = format!(r#"<EnumerationType name="E">{content}</EnumerationType>"#);
        let (_, warnings) = ModelDescription::read(around(&types, "", "")).expect("readable");
        let texts: Vec<_> = warnings.iter().map(ToString::to_string).collect();
        let late = texts.iter().filter(|text| text.contains("found it after Item")).count();
        assert_eq!(late, count, "{texts:?}");
    }
}

#[test]
fn defects_with_a_clear_meaning_are_warnings_that_name_them() {
    for (variables, structure, expected) in [
        (
            r#"<Float64 name="x" valueReference="1" start="1 2"><Dimension start="3"/></Float64>"#,
            "",
            "attribute start: expected one value or 3, found 2 values; read without start values",
        ),
        (
            r#"<Float64 name="x" valueReference="1" guid="no"/>"#,
            "",
            "attribute guid: expected an attribute of the standard, found \"no\"; it was skipped",
        ),
        (r#"<Real name="x"/>"#, "", "<Real> in <ModelVariables>: expected an element"),
        (
            r#"<Float64 name="x" valueReference="1"><Dimension start="3" valueReference="0"/></Float64>"#,
            "",
            "<Dimension>: expected start or valueReference, found both; read with its start",
        ),
        (
            r#"<Int8 name="x" valueReference="1" variability="continuous"/>"#,
            "",
            "expected another one than continuous for Int8",
        ),
        (
            r#"<Int8 name="x" valueReference="1" declaredType="Length"/>"#,
            "",
            "expected the name of a Int8Type",
        ),
        (
            r#"<Float64 name="x" valueReference="0"/>"#,
            "",
            "expected one that no other variable has, variable 1 has it, found \"0\"",
        ),
        (
            r#"<Float64 name="x" valueReference="1" causality="output"/>
               <Float64 name="y" valueReference="1" causality="output"/>"#,
            r#"<Output valueReference="1"/>"#,
            "references to it are read as the first variable",
        ),
        (
            r#"<Float64 name="x" valueReference="1" previous="9"/>"#,
            "",
            "attribute previous: expected the value reference of a variable, found \"9\"",
        ),
        (
            r#"<Float64 name="x" valueReference="1" causality="output"/>"#,
            "",
            "expected an Output for every output, found none for x",
        ),
        (
            r#"<Float64 name="x" valueReference="1" causality="output"/>"#,
            r#"<Output valueReference="1" dependencies="9"/>"#,
            "attribute dependencies: expected the value reference of a variable, found \"9\"",
        ),
        (
            r#"<Clock name="c" valueReference="1" causality="input"/>"#,
            "",
            "attribute intervalVariability: expected one of constant",
        ),
    ] {
        let (_, warnings) = read(variables, structure);
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].contains(expected), "{} has not {expected}", warnings[0]);
    }
}

#[test]
fn invalid_dependencies_with_kinds_are_one_warning() {
    let (description, warnings) = read(
        r#"<Float64 name="y" valueReference="1" causality="output"/>"#,
        r#"<Output valueReference="1" dependencies="9" dependenciesKind="dependent"/>"#,
    );
    let [warning] = &warnings[..] else { panic!("{warnings:#?}") };
    assert!(warning.contains("<Output>, attribute dependencies: expected the value"), "{warning}");
    assert_eq!(description.structure.outputs, [Unknown { index: 2, ..Unknown::default() }]);
}

#[test]
fn content_that_would_mislead_a_simulation_is_refused() {
    for (variables, structure, expected) in [
        (r#"<Float64 name="x"/>"#, "", "attribute valueReference: expected a value"),
        (r#"<Float64 name="x" valueReference="1" start="1,5"/>"#, "", "expected numbers"),
        (
            r#"<Float64 name="x" valueReference="1"><Dimension/></Float64>"#,
            "",
            "expected start or valueReference, found neither",
        ),
        (
            r#"<Float64 name="x" valueReference="1"><Dimension valueReference="0"/></Float64>"#,
            "",
            "expected the value reference of an integer with a start value",
        ),
        (
            r#"<Float64 name="x" valueReference="1" derivative="7"/>"#,
            "",
            "attribute derivative: expected the value reference of a variable",
        ),
        (
            r#"<Float64 name="x" valueReference="1" variability="discrete" clocks="7"/>"#,
            "",
            "attribute clocks: expected the value reference of a variable",
        ),
        (
            r#"<Binary name="x" valueReference="1"><Start value="abc"/></Binary>"#,
            "",
            "expected pairs of hexadecimal digits",
        ),
        ("", r#"<ContinuousStateDerivative valueReference="7"/>"#, "attribute valueReference"),
    ] {
        let error = refused(variables, structure);
        assert!(error.contains(expected), "{error} has not {expected}");
    }
    let xml = around("", "", "").replace("instantiationToken", "guid");
    let error = ModelDescription::read(xml).unwrap_err().to_string();
    assert!(error.contains("instantiationToken"), "{error}");
}
