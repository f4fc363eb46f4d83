//! Tests capabilities of the slaves; some model descriptions promise too much.

use crate::algorithm::{Algorithm, Coupling};
use crate::exchange::{Exchange, Refusal};
use crate::system::System;
use slave::CallError;

/// Lays out the connections of an initialised system. Derivatives that an FMU promises and refuses
/// are not used, with a warning.
pub(crate) fn build_exchange(system: &mut System, algorithm: &Algorithm) -> Exchange {
    let exchange = Exchange::new(system, algorithm, &[]);
    let mut refusing = vec![Refusal::default(); system.slaves.len()];
    for (slave, (name, instance)) in system.slaves.iter_mut().enumerate() {
        let (outputs, inputs) = exchange.reals.try_derivatives(slave, instance.as_mut());
        refusing[slave] = Refusal {
            outputs: is_refused(name, outputs, "maxOutputDerivativeOrder", "outputs"),
            inputs: is_refused(name, inputs, "canInterpolateInputs", "inputs"),
        };
    }
    if refusing.iter().all(|refusal| *refusal == Refusal::default()) {
        return exchange;
    }
    Exchange::new(system, algorithm, &refusing)
}

/// Whether an FMU refuses derivatives that `flag` promises. Ignores other failures, which appear again when the
/// derivatives are needed.
fn is_refused(name: &str, done: Result<(), CallError>, flag: &str, what: &str) -> bool {
    let Err(error) = done else { return false };
    let refused = error.leaves_the_instance_usable();
    if refused {
        tracing::warn!(
            "{name}: {error}, although its {flag} promises it; the run does without derivatives of \
             the {what} of {name}"
        );
    }
    refused
}

/// Returns `algorithm`. Removes its iteration if an FMU cannot restore its state although the FMU's description
/// promises this, provided that a fallback is allowed and nothing else repeats steps.
pub(crate) fn confirm_rollback(system: &mut System, algorithm: &Algorithm) -> Algorithm {
    let once = Algorithm { coupling: Coupling::Once, ..algorithm.clone() };
    if !algorithm.fallback || algorithm.coupling == Coupling::Once || once.repeats() {
        return algorithm.clone();
    }
    for (name, slave) in &mut system.slaves {
        let done = slave.save_state(0).and_then(|()| slave.restore_state(0));
        if let Err(error) = done {
            tracing::warn!(
                "{name}: {error}, although its canGetAndSetFMUstate is true; steps are not iterated"
            );
            return once;
        }
    }
    algorithm.clone()
}
