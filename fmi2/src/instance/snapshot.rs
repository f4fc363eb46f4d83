//! FMU states: copies of an instance's core, and their form as bytes.

use sha2::{Digest, Sha256};

use super::{Core, Instance};
use crate::call_order::{InterfaceType, State};
use crate::model::{Failure, Model};

/// First bytes of a serialised state; the last two digits are the version of the layout.
const MAGIC: &[u8; 8] = b"FMI2ST02";
/// Length of the SHA-256 digest at the end.
const DIGEST: usize = 32;

/// What `fmi2FMUstate` points to.
pub(crate) struct Snapshot<M: Model> {
    guid: String,
    core: Core<M>,
}

impl<M: Model> Instance<M> {
    /// `fmi2GetFMUstate`.
    pub(crate) fn snapshot(&self) -> Snapshot<M> {
        Snapshot { guid: self.guid.clone(), core: self.core.clone() }
    }

    /// `fmi2SetFMUstate`.
    pub(crate) fn restore(&mut self, snapshot: &Snapshot<M>) -> Result<(), Failure> {
        if snapshot.guid != self.guid {
            return Err(Failure::Error(format!(
                "the state belongs to the FMU {}, this one is {}",
                snapshot.guid, self.guid
            )));
        }
        let (of, own) = (snapshot.core.interface_type, self.core.interface_type);
        if of != own {
            return Err(Failure::Error(format!(
                "the state is one of {of:?}, this instance is {own:?}"
            )));
        }
        self.core = snapshot.core.clone();
        Ok(())
    }
}

impl<M: Model> Snapshot<M> {
    /// The bytes: magic, length of the GUID (one byte), GUID, core in postcard's little-endian
    /// form, SHA-256 of all that.
    pub(crate) fn to_bytes(&self) -> Result<Vec<u8>, Failure> {
        let failed = |reason: String| Failure::Error(format!("cannot serialize: {reason}"));
        let mut bytes = MAGIC.to_vec();
        bytes.push(u8::try_from(self.guid.len()).map_err(|error| failed(error.to_string()))?);
        bytes.extend_from_slice(self.guid.as_bytes());
        let core = postcard::to_stdvec(&self.core).map_err(|error| failed(error.to_string()))?;
        bytes.extend_from_slice(&core);
        bytes.extend_from_slice(&Sha256::digest(&bytes));
        Ok(bytes)
    }

    /// The state in `bytes`; refused unless it is whole and of the FMU `guid`.
    pub(crate) fn from_bytes(bytes: &[u8], guid: &str) -> Result<Self, Failure> {
        let refused = |reason: &str| Failure::Error(format!("serialized state: {reason}"));
        let rest =
            bytes.strip_prefix(&MAGIC[..6]).ok_or_else(|| refused("not of this exporter"))?;
        let rest = rest.strip_prefix(&MAGIC[6..]).ok_or_else(|| refused("unknown version"))?;
        let whole = bytes
            .len()
            .checked_sub(DIGEST)
            .is_some_and(|end| Sha256::digest(&bytes[..end])[..] == bytes[end..]);
        if !whole {
            return Err(refused("truncated or altered, its checksum does not hold"));
        }
        let core = rest
            .split_first()
            .and_then(|(&length, rest)| rest.split_at_checked(usize::from(length)))
            .filter(|(found, _)| *found == guid.as_bytes())
            .map(|(_, core)| core)
            .ok_or_else(|| refused("of another FMU, its GUID differs"))?;
        let core: Core<M> = postcard::from_bytes(&core[..core.len() - DIGEST])
            .map_err(|error| refused(&error.to_string()))?;
        if !core.is_possible() {
            return Err(refused("no instance can be in that state"));
        }
        Ok(Self { guid: guid.to_owned(), core })
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
