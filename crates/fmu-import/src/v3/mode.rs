//! The mode of an instance.

use serde::{Deserialize, Serialize};

/// The mode of the FMU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Mode {
    #[default]
    Instantiated,
    Initialization,
    Event,
    /// Step Mode, in model exchange Continuous-Time Mode.
    Step,
}

impl Mode {
    /// Whether the initialization has ended.
    pub(super) fn is_initialized(self) -> bool {
        matches!(self, Mode::Event | Mode::Step)
    }
}
