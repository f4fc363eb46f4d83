//! Suggestions of similar names for error messages about an unknown name.

use strsim::levenshtein;

use crate::ModelDescription;

/// Maximum edit distance of two similar names.
const EDITS: usize = 2;

/// Returns the names of up to five variables similar to `name` ([`among`]) as the end of a message, `, it has a, b`;
/// empty if there are none.
#[must_use]
pub fn nearest(description: &ModelDescription, name: &str) -> String {
    let names = description.variables.iter().map(|known| known.name.as_str());
    let similar = among(names, name);
    if similar.is_empty() { String::new() } else { format!(", it has {}", similar.join(", ")) }
}

/// Returns the five most similar of those `names` that contain `name`, are contained in `name`, or have an edit
/// distance of at most two to it, ignoring case; in the order of their edit distance.
#[must_use]
pub fn among<'a>(names: impl Iterator<Item = &'a str>, name: &str) -> Vec<&'a str> {
    let lower = name.to_ascii_lowercase();
    let near = |known: &&str| {
        let known = known.to_ascii_lowercase();
        known.contains(&lower) || lower.contains(&known) || levenshtein(&known, &lower) <= EDITS
    };
    let mut similar: Vec<_> = names.filter(near).collect();
    similar.sort_by_key(|known| levenshtein(&known.to_ascii_lowercase(), &lower));
    similar.truncate(5);
    similar
}

/// Returns the first of `names` that equals `name` or, if `name` has more than three bytes, has an edit distance of
/// one from `name`, ignoring case.
#[must_use]
pub fn slip<'a>(mut names: impl Iterator<Item = &'a str>, name: &str) -> Option<&'a str> {
    let lower = name.to_ascii_lowercase();
    let edits = usize::from(lower.len() > 3);
    names.find(|known| levenshtein(&known.to_ascii_lowercase(), &lower) <= edits)
}
