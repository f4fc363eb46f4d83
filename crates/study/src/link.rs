//! Connections of an SSP system structure.

use master::{System, SystemError};
use ssp::Link;

/// Makes the connection that `link` describes.
///
/// # Errors
///
/// Returns an error if slave or variable do not exist, if causality, type, unit or transformation
/// do not fit, or if the input already has a source.
pub fn link(system: &mut System, link: &Link) -> Result<(), SystemError> {
    let from = system.terminal(&link.from.element, &link.from.variable)?;
    let to = system.terminal(&link.to.element, &link.to.variable)?;
    system.connect_ports(from, to, link.transformation.clone(), link.units_settled)
}
