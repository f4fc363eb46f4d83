//! Conversion of a parameter value to the unit and type of a variable.

use fmu_description::{Kind, Version};

use crate::conversion::{ConversionChain, Measure};
use crate::structure::{
    Conversion, Definitions, Parameter, ParameterValue, Transformation as Stated,
};
use slave::Transformation;

/// A value with its unit or enumeration.
#[derive(Clone, Debug)]
pub(super) struct Value {
    pub(super) number: Number,
    pub(super) measure: Measure,
}

/// A value without its unit.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Number {
    Real(f64),
    Integer(i128),
    Boolean(bool),
    Text(String),
    /// An item of an enumeration, with its number if the file defines it.
    Item(String, Option<i32>),
    Binary,
    /// The description of an array value, which no variable can receive.
    Unsupported(String),
}

impl Value {
    pub(super) fn new(number: Number, measure: Measure) -> Self {
        Value { number, measure }
    }

    /// Returns the value of a parameter; its unit or enumeration is from the first of `scopes` that has this name.
    pub(super) fn of(parameter: &Parameter, scopes: &[&Definitions]) -> Self {
        let measure = match &parameter.value {
            ParameterValue::Real(_, Some(unit)) => Measure::unit(unit, scopes),
            ParameterValue::Enumeration(_, Some(name)) => Measure::enumeration(name, scopes),
            _ => Measure::default(),
        };
        let number = match &parameter.value {
            ParameterValue::Real(value, _) => Number::Real(*value),
            ParameterValue::Integer(value) => Number::Integer((*value).into()),
            ParameterValue::Long(value) => Number::Integer(*value),
            ParameterValue::Boolean(value) => Number::Boolean(*value),
            ParameterValue::String(text) => Number::Text(text.clone()),
            ParameterValue::Enumeration(item, _) => {
                Number::Item(item.clone(), number_of(item, measure.items.as_deref()))
            }
            ParameterValue::Binary(_) => Number::Binary,
            ParameterValue::Array(_, values) => {
                Number::Unsupported(format!("an array of {} elements", values.len()))
            }
        };
        Value { number, measure }
    }

    /// Converts the value to the unit of `there`, then applies the transformation of a mapping; also returns warnings.
    /// Returns an error sentence if the units measure different quantities or the transformation has another type.
    pub(super) fn convert(
        self,
        conversion: &Conversion,
        there: Measure,
    ) -> Result<(Value, Vec<String>), String> {
        // An enumeration mapping uses the names of items, so that their numbers may be unknown.
        if let (Some(Stated::Enumeration(pairs)), Number::Item(item, _)) =
            (&conversion.transformation, &self.number)
        {
            let target = pairs.iter().find(|(source, _)| source == item);
            let number = target
                .map_or(self.number.clone(), |(_, target)| Number::Item(target.clone(), None));
            return Ok((Value::new(number, there), Vec::new()));
        }
        let chain = ConversionChain::from(self.measure).append(conversion, there)?;
        let number = self.number.transformed(&chain.transformation)?;
        Ok((Value::new(number, chain.measure), chain.warnings))
    }
}

fn number_of(item: &str, items: Option<&[(String, i32)]>) -> Option<i32> {
    items?.iter().find(|(name, _)| name == item).map(|(_, value)| *value)
}

impl Number {
    pub(super) fn transformed(&self, transformation: &Transformation) -> Result<Number, String> {
        Ok(match (transformation, self) {
            (Transformation::Identity, _) => self.clone(),
            (Transformation::Linear { factor, offset }, Number::Real(value)) => {
                Number::Real(factor * value + offset)
            }
            #[expect(clippy::cast_precision_loss, reason = "rounds to the nearest number")]
            (Transformation::Linear { factor, offset }, Number::Integer(value)) => {
                Number::Real(factor * (*value as f64) + offset)
            }
            (Transformation::Integer(pairs), Number::Integer(value)) => {
                let target = pairs.iter().find(|(source, _)| i128::from(*source) == *value);
                Number::Integer(target.map_or(*value, |(_, target)| (*target).into()))
            }
            (Transformation::Integer(_), Number::Item(_, Some(value))) => {
                Number::Integer((*value).into()).transformed(transformation)?
            }
            (Transformation::Boolean { from_false, from_true }, Number::Boolean(value)) => {
                Number::Boolean(if *value { *from_true } else { *from_false })
            }
            _ => {
                let text = self.to_text();
                return Err(format!("the transformation is not for a value such as {text}"));
            }
        })
    }

    /// Applies the inverse of `transformation`. Returns an error sentence unless `transformation` is the identity, or
    /// linear with a factor other than zero for a Real.
    pub(super) fn inverted(&self, transformation: &Transformation) -> Result<Number, String> {
        match (transformation, self) {
            (Transformation::Identity, _) => Ok(self.clone()),
            (Transformation::Linear { factor, offset }, Number::Real(value)) if *factor != 0.0 => {
                Ok(Number::Real((value - offset) / factor))
            }
            _ => Err("the transformation on the way has no inverse".to_owned()),
        }
    }

    /// Returns the text of a setting for a variable of type `kind` with the enumeration `items`; an error sentence if
    /// the value does not fit the type.
    pub(super) fn text(
        &self,
        kind: &Kind,
        items: Option<&[(String, i32)]>,
    ) -> Result<String, String> {
        let (is_real, range) = (kind.as_real().is_some(), kind.integer_range(Version::V3));
        let fits = |value: i128| range.as_ref().is_some_and(|range| range.contains(&value));
        match (kind, self) {
            (Kind::Boolean(_), Number::Boolean(_)) | (Kind::String(_), Number::Text(_)) => {
                Ok(self.to_text())
            }
            (_, Number::Real(_) | Number::Integer(_)) if is_real => Ok(self.to_text()),
            (_, Number::Integer(value)) if fits(*value) => Ok(self.to_text()),
            (Kind::Enumeration(_), Number::Item(item, value)) => {
                let number = number_of(item, items).or(if items.is_none() { *value } else { None });
                number.map(|number| number.to_string()).ok_or_else(|| {
                    let names = items.unwrap_or_default().iter().map(|(name, _)| name.as_str());
                    let names: Vec<&str> = names.collect();
                    format!("expected an item of {}, found {item:?}", names.join(", "))
                })
            }
            (_, Number::Item(_, Some(value))) if fits((*value).into()) => Ok(value.to_string()),
            #[expect(clippy::cast_possible_truncation, reason = "saturates beyond every range")]
            (kind, Number::Real(value))
                if !matches!(kind, Kind::Enumeration(_))
                    && value.fract() == 0.0
                    && fits(*value as i128) =>
            {
                Ok(format!("{value:.0}"))
            }
            _ => {
                let (kind, text) = (kind.element(), self.to_text());
                Err(format!("expected a value of type {kind}, found {text}"))
            }
        }
    }

    pub(super) fn to_text(&self) -> String {
        match self {
            Number::Real(value) => format!("{value:?}"),
            Number::Integer(value) => value.to_string(),
            Number::Boolean(value) => value.to_string(),
            Number::Text(text) => text.clone(),
            Number::Item(item, _) => item.clone(),
            Number::Binary => "binary data".to_owned(),
            Number::Unsupported(words) => words.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use fmu_description::{IntegerType, RealType};

    use super::*;

    #[test]
    fn numbers_fit_variables_of_all_widths_of_fmi_3() {
        let (single, wide) =
            (Kind::Float32(RealType::default()), Kind::UInt64(IntegerType::default()));
        for (number, kind, expected) in [
            (Number::Real(2.5), &single, "2.5"),
            (Number::Integer(3), &single, "3"),
            (Number::Integer(3), &wide, "3"),
            (Number::Real(4.0), &wide, "4"),
            (Number::Item("low".to_owned(), Some(1)), &wide, "1"),
            (Number::Integer(u64::MAX.into()), &wide, "18446744073709551615"),
            // 2^63
            (Number::Real(9_223_372_036_854_775_808.0), &wide, "9223372036854775808"),
        ] {
            assert_eq!(number.text(kind, None).as_deref(), Ok(expected));
        }
        let sentence = Number::Real(2.5).text(&wide, None).unwrap_err();
        assert_eq!(sentence, "expected a value of type UInt64, found 2.5");
        let small = Kind::UInt32(IntegerType::default());
        let sentence = Number::Integer(4_294_967_296).text(&small, None).unwrap_err();
        assert_eq!(sentence, "expected a value of type UInt32, found 4294967296");
    }
}
