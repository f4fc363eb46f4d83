//! Reads what FMI 2.0 and 3.0 write in the same way: units, log categories, the default experiment.

use super::attributes::Node;
use crate::defect::ParseError;
use crate::description::{DefaultExperiment, LogCategory, Version};
use crate::unit::{BaseUnit, DisplayUnit, Unit};

pub(super) fn structured_names(root: Node<'_>) -> bool {
    const NAME: &str = "variableNamingConvention";
    match root.attribute(NAME) {
        None | Some("flat") => false,
        Some("structured") => true,
        Some(other) => {
            root.warn(NAME, "flat or structured", other, "read as flat");
            false
        }
    }
}

pub(super) fn unit(element: Node<'_>) -> Result<Unit, ParseError> {
    let display_units = element.children_named("DisplayUnit").map(|display| {
        Ok(DisplayUnit {
            name: display.required("name")?.to_owned(),
            factor: display.finite("factor", 1.0)?,
            offset: display.finite("offset", 0.0)?,
            inverse: element.warnings.version == Version::V3 && display.flag("inverse"),
        })
    });
    Ok(Unit {
        name: element.required("name")?.to_owned(),
        display_units: display_units.collect::<Result<_, ParseError>>()?,
        base: element.optional_child("BaseUnit")?.map(base_unit).transpose()?,
    })
}

fn base_unit(element: Node<'_>) -> Result<BaseUnit, ParseError> {
    let mut exponents = [0; 8];
    for (exponent, name) in exponents.iter_mut().zip(BaseUnit::EXPONENTS) {
        *exponent = element.integer(name)?.unwrap_or(0);
    }
    let (factor, offset) = (element.finite("factor", 1.0)?, element.finite("offset", 0.0)?);
    Ok(BaseUnit::from_exponents(exponents, factor, offset))
}

pub(super) fn category(element: Node<'_>) -> Result<LogCategory, ParseError> {
    let name = element.required("name")?.to_owned();
    Ok(LogCategory { name, description: element.text("description") })
}

pub(super) fn experiment(element: Node<'_>) -> Result<DefaultExperiment, ParseError> {
    Ok(DefaultExperiment {
        start_time: element.number("startTime")?,
        stop_time: element.number("stopTime")?,
        tolerance: element.number("tolerance")?,
        step_size: element.number("stepSize")?,
    })
}
