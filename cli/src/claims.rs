//! Compares the claims of the paper with measurements of a run.

use std::f64::consts::FRAC_PI_2;

use fmu_description::number::rounded;
use serde::Serialize;

/// The variables used by the claims, in the order of the values of [`Measurement::add`].
pub(crate) const WATCHED: [&str; 5] =
    ["plant.x_p", "plant.theta", "plant.f_fric", "controller.f_hat", "plant.regime"];

/// Time in s from the start of the compensation to the start of the measurement of the residual motion.
const SETTLING: f64 = 20.0;
/// The limit cycle is measured in this last fraction of the time before the activation.
const CYCLE: f64 = 0.75;
/// Shortest slide in m that counts: rounding makes a cart that creeps to its rest stick and slip in shorter slides.
const SLIDE: f64 = 1e-3;
/// Coulomb friction in the paper in N, the scale for the error of an estimate. An estimate follows the friction if the
/// root mean square of its error is below a fifth of this value.
const LEVEL: f64 = 25.0;
/// Time in s before and after a transition within which a spike belongs to the transition.
const NEAR: f64 = 0.01;

/// The smallest and the largest of the values added.
#[derive(Clone, Copy)]
struct Extremes {
    low: f64,
    high: f64,
}

impl Extremes {
    const NONE: Self = Self { low: f64::INFINITY, high: f64::NEG_INFINITY };

    fn add(&mut self, value: f64) {
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }

    /// Returns half of the peak-to-peak value; negative infinity without values.
    fn amplitude(self) -> f64 {
        0.5 * (self.high - self.low)
    }
}

/// Measurements in one time window.
struct Window {
    /// Start and end of the window in s, both included.
    from: f64,
    to: f64,
    x_p: Extremes,
    theta: Extremes,
    /// Sum of squares of `f_fric - f_hat`.
    squares: f64,
    /// The largest `|f_fric - f_hat|`, the time of this error, and whether this time is at a stick-slip transition.
    largest: f64,
    largest_at: f64,
    at_transition: bool,
    /// Number of samples in the window.
    count: f64,
    /// Number of slides of more than [`SLIDE`] that start and end at rest, and the position of the
    /// last rest.
    slides: u32,
    rest: Option<f64>,
    /// The last regime, 0 at rest, and the time of the last change between rest and sliding. Both include times outside
    /// of the window, and are NaN at first.
    regime: f64,
    changed_at: f64,
}

impl Window {
    fn new(from: f64, to: f64) -> Self {
        Self {
            from,
            to,
            x_p: Extremes::NONE,
            theta: Extremes::NONE,
            squares: 0.0,
            largest: 0.0,
            largest_at: f64::NAN,
            at_transition: false,
            count: 0.0,
            slides: 0,
            rest: None,
            regime: f64::NAN,
            changed_at: f64::NAN,
        }
    }

    fn add(&mut self, time: f64, [x_p, theta, f_fric, f_hat, regime]: [f64; 5]) {
        if (self.regime == 0.0) != (regime == 0.0) && !self.regime.is_nan() {
            self.changed_at = time;
            self.at_transition |= time - self.largest_at < NEAR;
        }
        self.regime = regime;
        if time < self.from || time > self.to {
            return;
        }
        self.x_p.add(x_p);
        self.theta.add(theta);
        let difference = f_fric - f_hat;
        self.squares += difference * difference;
        self.count += 1.0;
        if difference.abs() > self.largest {
            self.largest = difference.abs();
            self.largest_at = time;
            self.at_transition = time - self.changed_at < NEAR;
        }
        if regime == 0.0 {
            let slid = self.rest.is_some_and(|rest| (x_p - rest).abs() > SLIDE);
            self.slides += u32::from(slid);
            self.rest = Some(x_p);
        }
    }

    fn rms(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }
}

/// All measurements of a run that the claims need.
pub(crate) struct Measurement {
    before: Window,
    after: Window,
    can_fall: bool,
    fell: Option<f64>,
}

/// A claim with its measurement: one line of the table.
#[derive(Debug, Serialize)]
pub(crate) struct Claim {
    pub(crate) statement: String,
    pub(crate) paper: &'static str,
    pub(crate) measured: f64,
    pub(crate) unit: &'static str,
    /// `None` if the part of the run that the claim is about is missing or too short to judge; false if the run failed
    /// or the pendulum fell before that part.
    pub(crate) holds: Option<bool>,
}

impl Measurement {
    /// Creates the measurement for a run whose compensation starts at `t_on`. The linearised
    /// pendulum cannot fall; its angle has no bound.
    pub(crate) fn new(t_on: f64, linearised: bool) -> Self {
        Self {
            before: Window::new((1.0 - CYCLE) * t_on, t_on),
            after: Window::new(t_on + SETTLING, f64::INFINITY),
            can_fall: !linearised,
            fell: None,
        }
    }

    /// Adds the values of [`WATCHED`] at `time`.
    pub(crate) fn add(&mut self, time: f64, values: [f64; 5]) {
        self.before.add(time, values);
        self.after.add(time, values);
        if self.can_fall && self.fell.is_none() && values[1].abs() > FRAC_PI_2 {
            self.fell = Some(time);
        }
    }

    /// Returns the time in s of the first sample with the pendulum below the horizontal; `None` if there is none.
    pub(crate) fn fell(&self) -> Option<f64> {
        self.fell
    }

    /// Evaluates the claims. `end` is the time reached in s; `lost` is true if the run failed or an FMU ended it.
    pub(crate) fn claims(&self, end: f64, lost: bool) -> Vec<Claim> {
        let Self { before, after, .. } = self;
        let is_measured = before.count > 1.0;
        let is_whole = is_measured && end >= before.to;
        let settled = after.count > 1.0;
        let lost = lost || self.fell.is_some();
        let early = |statement: &str, paper, measured, unit, holds: bool| Claim {
            statement: format!("{statement}, {} to {} s", before.from, before.to),
            paper,
            measured,
            unit,
            holds: if is_whole { Some(holds) } else { lost.then_some(false) },
        };
        let late = |statement: &str, paper, measured, unit, holds: bool| Claim {
            statement: format!("{statement}, t > {} s", after.from),
            paper,
            measured,
            unit,
            holds: if lost { Some(false) } else { settled.then_some(holds) },
        };
        let (cart, angle) = (before.x_p.amplitude(), before.theta.amplitude());
        let (rest, rest_angle) = (after.x_p.amplitude(), after.theta.amplitude());
        let slides = if is_measured { f64::from(before.slides) } else { f64::NAN };
        let (rms, spike) = (after.rms(), if settled { after.largest } else { f64::NAN });
        vec![
            early("limit cycle of the cart", "a limit cycle", cart, "m", cart > 0.01),
            early("limit cycle of the pendulum", "a limit cycle", angle, "rad", angle > 0.01),
            early("slides between two rests", "stick-slip", slides, "", slides >= 1.0),
            late("cart after compensation", "below 1 mm", 1e3 * rest, "mm", rest < 1e-3),
            late(
                "pendulum after compensation",
                "below 2 mrad",
                1e3 * rest_angle,
                "mrad",
                rest_angle < 2e-3,
            ),
            late("rms of f_fric - f_hat", "accurate, Figure 6", rms, "N", rms < 0.2 * LEVEL),
            late("spikes at transitions", "spikes, Figure 6", spike, "N", after.at_transition),
        ]
    }
}

/// Formats the table, one line for each claim.
pub(crate) fn table(claims: &[Claim]) -> String {
    let mut lines = vec![format!("{:<44} {:<20} {:>14}  holds", "claim", "paper", "measured")];
    for claim in claims {
        let holds = match claim.holds {
            Some(true) => "yes",
            Some(false) => "NO",
            None => "not judged: too short",
        };
        let measured = if claim.measured.is_finite() {
            format!("{} {}", rounded(claim.measured, 4), claim.unit)
        } else {
            "-".to_owned()
        };
        lines
            .push(format!("{:<44} {:<20} {:>14}  {holds}", claim.statement, claim.paper, measured));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests;
