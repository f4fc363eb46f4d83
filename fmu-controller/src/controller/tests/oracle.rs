//! The equations again, as matrices and vectors: the expected values.

use crate::dense::dense;
use nalgebra::{DMatrix, DVector};

use super::sized::{Shape, sized};
use super::*;

type Vector = DVector<f64>;

/// A design as matrices; signals are values, not deviations.
pub(super) struct Oracle {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    f_a: DMatrix<f64>,
    a_f: Option<DMatrix<f64>>,
    p_f: Option<DMatrix<f64>>,
    sliding_mode: Option<aso_controller::design::SlidingMode>,
    k_x: DMatrix<f64>,
    k_f: DMatrix<f64>,
    l_x: DMatrix<f64>,
    l_f: DMatrix<f64>,
    filter: Option<Vector>,
    tracking: Tracking,
    transfer: Option<f64>,
    r_op: Vector,
    period: Option<f64>,
    x_op: Vector,
    u_op: Vector,
    y_op: Vector,
    limits: Vec<[f64; 2]>,
}

/// The matrices H, K_i, F_i, L_w, N_r of the references; zero where the design states none.
struct Tracking {
    h: DMatrix<f64>,
    k_i: DMatrix<f64>,
    f_i: DMatrix<f64>,
    l_w: DMatrix<f64>,
    n_r: DMatrix<f64>,
}

/// The estimates x_hat, f_hat, y_f, x_i, u_t.
#[derive(Clone)]
pub(super) struct Estimate {
    pub(super) x: Vector,
    pub(super) f: Vector,
    pub(super) y_f: Vector,
    pub(super) x_i: Vector,
    pub(super) u_t: Vector,
}

impl Estimate {
    /// The estimates in one list.
    pub(super) fn all(&self) -> Vec<f64> {
        [&self.x, &self.f, &self.y_f, &self.x_i, &self.u_t].map(Vector::as_slice).concat()
    }

    fn along(&self, slope: &Self, h: f64) -> Self {
        Self {
            x: &self.x + &slope.x * h,
            f: &self.f + &slope.f * h,
            y_f: &self.y_f + &slope.y_f * h,
            x_i: &self.x_i + &slope.x_i * h,
            u_t: &self.u_t + &slope.u_t * h,
        }
    }
}

impl Oracle {
    pub(super) fn of(design: &Design) -> Self {
        let operating = |value: Option<f64>| value.unwrap_or(0.0);
        let all = |values: Vec<f64>| Vector::from_vec(values);
        let (m, p, q) = (design.actuators.len(), design.measurements.len(), design.faults.len());
        let (t, integrals) = (design.references.len(), design.integrals());
        let stated = |matrix: &Option<aso_controller::Matrix>, rows: usize, columns: usize| {
            matrix.as_ref().map_or(DMatrix::zeros(rows, columns), dense)
        };
        Self {
            tracking: Tracking {
                h: stated(&design.h, integrals, p),
                k_i: stated(&design.k_i, m, integrals),
                f_i: stated(&design.f_i, integrals, q),
                l_w: stated(&design.l_w, integrals, m),
                n_r: stated(&design.n_r, m, t),
            },
            transfer: design.transfer,
            r_op: all(design
                .references
                .iter()
                .map(|reference| operating(reference.operating))
                .collect()),
            period: design.sample_time,
            a: dense(&design.a),
            b: dense(&design.b),
            c: dense(&design.c),
            d: stated(&design.d, p, m),
            f_a: dense(&design.f_a),
            a_f: design.a_f.as_ref().map(dense),
            p_f: design.p_f.as_ref().map(dense),
            sliding_mode: design.sliding_mode.clone(),
            k_x: dense(&design.k_x),
            k_f: dense(&design.k_f),
            l_x: dense(&design.l_x),
            l_f: dense(&design.l_f),
            filter: design.filter.clone().map(all),
            x_op: all(design.states.iter().map(|state| operating(state.operating)).collect()),
            u_op: all(design
                .actuators
                .iter()
                .map(|actuator| operating(actuator.operating))
                .collect()),
            y_op: all(design
                .measurements
                .iter()
                .map(|measurement| operating(measurement.operating))
                .collect()),
            limits: design
                .actuators
                .iter()
                .map(|signal| signal.limits.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]))
                .collect(),
        }
    }

    /// The estimate that a controller starts from, and its inputs [y; r].
    pub(super) fn start(&self, controller: &AsoController) -> (Estimate, Vector) {
        let y = Vector::from_column_slice(&controller.values.y);
        let filtered = if self.filter.is_some() { y.clone() } else { Vector::zeros(0) };
        let starts = [&controller.x_hat_0, &controller.f_hat_0, &controller.x_i_0];
        let [x, f, x_i] = starts.map(|values| Vector::from_column_slice(values));
        let inputs = [y.as_slice(), &controller.values.r].concat();
        let u_t = Vector::zeros(self.transfer.map_or(0, |_| self.u_op.len()));
        (Estimate { x, f, y_f: filtered, x_i, u_t }, Vector::from_vec(inputs))
    }

    /// Splits inputs [y; r] into y and the deviations of r.
    fn inputs(&self, inputs: &Vector) -> (Vector, Vector) {
        let (p, t) = (self.y_op.len(), self.r_op.len());
        (inputs.rows(0, p).into(), inputs.rows(p, t) - &self.r_op)
    }

    /// The estimated faults f_hat while estimating.
    pub(super) fn fault(&self, z: &Estimate, inputs: &Vector) -> Vector {
        match &self.p_f {
            Some(p_f) => &z.f + p_f * self.innovation(z, &self.inputs(inputs).0),
            None => z.f.clone(),
        }
    }

    /// The commands without limits.
    fn free(&self, z: &Estimate, inputs: &Vector, on: bool) -> Vector {
        let fault = &self.k_f * self.fault(z, inputs) * f64::from(u8::from(on));
        let Tracking { k_i, n_r, .. } = &self.tracking;
        let reference = k_i * &z.x_i + n_r * self.inputs(inputs).1;
        let left = if self.transfer.is_some() { z.u_t.clone() } else { &self.u_op * 0.0 };
        &self.u_op + &self.k_x * (&z.x - &self.x_op) + fault + reference + left
    }

    /// The parts of x_i': without the back-calculation, and the back-calculation.
    fn integral(&self, z: &Estimate, inputs: &Vector, on: bool) -> [Vector; 2] {
        let Tracking { h, f_i, l_w, .. } = &self.tracking;
        let (y, r) = self.inputs(inputs);
        let lost = self.command(z, inputs, on) - self.free(z, inputs, on);
        if h.nrows() == 0 {
            return [Vector::zeros(0), Vector::zeros(0)];
        }
        let f_hat = if on { self.fault(z, inputs) } else { z.f.clone() };
        [r - h * (y - &self.y_op) + f_i * f_hat, l_w * lost]
    }

    pub(super) fn command(&self, z: &Estimate, inputs: &Vector, on: bool) -> Vector {
        let mut u = self.free(z, inputs, on);
        for (u, [low, high]) in u.iter_mut().zip(&self.limits) {
            *u = u.clamp(*low, *high);
        }
        u
    }

    fn innovation(&self, z: &Estimate, y: &Vector) -> Vector {
        let source = if self.filter.is_some() { &z.y_f } else { y };
        source - &self.y_op - &self.c * (&z.x - &self.x_op)
    }

    /// The derivative z' at the inputs [y; r].
    fn rate(&self, z: &Estimate, inputs: &Vector, on: bool) -> Estimate {
        let (y, _) = self.inputs(inputs);
        let (u, e) = (self.command(z, inputs, on), self.innovation(z, &y));
        let [x_i, back] = self.integral(z, inputs, on);
        let fault = self.a_f.as_ref().map_or_else(|| &z.f * 0.0, |a_f| a_f * &z.f);
        let given = y - &self.d * (&u - &self.u_op);
        Estimate {
            x: &self.a * (&z.x - &self.x_op)
                + &self.b * (u - &self.u_op)
                + &self.f_a * &z.f
                + &self.l_x * &e,
            f: (fault + &self.l_f * e) * f64::from(u8::from(on)),
            y_f: self.filter.as_ref().map_or(z.y_f.clone(), |w| w.component_mul(&(given - &z.y_f))),
            x_i: x_i + back,
            u_t: &z.u_t * -self.transfer.unwrap_or_default(),
        }
    }

    /// A classic Runge-Kutta step of `h` from inputs [y; r] with slopes.
    pub(super) fn runge_kutta(
        &self,
        z: &Estimate,
        (y, slope): (&Vector, &Vector),
        h: f64,
        on: bool,
    ) -> Estimate {
        let middle = y + slope * (0.5 * h);
        let k1 = self.rate(z, y, on);
        let k2 = self.rate(&z.along(&k1, 0.5 * h), &middle, on);
        let k3 = self.rate(&z.along(&k2, 0.5 * h), &middle, on);
        let k4 = self.rate(&z.along(&k3, h), &(y + slope * h), on);
        z.along(&k1, h / 6.0).along(&k2, h / 3.0).along(&k3, h / 3.0).along(&k4, h / 6.0)
    }

    /// The command at the operating point.
    pub(super) fn operating_command(&self) -> Vector {
        self.u_op.clone()
    }

    /// Takes a sample at z[k|k-1] with the inputs [y; r] and the previous command. Returns the estimate that is used, u
    /// and z[k+1|k]. Switches: a current estimator; compensation at the previous sample; compensation now.
    pub(super) fn sample(
        &self,
        z: &Estimate,
        (inputs, previous): (&Vector, &Vector),
        [current, was_on, on]: [bool; 3],
    ) -> (Estimate, Vector, Estimate) {
        let y = self.inputs(inputs).0 - &self.d * (previous - &self.u_op);
        let e = self.innovation(z, &y);
        let gain = |applies: bool| if applies { &e * 1.0 } else { &e * 0.0 };
        let (before, after) = (gain(current), gain(!current));
        let on_number = f64::from(u8::from(on));
        let seen = &self.l_f * &before;
        let mut used = Estimate {
            x: &z.x + &self.l_x * &before,
            f: match &self.sliding_mode {
                Some(injection) if on => Vector::from_fn(seen.len(), |i, _| {
                    injection.rho[i] * seen[i] / (seen[i].abs() + injection.delta[i])
                }),
                _ => &z.f + seen * on_number,
            },
            ..z.clone()
        };
        if self.transfer.is_some() && was_on != on {
            used.u_t.fill(0.0);
            used.u_t = previous - self.free(&used, inputs, on);
        }
        let u = self.command(&used, inputs, on);
        let x = &self.a * (&used.x - &self.x_op)
            + &self.b * (&u - &self.u_op)
            + &self.f_a * &used.f
            + &self.l_x * &after
            + &self.x_op;
        let kept = match &self.a_f {
            Some(a_f) if on => a_f * &used.f,
            _ => used.f.clone(),
        };
        let f = kept + &self.l_f * after * on_number;
        let moved = |w: &Vector| &z.y_f + w.component_mul(&(&y - &z.y_f));
        let y_f = self.filter.as_ref().map_or(z.y_f.clone(), moved);
        let [x_i, back] = self.integral(&used, inputs, on);
        let x_i = &z.x_i + x_i * self.period.unwrap_or(f64::NAN) + back;
        let u_t = &used.u_t * (1.0 - self.transfer.unwrap_or_default());
        (used, u, Estimate { x, f, y_f, x_i, u_t })
    }
}

/// A controller whose A is stable, its limits close to its first commands, and its oracle.
pub(super) fn tamed(of: Shape) -> (AsoController, Oracle) {
    let mut model = sized(of);
    let n = model.design.states.len();
    for i in 0..n {
        model.design.a.values[i * (n + 1)] -= if model.sampler.is_some() { 0.3 } else { 3.0 };
    }
    if model.sampler.is_none() {
        model.design.t_on = 0.0;
    }
    model.initialize(&Experiment::default()).unwrap();
    for (actuator, u) in model.design.actuators.iter_mut().zip(&model.values.u) {
        actuator.limits = actuator.limits.map(|_| [u - 0.05, u + 0.05]);
    }
    let oracle = Oracle::of(&model.design);
    (model, oracle)
}

/// Whether all numbers agree to `tolerance`, relative to the larger of the number and 1.
pub(super) fn agree(actual: &[f64], required: &[f64], tolerance: f64) -> bool {
    actual.len() == required.len()
        && actual.iter().zip(required).all(|(a, b)| (a - b).abs() <= tolerance * b.abs().max(1.0))
}
