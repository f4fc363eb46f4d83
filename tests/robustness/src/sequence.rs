//! Runs sequences of legal and illegal calls and compares each with the standard.

use std::ffi::c_int;

use fmu::call_order::{Function, State};

use crate::calls::{CALLS, Call, Outcome, SavedState, Stores};
use crate::choice::Choice;
use crate::exporter::{c_text, guid, order};
use crate::importer::{HEARS, Importer, Message, Order, Saved};
use crate::machine::{Misbehaviour, Place, alive, happened, with_plan};
use crate::prediction::{Core, DISCARD, OK, in_table};

/// Maximum number of bytes that determine one call.
pub const LENGTH: usize = 24;

/// First bytes from which on the arguments of a call may be hostile.
pub const HOSTILE: u8 = 0xd0;
/// The same for calls that need not be legal.
pub const ILLEGAL: u8 = 0xf0;
/// The same for calls with a null component.
const NOBODY: u8 = 0xf8;
/// The second byte of `fmi2FreeInstance`.
pub const FREE: u8 = 0xff;

/// An instance and its predicted state.
struct Life {
    importer: Importer,
    core: Core,
    /// The chosen log categories; empty means all.
    chosen: Option<Vec<String>>,
    logger: bool,
}

struct World {
    lives: [Option<Life>; 2],
    stores: Stores,
    /// Frees FMU states whose own instance no longer can.
    spare: Importer,
    /// An importer whose component is null.
    null: Importer,
    reached: u32,
}

type Plan = Option<(Place, Misbehaviour)>;

/// Makes the calls that `bytes` encode. Returns the planned failures that happened, as bits, or the
/// first difference from the prediction.
pub fn run(bytes: &[u8]) -> Result<u32, String> {
    let before = alive();
    let mut world = World::new();
    for (number, call) in bytes.chunks(LENGTH).enumerate() {
        world.call(call).map_err(|what| format!("call {number}: {what}"))?;
    }
    let reached = world.reached;
    world.close();
    drop(world);
    if alive() == before { Ok(reached) } else { Err(format!("{} models left", alive() - before)) }
}

impl World {
    fn new() -> Self {
        let empty = || SavedState { saved: Saved::NULL, of: None };
        Self {
            lives: [None, None],
            stores: Stores { saved_states: [empty(), empty(), empty()], records: [None, None] },
            spare: Importer::new(&order(1)),
            null: Importer::new(&Order { guid: None, ..order(1) }),
            reached: 0,
        }
    }

    fn close(&mut self) {
        self.lives = [None, None];
        for slot in &mut self.stores.saved_states {
            self.spare.free_fmu_state(Some(&mut slot.saved));
        }
    }

    fn call(&mut self, bytes: &[u8]) -> Result<(), String> {
        let mut choice = Choice::new(bytes);
        let (who, which, planned) = (choice.byte(), choice.byte(), choice.byte());
        let plan =
            (planned >= 224).then(|| (choice.of(&Place::EVERY), choice.of(&Misbehaviour::EVERY)));
        choice.hostile = who >= HOSTILE;
        if who >= NOBODY {
            return self.call_null(which, choice);
        }
        let number = usize::from(who % 2);
        let Some(mut life) = self.lives[number].take() else {
            let (life, happened) = with_plan(plan, || instantiate(&mut choice, plan));
            self.note(plan, happened);
            self.lives[number] = life?;
            return Ok(());
        };
        if which == FREE || life.core.state == State::Fatal && which % 2 == 0 {
            let (freed, happened) = with_plan(plan, || free(life));
            self.note(plan, happened);
            return freed;
        }
        let candidates = || {
            CALLS.iter().flat_map(|one| {
                let weight = if who < ILLEGAL { weight(one.0, &life.core) } else { 1 };
                std::iter::repeat_n(one, weight)
            })
        };
        let chosen = usize::from(which) % candidates().count().max(1);
        if let Some(&(function, caller)) = candidates().nth(chosen) {
            let (outcome, happened) = with_plan(plan, || {
                let (importer, core) = (&life.importer, &life.core);
                caller(&mut Call { importer, core, stores: &mut self.stores, choice })
            });
            self.note(plan, happened);
            let plan = plan.filter(|_| happened);
            self.settle(&mut life, function, outcome, plan).map_err(|what| {
                format!("{} {plan:?} in {:?}: {what}", function.name(), life.core)
            })?;
        }
        self.lives[number] = Some(life);
        Ok(())
    }

    fn note(&mut self, plan: Plan, happened: bool) {
        if let Some((place, _)) = plan.filter(|_| happened) {
            self.reached |= 1 << place as u32;
        }
    }

    /// A call with a null component returns an error and does nothing else.
    fn call_null(&mut self, which: u8, choice: Choice) -> Result<(), String> {
        let (function, caller) = CALLS[usize::from(which) % CALLS.len()];
        let core = Core::new(true);
        let outcome = caller(&mut Call {
            importer: &self.null,
            core: &core,
            stores: &mut self.stores,
            choice,
        });
        if outcome.status == 3 {
            return Ok(());
        }
        Err(format!("{} of a null component gives {}", function.name(), outcome.status))
    }

    /// Compares the outcome with the prediction, and predicts the next state.
    fn settle(
        &mut self,
        life: &mut Life,
        function: Function,
        outcome: Outcome,
        plan: Plan,
    ) -> Result<(), String> {
        let misbehaviour = plan.map(|(_, misbehaviour)| misbehaviour);
        let predicted = life.core.statuses(function, outcome.verdict, misbehaviour);
        let status = 1_u8.checked_shl(outcome.status.unsigned_abs()).unwrap_or(0);
        if status & predicted == 0 {
            return Err(format!("status {}, predicted {predicted:#b}", outcome.status));
        }
        if let Some(complaint) = outcome.complaint {
            return Err(complaint);
        }
        let was_fatal = life.core.state == State::Fatal;
        life.check_messages(function, outcome.status, was_fatal, plan.is_some())?;
        let step = (life.core.time, outcome.half_way);
        life.core.after(function, status, misbehaviour);
        if status == OK {
            (outcome.effect)(&mut life.core, &mut self.stores);
            if let Some(chosen) = outcome.chosen {
                life.chosen = (!chosen.is_empty()).then_some(chosen);
            }
        }
        if status == DISCARD && plan.is_some_and(|(place, misbehaviour)| stops(place, misbehaviour))
        {
            life.core.time = step.0.max(step.1);
        }
        for slot in &mut self.stores.saved_states {
            if plan == Some((Place::Drop, Misbehaviour::Panic)) {
                self.spare.free_fmu_state(Some(&mut slot.saved));
            }
            if slot.saved.is_null() {
                slot.of = None;
            }
        }
        Ok(())
    }
}

/// Frequencies of legal calls: calls that lead to new states are more frequent.
fn weight(function: Function, core: &Core) -> usize {
    use Function as F;
    match function {
        _ if !in_table(core.exchange, function, core.state) => 0,
        F::Reset if core.state == State::Error => 25,
        F::SetTime if core.state == State::EventMode => 0,
        F::EnterInitializationMode
        | F::ExitInitializationMode
        | F::EnterContinuousTimeMode
        | F::EnterEventMode
        | F::NewDiscreteStates
        | F::DoStep
        | F::SetTime => 6,
        _ => 1,
    }
}

/// Whether the step stopped half way.
fn stops(place: Place, misbehaviour: Misbehaviour) -> bool {
    place == Place::Step
        && [Misbehaviour::Incomplete, Misbehaviour::Terminated].contains(&misbehaviour)
}

impl Life {
    /// Expects one message, naming the function, for each status but `fmi2OK`, and none from an
    /// instance after `fmi2Fatal`.
    fn check_messages(
        &self,
        function: Function,
        status: c_int,
        was_fatal: bool,
        by_misbehaviour: bool,
    ) -> Result<(), String> {
        let messages = self.importer.take_messages();
        let category = match status {
            0 => return silence(messages.iter().filter(|message| message.category != "logEvents")),
            2 => "logStatusDiscard",
            3 => "logStatusError",
            _ => "logStatusFatal",
        };
        let is_chosen =
            self.chosen.as_ref().is_none_or(|names| names.iter().any(|chosen| chosen == category));
        if was_fatal || !is_chosen || !self.logger || !HEARS {
            return silence(&messages);
        }
        match &messages[..] {
            [one]
                if one.status == status
                    && one.category == category
                    && one.text.starts_with(&format!("{}: ", function.name()))
                    && (!by_misbehaviour || one.text.ends_with("100 % misbehaviour ##1")) =>
            {
                Ok(())
            }
            _ => Err(format!("status {status} comes with {messages:?}")),
        }
    }
}

fn silence<'a>(messages: impl IntoIterator<Item = &'a Message>) -> Result<(), String> {
    messages.into_iter().next().map_or(Ok(()), |one| Err(format!("nothing happened, but {one:?}")))
}

/// Calls `fmi2Instantiate`; returns the instance if there should be one.
fn instantiate(choice: &mut Choice, plan: Plan) -> Result<Option<Life>, String> {
    let exchange = choice.byte().is_multiple_of(2);
    let mut order = order(c_int::from(!exchange));
    let mut fine = true;
    if choice.rarely() {
        (order.name, fine) = (choice.of(&[None, Some(c_text(b"")), Some(c_text(b"\xff"))]), false);
    }
    if choice.rarely() {
        let longer = format!("{}x", guid());
        let others =
            [None, Some(c_text(b"")), Some(c_text(longer.as_bytes())), Some(c_text(b"\xff"))];
        (order.guid, fine) = (choice.of(&others), false);
    }
    if choice.rarely() {
        (order.kind, fine) = (choice.of(&[2, -1, c_int::MIN]), false);
    }
    if choice.rarely() {
        (order.resources, fine) = (Some(choice.of(&[c_text(b"nowhere"), c_text(b"\xff")])), false);
    }
    order.logger = !choice.rarely();
    order.callbacks = !choice.rarely();
    let importer = Importer::new(&order);
    let fine = fine && order.callbacks && !happened();
    let heard = importer.take_messages();
    let expected = usize::from(!fine && order.callbacks && order.logger && HEARS);
    if importer.exists() != fine || heard.len() != expected {
        return Err(format!("fmi2Instantiate {plan:?}: {}, {heard:?}", importer.exists()));
    }
    let (core, logger) = (Core::new(exchange), order.logger);
    Ok(fine.then_some(Life { importer, core, chosen: None, logger }))
}

/// Calls `fmi2FreeInstance` in any state; a panic must be reported.
fn free(mut life: Life) -> Result<(), String> {
    life.importer.free();
    let heard = life.importer.take_messages();
    let category = |chosen: &String| chosen == "logStatusFatal";
    let is_chosen = life.chosen.as_ref().is_none_or(|names| names.iter().any(category));
    let expected = usize::from(happened() && is_chosen && life.logger && HEARS);
    if heard.len() == expected { Ok(()) } else { Err(format!("fmi2FreeInstance: {heard:?}")) }
}
