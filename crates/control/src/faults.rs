//! Fault models: builds the plant with a fault model from a list of faults.
//!
//! | fault | enters | `F_a` | `A_f` |
//! |---|---|---|---|
//! | constant | x' = A x + B u + `F_a` f | `F_a` | 0 |
//! | ramp, f' = g, g' = 0 | the same | [`F_a`, 0] | [0, I; 0, 0] |
//! | sensor | y = C x + `F_s` f | [0; W `F_s`] | by its kind |
//! | actuator and sensor | in both places | [`F_a`; W `F_s`] | by its kind |
//! | loss of effectiveness | x' = A x + B (I - E) u | columns of B, f = -E u | by its kind |
//!
//! Sensor faults pass the measurement filter W. The filter is a part of the controller; the observer models it as a
//! part of the plant:
//!
//! ```text
//! y_f' = W (y - y_f)
//! A -> [A, 0; W C, -W],  B -> [B; 0],  C -> [0, I],  F_a -> [F_a, 0; 0, W F_s]
//! ```
//!
//! With y = C x + D u, the plant without D is used and the controller gets y - D u as its measurement:
//! [`crate::controller::with_feedthrough`]. A fault of input i has the columns i of B and D, [`FaultEntry::Both`].

use crate::blocks::{block_2x2, stacked};
use crate::check::as_number;
use crate::faulty_plant::FaultyPlant;
use crate::{Domain, Error, check};
use nalgebra::{DMatrix, DVector};

/// The model by which a fault develops.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FaultKind {
    /// A constant fault, f' = 0.
    Constant,
    /// A ramp, f' = g, g' = 0: the estimate follows a ramp without a lag.
    Ramp,
}

/// The signals that a fault acts on.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FaultEntry {
    /// The states, x' = A x + B u + column f; n entries.
    Actuator(DVector<f64>),
    /// The measurements, y = C x + column f; p entries.
    Sensor(DVector<f64>),
    /// States and measurements, x' = A x + B u + `states` f, y = C x + `measurements` f; n and p entries.
    Both {
        /// The column of `F_a`: the effect on the states.
        states: DVector<f64>,
        /// The column of `F_s`: the effect on the measurements.
        measurements: DVector<f64>,
    },
    /// The input with this index, from zero, loses the fraction E of its effect: f = -E u.
    LossOfEffectiveness(usize),
}

impl FaultEntry {
    /// Whether the fault enters the measurements.
    #[must_use]
    pub fn is_measured(&self) -> bool {
        matches!(self, Self::Sensor(_) | Self::Both { .. })
    }
}

/// A fault.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// The signals that the fault acts on.
    pub entry: FaultEntry,
    /// The model by which the fault develops.
    pub kind: FaultKind,
}

/// Indices, from zero, of the estimates of a fault in `f_hat`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct FaultChannel {
    /// The index of the estimate of the fault.
    pub estimate: usize,
    /// For a ramp, the index of the estimate of the rate of the fault.
    pub rate: Option<usize>,
}

/// A plant in the form that the observer needs, and the indices of the given faults in `f_hat`.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtendedPlant {
    /// The plant; the states of the measurement filter follow those of the plant itself.
    pub plant: FaultyPlant,
    /// The time domain of the plant.
    pub domain: Domain,
    /// Diagonal of W, the rates of the measurement filter, in 1/s also in sampled time, p entries. None if y is not
    /// filtered.
    pub filter: Option<Vec<f64>>,
    /// Number of states of the plant itself.
    pub states: usize,
    /// The indices in `f_hat` of each given fault.
    pub channels: Vec<FaultChannel>,
}

impl ExtendedPlant {
    /// Wraps a continuous plant whose faults all act on its states; no filter is needed.
    #[must_use]
    pub fn without_filter(plant: FaultyPlant) -> Self {
        let channel = |estimate| FaultChannel { estimate, rate: None };
        let channels = (0..plant.f_a.ncols()).map(channel).collect();
        Self { states: plant.a.nrows(), plant, domain: Domain::Continuous, filter: None, channels }
    }

    /// Builds the continuous plant with the given faults.
    ///
    /// `a`: n x n; `b`: n x m; `c`: p x n; `faults`: at least one for an observer, which is not checked here; `filter`:
    /// the diagonal of W, p rates above zero in 1/s, or empty, which is possible if no fault enters the measurements.
    /// `f_hat` holds the estimates in the order of the faults, then the rates of the ramps.
    /// [`FaultyPlant::check_observer_exists`] and [`crate::detectability`] test whether an observer exists: a sensor
    /// fault, for example, needs other measurements that show the same state.
    ///
    /// # Example
    ///
    /// A motor that loses part of its torque and whose speed sensor drifts:
    ///
    /// ```
    /// use control::faults::{FaultEntry, ExtendedPlant, Fault, FaultKind};
    /// use nalgebra::{DMatrix, DVector};
    /// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, -2.0]);
    /// let b = DMatrix::from_row_slice(2, 1, &[0.0, 5.0]);
    /// let loss = Fault { entry: FaultEntry::LossOfEffectiveness(0), kind: FaultKind::Constant };
    /// let drift = FaultEntry::Sensor(DVector::from_vec(vec![0.0, 1.0]));
    /// let drift = Fault { entry: drift, kind: FaultKind::Ramp };
    /// let c = DMatrix::identity(2, 2);
    /// let extended = ExtendedPlant::new(&a, &b, &c, &[loss, drift], &[50.0, 50.0])?;
    /// assert_eq!(extended.plant.f_a.shape(), (4, 3));
    /// assert_eq!(extended.channels[1].rate, Some(2));
    /// assert!(extended.plant.check_observer_exists().is_ok());
    /// # Ok::<(), control::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix, a column of the
    /// wrong length or no filter W; [`Error::OutOfRange`] for an unknown input or a rate not above zero.
    pub fn new(
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        c: &DMatrix<f64>,
        faults: &[Fault],
        filter: &[f64],
    ) -> Result<Self, Error> {
        Self::in_domain([a, b, c], faults, filter, Domain::Continuous)
    }

    /// Builds the plant as [`Self::new`] does, from A, B, C in continuous or sampled time.
    ///
    /// In sampled time the plant is known at its samples only: a fault acts on x\[k+1\] through `F_a` by its value at
    /// sample k. A ramp has `A_f` = [I, T I; 0, I], and the filter has 1 - e^(-w T) in place of W.
    ///
    /// # Errors
    ///
    /// Same as [`Self::new`]; [`Error::OutOfRange`] for the period.
    pub fn in_domain(
        [a, b, c]: [&DMatrix<f64>; 3],
        faults: &[Fault],
        filter: &[f64],
        domain: Domain,
    ) -> Result<Self, Error> {
        domain.check()?;
        let n = check::with_inputs(a, b)?;
        check::shape("C", c, (c.nrows(), n))?;
        let (f_a, f_s) = columns(b, c.nrows(), faults)?;
        let (mut a_f, channels) = models(faults);
        if let Domain::Sampled { period } = domain {
            a_f = DMatrix::identity(a_f.nrows(), a_f.nrows()) + a_f * period;
        }
        let width = a_f.nrows();
        let f_a = f_a.resize_horizontally(width, 0.0);
        if filter.is_empty() && !faults.iter().any(|fault| fault.entry.is_measured()) {
            let plant = FaultyPlant { a: a.clone(), b: b.clone(), c: c.clone(), f_a, a_f };
            return Ok(Self { plant, domain, filter: None, states: n, channels });
        }
        check::column("W", filter, c.nrows())?;
        filter.iter().try_for_each(|&rate| check::positive("a rate of the filter W", rate))?;
        let coefficients = coefficients(filter, domain);
        let rates = DMatrix::from_diagonal(&DVector::from_column_slice(&coefficients));
        let decay = match domain {
            Domain::Continuous => -&rates,
            Domain::Sampled { .. } => DMatrix::identity(c.nrows(), c.nrows()) - &rates,
        };
        let f_s = f_s.resize_horizontally(width, 0.0);
        let plant = FaultyPlant {
            a: block_2x2([a, &DMatrix::zeros(n, c.nrows())], [&(&rates * c), &decay]),
            b: b.clone().resize_vertically(n + c.nrows(), 0.0),
            c: DMatrix::identity(c.nrows(), c.nrows()).insert_columns(0, n, 0.0),
            f_a: stacked(&f_a, &(&rates * f_s)),
            a_f,
        };
        Ok(Self { plant, domain, filter: Some(filter.to_vec()), states: n, channels })
    }
}

/// `F_a` and `F_s`, one column per fault.
fn columns(
    b: &DMatrix<f64>,
    p: usize,
    faults: &[Fault],
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let (n, m) = b.shape();
    let (mut f_a, mut f_s) = (DMatrix::zeros(n, faults.len()), DMatrix::zeros(p, faults.len()));
    let set = |into: &mut DMatrix<f64>, at: usize, name, column: &DVector<f64>| {
        check::column(name, column.as_slice(), into.nrows())?;
        into.set_column(at, column);
        Ok(())
    };
    let (on_states, on_measurements) = ("a column of F_a", "a column of F_s");
    for (at, fault) in faults.iter().enumerate() {
        match &fault.entry {
            FaultEntry::Actuator(column) => set(&mut f_a, at, on_states, column)?,
            FaultEntry::Sensor(column) => set(&mut f_s, at, on_measurements, column)?,
            FaultEntry::Both { states, measurements } => {
                set(&mut f_a, at, on_states, states)?;
                set(&mut f_s, at, on_measurements, measurements)?;
            }
            FaultEntry::LossOfEffectiveness(input) => {
                let (value, rule) = (as_number(*input), "the index of an input, from zero");
                check::that(*input < m, "the input of a loss", value, rule)?;
                f_a.set_column(at, &b.column(*input));
            }
        }
    }
    Ok((f_a, f_s))
}

/// `A_f` in continuous time, and the indices of each fault and its rate.
fn models(faults: &[Fault]) -> (DMatrix<f64>, Vec<FaultChannel>) {
    let mut next = faults.len();
    let mut channels = Vec::with_capacity(faults.len());
    for (estimate, fault) in faults.iter().enumerate() {
        let rate = (fault.kind == FaultKind::Ramp).then_some(next);
        next += usize::from(rate.is_some());
        channels.push(FaultChannel { estimate, rate });
    }
    let mut a_f = DMatrix::zeros(next, next);
    for channel in &channels {
        if let Some(rate) = channel.rate {
            a_f[(channel.estimate, rate)] = 1.0;
        }
    }
    (a_f, channels)
}

/// The coefficients of the measurement filter for its rates w: w in continuous, 1 - e^(-w T) in sampled time.
pub(crate) fn coefficients(rates: &[f64], domain: Domain) -> Vec<f64> {
    match domain {
        Domain::Continuous => rates.to_vec(),
        Domain::Sampled { period } => rates.iter().map(|rate| -(-rate * period).exp_m1()).collect(),
    }
}
