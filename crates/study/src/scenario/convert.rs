//! Conversion of stated values to the units of the variables.

use fmu_description::unit::{BaseUnit, Unit};
use fmu_description::{Kind, ModelDescription, ScalarVariable};

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

    /// Returns the conversion from the unit `stated` to the unit of `variable`, called `name`; the
    /// identity if no unit is stated.
    pub(super) fn find(
        stated: Option<&str>,
        name: &str,
        variable: &ScalarVariable,
        description: &ModelDescription,
    ) -> Result<Self, Reason> {
        let Some(stated) = stated else { return Ok(Self::NONE) };
        let name = name.to_owned();
        let Some(unit) = unit_of(variable, description) else {
            return Err(Reason::NoUnit { name, stated: stated.to_owned() });
        };
        if unit == stated {
            return Ok(Self::NONE);
        }
        let target = base_of(unit, description)?;
        let source = base_of(stated, description)?;
        match source.conversion(&target) {
            Some((factor, offset)) if factor.is_finite() && factor != 0.0 && offset.is_finite() => {
                Ok(Self { factor, offset })
            }
            _ => Err(Reason::Dimension { name, stated: stated.to_owned(), unit: unit.to_owned() }),
        }
    }
}

/// Returns the name of the unit of a Real: its own, or the unit of its type.
fn unit_of<'a>(variable: &'a ScalarVariable, description: &'a ModelDescription) -> Option<&'a str> {
    let Kind::Real(real) = &variable.kind else { return None };
    let declared = || {
        let name = real.declared_type.as_ref()?;
        match &description.types.iter().find(|one| one.name == *name)?.kind {
            Kind::Real(kind) => kind.unit.as_deref(),
            _ => None,
        }
    };
    real.unit.as_deref().or_else(declared)
}

/// Returns the base of a unit: from the definition in the FMU, or from the name.
fn base_of(name: &str, description: &ModelDescription) -> Result<BaseUnit, Reason> {
    let defined = description.units.iter().find(|unit| unit.name == name);
    if let Some(base) = defined.and_then(|unit| unit.base) {
        return Ok(base);
    }
    Ok(Unit::parse(name)?.base.unwrap_or_default())
}
