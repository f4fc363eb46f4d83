//! A slave with variables of all types, which allocates nothing.

use fmu_description::ModelDescription;
use fmu_description::abi::Status;
use master::fault::{Fault, FaultChain, Window};
use master::{
    Algorithm, CallError, Failure, Scenario, Simulation, Slave, StepResult, System, SystemError,
    Value,
};

use crate::engine::until;

type Done = Result<(), CallError>;

/// Each output is the changed input of its type: the Real plus 0.5 in each step, the Integer plus
/// 1, the Boolean inverted, the String unchanged.
pub(crate) struct Typed {
    description: ModelDescription,
    real: f64,
    integer: i64,
    boolean: i32,
    text: String,
}

fn boxed() -> Box<Typed> {
    let types = [("Real", "0"), ("Integer", "0"), ("Boolean", "false"), ("String", "none")];
    let pair = |(k, (kind, start)): (usize, &(&str, &str))| {
        format!(
            r#"<ScalarVariable name="in{k}" valueReference="0" causality="input">
            <{kind} start="{start}"/></ScalarVariable>
            <ScalarVariable name="out{k}" valueReference="1" causality="output"><{kind}/>
            </ScalarVariable>"#
        )
    };
    let variables: String = types.iter().enumerate().map(pair).collect();
    let output = |k: usize| format!(r#"<Unknown index="{}" dependencies=""/>"#, 2 * k + 2);
    let outputs: String = (0..types.len()).map(output).collect();
    let xml = format!(
        r#"<fmiModelDescription fmiVersion="2.0" modelName="Typed" guid="typed">
        <CoSimulation modelIdentifier="T" canInterpolateInputs="true" maxOutputDerivativeOrder="1"
        canHandleVariableCommunicationStepSize="true"/><ModelVariables>{variables}</ModelVariables>
        <ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"#
    );
    let text = "a text that does not fit into the place of a pointer".to_owned();
    let description = ModelDescription::parse(xml).unwrap();
    Box::new(Typed { description, real: 1.0, integer: 1, boolean: 1, text })
}

/// The same slave with these variables of FMI 3.0.
fn of_fmi_3(variables: &str) -> Box<Typed> {
    let xml = format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="Typed" instantiationToken="typed">
        <CoSimulation modelIdentifier="T"/><ModelVariables>{variables}</ModelVariables><ModelStructure/>
        </fmiModelDescription>"#
    );
    let mut slave = boxed();
    slave.description = ModelDescription::parse(&xml).unwrap();
    slave
}

/// Three of these slaves in a circle, with each type connected.
pub(crate) fn ring() -> System {
    let mut system = System::default();
    for name in ["a", "b", "c"] {
        system.add(name, boxed()).unwrap();
    }
    for (from, to) in [("a", "b"), ("b", "c"), ("c", "a")] {
        for k in 0..4 {
            system.connect(&format!("{from}.out{k}"), &format!("{to}.in{k}")).unwrap();
        }
    }
    system
}

#[test]
fn a_name_in_use_is_refused_and_keeps_its_slave() {
    let mut system = ring();
    assert!(system.add("a", boxed()).is_err());
    assert_eq!((system.slave("a").unwrap(), system.slaves.len()), (0, 3));
}

#[test]
fn a_structural_parameter_that_is_a_real_is_refused_and_not_set_to_zero() {
    let mut system = System::default();
    let variables =
        r#"<Float64 name="scale" valueReference="0" causality="structuralParameter" start="1"/>"#;
    system.add("a", of_fmi_3(variables)).unwrap();
    let message = system.set("a.scale", "2.5").unwrap_err().to_string();
    let expected = "a.scale is a structural parameter of type Float64, expected an integer or a Boolean, \
                    as no other one can be set";
    assert_eq!(message, expected);
}

/// The indices differ: `y[1]` is a vector, `u[1,1]` a matrix, and other tools count from 0.
#[test]
fn two_arrays_of_one_element_are_connected_as_scalars() {
    let variables = r#"<Float64 name="y[1]" valueReference="1" causality="output"/>
        <Float64 name="u[1,1]" valueReference="2" causality="input" start="0"/>
        <Float64 name="v[0]" valueReference="3" causality="input" start="0"/>"#;
    let mut system = System::default();
    for name in ["a", "b"] {
        system.add(name, of_fmi_3(variables)).unwrap();
    }
    let output = system.port("a.y[1]").unwrap();
    for (array, element) in [("b.u", "b.u[1,1]"), ("b.v", "b.v[0]")] {
        let input = system.port(element).unwrap();
        assert_eq!(system.pairs("a.y", array).unwrap(), [(output, input)]);
    }
}

#[test]
fn two_chains_of_faults_of_one_input_are_refused() {
    let system = ring();
    let input = system.port("b.in1").unwrap();
    let fault = (Window { from: 0.0, until: None }, Fault::Stuck(Some(5.0)));
    let chain = FaultChain::new(vec![fault], 1.0).unwrap();
    let faults = vec![(input, chain.clone()), (input, chain)];
    let scenario = Scenario { faults, ..Scenario::default() };
    let run = Simulation::with_scenario(system, &Algorithm::new(1.0), &until(1.0), scenario);
    let message = run.err().unwrap().to_string();
    assert_eq!(message, "b.in1 has two chains of faults, expected one with all its faults");
}

/// The elements of an array of structural parameters are the sizes of `a` and `b`; `a` is declared before them.
struct Sizes {
    description: ModelDescription,
    sizes: [i64; 2],
}

impl Sizes {
    fn new(sizes: [i64; 2]) -> Self {
        let inputs = |name: &str, first: i64, size: i64| -> String {
            let input = |k: i64| {
                let reference = first + k;
                format!(
                    r#"<Float64 name="{name}[{k}]" valueReference="{reference}" causality="input" start="0"/>"#
                )
            };
            (1..=size).map(input).collect()
        };
        let size = |k: i64| {
            format!(
                r#"<UInt64 name="n[{k}]" valueReference="{k}" causality="structuralParameter" start="1"/>"#
            )
        };
        let variables = [inputs("a", 10, sizes[0]), size(1), size(2), inputs("b", 20, sizes[1])];
        Self { description: of_fmi_3(&variables.concat()).description, sizes }
    }
}

impl Slave for Sizes {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn configure(&mut self, references: &[u32], values: &[i64]) -> Done {
        self.sizes[references[0] as usize - 1] = values[0];
        *self = Self::new(self.sizes);
        Ok(())
    }
    fn get_real(&mut self, _: &[u32], _: &mut [f64]) -> Done {
        Ok(())
    }
    fn set_real(&mut self, _: &[u32], _: &[f64]) -> Done {
        Ok(())
    }
    fn do_step(&mut self, _: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
        Ok(StepResult::Whole)
    }
}

#[test]
fn an_array_of_structural_parameters_is_set_whole_although_its_elements_move() {
    let mut system = System::default();
    system.add("s", Box::new(Sizes::new([1, 1]))).unwrap();
    system.set("s.n", "4 3").unwrap();
    let exists = |name: &str| system.port(name).is_ok();
    assert_eq!(["s.a[4]", "s.a[5]", "s.b[3]", "s.b[4]"].map(exists), [true, false, true, false]);
}

/// The value at which it sticks, and 1 for the step.
#[test]
fn a_fault_of_an_integer_of_64_bits_has_values_beyond_32_bits() {
    let variables = r#"<Int64 name="in" valueReference="0" causality="input" start="0"/>
        <Int64 name="out" valueReference="1" causality="output"/>"#;
    let mut system = System::default();
    system.add("a", of_fmi_3(variables)).unwrap();
    system.add("b", of_fmi_3(variables)).unwrap();
    system.connect("a.out", "b.in").unwrap();
    let (input, output) = (system.port("b.in").unwrap(), system.port("b.out").unwrap());
    let fault = (Window { from: 0.0, until: None }, Fault::Stuck(Some(5e9)));
    let faults = vec![(input, FaultChain::new(vec![fault], 1.0).unwrap())];
    let scenario = Scenario { faults, ..Scenario::default() };
    let algorithm = Algorithm::new(1.0);
    let run = Simulation::with_scenario(system, &algorithm, &until(1.0), scenario);
    let mut simulation = run.unwrap();
    simulation.step().unwrap();
    let value = simulation.system().get_value(output).unwrap();
    assert_eq!(value, Value::Integer(5_000_000_001));
}

/// A slave whose only variable is a `Float32`.
struct Single {
    description: ModelDescription,
    value: f32,
}

impl Slave for Single {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn get_real(&mut self, _: &[u32], values: &mut [f64]) -> Done {
        if self.value < 0.0 {
            let failure = Failure::Status(Status::Error);
            return Err(CallError { function: "fmi3GetFloat32", failure, messages: Vec::new() });
        }
        values[0] = self.value.into();
        Ok(())
    }
    #[expect(clippy::cast_possible_truncation, reason = "the nearest f32")]
    fn set_real(&mut self, _: &[u32], values: &[f64]) -> Done {
        self.value = values[0] as f32;
        Ok(())
    }
    fn do_step(&mut self, _: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
        Ok(StepResult::Whole)
    }
}

/// The `f32` nearest to 0.1 is 1.5e-9 larger.
#[test]
fn a_parameter_of_type_float32_keeps_a_setting_that_it_rounds() {
    let variables = r#"<Float32 name="p" valueReference="0" causality="parameter" start="1"/>"#;
    let mut system = System::default();
    let description = of_fmi_3(variables).description;
    system.add("a", Box::new(Single { description, value: 1.0 })).unwrap();
    system.set("a.p", "0.1").unwrap();
    let parameter = system.port("a.p").unwrap();
    let mut simulation = Simulation::new(system, &Algorithm::new(1.0), &until(1.0)).unwrap();
    let value = simulation.system().get_value(parameter).unwrap();
    assert_eq!(value, Value::Real(0.1_f32.into()));
}

#[test]
fn a_setting_that_ends_its_fmu_is_an_error_of_this_fmu_that_names_the_variable() {
    let variables = r#"<Float32 name="p" valueReference="0" causality="parameter" start="1"/>"#;
    let mut system = System::default();
    let description = of_fmi_3(variables).description;
    system.add("a", Box::new(Single { description, value: 1.0 })).unwrap();
    system.set("a.p", "-1").unwrap();
    let error = Simulation::new(system, &Algorithm::new(1.0), &until(1.0)).err().unwrap();
    assert_eq!(error.to_string(), "a.p at t = 0 s: fmi3GetFloat32 returned fmi3Error");
    let SystemError::Variable { slave, .. } = &error else { panic!("{error:?}") };
    assert_eq!(&**slave, "a");
}

impl Slave for Typed {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn get_real(&mut self, _: &[u32], values: &mut [f64]) -> Done {
        values[0] = self.real;
        Ok(())
    }
    fn set_real(&mut self, _: &[u32], values: &[f64]) -> Done {
        self.real = values[0];
        Ok(())
    }
    fn get_integer(&mut self, _: &[u32], values: &mut [i64]) -> Done {
        values[0] = self.integer;
        Ok(())
    }
    fn set_integer(&mut self, _: &[u32], values: &[i64]) -> Done {
        self.integer = values[0];
        Ok(())
    }
    fn get_boolean(&mut self, _: &[u32], values: &mut [i32]) -> Done {
        values[0] = self.boolean;
        Ok(())
    }
    fn set_boolean(&mut self, _: &[u32], values: &[i32]) -> Done {
        self.boolean = values[0];
        Ok(())
    }
    fn get_string(&mut self, _: &[u32], values: &mut [String]) -> Done {
        values[0].clone_from(&self.text);
        Ok(())
    }
    fn set_string(&mut self, _: &[u32], values: &[String]) -> Done {
        self.text.clone_from(&values[0]);
        Ok(())
    }
    fn set_input_derivatives(&mut self, _: &[u32], _: &[i32], _: &[f64]) -> Done {
        Ok(())
    }
    fn get_output_derivatives(&mut self, _: &[u32], _: &[i32], values: &mut [f64]) -> Done {
        values[0] = 0.0;
        Ok(())
    }
    fn do_step(&mut self, _: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
        self.real += 0.5;
        self.integer += 1;
        self.boolean = 1 - self.boolean;
        Ok(StepResult::Whole)
    }
}
