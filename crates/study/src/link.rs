//! Connections of an SSP system structure.

use std::collections::HashSet;

use master::{Port, System, SystemError};
use ssp::Link;

/// Makes the connection that `link` describes; between arrays of equal size, makes one connection for each element.
///
/// # Errors
///
/// Returns an error if a slave or a variable does not exist, if causality, type, unit or transformation
/// do not fit, if arrays have different sizes, or if the input already has a source.
pub fn link(system: &mut System, link: &Link) -> Result<(), SystemError> {
    link_others(system, link, &HashSet::new())
}

/// Same as [`link`], but leaves out the inputs whose holders are in `replaced`.
pub(crate) fn link_others(
    system: &mut System,
    link: &Link,
    replaced: &HashSet<Port>,
) -> Result<(), SystemError> {
    let from = (link.from.element.as_str(), link.from.variable.as_str());
    let to = (link.to.element.as_str(), link.to.variable.as_str());
    // The source of such an input need not exist.
    if system.terminal(to.0, to.1).is_ok_and(|port| replaced.contains(&system.holder(port))) {
        return Ok(());
    }
    for (from, to) in system.terminal_pairs(from, to)? {
        if !replaced.contains(&system.holder(to)) {
            system.connect_ports(from, to, link.transformation.clone(), link.units_settled)?;
        }
    }
    Ok(())
}
