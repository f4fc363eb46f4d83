//! Aliases of FMI 3.0: another name of the same value.

use master::{
    Algorithm, Extrapolation, Method, Readout, Simulation, System, by_direct_dependencies,
};

use super::memory::{Memory, after_step};
use super::until;

/// A slave with the input `u` and its alias `also u`, the parameter `p` and its alias `also p`, and the output `y`, which
/// is `u`.
fn boxed() -> Box<Memory> {
    let description = r#"<fmiModelDescription fmiVersion="3.0" modelName="A" instantiationToken="t">
        <CoSimulation modelIdentifier="A" canHandleVariableCommunicationStepSize="true"/><ModelVariables>
        <Float64 name="u" valueReference="0" causality="input" start="1"><Alias name="also u"/></Float64>
        <Float64 name="p" valueReference="1" causality="parameter" variability="tunable" start="2">
        <Alias name="also p"/></Float64>
        <Float64 name="y" valueReference="2" causality="output"/></ModelVariables>
        <ModelStructure><Output valueReference="2"/></ModelStructure></fmiModelDescription>"#;
    Memory::boxed(description, &[1.0, 2.0])
}

#[test]
fn a_variable_and_its_alias_have_one_value_and_one_setting() {
    for (input, parameter) in [("u", "p"), ("also u", "also p")] {
        let mut system = System::default();
        system.add("b", boxed()).unwrap();
        for (name, value) in [("u", "5"), ("also p", "6"), (input, "7"), (parameter, "8")] {
            system.set(&format!("b.{name}"), value).unwrap();
        }
        let actual = after_step(system, &["u", "also u", "p", "also p"]);
        assert_eq!(actual, [7.0, 7.0, 8.0, 8.0], "{input}");
    }
}

#[test]
fn an_input_is_connected_if_its_alias_is() {
    let system = || {
        let mut system = System::default();
        system.add("a", boxed()).unwrap();
        system.add("b", boxed()).unwrap();
        system.set("a.u", "3").unwrap();
        system.connect("a.y", "b.also u").unwrap();
        system
    };
    assert_eq!(after_step(system(), &["u", "also u"]), [3.0, 3.0]);
    let error = system().connect("a.y", "b.u").unwrap_err().to_string();
    assert_eq!(error, "b.u is connected twice, to a.y and to a.y");
    let (free, names) = (system().free_inputs(), system());
    let free: Vec<_> = free.into_iter().map(|port| names.name(port)).collect();
    assert_eq!(free, ["a.u", "a.also u"]);
}

/// A slave with the input `u`, its output `y`, which is `u`, and an alias of each.
fn through() -> Box<Memory> {
    let description = r#"<fmiModelDescription fmiVersion="3.0" modelName="A" instantiationToken="t">
        <CoSimulation modelIdentifier="A" canHandleVariableCommunicationStepSize="true"/><ModelVariables>
        <Float64 name="u" valueReference="0" causality="input" start="0"><Alias name="also u"/></Float64>
        <Float64 name="y" valueReference="1" causality="output"><Alias name="also y"/></Float64>
        </ModelVariables><ModelStructure><Output valueReference="1" dependencies="0"/></ModelStructure>
        </fmiModelDescription>"#;
    Memory::boxed(description, &[0.0])
}

#[test]
fn direct_dependencies_are_the_same_for_aliases() {
    for (input, output) in [("u", "y"), ("also u", "y"), ("u", "also y"), ("also u", "also y")] {
        let mut ring = System::default();
        for name in ["a", "b"] {
            ring.add(name, through()).unwrap();
        }
        ring.connect(&format!("a.{output}"), &format!("b.{input}")).unwrap();
        ring.connect(&format!("b.{output}"), &format!("a.{input}")).unwrap();
        assert_eq!(by_direct_dependencies(&ring).looped, [0, 1], "{input} {output}");
        let mut chain = System::default();
        for name in ["b", "c", "a"] {
            chain.add(name, through()).unwrap();
        }
        chain.set("a.u", "3").unwrap();
        chain.connect(&format!("c.{output}"), &format!("b.{input}")).unwrap();
        chain.connect(&format!("a.{output}"), &format!("c.{input}")).unwrap();
        let ports = [chain.port("b.y").unwrap()];
        let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 1.0);
        let mut simulation = Simulation::new(chain, &algorithm, &until(1.0)).unwrap();
        let mut readout = Readout::new(simulation.system(), &ports);
        readout.read(simulation.system(), 0.0).unwrap();
        assert_eq!(readout.reals, [3.0], "{input} {output}");
    }
}
