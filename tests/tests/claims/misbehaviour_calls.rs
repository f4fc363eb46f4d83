//! Calls that FMUs in C refuse, delay or complete in part: the result that the master gets.
#![expect(clippy::unwrap_used, clippy::float_cmp, reason = "tests; exact by construction")]

use std::time::Duration;

use fmu_description::abi::Status;
use fmu_import::{Fmu, Instance};
use master::{CallError, Failure, Slave, StepResult};
use tests::c_fmu::CFmu;

use crate::misbehaviour::{self, initialise, ready};

const PART: StepResult = StepResult::Part { reached: 0.5, terminated: false };

fn instance(behaviour: &str) -> Instance {
    misbehaviour::instance(&CFmu::that(behaviour))
}

fn output(slave: &mut Instance) -> f64 {
    let mut values = [f64::NAN];
    slave.get_real(&[1], &mut values).unwrap();
    values[0]
}

/// Calls every function from the initial values to the end; stops at the first call that fails.
fn life(slave: &mut Instance) -> Result<(), CallError> {
    slave.set_real(&[0], &[1.0])?;
    slave.set_integer(&[0], &[1])?;
    slave.set_boolean(&[0], &[1])?;
    slave.set_string(&[0], &[String::new()])?;
    initialise(slave)?;
    for time in [0.0, 0.25, 0.5] {
        slave.do_step(time, 0.25, true)?;
        slave.get_real(&[1], &mut [0.0])?;
        slave.get_integer(&[1], &mut [0])?;
        slave.get_boolean(&[1], &mut [0])?;
        slave.get_string(&[1], &mut [String::new()])?;
    }
    slave.terminate()
}

const FUNCTIONS: [&str; 13] = [
    "fmi2SetReal",
    "fmi2SetInteger",
    "fmi2SetBoolean",
    "fmi2SetString",
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2DoStep",
    "fmi2GetReal",
    "fmi2GetInteger",
    "fmi2GetBoolean",
    "fmi2GetString",
    "fmi2Terminate",
];

#[test]
fn an_error_has_the_function_the_status_and_the_message_of_the_fmu() {
    for function in FUNCTIONS {
        let error = life(&mut instance(&format!("fail in {function}"))).unwrap_err();
        assert_eq!(error.to_string(), format!("{function} returned fmi2Error: as it was told"));
    }
}

#[test]
fn an_undefined_status_is_an_error_with_its_number() {
    for function in FUNCTIONS {
        let error = life(&mut instance(&format!("return 17 in {function}"))).unwrap_err();
        assert_eq!((error.function, error.failure), (function, Failure::UnknownStatus(17)));
    }
}

#[test]
fn a_pending_call_that_cannot_be_pending_is_an_error() {
    for function in FUNCTIONS.into_iter().filter(|function| *function != "fmi2DoStep") {
        let error = life(&mut instance(&format!("stay pending in {function}"))).unwrap_err();
        let expected = Failure::Status(Status::Pending);
        assert_eq!((error.function, error.failure), (function, expected));
    }
}

#[test]
fn a_discarded_call_other_than_a_step_is_an_error() {
    for function in FUNCTIONS.into_iter().filter(|function| *function != "fmi2DoStep") {
        let error = life(&mut instance(&format!("discard in {function}"))).unwrap_err();
        let expected = Failure::Status(Status::Discard);
        assert_eq!((error.function, error.failure), (function, expected));
    }
}

#[test]
fn warnings_do_not_stop_a_run() {
    life(&mut instance("warn everywhere")).unwrap();
    for function in FUNCTIONS {
        life(&mut instance(&format!("warn in {function}"))).unwrap();
    }
}

#[test]
fn a_discarded_step_returns_the_time_reached_and_can_be_repeated_to_it() {
    let mut slave = ready("discard at t1");
    slave.save_state(0).unwrap();
    assert_eq!(slave.do_step(0.0, 0.75, false), Ok(PART));
    assert_eq!(output(&mut slave), 0.5, "the values of the last successful time");
    slave.restore_state(0).unwrap();
    assert_eq!(slave.do_step(0.0, 0.5, false), Ok(StepResult::Whole));
    assert_eq!(slave.do_step(0.5, 0.5, true), Ok(StepResult::Whole));
    assert_eq!(output(&mut slave), 1.0);
}

#[test]
fn a_step_discarded_without_progress_returns_its_start() {
    let mut slave = ready("discard every step");
    let nowhere = StepResult::Part { reached: 0.0, terminated: false };
    assert_eq!(slave.do_step(0.0, 1.0, false), Ok(nowhere));
}

#[test]
fn an_fmu_that_requests_the_end_of_the_simulation_returns_the_time() {
    let end = StepResult::Part { reached: 0.5, terminated: true };
    let mut slave = ready("end at t1");
    assert_eq!(slave.do_step(0.0, 1.0, true), Ok(end));
    assert_eq!(output(&mut slave), 0.5);
    assert_eq!(slave.terminate(), Ok(()));
}

#[test]
fn a_discarded_step_without_a_last_successful_time_is_an_error() {
    let error = ready("discard at t1 without saying so").do_step(0.0, 1.0, true).unwrap_err();
    assert_eq!(error.failure, Failure::Status(Status::Discard));
    assert_eq!(error.messages, ["the step is too long"]);
}

/// Section 2.1.3: after `fmi2Fatal` no function may be called; after a discarded step its state may be restored.
#[test]
fn an_fmu_that_breaks_when_asked_about_a_discarded_step_is_unusable() {
    for behaviour in ["discard at t1 and break", "discard at t1 and break later"] {
        let error = ready(behaviour).do_step(0.0, 1.0, true).unwrap_err();
        assert_eq!(error.failure, Failure::Status(Status::Fatal));
        assert!(!error.leaves_the_instance_usable());
    }
}

#[test]
fn a_last_successful_time_outside_of_the_step_is_an_error() {
    let error = ready("lie about t1").do_step(0.0, 1.0, true).unwrap_err();
    let Failure::InvalidAnswer(what) = &error.failure else { panic!("{error}") };
    assert!(what.contains("-1 s") && what.contains("from 0 to 1 s"), "{what}");
}

#[test]
fn a_pending_step_is_polled_until_it_is_done() {
    let mut slave = instance("pend");
    slave.set_integer(&[2], &[25]).unwrap();
    initialise(&mut slave).unwrap();
    assert_eq!(slave.do_step(0.0, 0.5, true), Ok(StepResult::Whole));
    assert_eq!(slave.do_step(0.5, 0.25, true), Ok(StepResult::Whole));
    assert_eq!(output(&mut slave), 0.75);
}

#[test]
fn a_pending_step_that_fails_later_is_an_error_of_the_step() {
    let mut slave = ready("pend and fail");
    assert_eq!(slave.do_step(0.0, 0.5, true), Ok(StepResult::Whole));
    let error = slave.do_step(0.5, 0.5, true).unwrap_err();
    assert_eq!(error.to_string(), "fmi2DoStep returned fmi2Error: failed in the background");
}

#[test]
fn a_pending_step_that_is_discarded_later_returns_the_time_reached() {
    let mut slave = ready("pend and discard at t1");
    slave.set_time_limit(Some(Duration::from_secs(60)));
    assert_eq!(slave.do_step(0.0, 1.0, true), Ok(PART));
}

/// Section 4.2.4: the FMU ends the process if an instance is freed while its step is pending.
#[test]
fn a_step_that_stays_pending_is_cancelled_or_abandoned_after_the_time_limit() {
    let stubborn = CFmu::that("pend").without(&["fmi2CancelStep"]);
    for fmu in [CFmu::that("pend"), stubborn] {
        let folder = tempfile::tempdir().unwrap();
        let opened = Fmu::open(&fmu.write(folder.path(), "slave")).unwrap();
        let mut slave = opened.instantiate("slave").unwrap();
        slave.set_integer(&[2], &[-1]).unwrap();
        slave.set_time_limit(Some(Duration::from_millis(50)));
        initialise(&mut slave).unwrap();
        let error = slave.do_step(0.0, 0.5, true).unwrap_err();
        assert_eq!(error.to_string(), "fmi2DoStep did not return within 0.05 s");
    }
}

/// Section 4.2.4: the FMU ends the process if an instance is freed while its step is pending.
#[test]
fn a_pending_step_about_which_the_fmu_does_not_answer_is_cancelled() {
    let folder = tempfile::tempdir().unwrap();
    let fmu = CFmu::that("pend").without(&["fmi2GetStatus"]);
    let opened = Fmu::open(&fmu.write(folder.path(), "slave")).unwrap();
    let mut slave = opened.instantiate("slave").unwrap();
    initialise(&mut slave).unwrap();
    let error = slave.do_step(0.0, 0.5, true).unwrap_err();
    assert_eq!((error.function, error.failure), ("fmi2GetStatus", Failure::Missing));
}

/// Section 2.1.3: the FMU ends the process if a function of any instance is called afterwards.
#[test]
fn after_a_fatal_error_no_instance_is_freed() {
    let folder = tempfile::tempdir().unwrap();
    let path = CFmu::that("fail fatally in fmi2DoStep").write(folder.path(), "slave");
    let fmu = Fmu::open(&path).unwrap();
    let mut slaves = ["a", "b"].map(|name| fmu.instantiate(name).unwrap());
    for slave in &mut slaves {
        initialise(slave).unwrap();
    }
    slaves[0].do_step(0.0, 0.5, true).unwrap();
    let error = slaves[0].do_step(0.5, 0.5, true).unwrap_err();
    assert_eq!(error.failure, Failure::Status(Status::Fatal));
}

#[test]
fn a_step_of_another_size_is_refused_with_the_message_of_the_fmu() {
    let mut slave = ready("step of one size");
    assert_eq!(slave.do_step(0.0, 0.25, true), Ok(StepResult::Whole));
    assert_eq!(slave.do_step(0.25, 0.25, true), Ok(StepResult::Whole));
    let error = slave.do_step(0.5, 0.125, true).unwrap_err();
    assert_eq!(error.messages, ["the size of the step has changed"]);
}

#[test]
fn nan_and_infinity_are_passed_on_unchanged() {
    for (behaviour, expected) in [("not a number", f64::NAN), ("infinity", f64::NEG_INFINITY)] {
        let mut slave = ready(behaviour);
        slave.do_step(0.0, 0.5, true).unwrap();
        let actual = output(&mut slave);
        assert!(actual == expected || (actual.is_nan() && expected.is_nan()), "{actual}");
    }
}

/// Returns the messages of the FMU until it refuses a value that does not exist.
fn said(behaviour: &str) -> Vec<String> {
    let mut slave = ready(behaviour);
    slave.get_real(&[99], &mut [0.0]).unwrap_err().messages
}

#[test]
fn messages_are_formatted_whatever_their_content() {
    let messages = said("specifiers in fmi2SetupExperiment");
    assert_eq!(messages[0], "7% of %s%n at 0.125 \u{fffd}\u{fffd}");
    assert_eq!(said("no category in fmi2SetupExperiment")[0], "uncategorised");
    assert_eq!(said("no name in fmi2SetupExperiment")[0], "anonymous");
    assert_eq!(said("no message in fmi2SetupExperiment"), ["there is no such Real"]);
}

#[test]
fn the_last_of_very_many_messages_are_kept() {
    let messages = said("flood in fmi2SetupExperiment");
    assert!(messages.len() <= 10, "{} messages", messages.len());
    assert_eq!(messages[messages.len() - 2..], ["message 999999", "there is no such Real"]);
}

#[test]
fn the_start_of_a_message_of_a_million_characters_is_kept() {
    let messages = said("long message in fmi2SetupExperiment");
    let length = messages[0].len();
    assert!((1000..=4096).contains(&length), "{length} characters");
    assert!(messages[0].bytes().all(|byte| byte == b'm'));
}

#[test]
fn an_instantiation_that_fails_reports_the_reason_or_that_the_fmu_gives_none() {
    for (behaviour, reason) in [
        ("fail in fmi2Instantiate", "as it was told"),
        ("return 17 in fmi2Instantiate", "no reason"),
        ("silent without loggingOn", "there is no licence"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = CFmu::that(behaviour).write(folder.path(), "slave");
        let error = Fmu::open(&path).unwrap().instantiate("slave").err().unwrap().to_string();
        assert!(error.contains(reason) && error.contains("fmi2Instantiate"), "{error}");
    }
}
