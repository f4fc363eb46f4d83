//! The commands that a master sends to a worker, and the encoding of errors.

use fmu_description::abi::Status;

use super::words::{Reader, Writer};
use slave::{CallError, Failure};

/// Defines the commands, each with the FMI function that its errors name.
macro_rules! commands {
    ($($command:ident = $function:literal,)*) => {
        /// A command for a worker.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Command {
            $($command,)*
        }

        impl Command {
            const ALL: &[Command] = &[$(Command::$command,)*];

            /// Returns the FMI function of the command.
            pub(super) fn function(self) -> &'static str {
                self.name()
            }

            /// Returns a static reference to the name of the FMI function.
            #[inline]
            pub(super) fn name(self) -> &'static &'static str {
                match self {
                    $(Command::$command => &$function,)*
                }
            }
        }

        /// The functions that a worker can execute; a [`place`] is an index into this list.
        const FUNCTIONS: &[&str] = &[
            $($function,)*
            LOADING,
            "fmi2GetStatus",
            "fmi2GetRealStatus",
            "fmi2GetBooleanStatus",
            "fmi2SerializedFMUstateSize",
        ];
    };
}

/// The activity of a worker before it has an instance.
pub(super) const LOADING: &str = "loading the library";

commands! {
    Open = "fmi2Instantiate",
    SetDebugLogging = "fmi2SetDebugLogging",
    SetupExperiment = "fmi2SetupExperiment",
    EnterInitializationMode = "fmi2EnterInitializationMode",
    ExitInitializationMode = "fmi2ExitInitializationMode",
    Terminate = "fmi2Terminate",
    GetReal = "fmi2GetReal",
    SetReal = "fmi2SetReal",
    GetInteger = "fmi2GetInteger",
    SetInteger = "fmi2SetInteger",
    GetBoolean = "fmi2GetBoolean",
    SetBoolean = "fmi2SetBoolean",
    GetString = "fmi2GetString",
    SetString = "fmi2SetString",
    SetInputDerivatives = "fmi2SetRealInputDerivatives",
    GetOutputDerivatives = "fmi2GetRealOutputDerivatives",
    DoStep = "fmi2DoStep",
    DirectionalDerivative = "fmi2GetDirectionalDerivative",
    SaveState = "fmi2GetFMUstate",
    RestoreState = "fmi2SetFMUstate",
    SerializeState = "fmi2SerializeFMUstate",
    DeserializeState = "fmi2DeSerializeFMUstate",
    Advance = "fmi2DoStep",
    // Transfer bytes of the next command, or of the last answer.
    Upload = "the transfer of data to it",
    Download = "the transfer of data from it",
    Free = "fmi2FreeInstance",
    // Frees the instance and creates another one.
    Renew = "fmi2Instantiate",
}

impl Command {
    pub(super) fn to_word(self) -> u64 {
        self as u64
    }

    pub(super) fn from_word(word: u64) -> Option<Self> {
        Self::ALL.get(usize::try_from(word).ok()?).copied()
    }
}

/// Returns the number of a function in [`FUNCTIONS`]; an invalid number for an unknown function.
pub(super) fn place(function: &str) -> u64 {
    let known = FUNCTIONS.iter().position(|known| *known == function);
    known.unwrap_or(FUNCTIONS.len()) as u64
}

/// Returns the function with the number `place`.
pub(super) fn function_at(place: u64) -> Option<&'static str> {
    FUNCTIONS.get(usize::try_from(place).ok()?).copied()
}

/// First word of an answer with results.
pub(super) const DONE: u64 = 0;
/// First word of an answer with a [`CallError`].
pub(super) const FAILED: u64 = 1;

/// Result of an instantiation: the instance exists.
pub(super) const INSTANTIATED: u64 = 0;
/// Result of an instantiation: the FMU does not load or instantiate. A reason follows.
pub(super) const REFUSED: u64 = 1;
/// Result of an instantiation: a library of `preload` does not load. A reason follows.
pub(super) const NOT_PRELOADED: u64 = 2;

/// Maximum number of bytes of one text in an error.
const TEXT: usize = 8192;

/// Returns the first [`TEXT`] bytes of `text`.
fn clipped(text: &str) -> &[u8] {
    &text.as_bytes()[..text.len().min(TEXT)]
}

/// Writes an error. If not all messages fit, the last ones are written.
pub(super) fn write_error(error: &CallError, writer: &mut Writer<'_>) {
    writer.put(FAILED);
    writer.put(place(error.function));
    let (kind, number, text): (u64, u64, &str) = match &error.failure {
        Failure::Status(status) => (0, *status as u64, ""),
        Failure::UnknownStatus(status) => (1, i64::from(*status).cast_unsigned(), ""),
        Failure::Missing => (2, 0, ""),
        Failure::TimedOut(seconds) => (3, seconds.to_bits(), ""),
        Failure::Panicked(text) => (4, 0, text),
        Failure::InvalidAnswer(text) => (5, 0, text),
        // A worker cannot report its own end: these failures arise in the master only.
        Failure::Killed(..) | Failure::Exited(_) | Failure::OutOfMemory(_) => {
            (5, 0, "ended a process of its own")
        }
    };
    writer.put(kind);
    writer.put(number);
    writer.put_bytes(clipped(text));
    let mut room = writer.room().saturating_sub(1);
    let needs = |message: &String| 1 + clipped(message).len().div_ceil(8);
    let fitting = error.messages.iter().rev().take_while(|message| {
        let fits = needs(message) <= room;
        room = room.saturating_sub(needs(message));
        fits
    });
    let first = error.messages.len() - fitting.count();
    let messages = &error.messages[first..];
    writer.put(messages.len());
    for message in messages {
        writer.put_bytes(clipped(message));
    }
}

/// Reads what [`write_error`] wrote after its first word, for a failure of `command`.
pub(super) fn read_error(command: Command, reader: &mut Reader<'_>) -> Option<CallError> {
    let function = function_at(reader.take()?).unwrap_or(command.function());
    let (kind, number): (u64, u64) = (reader.take()?, reader.take()?);
    let text = reader.take_text()?;
    let status = i32::try_from(number.cast_signed());
    let failure = match kind {
        0 => Failure::Status(Status::from_c(status.ok()?)?),
        1 => Failure::UnknownStatus(status.ok()?),
        2 => Failure::Missing,
        3 => Failure::TimedOut(f64::from_bits(number)),
        4 => Failure::Panicked(text),
        5 => Failure::InvalidAnswer(text),
        _ => return None,
    };
    let mut messages = Vec::new();
    for _ in 0..reader.take::<usize>()? {
        messages.push(reader.take_text()?);
    }
    Some(CallError { function, failure, messages })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;

    fn area(words: usize) -> Vec<AtomicU64> {
        (0..words).map(|_| AtomicU64::new(0)).collect()
    }

    fn error(failure: Failure, messages: &[&str]) -> CallError {
        let messages = messages.iter().map(|text| (*text).to_owned()).collect();
        CallError { function: "fmi2GetRealStatus", failure, messages }
    }

    fn through(error: &CallError, area: &[AtomicU64]) -> CallError {
        let mut writer = Writer::new(area);
        write_error(error, &mut writer);
        assert!(writer.fits());
        let mut reader = Reader::new(area);
        assert_eq!(reader.take(), Some(FAILED));
        read_error(Command::DoStep, &mut reader).unwrap()
    }

    #[test]
    fn errors_pass_unchanged() {
        let failures = [
            Failure::Status(Status::Fatal),
            Failure::UnknownStatus(-77),
            Failure::Missing,
            Failure::TimedOut(0.25),
            Failure::Panicked("index 4".to_owned()),
            Failure::InvalidAnswer("returned fmi2Discard".to_owned()),
        ];
        for failure in failures {
            let error = error(failure, &["first", "", "zweite Äußerung"]);
            assert_eq!(through(&error, &area(64)), error);
        }
    }

    #[test]
    fn of_too_many_messages_the_last_ones_pass() {
        let error = error(Failure::Missing, &["aaaaaaaaaaaaaaaaaaaaaaaaa", "bb", "cc"]);
        assert_eq!(through(&error, &area(10)).messages, ["bb", "cc"]);
    }

    #[test]
    fn random_words_give_an_error_or_none_and_no_panic() {
        let area = area(40);
        let mut state = 1_u64;
        for _ in 0..20_000 {
            for word in &area {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                let narrow = state >> (state >> 58);
                word.store(narrow, Ordering::Relaxed);
            }
            let _ = read_error(Command::GetReal, &mut Reader::new(&area));
        }
    }

    #[test]
    fn every_command_has_its_number() {
        for command in Command::ALL {
            assert_eq!(Command::from_word(command.to_word()), Some(*command));
        }
        assert_eq!(Command::from_word(u64::MAX), None);
    }
}
