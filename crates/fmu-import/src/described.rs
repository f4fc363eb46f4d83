//! The model description that the library of a model generates.

use std::path::Path;

use fmu_description::{ModelDescription, ParseError, Version};

use crate::error::LoadError;
use crate::library::describe_as;

/// Why a library has no usable generated model description.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum DescriptionError {
    /// The library does not load, or does not generate a model description.
    #[error("the library of {name} does not describe itself")]
    None { name: String, source: LoadError },
    /// The generated text is not a model description.
    #[error("the model description of {name}")]
    Unreadable { name: String, source: ParseError },
    /// The description breaks rules of the standard, or was read with warnings.
    #[error("the variables of {name} break rules of {}:\n{}", version.release(), problems.join("\n"))]
    Rules {
        version: Version,
        name: String,
        /// The warnings and the broken rules, each with its section of the standard.
        problems: Vec<String>,
    },
}

/// Returns the model description that the library at `file` generates, as XML and as data: of FMI 3.0 if `version` is
/// [`Version::V3`], otherwise of FMI 2.0. The crate `fmu` must have exported the library. `resources` is the folder of
/// the library's resources; messages use `name`.
///
/// # Errors
///
/// [`DescriptionError`] if the library does not load, or generates no description, an unreadable one, or one that
/// breaks rules of the standard.
pub fn described_as(
    file: &Path,
    resources: &Path,
    name: &str,
    version: Version,
) -> Result<(String, ModelDescription), DescriptionError> {
    let xml = describe_as(file, resources, version)
        .map_err(|source| DescriptionError::None { name: name.to_owned(), source })?;
    let (description, warnings) = ModelDescription::read(xml.as_bytes())
        .map_err(|source| DescriptionError::Unreadable { name: name.to_owned(), source })?;
    let warnings = warnings.iter().map(ToString::to_string);
    let rules = description.problems();
    let problems: Vec<String> = warnings.chain(rules.iter().map(ToString::to_string)).collect();
    if problems.is_empty() {
        Ok((xml, description))
    } else {
        Err(DescriptionError::Rules { version, name: name.to_owned(), problems })
    }
}
