//! The designs at the points of a schedule, and the loop between them.

pub(crate) mod references;

use control::aso::{Estimator, FaultyPlant, Gains};
use control::controller::complete_controller;
use control::hold::zero_order_hold;
use control::lmi::{Interval, bernstein};
use control::robustness::Loop;
use control::stability::instability;
use control::tracking::IntegralAction;
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

use crate::plant::linear::LinearPlant;
use crate::solve::family::check_states;
use crate::solve::solution::{Solution, solve};
use plant_file::PlantFile;
use plant_file::estimation::Law;
use plant_file::signals::Signal;
use plant_file::variants::Variable;

/// Degree of the loop of interpolated plant and controller in the scheduling variable: that of `B_p` K L `C_p` with a
/// current estimator. The loop of a continuous controller has degree 2, with a direct term 4; the Bernstein
/// coefficients of degree 4 are nearer to its values.
const DEGREE: u32 = 4;
/// [`DEGREE`] for a current estimator with direct feedthrough: the degree of B `K_f` `P_f` C L C.
const DEGREE_OF_DIRECT_TERM: u32 = 6;

/// The designs of a scheduled controller.
pub(crate) struct Scheduled {
    /// The scheduling variable.
    pub(crate) variable: Signal,
    /// The position of the scheduling variable among the measurements; None if it is an input.
    pub(crate) measurement: Option<usize>,
    /// Largest rate of the scheduling variable, per s, if stated.
    pub(crate) rate_bound: Option<f64>,
    /// Values of the scheduling variable, ascending, with their designs; None as design for the plant of the file.
    points: Vec<(f64, Option<Solution>)>,
}

/// The matrices at a value of the scheduling variable.
struct Point {
    /// The plant without filters, sampled if the controller is.
    physical: StateSpace,
    /// The model in the observer, and the gains.
    model: FaultyPlant,
    gains: Gains,
}

impl Scheduled {
    /// Designs the controller with `law` at each point of the schedule of `file`, except the point of the file's own
    /// plant; None without a schedule.
    pub(crate) fn of(
        file: &PlantFile<'_>,
        law: &Law,
        nominal: &LinearPlant,
    ) -> Result<Option<Self>, crate::Error> {
        let Some(schedule) = &file.schedule else { return Ok(None) };
        let variable = schedule.variable(&file.measurements).clone();
        let mut points = Vec::with_capacity(schedule.points.len());
        for (at, point) in schedule.points.iter().enumerate() {
            if at == schedule.nominal {
                points.push((point.at, None));
                continue;
            }
            let solution = solve(&file.with(&point.plant), law)
                .map_err(|error| {
                    error.within(format!("schedule with {} = {}", variable.name, point.at))
                })?
                .solution;
            check_states(file, &point.plant, nominal, &solution.linear)?;
            points.push((point.at, Some(solution)));
        }
        Ok(Some(Self {
            measurement: match schedule.variable {
                Variable::Measurement(at) => Some(at),
                Variable::Input(_) => None,
            },
            rate_bound: schedule.rate_bound,
            variable,
            points,
        }))
    }

    /// Returns the values of the scheduling variable with their designs; `nominal` is the design of the file.
    pub(crate) fn points<'a>(
        &'a self,
        nominal: &'a Solution,
    ) -> impl Iterator<Item = (f64, &'a Solution)> {
        self.points.iter().map(move |(at, solution)| (*at, solution.as_ref().unwrap_or(nominal)))
    }

    /// Returns the points except that of the plant of the file.
    pub(crate) fn others(&self) -> impl Iterator<Item = (f64, &Solution)> {
        self.points.iter().filter_map(|(at, solution)| Some((*at, solution.as_ref()?)))
    }
}

impl Point {
    fn of(solution: &Solution) -> Result<Self, Error> {
        let linear = &solution.linear;
        let (mut a, mut b) = (linear.a.clone(), linear.b.clone());
        if let Domain::Sampled { period } = solution.domain {
            (a, b) = zero_order_hold(&a, &b, period)?;
        }
        let physical = StateSpace::strictly_proper(a, b, linear.c.clone(), solution.domain);
        Ok(Self { physical, model: solution.plant.clone(), gains: solution.gains.clone() })
    }

    /// Returns the matrices at the part `t` of the way to `other`, as the controller FMU interpolates them.
    fn between(&self, other: &Self, t: f64) -> Self {
        let mix = |from: &DMatrix<f64>, to: &DMatrix<f64>| from * (1.0 - t) + to * t;
        let (plant, next_plant) = (&self.physical, &other.physical);
        let (model, next_model) = (&self.model, &other.model);
        let (gains, next) = (&self.gains, &other.gains);
        let mixed = |(from, to): (&IntegralAction, &IntegralAction)| IntegralAction {
            output: mix(&from.output, &to.output),
            gain: mix(&from.gain, &to.gain),
            ..from.clone()
        };
        Self {
            physical: StateSpace {
                a: mix(&plant.a, &next_plant.a),
                b: mix(&plant.b, &next_plant.b),
                c: mix(&plant.c, &next_plant.c),
                ..plant.clone()
            },
            model: FaultyPlant {
                a: mix(&model.a, &next_model.a),
                b: mix(&model.b, &next_model.b),
                c: mix(&model.c, &next_model.c),
                f_a: mix(&model.f_a, &next_model.f_a),
                a_f: model.a_f.clone(),
            },
            gains: Gains {
                k_x: mix(&gains.k_x, &next.k_x),
                k_f: mix(&gains.k_f, &next.k_f),
                l_x: mix(&gains.l_x, &next.l_x),
                l_f: mix(&gains.l_f, &next.l_f),
                p_f: gains.p_f.as_ref().zip(next.p_f.as_ref()).map(|(from, to)| mix(from, to)),
                integral: gains.integral.as_ref().zip(next.integral.as_ref()).map(mixed),
                ..gains.clone()
            },
        }
    }

    /// Returns the dynamics of plant and controller together.
    fn closed(self, filter: Option<&[f64]>) -> Result<DMatrix<f64>, Error> {
        let domain = self.physical.domain;
        let controller = complete_controller(&self.model, &self.gains, filter, domain)?;
        Ok(Loop::new(self.physical, controller.commands)?.dynamics())
    }
}

/// The loop at and between the points of a schedule.
pub(crate) struct ScheduledLoop {
    at: Vec<f64>,
    points: Vec<Point>,
    filter: Option<Vec<f64>>,
}

impl ScheduledLoop {
    pub(crate) fn of(scheduled: &Scheduled, nominal: &Solution) -> Result<Self, Error> {
        let all: Vec<_> = scheduled.points(nominal).collect();
        Ok(Self {
            at: all.iter().map(|(at, _)| *at).collect(),
            points: all.iter().map(|(_, design)| Point::of(design)).collect::<Result<_, _>>()?,
            filter: nominal.filter.clone(),
        })
    }

    /// Returns the intervals between the points. Plants and gains are interpolated linearly on them, so that the loop
    /// is a polynomial, of degree 4 or 6.
    pub(crate) fn intervals(&self) -> Result<Vec<Interval>, Error> {
        let Gains { p_f, estimator, .. } = &self.points[0].gains;
        let degree = match (p_f, estimator) {
            (Some(_), Estimator::Current) => DEGREE_OF_DIRECT_TERM,
            _ => DEGREE,
        };
        let interval = |k: usize| {
            let at = |j: u32| self.dynamics(k, f64::from(j) / f64::from(degree));
            let values = (0..=degree).map(at).collect::<Result<Vec<_>, _>>()?;
            let length = self.at[k + 1] - self.at[k];
            Ok(Interval { length, coefficients: bernstein(&values)? })
        };
        (0..self.points.len() - 1).map(interval).collect()
    }

    /// Returns the worst instability of the loop at the ends of `count` equal parts of each interval, and the value of
    /// the variable there.
    pub(crate) fn worst(&self, count: u32, domain: Domain) -> Result<(f64, f64), Error> {
        let mut worst = (f64::NEG_INFINITY, self.at[0]);
        for k in 0..self.points.len() - 1 {
            for j in 0..=count {
                let t = f64::from(j) / f64::from(count);
                let real = instability(&self.dynamics(k, t)?, domain)?;
                if real > worst.0 {
                    worst = (real, self.at[k] * (1.0 - t) + self.at[k + 1] * t);
                }
            }
        }
        Ok(worst)
    }

    /// Returns the dynamics at the part `t` of interval `k`.
    fn dynamics(&self, k: usize, t: f64) -> Result<DMatrix<f64>, Error> {
        self.points[k].between(&self.points[k + 1], t).closed(self.filter.as_deref())
    }
}

/// Returns the instability of the loop at each point if the scheduling variable is a measurement; None if it is not.
/// Its feedback through the interpolated operating points ("hidden coupling") is not part of the designs at the points.
///
/// With slopes ' of the operating points in the variable theta = `y_j`, A to D the controller with its states z,
///
/// ```text
/// z[k+1] = A z + B y + ((I - A) z_op' - B y_op') theta
/// u      = C z + D y + (u_op' - C z_op' - D y_op') theta
/// z'     = A z + B y - (A z_op' + B y_op') theta              the first line in continuous time
/// ```
///
/// Between two intervals the slopes jump; the worse side counts. Source: W. J. Rugh and J. S. Shamma,
/// Research on gain scheduling, Automatica 36 (2000), section 3.
pub(crate) fn coupled(
    scheduled: &Scheduled,
    nominal: &Solution,
) -> Result<Option<Vec<f64>>, Error> {
    let Some(j) = scheduled.measurement else { return Ok(None) };
    let all: Vec<_> = scheduled.points(nominal).collect();
    let slopes: Vec<_> = all.windows(2).map(|pair| Slopes::between(pair[0], pair[1])).collect();
    let one = |k: usize| {
        let sides = [k.checked_sub(1), (k + 1 < all.len()).then_some(k)].into_iter().flatten();
        let mut worst = f64::NEG_INFINITY;
        for side in sides {
            let design = all[k].1;
            let point = Point::of(design)?;
            let filter = design.filter.as_deref();
            let controller =
                complete_controller(&point.model, &point.gains, filter, design.domain)?;
            let mut changed = slopes[side].move_point(&controller.commands, filter.is_some(), j);
            slopes[side].move_references(design, &mut changed, j);
            let whole = Loop::new(point.physical, changed)?;
            worst = worst.max(instability(&whole.dynamics(), design.domain)?);
        }
        Ok(worst)
    };
    (0..all.len()).map(one).collect::<Result<_, _>>().map(Some)
}

/// Slopes of the operating points in the scheduling variable.
struct Slopes {
    x: Vec<f64>,
    u: Vec<f64>,
    y: Vec<f64>,
}

impl Slopes {
    fn between(from: (f64, &Solution), to: (f64, &Solution)) -> Self {
        let length = to.0 - from.0;
        let slope = |of: fn(&LinearPlant) -> &[Signal]| {
            let values = of(&from.1.linear).iter().zip(of(&to.1.linear));
            let value = |signal: &Signal| signal.operating.unwrap_or(0.0);
            values.map(|(from, to)| (value(to) - value(from)) / length).collect()
        };
        Self {
            x: slope(|linear| &linear.states),
            u: slope(|linear| &linear.actuators),
            y: slope(|linear| &linear.measurements),
        }
    }

    /// Adds the effect of constant references: r - r_op changes with their operating point r_op = H y_op.
    ///
    /// ```text
    /// x_i[k+1] = ... - T H y_op' theta,   u = ... - N_r H y_op' theta,   x_hat[k+1] = ... - B N_r H y_op' theta
    /// ```
    ///
    /// In continuous time these are x_i' without T, and x_hat'. The observer receives u, so that its next state has
    /// this part of u, too.
    fn move_references(&self, design: &Solution, controller: &mut StateSpace, j: usize) {
        let Some(tracking) = &design.tracking else { return };
        let moved = &tracking.h * DMatrix::from_column_slice(self.y.len(), 1, &self.y);
        let t = design.gains.integrals();
        let first = controller.b.nrows() - t;
        for k in 0..t {
            controller.b[(first + k, j)] -= design.domain.step() * moved[k];
        }
        if let Some(n_r) = tracking.feedforward() {
            let command = n_r * moved;
            let states = &design.plant.b * &command;
            let before = design.filter.as_ref().map_or(0, Vec::len);
            for i in 0..states.nrows() {
                controller.b[(before + i, j)] -= states[i];
            }
            for i in 0..command.nrows() {
                controller.d[(i, j)] -= command[i];
            }
        }
    }

    /// Returns `system`, the controller with its filter, with the terms of [`coupled`] in theta, its measurement `j`.
    ///
    /// Its states are the filtered measurements, if there are any, x_hat, the filtered measurements of the model,
    /// f_hat, and the integrals; the last two have no operating point.
    fn move_point(&self, system: &StateSpace, is_filtered: bool, j: usize) -> StateSpace {
        let filtered = if is_filtered { &self.y[..] } else { &[] };
        let slopes = [filtered, &self.x, filtered].concat();
        let z = DMatrix::from_column_slice(slopes.len(), 1, &slopes);
        let z = z.resize_vertically(system.a.nrows(), 0.0);
        let y = DMatrix::from_column_slice(self.y.len(), 1, &self.y);
        let u = DMatrix::from_column_slice(self.u.len(), 1, &self.u);
        let mut changed = system.clone();
        let held = z.scale(system.domain.constant());
        let to_z = held - &system.a * &z - &system.b * &y;
        let to_u = u - &system.c * &z - &system.d * &y;
        changed.b.set_column(j, &(system.b.column(j) + to_z.column(0)));
        changed.d.set_column(j, &(system.d.column(j) + to_u.column(0)));
        changed
    }
}
