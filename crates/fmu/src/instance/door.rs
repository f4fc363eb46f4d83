//! The rules of both versions of FMI for a C function with an instance, which
//! [`Instance::call`](super::Instance::call) applies.

use crate::model::Failure;
use fmu_description::call_order::{self, InterfaceType, State};
use fmu_description::call_order3;

/// A C function with an instance.
pub(crate) trait Function: Copy {
    /// The state of an instance after the function failed.
    const STATE_AFTER_ERROR: State;

    /// Returns the name in the C ABI.
    fn name(self) -> &'static str;

    /// Whether the function may be called in `state`.
    fn is_allowed(self, interface: InterfaceType, state: State) -> bool;

    /// Whether the function returns `fmi2Discard` or `fmi3Discard` for `failure`.
    fn discards(self, interface: InterfaceType, failure: &Failure) -> bool;

    /// Whether a discarded call may have advanced the model by a part of the step.
    fn keeps_partial_step(self) -> bool;
}

impl Function for call_order::Function {
    const STATE_AFTER_ERROR: State = State::Error;

    fn name(self) -> &'static str {
        self.name()
    }

    #[inline]
    fn is_allowed(self, interface: InterfaceType, state: State) -> bool {
        call_order::allowed(interface, self, state)
    }

    fn discards(self, interface: InterfaceType, failure: &Failure) -> bool {
        let discarded = matches!(
            failure,
            Failure::Discard(_) | Failure::Incomplete { .. } | Failure::Terminated { .. }
        );
        discarded && call_order::may_discard(interface, self)
    }

    fn keeps_partial_step(self) -> bool {
        self == Self::DoStep
    }
}

/// FMI 3.0: an instance is in state `Terminated` after an error (section 2.3.1), and `fmi3Discard` means
/// that nothing has changed (section 2.2.4).
impl Function for call_order3::Function {
    const STATE_AFTER_ERROR: State = State::Terminated;

    fn name(self) -> &'static str {
        self.name()
    }

    #[inline]
    fn is_allowed(self, interface: InterfaceType, state: State) -> bool {
        call_order3::allowed(interface, self, state)
    }

    fn discards(self, interface: InterfaceType, failure: &Failure) -> bool {
        matches!(failure, Failure::Discard(_)) && call_order3::may_discard(interface, self)
    }

    fn keeps_partial_step(self) -> bool {
        false
    }
}
