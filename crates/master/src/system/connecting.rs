//! Checks of a connection: causality, type, unit, transformation.

use fmu_description::Causality;

use super::{Connection, Port, System, units};
use crate::error::SystemError;
use slave::{Transformation, ValueType};

impl System {
    /// Connects an output to an input, an output or calculated parameter to a parameter, or an input
    /// clock that ticks at times to a triggered input clock. A parameter receives its value in
    /// initialization mode. If `units_settled` is true, `transformation` already includes the conversion
    /// of units; otherwise different units are converted.
    ///
    /// # Errors
    ///
    /// Returns an error if causality, type, unit or transformation do not fit, or if the input
    /// already has a source.
    pub fn connect_ports(
        &mut self,
        from: Port,
        to: Port,
        transformation: Transformation,
        units_settled: bool,
    ) -> Result<(), SystemError> {
        let to_parameter = self.variable(to).causality == Causality::Parameter;
        let calculated = self.variable(from).causality == Causality::CalculatedParameter;
        if !(to_parameter && calculated || self.is_clock_of_time(from, to)) {
            self.expect_causality(from, Causality::Output)?;
        }
        if !to_parameter {
            self.expect_causality(to, Causality::Input)?;
        }
        self.expect_fitting_types(from, to, &transformation)?;
        let transformation = if units_settled {
            transformation
        } else {
            match self.conversion(from, to)? {
                Some(conversion) => units::after(conversion, &transformation),
                None => transformation,
            }
        };
        let first = if to_parameter {
            self.initial.iter().find(|known| self.holder(known.to) == self.holder(to))
        } else {
            self.source(to)
        };
        if let Some(first) = first {
            let first = self.name(first.from);
            return Err(SystemError::Twice {
                input: self.name(to),
                first,
                second: self.name(from),
            });
        }
        let connection = Connection { from, to, transformation };
        if to_parameter {
            self.initial.push(connection);
        } else {
            self.sources.insert(self.holder(to), self.connections.len());
            self.connections.push(connection);
        }
        Ok(())
    }

    fn expect_causality(&self, port: Port, expected: Causality) -> Result<(), SystemError> {
        let causality = self.variable(port).causality;
        if causality == expected {
            return Ok(());
        }
        Err(SystemError::Role {
            name: self.name(port),
            actual: format!("a variable of causality {}", causality.as_str()),
            expected: expected.as_str().to_owned(),
        })
    }

    /// Checks the types: both are floating-point types, both are integers or enumerations, both are
    /// Boolean or clocks, both are Strings, both are binaries; or an integer goes to a floating-point
    /// type. The transformation must be for this type.
    fn expect_fitting_types(
        &self,
        from: Port,
        to: Port,
        transformation: &Transformation,
    ) -> Result<(), SystemError> {
        let wrong = |expected: String| SystemError::Role {
            name: self.name(to),
            actual: format!("a variable of type {}", self.type_name(to)),
            expected,
        };
        let (source, target) = (&self.variable(from).kind, &self.variable(to).kind);
        let fits = match (ValueType::of(source), ValueType::of(target)) {
            (ValueType::Real | ValueType::Integer, ValueType::Real) => {
                matches!(transformation, Transformation::Identity | Transformation::Linear { .. })
            }
            (ValueType::Integer, ValueType::Integer) => {
                matches!(transformation, Transformation::Identity | Transformation::Integer(_))
            }
            (ValueType::Boolean, ValueType::Boolean) => {
                matches!(transformation, Transformation::Identity | Transformation::Boolean { .. })
            }
            (ValueType::String, ValueType::String) | (ValueType::Binary, ValueType::Binary) => {
                *transformation == Transformation::Identity
            }
            _ => {
                return Err(wrong(format!("{} as {}", self.type_name(from), self.name(from))));
            }
        };
        if fits {
            return Ok(());
        }
        Err(wrong(format!("the type that its transformation is for: {transformation:?}")))
    }

    /// Returns the name of the type of a variable in the FMI version of its FMU.
    pub(crate) fn type_name(&self, port: Port) -> &'static str {
        let description = self.slaves[port.slave].1.description();
        self.variable(port).kind.element_in(description.version())
    }
}
