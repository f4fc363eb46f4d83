//! Printing to standard output and standard error that others may have closed, as `| head` does:
//! the rest is then for nobody, and the command goes on to its end.
//!
//! The macros take the place of those of the standard library, which panic there.

use std::fmt::Arguments;
use std::io::{self, Write as _};

/// As that of the standard library, and silent where standard output is closed.
macro_rules! print {
    ($($text:tt)*) => { $crate::output::out(format_args!($($text)*)) };
}

/// As that of the standard library, and silent where standard output is closed.
macro_rules! println {
    () => { $crate::output::out(format_args!("\n")) };
    ($($text:tt)*) => { $crate::output::out(format_args!("{}\n", format_args!($($text)*))) };
}

/// As that of the standard library, and silent where standard error is closed.
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::output::error(format_args!("{}\n", format_args!($($text)*))) };
}

/// Prints to standard output.
pub(crate) fn out(text: Arguments<'_>) {
    // What cannot be printed is a matter of who reads it.
    let _ = io::stdout().write_fmt(text);
}

/// Prints to standard error.
pub(crate) fn error(text: Arguments<'_>) {
    let _ = io::stderr().write_fmt(text);
}
