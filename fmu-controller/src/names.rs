//! The names of the variables of signals with several channels.

use crate::design::Design;

/// `name` for the only channel, `name[k]` for channel k of several; `position` counts from 0.
pub(crate) fn channel(name: &str, position: usize, count: usize) -> String {
    if count == 1 { name.to_owned() } else { format!("{name}[{}]", position + 1) }
}

/// The names of all `count` channels.
pub(crate) fn channels(name: &str, count: usize) -> impl Iterator<Item = String> + '_ {
    (0..count).map(move |position| channel(name, position, count))
}

/// `y_f`, the filtered measurements, where the design has a filter.
pub(crate) fn filtered(design: &Design) -> impl Iterator<Item = String> {
    let count = design.filter.as_ref().map_or(0, Vec::len);
    channels("y_f", count)
}

/// `x_i`, the integrals, where the design has some.
pub(crate) fn integrals(design: &Design) -> impl Iterator<Item = String> {
    channels("x_i", design.integrals())
}

/// `f_hat`, or `f_hat_i` in a design with a direct term: the part of z that estimates the faults.
pub(crate) fn fault_states(design: &Design) -> impl Iterator<Item = String> {
    let name = if design.p_f.is_some() { "f_hat_i" } else { "f_hat" };
    channels(name, design.faults.len())
}

/// `x_hat`, `f_hat` (or `f_hat_i`), `y_f` and `x_i`: the continuous states, in the order of z.
pub(crate) fn estimates(design: &Design) -> impl Iterator<Item = String> {
    let x_hat = channels("x_hat", design.states.len());
    let observed = x_hat.chain(fault_states(design)).chain(filtered(design));
    observed.chain(integrals(design))
}

/// `x_hat_0`, `f_hat_0` and `x_i_0`, in the same order.
pub(crate) fn starts(design: &Design) -> impl Iterator<Item = String> {
    let x_hat = channels("x_hat_0", design.states.len());
    let observed = x_hat.chain(channels("f_hat_0", design.faults.len()));
    observed.chain(channels("x_i_0", design.integrals()))
}

/// The lower (0) or upper (1) limit of actuator `position`.
pub(crate) fn limit(design: &Design, side: usize, position: usize) -> String {
    channel(["u_min", "u_max"][side], position, design.actuators.len())
}

/// `x_op`, `u_op`, `y_op` or `r_op`, where the design has an operating point.
pub(crate) fn operating(
    design: &Design,
    name: &'static str,
    count: usize,
) -> impl Iterator<Item = String> {
    let stated = if design.has_operating_point() { count } else { 0 };
    (0..stated).map(move |position| channel(name, position, count))
}
