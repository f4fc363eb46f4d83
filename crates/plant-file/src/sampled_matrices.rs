//! Matrices of a plant in sampled time.

use control::Domain;
use control::eigen::eigenvalues;
use control::hold::{continuous, zero_order_hold};
use files::Table;
use nalgebra::DMatrix;

use crate::Sampling;
use crate::read::{Result, is_first, refuse};

/// Size of an entry of the matrix logarithm that counts as rounding, relative to the geometric mean of the largest
/// entries in its row and column.
const ROUNDING: f64 = 1e-13;

/// Modulus below which an eigenvalue of a sampled A counts as zero: rounding moves the zero eigenvalues of a chain of
/// three registers to 1e-5.
const ZERO: f64 = 1e-4;

/// The plant of sampled matrices: the continuous plant x' = A x + B u with these samples, if one exists, otherwise the
/// plant in sampled time.
#[derive(Clone)]
pub struct SampledMatrices {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// The time domain of A and B.
    pub domain: Domain,
    /// Why no continuous plant has these samples, in a sentence; `None` if such a plant exists.
    pub only_samples: Option<String>,
    /// The integral of e^(A s) over a sample, n x n; the identity if `a` is in sampled time.
    hold_integral: DMatrix<f64>,
}

impl SampledMatrices {
    /// Reads `matrices`; `pair`: A and B of the file. `None` if the matrices are continuous.
    ///
    /// # Errors
    ///
    /// There is no `sample_time`, the file has a family or a schedule, or the logarithm of the matrices cannot be
    /// computed.
    pub fn read(
        file: &Table<'_>,
        sampling: Option<Sampling>,
        pair: (&DMatrix<f64>, &DMatrix<f64>),
    ) -> Result<Option<Box<Self>>> {
        let Some(entry) = file.get("matrices") else { return Ok(None) };
        if is_first(&entry, ["continuous", "sampled"])? {
            return Ok(None);
        }
        let Some(Sampling { period, .. }) = sampling else {
            let message =
                "expected `sample_time`, too: the time, in s, between the samples of A and B";
            return Err(entry.error(message));
        };
        let message = "expected continuous matrices, without `matrices = \"sampled\"`";
        refuse(file, &["family", "schedule"], message)?;
        let refuse =
            |error: control::Error| entry.error(format!("sampled every {period} s: {error}"));
        let identity = DMatrix::identity(pair.0.nrows(), pair.0.nrows());
        let (a, b) = match continuous(pair.0, pair.1, period) {
            Err(control::Error::NoContinuousPlant) => {
                return Ok(Some(Box::new(Self {
                    a: pair.0.clone(),
                    b: pair.1.clone(),
                    domain: Domain::Sampled { period },
                    only_samples: Some(only_samples(pair.0, period)),
                    hold_integral: identity,
                })));
            }
            result => result.map_err(refuse)?,
        };
        let a = without_rounding(&a);
        let (_, hold_integral) = zero_order_hold(&a, &identity, period).map_err(refuse)?;
        let domain = Domain::Continuous;
        Ok(Some(Box::new(Self { a, b, domain, only_samples: None, hold_integral })))
    }

    /// Converts columns of further inputs, such as faults, from sampled time to the time domain of `a`; NaN if rounding
    /// makes the integral singular.
    pub fn input_columns(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        // The integral has no zero eigenvalue if the logarithm exists.
        let solved = self.hold_integral.clone().lu().solve(columns);
        solved.unwrap_or_else(|| columns.map(|_| f64::NAN))
    }
}

/// Says why no continuous plant has the samples. For zero eigenvalues, mostly of a delay, also how to state it.
fn only_samples(a: &DMatrix<f64>, period: f64) -> String {
    let eigenvalues = eigenvalues(a).unwrap_or_default();
    let zeros = eigenvalues.iter().filter(|value| value.norm() < ZERO).count();
    let reason = if zeros > 0 {
        "A has an eigenvalue that is zero"
    } else if eigenvalues.iter().any(|value| value.im == 0.0 && value.re < 0.0) {
        "A has an eigenvalue that is negative"
    } else {
        "rounding hides the logarithm of A"
    };
    let fact = format!(
        "no continuous plant has these samples every {period} s, as {reason}: nothing is said about the time between the \
         samples"
    );
    if zeros == 0 {
        return fact;
    }
    #[expect(clippy::cast_precision_loss, reason = "a number of states")]
    let delay = format!("{:.6}", zeros as f64 * period);
    let delay = delay.trim_end_matches('0').trim_end_matches('.');
    format!(
        "{fact}. If {zeros} of them {} of a delay: A, B and C without the states of the delay, and `delay = {delay}` in the \
         actuator or the measurement, are examined between the samples, too",
        if zeros == 1 { "is" } else { "are" }
    )
}

/// A with 0 in place of entries that are rounding errors of the logarithm.
fn without_rounding(a: &DMatrix<f64>) -> DMatrix<f64> {
    let size = |i: usize, j: usize| (a.row(i).amax() * a.column(j).amax()).sqrt();
    DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| {
        if a[(i, j)].abs() <= ROUNDING * size(i, j) { 0.0 } else { a[(i, j)] }
    })
}
