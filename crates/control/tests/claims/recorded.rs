//! The files in tests/data: named cases, each with named matrices.

use nalgebra::DMatrix;

pub(crate) struct Case {
    pub(crate) name: &'static str,
    matrices: Vec<(&'static str, DMatrix<f64>)>,
}

impl Case {
    pub(crate) fn get(&self, name: &str) -> &DMatrix<f64> {
        let matrix = self.matrices.iter().find(|(known, _)| *known == name);
        &matrix.unwrap_or_else(|| panic!("{} has no {name}", self.name)).1
    }

    pub(crate) fn number(&self, name: &str) -> f64 {
        self.get(name)[(0, 0)]
    }
}

/// The cases of one kind.
pub(crate) fn cases(text: &'static str, kind: &str) -> Vec<Case> {
    let mut cases = Vec::new();
    let mut is_of_kind = false;
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        if let Some((case_kind, name)) = line.split_once(": ") {
            is_of_kind = case_kind == kind;
            if is_of_kind {
                cases.push(Case { name, matrices: Vec::new() });
            }
        } else if is_of_kind {
            cases.last_mut().expect("a case").matrices.push(named_matrix(line));
        }
    }
    assert!(!cases.is_empty(), "no cases of {kind}");
    cases
}

fn named_matrix(line: &'static str) -> (&'static str, DMatrix<f64>) {
    let mut words = line.split(' ');
    let name = words.next().expect("a name");
    let mut size = || words.next().and_then(|word| word.parse().ok()).expect("a size");
    let (rows, cols) = (size(), size());
    let entries = words.map(|word| word.parse().expect("a number"));
    (name, DMatrix::from_row_iterator(rows, cols, entries))
}
