//! The file of a checkpoint: configuration, simulation, and where the recording stands.

use crate::error::Error;
use std::path::Path;

use master::{Checkpoint, SlowState};
use results::Due;
use serde::{Deserialize, Serialize};

use crate::config::{self, Config, Every};

/// What a file of this kind and version begins with; four bytes of CRC-32 of the rest follow.
const MAGIC: &[u8; 16] = b"aso-ftc-state-3\n";
/// What files of this kind and of every version begin with.
const KIND: &[u8] = b"aso-ftc-state-";

/// A run as it stands.
#[derive(Serialize, Deserialize)]
pub struct SavedRun {
    /// The complete configuration, a `system.toml` with absolute paths.
    text: String,
    checkpoint: Checkpoint,
    /// How often rows are recorded, and when the next one is; none where nothing is recorded.
    due: Option<(String, Due)>,
    slow: SlowState,
}

impl SavedRun {
    /// A checkpoint of `checkpoint`, with the configuration `text` and what the recording knows.
    #[must_use]
    pub fn new(
        text: &str,
        checkpoint: Checkpoint,
        due: Option<(Every, Due)>,
        slow: SlowState,
    ) -> Self {
        let due = due.map(|(every, due)| (every.to_string(), due));
        Self { text: text.to_owned(), checkpoint, due, slow }
    }

    /// Writes the file: whole or not at all.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
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
    /// [`Error`] with the reason.
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
                "{shown}: the checkpoint is damaged: its checksum does not fit"
            )));
        }
        postcard::from_bytes(content).map_err(|error| {
            let what =
                format!("{shown}: expected a checkpoint of this version of aso-ftc: {error}");
            Error::Invalid(what)
        })
    }

    /// The configuration of the run, from the checkpoint at `path`.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn config(&self, path: &Path) -> Result<Config, Error> {
        Ok(config::parse(&self.text, path)?)
    }

    /// When the next row is due, where rows are recorded as they were.
    #[must_use]
    pub fn due(&self, every: Every) -> Option<&Due> {
        let (text, due) = self.due.as_ref()?;
        (*text == every.to_string()).then_some(due)
    }

    /// What the recording knows of FMUs that make several steps at once.
    #[must_use]
    pub fn slow(&self) -> &SlowState {
        &self.slow
    }

    /// The simulation.
    #[must_use]
    pub fn checkpoint(&self) -> &Checkpoint {
        &self.checkpoint
    }

    /// Time reached in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.checkpoint.time()
    }
}

/// Why the bytes of a file are no checkpoint for this version.
fn unreadable(path: &Path, bytes: &[u8]) -> String {
    let shown = path.display();
    let version = bytes.strip_prefix(KIND).filter(|_| !bytes.starts_with(MAGIC));
    let Some(version) = version.and_then(|rest| rest.first()) else {
        return format!("{shown}: expected a checkpoint of this version of aso-ftc");
    };
    format!(
        "{shown}: found a checkpoint of format {}, expected format 3: another version of aso-ftc \
         wrote it. Resume it with that version, or repeat the run from its start with --checkpoint",
        char::from(*version)
    )
}
