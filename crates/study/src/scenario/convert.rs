//! Conversion of stated values to the units of the variables.

use fmu_description::unit::{BaseUnit, Unit};
use fmu_description::{ModelDescription, RealType, ScalarVariable};

use super::Reason;

/// `value of the variable = factor * value stated + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Conversion {
    pub(super) factor: f64,
    pub(super) offset: f64,
}

impl Conversion {
    /// The identity.
    pub(super) const NONE: Self = Self { factor: 1.0, offset: 0.0 };

    /// Converts a value.
    pub(super) fn absolute(self, value: f64) -> f64 {
        self.factor * value + self.offset
    }

    /// Converts a difference of values.
    pub(super) fn relative(self, difference: f64) -> f64 {
        self.factor * difference
    }

    /// Returns the conversion from the unit `stated` to the unit of `variable`, called `name`; the identity if no unit
    /// is stated. The conversion has no offset if the variable is a difference (`relativeQuantity`). Returns an error
    /// if the variable has no unit, or if the units are unknown or measure different quantities.
    pub(super) fn find(
        stated: Option<&str>,
        name: &str,
        variable: &ScalarVariable,
        description: &ModelDescription,
    ) -> Result<Self, Reason> {
        let Some(stated) = stated else { return Ok(Self::NONE) };
        let name = name.to_owned();
        let Some(unit) = variable.kind.as_real().and_then(|real| real.unit.as_deref()) else {
            return Err(Reason::NoUnit { name, stated: stated.to_owned() });
        };
        if unit == stated {
            return Ok(Self::NONE);
        }
        let target = base_of(unit, description)?;
        let source = base_of(stated, description)?;
        match source.conversion(&target) {
            Some((factor, offset)) if factor.is_finite() && factor != 0.0 && offset.is_finite() => {
                let is_relative = variable.kind.as_real().is_some_and(RealType::is_relative);
                Ok(Self { factor, offset: if is_relative { 0.0 } else { offset } })
            }
            _ => Err(Reason::Dimension { name, stated: stated.to_owned(), unit: unit.to_owned() }),
        }
    }
}

/// Returns the base of a unit: from the definition in the FMU, otherwise from the name. Returns an error if the FMU
/// does not define the unit and `name` is no unit of FMI.
fn base_of(name: &str, description: &ModelDescription) -> Result<BaseUnit, Reason> {
    let defined = description.units.iter().find(|unit| unit.name == name);
    if let Some(base) = defined.and_then(|unit| unit.base) {
        return Ok(base);
    }
    Ok(Unit::parse(name)?.base.unwrap_or_default())
}
