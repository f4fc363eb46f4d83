//! The tables of a design that are whole numbers or flags: of tests, of actuators that may be gone, of losses, of
//! holds.

use super::{Source, wrapped};
use crate::detection::{Detection, Method};
use crate::reconfiguration::{Case, Reconfiguration};
use crate::symbols::Kind;
use crate::text::Lines;
use aso_controller::design::Loss;
use aso_controller::design::detection::TestDesign;

impl Source<'_> {
    pub(super) fn integer_tables(&self, lines: &mut Lines) {
        if let Some(detection) = &self.controller.detection {
            self.tables_of_tests(lines, detection);
        }
        if let Some(reconfiguration) = &self.controller.reconfiguration {
            self.tables_of_reconfiguration(lines, reconfiguration);
        }
        self.tables_of_losses(lines);
        if self.controller.limits_holds() {
            let text = "The most samples for which the last value of a measurement may replace it.";
            lines.push(format!("\n/* {text} */"));
            let most =
                self.controller.most_held.iter().map(|most| most.unwrap_or(u32::MAX) as usize);
            numbers(lines, ["most_held", &self.count(Kind::Measurement)], most);
        }
    }

    fn tables_of_tests(&self, lines: &mut Lines, detection: &Detection) {
        let (tests, suspects) = (self.count(Kind::Test), self.count(Kind::Suspect));
        if detection.method == Method::Window {
            let of_tests = detection.tests.iter();
            let residuals = |test: &TestDesign| test.residuals;
            numbers(lines, ["taken_residuals", &tests], of_tests.clone().map(residuals));
            let samples = |test: &TestDesign| test.window.unwrap_or_default() as usize;
            numbers(lines, ["window", &tests], of_tests.map(samples));
        }
        lines.push("\n/* Which tests react to each fault. */");
        flags(lines, &format!("reacts[{suspects}][{tests}]"), reactions(detection).into_iter());
    }

    fn tables_of_reconfiguration(&self, lines: &mut Lines, reconfiguration: &Reconfiguration) {
        let (cases, actuators) = (self.count(Kind::Case), self.count(Kind::Actuator));
        let (sets, faults) = (self.count(Kind::GainSet), self.count(Kind::Fault));
        let row = |row: &[bool]| row.iter().map(bool::to_string).collect();
        lines.push("\n/* The actuators without which each set of gains is. */");
        let gone = reconfiguration.sets.iter().map(|set| row(&set.gone));
        flags(lines, &format!("set_gone[{sets}][{actuators}]"), gone);
        if reconfiguration.cases.is_empty() {
            return;
        }
        if reconfiguration.fallback.is_none() {
            let text = "The set of gains without one actuator; 0 if there is none.";
            lines.push(format!("\n/* {text} */"));
            let singles = reconfiguration.single_sets(self.controller.actuators.len());
            numbers(lines, ["single_set", &actuators], singles.into_iter());
        }
        let text = "The actuators that may be gone; the samples for which a loss must last; the loss, or the number \
                    of losses.";
        lines.push(format!("\n/* {text} */"));
        let of_cases = reconfiguration.cases.iter();
        let place = |case: &Case| case.actuator;
        numbers(lines, ["case_actuator", &cases], of_cases.clone().map(place));
        let samples = |case: &Case| case.decision.map_or(0, |decision| decision.samples as usize);
        numbers(lines, ["case_samples", &cases], of_cases.clone().map(samples));
        let losses = self.controller.losses.len();
        if losses > 0 {
            let loss = |case: &Case| case.decision.map_or(losses, |decision| decision.loss);
            numbers(lines, ["case_loss", &cases], of_cases.clone().map(loss));
        }
        lines.push("\n/* The faults whose estimates restart at 0. */");
        let restarts = of_cases.map(|case| row(&case.restarts));
        flags(lines, &format!("case_restarts[{cases}][{faults}]"), restarts);
    }

    fn tables_of_losses(&self, lines: &mut Lines) {
        let losses = &self.controller.losses;
        if losses.is_empty() {
            return;
        }
        lines.push("\n/* Faults and actuators of the losses of effectiveness, and u_e^2. */");
        let fault = |loss: &Loss| loss.fault;
        numbers(lines, ["loss_fault", "ASO_LOSSES"], losses.iter().map(fault));
        let actuator = |loss: &Loss| loss.actuator;
        numbers(lines, ["loss_actuator", "ASO_LOSSES"], losses.iter().map(actuator));
        let squared =
            losses.iter().map(|loss| self.literal(loss.least_command * loss.least_command));
        let head = format!("{} squared_least_command[ASO_LOSSES]", self.real);
        list(lines, &head, wrapped(squared, "    "));
    }
}

/// Adds a table of whole numbers.
fn numbers(lines: &mut Lines, [name, size]: [&str; 2], values: impl Iterator<Item = usize>) {
    let values = values.map(|value| format!("{value}U"));
    list(lines, &format!("uint32_t {name}[{size}]"), wrapped(values, "    "));
}

/// Adds a table of flags; `head`: the name of the table with its sizes.
fn flags(lines: &mut Lines, head: &str, rows: impl Iterator<Item = Vec<String>>) {
    list(lines, &format!("bool {head}"), rows.map(|row| format!("    {{{}}},", row.join(", "))));
}

/// Adds a table of `rows`; `head`: the type and the name of the table with its sizes.
fn list(lines: &mut Lines, head: &str, rows: impl IntoIterator<Item = String>) {
    lines.push(format!("static const {head} =\n{{"));
    lines.extend(rows);
    lines.end_list();
    lines.push("};");
}

/// For each fault whether each test reacts to it: `true` or `false`, as C and Rust write it.
pub(crate) fn reactions(detection: &Detection) -> Vec<Vec<String>> {
    let row =
        |fault: usize| detection.tests.iter().map(|test| test.reacts[fault].to_string()).collect();
    (0..detection.faults.len()).map(row).collect()
}
