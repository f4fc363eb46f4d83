//! Reads the parts that several versions of FMI write in the same way: the attributes of the root element, units, log
//! categories, the default experiment.

use super::attributes::{Node, Result};
use crate::description::{DefaultExperiment, LogCategory, ModelDescription, Version};
use crate::unit::{BaseUnit, DisplayUnit, Unit};

/// Reads the attributes of the root element that mean the same in every version; `model_name` replaces a missing
/// `modelName`, with a warning.
pub(super) fn general(root: Node<'_>, model_name: String) -> ModelDescription {
    let version = root.warnings.version;
    let model_name = root.text_or("modelName", model_name);
    let structured_names = structured_names(root);
    ModelDescription {
        fmi_version: version.as_str().to_owned(),
        model_name,
        description: root.text("description"),
        author: root.text("author"),
        version: root.text("version"),
        generation_tool: root.text("generationTool"),
        generation_date_and_time: root.text("generationDateAndTime"),
        structured_names,
        number_of_event_indicators: match version {
            Version::V1 | Version::V2 => root.optional_unsigned("numberOfEventIndicators"),
            Version::V3 => None,
        },
        ..ModelDescription::default()
    }
}

/// Reads the common part of the root elements of FMI 2.0 and 3.0; `model_name` as for [`general`].
pub(super) fn common(root: Node<'_>, model_name: String) -> Result<ModelDescription> {
    // Read before the lists below, because only the first warnings are kept.
    let general = general(root, model_name);
    Ok(ModelDescription {
        copyright: root.text("copyright"),
        license: root.text("license"),
        units: root.list("UnitDefinitions", "Unit", unit)?,
        log_categories: root.list("LogCategories", "Category", category)?,
        default_experiment: root.optional("DefaultExperiment", experiment)?,
        ..general
    })
}

fn structured_names(root: Node<'_>) -> bool {
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

fn unit(element: Node<'_>) -> Result<Unit> {
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
        display_units: display_units.collect::<Result<_>>()?,
        base: element.optional("BaseUnit", base_unit)?,
    })
}

fn base_unit(element: Node<'_>) -> Result<BaseUnit> {
    let mut exponents = [0; 8];
    for (exponent, name) in exponents.iter_mut().zip(BaseUnit::EXPONENTS) {
        *exponent = element.integer(name)?.unwrap_or(0);
    }
    let (factor, offset) = (element.finite("factor", 1.0)?, element.finite("offset", 0.0)?);
    Ok(BaseUnit::from_exponents(exponents, factor, offset))
}

fn category(element: Node<'_>) -> Result<LogCategory> {
    let name = element.required("name")?.to_owned();
    Ok(LogCategory { name, description: element.text("description") })
}

pub(super) fn experiment(element: Node<'_>) -> Result<DefaultExperiment> {
    Ok(DefaultExperiment {
        start_time: element.number("startTime")?,
        stop_time: element.number("stopTime")?,
        tolerance: element.number("tolerance")?,
        step_size: element.number("stepSize")?,
    })
}
