//! Parses XML into a model description.

mod attributes;
mod definitions;
mod fmi1;
mod fmi2;
mod fmi3;
mod schema;
mod structure;
mod variables;
mod warning;

use super::{ModelDescription, Version};
use crate::defect::{ParseError, Warning};
use crate::limits::exceeds;
use crate::xml::tree::{self, Element};
use crate::xml::{MOST_BYTES, encoding};
use attributes::{Node, WHITE_SPACE};
use warning::Warnings;

impl ModelDescription {
    /// Maximum size in bytes of a file that is read, unless [`crate::limits`] are lifted.
    pub const MOST_BYTES: usize = MOST_BYTES;

    /// Reads `modelDescription.xml` as [`ModelDescription::read`] does, without warnings.
    ///
    /// # Errors
    ///
    /// Same as [`ModelDescription::read`].
    ///
    /// ```
    /// use fmu_description::ModelDescription;
    /// let error = ModelDescription::parse(r#"<fmiModelDescription fmiVersion="4.0"/>"#);
    /// assert_eq!(
    ///     error.expect_err("another version").to_string(),
    ///     "line 1, column 1: expected fmiVersion 1.0, 2.0 or 3.0, found \"4.0\""
    /// );
    /// ```
    pub fn parse(xml: impl AsRef<[u8]>) -> Result<ModelDescription, ParseError> {
        Self::read(xml).map(|(description, _)| description)
    }

    /// Reads `modelDescription.xml` of FMI 1.0, 2.0 or 3.0; returns warnings for content that breaks the standard.
    ///
    /// Fills in the defaults of the standard: `causality` local, `variability` by version and type, and for a variable
    /// with `declaredType` the attributes of the declared type that the variable does not state itself. Skips
    /// annotations.
    ///
    /// FMI 3.0: value references in `derivative`, `previous`, `clocks` and `ModelStructure` become indices; each
    /// `Alias` becomes a variable after the variable that contains it.
    ///
    /// FMI 1.0: `internal` and `none` become local. A variable with variability `parameter` becomes a parameter or,
    /// without start value, a calculated parameter; but an output stays an output. `fixed` of an output or local
    /// variable becomes `initial`, and `DirectDependency` becomes the dependencies of an output.
    ///
    /// Content that breaks the standard gives a [`Warning`], which states the assumption made, if
    /// the meaning for a simulation is clear or other importers accept it: other encodings,
    /// `fmiVersion` 2.0.x, unknown elements and attributes, wrong order, words in another case,
    /// unknown words, flags, types and dependencies, numbers that are infinite or empty. Content
    /// that would mislead a simulation is an error: missing required attributes, a `modelIdentifier`
    /// that is a path, numbers that are malformed or too large, value references that two inputs or
    /// parameters share, a name of two variables unless both are local or have one value, types that
    /// refer to types. [`ModelDescription::problems`] checks further rules.
    ///
    /// [Limits](crate::limits): 512 MiB, 4,000,000 elements, 12,000,000 attributes, 256 attributes of an
    /// element, 64 levels, 1,000,000 variables, 128 MiB of texts and lists that aliases inherit. Cost: linear
    /// in the length of the file. At most 1000 warnings are kept; one more states that there are others.
    ///
    /// # Errors
    ///
    /// [`ParseError`] with line and column, expected and actual content.
    pub fn read(xml: impl AsRef<[u8]>) -> Result<(ModelDescription, Vec<Warning>), ParseError> {
        let bytes = xml.as_ref();
        if exceeds(bytes.len(), Self::MOST_BYTES) {
            return Err(ParseError::Length { limit: Self::MOST_BYTES });
        }
        let (text, not_utf8) = encoding::decode(bytes)?;
        let element = tree::read(&text)?;
        let version = version(&element)?;
        let warnings = Warnings::new(version);
        let root = Node { element: &element, warnings: &warnings };
        let description = match version {
            Version::V1 => fmi1::root(root)?,
            Version::V2 => fmi2::root(root)?,
            Version::V3 => fmi3::root(root)?,
        };
        let mut warnings = warnings.finish();
        let section = if version == Version::V3 { "2.4" } else { "2.2" };
        // FMI 1.0 requires no particular encoding.
        let not_utf8 = not_utf8.filter(|_| version != Version::V1);
        warnings.splice(0..0, not_utf8.map(|warning| Warning { section, ..warning }));
        Ok((description, warnings))
    }
}

/// Returns the version of FMI that the root element states. 2.0.x is read as 2.0 and every 3.x as 3.0: these are
/// versions of the standard's text, and importers of 2.0 and 3.0 run their FMUs.
fn version(root: &Element<'_>) -> Result<Version, ParseError> {
    if root.name != "fmiModelDescription" {
        return Err(ParseError::Element {
            at: root.at,
            element: root.name.to_owned(),
            expected: "the root element fmiModelDescription".to_owned(),
            actual: format!("<{}>", root.name),
        });
    }
    let stated = root.attributes.iter().find(|(name, _)| *name == "fmiVersion");
    let Some((_, text)) = stated else {
        return Err(ParseError::Attribute {
            at: root.at,
            element: root.name.to_owned(),
            attribute: "fmiVersion",
            expected: "a value".to_owned(),
            actual: "no such attribute".to_owned(),
        });
    };
    let trimmed = text.trim_matches(WHITE_SPACE);
    let is_patch = |rest: &str| {
        let patch = rest.strip_prefix('.').unwrap_or(rest);
        patch.len() <= 3 && patch.bytes().all(|digit| digit.is_ascii_digit())
    };
    match trimmed.split_at_checked(2) {
        Some(("1.", "0")) => Ok(Version::V1),
        Some(("2.", _)) if trimmed.strip_prefix("2.0").is_some_and(is_patch) => Ok(Version::V2),
        Some(("3.", minor)) if minor.starts_with(|character: char| character.is_ascii_digit()) => {
            Ok(Version::V3)
        }
        _ => Err(ParseError::Version { at: root.at, actual: text.clone().into_owned() }),
    }
}

#[cfg(test)]
mod tests;
