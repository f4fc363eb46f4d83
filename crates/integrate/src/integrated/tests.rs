//! A model-exchange instance of one state with events at known times, stepped as a slave.

use fmu_description::{Experiment, ModelDescription};
use slave::{CallError, CompletedStep, EventInfo, ModelExchange, Slave, StepResult, absent};

use super::{Integrated, Options};

type Done = Result<(), CallError>;

/// The state x, from 0, and the number of events, which happen at `start + k period + late` for k = 1, 2, ...
struct Timer {
    description: ModelDescription,
    /// x' as a function of time in s.
    slope: fn(f64) -> f64,
    period: f64,
    late: f64,
    start: f64,
    time: f64,
    x: f64,
    events: f64,
    saved: Vec<u8>,
}

impl Timer {
    fn next(&self) -> f64 {
        self.start + (self.events + 1.0) * self.period + self.late
    }
}

/// The instance at `start`, after the initialization.
fn timer(slope: fn(f64) -> f64, start: f64, [period, late]: [f64; 2]) -> Integrated {
    let xml = r#"<fmiModelDescription fmiVersion="2.0" modelName="Timer" guid="timer">
        <ModelExchange modelIdentifier="T"/><ModelVariables>
        <ScalarVariable name="x" valueReference="0" causality="output"><Real/></ScalarVariable>
        <ScalarVariable name="events" valueReference="1" causality="output" variability="discrete">
        <Real/></ScalarVariable></ModelVariables><ModelStructure><Outputs><Unknown index="1"/>
        <Unknown index="2"/></Outputs></ModelStructure></fmiModelDescription>"#;
    let description = ModelDescription::parse(xml).unwrap();
    let (time, x, events, saved) = (0.0, 0.0, 0.0, Vec::new());
    let instance = Timer { description, slope, period, late, start, time, x, events, saved };
    let mut slave = Integrated::new(Box::new(instance), Options::default());
    let experiment = Experiment { start_time: start, ..Experiment::default() };
    slave.setup_experiment(&experiment).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    slave
}

/// Makes steps of `size` s from `start` on; returns x and the number of events.
fn steps(slave: &mut Integrated, start: f64, size: f64, count: u32) -> [f64; 2] {
    for step in 0..count {
        let done = slave.do_step(start + f64::from(step) * size, size, true).unwrap();
        assert_eq!(done, StepResult::Whole);
    }
    let mut values = [0.0; 2];
    slave.get_real(&[0, 1], &mut values).unwrap();
    values
}

impl Slave for Timer {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn setup_experiment(&mut self, experiment: &Experiment) -> Done {
        self.time = experiment.start_time;
        Ok(())
    }
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Done {
        for (value, &reference) in values.iter_mut().zip(references) {
            *value = [self.x, self.events][reference as usize];
        }
        Ok(())
    }
    fn set_real(&mut self, _: &[u32], _: &[f64]) -> Done {
        Err(absent("fmi2SetReal"))
    }
    fn do_step(&mut self, _: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
        Err(absent("fmi2DoStep"))
    }
    fn save_state(&mut self, _: usize) -> Done {
        self.saved = self.serialize_state()?;
        Ok(())
    }
    fn restore_state(&mut self, _: usize) -> Done {
        let saved = self.saved.clone();
        self.deserialize_state(&saved)
    }
    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        Ok([self.time, self.x, self.events].map(f64::to_le_bytes).concat())
    }
    fn deserialize_state(&mut self, bytes: &[u8]) -> Done {
        let values = [&mut self.time, &mut self.x, &mut self.events];
        for (value, bytes) in values.into_iter().zip(bytes.chunks_exact(8)) {
            *value = f64::from_le_bytes(bytes.try_into().unwrap());
        }
        Ok(())
    }
}

impl ModelExchange for Timer {
    fn number_of_continuous_states(&mut self) -> Result<usize, CallError> {
        Ok(1)
    }
    fn set_time(&mut self, time: f64) -> Done {
        self.time = time;
        Ok(())
    }
    fn set_continuous_states(&mut self, states: &[f64]) -> Done {
        self.x = states[0];
        Ok(())
    }
    fn get_continuous_states(&mut self, states: &mut [f64]) -> Done {
        states[0] = self.x;
        Ok(())
    }
    fn get_derivatives(&mut self, derivatives: &mut [f64]) -> Done {
        derivatives[0] = (self.slope)(self.time);
        Ok(())
    }
    fn get_event_indicators(&mut self, _: &mut [f64]) -> Done {
        Ok(())
    }
    /// The first event changes the nominal value.
    fn get_nominals_of_continuous_states(&mut self, nominals: &mut [f64]) -> Done {
        nominals[0] = if self.events > 0.0 { 1e3 } else { 1.0 };
        Ok(())
    }
    fn completed_integrator_step(&mut self, _: bool) -> Result<CompletedStep, CallError> {
        Ok(CompletedStep::default())
    }
    fn enter_event_mode(&mut self) -> Done {
        Ok(())
    }
    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        self.events += f64::from(u8::from(self.time >= self.next()));
        let next_event_time = Some(self.next());
        Ok(EventInfo { nominals_changed: true, next_event_time, ..EventInfo::default() })
    }
    fn enter_continuous_time_mode(&mut self) -> Done {
        Ok(())
    }
}

/// One unit in the last place of such times is 2.4e-7 s.
#[test]
fn steps_of_a_millisecond_in_seconds_since_1970_lose_neither_time_nor_events() {
    let start = 1.7e9;
    let [x, events] = steps(&mut timer(|_| 1.0, start, [0.25, 0.0]), start, 1e-3, 1000);
    assert!((x - 1.0).abs() < 1e-6, "{x}");
    assert!((events - 4.0).abs() < 0.5, "{events}");
}

/// The times of events of an FMU that adds up its period have such rounding errors.
#[test]
fn an_event_that_is_later_than_the_end_of_a_step_by_rounding_belongs_to_this_step() {
    let [x, events] = steps(&mut timer(|_| 1.0, 1e3, [0.01, 1.6e-10]), 1e3, 1e-4, 500);
    assert!((x - 0.05).abs() < 1e-8, "{x}");
    assert!((events - 5.0).abs() < 0.5, "{events}");
}

/// A reported time before the end of the step would mean an event within the step.
#[test]
fn an_event_that_is_earlier_than_the_end_of_a_step_by_rounding_is_at_this_end() {
    let mut slave = timer(|_| 1.0, 1e3, [0.01, -1.6e-10]);
    slave.hand_over_events(false).unwrap();
    steps(&mut slave, 1e3, 1e-4, 99);
    let (time, size) = (1e3 + 99.0 * 1e-4, 1e-4);
    let done = slave.do_step(time, size, true).unwrap();
    assert_eq!(done, StepResult::Event { reached: time + size });
}

/// The nominal value is a tolerance, on which the size of the steps depends.
#[test]
fn a_restored_state_goes_on_with_its_nominal_values_bit_by_bit() {
    let new = || timer(f64::cos, 0.0, [0.25, 0.0]);
    let (mut first, mut second) = (new(), new());
    steps(&mut first, 0.0, 0.5, 1);
    second.deserialize_state(&first.serialize_state().unwrap()).unwrap();
    let ends = [first, second].map(|mut slave| steps(&mut slave, 0.5, 0.5, 3)[0].to_bits());
    assert_eq!(ends[0], ends[1]);
}

/// The event that changes the nominal value is at 0.25 s.
#[test]
fn a_step_is_repeated_with_the_nominal_values_of_its_start_bit_by_bit() {
    let new = || timer(|time| (50.0 * time).cos(), 0.0, [0.25, 0.0]);
    let (mut repeated, first) = (new(), new());
    repeated.save_state(0).unwrap();
    steps(&mut repeated, 0.0, 0.5, 1);
    repeated.restore_state(0).unwrap();
    let ends = [repeated, first].map(|mut slave| steps(&mut slave, 0.0, 0.1, 2)[0].to_bits());
    assert_eq!(ends[0], ends[1]);
}
