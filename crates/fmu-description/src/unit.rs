//! Units and their conversion to SI base units (FMI 2.0.5, section 2.2.2).

mod expression;
mod names;

use serde::Serialize;

use crate::hash_form::{is_default, numbered};

use expression::Cursor;

/// Degrees in a radian, 180 / pi.
const DEGREES_PER_RADIAN: f64 = 57.295_779_513_082_32;

/// `Unit`: a name, the conversion to SI base units, and display units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unit {
    /// `name`, unique in `UnitDefinitions`.
    pub name: String,
    /// `BaseUnit`: the conversion to SI base units, if known.
    pub base: Option<BaseUnit>,
    /// `DisplayUnit`s.
    pub display_units: Vec<DisplayUnit>,
}

/// `BaseUnit`: exponents of the base units, and `base = factor * unit + offset`, without the offset for a
/// [difference](crate::RealType::is_relative).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[expect(missing_docs, reason = "exponents are named by their units")]
pub struct BaseUnit {
    pub kg: i32,
    pub m: i32,
    pub s: i32,
    pub a: i32,
    pub k: i32,
    pub mol: i32,
    pub cd: i32,
    /// Exponent of the radian, which FMI counts as a base unit.
    pub rad: i32,
    /// `factor`, not zero.
    pub factor: f64,
    /// `offset`, in base units.
    pub offset: f64,
}

impl Default for BaseUnit {
    /// The dimensionless unit 1.
    fn default() -> Self {
        BaseUnit::from_exponents([0; 8], 1.0, 0.0)
    }
}

impl BaseUnit {
    /// Names of the exponents in XML, in the order of [`BaseUnit::exponents`].
    pub const EXPONENTS: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

    /// Creates a base unit from exponents in the order of [`BaseUnit::EXPONENTS`].
    #[must_use]
    pub fn from_exponents(exponents: [i32; 8], factor: f64, offset: f64) -> Self {
        let [kg, m, s, a, k, mol, cd, rad] = exponents;
        BaseUnit { kg, m, s, a, k, mol, cd, rad, factor, offset }
    }

    /// Returns the exponents in the order of [`BaseUnit::EXPONENTS`].
    #[must_use]
    pub fn exponents(&self) -> [i32; 8] {
        [self.kg, self.m, self.s, self.a, self.k, self.mol, self.cd, self.rad]
    }

    /// Returns factor and offset of the conversion from this unit to `other`, `value_in_other = factor * value +
    /// offset`; `None` if the exponents differ. A [difference](crate::RealType::is_relative) is
    /// converted by the factor alone. Short decimals within the rounding errors count, so that 1 m/s is
    /// 3.6 km/h, not 3.5999999999999996 km/h.
    #[must_use]
    pub fn conversion(&self, other: &BaseUnit) -> Option<(f64, f64)> {
        let factor = self.factor / other.factor;
        let offset = (self.offset - other.offset) / other.factor;
        let size = (self.offset.abs() + other.offset.abs()) / other.factor.abs();
        let conversion = (shortest(factor, factor.abs()), shortest(offset, size));
        (self.exponents() == other.exponents()).then_some(conversion)
    }
}

/// Returns the decimal with the fewest digits, at most 12, that differs from `number` by no more than the rounding error
/// of numbers of this `size`; without one, `number`. With more digits, numbers such as pi / 180 would lose their last.
/// 10^22 is the largest power of ten that is exact. Formatting and parsing would add 13 kB to the pages.
fn shortest(number: f64, size: f64) -> f64 {
    let decimals = (-22..=22).map(|places: i32| {
        let power = 10_f64.powi(places.abs());
        let digits = if places < 0 { number / power } else { number * power }.round();
        (digits, if places < 0 { digits * power } else { digits / power })
    });
    let mut short = decimals.take_while(|(digits, _)| digits.abs() < 1e12);
    let within = short.find(|(_, decimal)| (decimal - number).abs() <= f64::EPSILON * size);
    within.map_or(number, |(_, decimal)| decimal)
}

/// `DisplayUnit`: `display = factor * unit + offset`, without the offset for a
/// [difference](crate::RealType::is_relative). As for a [`BaseUnit`], `unit` is a value in the [`Unit`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DisplayUnit {
    /// `name`, unique within its unit.
    pub name: String,
    /// `factor`, not zero.
    pub factor: f64,
    /// `offset`, in display units.
    pub offset: f64,
    /// `inverse` (FMI 3.0): `display = factor / unit`.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<1, _, _>")]
    pub inverse: bool,
}

/// The error of parsing a unit expression. Columns count characters from 1.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum UnitError {
    /// A name is not a known unit.
    #[error(
        "unit {expression:?}, column {column}: expected a unit such as kg, m, s, rad, N, J, W, Pa, \
         degC or %, with or without an SI prefix, found {name:?}"
    )]
    UnknownName { expression: String, column: usize, name: String },
    /// A character does not fit the syntax.
    #[error("unit {expression:?}, column {column}: expected {expected}, found {actual}")]
    Syntax { expression: String, column: usize, expected: &'static str, actual: String },
    /// A unit with an offset (such as degC) is part of a larger expression, where an offset has no meaning.
    #[error(
        "unit {expression:?}, column {column}: {name} has an offset and can only stand alone, \
         expected a unit without one, such as K"
    )]
    Offset { expression: String, column: usize, name: String },
    /// The conversion factor is not within 1e-300 and 1e300.
    #[error(
        "unit {expression:?}: expected a conversion factor from 1e-300 to 1e300, found {actual}"
    )]
    Magnitude { expression: String, actual: String },
}

impl Unit {
    /// Parses a unit expression and computes its conversion to SI base units.
    ///
    /// `expression` is a product of units separated by `.`, `*` or a blank, each with an optional integer exponent
    /// (`m2`, `m^2`, `s-1`), and any number of divisions by one unit (`m/s`) or by a product in parentheses
    /// (`J/(kg.K)`). `""` and `"1"` are dimensionless. The name of the result is the expression, unchanged. Metric
    /// units accept SI prefixes (`km`, `us`). `Hz` is 2 pi rad/s, as in the table of section 2.2.2.
    ///
    /// `rad` gets the display unit `deg`, `rad/s` gets `deg/s`. Powers of ten are collected and applied
    /// once, so that the factor has few rounding errors.
    ///
    /// # Errors
    ///
    /// [`UnitError`] for an unknown unit, a syntax error, a unit with an offset in a larger expression, and a
    /// conversion factor that is too large or too small.
    ///
    /// ```
    /// let unit = fmu_description::unit::Unit::parse("km/h")?;
    /// let base = unit.base.expect("a known unit has a base unit");
    /// assert_eq!((base.m, base.s, base.factor), (1, -1, 1000.0 / 3600.0));
    /// # Ok::<(), fmu_description::unit::UnitError>(())
    /// ```
    pub fn parse(expression: &str) -> Result<Unit, UnitError> {
        let base = Cursor::new(expression).unit()?;
        Ok(Unit { name: expression.to_owned(), base: Some(base), display_units: displays(&base) })
    }

    /// Whether this is a unit of temperature: [differences](crate::RealType::is_relative) and values have different
    /// conversions.
    #[must_use]
    pub fn is_temperature(&self) -> bool {
        self.base.is_some_and(|base| base.exponents() == [0, 0, 0, 0, 1, 0, 0, 0])
    }
}

/// Returns the display unit in degrees for `rad` and `rad/s`; none for other units.
fn displays(base: &BaseUnit) -> Vec<DisplayUnit> {
    let radian = BaseUnit { rad: 1, ..BaseUnit::default() };
    let name = if *base == radian {
        "deg"
    } else if *base == (BaseUnit { s: -1, ..radian }) {
        "deg/s"
    } else {
        return Vec::new();
    };
    vec![DisplayUnit {
        name: name.to_owned(),
        factor: DEGREES_PER_RADIAN,
        offset: 0.0,
        inverse: false,
    }]
}

#[cfg(test)]
mod tests;
