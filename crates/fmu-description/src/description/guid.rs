//! The GUID as a hash of the model description.

use std::fmt::{self, Display, Formatter};

use sha2::{Digest, Sha256};

use super::ModelDescription;

/// The GUID of an FMU: the first 128 bits of the SHA-256 of its serialised description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guid(pub [u8; 16]);

impl Guid {
    /// Hashes everything in `description` except `guid`, `terminals` and `is_bus_simulation`. Descriptions with different
    /// `modelDescription.xml`, apart from `guid`, have different results.
    ///
    /// Uses the crate postcard, which takes a tenth of the time of XML, because each `fmi2Instantiate` needs the result.
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
    /// Formats the GUID as `{xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx}`.
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str("{")?;
        for (index, byte) in self.0.iter().enumerate() {
            let dash = if matches!(index, 4 | 6 | 8 | 10) { "-" } else { "" };
            write!(formatter, "{dash}{byte:02x}")?;
        }
        formatter.write_str("}")
    }
}
