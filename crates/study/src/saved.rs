//! The checkpoint file: configuration, simulation, state of the recording.

use crate::error::Error;
use std::path::Path;

use master::{Checkpoint, SlowState};
use results::Due;
use serde::{Deserialize, Serialize};

use crate::config::{self, Config, Every};

/// Magic bytes of this version of the format; a CRC-32 of the rest (four bytes) follows.
const MAGIC: &[u8; 16] = b"aso-ftc-state-6\n";
/// Magic bytes common to all versions of the format.
const KIND: &[u8] = b"aso-ftc-state-";
/// Length in bytes of magic bytes and checksum.
const HEADER: usize = MAGIC.len() + 4;
/// Advice for a checkpoint that cannot be used.
const ADVICE: &str = "resume another one, or repeat the run from its start with --checkpoint";

/// A saved run.
#[derive(Serialize, Deserialize)]
pub struct SavedRun {
    /// The complete configuration, a `system.toml` with absolute paths.
    pub(crate) text: String,
    /// The state of the simulation.
    pub(crate) checkpoint: Checkpoint,
    /// Interval between rows as text, and the schedule of the next rows; `None` if nothing is recorded.
    pub(crate) due: Option<(String, Due)>,
    /// The recorded values of FMUs that step every several communication steps.
    pub(crate) slow: SlowState,
}

impl SavedRun {
    /// Writes the file atomically.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let content =
            postcard::to_stdvec(self).map_err(|error| Error::Invalid(error.to_string()))?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend(crc32fast::hash(&content).to_le_bytes());
        bytes.extend(content);
        files::whole::write(path, &bytes).map_err(Error::file("write", path))
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, is damaged or cut short, or has another version.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let shown = path.display();
        let bytes = std::fs::read(path).map_err(Error::file("read", path))?;
        let Some((sum, content)) =
            bytes.strip_prefix(MAGIC).and_then(|rest| rest.split_first_chunk::<4>())
        else {
            return Err(Error::Invalid(unreadable(path, &bytes)));
        };
        if crc32fast::hash(content) != u32::from_le_bytes(*sum) {
            return Err(Error::Invalid(format!(
                "{shown}: the checkpoint is damaged or cut short: its checksum does not fit; {ADVICE}"
            )));
        }
        postcard::from_bytes(content).map_err(|error| {
            Error::Invalid(format!(
                "{shown}: expected a checkpoint of this version of aso-ftc: {error}"
            ))
        })
    }

    /// Returns the configuration of the run. `path` is the path of the checkpoint, for error
    /// messages.
    ///
    /// # Errors
    ///
    /// Returns an error if the configuration is not valid in this version.
    pub fn config(&self, path: &Path) -> Result<Config, Error> {
        Ok(config::parse(&self.text, path)?)
    }

    /// Returns the schedule of the next rows if the saved run recorded rows at the interval `every`, otherwise `None`.
    #[must_use]
    pub fn due(&self, every: Every) -> Option<&Due> {
        let (text, due) = self.due.as_ref()?;
        (*text == every.to_string()).then_some(due)
    }

    /// Returns the time reached in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.checkpoint.time()
    }
}

/// Returns the sentence for a file that is not a checkpoint of this version: another file, another format, or a file
/// that ends within its [`HEADER`].
fn unreadable(path: &Path, bytes: &[u8]) -> String {
    let shown = path.display();
    if MAGIC.starts_with(bytes) || bytes.starts_with(MAGIC) {
        let length = bytes.len();
        return format!(
            "{shown}: the checkpoint is cut short: it has {length} bytes, expected at least {HEADER}; {ADVICE}"
        );
    }
    let Some(version) = bytes.strip_prefix(KIND).and_then(|rest| rest.first()) else {
        return format!("{shown}: expected a checkpoint of this version of aso-ftc");
    };
    format!(
        "{shown}: found a checkpoint of format {}, expected format {}: another version of aso-ftc \
         wrote it. Resume it with that version, or repeat the run from its start with --checkpoint",
        char::from(*version),
        char::from(MAGIC[KIND.len()])
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_that_ends_within_its_header_is_refused_as_cut_short() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let header = [&MAGIC[..], &[0; 4]].concat();
        for length in 0..header.len() {
            std::fs::write(&path, &header[..length]).unwrap();
            let message = SavedRun::read(&path).err().unwrap().to_string();
            let cause = format!("cut short: it has {length} bytes, expected at least 20");
            assert!(message.contains(&cause), "{message}");
        }
    }
}
