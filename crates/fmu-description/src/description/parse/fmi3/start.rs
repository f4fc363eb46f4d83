//! Reads the start values of variables and arrays of FMI 3.0.

use super::kinds::rounding;
use crate::description::parse::attributes::{Node, Result, integer};
use crate::description::parse::structure::words;
use crate::description::{Elements, Kind, Version};
use crate::hex::from_hex;

/// Reads `start`, or the elements `Start` of a String or Binary. A single value becomes the start of
/// `kind`; several values are returned. A Clock has none.
pub(super) fn read(element: Node<'_>, kind: &mut Kind) -> Result<Option<Elements>> {
    let range = kind.integer_range(Version::V3);
    if let (Some(integer_type), Some(range)) = (kind.as_integer_mut(), range) {
        let values = list(
            element,
            |text| integer(text).filter(|value| range.contains(value)),
            || format!("integers from {} to {}", range.start(), range.end()),
        )?;
        return Ok(single(values, |value| integer_type.start = Some(value)).map(Elements::Integer));
    }
    let round = rounding(kind);
    if let Some(real_type) = kind.as_real_mut() {
        // `parse` reads `INF`, `-INF` and `NaN` of XML Schema.
        let number = |text: &str| text.parse().ok().map(round);
        let values = list(element, number, || "numbers".to_owned())?;
        return Ok(single(values, |value| real_type.start = Some(value)).map(Elements::Real));
    }
    Ok(match kind {
        Kind::Boolean(start) => {
            let values = list(element, boolean, || "true, false, 1 or 0".to_owned())?;
            single(values, |value| *start = Some(value)).map(Elements::Boolean)
        }
        Kind::String(start) => {
            let values = texts(element).map(str::to_owned).collect();
            single(values, |value| *start = Some(value)).map(Elements::String)
        }
        Kind::Binary(binary_type) => {
            let wrong = |text| element.wrong("value", "pairs of hexadecimal digits", text);
            let digits = |text: &str| text.split_ascii_whitespace().collect::<String>();
            let bytes =
                texts(element).map(|text| from_hex(&digits(text)).ok_or_else(|| wrong(text)));
            let values = bytes.collect::<Result<_>>()?;
            single(values, |value| binary_type.start = Some(value)).map(Elements::Binary)
        }
        _ => None,
    })
}

/// Returns several values; passes a single one to `set` and returns `None`.
fn single<T>(mut values: Vec<T>, set: impl FnOnce(T)) -> Option<Vec<T>> {
    if values.len() > 1 {
        return Some(values);
    }
    values.pop().map(set);
    None
}

/// Reads the attribute `start` as a list of values between white space; empty if it is missing or, with a warning,
/// if it has no value.
fn list<T>(
    element: Node<'_>,
    value: impl Fn(&str) -> Option<T>,
    expected: impl Fn() -> String,
) -> Result<Vec<T>> {
    let Some(text) = element.attribute("start") else { return Ok(Vec::new()) };
    let wrong = |word| element.wrong("start", &expected(), word);
    let values = words(text).map(|word| value(word).ok_or_else(|| wrong(word)));
    let values: Vec<T> = values.collect::<Result<_, _>>()?;
    if values.is_empty() {
        element.warn("start", &expected(), text, "read as if it were not there");
    }
    Ok(values)
}

fn boolean(text: &str) -> Option<bool> {
    match text.to_ascii_lowercase().as_str() {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

/// Returns the value of each element `Start`, an empty text if the attribute `value` is missing.
fn texts(element: Node<'_>) -> impl Iterator<Item = &str> {
    element.children_named("Start").map(|start| start.attribute("value").unwrap_or_default())
}
