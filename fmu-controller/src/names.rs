//! The names of the variables of signals with several channels.
//!
//! The functions return iterators over vectors, because chains of iterators would be compiled once for each caller.

use aso_controller::Design;
use aso_controller::{channel, channels};

/// `y_f`, the filtered measurements; none without a filter.
pub(crate) fn filtered(design: &Design) -> std::vec::IntoIter<String> {
    let count = design.filter.as_ref().map_or(0, Vec::len);
    channels("y_f", count)
}

/// `x_i`, the integrals; none without integral action.
pub(crate) fn integrals(design: &Design) -> std::vec::IntoIter<String> {
    channels("x_i", design.integrals())
}

/// `u_t`, the parts of the commands that decay after a change of the law; none without a transfer.
pub(crate) fn transfers(design: &Design) -> std::vec::IntoIter<String> {
    channels("u_t", design.transfers())
}

/// `f_hat`, or `f_hat_i` in a design with a direct term: the part of z that estimates the faults.
pub(crate) fn fault_states(design: &Design) -> std::vec::IntoIter<String> {
    let name = if design.p_f.is_some() { "f_hat_i" } else { "f_hat" };
    channels(name, design.faults.len())
}

/// `x_hat`, `f_hat` (or `f_hat_i`), `y_f`, `x_i` and `u_t`: the continuous states, in the order of z.
pub(crate) fn estimates(design: &Design) -> std::vec::IntoIter<String> {
    let x_hat = channels("x_hat", design.states.len());
    let parts =
        [x_hat, fault_states(design), filtered(design), integrals(design), transfers(design)];
    parts.into_iter().flatten().collect::<Vec<_>>().into_iter()
}

/// `x_hat_0`, `f_hat_0` and `x_i_0`: the initial values, in the order of z.
pub(crate) fn starts(design: &Design) -> std::vec::IntoIter<String> {
    let x_hat = channels("x_hat_0", design.states.len());
    let f_hat = channels("f_hat_0", design.faults.len());
    let parts = [x_hat, f_hat, channels("x_i_0", design.integrals())];
    parts.into_iter().flatten().collect::<Vec<_>>().into_iter()
}

/// The lower (0) or upper (1) limit of actuator `position`.
pub(crate) fn limit(design: &Design, side: usize, position: usize) -> String {
    channel(["u_min", "u_max"][side], position, design.actuators.len())
}

/// `x_op`, `u_op`, `y_op` or `r_op` of `count` signals; none without an operating point.
pub(crate) fn operating(design: &Design, name: &str, count: usize) -> std::vec::IntoIter<String> {
    if design.has_operating_point() { channels(name, count) } else { Vec::new().into_iter() }
}
