//! Connections of an SSP system structure.

use master::{System, SystemError};
use ssp::Link;

/// Makes the connection that `link` describes; between arrays of equal size, makes one connection for each element.
///
/// # Errors
///
/// Returns an error if a slave or a variable does not exist, if causality, type, unit or transformation
/// do not fit, if arrays have different sizes, or if the input already has a source.
pub fn link(system: &mut System, link: &Link) -> Result<(), SystemError> {
    let from = (link.from.element.as_str(), link.from.variable.as_str());
    let to = (link.to.element.as_str(), link.to.variable.as_str());
    for (from, to) in system.terminal_pairs(from, to)? {
        system.connect_ports(from, to, link.transformation.clone(), link.units_settled)?;
    }
    Ok(())
}
