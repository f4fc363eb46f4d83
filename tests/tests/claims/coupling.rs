//! The master algorithms on slaves of a few lines, against answers computed by hand.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; exact by construction")]

use std::collections::HashMap;

use fmu_description::Experiment;
use fmu_description::ModelDescription;
use fmu_description::abi::Status;
use master::{
    Algorithm, CallError, Extrapolation, Failure, Method, Simulation, Slave, StepResult, System,
    by_direct_dependencies,
};
use ssp::Function;

const JACOBI: (Method, Extrapolation) = (Method::Jacobi, Extrapolation::Hold);
const GAUSS_SEIDEL: (Method, Extrapolation) = (Method::GaussSeidel, Extrapolation::Limited);
const GAUSS_SEIDEL_HOLD: (Method, Extrapolation) = (Method::GaussSeidel, Extrapolation::Hold);

/// x' = gain u, stepped exactly for a line u + slope t; with `direct` the output is y = u instead.
struct Integrator {
    description: ModelDescription,
    gain: f64,
    x: f64,
    u: f64,
    slope: f64,
    direct: bool,
    fails_at: f64,
    saved: HashMap<usize, [f64; 3]>,
}

impl Integrator {
    fn boxed(gain: f64, x: f64, direct: bool) -> Box<Self> {
        let dependencies = if direct { "1" } else { "" };
        let xml = format!(
            r#"<fmiModelDescription fmiVersion="2.0" modelName="Integrator" guid="g">
            <CoSimulation modelIdentifier="I" canInterpolateInputs="true"
            canHandleVariableCommunicationStepSize="true" maxOutputDerivativeOrder="1"/>
            <ModelVariables>
            <ScalarVariable name="u" valueReference="1" causality="input"><Real start="0"/></ScalarVariable>
            <ScalarVariable name="y" valueReference="2" causality="output"><Real/></ScalarVariable>
            </ModelVariables><ModelStructure><Outputs>
            <Unknown index="2" dependencies="{dependencies}"/></Outputs></ModelStructure>
            </fmiModelDescription>"#
        );
        let description = ModelDescription::parse(xml).unwrap();
        let fails_at = f64::INFINITY;
        let saved = HashMap::new();
        Box::new(Self { description, gain, x, u: 0.0, slope: 0.0, direct, fails_at, saved })
    }
}

impl Slave for Integrator {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        values[0] = match references {
            [1] => self.u,
            [2] if self.direct => self.u,
            [2] => self.x,
            _ => panic!("there is no {references:?}"),
        };
        Ok(())
    }
    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        assert_eq!(references, [1]);
        self.u = values[0];
        Ok(())
    }
    fn set_input_derivatives(
        &mut self,
        _: &[u32],
        _: &[i32],
        slopes: &[f64],
    ) -> Result<(), CallError> {
        self.slope = slopes[0];
        Ok(())
    }
    fn get_output_derivatives(
        &mut self,
        _: &[u32],
        _: &[i32],
        slopes: &mut [f64],
    ) -> Result<(), CallError> {
        slopes[0] = self.gain * self.u;
        Ok(())
    }
    fn do_step(&mut self, time: f64, size: f64, _: bool) -> Result<StepResult, CallError> {
        if time >= self.fails_at {
            let messages = vec!["out of paper".to_owned()];
            return Err(CallError {
                function: "fmi2DoStep",
                failure: Failure::Status(Status::Error),
                messages,
            });
        }
        self.x += self.gain * (self.u * size + 0.5 * self.slope * size * size);
        self.u += self.slope * size;
        self.slope = 0.0;
        Ok(StepResult::Whole)
    }
    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.saved.insert(slot, [self.x, self.u, self.slope]);
        Ok(())
    }
    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        [self.x, self.u, self.slope] = self.saved[&slot];
        Ok(())
    }
}

/// x' = v, v' = -x: two integrators in a ring, from x = 1, v = 0.5.
fn ring() -> System {
    let mut system = System::default();
    system.add("a", Integrator::boxed(1.0, 1.0, false)).unwrap();
    system.add("b", Integrator::boxed(-1.0, 0.5, false)).unwrap();
    system.connect("a.y", "b.u").unwrap();
    system.connect("b.y", "a.u").unwrap();
    system
}

fn start(system: System, method: (Method, Extrapolation), stop_time: Option<f64>) -> Simulation {
    let experiment = Experiment { stop_time, ..Experiment::default() };
    Simulation::new(system, &Algorithm::fixed(method.0, method.1, 0.5), &experiment).unwrap()
}

fn outputs(simulation: &mut Simulation) -> [f64; 2] {
    let mut read = |slave: usize| {
        let mut value = [0.0];
        simulation.system().slaves[slave].1.get_real(&[2], &mut value).unwrap();
        value[0]
    };
    [read(0), read(1)]
}

#[test]
fn jacobi_steps_all_slaves_from_the_same_values() {
    let mut simulation = start(ring(), JACOBI, None);
    simulation.step().unwrap();
    assert_eq!(outputs(&mut simulation), [1.0 + 0.5 * 0.5, 0.5 - 0.5 * 1.0]);
}

#[test]
fn gauss_seidel_with_held_inputs_gives_the_later_slave_the_new_value() {
    let mut simulation = start(ring(), GAUSS_SEIDEL_HOLD, None);
    simulation.step().unwrap();
    assert_eq!(outputs(&mut simulation), [1.25, 0.5 - 0.5 * 1.25]);
}

#[test]
fn gauss_seidel_gives_the_later_slave_the_line_between_both_values() {
    let mut simulation = start(ring(), GAUSS_SEIDEL, None);
    simulation.step().unwrap();
    let v = 0.5 - 0.5 * 0.5 * (1.0 + 1.25);
    assert_eq!(outputs(&mut simulation), [1.25, v]);
    // Second step: v fell by 0.5625 over 0.5 s, its derivative is -1.25: the quotient is smaller.
    simulation.step().unwrap();
    let x = 1.25 + 0.5 * v + 0.125 * ((v - 0.5) / 0.5);
    assert_eq!(outputs(&mut simulation), [x, v - 0.25 * (1.25 + x)]);
}

#[test]
fn a_run_that_returns_to_a_kept_state_repeats_its_steps_bit_for_bit() {
    let mut simulation = start(ring(), GAUSS_SEIDEL, Some(5.0));
    let mut kept = Vec::new();
    for slot in 0..3 {
        simulation.step().unwrap();
        let state = simulation.keep(slot).unwrap();
        assert_eq!(state.slot(), slot);
        kept.push((state, simulation.time(), outputs(&mut simulation)));
    }
    simulation.step().unwrap();
    let last = outputs(&mut simulation);
    for (state, time, values) in kept.iter().rev() {
        simulation.return_to(state).unwrap();
        assert_eq!((simulation.time(), outputs(&mut simulation)), (*time, *values));
    }
    for _ in 0..3 {
        simulation.step().unwrap();
    }
    assert_eq!((simulation.time(), outputs(&mut simulation)), (2.0, last));
}

#[test]
fn the_last_step_ends_at_the_stop_time() {
    let mut simulation = start(ring(), JACOBI, Some(1.2));
    let mut times = Vec::new();
    while !simulation.is_finished() {
        simulation.step().unwrap();
        times.push(simulation.time());
    }
    assert_eq!(times, [0.5, 1.0, 1.2]);
}

#[test]
fn a_slave_that_takes_equal_steps_only_is_not_given_a_shorter_one() {
    let mut rigid = Integrator::boxed(1.0, 1.0, false);
    let flags = rigid.description.co_simulation.as_mut().unwrap();
    flags.can_handle_variable_communication_step_size = false;
    let mut system = ring();
    system.slaves[0].1 = rigid;
    let experiment = Experiment { stop_time: Some(1.2), ..Experiment::default() };
    let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.5);
    let mut simulation = Simulation::new(system, &algorithm, &experiment).unwrap();
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    assert_eq!(simulation.time(), 1.0);
    let early = simulation.early_end().unwrap();
    assert_eq!((early.slave.as_str(), early.end, early.stop), ("a", 1.0, 1.2));
}

#[test]
fn a_slave_whose_output_passes_its_input_through_comes_after_its_source() {
    let mut system = System::default();
    system.add("through", Integrator::boxed(1.0, 0.0, true)).unwrap();
    system.add("source", Integrator::boxed(1.0, 2.0, false)).unwrap();
    system.connect("source.y", "through.u").unwrap();
    system.connect("through.y", "source.u").unwrap();
    let order = by_direct_dependencies(&system);
    assert_eq!((order.sequence, order.looped), (vec![1, 0], vec![]));
}

#[test]
fn slaves_that_pass_through_in_a_circle_are_reported_as_a_loop() {
    let mut system = System::default();
    for name in ["one", "other"] {
        system.add(name, Integrator::boxed(1.0, 0.0, true)).unwrap();
    }
    system.connect("one.y", "other.u").unwrap();
    system.connect("other.y", "one.u").unwrap();
    let order = by_direct_dependencies(&system);
    assert_eq!((order.sequence, order.looped), (vec![0, 1], vec![0, 1]));
}

#[test]
fn initial_values_pass_through_a_chain_of_direct_dependencies() {
    let mut system = System::default();
    system.add("last", Integrator::boxed(1.0, 0.0, true)).unwrap();
    system.add("middle", Integrator::boxed(1.0, 0.0, true)).unwrap();
    system.add("first", Integrator::boxed(1.0, 7.0, false)).unwrap();
    system.connect("first.y", "middle.u").unwrap();
    system.connect("middle.y", "last.u").unwrap();
    let mut simulation = start(system, GAUSS_SEIDEL, None);
    assert_eq!(outputs(&mut simulation), [7.0, 7.0]);
}

#[test]
fn an_output_that_is_not_a_number_stops_the_run_with_its_name_and_time() {
    let mut system = ring();
    system.slaves[0].1 = Integrator::boxed(f64::INFINITY, 1.0, false);
    let mut simulation = start(system, JACOBI, None);
    let message = simulation.step().unwrap_err().to_string();
    assert_eq!(message, "a.y is inf at t = 0.5 s, expected a finite number");
}

#[test]
fn a_failing_slave_is_named_with_time_function_and_message() {
    let mut broken = Integrator::boxed(1.0, 1.0, false);
    broken.fails_at = 0.5;
    let mut system = ring();
    system.slaves[1].1 = broken;
    let mut simulation = start(system, JACOBI, None);
    simulation.step().unwrap();
    let message = simulation.step().unwrap_err().to_string();
    assert_eq!(message, "b at t = 0.5 s: fmi2DoStep returned fmi2Error: out of paper");
}

#[test]
fn an_input_takes_one_source_only() {
    let mut system = ring();
    let message = system.connect("a.y", "a.u").unwrap_err().to_string();
    assert_eq!(message, "a.u is connected twice, to b.y and to a.y");
}

/// x' = x + 2 by an integrator that gets the sum of its own output and of a constant.
fn with_sum() -> System {
    let mut system = System::default();
    let sum = Function::Sum { inputs: 2 };
    system.add("sum", Box::new(sum.slave())).unwrap();
    system.add("a", Integrator::boxed(1.0, 1.0, false)).unwrap();
    system.add("constant", Integrator::boxed(1.0, 2.0, false)).unwrap();
    system.connect("a.y", "sum.in[0]").unwrap();
    system.connect("constant.y", "sum.in[1]").unwrap();
    system.connect("sum.out", "a.u").unwrap();
    system
}

#[test]
fn a_function_is_computed_between_the_steps_in_any_order_of_the_slaves() {
    for method in [JACOBI, GAUSS_SEIDEL_HOLD] {
        let mut simulation = start(with_sum(), method, None);
        let mut x = 1.0;
        for _ in 0..5 {
            simulation.step().unwrap();
            x += 0.5 * (x + 2.0);
            let mut actual = [0.0; 2];
            simulation.system().slaves[1].1.get_real(&[2], &mut actual[..1]).unwrap();
            simulation.system().slaves[0].1.get_real(&[2], &mut actual[1..]).unwrap();
            // A function that lags by one step would give another x from the second step on.
            assert_eq!(actual, [x, x + 2.0], "{method:?}");
        }
    }
}

#[test]
fn a_function_of_a_slower_slave_gets_its_value_at_the_current_time() {
    // The slow one is x' = 3, the fast one x' = the sum of its own output and the slow one's.
    let mut system = with_sum();
    system.add("three", Integrator::boxed(1.0, 3.0, false)).unwrap();
    system.connect("three.y", "constant.u").unwrap();
    let mut algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.5);
    algorithm.multiples = vec![1, 1, 2, 1];
    let mut simulation = Simulation::new(system, &algorithm, &Experiment::default()).unwrap();
    let (mut x, mut slow) = (1.0, 2.0);
    for step in 0..6 {
        simulation.step().unwrap();
        x += 0.5 * (x + slow);
        if step % 2 == 1 {
            slow += 3.0;
        }
        let mut actual = [0.0];
        simulation.system().slaves[1].1.get_real(&[2], &mut actual).unwrap();
        assert_eq!(actual, [x], "{step}");
    }
}

#[test]
fn a_function_of_extrapolated_inputs_reaches_their_end_values() {
    let mut simulation = start(with_sum(), (Method::GaussSeidel, Extrapolation::Linear), None);
    for _ in 0..3 {
        simulation.step().unwrap();
        let mut actual = [0.0; 3];
        simulation.system().slaves[0].1.get_real(&[2], &mut actual[..1]).unwrap();
        simulation.system().slaves[1].1.get_real(&[2], &mut actual[1..2]).unwrap();
        simulation.system().slaves[2].1.get_real(&[2], &mut actual[2..]).unwrap();
        let sum: f64 = actual[1] + actual[2];
        assert!((actual[0] - sum).abs() <= 1e-12 * sum.abs(), "{actual:?}");
    }
}

#[test]
fn a_vector_sum_adds_component_by_component_and_keeps_its_state() {
    let mut slave = Function::VectorSum { inputs: 3, dimension: 2 }.slave();
    let names: Vec<_> = slave.description().variables.iter().map(|v| v.name.clone()).collect();
    let expected = "in[0][0] in[0][1] in[1][0] in[1][1] in[2][0] in[2][1] out[0] out[1]";
    assert_eq!(names.join(" "), expected);
    assert_eq!(slave.description().problems(), []);
    slave.set_real(&[0, 1, 2, 3, 4, 5], &[1.0, 10.0, 2.0, 20.0, 4.0, 40.0]).unwrap();
    let mut sums = [0.0; 2];
    slave.get_real(&[6, 7], &mut sums).unwrap();
    assert_eq!(sums, [7.0, 70.0]);
    let mut changes = [0.0; 2];
    slave.directional_derivative(&[6, 7], &[0, 3, 5], &[1.0, 2.0, 3.0], &mut changes).unwrap();
    assert_eq!(changes, [1.0, 5.0]);
    let bytes = slave.serialize_state().unwrap();
    slave.save_state(0).unwrap();
    slave.set_real(&[0], &[100.0]).unwrap();
    slave.restore_state(0).unwrap();
    slave.get_real(&[6, 7], &mut sums).unwrap();
    assert_eq!(sums, [7.0, 70.0]);
    slave.set_real(&[0], &[100.0]).unwrap();
    slave.deserialize_state(&bytes).unwrap();
    slave.get_real(&[6, 7], &mut sums).unwrap();
    assert_eq!(sums, [7.0, 70.0]);
    assert!(slave.deserialize_state(&bytes[1..]).is_err());
    assert!(slave.get_real(&[8], &mut sums).is_err());
}
