//! The functions of the WebAssembly module. They pass numbers, a text in the text buffer, and rows by their address.
#![allow(unsafe_code, reason = "exported names")]

use std::cell::RefCell;

use crate::run::{Run, WIDTH};
use crate::text::{answer, read};

thread_local! {
    static RUN: RefCell<Option<Run>> = const { RefCell::new(None) };
    static ROWS: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

fn keep(row: [f64; WIDTH]) {
    ROWS.with_borrow_mut(|rows| rows.extend(row));
}

fn with(body: &mut dyn FnMut(&mut Run) -> Result<(), String>) -> i32 {
    let done = RUN.with_borrow_mut(|run| body(run.as_mut().ok_or("no run is started")?));
    answer(done.map(|()| None))
}

/// Starts a run with the settings in the text buffer and keeps its first row; returns 1 if it cannot be
/// started.
#[unsafe(no_mangle)]
pub extern "C" fn start(step: f64, stop: f64) -> i32 {
    ROWS.with_borrow_mut(Vec::clear);
    let run = Run::new(&read(), step, stop).and_then(|mut run| Ok((run.row()?, run)));
    answer(run.map(|(row, run)| {
        keep(row);
        RUN.with_borrow_mut(|current| *current = Some(run));
        None
    }))
}

/// Sets an input or a tunable parameter by `fmu.variable=value` in the text buffer; returns 1 if this is refused.
#[unsafe(no_mangle)]
pub extern "C" fn set() -> i32 {
    let text = read();
    let (name, value) = text.split_once('=').unwrap_or((&text, ""));
    with(&mut |run| run.set(name.trim(), value.trim()))
}

/// Makes up to `steps` steps. Keeps a row after each step whose number since the start is a multiple of `every`, and
/// after the last step of the run; returns 1 if a step failed. As in the results of the command, a row does not show a
/// change that is made at its time.
#[unsafe(no_mangle)]
pub extern "C" fn advance(steps: u32, every: u32) -> i32 {
    ROWS.with_borrow_mut(Vec::clear);
    with(&mut |run| {
        for _ in 0..steps {
            if run.is_finished() {
                break;
            }
            run.step()?;
            if run.steps() % u64::from(every.max(1)) == 0 || run.is_finished() {
                keep(run.row()?);
            }
        }
        Ok(())
    })
}

/// The time of the run in s; NaN if no run is started.
#[unsafe(no_mangle)]
pub extern "C" fn time() -> f64 {
    RUN.with_borrow(|run| run.as_ref().map_or(f64::NAN, Run::time))
}

/// Returns 1 if the stop time is reached or no run is started.
#[unsafe(no_mangle)]
pub extern "C" fn is_finished() -> i32 {
    RUN.with_borrow(|run| run.as_ref().is_none_or(Run::is_finished).into())
}

/// The address of the rows of the last [`start`] or [`advance`]: time and values, [`WIDTH`] numbers each.
#[unsafe(no_mangle)]
pub extern "C" fn rows() -> *const f64 {
    ROWS.with_borrow(|rows| rows.as_ptr())
}

/// The number of values in the rows.
#[unsafe(no_mangle)]
pub extern "C" fn rows_length() -> usize {
    ROWS.with_borrow(Vec::len)
}

/// Saves the state; returns 1 if it cannot be saved.
#[unsafe(no_mangle)]
pub extern "C" fn save() -> i32 {
    with(&mut Run::save)
}

/// Returns to the state saved last; returns 1 if there is none.
#[unsafe(no_mangle)]
pub extern "C" fn back() -> i32 {
    with(&mut Run::back)
}
