//! Loop shaping (mixed sensitivity) for controllers of a given structure.
//!
//! The parameters theta of a controller K(theta), the gains of feedback and observer for example, are
//! chosen for the least gamma:
//!
//! ```text
//! gamma(theta) = max over terms i and frequencies w of |W_i(j w)| sigma_max(X_i(j w))
//! ```
//!
//! X is S or T at the commands or the measurements, K S, or the tracking error of the references, with the signs
//! of [`crate::robustness`].
//! Gamma at most 1 means that every X is below 1 / |W|.

mod descent;
mod minimax;
mod objective;
mod structured;

pub use structured::Structure;

use crate::blocks::{beside, block_2x2, stacked};
use crate::delay::Delays;
use crate::response::h_infinity;
use crate::robustness::{Loop, Point};
use crate::weight::Weight;
use crate::{Error, StateSpace};
use nalgebra::{DMatrix, DVector};

/// Relative width of a verified norm.
const WIDTH: f64 = 1e-4;

/// A transfer function of the loop y = G u, u = K y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transfer {
    /// S: (I - K G)^-1 at the commands, (I - G K)^-1 at the measurements.
    Sensitivity(Point),
    /// T = I - S.
    Complementary(Point),
    /// K S: from a signal that is added to the measurements to the commands.
    Effort,
    /// The tracking error: from references r to r - H y.
    Tracking,
}

/// A transfer function with its weight.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// The transfer function X.
    pub transfer: Transfer,
    /// W; in sampled time, at the frequencies that [`crate::weight::bilinear_frequency`] returns.
    pub weight: Weight,
}

/// A problem of tuning: a plant, a controller of given structure, and what is minimised.
pub struct Tuning<'a> {
    /// G, with D = 0, in the domain of the controller and in units in which its channels are comparable.
    pub plant: StateSpace,
    /// K(theta), in the units of `plant`, from the measurements and then the references. Derivatives are central
    /// differences of its matrices, which are exact for entries of second degree in theta.
    pub controller: &'a (dyn Fn(&DVector<f64>) -> Result<StateSpace, Error> + Sync),
    /// H, t x p: H y follows the references; no rows without references.
    pub references: DMatrix<f64>,
    /// The weighted transfer functions, whose largest value is minimised.
    pub terms: Vec<Term>,
    /// The largest allowed instability of the loop, negative, see [`crate::stability::instability`].
    pub instability: f64,
    /// Whether the search may use the given theta.
    pub is_allowed: &'a (dyn Fn(&DVector<f64>) -> bool + Sync),
    /// The delays that `plant` approximates.
    pub delays: &'a Delays,
    /// G without its delays, in continuous time and in the units of `plant`.
    pub undelayed: StateSpace,
    /// The bandwidth in rad/s; the search examines frequencies from a thousandth of it to a thousand times it.
    pub rate: f64,
    /// Whether the search must end; called after each step.
    pub is_over: &'a (dyn Fn() -> bool + Sync),
}

/// The largest weighted norm, its term and its frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedPeak {
    /// The H-infinity norm of W X, verified with a relative width of 1e-4.
    pub gamma: f64,
    /// The index of the term.
    pub term: usize,
    /// The frequency of the peak, in rad/s.
    pub frequency: f64,
}

/// The tuned parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Tuned {
    /// The parameters theta.
    pub parameters: DVector<f64>,
    /// The largest weighted norm with these parameters.
    pub peak: WeightedPeak,
    /// Gamma or, if it is larger, the largest value of the search, which counts the deviation by delays, too.
    pub largest: f64,
    /// What limits gamma: the peak, then the places of the search with at least 0.95 of the largest value, not verified.
    pub limits: Vec<WeightedPeak>,
}

impl Tuning<'_> {
    /// Returns the largest H-infinity norm of the terms at `parameters`, by [`h_infinity`]; 0 without terms.
    ///
    /// # Errors
    ///
    /// Same as the controller, [`h_infinity`] and [`Loop::new`]; [`Error::NotHurwitz`], [`Error::NotSchur`] for a loop
    /// that is not stable.
    pub fn peak(&self, parameters: &DVector<f64>) -> Result<WeightedPeak, Error> {
        let controller = (self.controller)(parameters)?;
        let closed = Loop::new(self.plant.clone(), self.measured(&controller))?;
        let mut largest = WeightedPeak { gamma: 0.0, term: 0, frequency: 0.0 };
        for (term, weighted) in self.terms.iter().enumerate() {
            let system = weighted.system(&closed, &self.references, &controller)?;
            let norm = h_infinity(&system, WIDTH)?;
            if norm.upper > largest.gamma {
                largest = WeightedPeak { gamma: norm.upper, term, frequency: norm.frequency };
            }
        }
        Ok(largest)
    }

    /// Returns A of the closed loop at `parameters`: the states of the plant, then the states of the controller.
    ///
    /// # Errors
    ///
    /// Same as [`Loop::new`] and the controller.
    pub fn dynamics(&self, parameters: &DVector<f64>) -> Result<DMatrix<f64>, Error> {
        let controller = self.measured(&(self.controller)(parameters)?);
        Ok(Loop::new(self.plant.clone(), controller)?.dynamics())
    }

    /// The controller from the measurements alone.
    fn measured(&self, controller: &StateSpace) -> StateSpace {
        let p = self.plant.c.nrows();
        let first = |m: &DMatrix<f64>| m.columns(0, p.min(m.ncols())).into_owned();
        StateSpace { b: first(&controller.b), d: first(&controller.d), ..controller.clone() }
    }
}

impl Term {
    /// W X as a system; `references` is H, and `controller` has the inputs of the references.
    fn system(
        &self,
        closed: &Loop,
        references: &DMatrix<f64>,
        controller: &StateSpace,
    ) -> Result<StateSpace, Error> {
        let x = match self.transfer {
            Transfer::Sensitivity(at) => closed.sensitivity(at),
            Transfer::Complementary(at) => closed.complementary(at),
            Transfer::Effort => {
                let whole = closed.system();
                let (p, m) = closed.plant().d.shape();
                StateSpace {
                    b: whole.b.columns(m, p).into(),
                    c: whole.c.rows(0, m).into(),
                    d: closed.controller().d.clone(),
                    ..whole
                }
            }
            Transfer::Tracking => {
                let (plant, t) = (closed.plant(), references.nrows());
                let (n, p) = (plant.a.nrows(), plant.c.nrows());
                let of_references = |m: &DMatrix<f64>| m.columns(p, t).into_owned();
                let input = &plant.b * of_references(&controller.d);
                let measured = -(references * &plant.c);
                StateSpace {
                    a: closed.dynamics(),
                    b: stacked(&input, &of_references(&controller.b)),
                    c: measured.resize_horizontally(n + controller.a.nrows(), 0.0),
                    d: DMatrix::identity(t, t),
                    domain: plant.domain,
                }
            }
        };
        if let Some(magnitude) = self.weight.as_constant() {
            return Ok(StateSpace { c: x.c * magnitude, d: x.d * magnitude, ..x });
        }
        let channels = vec![self.weight.clone(); x.d.nrows()];
        let weight = crate::weight::diagonal(&channels, x.domain)?;
        let none = DMatrix::zeros(x.a.nrows(), weight.a.ncols());
        Ok(StateSpace {
            a: block_2x2([&x.a, &none], [&(&weight.b * &x.c), &weight.a]),
            b: stacked(&x.b, &(&weight.b * &x.d)),
            c: beside(&(&weight.d * &x.c), &weight.c),
            d: &weight.d * &x.d,
            domain: x.domain,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Domain;

    fn one(value: f64) -> DMatrix<f64> {
        DMatrix::from_element(1, 1, value)
    }

    fn term(transfer: Transfer, weight: f64) -> Term {
        Term { transfer, weight: Weight::constant(weight) }
    }

    /// The tuned k of K = -k for y' = a y + u, in sampled time for y[k+1] = a y[k] + u[k].
    fn tuned(
        a: f64,
        domain: Domain,
        terms: &[Term],
        rate: f64,
        [start, scales]: [DVector<f64>; 2],
    ) -> Result<Tuned, Error> {
        let controller = |parameters: &DVector<f64>| {
            let (a, d) = (one(domain.constant() - 1.0), one(-parameters[0]));
            Ok(StateSpace { a, b: one(0.0), c: one(0.0), d, domain })
        };
        let plant = StateSpace { a: one(a), b: one(1.0), c: one(1.0), d: one(0.0), domain };
        let tuning = Tuning {
            delays: &Delays { inputs: vec![0.0], outputs: vec![0.0] },
            undelayed: plant.clone(),
            plant,
            controller: &controller,
            references: DMatrix::zeros(0, 1),
            terms: terms.to_vec(),
            instability: -0.01,
            is_allowed: &|_| true,
            rate,
            is_over: &|| false,
        };
        tuning.tuned(&start, &scales)
    }

    /// G = 1 / (s - 1), K = -k: T = k / (s - 1 + k) has the norm k / (k - 1), K S the norm k.
    #[test]
    fn complementary_sensitivity_against_effort_has_the_gain_of_its_closed_form() {
        let terms =
            [term(Transfer::Complementary(Point::Output), 1.0), term(Transfer::Effort, 0.25)];
        let tuned = |start| tuned(1.0, Domain::Continuous, &terms, 1.0, start);
        let refused = tuned([1, 2].map(DVector::zeros));
        assert!(matches!(refused, Err(Error::Shape { .. })), "{refused:?}");
        // k / (k - 1) = k / 4.
        let tuned = tuned([2.0, 2.0].map(|value| DVector::from_element(1, value))).unwrap();
        assert!((tuned.parameters[0] - 5.0).abs() < 0.02, "{tuned:?}");
        assert!((tuned.peak.gamma - 1.25).abs() < 5e-3, "{tuned:?}");
    }

    /// From k = 0.2 for y[k+1] = y[k] / 2 + u[k] each second: S = (z - 0.5) / (z - 0.5 + k).
    fn sampled(terms: &[Term], rate: f64) -> Tuned {
        let start = [0.2, 1.0].map(|value| DVector::from_element(1, value));
        tuned(0.5, Domain::Sampled { period: 1.0 }, terms, rate, start).unwrap()
    }

    #[test]
    fn without_terms_the_parameters_stay() {
        assert_eq!(sampled(&[], 0.1).parameters, DVector::from_element(1, 0.2));
    }

    /// The mean of ln |S| over the circle is zero, so that its maximum is at least 1; at the start it is 1.5 / 1.3.
    #[test]
    fn a_bandwidth_far_above_the_sampling_rate_is_examined_at_half_of_that_rate() {
        let sensitivity = term(Transfer::Sensitivity(Point::Output), 1.0);
        let gamma = sampled(&[sensitivity], 1e8).peak.gamma;
        assert!((0.999..1.155).contains(&gamma), "{gamma}");
    }
}
