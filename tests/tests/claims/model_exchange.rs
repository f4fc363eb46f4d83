//! Model-exchange FMUs in a system, compared with exact solutions. The FMU is `tests/c/equations.c`.
#![expect(clippy::unwrap_used, reason = "tests")]

mod closed_loop;
mod command;

use fmu_description::Experiment;
use fmu_import::Fmu;
use integrate::{Integrated, Method, Options};
use master::{CallError, Slave, StepResult};
use tempfile::TempDir;
use tests::equations::{self, BOUNCES, GRAVITY, H, LAPS, MODE, MODE_OUT, P, TICKS, U, V, X};

const TOLERANCE: f64 = 1e-8;
/// Value references of parameters.
const K: u32 = 9;
const E: u32 = 10;
const PERIOD: u32 = 11;
const END: u32 = 12;
const FLOOR: u32 = 13;

/// An instance and the folder of its FMU.
struct Instance {
    slave: Integrated,
    _folder: TempDir,
}

impl Instance {
    /// An instance with these parameters, initialised, at 0 s.
    fn new(method: Method, parameters: &[(u32, f64)]) -> Self {
        Self::built(&[], method, parameters)
    }

    /// The same, of an FMU built with these definitions.
    fn built(definitions: &[&str], method: Method, parameters: &[(u32, f64)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = equations::write_with(folder.path(), definitions);
        let fmu = Fmu::open_any(&path).unwrap();
        let equations = fmu.instantiate_equations("equations").unwrap();
        let mut slave = Integrated::new(equations, Options { method });
        let experiment = Experiment { tolerance: Some(TOLERANCE), ..Experiment::default() };
        slave.setup_experiment(&experiment).unwrap();
        for (reference, value) in parameters {
            slave.set_real(&[*reference], &[*value]).unwrap();
        }
        slave.enter_initialization_mode().unwrap();
        slave.exit_initialization_mode().unwrap();
        Self { slave, _folder: folder }
    }

    fn real(&mut self, reference: u32) -> f64 {
        let mut value = [0.0];
        self.slave.get_real(&[reference], &mut value).unwrap();
        value[0]
    }

    fn integer(&mut self, reference: u32) -> i32 {
        let mut value = [0];
        self.slave.get_integer(&[reference], &mut value).unwrap();
        i32::try_from(value[0]).unwrap()
    }

    /// Makes `count` steps of `size` s from the step `from` on.
    fn steps(&mut self, from: u32, count: u32, size: f64) {
        for k in from..from + count {
            let done = self.slave.do_step(f64::from(k) * size, size, true).unwrap();
            assert_eq!(done, StepResult::Whole, "step {k}");
        }
    }

    fn numbers(&mut self) -> Vec<u64> {
        let reals = [X, H, V, P].map(|reference| self.real(reference).to_bits());
        let counters = [TICKS, LAPS, BOUNCES].map(|reference| self.integer(reference));
        reals.into_iter().chain(counters.map(|value| u64::try_from(value).unwrap())).collect()
    }
}

/// Height and number of bounces of the ball at `time`, from 1 m with the restitution `e`.
fn ball(time: f64, e: f64) -> (f64, i32) {
    let mut speed = (2.0 * GRAVITY).sqrt();
    let (mut start, mut bounces) = (speed / GRAVITY, 1);
    if time < start {
        return (1.0 - 0.5 * GRAVITY * time * time, 0);
    }
    loop {
        speed *= e;
        let flight = time - start;
        if flight < 2.0 * speed / GRAVITY {
            return (speed * flight - 0.5 * GRAVITY * flight * flight, bounces);
        }
        start += 2.0 * speed / GRAVITY;
        bounces += 1;
    }
}

const METHODS: [Method; 3] = [Method::Automatic, Method::Explicit, Method::Stiff];

#[test]
fn a_decay_is_an_exponential_function_by_every_method() {
    for method in METHODS {
        let mut instance = Instance::new(method, &[(K, 3.0)]);
        for k in 0..10 {
            instance.steps(k, 1, 0.1);
            let exact = (-0.3 * f64::from(k + 1)).exp();
            assert!((instance.real(X) - exact).abs() < 20.0 * TOLERANCE, "{method:?} {k}");
        }
    }
}

#[test]
fn a_stiff_decay_to_a_ramp_lags_behind_it_by_one_time_constant() {
    for (method, k) in [(Method::Automatic, 1e5), (Method::Stiff, 1e8)] {
        let mut instance = Instance::new(method, &[(K, k)]);
        for step in 0..10 {
            let time = 0.1 * f64::from(step);
            instance.slave.set_real(&[U], &[2.0 * time]).unwrap();
            instance.slave.set_input_derivatives(&[U], &[1], &[2.0]).unwrap();
            instance.steps(step, 1, 0.1);
        }
        let exact = 2.0 - 2.0 / k;
        assert!((instance.real(X) - exact).abs() < 1e-6, "{}", instance.real(X));
        assert!((instance.real(U) - 2.0).abs() < 1e-12, "the input is that of the end");
    }
}

#[test]
fn inputs_follow_their_derivatives_within_a_step() {
    let mut instance = Instance::new(Method::Automatic, &[]);
    instance.slave.set_real(&[U], &[1.0]).unwrap();
    instance.slave.set_input_derivatives(&[U, U], &[1, 2], &[-3.0, 4.0]).unwrap();
    instance.steps(0, 1, 1.0);
    // u = 1 - 3 t + 2 t^2; x = 8 - 7 t + 2 t^2 - 7 e^-t
    let exact = 3.0 - 7.0 * (-1.0_f64).exp();
    assert!((instance.real(X) - exact).abs() < 20.0 * TOLERANCE, "{}", instance.real(X));
    assert!(instance.real(U).abs() < 1e-12);
    // Without new derivatives, a new value is held.
    instance.slave.set_real(&[U], &[5.0]).unwrap();
    instance.slave.do_step(1.0, 1.0, true).unwrap();
    assert!((instance.real(U) - 5.0).abs() < 1e-15);
}

#[test]
fn a_ball_bounces_where_it_reaches_the_ground() {
    for method in METHODS {
        for size in [0.01, 0.3, 1.5] {
            let mut instance = Instance::new(method, &[(E, 0.8)]);
            let count = (1.5_f64 / size).round();
            for k in 0.. {
                if f64::from(k) >= count {
                    break;
                }
                instance.steps(k, 1, size);
                let (height, bounces) = ball(f64::from(k + 1) * size, 0.8);
                let actual = (instance.real(H), instance.integer(BOUNCES));
                assert!((actual.0 - height).abs() < 1e-6, "{method:?} {size} {k}: {actual:?}");
                assert_eq!(actual.1, bounces, "{method:?} {size} {k}");
            }
        }
    }
}

#[test]
fn time_events_happen_in_time_and_belong_to_the_step_that_they_end() {
    for size in [0.01, 0.05, 0.1, 0.25, 1.0] {
        let mut instance = Instance::new(Method::Automatic, &[(PERIOD, 0.05)]);
        for k in 0..10 {
            instance.steps(k, 1, size);
            let exact = (f64::from(k + 1) * size / 0.05 + 1e-9).floor();
            assert!((f64::from(instance.integer(TICKS)) - exact).abs() < 0.5, "{size} {k}");
        }
    }
}

#[test]
fn step_events_keep_what_they_move() {
    let mut instance = Instance::new(Method::Automatic, &[]);
    for k in 0..30 {
        instance.steps(k, 1, 0.1);
        let (part, laps) = (instance.real(P), f64::from(instance.integer(LAPS)));
        assert!((part + laps - 0.1 * f64::from(k + 1)).abs() < 1e-9 && part < 1.0, "{k}: {part}");
    }
    assert!(instance.integer(LAPS) >= 2);
}

#[test]
fn the_end_that_the_fmu_requests_is_the_end_of_the_step() {
    let mut instance = Instance::new(Method::Automatic, &[(END, 0.33)]);
    instance.steps(0, 3, 0.1);
    let done = instance.slave.do_step(0.3, 0.1, true).unwrap();
    let StepResult::Part { reached, terminated: true } = done else { panic!("{done:?}") };
    assert!((reached - 0.33).abs() < 1e-12, "{reached}");
    assert!((instance.real(X) - (-0.33_f64).exp()).abs() < 1e-7);
    instance.slave.terminate().unwrap();
}

#[test]
fn a_new_value_of_a_discrete_input_is_an_event() {
    let mut instance = Instance::new(Method::Automatic, &[]);
    instance.steps(0, 1, 0.1);
    instance.slave.set_integer(&[MODE], &[3]).unwrap();
    instance.steps(1, 1, 0.1);
    assert_eq!(instance.integer(MODE_OUT), 3);
    // The FMU would end the process if the same value were set outside of an event.
    instance.slave.set_integer(&[MODE], &[3]).unwrap();
    instance.steps(2, 1, 0.1);
    assert_eq!(instance.integer(MODE_OUT), 3);
}

#[test]
fn states_that_the_fmu_discards_shorten_the_step() {
    // The explicit trial steps reach below the floor before the bounce is located.
    let mut instance = Instance::new(Method::Automatic, &[(FLOOR, -1e-3), (E, 0.8)]);
    instance.steps(0, 1, 1.5);
    let (height, bounces) = ball(1.5, 0.8);
    assert_eq!(instance.integer(BOUNCES), bounces);
    assert!((instance.real(H) - height).abs() < 1e-6);
}

#[test]
fn an_fmu_that_discards_every_step_ends_the_run_with_its_message() {
    let mut instance = Instance::new(Method::Automatic, &[(FLOOR, 0.5)]);
    let error: CallError = instance.slave.do_step(0.0, 1.0, true).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("fmi2Discard") && text.contains("h is below the floor"), "{text}");
    assert!(text.contains("t = 0.31"), "{text}");
}

#[test]
fn a_restored_state_repeats_the_steps_bit_for_bit() {
    let mut instance = Instance::new(Method::Automatic, &[]);
    instance.steps(0, 5, 0.1);
    instance.slave.save_state(1).unwrap();
    let bytes = instance.slave.serialize_state().unwrap();
    instance.steps(5, 7, 0.1);
    let first = instance.numbers();
    instance.slave.restore_state(1).unwrap();
    instance.steps(5, 7, 0.1);
    assert_eq!(instance.numbers(), first);
    let mut other = Instance::new(Method::Automatic, &[]);
    other.slave.deserialize_state(&bytes).unwrap();
    other.steps(5, 7, 0.1);
    assert_eq!(other.numbers(), first);
    assert!(other.slave.deserialize_state(&bytes[..bytes.len() / 2]).is_err());
}

#[test]
fn a_step_from_another_time_is_refused() {
    let mut instance = Instance::new(Method::Automatic, &[]);
    let error = instance.slave.do_step(0.5, 0.1, true).unwrap_err();
    assert!(error.to_string().contains("the last step ended at 0 s"), "{error}");
}

#[test]
fn a_parameter_that_keeps_its_value_is_not_set_beside_an_input() {
    let mut instance = Instance::new(Method::Automatic, &[(E, 0.8)]);
    instance.steps(0, 1, 0.1);
    // The FMU would end the process if `e` were set now.
    instance.slave.set_real(&[E, U], &[0.8, 2.0]).unwrap();
    instance.steps(1, 1, 0.1);
    assert!((instance.real(U) - 2.0).abs() < 1e-15);
    let exact = 2.0 - (2.0 - (-0.1_f64).exp()) * (-0.1_f64).exp();
    assert!((instance.real(X) - exact).abs() < 1e-7);
}

#[test]
fn a_communication_step_allocates_nothing() {
    let mut instance = Instance::new(Method::Stiff, &[]);
    instance.steps(0, 2, 0.1);
    instance.slave.save_state(0).unwrap();
    let counted = allocation_counter::measure(|| {
        instance.slave.save_state(0).unwrap();
        for k in 2..20 {
            let time = 0.1 * f64::from(k);
            instance.slave.set_real(&[U], &[time]).unwrap();
            instance.slave.set_input_derivatives(&[U], &[1], &[1.0]).unwrap();
            instance.slave.do_step(time, 0.1, true).unwrap();
        }
    });
    assert_eq!(counted.count_total, 0);
}

#[test]
fn an_fmu_whose_inputs_cannot_be_read_is_integrated() {
    let mut instance = Instance::built(&["-DUNREADABLE_INPUTS"], Method::Automatic, &[]);
    instance.slave.set_input_derivatives(&[U], &[1], &[1.0]).unwrap();
    instance.steps(0, 1, 1.0);
    // u = t, x = t - 1 + 2 e^-t
    assert!((instance.real(X) - 2.0 * (-1.0_f64).exp()).abs() < 1e-7);
}
