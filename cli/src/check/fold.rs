//! Groups findings of the same kind about several variables or files into one line.

use std::collections::{HashMap, HashSet};
use std::fmt;

use super::finding::{Finding, Part, Severity, Tool};

/// A finding with the number of further findings of its kind.
pub(super) struct FindingGroup<'a> {
    first: &'a Finding,
    more: usize,
    /// A plural noun for the objects of the further findings, such as `files`.
    others: &'static str,
}

impl fmt::Display for FindingGroup<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let more = match self.more {
            0 => String::new(),
            more => format!("; and {more} more {}", self.others),
        };
        self.first.write(formatter, &more)
    }
}

/// The common properties of all findings of a group: severity, part, patterns of place, what and why, section, stops.
type Key<'a> = (Severity, Part, String, String, Option<String>, Option<&'static str>, &'a [Tool]);

/// Groups findings by kind, in the order of their first occurrence. Two findings have the same kind if they differ only
/// in names of variables, quoted texts, paths and, except in findings about libraries, numbers.
pub(super) fn fold<'a>(
    findings: &'a [Finding],
    variables: &HashSet<&str>,
) -> Vec<FindingGroup<'a>> {
    let mut groups: Vec<FindingGroup<'a>> = Vec::new();
    let mut known: HashMap<Key<'a>, usize> = HashMap::new();
    for finding in findings {
        let mut named = false;
        // Numbers in findings about libraries are versions.
        let numbers = finding.part != Part::Binaries;
        let place = pattern(&finding.place, variables, true, &mut named);
        let what = pattern(&finding.what, variables, numbers, &mut named);
        let why = finding.why.as_ref().map(|why| pattern(why, variables, numbers, &mut named));
        let Finding { severity, part, section, stops, .. } = finding;
        let key = (*severity, *part, place, what, why, *section, stops.as_slice());
        if let Some(&group) = known.get(&key) {
            groups[group].more += 1;
            continue;
        }
        known.insert(key, groups.len());
        let others = match part {
            // Words such as "a" in these findings may also be names of variables.
            Part::Archive | Part::Binaries => "files",
            Part::Description | Part::Behaviour if named => "variables",
            Part::Description | Part::Behaviour => "places",
        };
        groups.push(FindingGroup { first: finding, more: 0, others });
    }
    groups
}

/// Returns `text` without the parts that may differ within a kind: names of variables, quoted texts, paths and, if
/// `numbers`, numbers. Sets `named` to true if it removes the name of a variable.
fn pattern(text: &str, variables: &HashSet<&str>, numbers: bool, named: &mut bool) -> String {
    let mut pattern = String::with_capacity(text.len());
    // The parts with an odd index are within quotation marks.
    for (index, part) in text.split('"').enumerate() {
        if index % 2 == 1 {
            pattern.push('"');
            continue;
        }
        for word in part.split_inclusive(' ') {
            let bare = word.trim_end_matches([' ', ',', ':', ';', '.']);
            if variables.contains(bare) {
                *named = true;
            } else if !(bare.contains('/') || numbers && bare.parse::<f64>().is_ok()) {
                pattern.push_str(word);
            }
        }
    }
    pattern
}

#[cfg(test)]
mod tests {
    use super::super::finding::Findings;
    use super::*;

    fn lines(findings: &Findings) -> Vec<String> {
        let variables = HashSet::from(["x", "der(x)", "tank.h[1]"]);
        fold(&findings.all, &variables).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_same_of_several_variables_is_one_line_with_the_first_and_a_count() {
        let mut findings = Findings::about(Part::Description);
        for name in ["x", "tank.h[1]", "der(x)"] {
            let what = format!("InitialUnknowns lacks variable {name}");
            findings.add(Severity::Error, "xml", what, "Few use it.", "2.2.8");
        }
        findings.add(Severity::Error, "xml", "Outputs lacks variable x", "", "2.2.8");
        let expected = [
            "error: xml: InitialUnknowns lacks variable x; and 2 more variables (section 2.2.8)\n    \
             Few use it.",
            "error: xml: Outputs lacks variable x (section 2.2.8)",
        ];
        assert_eq!(lines(&findings), expected);
    }

    #[test]
    fn paths_quoted_texts_and_numbers_do_not_keep_findings_apart_but_versions_of_libraries_do() {
        let mut findings = Findings::about(Part::Archive);
        for name in ["sources/a.c", "sources/b.c"] {
            findings.add(Severity::Error, "sources", format!("expected {name}"), "", "");
        }
        assert_eq!(lines(&findings), ["error: sources: expected sources/a.c; and 1 more files"]);
        let mut findings = Findings::about(Part::Binaries);
        for version in ["2.14", "2.34"] {
            findings.add(Severity::Note, "binaries/a.so", format!("needs glibc {version}"), "", "");
        }
        assert_eq!(lines(&findings).len(), 2);
    }

    #[test]
    fn files_are_files_also_if_a_word_of_the_finding_is_the_name_of_a_variable() {
        let mut findings = Findings::about(Part::Archive);
        for name in ["resources/con.txt", "resources/aux.txt"] {
            findings.add(Severity::Warning, name, "a name that Windows does not allow", "", "");
        }
        let groups = fold(&findings.all, &HashSet::from(["a"]));
        let lines: Vec<_> = groups.iter().map(ToString::to_string).collect();
        let expected =
            "warning: resources/con.txt: a name that Windows does not allow; and 1 more files";
        assert_eq!(lines, [expected]);
    }

    #[test]
    fn a_finding_that_stops_a_tool_is_not_folded_into_one_that_does_not() {
        let mut findings = Findings::about(Part::Description);
        findings.add(Severity::Error, "xml", "variable x is odd", "", "");
        findings.add(Severity::Error, "xml", "variable der(x) is odd", "", "");
        findings.stopping(&[Tool::FmiLibrary]);
        assert_eq!(lines(&findings).len(), 2);
    }
}
