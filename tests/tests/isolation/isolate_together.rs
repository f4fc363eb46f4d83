//! Isolated FMUs step at the same time, with the same results and the same reports.
#![cfg(target_os = "linux")]
#![expect(clippy::float_cmp, reason = "tests; exact by construction")]

use std::time::{Duration, Instant};

use master::{Background as _, CommunicationStep, Failure, Slave as _, StepRequest};
use tests::Trouble;
use tests::c_fmu::CFmu;
use tests::coupled::Run;
use tests::isolated::{limited, options, ready};

#[test]
fn steps_started_together_are_finished_together() {
    let mut slaves = [ready(&options()), ready(&options()), ready(&options())];
    let mut outputs = [[0.0]; 3];
    for _ in 0..100 {
        for (input, slave) in [1.0, 2.0, 3.0].iter().zip(&mut slaves) {
            slave.begin_advance(&step(&[*input], &mut [0.0])).unwrap();
        }
        for ((input, slave), output) in [1.0, 2.0, 3.0].iter().zip(&mut slaves).zip(&mut outputs) {
            slave.finish_advance(&mut step(&[*input], output)).unwrap();
        }
    }
    assert_eq!(outputs, [[25.0], [50.0], [75.0]]);
}

#[test]
fn the_next_call_waits_for_a_step_that_was_started_and_not_finished() {
    let mut slave = ready(&options());
    let mut output = [0.0];
    for steps in 1..=100 {
        slave.begin_advance(&step(&[1.0], &mut [0.0])).unwrap();
        slave.get_real(&[1], &mut output).unwrap();
        assert_eq!(output, [0.25 * f64::from(steps)]);
        let error = slave.finish_advance(&mut step(&[1.0], &mut output)).unwrap_err();
        assert!(error.to_string().contains("was not started before it was finished"), "{error}");
    }
    let process = slave.process_id();
    slave.begin_advance(&step(&[1.0], &mut [0.0])).unwrap();
    drop(slave);
    let process = std::path::PathBuf::from(format!("/proc/{process}"));
    assert!(!process.exists());
}

#[test]
fn a_step_allocates_nothing_in_the_master() {
    let mut slave = ready(&options());
    let mut output = [0.0];
    let mut exchange = || {
        slave.set_real(&[0], &[1.0]).unwrap();
        slave.advance(&mut step(&[1.0], &mut output)).unwrap();
        slave.get_real(&[1], &mut output).unwrap();
    };
    exchange();
    let measured = allocation_counter::measure(|| (0..100).for_each(|_| exchange()));
    assert_eq!(measured.count_total, 0);
}

#[test]
fn the_time_limit_of_a_step_counts_from_its_start() {
    let mut slaves = [ready(&limited(1000)), ready(&limited(1000)), ready(&limited(1000))];
    for slave in &mut slaves {
        slave.set_integer(&[0], &[Trouble::Hang as i64]).unwrap();
    }
    let begin = Instant::now();
    for slave in &mut slaves {
        slave.begin_advance(&step(&[1.0], &mut [0.0])).unwrap();
    }
    for slave in &mut slaves {
        let error = slave.finish_advance(&mut step(&[1.0], &mut [0.0])).unwrap_err();
        assert_eq!((error.failure, error.function), (Failure::TimedOut(1.0), "fmi2DoStep"));
    }
    let taken = begin.elapsed();
    assert!(taken >= Duration::from_secs(1) && taken < Duration::from_secs(3), "{taken:?}");
}

/// A step of 0.25 s.
fn step<'a>(input: &'a [f64], output: &'a mut [f64]) -> StepRequest<'a> {
    let step = CommunicationStep { time: 0.0, size: 0.25, never_back: true };
    StepRequest::held(&[0], input, step, &[1], output)
}

const NAMES: [&str; 4] = ["a", "b", "c", "d"];

/// Four FMUs with these behaviours; the output of each is the input of the next. In steps at the
/// same time each gets the input from before the step.
fn chain(behaviours: [&str; 4], more: &[&str]) -> Run {
    let fmus = behaviours.map(CFmu::that);
    let named: Vec<_> = NAMES.into_iter().zip(&fmus).collect();
    let links = ["--connect", "a.y=b.u", "--connect", "b.y=c.u", "--connect", "c.y=d.u"];
    let record = NAMES.map(|name| format!("{name}.y"));
    let recorded = record.iter().flat_map(|name| ["--record", name.as_str()]);
    let more: Vec<_> = links.into_iter().chain(recorded).chain(more.iter().copied()).collect();
    Run::of(&named, &more)
}

fn outputs(run: &Run) -> Vec<Vec<String>> {
    ["time", "a.y", "b.y", "c.y", "d.y"].map(|name| run.column(name)).into()
}

const WELL: &str = "as it should";

#[test]
fn four_isolated_fmus_give_the_same_bits_even_if_steps_are_discarded() {
    let late = ["--set", "b.t1=0.53125"];
    for (behaviour, more) in [
        (WELL, &late[..]),
        ("discard at t1", &["--set", "b.t1=0.53125", "--rollback"]),
        ("discard at t1 and go on", &late),
        ("pend", &late[..]),
    ] {
        let behaviours = [WELL, behaviour, WELL, WELL];
        let near = chain(behaviours, more);
        assert_eq!(near.status, Some(0), "{}", near.message);
        let far = chain(behaviours, &[&["--isolate"], more].concat());
        assert_eq!(far.status, Some(0), "{}", far.message);
        assert!(near.column("time").len() >= 17);
        assert_eq!(outputs(&far), outputs(&near), "{behaviour}");
        let threads = chain(behaviours, &[&["--isolate", "--jobs", "2"], more].concat());
        assert_eq!(outputs(&threads), outputs(&near), "{behaviour}");
    }
}

#[test]
fn the_crash_of_one_of_four_is_attributed_to_it_and_the_results_are_complete() {
    for (position, name) in NAMES.into_iter().enumerate() {
        let mut behaviours = [WELL; 4];
        behaviours[position] = "crash in fmi2DoStep";
        let run = chain(behaviours, &["--isolate"]);
        assert_eq!(run.status, Some(1), "{}", run.message);
        run.says(&[&format!("{name} at t = 0.5 s: fmi2DoStep crashed"), "SIGSEGV"]);
        let whole = outputs(&chain([WELL; 4], &[]));
        let actual = outputs(&run);
        assert_eq!(actual[0].len(), 9);
        for (actual, whole) in actual.iter().zip(&whole) {
            assert_eq!(actual[..], whole[..9]);
        }
    }
}

#[test]
fn of_several_failures_in_a_step_the_first_in_order_is_reported() {
    let limit = ["--isolate", "--time-limit", "0.5"];
    for (behaviours, parts) in [
        ([WELL, "exit 3 in fmi2DoStep", "crash in fmi2DoStep", WELL], ["b at t", "exit status 3"]),
        ([WELL, WELL, "fail in fmi2DoStep", "hang in fmi2DoStep"], ["c at t", "as it was told"]),
        (
            [WELL, "hang in fmi2DoStep", "hang in fmi2DoStep", "abort in fmi2DoStep"],
            ["b at t", "did not return within 0.5 s"],
        ),
    ] {
        let run = chain(behaviours, &limit);
        assert_eq!(run.status, Some(1), "{}", run.message);
        run.says(&parts);
        assert_eq!(run.column("d.y").len(), 9);
    }
}
