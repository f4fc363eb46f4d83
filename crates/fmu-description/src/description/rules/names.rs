//! Rules on variable names (sections 2.2.7 and 2.2.9).

use std::collections::HashSet;

use super::Problems;
use crate::description::Version;

pub(super) fn check(problems: &mut Problems<'_>) {
    let description = problems.description;
    let section = problems.sections.names;
    let names = || description.variables.iter().map(|variable| variable.name.as_str());
    problems.unique(problems.sections.variables, "variable", names());
    for name in names() {
        problems.demand(!name.is_empty(), section, || "a variable has no name".to_owned());
        problems.line(section, "variable", name);
    }
    if !description.structured_names {
        return;
    }
    for variable in &description.variables {
        let name = &variable.name;
        problems.demand(is_structured_name(name), section, || {
            format!("variable {name:?} is not a structured name")
        });
        let real = variable.kind.as_real().is_some();
        problems.demand(real || !name.starts_with("der("), section, || {
            format!("variable {name} is named as a derivative and is not Real")
        });
    }
    // In FMI 3.0 an array is one variable, and names with indices need no order.
    if problems.version == Version::V2 {
        for (_, text) in misplaced_elements(names()) {
            problems.add(section, text);
        }
    }
}

/// Returns the positions, counted from 0, of the names that break the order of array elements (FMI 2.0.5,
/// section 2.2.9), each with the reason: the elements of an array are adjacent, with the last index running
/// fastest. Only arrays of scalars are checked: names with indices at their end. Missing elements are allowed.
pub fn misplaced_elements<'a>(names: impl Iterator<Item = &'a str>) -> Vec<(usize, String)> {
    let mut misplaced = Vec::new();
    let mut arrays = HashSet::new();
    let mut last: Option<(&str, Vec<u32>)> = None;
    for (position, name) in names.enumerate() {
        let Some((array, indices)) = array_element(name) else {
            last = None;
            continue;
        };
        let text = match &last {
            Some((other, before)) if *other == array => (*before >= indices)
                .then(|| format!("variable {name} does not follow in row-major order")),
            _ => (!arrays.insert(array)).then(|| {
                format!("variable {name} stands apart from the other elements of {array}")
            }),
        };
        misplaced.extend(text.map(|text| (position, text)));
        last = Some((array, indices));
    }
    misplaced
}

/// Splits `a.b[1,2]` into `a.b` and its indices; `None` if the name does not end in indices, or has more before.
#[must_use]
pub fn array_element(name: &str) -> Option<(&str, Vec<u32>)> {
    let (array, indices) = name.strip_suffix(']')?.split_once('[')?;
    let indices = indices.split(',').map(str::parse).collect::<Result<_, _>>().ok()?;
    Some((array, indices))
}

/// Returns whether `name` follows the convention of structured names (FMI 2.0.5, section 2.2.9):
/// `name = identifier | "der(" identifier [ "," unsignedInteger ] ")"`.
#[must_use]
pub fn is_structured_name(name: &str) -> bool {
    let derivative = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')'));
    let Some(inner) = derivative else {
        return is_identifier(name);
    };
    let with_order = inner.rsplit_once(',').is_some_and(|(identifier, order)| {
        is_unsigned(order.trim_start_matches(' ')) && is_identifier(identifier)
    });
    with_order || is_identifier(inner)
}

/// Whether the text is `identifier = B-name [ indices ] { "." B-name [ indices ] }`.
fn is_identifier(text: &str) -> bool {
    let mut rest = text;
    loop {
        let Some(after) = after_name(rest) else {
            return false;
        };
        let Some(after) = after_indices(after) else {
            return false;
        };
        match after.strip_prefix('.') {
            Some(next) => rest = next,
            None => return after.is_empty(),
        }
    }
}

/// Returns the rest after a `B-name`, which is plain or in apostrophes; `None` if `text` does not start with one.
fn after_name(text: &str) -> Option<&str> {
    let Some(quoted) = text.strip_prefix('\'') else {
        let is_letter = |character: char| character.is_ascii_alphanumeric() || character == '_';
        let length = text.find(|character| !is_letter(character)).unwrap_or(text.len());
        let starts =
            text.starts_with(|character: char| is_letter(character) && !character.is_ascii_digit());
        return starts.then(|| &text[length..]);
    };
    let mut characters = quoted.char_indices();
    while let Some((at, character)) = characters.next() {
        match character {
            '\'' => return (at > 0).then(|| &quoted[at + 1..]),
            '\\' => {
                characters.next().filter(|(_, escaped)| "'\"?\\abfnrtv".contains(*escaped))?;
            }
            _ if character.is_ascii_alphanumeric() => {}
            _ if "_!#$%&()*+,-./:;<>=?@[]^{}|~ ".contains(character) => {}
            _ => return None,
        }
    }
    None
}

/// Returns the rest after the optional `[ unsignedInteger { "," unsignedInteger } ]`; `None` for other content in
/// brackets.
fn after_indices(text: &str) -> Option<&str> {
    let Some(inner) = text.strip_prefix('[') else {
        return Some(text);
    };
    let (indices, after) = inner.split_once(']')?;
    indices.split(',').all(is_unsigned).then_some(after)
}

fn is_unsigned(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}
