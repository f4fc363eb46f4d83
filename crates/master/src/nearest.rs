//! Variables whose names are near to one that does not exist.

use fmu_description::ModelDescription;

/// Most edits between two names that are near each other.
const EDITS: usize = 2;

/// Up to five variables that are near `name`, as part of a sentence.
pub(crate) fn nearest(description: &ModelDescription, name: &str) -> String {
    let names = description.variables.iter().map(|known| known.name.as_str());
    let similar = among(names, name);
    if similar.is_empty() { String::new() } else { format!(", it has {}", similar.join(", ")) }
}

/// Up to five of `names` that contain `name`, are contained in it or differ by two letters; case
/// does not count.
pub(crate) fn among<'a>(names: impl Iterator<Item = &'a str>, name: &str) -> Vec<&'a str> {
    let wanted = name.to_lowercase();
    let near = |known: &&str| {
        let known = known.to_lowercase();
        known.contains(&wanted) || wanted.contains(&known) || distance(&known, &wanted) <= EDITS
    };
    let mut similar: Vec<_> = names.filter(near).collect();
    similar.sort_by_key(|known| distance(&known.to_lowercase(), &wanted));
    similar.truncate(5);
    similar
}

/// Letters to insert, delete or replace between two texts (Levenshtein 1966).
fn distance(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (line, letter) in from.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], line + 1);
        for (column, other) in to.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != *other);
            diagonal = row[column + 1];
            row[column + 1] = replaced.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[to.len()]
}

#[cfg(test)]
mod tests {
    use super::distance;

    #[test]
    fn the_distance_counts_insertions_deletions_and_replacements() {
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("omega", "omega"), 0);
    }
}
