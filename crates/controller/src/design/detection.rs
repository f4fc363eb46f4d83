//! The section `[detection]` of a design file: the filter of the residuals and the tests.

use serde::{Deserialize, Serialize};

use super::Design;
use super::checks::Refusal;
use crate::matrix::Matrix;

/// The filter of the residuals r, which has k states x_r, and the tests of r. In a sampled controller
///
/// ```text
/// x_r[k+1] = A x_r[k] + B_u u[k] + B_y y[k],  r[k] = C x_r[k] + D_u u[k] + D_y y[k]
/// ```
///
/// in a continuous one x_r' in place of x_r[k+1]; its residuals are the averages of r over each interval of
/// `sample_time`, times the root of `sample_time`. Without faults the residuals are white with variance 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DetectionDesign {
    /// The interval in s between two tests of a continuous controller; a sampled one states none, and tests in each
    /// sample.
    pub sample_time: Option<f64>,
    /// Time in s after the start of the run from which the residuals are tested.
    pub from: f64,
    /// A, k x k.
    #[serde(rename = "A")]
    pub a: Matrix,
    /// B_u, k x m: the effect of the commands on x_r.
    #[serde(rename = "B_u")]
    pub b_u: Matrix,
    /// B_y, k x p: the effect of the measurements on x_r.
    #[serde(rename = "B_y")]
    pub b_y: Matrix,
    /// C, rows x k.
    #[serde(rename = "C")]
    pub c: Matrix,
    /// D_u, rows x m: the effect of the commands on r.
    #[serde(rename = "D_u")]
    pub d_u: Matrix,
    /// D_y, rows x p: the effect of the measurements on r.
    #[serde(rename = "D_y")]
    pub d_y: Matrix,
    /// Maps the initial estimate of the states to the initial x_r, k x n.
    pub start: Matrix,
    /// The faults that `fault_isolated` counts, from 1.
    pub faults: Vec<String>,
    /// The tests. Each test takes the next `residuals` rows of r, so that together the tests take all rows.
    pub tests: Vec<TestDesign>,
}

/// A test: of one residual by cumulative sums (`drift`), or of the mean of one or more residuals over a `window`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TestDesign {
    /// The name of the test and of its output.
    pub name: String,
    /// The number of rows of r that the test takes.
    pub residuals: usize,
    /// kappa of the cumulative sums.
    pub drift: Option<f64>,
    /// The number of samples of a window.
    pub window: Option<u32>,
    /// The value of the statistic above which there is an alarm.
    pub threshold: f64,
    /// For each fault whether this test reacts to it.
    pub reacts: Vec<bool>,
}

impl DetectionDesign {
    /// The matrices with their names and their required numbers of rows and columns.
    fn shapes(&self, design: &Design) -> [(&'static str, &Matrix, (usize, usize)); 7] {
        let (k, rows) = (self.a.rows, self.c.rows);
        let (m, p) = (design.actuators.len(), design.measurements.len());
        [
            ("detection.A", &self.a, (k, k)),
            ("detection.B_u", &self.b_u, (k, m)),
            ("detection.B_y", &self.b_y, (k, p)),
            ("detection.C", &self.c, (rows, k)),
            ("detection.D_u", &self.d_u, (rows, m)),
            ("detection.D_y", &self.d_y, (rows, p)),
            ("detection.start", &self.start, (k, design.states.len())),
        ]
    }

    /// Describes the first contradiction: a list or matrix of a wrong size, or an entry that is missing or must not be
    /// stated.
    pub(super) fn contradiction(&self, design: &Design) -> Option<String> {
        let lists = [("faults", self.faults.len()), ("tests", self.tests.len())];
        if let Some((name, _)) = lists.iter().find(|(_, count)| *count == 0) {
            return Some(format!("detection.{name} is empty, expected at least one entry"));
        }
        for (name, matrix, (rows, columns)) in self.shapes(design) {
            let (actual_rows, actual_columns) = (matrix.rows, matrix.columns);
            if (actual_rows, actual_columns) != (rows, columns) {
                return Some(format!(
                    "{name} is {actual_rows} x {actual_columns}, expected {rows} x {columns}"
                ));
            }
        }
        let stated = self.sample_time.is_some();
        if stated == design.sample_time.is_some() {
            let reason = if stated {
                "is stated, expected none: a sampled controller tests in each sample"
            } else {
                "is missing, expected the time in s between two tests of a continuous controller"
            };
            return Some(format!("detection.sample_time {reason}"));
        }
        let rows = self.c.rows;
        let assigned: usize = self.tests.iter().map(|test| test.residuals).sum();
        if rows != assigned {
            return Some(format!(
                "the tests take {assigned} residuals, detection.C has {rows} rows"
            ));
        }
        self.tests.iter().find_map(|test| self.contradiction_of(test))
    }

    fn contradiction_of(&self, test: &TestDesign) -> Option<String> {
        let (name, length, expected) = (&test.name, test.reacts.len(), self.faults.len());
        if length != expected {
            return Some(format!(
                "detection test {name}: reacts has {length} entries, expected {expected}, one for each fault"
            ));
        }
        match (test.drift, test.window, test.residuals) {
            (Some(_), None, 1) => None,
            (None, Some(window), 1..) if window > 0 => None,
            (Some(_), None, count) => Some(format!(
                "detection test {name}: cumulative sums of {count} residuals, expected 1"
            )),
            _ => Some(format!(
                "detection test {name}: expected drift, or window and residuals of at least 1"
            )),
        }
    }

    /// The first number that is out of its range.
    #[must_use]
    pub fn refused_number(&self, design: &Design) -> Option<Refusal> {
        let mut shapes = self.shapes(design).into_iter();
        let refused = shapes.find_map(|(name, matrix, _)| Refusal::of_matrix(name, matrix));
        if refused.is_some() {
            return refused;
        }
        let positive = |value: &f64| *value > 0.0 && value.is_finite();
        for test in &self.tests {
            for (what, value) in [("threshold", Some(test.threshold)), ("drift", test.drift)] {
                if let Some(value) = value.filter(|value| !positive(value)) {
                    let what = format!("detection test {}: {what}", test.name);
                    return Some(Refusal::new(what, value, "above 0"));
                }
            }
        }
        if let Some(value) = self.sample_time.filter(|value| !positive(value)) {
            return Some(Refusal::new("detection.sample_time".to_owned(), value, "more than 0 s"));
        }
        (!(self.from >= 0.0 && self.from.is_finite()))
            .then(|| Refusal::new("detection.from".to_owned(), self.from, "a time in s from 0"))
    }
}
