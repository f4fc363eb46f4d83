//! Decodes the bytes of an XML file.

use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};
use quick_xml::events::Event;
use quick_xml::reader::Reader;

use crate::defect::{ParseError, Position, Warning};

/// Length of the part that is searched for an XML declaration.
const DECLARATION: usize = 256;

/// Returns the text of an XML file, and a warning unless it is UTF-8 without a byte order mark, which FMI requires.
///
/// # Errors
///
/// [`ParseError::Encoding`] for an unknown encoding, and for bytes that the encoding does not have.
pub(crate) fn decode(bytes: &[u8]) -> Result<(Cow<'_, str>, Option<Warning>), ParseError> {
    if let Some((encoding, mark)) = Encoding::for_bom(bytes) {
        let rest = &bytes[mark..];
        if encoding == UTF_8 {
            return Ok((utf8(rest)?, Some(encoding_warning("a byte order mark".to_owned()))));
        }
        return decode_as(rest, encoding, encoding.name());
    }
    // Without a byte order mark, the first character "<" distinguishes the two forms of UTF-16.
    match bytes {
        [b'<', 0, ..] => return decode_as(bytes, UTF_16LE, UTF_16LE.name()),
        [0, b'<', ..] => return decode_as(bytes, UTF_16BE, UTF_16BE.name()),
        _ => {}
    }
    let Some(declared) = declared(bytes) else {
        return Ok((utf8(bytes)?, None));
    };
    match Encoding::for_label(declared.as_bytes()) {
        Some(encoding) if encoding == UTF_8 => Ok((utf8(bytes)?, None)),
        // `for_label` reads ASCII as windows-1252, but ASCII is a part of UTF-8.
        _ if declared.eq_ignore_ascii_case("us-ascii")
            || declared.eq_ignore_ascii_case("ascii") =>
        {
            Ok((utf8(bytes)?, Some(encoding_warning(format!("encoding {declared:?}")))))
        }
        // A file that declares UTF-16 in single bytes is not UTF-16.
        Some(encoding) if encoding != UTF_16LE && encoding != UTF_16BE => {
            decode_as(bytes, encoding, &declared)
        }
        _ => Err(ParseError::Encoding { actual: format!("encoding {declared:?}") }),
    }
}

/// Decodes bytes in another encoding than UTF-8, with a warning that states `name`: `encoding` is often a larger one,
/// such as windows-1252 for ISO-8859-1.
fn decode_as<'a>(
    bytes: &'a [u8],
    encoding: &'static Encoding,
    name: &str,
) -> Result<(Cow<'a, str>, Option<Warning>), ParseError> {
    let actual = format!("encoding {name:?}");
    let text = encoding.decode_without_bom_handling_and_without_replacement(bytes);
    let text = text.ok_or_else(|| ParseError::Encoding {
        actual: format!("{actual} with bytes that it does not have"),
    })?;
    Ok((text, Some(encoding_warning(actual))))
}

/// Returns the warning about a file that is not UTF-8 without a byte order mark.
fn encoding_warning(actual: String) -> Warning {
    Warning {
        at: Position::START,
        place: "the file".to_owned(),
        expected: "UTF-8 without a byte order mark".to_owned(),
        actual,
        assumed: "it was read as what it is".to_owned(),
        section: "2.2",
        by_schema: false,
    }
}

/// Checks that bytes are UTF-8.
fn utf8(bytes: &[u8]) -> Result<Cow<'_, str>, ParseError> {
    std::str::from_utf8(bytes).map(Cow::Borrowed).map_err(|error| {
        let at = error.valid_up_to();
        let line = bytes[..at].split(|byte| *byte == b'\n').count();
        let actual = format!("a byte 0x{:02x} that is not UTF-8 in line {line}", bytes[at]);
        ParseError::Encoding { actual }
    })
}

/// Returns the encoding in the XML declaration, if there is one in the first 256 bytes.
fn declared(bytes: &[u8]) -> Option<String> {
    let start = &bytes[..bytes.len().min(DECLARATION)];
    let end = start.windows(2).position(|pair| pair == b"?>")? + 2;
    let mut reader = Reader::from_str(std::str::from_utf8(&start[..end]).ok()?);
    match reader.read_event() {
        Ok(Event::Decl(declaration)) => declaration.encoding()?.ok().map(Cow::into_owned),
        _ => None,
    }
}
