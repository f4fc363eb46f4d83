//! FMU states: copies of an instance's core, and their form as bytes.

use std::mem::MaybeUninit;

use super::layout::{Layout, layout};
use super::{Core, Instance};
use crate::model::{Failure, Model};
use fmu_description::Guid;
use fmu_description::call_order::{InterfaceType, State};

/// First bytes of a serialised state; the last two digits are the version of the layout.
const MAGIC: &[u8; 8] = b"FMI2ST03";
/// Length of magic, GUID and layout.
const HEAD: usize = MAGIC.len() + size_of::<Guid>() + size_of::<Layout>();
/// Length of the checksum at the end.
const CHECKSUM: usize = 4;

/// What `fmi2FMUstate` points to.
///
/// Some importers hand the state itself to `fmi2FreeFMUstate`, where section 2.1.8 wants its
/// address. They find the pointer `none`: there is nothing to free.
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

    /// `fmi2SetFMUstate`.
    pub(crate) fn restore(&mut self, snapshot: &Snapshot<M>) -> Result<(), Failure> {
        if snapshot.guid != self.guid() {
            let (of, own) = (snapshot.guid, self.guid());
            return Err(Failure::Error(format!(
                "the state belongs to the FMU {of}, this one is {own}"
            )));
        }
        let (of, own) = (snapshot.core.interface_type, self.core.interface_type);
        if of != own {
            return Err(Failure::Error(format!(
                "the state is one of {of:?}, this instance is {own:?}"
            )));
        }
        self.core.clone_from(&snapshot.core);
        Ok(())
    }
}

fn failed(error: &dyn std::fmt::Display) -> Failure {
    Failure::Error(format!("cannot serialize: {error}"))
}

impl<M: Model> Snapshot<M> {
    /// How many bytes [`Snapshot::write`] needs.
    pub(crate) fn size(&self) -> Result<usize, Failure> {
        let core = postcard::experimental::serialized_size(&self.core);
        core.map(|core| HEAD + core + CHECKSUM).map_err(|error| failed(&error))
    }

    /// Writes the state to the first bytes of `room`.
    pub(crate) fn write(&self, room: &mut [MaybeUninit<u8>]) -> Result<(), Failure> {
        let bytes = self.to_bytes()?;
        let (found, needed) = (room.len(), bytes.len());
        if found < needed {
            return Err(Failure::Error(format!("{found} bytes given, {needed} needed")));
        }
        for (place, byte) in room.iter_mut().zip(bytes) {
            place.write(byte);
        }
        Ok(())
    }

    /// The state as bytes: magic, GUID, layout, core in postcard's little-endian form, CRC-32 of all
    /// that.
    pub(crate) fn to_bytes(&self) -> Result<Vec<u8>, Failure> {
        let layout = layout(&self.core).map_err(|error| failed(&error))?;
        let head = [MAGIC.as_slice(), &self.guid.0, &layout].concat();
        let mut bytes = postcard::to_extend(&self.core, head).map_err(|error| failed(&error))?;
        bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
        Ok(bytes)
    }

    /// The state in `bytes`; refused unless it is whole, of the FMU `guid`, and of a model with the
    /// fields of `M`.
    pub(crate) fn from_bytes(bytes: &[u8], guid: Guid) -> Result<Self, Failure> {
        let refused = |reason: &str| Failure::Error(format!("serialized state: {reason}"));
        if !bytes.starts_with(&MAGIC[..6]) {
            return Err(refused("not of this exporter"));
        }
        if !bytes.starts_with(MAGIC) {
            return Err(refused("unknown version"));
        }
        let (content, _) = bytes
            .split_last_chunk::<CHECKSUM>()
            .filter(|(content, sum)| crc32fast::hash(content).to_le_bytes() == **sum)
            .ok_or_else(|| refused("truncated or altered, its checksum does not hold"))?;
        let core = content[MAGIC.len()..]
            .strip_prefix(&guid.0)
            .ok_or_else(|| refused("of another FMU, its GUID differs"))?;
        let another_build = |reason: &dyn std::fmt::Display| {
            refused(&format!(
                "of another build of this FMU, whose model has fields of other names, types or order: \
                 only a library with the same model can read it ({reason})"
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
        if !rest.is_empty() || !core.is_possible() {
            return Err(refused("no instance can be in that state"));
        }
        Ok(Self { none: 0, guid, core })
    }
}

impl<M: Model> Core<M> {
    /// Whether an instance can be like that when its state is read.
    fn is_possible(&self) -> bool {
        let reached = match self.state {
            State::Instantiated | State::InitializationMode | State::Terminated | State::Error => {
                true
            }
            State::EventMode | State::ContinuousTimeMode => {
                self.interface_type == InterfaceType::ModelExchange
            }
            State::StepComplete | State::StepFailed => {
                self.interface_type == InterfaceType::CoSimulation
            }
            State::StepInProgress | State::StepCanceled | State::Fatal => false,
        };
        reached && self.time.is_finite() && self.experiment.start_time.is_finite()
    }
}
