//! Strings as bytes: for each string its length in eight bytes (little endian), then its bytes.

/// Encodes `values`.
pub(super) fn write(values: &[String]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for value in values {
        bytes.extend_from_slice(&(value.len() as u64).to_le_bytes());
        bytes.extend_from_slice(value.as_bytes());
    }
    bytes
}

/// Decodes `bytes` into `values`; `None` if `bytes` holds another number of strings.
pub(super) fn read(mut bytes: &[u8], values: &mut [String]) -> Option<()> {
    for value in values {
        let (length, rest) = bytes.split_first_chunk()?;
        let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
        let (text, rest) = rest.split_at_checked(length)?;
        value.clear();
        value.push_str(&String::from_utf8_lossy(text));
        bytes = rest;
    }
    bytes.is_empty().then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_pass_and_other_bytes_are_refused() {
        let sent = ["", "a b", "Größe\n"].map(str::to_owned);
        let bytes = write(&sent);
        let mut found = ["x", "y", "z"].map(str::to_owned);
        assert_eq!(read(&bytes, &mut found), Some(()));
        assert_eq!(found, sent);
        for length in 0..bytes.len() {
            assert_eq!(read(&bytes[..length], &mut found), None, "{length}");
        }
        assert_eq!(read(&[255; 30], &mut found), None);
        assert_eq!(read(&bytes, &mut found[..2]), None);
    }
}
