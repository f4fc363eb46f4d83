//! The fields of an instance that belong to tests and to actuators that may be gone.

use super::Source;
use crate::code::detection::Method;

/// A field: its name, its type, its start value.
pub(super) struct Field {
    pub(super) name: &'static str,
    pub(super) kind: String,
    pub(super) start: String,
}

fn field(name: &'static str, kind: impl Into<String>, start: impl Into<String>) -> Field {
    Field { name, kind: kind.into(), start: start.into() }
}

impl Source<'_> {
    /// The fields of the tests and of the decision.
    pub(super) fn fields_of_tests(&self) -> Vec<Field> {
        let Some(detection) = &self.controller.detection else { return Vec::new() };
        let real = self.real;
        let mut all = match detection.method {
            Method::Cusum => vec![field(
                "tests",
                format!("[Cumulative<{real}>; TESTS]"),
                "[Cumulative { sums: [0.0; 2], since: [0; 2] }; TESTS]",
            )],
            Method::Window => vec![
                field("sums", format!("[{real}; RESIDUALS]"), "[0.0; RESIDUALS]"),
                field("tests", "[Window; TESTS]", "[Window { since: 0, count: 0 }; TESTS]"),
            ],
        };
        all.extend([
            field("statistic", format!("[{real}; TESTS]"), "[0.0; TESTS]"),
            field("alarmed", "[bool; TESTS]", "[false; TESTS]"),
            field("decision", "Decision", "Decision { isolated: 0, detected_at: 0, onset: 0 }"),
        ]);
        all
    }

    /// The fields of the choice of gains.
    pub(super) fn fields_of_reconfiguration(&self) -> Vec<Field> {
        let Some(reconfiguration) = &self.controller.reconfiguration else { return Vec::new() };
        let mut all = vec![
            field("gone", "[bool; ACTUATORS]", "[false; ACTUATORS]"),
            field("choice", "Choice", "Choice { set: 0, reconfiguration: 0 }"),
        ];
        if !reconfiguration.cases.is_empty() {
            all.extend([
                field("lost", format!("[{}; CASES]", self.real), "[0.0; CASES]"),
                field("above", "[bool; CASES]", "[false; CASES]"),
                field("since", "[u32; CASES]", "[0; CASES]"),
                field("decided", "[bool; CASES]", "[false; CASES]"),
            ]);
        }
        all
    }
}
