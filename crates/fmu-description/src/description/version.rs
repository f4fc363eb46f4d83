//! The versions of FMI.

use std::fmt;

use super::ModelDescription;

/// A version of FMI, as importers and exporters distinguish them: the C interface and the schema of
/// `modelDescription.xml` differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Version {
    /// FMI 1.0.
    V1,
    /// FMI 2.0 with all its bug-fix releases.
    V2,
    /// FMI 3.0 with all its bug-fix releases.
    V3,
}

impl Version {
    /// Returns the value of `fmiVersion`.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Version::V1 => "1.0",
            Version::V2 => "2.0",
            Version::V3 => "3.0",
        }
    }

    /// Returns the release of the standard whose section numbers this crate states.
    #[must_use]
    pub fn release(self) -> &'static str {
        match self {
            Version::V1 => "FMI 1.0",
            Version::V2 => "FMI 2.0.5",
            Version::V3 => "FMI 3.0.2",
        }
    }
}

impl fmt::Display for Version {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}

impl ModelDescription {
    /// Returns the version of FMI by the first character of `fmi_version`; [`Version::V2`] if this character is neither
    /// 1 nor 3, or if `fmi_version` is empty.
    #[must_use]
    pub fn version(&self) -> Version {
        match self.fmi_version.bytes().next() {
            Some(b'1') => Version::V1,
            Some(b'3') => Version::V3,
            _ => Version::V2,
        }
    }
}
