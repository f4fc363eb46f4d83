//! An amount of memory.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::from_toml::from_toml;

const EXPECTED: &str = "a number of bytes, or one with a unit, for example 512MiB or 2GiB";
/// Names of units, with their size in bytes.
const UNITS: [(&str, u64); 8] = [
    ("kB", 1000),
    ("MB", 1_000_000),
    ("GB", 1_000_000_000),
    ("KiB", 1 << 10),
    ("kiB", 1 << 10),
    ("MiB", 1 << 20),
    ("GiB", 1 << 30),
    ("TiB", 1 << 40),
];

/// A number of bytes, at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory(pub u64);

impl FromStr for Memory {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("expected {EXPECTED}, found {text:?}");
        let unit = UNITS.iter().find_map(|(name, size)| Some((text.strip_suffix(name)?, *size)));
        let (number, size) = unit.unwrap_or((text, 1));
        let number: u64 = number.trim_end().parse().map_err(|_| wrong())?;
        let bytes = number.checked_mul(size).filter(|bytes| *bytes > 0).ok_or_else(wrong)?;
        Ok(Self(bytes))
    }
}

impl fmt::Display for Memory {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let units = UNITS.iter().filter(|(name, _)| name.ends_with("iB") && *name != "kiB").rev();
        match units.into_iter().find(|(_, size)| self.0.is_multiple_of(*size)) {
            Some((name, size)) => write!(formatter, "{}{name}", self.0 / size),
            None => write!(formatter, "{}", self.0),
        }
    }
}

impl Serialize for Memory {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

from_toml! {
    Memory, EXPECTED;
    visit_i64(bytes: i64) => bytes.to_string().parse();
    visit_u64(bytes: u64) => bytes.to_string().parse();
    visit_str(text: &str) => text.parse();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_amount_is_bytes_or_has_a_unit_and_is_written_so_that_it_reads_back() {
        for (text, bytes) in [
            ("1", 1),
            ("1000000", 1_000_000),
            ("2GiB", 2_147_483_648),
            ("512 MiB", 536_870_912),
            ("3kB", 3000),
            ("1TiB", 1_099_511_627_776),
        ] {
            let memory: Memory = text.parse().unwrap();
            assert_eq!(memory.0, bytes, "{text}");
            assert_eq!(memory.to_string().parse::<Memory>().unwrap(), memory, "{memory}");
        }
        assert_eq!(Memory(1 << 31).to_string(), "2GiB");
        for wrong in
            ["", "0", "-1", "2 gigabytes", "GiB", "1.5GiB", "99999999999999999999", "20000000TiB"]
        {
            let error = wrong.parse::<Memory>().unwrap_err();
            assert!(error.contains("512MiB") && error.contains(wrong), "{error}");
        }
    }
}
