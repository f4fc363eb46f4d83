//! FMI 1.0, co-simulation.

use super::*;
use crate::description::{DependencyKind, Unknown};

const COUPLING: &str = r#"<?xml version="1.0" encoding="ISO-8859-1"?>
<fmiModelDescription fmiVersion="1.0" modelName="My.Coupling" modelIdentifier="My_Coupling"
    guid="{1}" numberOfContinuousStates="1" numberOfEventIndicators="0">
  <UnitDefinitions>
    <BaseUnit unit="rad"><DisplayUnitDefinition displayUnit="deg" gain="57.5"/></BaseUnit>
  </UnitDefinitions>
  <TypeDefinitions>
    <Type name="Angle"><RealType unit="rad" displayUnit="deg" min="-3.5"/></Type>
    <Type name="Gear"><EnumerationType><Item name="low"/><Item name="high"/></EnumerationType></Type>
  </TypeDefinitions>
  <DefaultExperiment startTime="0" stopTime="2.5"/>
  <ModelVariables>
    <ScalarVariable name="k" valueReference="0" variability="parameter" causality="internal">
      <Real start="2" fixed="true"/></ScalarVariable>
    <ScalarVariable name="2k" valueReference="1" variability="parameter"><Real/></ScalarVariable>
    <ScalarVariable name="phi1" valueReference="2" causality="input">
      <Real declaredType="Angle" start="0.5"/></ScalarVariable>
    <ScalarVariable name="gear" valueReference="0" causality="input">
      <Enumeration declaredType="Gear" start="2"/></ScalarVariable>
    <ScalarVariable name="tau1" valueReference="3" causality="output"><Real start="0" fixed="false"/>
      <DirectDependency><Name>gear</Name><Name>phi1</Name></DirectDependency></ScalarVariable>
    <ScalarVariable name="tau2" valueReference="3" causality="output" alias="negatedAlias"><Real/>
    </ScalarVariable>
    <ScalarVariable name="on" valueReference="0" causality="output" variability="discrete">
      <Boolean/><DirectDependency/></ScalarVariable>
    <ScalarVariable name="x" valueReference="4" causality="none"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="4" alias="alias"><Real/></ScalarVariable>
  </ModelVariables>
  <Implementation><CoSimulation_StandAlone>
    <Capabilities canHandleVariableCommunicationStepSize="true" canInterpolateInputs="1"
        maxOutputDerivativeOrder="1" canRejectSteps="true"/>
  </CoSimulation_StandAlone></Implementation>
</fmiModelDescription>"#;

fn read(xml: &str) -> ModelDescription {
    let (description, warnings) = ModelDescription::read(xml).expect("readable");
    assert_eq!(warnings, []);
    description
}

#[test]
fn roles_of_variables_become_those_of_later_versions() {
    let description = read(COUPLING);
    let role = |name: &str| {
        let variable = description.variable(name).unwrap();
        (variable.causality, variable.variability, variable.initial)
    };
    assert_eq!(role("k"), (Causality::Parameter, Variability::Fixed, None));
    assert_eq!(role("2k"), (Causality::CalculatedParameter, Variability::Fixed, None));
    assert_eq!(role("phi1"), (Causality::Input, Variability::Continuous, None));
    assert_eq!(role("gear"), (Causality::Input, Variability::Discrete, None));
    let guess = Some(Initial::Approx);
    assert_eq!(role("tau1"), (Causality::Output, Variability::Continuous, guess));
    assert_eq!(role("on"), (Causality::Output, Variability::Discrete, None));
    assert_eq!(role("x"), (Causality::Local, Variability::Continuous, Some(Initial::Exact)));
}

#[test]
fn an_output_that_is_constant_after_the_initialization_stays_an_output() {
    let xml = COUPLING.replace(
        r#"name="tau1" valueReference="3""#,
        r#"name="tau1" valueReference="3" variability="parameter""#,
    );
    let description = read(&xml);
    let variable = description.variable("tau1").unwrap();
    let role = (variable.causality, variable.variability, variable.initial);
    assert_eq!(role, (Causality::Output, Variability::Discrete, Some(Initial::Approx)));
    assert_eq!(description.structure.outputs[0].dependencies.as_deref(), Some(&[3, 4][..]));
}

#[test]
fn an_alias_names_its_variable_and_whether_the_sign_differs() {
    let description = read(COUPLING);
    let alias = |name: &str| {
        let variable = description.variable(name).unwrap();
        (variable.alias_of.as_deref(), variable.negated)
    };
    assert_eq!(alias("tau1"), (None, false));
    assert_eq!(alias("tau2"), (Some("tau1"), true));
    assert_eq!(alias("y"), (Some("x"), false));
    // `on` has the value reference 0 too, but another type: it is another variable.
    assert_eq!(alias("on"), (None, false));
}

#[test]
fn a_direct_dependency_is_one_of_an_output() {
    let row = |index, dependencies: Option<&[u32]>| Unknown {
        index,
        dependencies: dependencies.map(<[u32]>::to_vec),
        kinds: None::<Vec<DependencyKind>>,
    };
    let outputs = read(COUPLING).structure.outputs;
    assert_eq!(outputs, [row(5, Some(&[3, 4])), row(6, None), row(7, Some(&[]))]);
}

#[test]
fn a_direct_dependency_names_an_input_with_escaped_characters() {
    let xml = COUPLING
        .replace("name=\"gear\"", "name=\"gear &lt;1&gt;\"")
        .replace("<Name>gear</Name>", "<Name> gear &lt;1&#62; </Name>");
    assert_eq!(read(&xml).structure.outputs[0].dependencies.as_deref(), Some(&[3, 4][..]));
}

#[test]
fn types_units_and_the_experiment_are_read() {
    let description = read(COUPLING);
    assert_eq!((description.version(), description.guid.as_str()), (Version::V1, "{1}"));
    let Kind::Real(angle) = &description.variable("phi1").unwrap().kind else { panic!("Real") };
    assert_eq!(
        (angle.unit.as_deref(), angle.min, angle.start),
        (Some("rad"), Some(-3.5), Some(0.5))
    );
    let degrees = DisplayUnit { name: "deg".into(), factor: 57.5, offset: 0.0, inverse: false };
    assert_eq!(description.units[0].display_units, [degrees]);
    let items = [("low".to_owned(), 1), ("high".to_owned(), 2)];
    assert_eq!(description.types[1].items, items);
    assert_eq!(description.default_experiment.unwrap().stop_time, Some(2.5));
}

#[test]
fn a_difference_is_relative_by_its_declared_type() {
    let relative = |xml: &str| {
        let description = read(xml);
        ["phi1", "tau1"].map(|name| {
            let variable = description.variable(name).unwrap();
            variable.kind.as_real().unwrap().is_relative()
        })
    };
    assert_eq!(relative(COUPLING), [false, false]);
    let typed = COUPLING.replace("<RealType ", "<RealType relativeQuantity=\"true\" ");
    assert_eq!(relative(&typed), [true, false]);
    let stated = typed.replace("\"Angle\" start", "\"Angle\" relativeQuantity=\"0\" start");
    assert_eq!(relative(&stated), [false, false]);
}

#[test]
fn the_implementation_decides_between_the_interfaces() {
    let flags = read(COUPLING).co_simulation.unwrap();
    assert_eq!(flags.model_identifier, "My_Coupling");
    assert!(flags.can_handle_variable_communication_step_size && flags.can_interpolate_inputs);
    assert!(flags.can_reject_steps && !flags.needs_execution_tool);
    assert_eq!(flags.max_output_derivative_order, 1);

    let tool = COUPLING.replace("CoSimulation_StandAlone", "CoSimulation_Tool");
    assert!(read(&tool).co_simulation.unwrap().needs_execution_tool);

    let (start, end) = (COUPLING.find("<Implementation").unwrap(), COUPLING.len());
    let exchange = read(&format!("{}</fmiModelDescription>", &COUPLING[..start.min(end)]));
    assert_eq!(exchange.co_simulation, None);
    assert_eq!(exchange.model_exchange.unwrap().model_identifier, "My_Coupling");
}

#[test]
fn an_unknown_name_in_a_direct_dependency_may_be_anything() {
    let xml = COUPLING.replace("<Name>gear</Name>", "<Name>none</Name>");
    let (description, warnings) = ModelDescription::read(xml).unwrap();
    assert_eq!(description.structure.outputs[0].dependencies, None);
    let text = warnings[0].to_string();
    assert!(text.contains("expected the name of an input, found \"none\""), "{text}");
}
