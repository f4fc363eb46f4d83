//! `fmi2GetXXX`, `fmi2SetXXX`, `fmi2GetDirectionalDerivative`.

use fmu::call_order::State;

use super::{Call, Outcome, together};
use crate::array::Array;
use crate::choice::{Choice, usable};
use crate::prediction::{Core, DISCARD, ERROR, OK, Values};

/// Chooses references of variables of a type with `count` variables, most of which satisfy `fit`.
fn references(choice: &mut Choice, count: u32, fit: impl Fn(u32) -> bool) -> Array<u32> {
    let length = choice.count();
    choice.array(length, |choice| choice.reference(count, &fit))
}

fn any(_: u32) -> bool {
    true
}

/// The verdict on the arrays, then on each element.
fn verdict(arrays: &[bool], elements: impl IntoIterator<Item = u8>) -> u8 {
    if arrays.iter().all(|fine| *fine) { together(elements) } else { ERROR }
}

fn fine(holds: bool) -> u8 {
    if holds { OK } else { ERROR }
}

/// Whether the value is valid and the variable can be set.
fn set(settable: bool, accepted: bool) -> u8 {
    match (settable, accepted) {
        (false, _) => ERROR,
        (true, false) => DISCARD,
        (true, true) => OK,
    }
}

/// Whether discrete inputs can be set.
fn between(core: &Core) -> bool {
    use State as S;
    let here = [S::Instantiated, S::InitializationMode, S::EventMode, S::StepComplete];
    here.contains(&core.state)
}

/// Whether the stored value differs from the one read.
fn differs<T: PartialEq>(pairs: impl IntoIterator<Item = (Option<T>, T)>) -> bool {
    pairs.into_iter().any(|(stored, got)| stored.is_some_and(|stored| stored != got))
}

pub(super) fn get_real(call: &mut Call) -> Outcome {
    let vr = references(&mut call.choice, 11, any);
    let mut values = call.choice.array(vr.items.len(), |_| 77.0);
    let status = call.importer.get_real(&vr, &mut values);
    let elements = vr.items.iter().map(|reference| fine(*reference < 11));
    let stored = |reference: &u32| match Values::place_of_real(*reference) {
        None => (*reference == 0).then_some(call.core.time),
        Some(place) => Some(call.core.values.reals[place]),
    };
    let wrong = differs(vr.items.iter().map(stored).zip(values.items.iter().copied()));
    Outcome::new(status, verdict(&[usable(&vr), usable(&values)], elements))
        .claim(!wrong, || format!("{vr:?} reads {values:?}"))
}

pub(super) fn set_real(call: &mut Call) -> Outcome {
    let vr = references(&mut call.choice, 11, |reference| call.core.settable_real(reference));
    let values = call.choice.array(vr.items.len(), Choice::real);
    let status = call.importer.set_real(&vr, &values);
    let (core, mut set_values) = (call.core, Vec::new());
    let elements = vr.items.iter().zip(&values.items).map(|(&reference, &value)| {
        if let Some(place) = Values::place_of_real(reference) {
            set_values.push((place, value));
        }
        let in_range = reference != 5 || (-10.0..=10.0).contains(&value);
        set(core.settable_real(reference), value.is_finite() && in_range)
    });
    let verdict = verdict(&[usable(&vr), usable(&values)], elements);
    Outcome::new(status, verdict).with(move |core, _| {
        for (place, value) in set_values {
            core.values.reals[place] = value;
        }
    })
}

pub(super) fn get_integer(call: &mut Call) -> Outcome {
    let vr = references(&mut call.choice, 3, any);
    let mut values = call.choice.array(vr.items.len(), |_| 77);
    let status = call.importer.get_integer(&vr, &mut values);
    let elements = vr.items.iter().map(|reference| fine(*reference < 3));
    let stored = |reference: &u32| call.core.values.integers.get(*reference as usize).copied();
    let wrong = differs(vr.items.iter().map(stored).zip(values.items.iter().copied()));
    Outcome::new(status, verdict(&[usable(&vr), usable(&values)], elements))
        .claim(!wrong, || format!("{vr:?} reads {values:?}"))
}

pub(super) fn set_integer(call: &mut Call) -> Outcome {
    let vr = references(&mut call.choice, 3, |reference| reference < 2);
    let values =
        call.choice.array(vr.items.len(), |choice| choice.either(&[1, 2], &[-5, 6, i32::MIN]));
    let status = call.importer.set_integer(&vr, &values);
    let pairs: Vec<_> = vr.items.iter().copied().zip(values.items.iter().copied()).collect();
    let elements = pairs.iter().map(|(reference, value)| {
        let accepted =
            if *reference == 0 { (-5..=5).contains(value) } else { [1, 2].contains(value) };
        set(*reference < 2 && between(call.core), accepted)
    });
    let verdict = verdict(&[usable(&vr), usable(&values)], elements);
    Outcome::new(status, verdict).with(move |core, _| {
        for (reference, value) in pairs {
            core.values.integers[reference as usize] = value;
        }
    })
}

pub(super) fn get_boolean(call: &mut Call) -> Outcome {
    let vr = references(&mut call.choice, 2, any);
    let mut values = call.choice.array(vr.items.len(), |_| 77);
    let status = call.importer.get_boolean(&vr, &mut values);
    let elements = vr.items.iter().map(|reference| fine(*reference < 2));
    let stored = |reference: &u32| (*reference == 0).then_some(i32::from(call.core.values.on));
    let wrong = differs(vr.items.iter().map(stored).zip(values.items.iter().copied()));
    Outcome::new(status, verdict(&[usable(&vr), usable(&values)], elements))
        .claim(!wrong, || format!("{vr:?} reads {values:?}"))
}

pub(super) fn set_boolean(call: &mut Call) -> Outcome {
    let vr = references(&mut call.choice, 2, |reference| reference == 0);
    let values = call.choice.array(vr.items.len(), |choice| choice.of(&[0, 1, 2, -1]));
    let status = call.importer.set_boolean(&vr, &values);
    let last = values.items.last().map(|value| *value != 0);
    let elements = vr.items.iter().map(|reference| fine(*reference == 0 && between(call.core)));
    let verdict = verdict(&[usable(&vr), usable(&values)], elements);
    Outcome::new(status, verdict)
        .with(move |core, _| core.values.on = last.unwrap_or(core.values.on))
}

pub(super) fn get_string(call: &mut Call) -> Outcome {
    let vr = references(&mut call.choice, 3, any);
    let shape = call.choice.shape();
    let (status, got) = call.importer.get_string(&vr, shape);
    let elements = vr.items.iter().map(|reference| fine(*reference < 3));
    let stored = |reference: &u32| call.core.values.strings.get(*reference as usize).cloned();
    let wrong = differs(vr.items.iter().map(stored).zip(got));
    let values = Array::<u32> { items: vr.items.clone(), shape };
    Outcome::new(status, verdict(&[usable(&vr), usable(&values)], elements))
        .claim(!wrong, || format!("{vr:?} reads something else"))
}

pub(super) fn set_string(call: &mut Call) -> Outcome {
    let vr = references(&mut call.choice, 3, |reference| reference < 2);
    let texts = call.choice.array(vr.items.len(), Choice::text);
    let status = call.importer.set_string(&vr, &texts);
    let as_text = |text: &Option<std::ffi::CString>| Some(text.as_ref()?.to_str().ok()?.to_owned());
    let read: Vec<_> = texts.items.iter().map(as_text).collect();
    let pairs: Vec<_> = vr.items.iter().copied().zip(read).collect();
    let elements = pairs
        .iter()
        .map(|(reference, text)| fine(*reference < 2 && text.is_some() && between(call.core)));
    let verdict = verdict(&[usable(&vr), usable(&texts)], elements);
    Outcome::new(status, verdict).with(move |core, _| {
        for (reference, text) in pairs {
            core.values.strings[reference as usize] = text.unwrap_or_default();
        }
    })
}

pub(super) fn get_directional_derivative(call: &mut Call) -> Outcome {
    let choice = &mut call.choice;
    let unknowns = references(choice, 11, |reference| call.core.is_unknown(reference));
    let mut to = choice.array(unknowns.items.len(), |_| 77.0);
    let knowns = references(choice, 11, |reference| call.core.is_known(reference));
    let delta = choice.array(knowns.items.len(), Choice::real);
    let status = call.importer.get_directional_derivative((&unknowns, &mut to), (&knowns, &delta));
    let elements = unknowns.items.iter().map(|reference| fine(call.core.is_unknown(*reference)));
    let elements =
        elements.chain(knowns.items.iter().map(|reference| fine(call.core.is_known(*reference))));
    let arrays = [usable(&unknowns), usable(&to), usable(&knowns), usable(&delta)];
    Outcome::new(status, verdict(&arrays, elements))
}
