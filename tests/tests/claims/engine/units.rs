//! Units of connected variables: temperatures, and differences of temperatures.

use master::{System, Transformation};

use super::memory::{Memory, after_step};

/// A slave with the outputs `rise`, a difference of 5 K, and `temperature`, 293.15 K, and with inputs in other units.
fn boxed() -> Box<Memory> {
    let variable = |(reference, (name, attributes)): (usize, &(&str, &str))| {
        let (role, start) = if reference < 2 { ("output", "") } else { ("input", "start='0'") };
        format!(
            "<ScalarVariable name='{name}' valueReference='{reference}' causality='{role}'>
            <Real {start} {attributes}/></ScalarVariable>"
        )
    };
    let variables = [
        ("rise", "unit='K' relativeQuantity='true'"),
        ("temperature", "unit='K'"),
        ("rise_in_degC", "unit='degC' relativeQuantity='true'"),
        ("rise_in_degF", "unit='degF' relativeQuantity='true'"),
        ("temperature_in_degC", "unit='degC'"),
        ("temperature_in_mK", "unit='mK'"),
    ];
    let variables: String = variables.iter().enumerate().map(variable).collect();
    let description = format!(
        r#"<fmiModelDescription fmiVersion="2.0" modelName="Heater" guid="heater">
        <CoSimulation modelIdentifier="H" canHandleVariableCommunicationStepSize="true"/>
        <UnitDefinitions><Unit name="K"><BaseUnit K="1"/></Unit>
        <Unit name="mK"><BaseUnit K="1" factor="0.001"/></Unit>
        <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
        <Unit name="degF"><BaseUnit K="1" factor="0.5555555555555556" offset="255.3722222222222"/>
        </Unit></UnitDefinitions><ModelVariables>{variables}</ModelVariables>
        <ModelStructure><Outputs><Unknown index="1" dependencies=""/>
        <Unknown index="2" dependencies=""/></Outputs></ModelStructure></fmiModelDescription>"#
    );
    Memory::boxed(&description, &[5.0, 293.15, 0.0, 0.0, 0.0, 0.0])
}

fn system() -> System {
    let mut system = System::default();
    system.add("a", boxed()).unwrap();
    system.add("b", boxed()).unwrap();
    system
}

/// 5 K are 5 degC and 9 degF, and 293.15 K is 20 degC.
#[test]
fn a_difference_has_no_offset_and_a_temperature_has_one() {
    let inputs = ["rise_in_degC", "rise_in_degF", "temperature_in_degC"];
    let mut system = system();
    for input in inputs {
        let output = input.split('_').next().unwrap();
        system.connect(&format!("a.{output}"), &format!("b.{input}")).unwrap();
    }
    for (actual, expected) in after_step(system, &inputs).into_iter().zip([5.0, 9.0, 20.0]) {
        assert!((actual - expected).abs() < 1e-9, "{actual} {expected}");
    }
}

#[test]
fn a_difference_is_no_temperature_if_an_offset_separates_their_units() {
    let mut system = system();
    let error = system.connect("a.rise", "b.temperature_in_degC").unwrap_err().to_string();
    let expected = "a.rise in K is a difference (relativeQuantity) and b.temperature_in_degC in \
                    degC is not: state factor and offset of the connection";
    assert_eq!(error, expected);
    let error = system.connect("a.temperature", "b.rise_in_degC").unwrap_err().to_string();
    assert!(error.starts_with("b.rise_in_degC in degC is a difference"), "{error}");
    // 1 K are 1000 mK, a difference or not.
    system.connect("a.rise", "b.temperature_in_mK").unwrap();
    let thousand = Transformation::Linear { factor: 1000.0, offset: 0.0 };
    assert_eq!(system.connections[0].transformation, thousand);
}
