//! The functions of model exchange; the machine has one state and one event indicator.

use std::ffi::c_int;

use fmu::call_order::State;
use fmu_description::abi::fmi2EventInfo;

use super::{Call, Outcome};
use crate::array::Array;
use crate::choice::{Choice, usable};
use crate::importer::Importer;
use crate::prediction::{DISCARD, ERROR, OK};

pub(super) fn enter_event_mode(call: &mut Call) -> Outcome {
    let fine = call.core.takes_event();
    Outcome::if_fine(call.importer.enter_event_mode(), fine)
        .with(|core, _| (core.state, core.earliest) = (State::EventMode, core.time))
}

pub(super) fn enter_continuous_time_mode(call: &mut Call) -> Outcome {
    Outcome::new(call.importer.enter_continuous_time_mode(), OK).to(State::ContinuousTimeMode)
}

pub(super) fn new_discrete_states(call: &mut Call) -> Outcome {
    let mut info = call.choice.place(fmi2EventInfo::default());
    let status = call.importer.new_discrete_states(&mut info);
    let next = info.items[0].next_event_time;
    Outcome::if_fine(status, usable(&info))
        .with(move |core, _| core.next_event = Some(next))
        .claim(next == call.core.time + 1.0, || format!("next event at {next}"))
}

pub(super) fn completed_integrator_step(call: &mut Call) -> Outcome {
    let (mut enter, mut terminate) = (call.choice.place(7), call.choice.place(7));
    let status = call.importer.completed_integrator_step(&mut enter, &mut terminate);
    let fine = usable(&enter) && usable(&terminate) && call.core.is_before_stop(call.core.time);
    Outcome::if_fine(status, fine)
        .with(|core, _| {
            core.earliest = core.earliest.max(core.completed);
            core.completed = core.time;
        })
        .claim((enter.items[0], terminate.items[0]) == (0, 0), || "an event".to_owned())
}

pub(super) fn set_time(call: &mut Call) -> Outcome {
    let core = call.core;
    let ahead = core.time + f64::from(call.choice.byte() % 32);
    let odd = [f64::NAN, f64::INFINITY, core.start - 1.0, core.earliest - 0.5, core.earliest, 1e12];
    let time = if call.choice.rarely() { call.choice.of(&odd) } else { ahead };
    let status = call.importer.set_time(time);
    // Condition 8 of section 3.2.3: in event mode only without continuous states.
    let here = core.state == State::ContinuousTimeMode;
    let fine = here && time.is_finite() && time >= core.earliest;
    Outcome::if_fine(status, fine).with(move |core, _| core.time = time)
}

pub(super) fn set_continuous_states(call: &mut Call) -> Outcome {
    let count = call.choice.either(&[1], &[0, 2]);
    let values = call.choice.array(count, Choice::real);
    let status = call.importer.set_continuous_states(&values);
    let verdict = match values.items[..] {
        [value] if usable(&values) => {
            if value.is_finite() {
                OK
            } else {
                DISCARD
            }
        }
        _ => ERROR,
    };
    Outcome::new(status, verdict)
}

fn vector(call: &mut Call, get: fn(&Importer, &mut Array<f64>) -> c_int) -> Outcome {
    let count = call.choice.either(&[1], &[0, 2]);
    let mut values = call.choice.array(count, |_| 77.0);
    let status = get(call.importer, &mut values);
    Outcome::if_fine(status, usable(&values) && count == 1)
}

pub(super) fn get_derivatives(call: &mut Call) -> Outcome {
    vector(call, Importer::get_derivatives)
}

pub(super) fn get_event_indicators(call: &mut Call) -> Outcome {
    vector(call, Importer::get_event_indicators)
}

pub(super) fn get_continuous_states(call: &mut Call) -> Outcome {
    vector(call, Importer::get_continuous_states)
}

pub(super) fn get_nominals(call: &mut Call) -> Outcome {
    vector(call, Importer::get_nominals)
}
