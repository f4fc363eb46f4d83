//! FMU states, together with the state of the integration.

use serde::{Deserialize, Serialize};
use slave::CallError;

use super::{Integrated, Point, failed};
use crate::inputs::Track;

/// The state of the integration.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Saved {
    /// The point with the memory of the integrator; `None` in a slot without a state.
    point: Option<Point>,
    states: Vec<f64>,
    /// The nominal values of the states, which events may change.
    nominals: Vec<f64>,
    indicators: Vec<f64>,
    tracks: Vec<Track>,
}

impl Integrated {
    /// Saves the state of the integration in a slot; the FMU itself saves the state of the FMU.
    pub(super) fn save_integration(&mut self, slot: usize) {
        if self.saved.len() <= slot {
            self.saved.resize(slot + 1, Saved::default());
        }
        let saved = &mut self.saved[slot];
        saved.point = Some(Point { memory: self.stepper.memory, ..self.point });
        saved.states.clone_from(&self.states);
        saved.nominals.clear();
        saved.nominals.extend_from_slice(self.stepper.nominals());
        saved.indicators.clone_from(&self.indicators);
        saved.tracks.clone_from(&self.inputs.tracks);
    }

    /// Restores the state of the integration from a slot; an empty slot changes nothing.
    pub(super) fn restore_integration(&mut self, slot: usize) {
        let Some(saved) = self.saved.get(slot) else { return };
        let Some(point) = saved.point else { return };
        self.point = point;
        self.states.clone_from(&saved.states);
        self.indicators.clone_from(&saved.indicators);
        self.inputs.tracks.clone_from(&saved.tracks);
        self.stepper.memory = point.memory;
        self.stepper.set_nominals(&saved.nominals);
        self.stepper.forget_slope();
    }

    /// Returns the bytes of the state of the integration and of the state of the FMU.
    pub(super) fn serialize(&mut self) -> Result<Vec<u8>, CallError> {
        // In a temporary slot after the slots of the master.
        let slot = self.saved.len();
        self.save_integration(slot);
        let saved = self.saved.pop().unwrap_or_default();
        let fmu_state = self.instance.serialize_state()?;
        postcard::to_allocvec(&(saved, fmu_state))
            .map_err(|error| failed(format!("cannot serialise its state: {error}")))
    }

    /// Restores integration and FMU from bytes of [`Integrated::serialize`]; on failure the integration is unchanged.
    pub(super) fn deserialize(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        let read: Result<(Saved, Vec<u8>), _> = postcard::from_bytes(bytes);
        let (saved, fmu_state) =
            read.map_err(|error| failed(format!("cannot read a serialised state: {error}")))?;
        let fits = saved.point.is_some()
            && saved.states.len() == self.states.len()
            && saved.nominals.len() == self.states.len()
            && saved.indicators.len() == self.indicators.len()
            && saved.tracks.len() == self.inputs.tracks.len();
        if !fits {
            let what = "cannot read a serialised state: it is one of another FMU";
            return Err(failed(what.to_owned()));
        }
        self.instance.deserialize_state(&fmu_state)?;
        // In a temporary slot after the slots of the master.
        let slot = self.saved.len();
        self.saved.push(saved);
        self.restore_integration(slot);
        self.saved.pop();
        Ok(())
    }
}
