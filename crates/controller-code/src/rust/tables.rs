//! The tables of a design.

use super::Source;
use crate::c::{reactions, wrapped};
use crate::constants::Constants;
use crate::detection::Method;
use crate::reconfiguration::{Case, Reconfiguration};
use crate::symbols::Kind;
use crate::tables::tables;
use crate::text::Lines;

impl Source<'_> {
    pub(super) fn tables(&self, lines: &mut Lines) {
        for table in tables(self.controller) {
            self.table(lines, &table);
        }
        self.validity(lines);
        self.tables_of_tests(lines);
        if let Some(reconfiguration) = &self.controller.reconfiguration {
            self.tables_of_reconfiguration(lines, reconfiguration);
        }
    }

    /// Adds the ranges and the longest holds of measurements; nothing without them.
    fn validity(&self, lines: &mut Lines) {
        if !self.controller.checks_measurements() {
            return;
        }
        let most_held = if self.controller.limits_holds() {
            let most = self.controller.most_held.iter();
            let most = most.map(|most| most.map_or("u32::MAX".to_owned(), |most| most.to_string()));
            list(lines, "MOST_HELD: [u32; MEASUREMENTS]", most);
            "&MOST_HELD"
        } else {
            "&[]"
        };
        lines.push(format!(
            "
static VALIDITY: Validity<'static, {}> = Validity {{
    low: &Y_MIN,
    high: &Y_MAX,
    most_held: {most_held},
}};",
            self.real
        ));
    }

    /// Adds a vector, a matrix row by row, or the vectors or matrices of all points of a schedule or sets of gains.
    fn table(&self, lines: &mut Lines, table: &Constants) {
        let Constants { name, rows, columns, layers, values, .. } = table;
        let real = self.real;
        let (size, layers, per_layer) = match (columns, layers) {
            (None, _) => (rows.plural().to_owned(), None, 1),
            // A vector for each point.
            (Some(columns), None) if *rows == Kind::Point => {
                (columns.plural().to_owned(), Some(*rows), 1)
            }
            (Some(columns), layers) => (
                format!("{} * {}", rows.plural(), columns.plural()),
                *layers,
                rows.count(self.controller),
            ),
        };
        let kind = match layers {
            Some(layers) => format!("[[{real}; {size}]; {}]", layers.plural()),
            None => format!("[{real}; {size}]"),
        };
        lines.push(format!("\nstatic {}: {kind} = [", name.to_ascii_uppercase()));
        for layer in values.chunks(if layers.is_some() { per_layer } else { values.len().max(1) }) {
            let indent = if layers.is_some() { "        " } else { "    " };
            lines.push_if(layers.is_some(), "    [");
            for row in layer {
                lines.extend(wrapped(row.iter().map(|value| self.literal(*value)), indent));
            }
            lines.push_if(layers.is_some(), "    ],");
        }
        lines.push("];");
    }

    /// Adds the tables of the tests that are no real numbers, and the filter of the residuals; nothing without a
    /// detection.
    fn tables_of_tests(&self, lines: &mut Lines) {
        let Some(detection) = &self.controller.detection else { return };
        if detection.method == Method::Window {
            let counts = detection.tests.iter().map(|test| test.residuals.to_string());
            list(lines, "COUNTS: [usize; TESTS]", counts);
            let lengths = detection.tests.iter().filter_map(|test| Some(test.window?.to_string()));
            list(lines, "LENGTHS: [u32; TESTS]", lengths);
        }
        let rows = reactions(detection).into_iter().map(|row| format!("[{}]", row.join(", ")));
        list(lines, "REACTS: [[bool; TESTS]; SUSPECTS]", rows);
        lines.push(format!(
            "
static RESIDUAL_FILTER: Filter<'static, {}> = Filter {{
    state: [
        Matrix::new(&A_R),
        Matrix::new(&B_RU),
        Matrix::new(&B_RY),
    ],
    residual: [
        Matrix::new(&C_R),
        Matrix::new(&D_RU),
        Matrix::new(&D_RY),
    ],
}};",
            self.real
        ));
    }

    fn tables_of_reconfiguration(&self, lines: &mut Lines, reconfiguration: &Reconfiguration) {
        let row = |row: &[bool]| {
            format!("[{}]", row.iter().map(bool::to_string).collect::<Vec<_>>().join(", "))
        };
        let sets = reconfiguration.sets.iter().map(|set| row(&set.gone));
        list(lines, "SET_GONE: [[bool; ACTUATORS]; GAIN_SETS]", sets);
        let last = reconfiguration.sets.len() - 1;
        let fall_back = match reconfiguration.fallback {
            Some(_) => format!("Some({last})"),
            None => "None".to_owned(),
        };
        let single = if reconfiguration.fallback.is_none() && !reconfiguration.cases.is_empty() {
            let singles = reconfiguration.single_sets(self.controller.actuators.len());
            singles.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
        } else {
            String::new()
        };
        lines.push(format!(
            "
/// The sets of gains.
fn sets() -> Sets<'static, ACTUATORS> {{
    let gone = SET_GONE.split_at({}).0;
    Sets {{ gone, single: &[{single}], fall_back: {fall_back} }}
}}

/// An entry of a table of the sets of gains.
fn of_set<T, const N: usize>(table: &[[T; N]; GAIN_SETS], set: u32) -> &[T] {{
    let [intact, ..] = table;
    table.get(set as usize).unwrap_or(intact)
}}",
            reconfiguration.regular_sets()
        ));
        if reconfiguration.cases.is_empty() {
            return;
        }
        let case = |case: &Case| {
            let samples = case.decision.map_or(0, |decision| decision.samples);
            format!(
                "Case {{ actuator: {}, samples: {samples}, restarts: &{} }}",
                case.actuator,
                row(&case.restarts)
            )
        };
        list(lines, "ALL_CASES: [Case<'static>; CASES]", reconfiguration.cases.iter().map(case));
    }
}

/// Adds a static list; `head` is its name and type.
fn list(lines: &mut Lines, head: &str, values: impl Iterator<Item = String>) {
    lines.push(format!("\nstatic {head} = ["));
    lines.extend(wrapped(values, "    "));
    lines.push("];");
}
