//! The buffer by which a module and the page exchange texts, and the parsing of numbers in texts.
#![allow(unsafe_code, reason = "exported names")]

use std::cell::RefCell;

thread_local! {
    static TEXT: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Makes the text buffer `length` bytes long; returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn text(length: usize) -> *mut u8 {
    TEXT.with_borrow_mut(|text| {
        text.resize(length, 0);
        text.as_mut_ptr()
    })
}

/// The length of the text buffer. After a function returned 1, the buffer holds the error message.
#[unsafe(no_mangle)]
pub extern "C" fn text_length() -> usize {
    TEXT.with_borrow(Vec::len)
}

/// The text in the buffer.
pub(crate) fn read() -> String {
    TEXT.with_borrow(|text| String::from_utf8_lossy(text).into_owned())
}

/// Parses a finite number. The page does it, because the tables of `f64::from_str` have 10 kB.
#[cfg(target_family = "wasm")]
pub(crate) fn number(text: &str) -> Option<f64> {
    #[link(wasm_import_module = "page")]
    unsafe extern "C" {
        fn number(text: *const u8, length: usize) -> f64;
    }
    // SAFETY: the page reads these bytes during the call.
    Some(unsafe { number(text.as_ptr(), text.len()) }).filter(|value| value.is_finite())
}

/// Parses a finite number.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.is_finite())
}

/// Returns the status of an exported function, 0 or 1, and puts its text or its error message into the buffer.
pub(crate) fn answer(done: Result<Option<String>, String>) -> i32 {
    let (status, text) = match done {
        Ok(text) => (0, text),
        Err(text) => (1, Some(text)),
    };
    if let Some(text) = text {
        TEXT.with_borrow_mut(|buffer| *buffer = text.into_bytes());
    }
    status
}
