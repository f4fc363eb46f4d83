//! Instants of a slave that samples its input and counts ticks.

use fmu_description::{Experiment, ModelDescription};
use slave::{CallError, EventInfo, Events, Slave, StepResult, Value};

use crate::drive::{Drive, DriveKind, DriveSource, Drives};
use crate::signal::{Interpolation, Signal, Track};
use crate::{Algorithm, Extrapolation, Method, Scenario, Simulation, System};

type Done = Result<(), CallError>;

/// The time in s of the event, unless a test states another one.
const EVENT: f64 = 1.5;

/// The output y is the time, but at most 1. If `samples`, the event copies the input u to the output z. The output n is
/// the number of ticks.
struct Sampler {
    description: ModelDescription,
    samples: bool,
    event: f64,
    time: f64,
    u: f64,
    slope: f64,
    z: f64,
    n: f64,
}

fn sampler(samples: bool) -> Box<Sampler> {
    let xml = r#"<fmiModelDescription fmiVersion="2.0" modelName="Sampler" guid="sampler">
        <CoSimulation modelIdentifier="S" canInterpolateInputs="true"/><ModelVariables>
        <ScalarVariable name="y" valueReference="0" causality="output"><Real/></ScalarVariable>
        <ScalarVariable name="z" valueReference="1" causality="output" variability="discrete"><Real/>
        </ScalarVariable>
        <ScalarVariable name="u" valueReference="2" causality="input"><Real start="0"/></ScalarVariable>
        <ScalarVariable name="n" valueReference="3" causality="output"><Real/></ScalarVariable>
        </ModelVariables><ModelStructure><Outputs><Unknown index="1" dependencies=""/>
        <Unknown index="2" dependencies=""/><Unknown index="4" dependencies=""/></Outputs>
        </ModelStructure></fmiModelDescription>"#;
    let description = ModelDescription::parse(xml).unwrap();
    let event = EVENT;
    Box::new(Sampler { description, samples, event, time: 0.0, u: 0.0, slope: 0.0, z: 0.0, n: 0.0 })
}

impl Slave for Sampler {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Done {
        for (value, &reference) in values.iter_mut().zip(references) {
            *value = [self.time.min(1.0), self.z, self.u, self.n][reference as usize];
        }
        Ok(())
    }
    fn set_real(&mut self, _: &[u32], values: &[f64]) -> Done {
        (self.u, self.slope) = (values[0], 0.0);
        Ok(())
    }
    fn set_boolean(&mut self, _: &[u32], _: &[i32]) -> Done {
        self.n += 1.0;
        Ok(())
    }
    fn set_input_derivatives(&mut self, _: &[u32], _: &[i32], values: &[f64]) -> Done {
        self.slope = values[0];
        Ok(())
    }
    fn do_step(&mut self, time: f64, size: f64, _: bool) -> Result<StepResult, CallError> {
        (self.u, self.time) = (self.u + self.slope * size, time + size);
        let happens = self.samples && time < self.event && self.time >= self.event;
        Ok(if happens { StepResult::Event { reached: self.time } } else { StepResult::Whole })
    }
    fn hand_over_events(&mut self, _: bool) -> Result<bool, CallError> {
        Ok(self.samples)
    }
    fn events(&mut self) -> Option<&mut dyn Events> {
        if self.samples { Some(self) } else { None }
    }
}

impl Events for Sampler {
    fn next_event(&mut self) -> Result<Option<f64>, CallError> {
        Ok((self.time < self.event).then_some(self.event))
    }
    fn enter_event_mode(&mut self) -> Done {
        Ok(())
    }
    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        self.z = self.u;
        Ok(EventInfo::default())
    }
    fn leave_event_mode(&mut self) -> Done {
        Ok(())
    }
}

/// At 1.5 s the line through the earlier values 0.5 and 1 gives 1.5, but y is still 1.
#[test]
fn an_instant_sees_the_value_of_an_input_and_not_its_extrapolation() {
    let mut system = System::default();
    system.add("p", sampler(false)).unwrap();
    system.add("q", sampler(true)).unwrap();
    system.connect("p.y", "q.u").unwrap();
    let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Linear, 0.5);
    let experiment = Experiment { stop_time: Some(2.0), ..Experiment::default() };
    let mut simulation = Simulation::new(system, &algorithm, &experiment).unwrap();
    while !simulation.is_finished() {
        simulation.step().unwrap();
    }
    let port = simulation.system().port("q.z").unwrap();
    assert_eq!(simulation.system().get_value(port).unwrap(), Value::Real(1.0));
}

/// One unit in the last place of these times is 2.4e-7 s, more than 1e-6 of a step.
#[test]
fn in_seconds_since_1970_an_event_just_before_a_grid_point_adds_no_step() {
    let start_time = 1.7e9_f64;
    let (mut p, mut q) = (sampler(false), sampler(true));
    q.event = (start_time + 0.3).next_down();
    for description in [&mut p.description, &mut q.description] {
        let flags = description.co_simulation.as_mut().unwrap();
        flags.can_handle_variable_communication_step_size = true;
    }
    let mut system = System::default();
    system.add("p", p).unwrap();
    system.add("q", q).unwrap();
    system.connect("p.y", "q.u").unwrap();
    let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 0.1);
    let stop_time = Some(start_time + 0.5);
    let experiment = Experiment { start_time, stop_time, ..Experiment::default() };
    let mut simulation = Simulation::new(system, &algorithm, &experiment).unwrap();
    let port = simulation.system().port("q.z").unwrap();
    let mut values = Vec::new();
    while !simulation.is_finished() {
        simulation.step().unwrap();
        values.push(simulation.system().get_value(port).unwrap());
    }
    assert_eq!(values, [0.0, 0.0, 1.0, 1.0, 1.0].map(Value::Real));
}

/// Ticks at 0.1 and 1.2 s, and steps of 0.5 s only.
#[test]
fn a_tick_within_a_step_that_cannot_end_there_comes_at_its_end() {
    let mut system = System::default();
    system.add("q", sampler(true)).unwrap();
    let times = [0.1, 1.2];
    let track = Track::new(times.into(), [1.0; 2].into(), Interpolation::Points).unwrap();
    let (signal, start) = (Signal::Track(track), f64::NEG_INFINITY);
    let source = DriveSource { signal, start, texts: Vec::new() };
    let clock = Drive::new(system.port("q.u").unwrap(), 2, DriveKind::Clock, source);
    let scenario = Scenario { drives: Drives::new(vec![clock]), faults: Vec::new() };
    let experiment = Experiment { stop_time: Some(2.0), ..Experiment::default() };
    let algorithm = Algorithm::new(0.5);
    let run = Simulation::with_scenario(system, &algorithm, &experiment, scenario);
    let mut simulation = run.unwrap();
    let ticks = simulation.system().port("q.n").unwrap();
    for expected in [1.0, 1.0, 2.0, 2.0] {
        simulation.step().unwrap();
        let actual = simulation.system().get_value(ticks).unwrap();
        assert_eq!(actual, Value::Real(expected), "{}", simulation.time());
    }
}
