//! The result: matrices, operating point and method.

use std::fmt::{self, Display, Formatter};

use nalgebra::DMatrix;

use super::parts::{Part, Parts, State};
use super::point::row_name;
use super::{Linearise, LineariseError, differences};
use fmu_import::Interface;

/// A dependence on a state that is left out is negligible if it is at most this fraction of the size of its row.
const NEGLIGIBLE: f64 = 1e-12;

/// x' = A x + B u + F f, y = C x + D u + G f, in the units of the variables.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrices {
    /// A, states x states.
    pub a: DMatrix<f64>,
    /// B, states x inputs.
    pub b: DMatrix<f64>,
    /// F, states x faults: the effect of the faults on the states.
    pub f: DMatrix<f64>,
    /// C, outputs x states.
    pub c: DMatrix<f64>,
    /// D, outputs x inputs: the direct feedthrough.
    pub d: DMatrix<f64>,
    /// G, outputs x faults: the effect of the faults on the outputs.
    pub g: DMatrix<f64>,
}

impl Matrices {
    /// Returns the matrices as one: [A, B, F; C, D, G].
    #[must_use]
    pub fn joined(&self) -> DMatrix<f64> {
        let Self { a, b, f, c, d, g } = self;
        let n = a.nrows();
        let mut all = DMatrix::zeros(n + c.nrows(), n + b.ncols() + f.ncols());
        for (row, blocks) in [(0, [a, b, f]), (n, [c, d, g])] {
            let mut column = 0;
            for block in blocks {
                all.view_mut((row, column), block.shape()).copy_from(block);
                column += block.ncols();
            }
        }
        all
    }
}

/// A state, input, fault or output at the operating point.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Name of the variable.
    pub name: String,
    /// Unit of the variable, if the FMU states one.
    pub unit: Option<String>,
    /// Value of the variable at the operating point.
    pub value: f64,
    /// The typical size of a change: see [`Linearise::typical`].
    pub typical: f64,
}

/// The method of a linearisation. `Display` writes it as a phrase for a report.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// Values of `fmi2GetDirectionalDerivative`.
    DirectionalDerivatives {
        /// The interface of the instance.
        interface: Interface,
        /// The largest contradiction to differences of the same FMU; `None` if there was no
        /// comparison or no contradiction is larger than ten times the error of the difference.
        disagreement: Option<Disagreement>,
    },
    /// Finite differences.
    FiniteDifferences {
        /// The differentiated quantity.
        how: Differences,
        /// Estimated error of each entry.
        errors: Box<Matrices>,
    },
}

/// The quantity that is differentiated by finite differences.
#[derive(Clone, Debug, PartialEq)]
pub enum Differences {
    /// `fmi2GetDerivatives` and outputs in model exchange.
    OfEquations {
        /// The largest step of each state and input, in its unit.
        steps: Vec<(String, f64)>,
    },
    /// Communication steps in co-simulation.
    OfSteps {
        /// The shortest communication step in s.
        step: f64,
        /// Number of steps of a run.
        count: usize,
        /// The height of the pulse of each input, in the unit of the input.
        heights: Vec<(String, f64)>,
        /// Relative prediction error for an input signal that the fit did not use.
        missed: f64,
    },
}

/// An entry for which directional derivative and difference quotient disagree.
#[derive(Clone, Debug, PartialEq)]
pub struct Disagreement {
    /// The differentiated quantity.
    pub of: String,
    /// The variable of differentiation.
    pub to: String,
    /// The value that `fmi2GetDirectionalDerivative` returns.
    pub derivative: f64,
    /// The difference quotient, extrapolated.
    pub difference: f64,
    /// The disagreement minus ten times the error, relative to the row's largest entry in units of typical sizes.
    pub relative: f64,
}

/// A linearised FMU.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearisation {
    /// The matrices A, B, F, C, D, G.
    pub matrices: Matrices,
    /// The states x with `x_0`.
    pub states: Vec<Signal>,
    /// The inputs u with `u_0`.
    pub inputs: Vec<Signal>,
    /// The faults f with `f_0`.
    pub faults: Vec<Signal>,
    /// The outputs y with `y_0`.
    pub outputs: Vec<Signal>,
    /// x' at the operating point, in the states' units per s; zero at an equilibrium.
    pub rates: Vec<f64>,
    /// The largest of `rates`, each relative to the sum of |`A_ij`|, |`B_ij`| and |`F_ij`| times
    /// the typical sizes. Far below one, the operating point is practically an equilibrium.
    pub residual: f64,
    /// The method that gave the matrices.
    pub method: Method,
}

impl Linearisation {
    /// Returns the largest estimated error of an entry, relative to the largest entry of its row in
    /// units of the typical sizes; `None` for directional derivatives.
    #[must_use]
    pub fn relative_error(&self) -> Option<f64> {
        let Method::FiniteDifferences { errors, .. } = &self.method else { return None };
        let columns = self.states.iter().chain(&self.inputs).chain(&self.faults);
        let sizes: Vec<f64> = columns.map(|signal| signal.typical).collect();
        let (values, errors) = (self.matrices.joined(), errors.joined());
        Some(relative_error(&errors, &values, &sizes))
    }
}

impl Display for Method {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Method::DirectionalDerivatives { interface, disagreement } => {
                let interface = match interface {
                    Interface::ModelExchange => "model exchange",
                    Interface::CoSimulation => "co-simulation",
                };
                write!(formatter, "directional derivatives of the FMU in {interface}")?;
                let Some(disagreement) = disagreement else { return Ok(()) };
                let Disagreement { of, to, derivative, difference, .. } = disagreement;
                write!(
                    formatter,
                    "; they contradict its own differences: d {of} / d {to} is {derivative} by \
                     derivative and {difference} by difference"
                )
            }
            Method::FiniteDifferences { how: Differences::OfEquations { .. }, .. } => {
                formatter.write_str("finite differences of the FMU's equations in model exchange")
            }
            Method::FiniteDifferences {
                how: Differences::OfSteps { step, count, missed, .. },
                ..
            } => write!(
                formatter,
                "finite differences over FMU states in co-simulation: {count} steps of {step} s \
                 and its multiples, relative prediction error for another input signal {missed:.1e}"
            ),
        }
    }
}

/// The result of one method, with all states of the FMU.
pub(super) struct RawResult {
    pub(super) states: Vec<Part>,
    pub(super) x: Vec<f64>,
    pub(super) u: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) rates: Vec<f64>,
    /// Rows: derivatives of the states, outputs. Columns: states, inputs, faults.
    pub(super) jacobian: DMatrix<f64>,
    pub(super) method: MethodResult,
}

/// The method, before the errors are split into blocks.
pub(super) enum MethodResult {
    Derivatives(Interface, Option<Disagreement>),
    Differences(Differences, DMatrix<f64>),
}

/// Returns `part` / `whole`; 0 if `part` is 0, also for 0 / 0.
fn ratio(part: f64, whole: f64) -> f64 {
    if part == 0.0 { 0.0 } else { part / whole }
}

/// Returns the largest entry of a row in units of the typical sizes.
fn row_size(jacobian: &DMatrix<f64>, row: usize, scales: &[f64]) -> f64 {
    scales.iter().enumerate().map(|(j, scale)| jacobian[(row, j)].abs() * scale).fold(0.0, f64::max)
}

/// Returns the largest error relative to the largest entry of its row, in units of typical sizes.
pub(super) fn relative_error(errors: &DMatrix<f64>, values: &DMatrix<f64>, scales: &[f64]) -> f64 {
    let relative = |row| ratio(row_size(errors, row, scales), row_size(values, row, scales));
    (0..values.nrows()).map(relative).fold(0.0, f64::max)
}

/// Returns the entry in which directional derivatives and differences contradict most; `None` if no contradiction
/// exceeds ten times the error of the difference by 1e-9 of the row.
pub(super) fn disagreement(
    parts: &Parts,
    states: &[State],
    scales: &[f64],
    jacobian: &DMatrix<f64>,
    differences: &differences::Differences,
) -> Option<Disagreement> {
    let mut worst: Option<Disagreement> = None;
    for row in 0..jacobian.nrows() {
        let size = row_size(jacobian, row, scales);
        let size = size.max(row_size(&differences.jacobian, row, scales));
        for (column, scale) in scales.iter().enumerate() {
            let (derivative, difference) =
                (jacobian[(row, column)], differences.jacobian[(row, column)]);
            let beyond = (derivative - difference).abs() - 10.0 * differences.errors[(row, column)];
            let relative = ratio(beyond.max(0.0) * scale, size);
            if relative > 1e-9 && worst.as_ref().is_none_or(|known| relative > known.relative) {
                let to = states.iter().map(|state| &state.part).chain(&parts.inputs).nth(column);
                worst = Some(Disagreement {
                    of: row_name(states, parts, row),
                    to: to.map_or_else(String::new, |part| part.name.clone()),
                    derivative,
                    difference,
                    relative,
                });
            }
        }
    }
    worst
}

/// Selects the states of the request and splits the Jacobian into its blocks. Same errors as [`select_states`].
pub(super) fn assemble(
    parts: &Parts,
    request: &Linearise,
    raw: RawResult,
) -> Result<Linearisation, LineariseError> {
    let chosen = select_states(parts, request, &raw)?;
    let all = raw.states.len();
    let signal = |part: &Part, value: f64| Signal {
        name: part.name.clone(),
        unit: part.unit.clone(),
        value,
        typical: part.scale(value),
    };
    let signals = |list: &[Part], values: &[f64]| {
        list.iter().zip(values).map(|(part, &value)| signal(part, value)).collect::<Vec<_>>()
    };
    let mut inputs = signals(&parts.inputs, &raw.u);
    let faults = inputs.split_off(parts.controlled);
    let blocks = |m: &DMatrix<f64>| blocks(m, &chosen, all, parts);
    let scales = super::scales(&raw.states, &raw.x, &parts.inputs, &raw.u);
    let residual = |&row: &usize| {
        let terms = scales.iter().enumerate();
        let sum: f64 = terms.map(|(j, scale)| raw.jacobian[(row, j)].abs() * scale).sum();
        ratio(raw.rates[row].abs(), sum)
    };
    Ok(Linearisation {
        matrices: blocks(&raw.jacobian),
        states: chosen.iter().map(|&k| signal(&raw.states[k], raw.x[k])).collect(),
        outputs: signals(&parts.outputs, &raw.y),
        rates: chosen.iter().map(|&k| raw.rates[k]).collect(),
        residual: chosen.iter().map(residual).fold(0.0, f64::max),
        inputs,
        faults,
        method: match raw.method {
            MethodResult::Derivatives(interface, disagreement) => {
                Method::DirectionalDerivatives { interface, disagreement }
            }
            MethodResult::Differences(how, errors) => {
                Method::FiniteDifferences { how, errors: Box::new(blocks(&errors)) }
            }
        },
    })
}

/// Splits a matrix whose first rows and columns belong to `all` states into the blocks of the states `chosen`.
fn blocks(m: &DMatrix<f64>, chosen: &[usize], all: usize, parts: &Parts) -> Matrices {
    let rates = m.select_rows(chosen);
    let outputs = m.rows(all, parts.outputs.len()).into_owned();
    let (controlled, faults) = (parts.controlled, parts.inputs.len() - parts.controlled);
    Matrices {
        a: rates.select_columns(chosen),
        b: rates.columns(all, controlled).into_owned(),
        f: rates.columns(all + controlled, faults).into_owned(),
        c: outputs.select_columns(chosen),
        d: outputs.columns(all, controlled).into_owned(),
        g: outputs.columns(all + controlled, faults).into_owned(),
    }
}

/// Returns the positions of the requested states, or of all states if the request names none. It is an error if a name
/// is no state, or if a remaining row depends on a state that is left out.
fn select_states(
    parts: &Parts,
    request: &Linearise,
    raw: &RawResult,
) -> Result<Vec<usize>, LineariseError> {
    let all = raw.states.len();
    if request.states.is_empty() {
        return Ok((0..all).collect());
    }
    let position = |name: &String| {
        super::parts::find(parts.description, name)?;
        let known = raw.states.iter().position(|part| part.name == *name);
        known.ok_or_else(|| {
            let known: Vec<_> = raw.states.iter().map(|part| part.name.as_str()).collect();
            LineariseError::Role {
                name: name.clone(),
                actual: format!("no continuous state, which are {}", known.join(", ")),
                expected: "one of them",
            }
        })
    };
    let chosen = request.states.iter().map(position).collect::<Result<Vec<_>, _>>()?;
    let scales = super::scales(&raw.states, &raw.x, &parts.inputs, &raw.u);
    let rows = chosen.iter().copied().chain(all..raw.jacobian.nrows());
    for row in rows {
        let size = row_size(&raw.jacobian, row, &scales);
        for left_out in (0..all).filter(|column| !chosen.contains(column)) {
            let error = match &raw.method {
                MethodResult::Derivatives(..) => 0.0,
                MethodResult::Differences(_, errors) => errors[(row, left_out)],
            };
            let entry = raw.jacobian[(row, left_out)].abs();
            if entry > error && entry * scales[left_out] > NEGLIGIBLE * size {
                let dependent = match raw.states.get(row) {
                    Some(state) => format!("der({})", state.name),
                    None => parts.outputs[row - all].name.clone(),
                };
                let left_out = raw.states[left_out].name.clone();
                return Err(LineariseError::Coupled { left_out, dependent });
            }
        }
    }
    Ok(chosen)
}
