//! The tests of the residuals and the decision.

use super::Source;
use crate::code::c::{reactions, wrapped};
use crate::code::detection::{Method, Test};

impl Source<'_> {
    /// The structure with decision, residuals and statistics of a sample.
    pub(super) fn detection_structure(&self, lines: &mut Vec<String>) {
        if self.controller.detection.is_none() {
            return;
        }
        let real = self.real;
        lines.push(format!(
            "
/// Decision, residuals and statistics of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {{
    /// Whether a test has given an alarm since the last reset.
    pub detected: bool,
    /// The position from 1 of the fault that the alarms fit; 0 without an alarm, -1 if they fit none or several.
    pub isolated: i32,
    /// The time of the first alarm in s; -1 before.
    pub t_detected: {real},
    /// The estimated time in s at which the fault started; -1 before an alarm.
    pub t_onset: {real},
    /// The residuals in standard deviations.
    pub residual: [{real}; RESIDUALS],
    /// The statistics of the tests.
    pub statistic: [{real}; TESTS],
}}

impl Default for Detection {{
    fn default() -> Self {{
        Self {{
            detected: false,
            isolated: 0,
            t_detected: -1.0,
            t_onset: -1.0,
            residual: [0.0; RESIDUALS],
            statistic: [0.0; TESTS],
        }}
    }}
}}"
        ));
    }

    /// The fields of an instance with their types and start values.
    fn detection_fields(&self) -> Vec<(&'static str, String, &'static str)> {
        let Some(own) = &self.controller.detection else { return Vec::new() };
        let real = self.real;
        let sums = match own.method {
            Method::Cusum => vec![
                ("sums", format!("[[{real}; 2]; TESTS]"), "[[0.0; 2]; TESTS]"),
                ("since", "[[u32; 2]; TESTS]".to_owned(), "[[0; 2]; TESTS]"),
            ],
            Method::Window => vec![
                ("sums", format!("[{real}; RESIDUALS]"), "[0.0; RESIDUALS]"),
                ("since", "[u32; TESTS]".to_owned(), "[0; TESTS]"),
                ("taken", "[u32; TESTS]".to_owned(), "[0; TESTS]"),
            ],
        };
        let rest = [
            ("statistic", format!("[{real}; TESTS]"), "[0.0; TESTS]"),
            ("alarmed", "[bool; TESTS]".to_owned(), "[false; TESTS]"),
            ("detected", "bool".to_owned(), "false"),
            ("isolated", "i32".to_owned(), "0"),
            ("detected_at", "u32".to_owned(), "0"),
            ("onset", "u32".to_owned(), "0"),
        ];
        sums.into_iter().chain(rest).collect()
    }

    /// The declarations of these fields.
    pub(super) fn detection_state(&self, lines: &mut Vec<String>) {
        let fields = self.detection_fields().into_iter();
        lines.extend(fields.map(|(field, kind, _)| format!("    {field}: {kind},")));
    }

    /// Their start values.
    pub(super) fn detection_start(&self, lines: &mut Vec<String>) {
        let fields = self.detection_fields().into_iter();
        lines.extend(fields.map(|(field, _, start)| format!("            {field}: {start},")));
    }

    /// The constants of the tests that are no real numbers.
    pub(super) fn detection_tables(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.detection else { return };
        if own.method == Method::Window {
            for (name, kind, value) in [
                (
                    "TAKEN_RESIDUALS",
                    "usize",
                    (|test| test.residuals.to_string()) as fn(&Test) -> String,
                ),
                ("WINDOW", "u32", |test| test.window.to_string()),
            ] {
                lines.push(format!("\nstatic {name}: [{kind}; TESTS] = ["));
                lines.extend(wrapped(own.tests.iter().map(value), "    "));
                lines.push("];".to_owned());
            }
        }
        lines.push("\nstatic REACTS: [[bool; TESTS]; SUSPECTS] = [".to_owned());
        lines.extend(reactions(own).iter().map(|row| format!("    [{}],", row.join(", "))));
        lines.push("];".to_owned());
    }

    /// The methods that test the residuals and return the decision.
    pub(super) fn detection_methods(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.detection else { return };
        let real = self.real;
        lines.push("\nimpl Controller {\n    /// Clears sums, windows and decision.".to_owned());
        lines.push("    fn clear_detection(&mut self) {".to_owned());
        let fields = self.detection_fields().into_iter();
        lines.extend(fields.map(|(field, _, start)| format!("        self.{field} = {start};")));
        let tests = match own.method {
            Method::Cusum => {
                "let tests = self.sums.iter_mut().zip(&mut self.since).zip(&self.residual).zip(&DRIFT);
        let outcomes = self.statistic.iter_mut().zip(&mut self.alarmed).zip(&THRESHOLD);
        for ((((sums, since), residual), drift), ((statistic, alarmed), threshold)) in tests.zip(outcomes) {
            let complete = Some(cumulate(sums, since, statistic, (*residual, *drift, self.sample)));"
            }
            Method::Window => {
                "let mut sums = self.sums.iter_mut().zip(&self.residual);
        let windows = self.since.iter_mut().zip(&mut self.taken).zip(&TAKEN_RESIDUALS).zip(&WINDOW);
        let outcomes = self.statistic.iter_mut().zip(&mut self.alarmed).zip(&THRESHOLD);
        for ((((since, taken), count), window), ((statistic, alarmed), threshold)) in windows.zip(outcomes) {
            if *taken == 0 {
                *since = self.sample;
            }
            let starts = *taken == 0;
            *taken += 1;
            let mut squared = 0.0;
            for (sum, residual) in sums.by_ref().take(*count) {
                let before = if starts { 0.0 } else { *sum };
                *sum = kept_finite(before + residual);
                squared += *sum * *sum;
            }
            let complete = (*taken >= *window).then_some(*since);
            if complete.is_some() {
                *taken = 0;
                *statistic = kept_finite(squared / *window as REAL);
            }"
            }
        };
        lines.push(format!(
            "    }}

    /// Tests the residuals of a sample.
    fn detect(&mut self, detection_reset: bool) {{
        if detection_reset {{
            self.clear_detection();
        }}
        if self.sample < FIRST_TESTED {{
            return;
        }}
        {}
            let Some(onset) = complete.filter(|_| *statistic > *threshold) else {{
                continue;
            }};
            *alarmed = true;
            if !self.detected {{
                (self.detected, self.detected_at, self.onset) = (true, self.sample, onset);
            }}
        }}
        if self.detected {{
            self.isolated = isolate(&self.alarmed);
        }}
    }}

    /// Decision, residuals and statistics of the last sample.
    fn detection(&self) -> Detection {{
        let time = |sample: u32| if self.detected {{ sample as {real} * SAMPLE_TIME }} else {{ -1.0 }};
        Detection {{
            detected: self.detected,
            isolated: self.isolated,
            t_detected: time(self.detected_at),
            t_onset: time(self.onset),
            residual: self.residual,
            statistic: self.statistic,
        }}
    }}
}}",
            tests.replace("REAL", real)
        ));
    }

    /// The functions that test and decide.
    pub(super) fn detection_helpers(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.detection else { return };
        let real = self.real;
        lines.push(format!(
            "
/// Finds the one fault to which exactly the tests react that have given an alarm.
fn isolate(alarmed: &[bool; TESTS]) -> i32 {{
    let (mut isolated, mut fitting) = (-1, 0);
    for (fault, reacts) in (1..).zip(&REACTS) {{
        if reacts == alarmed {{
            fitting += 1;
            isolated = fault;
        }}
    }}
    if fitting == 1 {{
        isolated
    }} else {{
        -1
    }}
}}

/// Keeps a sum within the range of the numbers; NaN and what is beyond it become the largest number.
fn kept_finite(sum: {real}) -> {real} {{
    if sum.is_finite() {{
        sum
    }} else {{
        {real}::MAX
    }}
}}"
        ));
        if own.method == Method::Cusum {
            lines.push(format!(
                "
/// A cumulative sum: the sum if it is above 0, else 0.
fn above_zero(sum: {real}) -> {real} {{
    if sum > 0.0 {{
        sum
    }} else {{
        0.0
    }}
}}

/// Takes a residual: S+ = max(0, S+ + r - kappa), S- = max(0, S- - r - kappa); the statistic is the larger one.
/// Returns the sample since which it is above 0.
fn cumulate(
    sums: &mut [{real}; 2],
    since: &mut [u32; 2],
    statistic: &mut {real},
    (residual, drift, sample): ({real}, {real}, u32),
) -> u32 {{
    for (sum, since) in sums.iter().zip(since.iter_mut()) {{
        if *sum <= 0.0 {{
            *since = sample;
        }}
    }}
    let [upper, lower] = *sums;
    let upper = above_zero(kept_finite(upper + residual - drift));
    let lower = above_zero(kept_finite(lower - residual - drift));
    *sums = [upper, lower];
    let [since_upper, since_lower] = *since;
    let (larger, onset) = if lower > upper {{ (lower, since_lower) }} else {{ (upper, since_upper) }};
    *statistic = larger;
    onset
}}"
            ));
        }
    }
}
