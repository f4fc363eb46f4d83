//! `summary.json`: the claims, and theorem 1 for the controller of the run.

use std::path::Path;

use anyhow::bail;
use control::aso::{Estimator, FaultyPlant, Gains};
use control::eigen::eigenvalues;
use control::theorem1::{Certificate, certify};
use fmu_description::Kind;
use master::{Probe, System};
use nalgebra::DMatrix;
use serde::Serialize;

use crate::claims::Claim;
use crate::outputs;

/// The design parameter alpha of equation (12) of the paper; alpha cancels in delta.
const ALPHA: f64 = 1.0;

/// The content of `summary.json`.
#[derive(Serialize)]
pub(crate) struct Summary<'a> {
    pub(crate) scenario: String,
    pub(crate) method: &'static str,
    pub(crate) extrapolation: &'static str,
    /// Communication step in s.
    pub(crate) communication_step: f64,
    /// Stop time in s.
    pub(crate) stop_time: f64,
    /// Time reached in s.
    pub(crate) reached: f64,
    /// The reason if the run failed or an FMU requested the end; none at the stop time and after a signal.
    pub(crate) lost: Option<&'a str>,
    /// Time in s at which the pendulum passed the horizontal.
    pub(crate) fell: Option<f64>,
    pub(crate) settings: Vec<String>,
    pub(crate) claims: &'a [Claim],
    pub(crate) design: &'a ControllerCertificate,
}

/// The controller with the result of theorem 1.
#[derive(Serialize)]
pub(crate) struct ControllerCertificate {
    #[serde(rename = "K_x")]
    k_x: Rows,
    #[serde(rename = "K_f")]
    k_f: Rows,
    #[serde(rename = "L_x")]
    l_x: Rows,
    #[serde(rename = "L_f")]
    l_f: Rows,
    /// Eigenvalues of A + B K_x: real and imaginary parts.
    controller_eigenvalues: Vec<[f64; 2]>,
    /// Eigenvalues of A_0 - L C_0.
    observer_eigenvalues: Vec<[f64; 2]>,
    theorem_1: Theorem1,
}

/// The result of theorem 1, or the reason why it does not apply.
#[derive(Serialize)]
#[serde(untagged)]
enum Theorem1 {
    Holds(Box<Numbers>),
    Fails { reason: String },
}

#[derive(Serialize)]
struct Numbers {
    alpha: f64,
    /// Bound of the fault in N: the static friction F_s of the plant.
    beta: f64,
    #[serde(rename = "P")]
    p: Rows,
    p_smallest_eigenvalue: f64,
    p_largest_eigenvalue: f64,
    /// Residual of the Lyapunov equation (12) of the paper: the largest ratio of an entry to the sum of its
    /// absolute terms.
    residual: f64,
    delta: f64,
    note: &'static str,
    /// The rank of the controllability matrix, and the rank that theorem 1 requires.
    controllability_rank: [usize; 2],
    observability_rank: [usize; 2],
}

type Rows = Vec<Vec<f64>>;

fn rows(matrix: &DMatrix<f64>) -> Rows {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

impl ControllerCertificate {
    /// Evaluates theorem 1 for the controller in `system`, whose matrices are read from its
    /// parameters. `beta` is the bound of the fault in N.
    pub(crate) fn of(system: &mut System, beta: f64) -> anyhow::Result<Self> {
        let mut matrix = |name: &str| read_matrix(system, name);
        let (a, b, c) = (matrix("A")?, matrix("B")?, matrix("C")?);
        let plant = FaultyPlant::with_constant_faults(a, b, c, matrix("F_a")?);
        let gains = Gains {
            estimator: Estimator::Prediction,
            k_x: matrix("K_x")?,
            k_f: matrix("K_f")?,
            l_x: matrix("L_x")?,
            l_f: matrix("L_f")?,
            p_f: None,
            integral: None,
        };
        let pairs = |matrix: &DMatrix<f64>| -> anyhow::Result<Vec<[f64; 2]>> {
            Ok(eigenvalues(matrix)?.iter().map(|value| [value.re, value.im]).collect())
        };
        Ok(Self {
            controller_eigenvalues: pairs(&gains.controlled_dynamics(&plant))?,
            observer_eigenvalues: pairs(&gains.error_dynamics(&plant))?,
            theorem_1: match certify(&plant, &gains, ALPHA, beta) {
                Ok(certificate) => Theorem1::Holds(Box::new(numbers(&certificate))),
                Err(error) => Theorem1::Fails { reason: error.to_string() },
            },
            k_x: rows(&gains.k_x),
            k_f: rows(&gains.k_f),
            l_x: rows(&gains.l_x),
            l_f: rows(&gains.l_f),
        })
    }
}

fn numbers(certificate: &Certificate) -> Numbers {
    let rank = |rank: &control::rank::Rank| [rank.rank, rank.n];
    Numbers {
        alpha: certificate.alpha,
        beta: certificate.beta,
        p: rows(&certificate.p),
        p_smallest_eigenvalue: certificate.p_range.0,
        p_largest_eigenvalue: certificate.p_range.1,
        residual: certificate.residual,
        delta: certificate.delta,
        note: "P grows in proportion to alpha, which therefore cancels in delta (16)",
        controllability_rank: rank(&certificate.controllability),
        observability_rank: rank(&certificate.observability),
    }
}

/// Reads the matrix parameter `name` of the controller, whose elements are the real variables `name[i,j]`. The first
/// row and the first column state its size; an element that is missing then is an error.
fn read_matrix(system: &mut System, name: &str) -> anyhow::Result<DMatrix<f64>> {
    let slave = system.port(&format!("controller.{name}[1,1]"))?.slave;
    let description = system.slaves[slave].1.description();
    let position = |row: usize, column: usize| {
        let element = format!("{name}[{row},{column}]");
        description
            .variables
            .iter()
            .position(|variable| variable.name == element && matches!(variable.kind, Kind::Real(_)))
    };
    let count = description.variables.len();
    let row_count = (1..=count).take_while(|row| position(*row, 1).is_some()).count();
    let column_count = (1..=count).take_while(|column| position(1, *column).is_some()).count();
    let mut ports = Vec::new();
    for row in 1..=row_count {
        for column in 1..=column_count {
            let Some(variable) = position(row, column) else {
                bail!("the controller has no variable {name}[{row},{column}]");
            };
            ports.push(master::Port { slave, variable });
        }
    }
    let mut values = vec![0.0; ports.len()];
    Probe::new(system, &ports).read(system, 0.0, &mut values)?;
    Ok(DMatrix::from_row_slice(row_count, column_count, &values))
}

/// Writes `value` as JSON to `path`, completely or not at all.
pub(crate) fn write(value: &impl Serialize, path: &Path) -> anyhow::Result<()> {
    outputs::write(path, &serde_json::to_vec_pretty(value)?)
}
