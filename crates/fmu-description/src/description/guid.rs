//! The GUID as a hash of the model description.

use std::fmt::{self, Display, Formatter};

use sha2::{Digest, Sha256};

use super::ModelDescription;

/// The GUID of an FMU: the first 128 bits of the SHA-256 of its description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guid(pub [u8; 16]);

impl Guid {
    /// The hash of everything in `description` but its `guid`.
    ///
    /// # Panics
    ///
    /// Never: plain data can always be serialised.
    #[must_use]
    pub fn of(description: &ModelDescription) -> Self {
        let form = postcard::to_stdvec(description).expect("plain data has a serialized form");
        let hash = Sha256::digest(form);
        Self(std::array::from_fn(|index| hash[index]))
    }
}

impl Display for Guid {
    /// `{xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx}`.
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str("{")?;
        for (index, byte) in self.0.iter().enumerate() {
            let dash = if matches!(index, 4 | 6 | 8 | 10) { "-" } else { "" };
            write!(formatter, "{dash}{byte:02x}")?;
        }
        formatter.write_str("}")
    }
}

impl ModelDescription {
    /// A `guid` that follows from everything else in the description: the first 128 bits of the
    /// SHA-256 of its serialized form, as `{xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx}`.
    ///
    /// The form is postcard's, which takes a tenth of the time of the XML: each `fmi2Instantiate`
    /// makes it. Two descriptions that differ in anything but `guid` have different results.
    #[must_use]
    pub fn content_guid(&self) -> String {
        Guid::of(self).to_string()
    }
}
