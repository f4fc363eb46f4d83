//! Conversion between units of the same base.

use fmu_description::unit::BaseUnit;

use super::{Port, System};
use crate::error::SystemError;
use slave::Transformation;

impl System {
    /// Returns name and base of a variable's unit, if it has one that its description defines.
    fn unit(&self, port: Port) -> Option<(&String, Option<BaseUnit>)> {
        let real = self.variable(port).kind.as_real()?;
        let name = real.unit.as_ref()?;
        let description = self.slaves[port.slave].1.description();
        let base = description.units.iter().find(|unit| unit.name == *name)?.base;
        Some((name, base))
    }

    /// Returns the unit of a variable; `None` if it has none or is dimensionless.
    pub(super) fn dimension(&self, port: Port) -> Option<&str> {
        let real = self.variable(port).kind.as_real()?;
        real.unit.as_deref().filter(|unit| !["", "1", "-"].contains(unit))
    }

    /// Returns factor and offset of the conversion between the units of two variables; `None` if the units have the same
    /// name (their definitions are not compared), if values are equal in both, or if a variable has no unit that its
    /// description defines. An error if the units cannot be converted.
    pub(super) fn conversion(
        &self,
        from: Port,
        to: Port,
    ) -> Result<Option<(f64, f64)>, SystemError> {
        let (Some(source), Some(target)) = (self.unit(from), self.unit(to)) else {
            return Ok(None);
        };
        if source.0 == target.0 {
            return Ok(None);
        }
        let both = source.1.zip(target.1);
        let Some(conversion) = both.and_then(|(source, target)| source.conversion(&target)) else {
            return Err(SystemError::Unit {
                from: self.name(from),
                from_unit: source.0.clone(),
                to: self.name(to),
                to_unit: target.0.clone(),
            });
        };
        Ok(Some(conversion).filter(|conversion| *conversion != (1.0, 0.0)))
    }
}

/// Returns the transformation that first applies `conversion` (factor and offset) and then
/// `transformation`.
pub(super) fn after(conversion: (f64, f64), transformation: &Transformation) -> Transformation {
    match transformation {
        &Transformation::Linear { factor, offset } => Transformation::Linear {
            factor: factor * conversion.0,
            offset: factor * conversion.1 + offset,
        },
        _ => Transformation::Linear { factor: conversion.0, offset: conversion.1 },
    }
}
