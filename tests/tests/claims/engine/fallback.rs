//! Runs in which an iteration or a step control fails.

use fmu_description::ModelDescription;
use master::{
    Algorithm, CallError, Coupling, Simulation, Slave, StepControl, StepResult, System, SystemError,
};

use super::{puppet, until};

const STEP: f64 = 0.125;
const STOP: f64 = 1.0;

/// y = f(u) at the end of each step. Above the limit of u, a step ends halfway with y = 0.
struct Direct {
    description: ModelDescription,
    function: fn(f64) -> f64,
    limit: f64,
    u: f64,
    y: f64,
    slots: [(f64, f64); 4],
}

impl Direct {
    /// A slave whose direct dependency appears only after the initialization.
    fn boxed(function: fn(f64) -> f64) -> Box<Self> {
        let xml = r#"<fmiModelDescription fmiVersion="2.0" modelName="Direct" guid="direct">
            <CoSimulation modelIdentifier="D" canGetAndSetFMUstate="true"
            canHandleVariableCommunicationStepSize="true"/><ModelVariables>
            <ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/>
            </ScalarVariable><ScalarVariable name="y" valueReference="1" causality="output"><Real/>
            </ScalarVariable></ModelVariables><ModelStructure>
            <Outputs><Unknown index="2" dependencies="1"/></Outputs>
            <InitialUnknowns><Unknown index="2" dependencies=""/></InitialUnknowns>
            </ModelStructure></fmiModelDescription>"#;
        let description = ModelDescription::parse(xml).unwrap();
        let (limit, slots) = (f64::INFINITY, [(0.0, 0.0); 4]);
        Box::new(Self { description, function, limit, u: 0.0, y: 0.0, slots })
    }
}

impl Slave for Direct {
    fn description(&self) -> &ModelDescription {
        &self.description
    }
    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        for (value, &reference) in values.iter_mut().zip(references) {
            *value = if reference == 0 { self.u } else { self.y };
        }
        Ok(())
    }
    fn set_real(&mut self, _: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.u = values[0];
        Ok(())
    }
    fn do_step(&mut self, time: f64, size: f64, _: bool) -> Result<StepResult, CallError> {
        if self.u > self.limit {
            self.y = 0.0;
            return Ok(StepResult::Part { reached: time + 0.5 * size, terminated: false });
        }
        self.y = (self.function)(self.u);
        Ok(StepResult::Whole)
    }
    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.slots[slot] = (self.u, self.y);
        Ok(())
    }
    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        (self.u, self.y) = self.slots[slot];
        Ok(())
    }
}

/// u = -sign(u) has no solution.
fn relay_in_a_loop() -> System {
    let mut system = System::default();
    let relay = |u: f64| if u > 0.0 { -1.0 } else { 1.0 };
    system.add("relay", Direct::boxed(relay)).unwrap();
    system.add("gain", Direct::boxed(|u| u)).unwrap();
    system.connect("relay.y", "gain.u").unwrap();
    system.connect("gain.y", "relay.u").unwrap();
    system
}

fn started(algorithm: &Algorithm) -> Simulation {
    Simulation::new(relay_in_a_loop(), algorithm, &until(STOP)).unwrap()
}

fn outputs(simulation: &mut Simulation) -> Vec<f64> {
    let slaves = simulation.system().slaves.iter_mut();
    let read = |(_, slave): &mut (String, Box<dyn Slave>)| {
        let mut value = [f64::NAN];
        slave.get_real(&[1], &mut value).unwrap();
        value[0]
    };
    slaves.map(read).collect()
}

/// The oracle is the run without iteration, step by step.
#[test]
fn a_loop_without_solution_falls_back_to_single_steps_and_counts_them() {
    for coupling in [Coupling::Newton, Coupling::Anderson, Coupling::QuasiNewton] {
        let once = Algorithm { coupling: Coupling::Once, ..Algorithm::new(STEP) };
        let (mut once, mut iterated) = (
            started(&once),
            started(&Algorithm { coupling, fallback: true, ..Algorithm::new(STEP) }),
        );
        while !once.is_finished() {
            once.step().unwrap();
            iterated.step().unwrap();
            assert_eq!(outputs(&mut once), outputs(&mut iterated), "{}", coupling.name());
        }
        assert!(iterated.is_finished());
        let fallbacks = iterated.fallbacks().unwrap();
        assert_eq!(fallbacks.count, 8, "{}", coupling.name());
        assert!(fallbacks.first.contains("t = 0 s"), "{}", fallbacks.first);
        assert_eq!(once.fallbacks(), None);
    }
}

/// A whole step and two halves end with different signs for every step size.
#[test]
fn a_step_that_the_step_control_repeats_counts_as_one_fallback() {
    let algorithm = Algorithm {
        coupling: Coupling::Newton,
        control: StepControl::Doubling,
        fallback: true,
        ..Algorithm::new(STEP)
    };
    let mut simulation = started(&algorithm);
    let error = simulation.step().unwrap_err();
    assert!(matches!(error, SystemError::Stuck { .. }), "{error}");
    assert_eq!(simulation.fallbacks().unwrap().count, 1);
}

#[test]
fn a_step_from_a_kept_state_counts_again() {
    let algorithm =
        Algorithm { coupling: Coupling::Newton, fallback: true, ..Algorithm::new(STEP) };
    let mut simulation = started(&algorithm);
    let state = simulation.keep(0).unwrap();
    for count in [1, 2] {
        simulation.step().unwrap();
        assert_eq!(simulation.fallbacks().unwrap().count, count);
        simulation.return_to(&state).unwrap();
    }
}

/// The loop u = -1 - 3 u has the solution -0.25. The iteration starts at 0, the limit: a larger value, as a difference
/// quotient needs it, ends the step early.
#[test]
fn a_perturbed_step_that_ends_early_is_not_part_of_the_matrix() {
    let mut system = System::default();
    let mut limited = Direct::boxed(|u| -1.0 - 3.0 * u);
    limited.limit = 0.0;
    system.add("limited", limited).unwrap();
    system.add("gain", Direct::boxed(|u| u)).unwrap();
    system.connect("limited.y", "gain.u").unwrap();
    system.connect("gain.y", "limited.u").unwrap();
    let algorithm = Algorithm { coupling: Coupling::Newton, ..Algorithm::new(STEP) };
    let mut simulation = Simulation::new(system, &algorithm, &until(STOP)).unwrap();
    simulation.step().unwrap();
    assert_eq!(simulation.time(), STEP);
    for output in outputs(&mut simulation) {
        assert!((output + 0.25).abs() < 1e-3, "{output}");
    }
}

#[test]
fn a_loop_without_solution_ends_a_run_with_stated_coupling() {
    let stated = Algorithm { coupling: Coupling::Newton, ..Algorithm::new(STEP) };
    let error = started(&stated).step().unwrap_err();
    assert!(matches!(error, SystemError::Coupling { .. }), "{error}");
}

/// A signal that changes by far more than the tolerance in any step, however small.
///
/// It is a function of time alone, so a whole step and two halves agree, and doubling is not
/// affected.
#[test]
fn embedded_and_increment_control_end_a_run_that_cannot_advance_with_a_reason() {
    for control in [StepControl::Embedded, StepControl::Increment] {
        let noise = |time: f64| 1e6 * (1e12 * time).sin();
        let (system, _) = puppet::system([noise, noise], puppet::whole);
        let algorithm = Algorithm { control, smallest_step: 1e-9, ..Algorithm::new(1e-3) };
        let mut simulation = Simulation::new(system, &algorithm, &until(STOP)).unwrap();
        let mut steps = 0;
        let error = loop {
            match simulation.step() {
                Ok(()) => steps += 1,
                Err(error) => break error,
            }
            assert!(steps < 10_000, "{} goes on", control.name());
        };
        let named = matches!(error, SystemError::Stuck { .. } | SystemError::TooManySteps { .. });
        assert!(named, "{}: {error}", control.name());
        assert!(error.to_string().contains("smallest step"), "{error}");
    }
}
