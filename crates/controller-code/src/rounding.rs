//! A bound of the differences between single and double precision.
//!
//! Each vector of a sample is computed with an error of at most
//!
//! ```text
//! kappa s,   s = the largest deviations of x_hat, f_hat, y and u from the operating point, and 1
//! ```
//!
//! from the rounding of its constants, products and partial sums: r |a| |v| for a product a v, r times the magnitudes
//! added so far for a sum, r = 2^-24 (N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2002, equation
//! (2.4) and section 3.1). The errors w of all vectors enter the loop of plant and controller,
//!
//! ```text
//! d[k+1] = A d[k] + B w[k],   [du; df_hat] = C d[k] + D w[k],   d = [dx; dx_hat; df_hat]
//! ```
//!
//! for the differences d, du, `df_hat` from exact arithmetic. With the peak-to-peak gains G of this system, G kappa s
//! bounds the differences of the outputs u and f_hat. The bound holds in the loop of the design, while faults are
//! compensated and no command is at a limit. s has the signals of single precision. If all their differences are at
//! most M s and the spectral radius of M is below 1, they are bounded by the signals of double precision: rounding does
//! not make the loop unstable. The residuals of a detection are further outputs, and x_r is part of d; their size
//! follows from those of y and u. The bound takes the worst case of every rounding; errors of both signs cancel in
//! practice. A scheduled loop is not such a system, and has no bound.
//!
//! The law g(s) = rho s / (|s| + delta) of a sliding mode is not linear, but the slope of each of its chords is
//! between 0 and c = rho / delta. So dg = (c / 2) ds + v with |v| <= (c / 2) |ds|, and v is one more input of the
//! linear system, ds one more output: with its gains `G_s`, `G_v` from w and v to ds,
//!
//! ```text
//! |ds| <= G_s kappa s + G_v (c / 2) |ds|,   so   |ds| <= (1 - G_v c / 2)^-1 G_s kappa s
//! ```
//!
//! if the spectral radius of the matrix `G_v` c / 2, which has no negative element, is below 1 (the small-gain
//! theorem; M. A. Dahleh and I. J. Diaz-Bobillo, Control of Uncertain Systems, 1995, section 7.3).

mod analysis;
mod rounded;

use control::response::peak_gain;
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

use self::analysis::Analysis;
use super::controller::Controller;
use super::fields::Fields;
use super::symbols::{Kind, Matrix};
use super::text::{aligned, filled};

/// A factor of the bound that covers products of rounding errors, and the rounding of its printed digits.
const SECOND_ORDER: f64 = 1.001;
/// The relative width to which the peak gains are enclosed.
const WIDTH: f64 = 0.02;
/// The largest order of the loop whose peak gains are computed.
const LARGEST_ORDER: usize = 60;
/// The fraction of a signal above which its rounding errors are a warning.
const COARSE: f64 = 0.01;

/// Why the stability of a loop is not proven.
const UNPROVEN: &str = "at worst, the errors of all signals are larger than the signals";

/// The bound, or the reason why there is none.
pub(super) struct RoundingBound {
    /// The bound: rows are commands, faults and residuals, columns are signals in the order of [`Kind::ALL`], then 1.
    /// If there is none, the reason.
    bound: Result<DMatrix<f64>, String>,
    /// 1 - |lambda| for the slowest eigenvalue lambda of the loop; NaN if this eigenvalue is not known.
    slowest: f64,
    /// Whether the bound proves that the loop with the controller in single precision is stable.
    contracts: bool,
}

impl RoundingBound {
    /// Computes the bound. There is none for a scheduled controller, for a loop of more than [`LARGEST_ORDER`] states,
    /// if the peak gains cannot be computed, or if the slope of a sliding-mode law changes too much.
    pub(super) fn of(controller: &Controller) -> Self {
        if controller.schedule.is_some() {
            let reason = "matrices and operating point change with the scheduling variable";
            return Self::none(reason);
        }
        let state_of_filter = match residual_states(controller) {
            Ok(gains) => gains,
            Err(error) => return Self::none(&error.to_string()),
        };
        let analysis = Analysis::of(controller, state_of_filter);
        let order = analysis.order();
        if order > LARGEST_ORDER {
            let reason =
                format!("{order} states of plant and controller are too many to compute it");
            return Self::none(&reason);
        }
        let system = analysis.system();
        let domain = Domain::Sampled { period: controller.sample_time };
        let slowest = control::stability::instability(&system.a, domain)
            .map_or(f64::NAN, |instability| -instability);
        let gains = peak_gain(&system, WIDTH).map_err(|error| error.to_string());
        let all = gains.and_then(|gains| analysis.bound(&gains.upper));
        let all = all.map(|bound| bound * SECOND_ORDER);
        let contracts = all.as_ref().is_ok_and(|all| analysis.contracts(all));
        let outputs = [Kind::Actuator, Kind::Fault, Kind::Residual];
        let outputs = outputs.map(|kind| kind.count(controller)).iter().sum();
        let bound = all.map(|all| all.rows(0, outputs).into_owned());
        Self { bound, slowest, contracts }
    }

    fn none(reason: &str) -> Self {
        Self { bound: Err(reason.to_owned()), slowest: f64::NAN, contracts: false }
    }

    /// Sentences on signals that rounding may change by more than [`COARSE`], on a loop that may become unstable, or
    /// on a bound that does not exist.
    pub(super) fn warnings(&self, controller: &Controller) -> Vec<String> {
        let bound = match &self.bound {
            Ok(bound) => bound,
            Err(reason) => {
                return vec![format!("float: no bound of the rounding errors: {reason}")];
            }
        };
        let first = |kind| first_signal(kind, controller);
        let commands = controller.actuators.iter().enumerate();
        let commands =
            commands.map(|(j, signal)| (&signal.name, bound[(j, first(Kind::Actuator) + j)]));
        let (m, faults) = (controller.actuators.len(), controller.faults.iter().enumerate());
        let faults =
            faults.map(|(i, signal)| (&signal.name, bound[(m + i, first(Kind::Fault) + i)]));
        let coarse = commands.chain(faults).filter(|(_, part)| *part > COARSE);
        let unstable = (!self.contracts).then(|| {
            format!(
                "float: nothing excludes that rounding makes the loop unstable: {UNPROVEN}; use double, or a longer \
                 sample time"
            )
        });
        let coarse = coarse
            .map(|(name, part)| {
                format!(
                    "float: rounding may change {name} by {:.2} % of itself: the slowest eigenvalue of \
                     the loop is 1 - {:.1e}, and rounding errors add up over its time; use double, or a \
                     longer sample time",
                    100.0 * part,
                    self.slowest
                )
            });
        unstable.into_iter().chain(coarse).collect()
    }

    /// The lines about the bound in the description of the code.
    pub(super) fn lines(&self, controller: &Controller, fields: &Fields) -> Vec<String> {
        let bound = match &self.bound {
            Ok(bound) => bound,
            Err(reason) => return filled(&format!("No bound of the difference: {reason}.")),
        };
        let mut outputs: Vec<_> =
            fields.actuators.iter().map(|field| format!("Commands.{field}")).collect();
        outputs.extend(fields.faults.iter().map(|field| format!("Estimates.f_hat_{field}")));
        let residuals = bound.nrows() - outputs.len();
        outputs.extend((0..residuals).map(|k| format!("Detection.residual[{k}]")));
        let mut signals = named("x_hat_", &fields.states);
        signals.extend(named("f_hat_", &fields.faults));
        signals.extend(named("", &fields.measurements));
        signals.extend(named("", &fields.actuators));
        signals.extend(named("", &fields.references));
        signals.extend(named("x_i_", &fields.integrals));
        signals.push("1".to_owned());
        let intact =
            if controller.reconfiguration.is_some() { " and no actuator gone" } else { "" };
        let used = if controller.checks_measurements() { " and no measurement held" } else { "" };
        let settled = if controller.transfer.is_some() { " and u_t = 0" } else { "" };
        let mut lines = filled(&format!(
            "In the loop with the plant of the design, while compensating and with no command at a limit{intact}{used}{settled}, \
             an output differs by at most the sum over the signals of coefficient times largest \
             deviation from the operating point (last row: a constant):"
        ));
        if !self.contracts {
            let text =
                format!("Nothing excludes that rounding makes the loop unstable: {UNPROVEN}.");
            lines.extend(filled(&text));
        }
        for (output, row) in outputs.into_iter().zip(bound.row_iter()) {
            lines.extend([String::new(), output]);
            let rows = signals.iter().zip(row.iter());
            let rows: Vec<_> =
                rows.map(|(name, error)| [format!("  {name}"), format!("{error:.4e}")]).collect();
            lines.extend(aligned(&rows));
        }
        lines
    }
}

/// A bound of the elements of `x_r` in a run from the operating point, states x signals (the last column, of 1, is
/// zero): the peak-to-peak gains of the filter from the commands and the measurements. No rows without a detection. An
/// error if a gain cannot be computed.
fn residual_states(controller: &Controller) -> Result<DMatrix<f64>, Error> {
    let signals: usize = Kind::ALL.map(|kind| kind.count(controller)).iter().sum();
    let k = Kind::ResidualState.count(controller);
    let mut all = DMatrix::zeros(k, signals + 1);
    for (kind, b) in [(Kind::Actuator, Matrix::ResidualBu), (Kind::Measurement, Matrix::ResidualBy)]
    {
        let (Some(a), Some(b)) = (Matrix::ResidualA.of(controller), b.of(controller)) else {
            continue;
        };
        let domain = Domain::Sampled { period: controller.sample_time };
        let unit = DMatrix::identity(k, k);
        let system = StateSpace::strictly_proper(a.clone(), b.clone(), unit, domain);
        let gain = peak_gain(&system, WIDTH)?.upper;
        all.columns_mut(first_signal(kind, controller), b.ncols()).copy_from(&gain);
    }
    Ok(all)
}

/// The position of the first signal of a kind in the order of [`Kind::ALL`].
fn first_signal(kind: Kind, controller: &Controller) -> usize {
    let before = Kind::ALL.into_iter().take_while(|other| *other != kind);
    before.map(|other| other.count(controller)).sum()
}

fn named(start: &str, fields: &[String]) -> Vec<String> {
    fields.iter().map(|field| format!("{start}{field}")).collect()
}

#[cfg(test)]
mod tests {
    use super::{Controller, RoundingBound};

    /// x[k+1] = 0.9 x + u + f, u = -f_hat, f_hat = s / (|s| + delta), s = y - x_hat.
    fn bound(delta: f64) -> Result<f64, String> {
        let text = format!(
            "description = \"\"\nt_on = 0.0\nsample_time = 1.0\nestimator = \"current\"\n\
             states = [{{ name = \"x\" }}]\nactuators = [{{ name = \"u\" }}]\n\
             measurements = [{{ name = \"y\" }}]\nfaults = [{{ name = \"f\" }}]\n\
             A = [[0.9]]\nB = [[1.0]]\nC = [[1.0]]\nF_a = [[1.0]]\nA_f = [[0.0]]\n\
             K_x = [[0.0]]\nK_f = [[-1.0]]\nL_x = [[0.0]]\nL_f = [[1.0]]\n\
             sliding_mode = {{ rho = [1.0], delta = [{delta:?}] }}\nexperiment = {{ stop_time = 2.0 }}\n"
        );
        let file = aso_controller::Design::parse(&text, "design.toml").unwrap();
        let controller = Controller::of(file).unwrap();
        let rounding = RoundingBound::of(&controller);
        rounding.bound.map(|bound| bound[(1, 1)])
    }

    /// s[k+1] = 0.9 s - s / (|s| + delta): the chords have slopes from 0.9 - 1 / delta to 0.9, so the loop contracts
    /// for delta above 1 / 1.9.
    #[test]
    fn a_sliding_mode_has_a_bound_where_all_slopes_contract() {
        assert!(bound(0.6).unwrap() < 1e-4);
        let error = bound(0.45).unwrap_err();
        assert_eq!(error, "the slope of the sliding-mode law changes too much for one");
    }
}
