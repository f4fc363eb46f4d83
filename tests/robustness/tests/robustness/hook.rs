//! The panic hook: replaced while an instance exists, inactive inside its calls only, restored when
//! the last instance is freed.

use std::panic::{self, PanicHookInfo};
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::thread;

use fmu_description::abi::fmi2EventInfo;

use robustness::array::Array;
use robustness::exporter::order;
use robustness::importer::{HEARS, Importer};
use robustness::machine::{Misbehaviour, Place, with_plan};

const FATAL: i32 = 4;

type Hook = Box<dyn Fn(&PanicHookInfo<'_>) + Send + Sync>;

/// Runs `body`, as the test `name` of this module, alone in a process.
fn alone(name: &str, body: impl FnOnce()) {
    const ALONE: &str = "FMI2_TEST_ALONE";
    if std::env::var_os(ALONE).is_some() {
        return body();
    }
    let this = std::env::current_exe().unwrap();
    let name = format!("hook::{name}");
    let output = Command::new(this)
        .args(["--exact", &name, "--nocapture", "--test-threads", "1"])
        .env(ALONE, "1")
        .output()
        .unwrap();
    let [out, err] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    assert!(output.status.success() && out.contains("1 passed"), "{out}{err}");
}

fn address(hook: &Hook) -> usize {
    std::ptr::from_ref(&**hook).cast::<()>().addr()
}

/// Installs a hook that keeps the messages; returns its address and the messages.
fn listen() -> (usize, Arc<Mutex<Vec<String>>>) {
    let messages = Arc::<Mutex<Vec<String>>>::default();
    let heard = Arc::clone(&messages);
    let hook: Hook = Box::new(move |panic| heard.lock().unwrap().push(panic.to_string()));
    let address = address(&hook);
    panic::set_hook(hook);
    (address, messages)
}

/// Returns the address of the installed hook and leaves it installed.
fn installed() -> usize {
    let hook = panic::take_hook();
    let address = address(&hook);
    panic::set_hook(hook);
    address
}

fn started() -> Importer {
    let importer = Importer::new(&order(1));
    let done = [importer.enter_initialization_mode(), importer.exit_initialization_mode()];
    assert_eq!(done, [0; 2]);
    importer
}

/// A step in which the model panics.
fn panic_in_a_step(importer: &Importer) {
    let plan = Some((Place::Step, Misbehaviour::Panic));
    assert_eq!(with_plan(plan, || importer.do_step(0.0, 0.5)), (FATAL, true));
}

/// `file:line:` of the line that contains `text` in the source of the machine.
fn place_of(text: &str) -> String {
    let source = include_str!("../../src/machine.rs");
    let line = source.lines().position(|line| line.contains(text)).unwrap() + 1;
    format!("machine.rs:{line}:")
}

#[test]
fn the_message_of_a_panic_has_its_file_and_line() {
    if !HEARS {
        return;
    }
    let importer = started();
    panic_in_a_step(&importer);
    let text = importer.take_messages().pop().unwrap().text;
    let place = place_of("Misbehaviour::Panic => panic!");
    assert!(text.contains(&place) && text.contains("misbehaviour"), "{text}, expected {place}");
    // In another function, so the place differs from that of the previous panic.
    let (other, happened) =
        with_plan(Some((Place::Variables, Misbehaviour::Panic)), || Importer::new(&order(1)));
    assert!(happened && !other.exists());
    let text = other.take_messages().pop().unwrap().text;
    assert!(text.contains("machine.rs:") && !text.contains(&place), "{text}");
}

#[test]
fn a_panic_inside_an_instance_reaches_its_importer_only() {
    alone("a_panic_inside_an_instance_reaches_its_importer_only", || {
        let (_, heard) = listen();
        let [one, other] = [started(), started()];
        panic_in_a_step(&one);
        drop(one);
        panic_in_a_step(&other);
        assert_eq!(*heard.lock().unwrap(), [""; 0]);
    });
}

#[test]
fn a_panic_outside_goes_to_the_hook_of_the_process() {
    alone("a_panic_outside_goes_to_the_hook_of_the_process", || {
        let (_, heard) = listen();
        let importer = started();
        assert!(thread::spawn(|| panic!("elsewhere")).join().is_err());
        assert!(panic::catch_unwind(|| panic!("between two calls")).is_err());
        panic_in_a_step(&importer);
        if HEARS {
            importer.let_the_logger_panic();
            assert_eq!(importer.do_step(0.0, f64::NAN), FATAL);
            let exchange = Importer::new(&order(0));
            let done = [exchange.enter_initialization_mode(), exchange.exit_initialization_mode()];
            assert_eq!(done, [0; 2]);
            assert_eq!(exchange.enter_continuous_time_mode(), 0);
            assert_eq!([exchange.set_time(60.0), exchange.enter_event_mode()], [0; 2]);
            exchange.let_the_logger_panic();
            // The message that the simulation ends is logged from inside the call.
            assert_eq!(
                exchange.new_discrete_states(&mut Array::right(vec![fmi2EventInfo::default()])),
                0
            );
        }
        let heard = heard.lock().unwrap();
        let all = ["elsewhere", "between two calls", "the importer's logger"];
        let expected = if HEARS { &all[..] } else { &all[..2] };
        assert_eq!(heard.len(), expected.len(), "{heard:?}");
        assert!(
            heard.iter().zip(expected).all(|(actual, token)| actual.contains(token)),
            "{heard:?}"
        );
    });
}

#[test]
fn the_hook_of_the_process_is_restored_when_the_last_instance_is_freed() {
    alone("the_hook_of_the_process_is_restored_when_the_last_instance_is_freed", || {
        let (token, _) = listen();
        let one = started();
        let other = started();
        panic_in_a_step(&one);
        assert_ne!(installed(), token);
        drop(one);
        assert_ne!(installed(), token);
        drop(other);
        assert_eq!(installed(), token, "after the last instance");
        let plan = Some((Place::New, Misbehaviour::Panic));
        assert!(!with_plan(plan, || Importer::new(&order(1))).0.exists());
        assert_eq!(installed(), token, "after an instance that could not be made");
        robustness::importer::describe().unwrap();
        assert_eq!(installed(), token, "after a description");
    });
}

#[test]
fn a_hook_that_the_importer_installs_meanwhile_stays() {
    alone("a_hook_that_the_importer_installs_meanwhile_stays", || {
        let importer = started();
        let (token, _) = listen();
        drop(importer);
        assert_eq!(installed(), token);
        let importer = started();
        panic_in_a_step(&importer);
        drop(importer);
        assert_eq!(installed(), token);
    });
}

#[test]
fn threads_that_make_and_free_instances_restore_the_hook() {
    alone("threads_that_make_and_free_instances_restore_the_hook", || {
        let (token, heard) = listen();
        thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| (0..200).for_each(|_| panic_in_a_step(&started())));
            }
        });
        assert_eq!(installed(), token);
        assert_eq!(*heard.lock().unwrap(), [""; 0]);
    });
}
