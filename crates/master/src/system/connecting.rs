//! Checks of a connection: causality, type, unit, transformation.

use fmu_description::{Causality, Kind};

use super::{Connection, Port, System, units};
use crate::error::SystemError;
use slave::Transformation;

impl System {
    /// Connects an output to an input, or an output or calculated parameter to a parameter. A
    /// parameter receives its value in initialization mode. If `units_settled` is true,
    /// `transformation` already includes the conversion of units; otherwise different units are
    /// converted.
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
        if !(to_parameter && self.variable(from).causality == Causality::CalculatedParameter) {
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
            self.initial.iter().find(|known| known.to == to)
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
            self.sources.insert(to, self.connections.len());
            self.connections.push(connection);
        }
        Ok(())
    }

    fn expect_causality(&self, port: Port, expected: Causality) -> Result<(), SystemError> {
        let found = self.variable(port).causality;
        if found == expected {
            return Ok(());
        }
        Err(SystemError::Role {
            name: self.name(port),
            found: format!("a variable of causality {}", found.as_str()),
            expected: expected.as_str().to_owned(),
        })
    }

    /// Checks the types: equal types, Integer and Enumeration, or Integer to Real, with a
    /// transformation for this type.
    fn expect_fitting_types(
        &self,
        from: Port,
        to: Port,
        transformation: &Transformation,
    ) -> Result<(), SystemError> {
        use Kind::{Boolean, Enumeration, Integer, Real, String};
        let (source, target) = (&self.variable(from).kind, &self.variable(to).kind);
        let fits = match (source, target) {
            (Real(_) | Integer(_) | Enumeration(_), Real(_)) => {
                matches!(transformation, Transformation::Identity | Transformation::Linear { .. })
            }
            (Integer(_) | Enumeration(_), Integer(_) | Enumeration(_)) => {
                matches!(transformation, Transformation::Identity | Transformation::Integer(_))
            }
            (Boolean(_), Boolean(_)) => {
                matches!(transformation, Transformation::Identity | Transformation::Boolean { .. })
            }
            (String(_), String(_)) => *transformation == Transformation::Identity,
            _ => {
                return Err(SystemError::Role {
                    name: self.name(to),
                    found: format!("a variable of type {}", target.element()),
                    expected: format!("{} as {}", source.element(), self.name(from)),
                });
            }
        };
        if fits {
            return Ok(());
        }
        Err(SystemError::Role {
            name: self.name(to),
            found: format!("a variable of type {}", target.element()),
            expected: format!("the type that its transformation is for: {transformation:?}"),
        })
    }
}
