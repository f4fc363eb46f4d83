//! Prints to standard output and standard error. If a reader has closed one of them, as `| head` does,
//! the command continues without output; after another error, as of a full disk, the exit status is not 0.
//!
//! The macros replace the macros of the standard library, which panic after an error. The words `error:` and `warning:`
//! at the start of a text have the colours of clap's errors, unless the stream is no terminal or `NO_COLOR` is set;
//! `CLICOLOR_FORCE` asks for colours everywhere.

use std::fmt::Arguments;
use std::io::{self, Write as _};
use std::sync::{Mutex, OnceLock, PoisonError};

use anstream::stream::{AsLockedWrite, RawStream};
use anstream::{AutoStream, ColorChoice};
use anstyle::{AnsiColor, Style};

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

/// The words that have a colour at the start of a text, with their styles.
const WORDS: [(&str, Style); 2] = [
    ("error:", AnsiColor::Red.on_default().bold()),
    ("warning:", AnsiColor::Yellow.on_default().bold()),
];

/// The first error of standard output or standard error, except one for a closed reader; [`finish`] takes it.
static FAILED: Mutex<Option<io::Error>> = Mutex::new(None);

fn note(done: io::Result<()>) {
    if let Err(error) = done
        && error.kind() != io::ErrorKind::BrokenPipe
    {
        FAILED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }
}

/// Parses the arguments of the command. If these are wrong or request help, prints the error or the help, and returns
/// the exit status as an error.
pub(crate) fn parse<P: clap::Parser>() -> Result<P, u8> {
    P::try_parse().map_err(|error| {
        note(error.print());
        finish(u8::try_from(error.exit_code()).unwrap_or(2))
    })
}

/// Returns the exit status of the command: `status`, or 1 in place of 0 if printed text was lost. Also reports such a
/// loss.
pub(crate) fn finish(status: u8) -> u8 {
    note(io::stdout().flush());
    let Some(error) = FAILED.lock().unwrap_or_else(PoisonError::into_inner).take() else {
        return status;
    };
    eprintln!("error: the output is not complete: {error}");
    status.max(1)
}

/// Prints to standard output.
pub(crate) fn out(text: Arguments<'_>) {
    static CHOICE: OnceLock<ColorChoice> = OnceLock::new();
    write(io::stdout(), &CHOICE, &text.to_string());
}

/// Prints to standard error.
pub(crate) fn error(text: Arguments<'_>) {
    static CHOICE: OnceLock<ColorChoice> = OnceLock::new();
    write(io::stderr(), &CHOICE, &text.to_string());
}

/// Writes `text` with or without colours. The first call decides on colours and keeps the decision in `choice`, because
/// the environment cannot be read while a crash is handled.
fn write(stream: impl RawStream + AsLockedWrite, choice: &OnceLock<ColorChoice>, text: &str) {
    let choice = choice.get_or_init(|| AutoStream::choice(&stream));
    note(AutoStream::new(stream, *choice).write_all(coloured(text).as_bytes()));
}

fn coloured(text: &str) -> String {
    let split = |(word, style)| Some((word, style, text.strip_prefix(word)?));
    match WORDS.into_iter().find_map(split) {
        Some((word, style, rest)) => format!("{style}{word}{style:#}{rest}"),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_word_has_the_colour_of_claps_errors() {
        let clap = clap::builder::Styles::styled();
        let expected = format!("{0}error:{0:#} plant: error: lost\n", clap.get_error());
        assert_eq!(coloured("error: plant: error: lost\n"), expected);
        assert_eq!(coloured("warning: late\n"), "\u{1b}[1m\u{1b}[33mwarning:\u{1b}[0m late\n");
        assert_eq!(coloured("errors: 2\n"), "errors: 2\n");
    }
}
