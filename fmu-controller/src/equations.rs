//! The equations of the controller, written once for plain and for dual numbers.
//!
//! With z = [x_hat; f_hat; y_f; x_i; u_t], measurements y, references r and the command u that is really applied
//! (equations (1), (2), (4), (5), (18) of Patton and Klinkhieo (2009) in the general form)
//!
//! ```text
//! e      = y - C x_hat                                the innovation
//! u      = K_x x_hat + K_f f_hat                      while compensating, else K_x x_hat
//! x_hat' = A x_hat + B u + F_a f_hat + L_x e
//! f_hat' = A_f f_hat + L_f e                          while estimating, else 0
//! ```
//!
//! and every channel of u kept within its limits. A design without A_f has A_f = 0. In a design with
//! a direct term P_f, z has f_hat_i, the integral part, in place of f_hat, and
//!
//! ```text
//! x_hat'   = A x_hat + B u + F_a f_hat_i + L_x e
//! f_hat_i' = A_f f_hat_i + L_f e                      while estimating, else 0
//! f_hat    = f_hat_i + P_f e                          while estimating, else f_hat_i
//! ```
//!
//! In a design with a filter, y_f takes the place of y in e, and
//!
//! ```text
//! y_f' = W (y - D u - y_f)
//! ```
//!
//! else z has no y_f. A design without D has D = 0. In a design with references
//!
//! ```text
//! u    = K_x x_hat + K_f f_hat + K_i x_i + N_r r
//! x_i' = r - H y + F_i f_hat + L_w (u - (K_x x_hat + K_f f_hat + K_i x_i + N_r r))
//! ```
//!
//! H uses only measurements whose rows of D are zero. x_i integrates the distance of the references from
//! H y - F_i f_hat, that is H y without the estimated sensor faults.
//! The last term is the back-calculation of Åström and Rundqwist, Integrator windup and how to avoid it
//! (American Control Conference 1989): it is not zero while a command is at a limit, and then lets x_i
//! follow the command that is really applied. A term is absent if the design does not state its matrix.
//!
//! A design with a transfer adds u_t to u, also to the commands in x_i':
//!
//! ```text
//! u_t' = -w u_t
//! ```
//!
//! When the law changes (compensation, actuators that are gone, fall-back), u_t becomes the distance of the last
//! commands from those of the new law, so that the commands do not jump.
//!
//! All signals, limits included, are deviations from the operating point, which is
//! zero where the design states none. A sampled controller has the same terms (`sampled.rs`).
//!
//! Everything else follows from these functions: the matrices of the exact step (`observer.rs`) are their values at
//! unit vectors, the directional derivatives are their values for dual numbers, and u' is the command at z'.

use crate::mode::Mode;
use crate::number::Number;
use crate::signals::Signals;
use aso_controller::Matrix;
use aso_controller::design::{Design, SlidingMode};

/// The equations of one design in one mode, for numbers `D`.
#[derive(Clone, Copy)]
pub(crate) struct Equations<'a, D: Number> {
    design: D::In<'a, Design>,
    mode: Mode,
    /// Numbers of states, faults, filters and integrals: the lengths of the first four parts of z.
    states: usize,
    faults: usize,
    filters: usize,
    integrals: usize,
}

/// The parts of z; `f_hat` is f_hat_i in a design with a direct term.
#[derive(Clone, Copy)]
pub(crate) struct Estimate<'a, D: Number> {
    x_hat: D::In<'a, [f64]>,
    f_hat: D::In<'a, [f64]>,
    y_f: D::In<'a, [f64]>,
    x_i: D::In<'a, [f64]>,
    u_t: D::In<'a, [f64]>,
}

/// The signals on the right-hand sides.
#[derive(Clone, Copy)]
pub(crate) struct Knowns<'a, D: Number> {
    pub(crate) z: Estimate<'a, D>,
    pub(crate) y: D::In<'a, [f64]>,
    pub(crate) r: D::In<'a, [f64]>,
    e: D::In<'a, [f64]>,
    u: D::In<'a, [f64]>,
}

impl<D: Number> Knowns<'_, D> {
    /// A copy of the signals with innovations of zero.
    pub(crate) fn without_innovations(self) -> Self {
        Self { e: D::part(self.e, |e| &e[..0]), ..self }
    }
}

impl<'a, D: Number> Equations<'a, D> {
    pub(crate) fn new(design: D::In<'a, Design>, mode: Mode) -> Self {
        let Design { states, faults, filter, .. } = D::values(design);
        let filters = filter.as_ref().map_or(0, Vec::len);
        let integrals = D::values(design).integrals();
        Self { design, mode, states: states.len(), faults: faults.len(), filters, integrals }
    }

    /// Splits z into its parts.
    #[inline]
    pub(crate) fn estimate(self, z: D::In<'_, [f64]>) -> Estimate<'_, D> {
        let faults = self.states..self.states + self.faults;
        let integrals = faults.end + self.filters..faults.end + self.filters + self.integrals;
        Estimate {
            x_hat: D::part(z, |z| &z[..faults.start]),
            f_hat: D::part(z, |z| &z[faults.clone()]),
            y_f: D::part(z, |z| &z[faults.end..integrals.start]),
            x_i: D::part(z, |z| &z[integrals.clone()]),
            u_t: D::part(z, |z| &z[integrals.end..]),
        }
    }

    /// The present values of the signals on the right-hand sides.
    #[inline]
    pub(crate) fn knowns<'b>(self, signals: &'b D::Out<'_, Signals>) -> Knowns<'b, D> {
        let signals = D::read(signals);
        Knowns {
            z: self.estimate(D::part(signals, |signals| &signals.z[..])),
            y: D::part(signals, |signals| &signals.y[..]),
            r: D::part(signals, |signals| &signals.r[..]),
            e: D::part(signals, |signals| &signals.e[..]),
            u: D::part(signals, |signals| &signals.u[..]),
        }
    }

    /// Computes e, the estimates of a design with a direct term, the free commands and z' from z, y and r. The commands
    /// at a limit must be in u already.
    pub(crate) fn evaluate(
        self,
        signals: &mut D::Out<'_, Signals>,
        z_slopes: &mut D::Out<'_, [f64]>,
    ) {
        self.set_signals(signals);
        self.set_slopes(self.knowns(signals), z_slopes);
    }

    /// Computes e, the estimates of a design with a direct term, and the free commands from z, y and r.
    pub(crate) fn set_signals(self, signals: &mut D::Out<'_, Signals>) {
        for k in 0..D::values(D::read(signals)).e.len() {
            let Knowns { z, y, .. } = self.knowns(signals);
            let e = self.innovation(k, z, y);
            D::write(signals, |signals| &mut signals.e[k], e);
        }
        self.set_free_commands(signals);
    }

    /// Computes the estimates of a design with a direct term, and the commands that are not at a
    /// limit, from z, y and r.
    pub(crate) fn set_free_commands(self, signals: &mut D::Out<'_, Signals>) {
        for i in 0..D::values(D::read(signals)).f_hat.len() {
            let Knowns { z, y, .. } = self.knowns(signals);
            let f_hat = self.fault(i, z, y);
            D::write(signals, |signals| &mut signals.f_hat[i], f_hat);
        }
        for j in 0..D::values(D::read(signals)).u.len() {
            if !self.mode.is_limited(j) {
                let Knowns { z, y, r, u, .. } = self.knowns(signals);
                let u = self.free_command(j, z, [y, r], self.stuck_part(j, u));
                D::write(signals, |signals| &mut signals.u[j], u);
            }
        }
    }

    /// Element `k` of e = y - C x_hat; with a filter, of y_f - C x_hat.
    #[inline]
    pub(crate) fn innovation(
        self,
        k: usize,
        Estimate { x_hat, y_f, .. }: Estimate<'_, D>,
        y: D::In<'_, [f64]>,
    ) -> D {
        let filtered = D::values(self.design).filter.is_some();
        let observed = if filtered { D::at(y_f, k) } else { D::at(y, k) };
        observed - self.product(|design| design.c.row(k), x_hat)
    }

    /// Element `j` of K_x x_hat + K_f f_hat + K_i x_i + N_r r + `stuck` + u_t without limits; the second term while
    /// compensating, the others where the design states their matrix.
    #[inline]
    pub(crate) fn free_command(
        self,
        j: usize,
        z: Estimate<'_, D>,
        [y, r]: [D::In<'_, [f64]>; 2],
        stuck: D,
    ) -> D {
        let gains = |design: &'a Design| self.mode.gains(design);
        let k_x = |design| gains(design).map_or_else(|| design.k_x.row(j), |gains| gains.k_x(j));
        let mut command = self.product(k_x, z.x_hat);
        if self.mode.compensating {
            let k_f =
                |design| gains(design).map_or_else(|| design.k_f.row(j), |gains| gains.k_f(j));
            command += self.product_with_faults(k_f, z, y);
        }
        let Design { k_i, n_r, .. } = D::values(self.design);
        if k_i.is_some() {
            command += self.product(|design| row(design.k_i.as_ref(), j), z.x_i);
        }
        if n_r.is_some() {
            command += self.product(|design| row(design.n_r.as_ref(), j), r);
        }
        command += stuck;
        if D::values(self.design).transfer.is_some() {
            command += D::at(z.u_t, j);
        }
        command
    }

    /// Element `i` of f_hat in a design with a direct term: f_hat_i + P_f e, the second term while
    /// estimating.
    #[inline]
    pub(crate) fn fault(self, i: usize, z: Estimate<'_, D>, y: D::In<'_, [f64]>) -> D {
        let mut fault = D::at(z.f_hat, i);
        if self.mode.estimating {
            let gains = D::list(D::part(self.design, |design| row(design.p_f.as_ref(), i)));
            fault += gains.enumerate().map(|(k, gain)| gain * self.innovation(k, z, y)).sum::<D>();
        }
        fault
    }

    /// A row of a matrix times f_hat, which depends on z and y in a design with a direct term.
    #[inline]
    fn product_with_faults(
        self,
        row: impl Fn(&'a Design) -> &'a [f64],
        z: Estimate<'_, D>,
        y: D::In<'_, [f64]>,
    ) -> D {
        if D::values(self.design).p_f.is_none() {
            return self.product(row, z.f_hat);
        }
        let gains = D::list(D::part(self.design, row)).enumerate();
        gains.map(|(i, gain)| gain * self.fault(i, z, y)).sum()
    }

    /// The part of command `j` that stuck actuators cause: row j of K_s times their commands.
    fn stuck_part(self, j: usize, u: D::In<'_, [f64]>) -> D {
        let row =
            |design: &'a Design| self.mode.gains(design).map_or(&[][..], |gains| gains.k_s(j));
        let k_s = D::list(D::part(self.design, row)).zip(self.mode.gone_channels());
        // -0 + x has the bits of x.
        k_s.fold(-D::zero(), |sum, (k_s, gone)| sum + k_s * D::at(u, gone))
    }

    /// Computes z' = [A x_hat + B u + F_a f_hat + L_x e; A_f f_hat + L_f e; W (y - D u - y_f); x_i'; -w u_t], the
    /// second part 0 unless estimating. In a sampled controller, whose y is without D u, these are the terms of the
    /// prediction.
    pub(crate) fn set_slopes(self, knowns: Knowns<'_, D>, z_slopes: &mut D::Out<'_, [f64]>) {
        let Knowns { z: Estimate { x_hat, f_hat, y_f, u_t, .. }, y, e, u, .. } = knowns;
        let design = |matrix: fn(&Design) -> &Matrix| D::part(self.design, matrix);
        for i in 0..self.states {
            // -0 + x has the bits of x.
            D::write(z_slopes, |z_slopes| &mut z_slopes[i], -D::zero());
        }
        D::add_product::<true>(z_slopes, 0, design(|design| &design.a), x_hat);
        D::add_product::<true>(z_slopes, 0, design(|design| &design.b), u);
        D::add_product::<true>(z_slopes, 0, design(|design| &design.f_a), f_hat);
        D::add_product::<false>(z_slopes, 0, design(|design| &design.l_x), e);
        for i in 0..self.faults {
            let mut slope = D::zero();
            if self.has_fault_model() {
                let row = |a_f: &'a Matrix| a_f.row(i);
                slope = self.product(|design| design.a_f.as_ref().map_or(&[], row), f_hat);
            }
            D::write(z_slopes, |z_slopes| &mut z_slopes[self.states + i], slope);
        }
        if self.mode.estimating {
            D::add_product::<false>(z_slopes, self.states, design(|design| &design.l_f), e);
        }
        let w = D::part(self.design, |design| design.filter.as_deref().unwrap_or_default());
        // D u was removed from the measurements of a sampled controller.
        let Design { d, sample_time, .. } = D::values(self.design);
        let has_feedthrough = d.is_some() && sample_time.is_none();
        for (k, w) in D::list(w).enumerate() {
            let mut distance = D::at(y, k) - D::at(y_f, k);
            if has_feedthrough {
                distance -= self.product(|design| row(design.d.as_ref(), k), u);
            }
            let slope = w * distance;
            D::write(z_slopes, |z_slopes| &mut z_slopes[self.states + self.faults + k], slope);
        }
        let first = self.states + self.faults + self.filters;
        for i in 0..self.integrals {
            let slope = self.integral_slope(i, knowns);
            D::write(z_slopes, |z_slopes| &mut z_slopes[first + i], slope);
        }
        let decay = D::values(self.design).transfer.unwrap_or_default();
        for (j, u_t) in D::list(u_t).enumerate() {
            let slope = -(u_t * decay);
            D::write(z_slopes, |z_slopes| &mut z_slopes[first + self.integrals + j], slope);
        }
    }

    /// Element `i` of x_i' = r - H y + F_i f_hat + L_w (u - free command); in a sampled controller the change
    /// in a sample, where the first three terms have the factor T.
    fn integral_slope(self, i: usize, Knowns { z, y, r, u, .. }: Knowns<'_, D>) -> D {
        let mut slope = D::at(r, i) - self.product(|design| row(design.h.as_ref(), i), y);
        let Design { f_i, l_w, sample_time, actuators, .. } = D::values(self.design);
        if f_i.is_some() {
            slope += self.product_with_faults(|design| row(design.f_i.as_ref(), i), z, y);
        }
        slope *= sample_time.unwrap_or(1.0);
        if l_w.is_some() {
            let gains = D::part(self.design, |design| row(design.l_w.as_ref(), i));
            for j in (0..actuators.len()).filter(|j| self.mode.is_limited(*j)) {
                let free = self.free_command(j, z, [y, r], -D::zero());
                slope += D::at(gains, j) * (D::at(u, j) - free);
            }
        }
        slope
    }

    /// Adds [L_x e; L_f e] to x_hat and, while estimating, f_hat. A sliding-mode law replaces f_hat by
    /// rho L_f e / (|L_f e| + delta), element by element.
    pub(crate) fn correct(self, signals: &mut D::Out<'_, Signals>) {
        for i in 0..self.states {
            let Knowns { z, e, .. } = self.knowns(signals);
            let x_hat = self.sum(D::at(z.x_hat, i), |design| design.l_x.row(i), e);
            D::write(signals, |signals| &mut signals.z[i], x_hat);
        }
        for i in (0..self.faults).filter(|_| self.mode.estimating) {
            let Knowns { z, e, .. } = self.knowns(signals);
            let f_hat = if D::values(self.design).sliding_mode.is_some() {
                self.injection(i, e)
            } else {
                self.sum(D::at(z.f_hat, i), |design| design.l_f.row(i), e)
            };
            D::write(signals, |signals| &mut signals.z[self.states + i], f_hat);
        }
    }

    /// Element `i` of rho L_f e / (|L_f e| + delta).
    fn injection(self, i: usize, e: D::In<'_, [f64]>) -> D {
        let number = |list: fn(&SlidingMode) -> &Vec<f64>| {
            let lists = |design: &'a Design| {
                design.sliding_mode.as_ref().map_or(&[][..], |law| list(law).as_slice())
            };
            D::at(D::part(self.design, lists), i)
        };
        let innovation = self.product(|design| design.l_f.row(i), e);
        let size = if innovation.re() < 0.0 { -innovation } else { innovation };
        number(|law| &law.rho) * innovation / (size + number(|law| &law.delta))
    }

    /// Whether A_f f_hat is part of f_hat'.
    pub(crate) fn has_fault_model(self) -> bool {
        self.mode.estimating && D::values(self.design).a_f.is_some()
    }

    /// A row of a matrix times a vector.
    #[inline]
    fn product(self, row: impl Fn(&'a Design) -> &'a [f64], vector: D::In<'_, [f64]>) -> D {
        let row = D::list(D::part(self.design, row));
        row.zip(D::list(vector)).map(|(entry, element)| entry * element).sum()
    }

    /// `start` plus a row of a matrix times a vector, term by term.
    #[inline]
    fn sum(self, start: D, row: impl Fn(&'a Design) -> &'a [f64], vector: D::In<'_, [f64]>) -> D {
        let row = D::list(D::part(self.design, row));
        row.zip(D::list(vector)).fold(start, |sum, (entry, element)| sum + entry * element)
    }
}

impl Mode {
    /// The mode in which a channel is at a limit if its free command, at `z` and the inputs y and r (deviations), is
    /// beyond the limit and its actuator is not gone.
    pub(crate) fn limited(self, design: &Design, z: &[f64], inputs: [&[f64]; 2]) -> Self {
        let mut mode = self;
        (mode.lower, mode.upper) = (0, 0);
        let equations = Equations::<f64>::new(design, mode);
        for (j, actuator) in design.actuators.iter().enumerate() {
            if let Some([low, high]) = actuator.range().filter(|_| !self.is_gone(j)) {
                // -0 + x has the bits of x.
                let stuck = if self.gone != 0 { self.stuck_part(design, j) } else { -0.0 };
                let command = equations.free_command(j, equations.estimate(z), inputs, stuck);
                mode.lower |= u64::from(command < low) << j;
                mode.upper |= u64::from(command > high) << j;
            }
        }
        mode
    }
}

/// A row of a matrix; empty if the design does not state the matrix.
fn row(matrix: Option<&Matrix>, row: usize) -> &[f64] {
    matrix.map_or(&[], |matrix| matrix.row(row))
}
