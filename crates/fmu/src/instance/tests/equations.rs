//! Models without a step of their own: the instance integrates their equations. Messages of a model.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::callbacks::Callbacks;
use crate::instance::Instance;
use crate::room::room_of;
use crate::{Event, Experiment, Failure, Log, Model, Simulation, Variables};
use fmu_description::abi::Status;
use fmu_description::call_order::{Function, InterfaceType};

/// x' = u, and a sampler that copies x to y at every multiple of 0.3 s.
#[derive(Clone, Variables, Serialize, Deserialize)]
struct Sampled {
    /// Input
    #[fmu(input, start = 0, derivatives(u_slope))]
    u: f64,
    #[fmu(skip)]
    u_slope: f64,
    /// Integral of the input
    #[fmu(output, start = 0)]
    x: f64,
    /// The input
    #[fmu(derivative_of = x, depends(u))]
    rise: f64,
    /// The last sample
    #[fmu(output, discrete, depends(), start = 0)]
    y: f64,
    /// Number of samples
    #[fmu(output, depends(), start = 0)]
    samples: i32,
    /// The simulation ends after this number of samples
    #[fmu(parameter, start = 1000)]
    last: i32,
    /// Time between samples in s
    #[fmu(skip, start = 0.3)]
    interval: f64,
    log: Log,
}

impl Sampled {
    fn next(&self) -> f64 {
        self.interval * f64::from(self.samples)
    }
}

#[fmu::model]
impl Model for Sampled {
    const LOG_CATEGORIES: &'static [(&'static str, &'static str)] = &[("logSamples", "Samples")];

    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.rise = self.u;
        if self.u > 1e3 {
            return Err(Failure::Discard("u is too large".to_owned()));
        }
        Ok(())
    }

    fn event(&mut self, time: f64) -> Result<Event, Failure> {
        if time >= self.next() {
            (self.y, self.samples) = (self.x, self.samples + 1);
            self.log.info("logSamples", format!("sample {} at {time} s", self.samples));
        }
        if self.u < 0.0 {
            self.log.warn(format!("u = {} is negative", self.u));
        }
        let ended = self.samples >= self.last;
        Ok(Event {
            next_event_time: Some(self.next()),
            terminate_simulation: ended.then(|| "the last sample".to_owned()),
            ..Event::default()
        })
    }
}

fn initialized() -> Instance<Sampled> {
    initialized_for(InterfaceType::CoSimulation)
}

fn initialized_for(kind: InterfaceType) -> Instance<Sampled> {
    let none = Path::new("");
    let guid = crate::describe::<Sampled>(none).unwrap().guid;
    let mut instance = Instance::new(kind, none, &guid, Callbacks::silent()).unwrap();
    let done = [
        instance.call(Function::SetupExperiment, |i| i.setup_experiment(Experiment::default())),
        instance.call(Function::EnterInitializationMode, Instance::enter_initialization_mode),
        instance.call(Function::ExitInitializationMode, Instance::exit_initialization_mode),
    ];
    assert_eq!(done, [Status::OK; 3]);
    instance
}

fn step(instance: &mut Instance<Sampled>, start: f64, size: f64) -> Status {
    instance.call(Function::DoStep, |i| i.do_step(start, size))
}

#[test]
fn the_description_of_the_derived_table_breaks_no_rule() {
    assert_eq!(crate::problems::<Sampled>(Path::new("")), Ok(vec![]));
}

#[test]
fn states_are_integrated_and_time_events_happen_at_their_times() {
    for size in [1.0, 0.25, 0.1] {
        let mut instance = initialized();
        instance.core.model.u = 2.0;
        let mut time = 0.0;
        while time < 0.99 {
            assert_eq!(step(&mut instance, time, size), Status::OK);
            time += size;
        }
        let model = &instance.core.model;
        // The samples at 0, 0.3, 0.6 and 0.9 s.
        assert_eq!(model.samples, 4);
        assert!((model.x - 2.0).abs() < 1e-14 && (model.y - 1.8).abs() < 1e-14, "{}", model.y);
    }
}

#[test]
fn an_event_at_the_end_of_a_step_is_handled_in_this_step() {
    let mut instance = initialized();
    step(&mut instance, 0.0, 0.3);
    assert_eq!(instance.core.model.samples, 2);
    step(&mut instance, 0.3, 0.1);
    assert_eq!(instance.core.model.samples, 2);
}

#[test]
fn an_input_with_a_derivative_follows_its_line_and_keeps_its_value() {
    let mut instance = initialized();
    let reference = 1;
    instance.call(Function::SetReal, |i| i.set_real(&[reference], &[1.0]));
    instance.call(Function::SetRealInputDerivatives, |i| {
        i.set_real_input_derivatives(&[reference], &[1], &[4.0])
    });
    assert_eq!(step(&mut instance, 0.0, 0.5), Status::OK);
    let model = &instance.core.model;
    assert!((model.x - 1.0).abs() < 1e-14, "0.5 + 4 0.5^2 / 2, found {}", model.x);
    assert!((model.y - (0.3 + 2.0 * 0.09)).abs() < 1e-14);
    assert_eq!((model.u, model.rise, model.u_slope), (1.0, 3.0, 0.0));
}

#[test]
fn the_model_may_end_the_simulation_at_an_event() {
    let mut instance = initialized();
    instance.core.model.last = 3;
    assert_eq!(step(&mut instance, 0.0, 1.0), Status::Discard);
    assert!(instance.is_terminated());
    assert!((instance.last_successful_time() - 0.6).abs() < 1e-15);
}

#[test]
fn a_next_event_time_that_is_nan_is_an_error_in_both_interfaces() {
    let mut instance = initialized();
    instance.core.model.interval = f64::NAN;
    assert_eq!(step(&mut instance, 0.0, 0.1), Status::Error);
    let mut instance = initialized_for(InterfaceType::ModelExchange);
    instance.core.model.interval = f64::NAN;
    let status =
        instance.call(Function::NewDiscreteStates, |i| i.new_discrete_states().map(|_| ()));
    assert_eq!(status, Status::Error);
}

#[test]
fn a_step_that_the_equations_refuse_ends_at_the_time_reached() {
    let mut instance = initialized();
    instance.call(Function::SetRealInputDerivatives, |i| {
        i.set_real_input_derivatives(&[1], &[1], &[2e3])
    });
    // u = 2000 t passes 1000 at 0.5 s.
    assert_eq!(step(&mut instance, 0.0, 1.0), Status::Discard);
    assert!(!instance.is_terminated());
    assert!((instance.last_successful_time() - 0.5).abs() < 1e-6);
}

#[test]
fn a_restored_state_continues_with_the_same_bits() {
    let mut instance = initialized();
    instance.core.model.u = 0.7;
    step(&mut instance, 0.0, 0.25);
    let snapshot = instance.snapshot();
    let mut bits = [0; 2];
    for place in &mut bits {
        instance.restore(&snapshot).unwrap();
        step(&mut instance, 0.25, 0.25);
        *place = instance.core.model.x.to_bits();
    }
    assert_eq!(bits[0], bits[1]);
}

/// x' = -x.
#[derive(Clone, Variables, Serialize, Deserialize)]
struct Decaying {
    /// State
    #[fmu(output, start = 1)]
    x: f64,
    /// Its derivative
    #[fmu(derivative_of = x)]
    rise: f64,
}

#[fmu::model]
impl Model for Decaying {
    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.rise = -self.x;
        Ok(())
    }
}

#[test]
fn a_run_without_a_tolerance_does_not_use_the_one_of_the_run_before() {
    let mut simulation = Simulation::<Decaying>::new(Path::new("")).unwrap();
    let mut run = |tolerance| {
        simulation.model_mut().x = 1.0;
        simulation.start(Experiment { tolerance, ..Experiment::default() }).unwrap();
        simulation.step(1.0).unwrap();
        simulation.model().x.to_bits()
    };
    let bits = run(None);
    assert_ne!(run(Some(1e-10)), bits);
    assert_eq!(run(None), bits);
}

#[test]
fn integrated_steps_do_not_allocate() {
    let mut instance = initialized();
    (instance.core.model.samples, instance.core.model.last) = (1000, 2000);
    let mut value = [0.0];
    let allocations = allocation_counter::measure(|| {
        for k in 0..50 {
            step(&mut instance, f64::from(k) * 0.1, 0.1);
            instance.call(Function::GetReal, |i| i.get_real(&[2], room_of(&mut value)));
        }
    });
    assert_eq!(allocations.count_total, 0);
}

#[test]
fn a_warning_of_the_model_is_the_status_of_its_call_and_a_message_is_not() {
    let mut instance = initialized();
    assert_eq!(step(&mut instance, 0.0, 0.1), Status::OK, "a sample is a message");
    instance.core.model.u = -1.0;
    assert_eq!(step(&mut instance, 0.1, 0.1), Status::Warning);
    assert!(instance.core.model.log.is_empty() && instance.messages.is_empty());
    instance.core.model.u = 1.0;
    assert_eq!(step(&mut instance, 0.2, 0.1), Status::OK);
}

#[test]
fn the_log_categories_of_the_model_are_described_and_may_be_chosen() {
    let description = crate::describe::<Sampled>(Path::new("")).unwrap();
    let names = description.log_categories.iter().map(|category| category.name.as_str());
    assert!(names.clone().any(|name| name == "logSamples"));
    assert!(names.clone().any(|name| name == "logStatusWarning"));
    let mut instance = initialized();
    let mut choose = |name: &str| {
        let names = vec![name.to_owned()];
        instance.call(Function::SetDebugLogging, |i| i.set_debug_logging(names))
    };
    assert_eq!([choose("logSamples"), choose("logOthers")], [Status::OK, Status::Error]);
}
