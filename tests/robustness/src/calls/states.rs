//! FMU states: of this instance or another one, null, freed, serialised, damaged.

use super::{Call, Outcome, Record, SavedState};
use crate::array::{Array, Shape};
use crate::choice::{Choice, usable};
use crate::prediction::{Core, OK};

fn slot(choice: &mut Choice) -> usize {
    usize::from(choice.byte() % 3)
}

/// Chooses the index of a state that fits, or of any other.
fn filled(call: &mut Call, fits: impl Fn(&Core) -> bool) -> usize {
    let every: Vec<_> = (0..3).collect();
    let is_fine = |slot: &usize| call.stores.saved_states[*slot].of.as_ref().is_some_and(&fits);
    let fine: Vec<_> = every.iter().copied().filter(is_fine).collect();
    call.choice.either(if fine.is_empty() { &every } else { &fine }, &every)
}

/// Bytes are never misaligned.
fn bytes(items: Vec<u8>, shape: Shape) -> Array<u8> {
    Array { items, shape: if shape == Shape::Misaligned { Shape::Null } else { shape } }
}

pub(super) fn get(call: &mut Call) -> Outcome {
    let (slot, nowhere) = (slot(&mut call.choice), call.choice.rarely());
    let place = (!nowhere).then_some(&mut call.stores.saved_states[slot].saved);
    let status = call.importer.get_fmu_state(place);
    Outcome::if_fine(status, !nowhere)
        .with(move |core, stores| stores.saved_states[slot].of = Some(core.clone()))
}

pub(super) fn set(call: &mut Call) -> Outcome {
    let exchange = call.core.exchange;
    let slot = filled(call, |core| core.exchange == exchange);
    let SavedState { saved, of } = &call.stores.saved_states[slot];
    let status = call.importer.set_fmu_state(saved);
    let fine = of.as_ref().is_some_and(|core| core.exchange == call.core.exchange);
    Outcome::if_fine(status, fine).with(move |core, stores| {
        if let Some(saved_core) = &stores.saved_states[slot].of {
            *core = saved_core.clone();
        }
    })
}

pub(super) fn free(call: &mut Call) -> Outcome {
    let (slot, nowhere) = (slot(&mut call.choice), call.choice.rarely());
    if nowhere {
        // "If a null pointer is provided, the call is ignored" (section 2.1.8).
        return Outcome::new(call.importer.free_fmu_state(None), OK);
    }
    let SavedState { saved, .. } = &mut call.stores.saved_states[slot];
    let status = call.importer.free_fmu_state(Some(saved));
    let is_null = saved.is_null();
    Outcome::new(status, OK)
        .claim(is_null, || "a freed state is not null".to_owned())
        .with(move |_, stores| stores.saved_states[slot].of = None)
}

pub(super) fn size(call: &mut Call) -> Outcome {
    let SavedState { saved, of } = &call.stores.saved_states[filled(call, |_| true)];
    let mut size = call.choice.place(0);
    let status = call.importer.serialized_fmu_state_size(saved, &mut size);
    Outcome::if_fine(status, of.is_some() && usable(&size))
        .claim(size.items[0] > 0, || "no bytes".to_owned())
}

/// A size larger than any state of the machine.
const ROOM: usize = 20_000;

pub(super) fn serialize(call: &mut Call) -> Outcome {
    let SavedState { saved, of } = &call.stores.saved_states[filled(call, |_| true)];
    let room = call.choice.either(&[ROOM], &[0, 8, 60]);
    let mut place = bytes(vec![0xee; room], call.choice.shape());
    let status = call.importer.serialize_fmu_state(saved, &mut place);
    let record = usize::from(call.choice.byte() % 2);
    let fine = of.is_some() && place.shape == Shape::Right && room == ROOM;
    let mut again = Array::right(vec![0x11; room]);
    let same = status == 0 && call.importer.serialize_fmu_state(saved, &mut again) == 0;
    // Bytes that were not written keep the fill value.
    let unwritten = |(one, other): &(&u8, &u8)| **one == 0xee && **other == 0x11;
    let rest = place.items.iter().zip(&again.items).rev().take_while(unwritten).count();
    place.items.truncate(room - rest);
    again.items.truncate(room - rest);
    let same = same && place.items == again.items;
    let written = of.clone().map(|of| Record { bytes: place.items, of });
    Outcome::if_fine(status, fine)
        .claim(same, || "twice serialised is not the same".to_owned())
        .with(move |_, stores| stores.records[record] = written)
}

pub(super) fn de_serialize(call: &mut Call) -> Outcome {
    let choice = &mut call.choice;
    let record = call.stores.records[usize::from(choice.byte() % 2)].clone();
    let (slot, nowhere) = (slot(choice), choice.rarely());
    let shape = choice.shape();
    let damage = if choice.hostile { choice.byte() } else { 0 };
    let at = usize::from(choice.byte()) * 7;
    let mut bytes_read = record.as_ref().map(|record| record.bytes.clone()).unwrap_or_default();
    let at = at % bytes_read.len().max(1);
    let whole = damage < 200 && record.is_some();
    match damage {
        0..=199 => {}
        200..=219 => bytes_read.truncate(at),
        220..=239 if !bytes_read.is_empty() => bytes_read[at] ^= damage,
        _ => bytes_read.push(damage),
    }
    let array = bytes(bytes_read, shape);
    let place = (!nowhere).then_some(&mut call.stores.saved_states[slot].saved);
    let status = call.importer.de_serialize_fmu_state(&array, place);
    Outcome::if_fine(status, whole && !nowhere && array.shape == Shape::Right)
        .with(move |_, stores| stores.saved_states[slot].of = record.map(|record| record.of))
}
