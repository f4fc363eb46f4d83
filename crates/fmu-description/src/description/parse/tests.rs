use super::*;
use crate::description::{
    Causality, CoSimulation, DefaultExperiment, DependencyKind, Initial, IntegerType, Kind,
    RealType, Variability,
};
use crate::unit::{BaseUnit, DisplayUnit};

mod files;
mod fmi1;
mod fmi3;
mod tolerance;

/// A model description around `variables` and `structure`, with an enumeration and a real type.
fn with(variables: &str, structure: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="M" guid="{{1}}">
  <TypeDefinitions>
    <SimpleType name="Length"><Real quantity="Length" unit="m" min="0" max="9"/></SimpleType>
    <SimpleType name="Mode"><Enumeration><Item name="off" value="0"/></Enumeration></SimpleType>
  </TypeDefinitions>
  <ModelVariables>{variables}</ModelVariables>
  <ModelStructure>{structure}</ModelStructure>
</fmiModelDescription>"#
    )
}

const X: &str = r#"<ScalarVariable name="x" valueReference="0"><Real/></ScalarVariable>"#;

fn refused(variables: &str, structure: &str) -> String {
    ModelDescription::parse(with(variables, structure)).unwrap_err().to_string()
}

#[test]
fn defaults_of_the_standard_are_filled_in() {
    let description = ModelDescription::parse(with(X, "")).unwrap();
    let x = description.variable("x").unwrap();
    assert_eq!((x.causality, x.variability), (Causality::Local, Variability::Continuous));
    assert_eq!(x.initial, None);
    assert_eq!(x.kind, Kind::Real(RealType::default()));
    assert!(!description.structured_names);
    assert_eq!(description.co_simulation, None);
}

#[test]
fn each_kind_of_variable_is_read() {
    let variables = r#"
      <ScalarVariable name="r" valueReference="4294967295" description="a &lt; b" causality="output"
          variability="discrete" initial="exact">
        <Real start=" -1.5E-3 " nominal="2." unit="m" displayUnit="mm" derivative="1"/>
        <Annotations><Tool name="t"><ScalarVariable name="not one"/></Tool></Annotations>
      </ScalarVariable>
      <ScalarVariable name="i" valueReference="0" variability="fixed" causality="parameter">
        <Integer start="-2147483648" min="-2147483648" max="+7" quantity="q"/>
      </ScalarVariable>
      <ScalarVariable name="b" valueReference="0"><Boolean start="1"/></ScalarVariable>
      <ScalarVariable name="s" valueReference="0"><String start="two&#10;lines &#x3b1;"/></ScalarVariable>
      <ScalarVariable name="e" valueReference="1">
        <Enumeration declaredType="Mode" start="0" unknown="ignored"/>
      </ScalarVariable>"#;
    let description = ModelDescription::parse(with(variables, "")).unwrap();
    let kind = |name| description.variable(name).unwrap().kind.clone();
    let real = RealType {
        start: Some(-0.0015),
        nominal: Some(2.0),
        unit: Some("m".into()),
        display_unit: Some("mm".into()),
        derivative: Some(1),
        ..RealType::default()
    };
    assert_eq!(kind("r"), Kind::Real(real));
    let integer = IntegerType {
        start: Some(i32::MIN.into()),
        min: Some(i32::MIN.into()),
        max: Some(7),
        quantity: Some("q".into()),
        declared_type: None,
    };
    assert_eq!(kind("i"), Kind::Integer(integer));
    assert_eq!(kind("b"), Kind::Boolean(Some(true)));
    assert_eq!(kind("s"), Kind::String(Some("two\nlines \u{3b1}".into())));
    let enumeration = IntegerType {
        declared_type: Some("Mode".into()),
        start: Some(0),
        ..IntegerType::default()
    };
    assert_eq!(kind("e"), Kind::Enumeration(enumeration));
    assert_eq!(description.variables.len(), 5);
    let r = description.variable("r").unwrap();
    assert_eq!(r.description.as_deref(), Some("a < b"));
    assert_eq!((r.value_reference, r.initial), (u32::MAX, Some(Initial::Exact)));
}

#[test]
fn a_variable_gets_the_attributes_of_its_declared_type() {
    let variables = r#"<ScalarVariable name="x" valueReference="0">
        <Real declaredType="Length" min="1"/></ScalarVariable>"#;
    let description = ModelDescription::parse(with(variables, "")).unwrap();
    let Kind::Real(x) = &description.variables[0].kind else { panic!("x is Real") };
    assert_eq!((x.min, x.max), (Some(1.0), Some(9.0)));
    assert_eq!((x.unit.as_deref(), x.quantity.as_deref()), (Some("m"), Some("Length")));
}

#[test]
fn a_variable_is_relative_if_it_or_its_declared_type_says_so() {
    let relative = |attributes: &str| {
        let variable = format!(
            r#"<ScalarVariable name="x" valueReference="0"><Real {attributes}/></ScalarVariable>"#
        );
        let xml = with(&variable, "").replace(r#"min="0""#, r#"min="0" relativeQuantity="true""#);
        ModelDescription::parse(xml).unwrap().variables[0].kind.as_real().unwrap().is_relative()
    };
    assert!(!relative(""));
    assert!(relative(r#"relativeQuantity="1""#));
    assert!(relative(r#"declaredType="Length""#));
    assert!(!relative(r#"declaredType="Length" relativeQuantity="false""#));
}

#[test]
fn no_dependencies_and_unknown_dependencies_are_distinguished() {
    let structure = r#"<Outputs><Unknown index="1"/><Unknown index="1" dependencies=""/>
        <Unknown index="1" dependencies="1 &#9; 1" dependenciesKind="fixed constant"/></Outputs>"#;
    let description = ModelDescription::parse(with(X, structure)).unwrap();
    let outputs = &description.structure.outputs;
    assert_eq!(outputs[0].dependencies, None);
    assert_eq!(outputs[1].dependencies, Some(vec![]));
    assert_eq!(outputs[2].dependencies, Some(vec![1, 1]));
    let kinds = vec![DependencyKind::Fixed, DependencyKind::Constant];
    assert_eq!(outputs[2].kinds, Some(kinds));
}

const CRANE: &str = r#"<fmiModelDescription fmiVersion="2.0" modelName="Crane" guid="{crane}"
    variableNamingConvention="structured" numberOfEventIndicators="3">
  <ModelExchange modelIdentifier="crane_me"><SourceFiles><File name="a.c"/></SourceFiles></ModelExchange>
  <CoSimulation modelIdentifier="crane" canInterpolateInputs="1" canSerializeFMUstate="false"
    canHandleVariableCommunicationStepSize=" true " maxOutputDerivativeOrder="2"/>
  <UnitDefinitions>
    <Unit name="rad"><BaseUnit rad="1"/><DisplayUnit name="deg" factor="57.3"/></Unit>
    <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
    <Unit name="apples"/>
  </UnitDefinitions>
  <LogCategories><Category name="logEvents" description="jumps"/></LogCategories>
  <DefaultExperiment stopTime="3.0" tolerance="1e-4"/>
  <ModelVariables/>
  <ModelStructure/>
</fmiModelDescription>"#;

#[test]
fn both_interfaces_are_read() {
    let description = ModelDescription::parse(CRANE).unwrap();
    let co_simulation = CoSimulation {
        model_identifier: "crane".into(),
        can_interpolate_inputs: true,
        can_handle_variable_communication_step_size: true,
        max_output_derivative_order: 2,
        ..CoSimulation::default()
    };
    assert_eq!(description.co_simulation, Some(co_simulation));
    let model_exchange = description.model_exchange.as_ref().unwrap();
    assert_eq!(model_exchange.model_identifier, "crane_me");
    assert_eq!(description.number_of_event_indicators, Some(3));
    assert!(description.structured_names);
}

#[test]
fn units_categories_and_experiment_are_read() {
    let description = ModelDescription::parse(CRANE).unwrap();
    let celsius = BaseUnit { k: 1, offset: 273.15, ..BaseUnit::default() };
    assert_eq!(description.units[1].base, Some(celsius));
    assert_eq!(description.units[2].base, None);
    let degrees = DisplayUnit { name: "deg".into(), factor: 57.3, offset: 0.0, inverse: false };
    assert_eq!(description.units[0].display_units, [degrees]);
    assert_eq!(description.log_categories[0].description.as_deref(), Some("jumps"));
    let experiment = DefaultExperiment {
        stop_time: Some(3.0),
        tolerance: Some(1e-4),
        ..DefaultExperiment::default()
    };
    assert_eq!(description.default_experiment, Some(experiment));
}

#[test]
fn other_versions_are_named() {
    for version in ["0.9", "1.1", "3.", "4.0", "2.1", "2.0.x", "2.0.1.2", ""] {
        let xml = format!(r#"<fmiModelDescription fmiVersion="{version}"/>"#);
        let error = ModelDescription::parse(xml).unwrap_err();
        assert!(matches!(error, ParseError::Version { ref actual, .. } if actual == version));
    }
    let missing = ModelDescription::parse("<fmiModelDescription/>").unwrap_err().to_string();
    assert!(missing.contains("fmiVersion"), "{missing}");
    let other = ModelDescription::parse("<ssd/>").unwrap_err().to_string();
    assert!(other.contains("fmiModelDescription") && other.contains("<ssd>"), "{other}");
}

#[test]
fn a_model_identifier_that_leads_out_of_the_fmu_is_refused() {
    for identifier in ["../../M", "/tmp/M", "folder/M", "..\\M", "\\\\server\\M", "C:M"] {
        let model = format!("modelName='M' modelIdentifier='{identifier}' guid='1'");
        let interface = |version: u32, name: &str| {
            format!(
                "<fmiModelDescription fmiVersion='{version}.0' guid='1' instantiationToken='1'>\
                 <{name} modelIdentifier='{identifier}'/><ModelVariables/></fmiModelDescription>"
            )
        };
        for xml in [
            format!("<fmiModelDescription fmiVersion='1.0' {model}/>"),
            interface(2, "ModelExchange"),
            interface(2, "CoSimulation"),
            interface(3, "ModelExchange"),
            interface(3, "CoSimulation"),
            interface(3, "ScheduledExecution"),
        ] {
            let error = ModelDescription::parse(&xml).unwrap_err().to_string();
            let value = format!("found {identifier:?}");
            assert!(error.contains("modelIdentifier") && error.contains(&value), "{xml}: {error}");
            assert!(ModelDescription::parse(xml.replace(identifier, "M")).is_ok(), "{xml}");
        }
    }
}

#[test]
fn malformed_numbers_are_refused() {
    let number = |attribute: &str| {
        refused(
            &format!(
                r#"<ScalarVariable name="x" valueReference="0"><Real {attribute}/></ScalarVariable>"#
            ),
            "",
        )
    };
    for text in ["1e999", "-1e999", "1,5", "0x10", "1_0", "one", "1.5e"] {
        let error = number(&format!("start=\"{text}\""));
        assert!(error.contains("start: expected a finite number"), "{error}");
        assert!(error.contains(&format!("found {text:?}")), "{error}");
    }
    for (kind, attribute, text) in [
        ("Integer", "start", "2147483648"),
        ("Integer", "start", "-1e300"),
        ("Integer", "min", "1.5"),
        ("Integer", "max", "many"),
        ("Enumeration", "start", "off"),
        ("Boolean", "start", "yes"),
        ("Boolean", "start", "2"),
    ] {
        let error = refused(
            &format!(
                r#"<ScalarVariable name="x" valueReference="0"><{kind} {attribute}="{text}"/></ScalarVariable>"#
            ),
            "",
        );
        assert!(error.contains(&format!("<{kind}>, attribute {attribute}")), "{error}");
    }
}

/// Checks that `variables` and `structure` give an error with a position and the text `said`.
fn assert_refused(variables: &str, structure: &str, said: &str) {
    let error = refused(variables, structure);
    assert!(error.contains(said) && error.starts_with("line "), "{said}: {error}");
}

#[test]
fn a_variable_that_would_mislead_a_simulation_is_refused() {
    for (attributes, content, said) in [
        ("valueReference='0'", "<Real/>", "attribute name"),
        ("name='x'", "<Real/>", "attribute valueReference"),
        ("name='x' valueReference='-1'", "<Real/>", "0 to 4294967295"),
        ("name='x' valueReference='8589934592'", "<Real/>", "0 to 4294967295"),
        ("name='x' valueReference=''", "<Real/>", "0 to 4294967295"),
        ("name='x' valueReference='0'", "", "expected one of Real"),
        ("name='x' valueReference='0'", "<Real/><String/>", "found more"),
        ("name='x' valueReference='0'", "<Real derivative='2'/>", "1 to 1"),
    ] {
        let variable = format!("<ScalarVariable {attributes}>{content}</ScalarVariable>");
        assert_refused(&variable, "", said);
    }
}

fn variable(name: &str, reference: u32, causality: &str) -> String {
    format!(
        "<ScalarVariable name='{name}' valueReference='{reference}' causality='{causality}'>\
         <Real start='0'/></ScalarVariable>"
    )
}

#[test]
fn a_name_of_two_outputs_is_refused() {
    let twice = variable("y", 1, "output") + &variable("y", 2, "output");
    assert_refused(&twice, "", "a name that is used once");
    let hidden = variable("y", 1, "output") + &variable("y", 2, "local");
    assert_refused(&hidden, "", "a name that is used once");
}

#[test]
fn inputs_and_parameters_with_the_same_value_reference_are_refused() {
    for (one, other) in [("input", "input"), ("parameter", "parameter"), ("input", "parameter")] {
        let both = variable("a", 7, one) + &variable("b", 7, other);
        assert_refused(
            &both,
            "",
            "one that no other input or parameter of this type has, a has it",
        );
    }
    let apart = variable("a", 7, "input") + &variable("b", 7, "output");
    ModelDescription::parse(with(&apart, "")).unwrap();
    let typed = variable("a", 7, "input")
        + &variable("b", 7, "input").replace("<Real start='0'/>", "<Integer start='0'/>");
    ModelDescription::parse(with(&typed, "")).unwrap();
}

#[test]
fn types_that_refer_to_types_are_refused() {
    let xml = with(X, "").replace("<Real quantity=", "<Real declaredType=\"Length\" quantity=");
    let error = ModelDescription::parse(xml).unwrap_err().to_string();
    assert!(error.contains("no reference to another type"), "{error}");
}

#[test]
fn conversions_by_numbers_that_are_not_finite_are_refused() {
    for (unit, attribute) in [
        ("<BaseUnit factor='NaN'/>", "factor"),
        ("<BaseUnit offset=''/>", "offset"),
        ("<DisplayUnit name='d' factor='INF'/>", "factor"),
        ("<BaseUnit kg='1.5'/>", "kg"),
    ] {
        let units = format!("<UnitDefinitions><Unit name='u'>{unit}</Unit></UnitDefinitions>");
        let xml = with(X, "").replace("<TypeDefinitions>", &(units + "<TypeDefinitions>"));
        let error = ModelDescription::parse(xml).unwrap_err().to_string();
        assert!(error.contains(&format!("attribute {attribute}")), "{error}");
    }
}

#[test]
fn a_structure_that_would_mislead_a_simulation_is_refused() {
    assert_refused(X, "<Outputs><Unknown/></Outputs>", "attribute index");
    assert_refused(X, "<Outputs/><Outputs/>", "one element Outputs");
    for index in ["0", "2", "x"] {
        let rows = format!("<Derivatives><Unknown index='{index}'/></Derivatives>");
        assert_refused(X, &rows, "1 to 1");
    }
}

#[test]
fn aliases_share_a_value_reference() {
    let alias = X.replace("\"x\"", "\"y\"");
    let description = ModelDescription::parse(with(&format!("{X}{alias}"), "")).unwrap();
    assert_eq!(description.variables[1].value_reference, description.variables[0].value_reference);
}
