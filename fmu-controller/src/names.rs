//! The names of the variables that stand for a channel of a signal.

use crate::design::Design;

/// `name` for the only channel, `name[k]` for channel k of several; `position` counts from 0.
pub(crate) fn channel(name: &str, position: usize, count: usize) -> String {
    if count == 1 { name.to_owned() } else { format!("{name}[{}]", position + 1) }
}

/// The names of all `count` channels.
pub(crate) fn channels(name: &str, count: usize) -> impl Iterator<Item = String> + '_ {
    (0..count).map(move |position| channel(name, position, count))
}

/// `x_hat` and `f_hat`: the continuous states, in the order of the estimate.
pub(crate) fn estimates(design: &Design) -> impl Iterator<Item = String> {
    channels("x_hat", design.states.len()).chain(channels("f_hat", design.faults.len()))
}

/// `x_hat_0` and `f_hat_0`, in the same order.
pub(crate) fn starts(design: &Design) -> impl Iterator<Item = String> {
    channels("x_hat_0", design.states.len()).chain(channels("f_hat_0", design.faults.len()))
}

/// The lower (0) or upper (1) limit of actuator `position`.
pub(crate) fn limit(design: &Design, side: usize, position: usize) -> String {
    channel(["u_min", "u_max"][side], position, design.actuators.len())
}
