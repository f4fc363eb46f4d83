//! Conversion between units of the same base.

use fmu_description::RealType;
use fmu_description::unit::BaseUnit;

use super::{Port, System};
use crate::error::SystemError;
use slave::Transformation;

impl System {
    /// Returns name and base of a variable's unit, if the variable has a unit that its description defines.
    fn unit(&self, port: Port) -> Option<(&String, Option<BaseUnit>)> {
        let real = self.variable(port).kind.as_real()?;
        let name = real.unit.as_ref()?;
        let description = self.slaves[port.slave].1.description();
        let base = description.units.iter().find(|unit| unit.name == *name)?.base;
        Some((name, base))
    }

    /// Returns the name of the unit of a variable; `None` for a variable without a unit or with a dimensionless one.
    pub(super) fn unit_name(&self, port: Port) -> Option<&str> {
        let real = self.variable(port).kind.as_real()?;
        real.unit.as_deref().filter(|unit| !["", "1", "-"].contains(unit))
    }

    /// Returns factor and offset of the conversion between the units of two variables. `None` if the units have the
    /// same name (their definitions are not compared), if values are equal in both units, or if a variable has no unit
    /// that its description defines. The conversion of differences (`relativeQuantity`) has no offset. An error if the
    /// units cannot be converted, or if they differ by an offset and only one of the variables is a difference.
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
        let conversion = both.and_then(|(source, target)| source.conversion(&target));
        let Some((factor, offset)) = conversion else {
            return Err(SystemError::Unit {
                from: self.name(from),
                from_unit: source.0.clone(),
                to: self.name(to),
                to_unit: target.0.clone(),
            });
        };
        let is_relative =
            |port: Port| self.variable(port).kind.as_real().is_some_and(RealType::is_relative);
        let from_is_relative = is_relative(from);
        if from_is_relative != is_relative(to) && offset != 0.0 {
            let (from, to) = ((self.name(from), source.0), (self.name(to), target.0));
            let (relative, absolute) = if from_is_relative { (from, to) } else { (to, from) };
            return Err(SystemError::Relative {
                relative: relative.0,
                relative_unit: relative.1.clone(),
                absolute: absolute.0,
                absolute_unit: absolute.1.clone(),
            });
        }
        let offset = if from_is_relative { 0.0 } else { offset };
        Ok(Some((factor, offset)).filter(|conversion| *conversion != (1.0, 0.0)))
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
