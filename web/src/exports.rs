//! The functions of the WebAssembly module: numbers, and one buffer for texts and rows.
#![allow(unsafe_code, reason = "exported names")]

use std::cell::RefCell;

use crate::Paper;

thread_local! {
    static RUN: RefCell<Option<Paper>> = const { RefCell::new(None) };
    static TEXT: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static ROWS: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

fn told(done: Result<(), String>) -> i32 {
    match done {
        Ok(()) => 0,
        Err(text) => {
            TEXT.set(text.into_bytes());
            1
        }
    }
}

fn with(body: impl FnOnce(&mut Paper) -> Result<(), String>) -> i32 {
    told(RUN.with_borrow_mut(|run| body(run.as_mut().ok_or("no run is started")?)))
}

/// Makes the text buffer `length` bytes long; returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn text(length: usize) -> *mut u8 {
    TEXT.with_borrow_mut(|text| {
        text.resize(length, 0);
        text.as_mut_ptr()
    })
}

/// The length of the text buffer, which holds the sentence after a function returned 1.
#[unsafe(no_mangle)]
pub extern "C" fn text_length() -> usize {
    TEXT.with_borrow(Vec::len)
}

/// Starts a run with the settings in the text buffer; 1: it cannot be started.
#[unsafe(no_mangle)]
pub extern "C" fn start(step: f64, stop: f64) -> i32 {
    let settings = TEXT.with_borrow(|text| String::from_utf8_lossy(text).into_owned());
    told(Paper::new(&settings, step, stop).map(|paper| RUN.set(Some(paper))))
}

/// Makes up to `steps` steps and keeps a row before every `every`th of them; 1: a step failed.
#[unsafe(no_mangle)]
pub extern "C" fn advance(steps: u32, every: u32) -> i32 {
    ROWS.set(Vec::new());
    with(|run| {
        for step in 0..steps {
            if step % every.max(1) == 0 {
                let row = run.row()?;
                ROWS.with_borrow_mut(|rows| rows.extend(row));
            }
            if run.is_finished() {
                break;
            }
            run.step()?;
        }
        Ok(())
    })
}

/// The address of the rows of the last [`advance`]: time and values, nine numbers each.
#[unsafe(no_mangle)]
pub extern "C" fn rows() -> *const f64 {
    ROWS.with_borrow(|rows| rows.as_ptr())
}

/// The number of values in the rows.
#[unsafe(no_mangle)]
pub extern "C" fn rows_length() -> usize {
    ROWS.with_borrow(Vec::len)
}

/// Saves the state; 1: it cannot be saved.
#[unsafe(no_mangle)]
pub extern "C" fn save() -> i32 {
    with(Paper::save)
}

/// Returns to the saved state; 1: there is none.
#[unsafe(no_mangle)]
pub extern "C" fn back() -> i32 {
    with(Paper::back)
}
