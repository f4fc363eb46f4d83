//! FMU states with what the slave knows beside them: mode, next event, clocks, values set last.

use super::Instance;
use super::access::refused;
use super::modes::{Mode, State};
use slave::CallError;

/// The first bytes of a serialised state.
const MAGIC: &[u8; 8] = b"fmi3\0\0\0\x01";

impl Instance {
    pub(crate) fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.component.save_state(slot)?;
        if self.slots.len() <= slot {
            self.slots.resize(slot + 1, State::default());
        }
        self.slots[slot].clone_from(&self.state);
        Ok(())
    }

    pub(crate) fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.component.restore_state(slot)?;
        if let Some(state) = self.slots.get(slot) {
            self.state.clone_from(state);
        }
        Ok(())
    }

    /// Returns the state of the slave, then that of the FMU.
    pub(crate) fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        if self.state.mode == Mode::Event {
            // A serialised state is always in Step Mode.
            self.handle_event(self.state.time)?;
        }
        let mut bytes = MAGIC.to_vec();
        bytes.push(u8::from(self.state.mode.is_initialized()));
        bytes.push(self.state.terminate.into());
        for time in [self.state.time, self.state.next_event.unwrap_or(f64::NAN)] {
            bytes.extend(time.to_le_bytes());
        }
        bytes.extend((self.state.held.len() as u64).to_le_bytes());
        for held in &self.state.held {
            bytes.push(held.is_some().into());
            bytes.extend(held.unwrap_or(0).to_le_bytes());
        }
        for (ticks, next) in self.state.clocks.state() {
            bytes.extend(ticks.to_le_bytes());
            bytes.extend(next.to_le_bytes());
        }
        bytes.extend(self.component.serialize_state()?);
        Ok(bytes)
    }

    pub(crate) fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        const NAME: &str = "fmi3DeserializeFMUState";
        let Some((state, rest)) = self.parsed(bytes) else {
            let what = "cannot restore the state: it is not one of this FMU".to_owned();
            return Err(refused(NAME, what));
        };
        self.component.deserialize_state(rest)?;
        self.state = state;
        Ok(())
    }

    /// Returns the state of the slave and the bytes of the FMU.
    fn parsed<'a>(&self, bytes: &'a [u8]) -> Option<(State, &'a [u8])> {
        let mut reader = Reader { bytes: bytes.strip_prefix(MAGIC)? };
        let mut state = State { clocks: self.state.clocks.clone(), ..State::default() };
        state.mode = if reader.byte()? == 0 { Mode::Instantiated } else { Mode::Step };
        state.terminate = reader.byte()? != 0;
        state.time = f64::from_bits(reader.word()?);
        state.next_event = Some(f64::from_bits(reader.word()?)).filter(|time| !time.is_nan());
        if reader.word()? != self.state.held.len() as u64 {
            return None;
        }
        for _ in 0..self.state.held.len() {
            let is_known = reader.byte()? != 0;
            let value = reader.word()?;
            state.held.push(is_known.then_some(value));
        }
        let mut clocks = Vec::new();
        for _ in 0..self.state.clocks.timed() {
            clocks.push((reader.word()?, f64::from_bits(reader.word()?)));
        }
        state.clocks.restore(&clocks);
        Some((state, reader.bytes))
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
}

impl Reader<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.bytes.split_first()?;
        self.bytes = rest;
        Some(*first)
    }

    fn word(&mut self) -> Option<u64> {
        let (first, rest) = self.bytes.split_first_chunk::<8>()?;
        self.bytes = rest;
        Some(u64::from_le_bytes(*first))
    }
}
