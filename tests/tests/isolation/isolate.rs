//! Isolated FMUs give the same results, and every misbehaviour gives a clear report.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; numbers as written")]

use std::time::{Duration, Instant};

use fmu_description::Experiment;
use fmu_description::abi::Status;
use fmu_description::{Causality, Kind, ModelDescription};
use fmu_import::Fmu;
use fmu_import::isolate::{self, IsolateError, Isolated, Options};
use master::{CallError, CommunicationStep, Failure, Slave, StepRequest, StepResult};
use tests::isolated::{limited, options, ready};
use tests::{Trouble, dist, troubles};

/// The error of a step of 0.5 s with this misbehaviour of the FMU.
fn error_of(trouble: Trouble, options: &Options) -> (Isolated, CallError) {
    let mut slave = ready(options);
    slave.set_integer(&[0], &[trouble as i64]).unwrap();
    let error = advance(&mut slave, 1.0, 0.5).expect_err(&format!("{trouble:?}"));
    let again = slave.get_real(&[1], &mut [0.0]).unwrap_err();
    assert_eq!((again.failure, again.function), (error.failure.clone(), "fmi2GetReal"));
    (slave, error)
}

/// Sets u = `input`, steps 0.5 s from 0 s, and returns y.
fn advance(slave: &mut dyn Slave, input: f64, size: f64) -> Result<(StepResult, f64), CallError> {
    let mut output = [f64::NAN];
    let input = [input];
    let step = CommunicationStep { time: 0.0, size, never_back: true };
    let done = slave.advance(&mut StepRequest::held(&[0], &input, step, &[1], &mut output))?;
    Ok((done, output[0]))
}

fn is_gone(process: u32) -> bool {
    !std::path::Path::new(&format!("/proc/{process}")).exists()
}

/// Value references of the Reals, or of those with one causality.
fn reals(description: &ModelDescription, causality: Option<Causality>) -> Vec<u32> {
    let variables = description.variables.iter();
    variables
        .filter(|variable| matches!(variable.kind, Kind::Real(_)))
        .filter(|variable| causality.is_none_or(|causality| variable.causality == causality))
        .map(|variable| variable.value_reference)
        .collect()
}

/// Inputs, outputs and their derivatives of the pendulum.
struct Pendulum<'a> {
    plant: &'a mut dyn Slave,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    /// The bits of all values that were read.
    trajectory: Vec<u64>,
}

impl Pendulum<'_> {
    fn step(&mut self, time: f64, force: f64) {
        let (inputs, outputs) = (self.inputs.len(), self.outputs.len());
        let (mut values, mut derivatives) = (vec![0.0; outputs], vec![0.0; outputs]);
        let mut step = StepRequest {
            inputs: &self.inputs,
            input_values: &vec![force; inputs],
            derived_inputs: &self.inputs,
            input_orders: &vec![1; inputs],
            input_derivatives: &vec![3.0; inputs],
            step: CommunicationStep { time, size: 0.001, never_back: false },
            outputs: &self.outputs,
            output_values: &mut values,
            derived_outputs: &self.outputs,
            output_orders: &vec![1; outputs],
            output_derivatives: &mut derivatives,
        };
        assert_eq!(self.plant.advance(&mut step).unwrap(), StepResult::Whole);
        self.keep(&values);
        self.keep(&derivatives);
    }

    fn keep(&mut self, values: &[f64]) {
        self.trajectory.extend(values.iter().map(|value| value.to_bits()));
    }
}

/// Steps the pendulum, sometimes going back, and returns the bits of all its Reals after each step,
/// and at the end its serialised state and a derivative.
fn trajectory(plant: &mut dyn Slave) -> (Vec<u64>, Vec<u8>) {
    let description = plant.description().clone();
    let of = |causality| reals(&description, causality);
    let (inputs, outputs) = (of(Some(Causality::Input)), of(Some(Causality::Output)));
    plant.setup_experiment(&Experiment { stop_time: Some(5.0), ..Experiment::default() }).unwrap();
    plant.enter_initialization_mode().unwrap();
    plant.exit_initialization_mode().unwrap();
    let mut pendulum = Pendulum { plant, inputs, outputs, trajectory: Vec::new() };
    for count in 0..2000_u32 {
        let time = f64::from(count) * 0.001;
        let force = 20.0 * (7.0 * time).sin();
        if count % 50 == 7 {
            pendulum.plant.save_state(3).unwrap();
            pendulum.step(time, -force);
            pendulum.plant.restore_state(3).unwrap();
        }
        pendulum.step(time, force);
    }
    let Pendulum { plant, inputs, outputs, mut trajectory } = pendulum;
    let all = of(None);
    let (mut values, mut changes) = (vec![0.0; all.len()], vec![0.0; outputs.len()]);
    plant.get_real(&all, &mut values).unwrap();
    plant
        .directional_derivative(&outputs, &inputs, &vec![1.0; inputs.len()], &mut changes)
        .unwrap();
    trajectory.extend(values.iter().chain(&changes).map(|value| value.to_bits()));
    let state = plant.serialize_state().unwrap();
    plant.deserialize_state(&state).unwrap();
    assert_eq!(plant.serialize_state().unwrap(), state);
    plant.terminate().unwrap();
    (trajectory, state)
}

#[test]
fn the_isolated_pendulum_gives_the_same_bits() {
    let fmu = dist().join("FrictionPendulum.fmu");
    let mut near = Fmu::open(&fmu).unwrap().instantiate("plant").unwrap();
    let mut far = isolate::open(&fmu, "plant", &options()).unwrap();
    assert_eq!(far.description(), near.description());
    let (near, far) = (trajectory(&mut near), trajectory(&mut far));
    assert!(near.0.len() > 10_000);
    assert_eq!(near, far);
}

#[test]
fn every_type_of_variable_and_large_data_are_transferred() {
    let mut slave = ready(&options());
    slave.set_boolean(&[0], &[1]).unwrap();
    let mut flags = [0, 0];
    slave.get_boolean(&[0, 0], &mut flags).unwrap();
    assert_eq!(flags, [1, 1]);
    let text = "Grüße, ".repeat(40_000);
    slave.set_string(&[0], std::slice::from_ref(&text)).unwrap();
    let mut texts = vec!["old".to_owned(); 3];
    slave.get_string(&[0, 0, 0], &mut texts).unwrap();
    assert!(texts.iter().all(|actual| *actual == text));
    slave.set_string(&[0], &[String::new()]).unwrap();
    slave.get_string(&[0], &mut texts[..1]).unwrap();
    assert_eq!(texts[0], "");
    assert_eq!(advance(&mut slave, 3.0, 0.5).unwrap(), (StepResult::Whole, 1.5));
    let state = slave.serialize_state().unwrap();
    assert!(state.len() > 1 << 20);
    let ones = state.iter().map(|byte| usize::from(*byte == 1)).sum::<usize>();
    assert_eq!(ones, 2, "the Boolean and the first step");
    advance(&mut slave, 3.0, 0.5).unwrap();
    slave.deserialize_state(&state).unwrap();
    assert_eq!(advance(&mut slave, 0.0, 0.5).unwrap().1, 1.5);
}

#[test]
fn errors_and_early_ends_are_reported_as_without_isolation() {
    let mut far = ready(&options());
    let mut near = Fmu::open(troubles()).unwrap().instantiate("one").unwrap();
    near.setup_experiment(&Experiment::default()).unwrap();
    near.enter_initialization_mode().unwrap();
    near.exit_initialization_mode().unwrap();
    let slaves: [&mut dyn Slave; 2] = [&mut near, &mut far];
    let [near, far] = slaves.map(|slave| {
        let mut actual = vec![
            slave.set_real(&[1], &[2.0]).unwrap_err(),
            slave.directional_derivative(&[1], &[0], &[1.0], &mut [0.0]).unwrap_err(),
            slave.restore_state(7).unwrap_err(),
            slave.deserialize_state(b"short").unwrap_err(),
        ];
        slave.set_integer(&[0], &[Trouble::Refuse as i64]).unwrap();
        actual.push(advance(slave, 1.0, 0.5).unwrap_err());
        slave.set_integer(&[0], &[Trouble::StopEarly as i64]).unwrap();
        (actual, advance(slave, 4.0, 1.0).unwrap())
    });
    assert_eq!(near, far);
    let refused = near.0.last().unwrap();
    assert_eq!(refused.failure, Failure::Status(Status::Error));
    assert_eq!(refused.messages.last().map(String::as_str), Some("not today"));
    assert_eq!(near.1, (StepResult::Part { reached: 0.25, terminated: true }, 1.0));
}

#[test]
fn a_crash_is_reported_with_its_function_and_signal() {
    for (trouble, function, signal, name) in [
        (Trouble::CrashInStep, "fmi2DoStep", 11, "SIGSEGV"),
        (Trouble::CrashInGet, "fmi2GetReal", 11, "SIGSEGV"),
        (Trouble::OverflowStack, "fmi2DoStep", 11, "SIGSEGV"),
        (Trouble::Abort, "fmi2DoStep", 6, "SIGABRT"),
        (Trouble::BreakHeap, "fmi2DoStep", 6, "SIGABRT"),
        (Trouble::DivideByZero, "fmi2DoStep", 8, "SIGFPE"),
    ] {
        let (slave, error) = error_of(trouble, &options());
        assert_eq!(error.function, function, "{trouble:?}");
        // Rust's handler aborts the process after a stack overflow.
        if trouble == Trouble::OverflowStack && error.failure == Failure::Killed(6, "SIGABRT") {
            continue;
        }
        assert_eq!(error.failure, Failure::Killed(signal, name), "{trouble:?}");
        assert!(is_gone(slave.process_id()));
    }
}

#[test]
fn messages_of_the_fmu_before_its_crash_are_in_the_report() {
    let (_, error) = error_of(Trouble::CrashInStep, &options());
    assert_eq!(error.messages, ["this will not end well"]);
    let text = error.to_string();
    assert!(text.contains("fmi2DoStep crashed") && text.contains("SIGSEGV"), "{text}");
}

#[test]
fn an_exit_is_reported_with_its_status() {
    let (_, error) = error_of(Trouble::Leave, &options());
    assert_eq!((error.failure, error.function), (Failure::Exited(3), "fmi2DoStep"));
}

#[test]
fn an_fmu_that_hangs_is_ended_with_the_processes_that_it_started() {
    for trouble in [Trouble::Hang, Trouble::HangWithChild, Trouble::CloseFiles] {
        let begin = Instant::now();
        let (slave, error) = error_of(trouble, &limited(300));
        assert_eq!(error.function, "fmi2DoStep");
        match error.failure {
            Failure::TimedOut(limit) => {
                assert_eq!(limit, 0.3);
                assert!(begin.elapsed() >= Duration::from_millis(300));
            }
            // An FMU that closes its connection may be noticed before the limit.
            failure => {
                assert!(trouble == Trouble::CloseFiles, "{trouble:?}: {failure:?}");
                assert!(failure.to_string().contains("closed the connection"), "{failure}");
            }
        }
        let group = slave.process_id().to_string();
        let begin = Instant::now();
        while group_exists(&group) {
            assert!(begin.elapsed() < Duration::from_secs(20), "{trouble:?} left processes");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// Whether a process of that group runs.
fn group_exists(group: &str) -> bool {
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let stats =
        processes.filter_map(|entry| std::fs::read_to_string(entry.path().join("stat")).ok());
    stats.into_iter().any(|stat| {
        // After the name in parentheses: state, parent, group.
        let fields: Vec<_> = stat.rsplit(") ").next().unwrap_or("").split(' ').collect();
        fields.get(2) == Some(&group) && fields.first() != Some(&"Z")
    })
}

#[test]
fn an_fmu_that_overwrites_the_turn_counter_is_detected_at_once() {
    let (slave, error) = error_of(Trouble::AnswerWrongTurn, &options());
    assert!(error.to_string().contains("wrote over shared memory"), "{error}");
    assert!(is_gone(slave.process_id()));
}

#[test]
fn the_master_survives_a_thread_of_the_fmu_that_overwrites_the_shared_memory() {
    for _ in 0..10 {
        let mut slave = ready(&limited(500));
        slave.set_integer(&[0], &[Trouble::OverwriteShared as i64]).unwrap();
        let (mut errors, mut texts) = (0, vec![String::new(); 4]);
        for _ in 0..20_000 {
            errors += usize::from(advance(&mut slave, 1.0, 0.5).is_err());
            errors += usize::from(slave.get_string(&[0; 4], &mut texts).is_err());
            errors += usize::from(slave.serialize_state().is_err());
            if errors > 100 {
                break;
            }
        }
        assert!(errors > 100, "{errors} errors only");
        let process = slave.process_id();
        drop(slave);
        assert!(is_gone(process));
    }
}

#[test]
fn very_many_messages_neither_delay_nor_end_the_run() {
    let mut slave = ready(&options());
    slave.set_integer(&[0], &[Trouble::Flood as i64]).unwrap();
    assert_eq!(advance(&mut slave, 1.0, 0.5).unwrap(), (StepResult::Whole, 0.5));
    slave.set_integer(&[0], &[Trouble::None as i64]).unwrap();
    assert_eq!(advance(&mut slave, 1.0, 0.5).unwrap(), (StepResult::Whole, 1.0));
}

#[test]
fn an_fmu_that_hangs_while_it_is_freed_is_ended() {
    for trouble in [Trouble::HangInFree, Trouble::CrashInFree] {
        let mut slave = ready(&limited(200));
        slave.set_integer(&[0], &[trouble as i64]).unwrap();
        let process = slave.process_id();
        drop(slave);
        assert!(is_gone(process), "{trouble:?}");
    }
}

#[test]
fn an_fmu_that_fails_at_once_is_reported() {
    let error = |name| isolate::open(troubles(), name, &options()).err().unwrap();
    let IsolateError::Call { source, .. } = error("crashes at once") else { panic!() };
    assert_eq!(source.function, "fmi2Instantiate");
    assert_eq!(source.failure, Failure::Killed(11, "SIGSEGV"));
    assert_eq!(source.messages, ["going down"]);
    let refused = error("refuses").to_string();
    assert!(refused.contains("not under this name") && refused.contains("refuses"), "{refused}");
}

#[test]
fn an_instance_can_be_created_again_in_the_same_process() {
    let mut slave = ready(&options());
    let process = slave.process_id();
    for _ in 0..3 {
        assert_eq!(advance(&mut slave, 1.0, 0.5).unwrap(), (StepResult::Whole, 0.5));
        slave.renew("two", &options()).unwrap();
        assert_eq!(slave.process_id(), process);
        slave.setup_experiment(&Experiment::default()).unwrap();
        slave.enter_initialization_mode().unwrap();
        slave.exit_initialization_mode().unwrap();
    }
    let refused = slave.renew("refuses", &options()).unwrap_err().to_string();
    assert!(refused.contains("not under this name"), "{refused}");
    drop(slave);
    assert!(is_gone(process));
    let IsolateError::Call { source, .. } =
        ready(&options()).renew("crashes at once", &options()).unwrap_err()
    else {
        panic!()
    };
    assert_eq!(
        (source.function, source.failure),
        ("fmi2Instantiate", Failure::Killed(11, "SIGSEGV"))
    );
}

#[test]
fn fmus_that_cannot_be_isolated_are_refused_with_the_reason() {
    let missing = isolate::open("missing.fmu".as_ref(), "one", &options()).err().unwrap();
    assert!(missing.to_string().contains("missing.fmu"), "{missing}");
    let wrong = Options { executable: Some("no/such/program".into()), ..options() };
    let error = isolate::open(troubles(), "one", &wrong).err().unwrap().to_string();
    assert!(error.contains("no/such/program") && error.contains("one"), "{error}");
    let other = Options { executable: Some("/bin/true".into()), ..options() };
    let error = isolate::open(troubles(), "one", &other).err().unwrap();
    let text = error.to_string();
    let IsolateError::NoWorker { failure: Failure::Exited(0), .. } = error else {
        panic!("{text}");
    };
    assert!(
        text.contains("fmu_import::isolate::worker()") && text.contains("--fmu-worker"),
        "{text}"
    );
    let preload = Options { preload: vec!["libno-such.so".into()], ..options() };
    let error = isolate::open(troubles(), "one", &preload).err().unwrap().to_string();
    assert!(error.contains("libno-such.so"), "{error}");
}

#[test]
fn the_time_limit_of_calls_is_not_that_of_the_start_of_a_process() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("slow");
    let text = format!("#!/bin/sh\nsleep 1\nexec '{}' \"$@\"\n", tests::command().display());
    std::fs::write(&script, text).unwrap();
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(&script, mode).unwrap();
    let slow = Options { executable: Some(script), ..limited(500) };
    isolate::open(troubles(), "one", &slow).map(drop).unwrap();
}

#[test]
fn a_worker_without_a_master_reports_it() {
    let output = tests::run(&[isolate::WORKER]);
    assert_eq!(output.status.code(), Some(2));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(text.contains("for the master's own use"), "{text}");
}
