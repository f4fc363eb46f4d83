//! The detection of a controller: its matrices and tests as data. `fmu-controller/src/detection.rs` has the equations.

use aso_controller::design::detection::{DetectionDesign, TestDesign};
use nalgebra::DMatrix;

use super::constants::Constants;
use super::parts::{dense, first_at};
use super::symbols::{Kind, Vector};
use crate::Error;

/// The detection of a design.
pub(super) struct Detection {
    /// The first sample whose residuals are tested; at least 1, as the sample at the start has none.
    pub(super) first_tested: u32,
    /// Maps the initial deviations of the states to the initial x_r, k x n.
    pub(super) start: DMatrix<f64>,
    /// The faults that a decision counts from 1.
    pub(super) faults: Vec<String>,
    pub(super) method: Method,
    /// The tests, all with `drift` or all with `window`.
    pub(super) tests: Vec<TestDesign>,
}

/// The method of all tests of a detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// Two cumulative sums of one residual.
    Cusum,
    /// The squared norm of the mean of one or more residuals over a window.
    Window,
}

impl Detection {
    /// The detection of a design file with this sample time in s; an error if `from` is beyond 2^32 samples, or if the
    /// tests have both methods.
    pub(super) fn of(file: DetectionDesign, sample_time: f64) -> Result<Self, Error> {
        let first_tested = first_at("detection.from", file.from, sample_time)?;
        let cusums = file.tests.iter().filter(|test| test.drift.is_some()).count();
        let method = match file.tests.len() - cusums {
            0 => Method::Cusum,
            windows if windows == file.tests.len() => Method::Window,
            _ => {
                let text = "detection has cumulative sums and windows; only the FMU can have both";
                return Err(Error(text.to_owned()));
            }
        };
        Ok(Self {
            first_tested: first_tested.max(1),
            start: dense(&file.start),
            faults: file.faults,
            method,
            tests: file.tests,
        })
    }

    /// The real numbers of the tests and of the start of the filter, for a check of their range.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> {
        let tests = self.tests.iter().flat_map(|test| [test.drift, Some(test.threshold)]);
        self.start.iter().copied().chain(tests.flatten())
    }

    /// The tables of real numbers: the start of the filter, then drifts and thresholds of the tests.
    pub(super) fn tables(&self) -> Vec<Constants> {
        let of_tests = |name, meaning, value: fn(&TestDesign) -> f64| {
            Constants::vector(name, meaning, Kind::Test, self.tests.iter().map(value).collect())
        };
        let meaning = "start of x_r, times the deviations of the states";
        let kinds = [Kind::ResidualState, Kind::State];
        let mut all = vec![Constants::matrices("start_r", meaning, kinds, None, [&self.start])];
        if self.method == Method::Cusum {
            all.push(of_tests("drift", "tests", |test| test.drift.unwrap_or_default()));
        }
        let meaning = if self.method == Method::Cusum { "" } else { "tests" };
        all.push(of_tests("threshold", meaning, |test| test.threshold));
        all
    }

    /// The number of real numbers in an instance besides the vectors of the filter: statistics and sums.
    pub(super) fn stored(&self) -> usize {
        self.tests.len()
            + match self.method {
                Method::Cusum => 2 * self.tests.len(),
                Method::Window => self.tests.iter().map(|test| test.residuals).sum(),
            }
    }

    /// The number of 32-bit integers in an instance besides the counter of samples. For each test: the starts of both
    /// sums, or the start of a window and its number of samples. Then alarm, onset and isolated fault.
    pub(super) fn counters(&self) -> usize {
        2 * self.tests.len() + 3
    }

    /// The bytes of the constants that are no real numbers: reactions, and residuals and lengths of windows.
    pub(super) fn integer_bytes(&self) -> usize {
        let windows = if self.method == Method::Window { 8 * self.tests.len() } else { 0 };
        windows + self.tests.len() * self.faults.len()
    }

    /// The number of flags in an instance: the alarms of the tests.
    pub(super) fn flags(&self) -> usize {
        self.tests.len()
    }
}

/// The matrices of the filter, x_r[k+1] = `A_r` x_r[k] + `B_ru` u[k] + `B_ry` y[k], and of the residuals, r[k] = `C_r`
/// x_r[k] + `D_ru` u[k] + `D_ry` y[k], with their names.
pub(super) fn matrices(file: &DetectionDesign) -> [(&'static str, &aso_controller::Matrix); 6] {
    [
        ("A_r", &file.a),
        ("B_ru", &file.b_u),
        ("B_ry", &file.b_y),
        ("C_r", &file.c),
        ("D_ru", &file.d_u),
        ("D_ry", &file.d_y),
    ]
}

/// The vectors that an instance stores for the filter.
pub(super) const STORED: [Vector; 2] = [Vector::StoredXR, Vector::StoredResidual];
