//! Prints to standard output and standard error, which a reader may have closed, as `| head` does.
//! The command then continues without output.
//!
//! The macros replace those of the standard library, which panic in this case.

use std::fmt::Arguments;
use std::io::{self, Write as _};

/// As `print!` of the standard library; silent if standard output is closed.
macro_rules! print {
    ($($text:tt)*) => { $crate::output::out(format_args!($($text)*)) };
}

/// As `println!` of the standard library; silent if standard output is closed.
macro_rules! println {
    () => { $crate::output::out(format_args!("\n")) };
    ($($text:tt)*) => { $crate::output::out(format_args!("{}\n", format_args!($($text)*))) };
}

/// As `eprintln!` of the standard library; silent if standard error is closed.
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::output::error(format_args!("{}\n", format_args!($($text)*))) };
}

/// Prints to standard output.
pub(crate) fn out(text: Arguments<'_>) {
    // Printing fails only if the reader has closed the stream.
    let _ = io::stdout().write_fmt(text);
}

/// Prints to standard error.
pub(crate) fn error(text: Arguments<'_>) {
    let _ = io::stderr().write_fmt(text);
}
