//! `fmi2GetDirectionalDerivative` of an instance (section 2.1.9).

use super::Instance;
use crate::interface::Slot;
use crate::model::{At, Failure, Model};
use crate::room::Room;
use fmu_description::call_order::State;
use fmu_description::{Causality, Initial, Variability};

/// Whether the variable is a known: in initialization mode if `initializing`, otherwise after initialization mode.
fn is_known<M>(slot: &Slot<M, f64>, initializing: bool) -> bool {
    if initializing {
        let exact = slot.initial == Some(Initial::Exact);
        slot.causality == Causality::Input || exact && slot.variability != Variability::Constant
    } else {
        slot.causality == Causality::Input || slot.is_state
    }
}

impl<M: Model> Instance<M> {
    /// `fmi2GetDirectionalDerivative`: `to = (dh/dv) delta` for the unknowns h and the knowns v. An error if the model
    /// has no derivatives, or if a variable is no unknown or known in the present mode.
    pub(crate) fn get_directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        delta: &[f64],
        to: &mut Room<f64>,
    ) -> Result<(), Failure> {
        let mut places = to.iter_mut();
        self.directional_derivative(unknowns, knowns, delta, |value| {
            if let Some(place) = places.next() {
                place.write(value);
            }
        })
    }

    /// Checks that the model has derivatives.
    pub(super) fn provides_derivatives() -> Result<(), Failure> {
        if M::PROVIDES_DIRECTIONAL_DERIVATIVE {
            return Ok(());
        }
        let message = "not available: the model description offers no directional derivatives";
        Err(Failure::Error(message.to_owned()))
    }

    /// Computes `(dh/dv) delta` and passes the components to `write`, in the order of the unknowns.
    pub(super) fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        delta: &[f64],
        mut write: impl FnMut(f64),
    ) -> Result<(), Failure> {
        Self::provides_derivatives()?;
        self.refresh()?;
        let initializing = self.core.state == State::InitializationMode;
        for &reference in unknowns {
            let slot = self.interface.real(reference)?;
            let is_unknown = slot.is_some_and(|slot| {
                if initializing { slot.is_initial_unknown } else { slot.is_unknown }
            });
            if !is_unknown {
                return Err(not_part("an unknown", slot, self.core.state));
            }
        }
        let model = &self.core.model;
        let direction = self.direction.get_or_insert_with(|| model.clone());
        for slot in &self.interface.reals {
            *(slot.field)(direction) = 0.0;
        }
        let mut delta_time = 0.0;
        for (&reference, &delta) in knowns.iter().zip(delta) {
            match self.interface.real(reference)? {
                None => delta_time += delta,
                Some(slot) if is_known(slot, initializing) => *(slot.field)(direction) += delta,
                slot => return Err(not_part("a known", slot, self.core.state)),
            }
        }
        let at = if initializing {
            At::Initialization
        } else {
            At::Point { time: self.core.time, delta_time }
        };
        model.differentiate(&at, direction)?;
        for &reference in unknowns {
            if let Some(slot) = self.interface.real(reference)? {
                write(*(slot.field)(direction));
            }
        }
        Ok(())
    }
}

fn not_part<M>(role: &str, slot: Option<&Slot<M, f64>>, state: State) -> Failure {
    let name = slot.map_or("time", |slot| &slot.name);
    Failure::Error(format!(
        "{name} is not {role} of the equations in state {state:?}, see ModelStructure"
    ))
}
