//! Binaries as hexadecimal digits.

/// Returns the bytes as hexadecimal digits, as a model description writes a Binary (FMI 3.0.2, section
/// 2.4.7.8).
#[must_use]
pub fn to_hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        // Writing to a String does not fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// Returns the bytes that `text` states, two hexadecimal digits for each; `None` if another character occurs or if the
/// number of digits is odd.
#[must_use]
pub fn from_hex(text: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| char::from(byte).to_digit(16);
    let pairs = text.as_bytes().chunks(2).map(|pair| match *pair {
        [high, low] => u8::try_from(16 * digit(high)? + digit(low)?).ok(),
        _ => None,
    });
    pairs.collect()
}
