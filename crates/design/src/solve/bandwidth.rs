//! Gains of a stated bandwidth: a linear-quadratic regulator and a Kalman filter in natural units.

use control::aso::Estimator;
use control::bandwidth::{ByBandwidth, NaturalUnits, filter, regulator};
use control::{Domain, StateSpace};
use nalgebra::DMatrix;

use crate::report::number::rounded;
use crate::solve::gain::{FeedbackProblem, GainResult, Noise, Refusal, unique};
use crate::solve::norm_gains::ObserverProblem;
use control::blocks::stacked;
use plant_file::requirements::Bandwidth;

/// Integral action and the estimates of faults are slower than the loop by this factor.
const SLOWER: f64 = 8.0;

impl FeedbackProblem<'_> {
    /// Returns the regulator whose cost weights the measurements, and the integrals of references so that they are
    /// slower by [`SLOWER`].
    pub(crate) fn by_bandwidth(
        &self,
        bandwidth: &Bandwidth,
        domain: Domain,
    ) -> Result<GainResult, Refusal> {
        let Self { a, b, c, states, .. } = *self;
        let rate = self::rate(bandwidth)?;
        // The rates of the integrals are outputs of the plant, too: a sampled row is that of a step.
        let integrals = a.view((states, 0), (a.nrows() - states, states)) / domain.step();
        let outputs = stacked(&c.columns(0, states).into_owned(), &integrals);
        let plant = plant(a, &b.rows(0, states).into_owned(), &outputs, domain);
        let units = NaturalUnits::new(&plant, rate)?;
        let p = c.nrows();
        let weighted = DMatrix::from_diagonal(&units.outputs.rows(0, p).into_owned()) * c;
        let mut q = weighted.tr_mul(&weighted);
        for (at, unit) in units.outputs.iter().skip(p).enumerate() {
            q[(states + at, states + at)] += (rate / SLOWER * unit).powi(2);
        }
        let ByBandwidth { result, loop_gain, .. } =
            regulator(a, b, &q, &units.inputs, rate, domain)?;
        let method = method(bandwidth, "Linear-quadratic regulator", loop_gain, result.residual);
        Ok(unique(result.gain, method))
    }
}

impl ObserverProblem<'_> {
    /// Returns the Kalman filter for noise where commands and faults enter, and for random walks of the faults, which
    /// are slower by [`SLOWER`].
    pub(crate) fn by_bandwidth(
        &self,
        bandwidth: &Bandwidth,
        domain: Domain,
    ) -> Result<GainResult, Refusal> {
        let Self { a_0, c_0, b, channels, faults, estimator, .. } = *self;
        let rate = self::rate(bandwidth)?;
        let (order, m) = (a_0.nrows(), b.ncols());
        let n = order - faults;
        let mut inputs = b.clone().resize(order, m + channels.len(), 0.0);
        let walk = rate * domain.step() / SLOWER;
        for (at, channel) in channels.iter().enumerate() {
            let mut column = inputs.column_mut(m + at);
            column.rows_mut(0, n).copy_from(&a_0.view((0, n + channel.estimate), (n, 1)));
            column[n + channel.estimate] = walk;
            if let Some(of_ramp) = channel.rate {
                column[n + of_ramp] = walk * rate / SLOWER;
            }
        }
        let plant =
            plant(a_0, &inputs.rows(0, n).into_owned(), &c_0.columns(0, n).into_owned(), domain);
        let units = NaturalUnits::new(&plant, rate)?;
        let noise = inputs * DMatrix::from_diagonal(&units.inputs);
        let w = &noise * noise.transpose();
        let process = (&w + w.transpose()) / 2.0;
        let ByBandwidth { result, loop_gain, weight } =
            filter(a_0, c_0, &process, &units.outputs, rate, domain)?;
        let measurements = units.outputs.map(|unit| weight / (unit * unit));
        let noise = Noise {
            process,
            measurements: DMatrix::from_diagonal(&measurements),
            covariance: result.covariance,
            is_relative: true,
        };
        let current = result.current_gain.filter(|_| estimator == Estimator::Current);
        let method = method(bandwidth, "Kalman filter", loop_gain, result.residual);
        let choice = unique(current.unwrap_or(result.gain), method);
        Ok(GainResult { noise: Some(Box::new(noise)), ..choice })
    }
}

fn rate(bandwidth: &Bandwidth) -> Result<f64, Refusal> {
    let open = || Refusal::Conflict("expected a bandwidth or another requirement".to_owned());
    bandwidth.rate.ok_or_else(open)
}

fn method(bandwidth: &Bandwidth, name: &str, loop_gain: f64, residual: f64) -> String {
    let rate = rounded(bandwidth.rate.unwrap_or_default());
    let chosen = if bandwidth.is_stated {
        ""
    } else {
        ", chosen by the verdict as the file states no requirement"
    };
    let why = match loop_gain {
        gain if gain > 1.1 => Some("no weight gives less, for unstable modes or by rounding"),
        gain if gain < 0.9 => Some("no weight reaches it"),
        _ => None,
    };
    let reached = why.map(|why| format!("; {why}: the loop gain there is {loop_gain:.3}"));
    let reached = reached.unwrap_or_default();
    format!(
        "{name} with a bandwidth of {rate} rad/s{chosen}{reached}; relative residual of the Riccati equation \
         {residual:.1e}."
    )
}

/// Returns the plant from `b` to `c` with the first states of `a`, as many as `b` has rows.
fn plant(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>, domain: Domain) -> StateSpace {
    let n = b.nrows();
    StateSpace::strictly_proper(a.view((0, 0), (n, n)).into(), b.clone(), c.clone(), domain)
}
