//! Names that are similar to one that does not exist, for messages.

use strsim::levenshtein;

use crate::ModelDescription;

/// Most edits between two similar names.
const EDITS: usize = 2;

/// Up to five variables that are near `name`, as part of a sentence.
#[must_use]
pub fn nearest(description: &ModelDescription, name: &str) -> String {
    let names = description.variables.iter().map(|known| known.name.as_str());
    let similar = among(names, name);
    if similar.is_empty() { String::new() } else { format!(", it has {}", similar.join(", ")) }
}

/// Up to five of `names` that contain `name`, are contained in it or differ by two letters; case
/// does not count.
#[must_use]
pub fn among<'a>(names: impl Iterator<Item = &'a str>, name: &str) -> Vec<&'a str> {
    let wanted = name.to_lowercase();
    let near = |known: &&str| {
        let known = known.to_lowercase();
        known.contains(&wanted) || wanted.contains(&known) || levenshtein(&known, &wanted) <= EDITS
    };
    let mut similar: Vec<_> = names.filter(near).collect();
    similar.sort_by_key(|known| levenshtein(&known.to_lowercase(), &wanted));
    similar.truncate(5);
    similar
}
