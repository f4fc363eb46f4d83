//! The fields of an instance that belong to tests, to actuators that may be gone, and to measurements that are held.

use super::Source;
use crate::detection::Method;

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

    /// The counters of samples: for each measurement, while its last value replaces it; for the controller, since it
    /// rested.
    fn fields_of_measurements(&self) -> Vec<Field> {
        let held = field("held", "[u32; MEASUREMENTS]", "[0; MEASUREMENTS]");
        let running = field("running", "u32", "0");
        let held = self.controller.limits_holds().then_some(held);
        held.into_iter().chain(self.controller.counts_since_rest().then_some(running)).collect()
    }

    /// The fields of tests, of the choice of gains, of measurements, and of the law.
    pub(super) fn other_fields(&self) -> impl Iterator<Item = Field> {
        let of_tests = self.fields_of_tests().into_iter().chain(self.fields_of_reconfiguration());
        of_tests.chain(self.fields_of_measurements()).chain(self.field_of_law())
    }

    /// The law of the last commands: whether it compensates, the actuators that are gone, the set of gains. The value
    /// of the field is `None` before the first commands and at rest. No field if commands may jump.
    fn field_of_law(&self) -> Option<Field> {
        let kind = match self.controller.reconfiguration {
            None => "Option<bool>",
            Some(_) => "Option<(bool, [bool; ACTUATORS], u32)>",
        };
        self.controller.transfer.map(|_| field("law", kind, "None"))
    }

    /// The fields of the choice of gains.
    fn fields_of_reconfiguration(&self) -> Vec<Field> {
        let Some(reconfiguration) = &self.controller.reconfiguration else { return Vec::new() };
        let mut all = vec![
            field("gone", "[bool; ACTUATORS]", "[false; ACTUATORS]"),
            field("choice", "Choice", "Choice { set: 0, reconfiguration: 0 }"),
        ];
        if !reconfiguration.cases.is_empty() {
            all.extend([
                field("lost", format!("[{}; CASES]", self.real), "[0.0; CASES]"),
                field("above_for", "[u32; CASES]", "[0; CASES]"),
                field("decided", "[bool; CASES]", "[false; CASES]"),
            ]);
        }
        all
    }
}
