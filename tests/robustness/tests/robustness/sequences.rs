//! Random sequences of calls.

use fmu::call_order::Function;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use robustness::calls::CALLS;
use robustness::exporter::order;
use robustness::importer::{Importer, describe};
use robustness::machine::{Misbehaviour, Place, with_plan};
use robustness::sequence::{FREE, HOSTILE, ILLEGAL, LENGTH, run};

/// Bytes for up to `calls` calls; `first` says which instance and whether calls may be illegal.
fn bytes(first: impl Strategy<Value = u8>, calls: usize) -> impl Strategy<Value = Vec<u8>> {
    let call = (first, any::<[u8; LENGTH - 1]>()).prop_map(|(first, rest)| {
        let mut call = vec![first];
        call.extend(rest);
        call
    });
    vec(call, 1..calls).prop_map(|calls| calls.concat())
}

fn hold(cases: u32, strategy: &impl Strategy<Value = Vec<u8>>) {
    // Data that is created once for the process is created before memory is counted.
    run(&[0; 3 * LENGTH]).unwrap();
    // The panic hook is shared by all instances: this instance keeps it in place during the count.
    let _instance = Importer::new(&order(1));
    let cases = if cfg!(miri) { 3 } else { cases };
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let done = TestRunner::new(config).run(strategy, |bytes| {
        let mut done = Ok(0);
        let memory = allocation_counter::measure(|| done = run(&bytes));
        let memory = (memory.count_current, memory.bytes_current);
        prop_assert!(done.is_ok(), "{done:?}");
        // Rust leaks the return value of a function if a destructor of its locals panics.
        let lossy = done.is_ok_and(|reached| reached & (1 << Place::Drop as u32) != 0);
        prop_assert!(lossy || memory == (0, 0), "{memory:?} blocks and bytes are left");
        Ok(())
    });
    assert_eq!(done, Ok(()));
}

#[test]
fn every_sequence_of_calls_is_answered_as_the_standard_says_and_leaves_no_memory() {
    hold(4000, &bytes(any::<u8>(), 60));
}

#[test]
fn long_sequences_are_answered_as_the_standard_says() {
    hold(200, &bytes(0..HOSTILE, 600));
}

/// Whether the model can fail there by other means than a panic.
fn is_fallible(place: Place) -> bool {
    use Place as P;
    let fallible =
        [P::New, P::Check, P::Initialize, P::Step, P::Update, P::Differentiate, P::Event];
    fallible.contains(&place)
}

/// The bytes of one call: the instance, the function, and the plan of the model.
fn call(who: u8, which: u8, plan: [u8; 3]) -> [u8; LENGTH] {
    let mut call = [0; LENGTH];
    call[..2].copy_from_slice(&[who, which]);
    call[2..5].copy_from_slice(&plan);
    call
}

/// `fmi2Instantiate` for one interface.
fn instantiate(instance: u8, exchange: bool) -> [u8; LENGTH] {
    let mut call = call(instance, 0, [0; 3]);
    call[3] = u8::from(!exchange);
    call
}

/// One call of `function` with harmless arguments, legal or not.
fn plain(instance: u8, function: Function, plan: [u8; 3]) -> [u8; LENGTH] {
    let which = CALLS.iter().position(|(known, _)| *known == function);
    call(ILLEGAL | instance, which.map_or(FREE, |which| u8::try_from(which).unwrap()), plan)
}

/// The calls after `fmi2Instantiate` that lead to each state.
fn ways(exchange: bool) -> Vec<Vec<Function>> {
    use Function as F;
    let on = |more: &[F]| [&[F::EnterInitializationMode, F::ExitInitializationMode], more].concat();
    let by_interface = if exchange {
        on(&[F::EnterContinuousTimeMode, F::SetContinuousStates])
    } else {
        on(&[F::SetRealInputDerivatives, F::DoStep, F::GetDirectionalDerivative])
    };
    vec![
        vec![],
        vec![F::EnterInitializationMode],
        on(&[F::GetFMUstate, F::SerializeFMUstate, F::SetReal]),
        by_interface,
        on(&[F::Terminate]),
        on(&[F::CancelStep]),
    ]
}

#[test]
fn failures_and_panics_anywhere_are_answered_and_reported_while_another_instance_continues() {
    let (mut reached, mut number) = (0, 0_u32);
    let every = CALLS.iter().map(|(function, _)| *function).chain([Function::FreeInstance]);
    let plans = (0..Place::EVERY.len()).flat_map(|place| {
        let misbehaviour =
            if is_fallible(Place::EVERY[place]) { 0..Misbehaviour::EVERY.len() } else { 0..1 };
        misbehaviour.map(move |misbehaviour| {
            [0xff, place, misbehaviour].map(|way| u8::try_from(way).unwrap())
        })
    });
    for plan in plans {
        reached |= run(&call(0, 0, plan)).unwrap();
        for (exchange, function) in every.clone().flat_map(|way| [(true, way), (false, way)]) {
            for way in ways(exchange) {
                number += 1;
                if cfg!(miri) && !number.is_multiple_of(2999) {
                    continue;
                }
                let mut calls = vec![instantiate(0, exchange), instantiate(1, exchange)];
                calls.extend(way.iter().map(|way| plain(0, *way, [0; 3])));
                calls.push(plain(0, function, plan));
                calls.extend(ways(exchange)[3].iter().map(|way| plain(1, *way, [0; 3])));
                match run(&calls.concat()) {
                    Ok(places) => reached |= places,
                    Err(what) => panic!("{what}: {plan:?}, {function:?} after {way:?}"),
                }
            }
        }
    }
    assert!(cfg!(miri) || reached == (1 << Place::EVERY.len()) - 1, "{reached:b}");
}

#[test]
fn a_panic_in_the_description_of_a_model_is_reported() {
    for place in Place::EVERY {
        let (described, happened) = with_plan(Some((place, Misbehaviour::Panic)), describe);
        match described {
            Ok(xml) => assert!(!happened && xml.contains("<ModelStructure>")),
            Err(message) => {
                assert!(happened && message.contains("100 % misbehaviour #1"), "{message}");
            }
        }
    }
}
