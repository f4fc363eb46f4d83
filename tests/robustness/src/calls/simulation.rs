//! The functions of co-simulation.

use std::ffi::c_int;
use std::ptr::null;

use super::{Call, Outcome, together};
use crate::choice::{Choice, usable};
use crate::prediction::{DISCARD, ERROR, OK};

const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

pub(super) fn do_step(call: &mut Call) -> Outcome {
    let core = call.core;
    let size = f64::from(1 + call.choice.byte() % 8) * 0.25;
    let (mut start, mut step) = (core.time, size);
    if call.choice.rarely() {
        start = call.choice.of(&[core.time + 1.0, core.time - 0.1, f64::NAN, f64::INFINITY]);
    }
    if call.choice.rarely() {
        step =
            call.choice.of(&[0.0, -0.25, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-15, 1e-20]);
    }
    let status = call.importer.do_step(start, step);
    let end = start + step;
    // A step must lead from one time to a later one.
    let takes_time = step >= start.next_up() - start;
    let fine = start == core.time && takes_time && step.is_finite() && core.is_before_stop(end);
    let half_way = start + 0.5 * step;
    let outcome = Outcome::if_fine(status, fine).with(move |core, _| core.time = end);
    Outcome { half_way, ..outcome }
}

pub(super) fn set_real_input_derivatives(call: &mut Call) -> Outcome {
    let choice = &mut call.choice;
    let count = choice.count();
    let vr = choice.array(count, |choice| choice.either(&[1], &[0, 2, 5, 99]));
    let orders = choice.array(count, |choice| choice.either(&[1, 2, i32::MAX], &[0, -1, i32::MIN]));
    let values = choice.array(count, Choice::real);
    let status = call.importer.set_real_input_derivatives(&vr, &orders, &values);
    let elements =
        vr.items.iter().zip(&orders.items).zip(&values.items).map(|((reference, order), x)| {
            if *reference == 1 && *order >= 1 && x.is_finite() { OK } else { ERROR }
        });
    let usable = usable(&vr) && usable(&orders) && usable(&values);
    Outcome::new(status, if usable { together(elements) } else { ERROR })
}

pub(super) fn get_real_output_derivatives(call: &mut Call) -> Outcome {
    let choice = &mut call.choice;
    let count = choice.count();
    let vr = choice.array(count, |choice| choice.either(&[2, 4], &[0, 1, 5, 99]));
    let orders = choice.array(count, |choice| choice.either(&[1], &[2, 0, -1, i32::MAX]));
    let mut values = choice.array(count, |_| 77.0);
    let status = call.importer.get_real_output_derivatives(&vr, &orders, &mut values);
    let elements = vr.items.iter().zip(&orders.items).map(|(reference, order)| {
        if [2, 4].contains(reference) && *order == 1 { OK } else { ERROR }
    });
    let usable = usable(&vr) && usable(&orders) && usable(&values);
    Outcome::new(status, if usable { together(elements) } else { ERROR })
}

pub(super) fn cancel_step(call: &mut Call) -> Outcome {
    Outcome::new(call.importer.cancel_step(), ERROR)
}

fn kind(choice: &mut Choice) -> c_int {
    choice.of(&[LAST_SUCCESSFUL_TIME, TERMINATED, 0, 1, 4, -1, c_int::MAX])
}

pub(super) fn get_status(call: &mut Call) -> Outcome {
    let (kind, mut value) = (kind(&mut call.choice), call.choice.place(7));
    Outcome::new(call.importer.get_status(kind, &mut value), DISCARD)
}

pub(super) fn get_integer_status(call: &mut Call) -> Outcome {
    let (kind, mut value) = (kind(&mut call.choice), call.choice.place(7));
    Outcome::new(call.importer.get_integer_status(kind, &mut value), DISCARD)
}

pub(super) fn get_string_status(call: &mut Call) -> Outcome {
    let (kind, mut value) = (kind(&mut call.choice), call.choice.place(null()));
    Outcome::new(call.importer.get_string_status(kind, &mut value), DISCARD)
}

pub(super) fn get_real_status(call: &mut Call) -> Outcome {
    let (kind, mut value) = (kind(&mut call.choice), call.choice.place(77.0));
    let status = call.importer.get_real_status(kind, &mut value);
    if kind != LAST_SUCCESSFUL_TIME {
        return Outcome::new(status, DISCARD);
    }
    Outcome::if_fine(status, usable(&value))
        .claim(value.items[0] == call.core.time, || format!("last successful time {value:?}"))
}

pub(super) fn get_boolean_status(call: &mut Call) -> Outcome {
    let (kind, mut value) = (kind(&mut call.choice), call.choice.place(77));
    let status = call.importer.get_boolean_status(kind, &mut value);
    if kind != TERMINATED {
        return Outcome::new(status, DISCARD);
    }
    Outcome::if_fine(status, usable(&value))
        .claim(value.items[0] == c_int::from(call.core.ended), || format!("terminated {value:?}"))
}
