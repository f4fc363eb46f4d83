//! Selection of variables to record or to plot.

/// Largest number of similar or available names in an error message.
const SHOWN: usize = 5;

/// A selection of variables by names and patterns: all variables that match a pattern of `include` and
/// no pattern of `exclude`.
///
/// A pattern that equals the name of a variable selects only that variable. Otherwise `*` matches any
/// characters, including dots, and `?` matches one character. Every other character matches itself,
/// also brackets, which are part of names in FMI, as in `x_hat[1]`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Selection {
    /// Patterns to include; empty includes all variables.
    pub include: Vec<String>,
    /// Patterns to exclude from the included variables.
    pub exclude: Vec<String>,
}

/// The error of a selection.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SelectionError {
    /// A pattern matches no variable.
    #[error("no variable matches {pattern:?}{near}")]
    NoMatch {
        /// The pattern.
        pattern: String,
        /// Similar names, or the first names if none is similar, as the end of the message.
        near: String,
    },
    /// `exclude` excludes every included variable.
    #[error("the selection is empty: all included variables are also excluded")]
    Empty,
}

impl Selection {
    /// Returns the positions of the selected `names` without duplicates: in the order of `include`, within
    /// a pattern in the order of `names`. The cost is proportional to patterns times names.
    ///
    /// # Errors
    ///
    /// [`SelectionError`] if a pattern matches no name, or if there are names and none is selected.
    pub fn choose<N: AsRef<str>>(&self, names: &[N]) -> Result<Vec<usize>, SelectionError> {
        let mut open = vec![true; names.len()];
        for pattern in &self.exclude {
            for position in matching(pattern, names)? {
                open[position] = false;
            }
        }
        let mut chosen = Vec::new();
        let mut take = |position: usize| {
            if std::mem::replace(&mut open[position], false) {
                chosen.push(position);
            }
        };
        if self.include.is_empty() {
            (0..names.len()).for_each(take);
        } else {
            for pattern in &self.include {
                matching(pattern, names)?.into_iter().for_each(&mut take);
            }
        }
        if chosen.is_empty() && !names.is_empty() { Err(SelectionError::Empty) } else { Ok(chosen) }
    }
}

/// Returns the positions of the names that match a pattern, at least one.
fn matching<N: AsRef<str>>(pattern: &str, names: &[N]) -> Result<Vec<usize>, SelectionError> {
    if let Some(same) = names.iter().position(|name| name.as_ref() == pattern) {
        return Ok(vec![same]);
    }
    let pieces: Vec<char> = pattern.chars().collect();
    let matches: Vec<usize> = names
        .iter()
        .enumerate()
        .filter(|(_, name)| matches_pattern(&pieces, name.as_ref()))
        .map(|(position, _)| position)
        .collect();
    if matches.is_empty() {
        return Err(SelectionError::NoMatch {
            pattern: pattern.to_owned(),
            near: similar_hint(pattern, names),
        });
    }
    Ok(matches)
}

/// Whether the whole name matches the pattern. Backtracks to the last `*` only, so the cost is at most
/// the product of both lengths.
fn matches_pattern(pattern: &[char], name: &str) -> bool {
    let name: Vec<char> = name.chars().collect();
    let (mut at, mut letter) = (0, 0);
    let mut star: Option<(usize, usize)> = None;
    while letter < name.len() {
        match pattern.get(at) {
            Some('*') => {
                star = Some((at, letter));
                at += 1;
            }
            Some(character) if *character == '?' || *character == name[letter] => {
                at += 1;
                letter += 1;
            }
            _ => match star {
                Some((place, end)) => {
                    star = Some((place, end + 1));
                    (at, letter) = (place + 1, end + 1);
                }
                None => return false,
            },
        }
    }
    pattern[at..].iter().all(|rest| *rest == '*')
}

/// Largest edit distance of two similar names.
const EDITS: usize = 2;

/// Returns up to [`SHOWN`] of `names` that contain `name`, are contained in `name`, or have an edit distance of at most
/// [`EDITS`] to it, the most similar first.
fn similar<'a>(names: impl Iterator<Item = &'a str>, name: &str) -> Vec<&'a str> {
    let edits = |known: &str| strsim::levenshtein(&known.to_lowercase(), &name.to_lowercase());
    let near = |known: &&str| {
        known.to_lowercase().contains(&name.to_lowercase())
            || name.to_lowercase().contains(&known.to_lowercase())
            || edits(known) <= EDITS
    };
    let mut similar: Vec<_> = names.filter(near).collect();
    similar.sort_by_key(|known| edits(known));
    similar.truncate(SHOWN);
    similar
}

/// Returns a hint for a message: names similar to the pattern without its wildcards, or else the first
/// names.
fn similar_hint<N: AsRef<str>>(pattern: &str, names: &[N]) -> String {
    let plain: String = pattern.chars().filter(|letter| !"*?".contains(*letter)).collect();
    let all = || names.iter().map(AsRef::as_ref);
    let similar = similar(all(), &plain);
    let count = names.len();
    match similar.is_empty() {
        false => format!("; similar names: {}", similar.join(", ")),
        true if count == 0 => "; there are no variables".to_owned(),
        true => {
            let first: Vec<&str> = all().take(SHOWN).collect();
            let more =
                if count > SHOWN { format!(" and {} more", count - SHOWN) } else { String::new() };
            format!("; available: {}{more}", first.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 7] = [
        "plant.x_p",
        "plant.theta",
        "ctrl.x_hat[1]",
        "ctrl.x_hat[2]",
        "ctrl.inner.y",
        "der(plant.theta)",
        "'a*b'",
    ];

    fn chosen(include: &[&str], exclude: &[&str]) -> Result<Vec<&'static str>, SelectionError> {
        let owned = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect();
        let selection = Selection { include: owned(include), exclude: owned(exclude) };
        Ok(selection.choose(&NAMES)?.into_iter().map(|position| NAMES[position]).collect())
    }

    #[test]
    fn patterns_select_each_name_once_in_their_order_except_those_that_are_excluded() {
        let cases: [(&[&str], &[&str], &[&str]); 10] = [
            (&[], &[], &NAMES),
            (&["plant.theta", "plant.x_p", "plant.*"], &[], &["plant.theta", "plant.x_p"]),
            // Brackets match themselves, also with wildcards.
            (&["ctrl.x_hat[1]"], &[], &["ctrl.x_hat[1]"]),
            (&["*.x_hat[?]"], &[], &["ctrl.x_hat[1]", "ctrl.x_hat[2]"]),
            (&["*[2]"], &[], &["ctrl.x_hat[2]"]),
            // A star also matches dots, and a question mark is one character.
            (&["ctrl.*y"], &[], &["ctrl.inner.y"]),
            (&["plant.?_p"], &[], &["plant.x_p"]),
            (&["*theta*"], &[], &["plant.theta", "der(plant.theta)"]),
            // A pattern that equals a name selects only this name.
            (&["'a*b'"], &[], &["'a*b'"]),
            (&[], &["*theta*", "*.x_hat[*]"], &["plant.x_p", "ctrl.inner.y", "'a*b'"]),
        ];
        for (include, exclude, expected) in cases {
            assert_eq!(chosen(include, exclude).unwrap(), expected);
        }
        assert!(chosen(&["plant.x_?p"], &[]).is_err());
        assert_eq!(chosen(&["plant.*"], &["plant.*"]), Err(SelectionError::Empty));
    }

    #[test]
    fn a_pattern_without_a_variable_is_refused_with_names_near_it() {
        let message = |include| chosen(&[include], &[]).unwrap_err().to_string();
        assert_eq!(
            message("plant.x_q"),
            "no variable matches \"plant.x_q\"; similar names: plant.x_p"
        );
        assert!(message("plant.tehta").contains("plant.theta"), "{}", message("plant.tehta"));
        assert!(message("*.inner.z").contains("ctrl.inner.y"), "{}", message("*.inner.z"));
        let strange = message("motor.*");
        assert!(
            strange.contains("available: plant.x_p") && strange.contains("2 more"),
            "{strange}"
        );
        assert!(chosen(&[], &["motor.*"]).is_err(), "an exclusion is held to the same");
    }

    #[test]
    fn matching_many_stars_takes_at_most_the_product_of_the_lengths() {
        let pattern: Vec<char> = "*a".repeat(200).chars().chain(['b']).collect();
        assert!(!matches_pattern(&pattern, &"a".repeat(5000)));
    }
}
