//! FMU states: copies of an instance's core, and their serialised form.

use super::layout::{Layout, layout};
use super::{Core, Instance};
use crate::model::{Failure, Model};
use crate::room::Room;
use fmu_description::Guid;
use fmu_description::call_order::{InterfaceType, State};

/// First bytes of a serialised state; the last two digits are the version of the layout.
const MAGIC: &[u8; 8] = b"FMI2ST04";
/// Length in bytes of magic bytes, GUID and layout.
const HEAD: usize = MAGIC.len() + size_of::<Guid>() + size_of::<Layout>();
/// Length in bytes of the checksum at the end.
const CHECKSUM: usize = 4;

/// The target of `fmi2FMUstate`.
///
/// Some importers pass the state itself to `fmi2FreeFMUstate` instead of its address (section 2.1.8).
/// The function then reads `none` as a null pointer and frees nothing.
#[repr(C)]
pub(crate) struct Snapshot<M: Model> {
    none: usize,
    guid: Guid,
    core: Core<M>,
}

impl<M: Model> Instance<M> {
    /// `fmi2GetFMUstate`.
    pub(crate) fn snapshot(&self) -> Snapshot<M> {
        Snapshot { none: 0, guid: self.guid(), core: self.core.clone() }
    }

    /// `fmi2DeSerializeFMUstate`.
    pub(crate) fn read_snapshot(&self, bytes: &[u8]) -> Result<Snapshot<M>, Failure> {
        let mut snapshot = Snapshot::<M>::from_bytes(bytes, self.guid())?;
        snapshot.core.model.complete(&self.core.model);
        Ok(snapshot)
    }

    /// `fmi2SetFMUstate`. An error for a state of another FMU or interface type, and for a state in event mode if this
    /// instance, for co-simulation, does not use event mode.
    pub(crate) fn restore(&mut self, snapshot: &Snapshot<M>) -> Result<(), Failure> {
        if snapshot.guid != self.guid() {
            let (of, expected) = (snapshot.guid, self.guid());
            return Err(Failure::Error(format!(
                "the state belongs to the FMU with GUID {of}, this FMU has GUID {expected}"
            )));
        }
        let (of, expected) = (snapshot.core.interface_type, self.core.interface_type);
        if of != expected {
            return Err(Failure::Error(format!(
                "the state belongs to an instance for {of:?}, this instance is for {expected:?}"
            )));
        }
        if snapshot.core.state == State::EventMode
            && expected == InterfaceType::CoSimulation
            && !self.uses_event_mode()
        {
            let message = "the state is in event mode, which this instance does not use";
            return Err(Failure::Error(message.to_owned()));
        }
        self.core.clone_from(&snapshot.core);
        self.fit_layout()
    }
}

fn failed(error: &dyn std::fmt::Display) -> Failure {
    Failure::Error(format!("the state cannot be serialized: {error}"))
}

impl<M: Model> Snapshot<M> {
    /// Returns the number of bytes that [`Snapshot::write`] needs.
    pub(crate) fn size(&self) -> Result<usize, Failure> {
        let core = postcard::experimental::serialized_size(&self.core);
        core.map(|core| HEAD + core + CHECKSUM).map_err(|error| failed(&error))
    }

    /// Writes the state to the first bytes of `room`; an error if `room` has too few bytes.
    pub(crate) fn write(&self, room: &mut Room<u8>) -> Result<(), Failure> {
        let bytes = self.to_bytes()?;
        let (available, needed) = (room.len(), bytes.len());
        if available < needed {
            return Err(Failure::Error(format!("expected {needed} bytes, found {available}")));
        }
        for (place, byte) in room.iter_mut().zip(bytes) {
            place.write(byte);
        }
        Ok(())
    }

    /// Serialises the state: magic, GUID, layout, core in postcard's little-endian form, CRC-32 of all preceding bytes.
    pub(crate) fn to_bytes(&self) -> Result<Vec<u8>, Failure> {
        let layout = layout(&self.core).map_err(|error| failed(&error))?;
        let head = [MAGIC.as_slice(), &self.guid.0, &layout].concat();
        let mut bytes = postcard::to_extend(&self.core, head).map_err(|error| failed(&error))?;
        bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
        Ok(bytes)
    }

    /// Reads a serialised state. An error if `bytes` is truncated or altered, has another version of the format,
    /// belongs to an FMU other than `guid`, was written by a build whose model has other fields, or is a state that no
    /// instance can reach.
    pub(crate) fn from_bytes(bytes: &[u8], guid: Guid) -> Result<Self, Failure> {
        let refused = |reason: &str| Failure::Error(format!("serialized state: {reason}"));
        if !bytes.starts_with(&MAGIC[..6]) {
            return Err(refused("not written by an FMU of this exporter"));
        }
        if !bytes.starts_with(MAGIC) {
            return Err(refused("unknown version of the format"));
        }
        let (content, _) = bytes
            .split_last_chunk::<CHECKSUM>()
            .filter(|(content, sum)| crc32fast::hash(content).to_le_bytes() == **sum)
            .ok_or_else(|| refused("truncated or altered: the checksum does not match"))?;
        let core = content[MAGIC.len()..]
            .strip_prefix(&guid.0)
            .ok_or_else(|| refused("it belongs to another FMU: the GUID differs"))?;
        let another_build = |reason: &dyn std::fmt::Display| {
            refused(&format!(
                "it was written by another build of this FMU, whose model has fields of other names, \
                 types or order; use a library with the same model ({reason})"
            ))
        };
        let (stored, core) = core
            .split_first_chunk::<{ size_of::<Layout>() }>()
            .ok_or_else(|| another_build(&"no layout"))?;
        let (core, rest) =
            postcard::take_from_bytes::<Core<M>>(core).map_err(|error| another_build(&error))?;
        if layout(&core).map_err(|error| another_build(&error))? != *stored {
            return Err(another_build(&"the layouts differ"));
        }
        if !rest.is_empty() || !core.is_reachable() {
            return Err(refused("no instance can reach this state"));
        }
        Ok(Self { none: 0, guid, core })
    }
}

impl<M: Model> Core<M> {
    /// Whether an instance can reach this state.
    fn is_reachable(&self) -> bool {
        let reached = match self.state {
            State::Instantiated
            | State::InitializationMode
            | State::EventMode
            | State::ConfigurationMode
            | State::ReconfigurationMode
            | State::Terminated
            | State::Error => true,
            State::ContinuousTimeMode => self.interface_type == InterfaceType::ModelExchange,
            State::StepComplete | State::StepFailed => {
                self.interface_type == InterfaceType::CoSimulation
            }
            State::StepInProgress
            | State::StepCanceled
            | State::Fatal
            | State::IntermediateUpdateMode => false,
        };
        reached && self.time.is_finite() && self.experiment.start_time.is_finite()
    }
}
