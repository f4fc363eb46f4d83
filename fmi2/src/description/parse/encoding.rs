//! Bytes to text.

use std::borrow::Cow;

use quick_xml::events::Event;
use quick_xml::reader::Reader;

use super::ParseError;

/// Longest XML declaration that is looked at.
const DECLARATION: usize = 256;

/// The text of an XML file in UTF-8, or in ISO-8859-1 if it says so.
pub(super) fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, ParseError> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(ParseError::Encoding { found: "the byte order mark of UTF-16".to_owned() });
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let declared = declared(bytes).unwrap_or_else(|| "UTF-8".to_owned());
    match declared.to_ascii_lowercase().as_str() {
        "utf-8" | "utf8" | "us-ascii" | "ascii" => utf8(bytes),
        "iso-8859-1" | "latin1" | "latin-1" => {
            Ok(bytes.iter().map(|byte| char::from(*byte)).collect::<String>().into())
        }
        _ => Err(ParseError::Encoding { found: format!("encoding {declared:?}") }),
    }
}

fn utf8(bytes: &[u8]) -> Result<Cow<'_, str>, ParseError> {
    std::str::from_utf8(bytes).map(Cow::Borrowed).map_err(|error| {
        let at = error.valid_up_to();
        let line = bytes[..at].split(|byte| *byte == b'\n').count();
        let found = format!("a byte 0x{:02x} that is not UTF-8 in line {line}", bytes[at]);
        ParseError::Encoding { found }
    })
}

/// The encoding in the XML declaration, if there is one.
fn declared(bytes: &[u8]) -> Option<String> {
    let start = &bytes[..bytes.len().min(DECLARATION)];
    let end = start.windows(2).position(|pair| pair == b"?>")? + 2;
    let mut reader = Reader::from_str(std::str::from_utf8(&start[..end]).ok()?);
    match reader.read_event() {
        Ok(Event::Decl(declaration)) => {
            declaration.encoding()?.ok().map(std::borrow::Cow::into_owned)
        }
        _ => None,
    }
}
