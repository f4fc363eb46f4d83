//! FMU states: copies of an instance's core, and their form as bytes.

use super::{Core, Instance};
use crate::call_order::{InterfaceType, State};
use crate::description::Guid;
use crate::model::{Failure, Model};

/// First bytes of a serialised state; the last two digits are the version of the layout.
const MAGIC: &[u8; 8] = b"FMI2ST02";
/// Length of magic and GUID.
const HEAD: usize = 24;
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

fn failed(error: &postcard::Error) -> Failure {
    Failure::Error(format!("cannot serialize: {error}"))
}

impl<M: Model> Snapshot<M> {
    /// How many bytes [`Snapshot::write`] needs.
    pub(crate) fn size(&self) -> Result<usize, Failure> {
        let core = postcard::experimental::serialized_size(&self.core);
        core.map(|core| HEAD + core + CHECKSUM).map_err(|error| failed(&error))
    }

    /// Writes the state to the begin of `bytes`: magic, GUID, core in postcard's little-endian
    /// form, CRC-32 of all that.
    pub(crate) fn write(&self, bytes: &mut [u8]) -> Result<(), Failure> {
        let (found, needed) = (bytes.len(), self.size()?);
        let Some(bytes) = bytes.get_mut(..needed) else {
            return Err(Failure::Error(format!("{found} bytes given, {needed} needed")));
        };
        let (content, sum) = bytes.split_at_mut(needed - CHECKSUM);
        content[..MAGIC.len()].copy_from_slice(MAGIC);
        content[MAGIC.len()..HEAD].copy_from_slice(&self.guid.0);
        postcard::to_slice(&self.core, &mut content[HEAD..]).map_err(|error| failed(&error))?;
        sum.copy_from_slice(&crc32fast::hash(content).to_le_bytes());
        Ok(())
    }

    /// The state in `bytes`; refused unless it is whole and of the FMU `guid`.
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
        let (core, rest) = postcard::take_from_bytes::<Core<M>>(core)
            .map_err(|error| refused(&error.to_string()))?;
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
