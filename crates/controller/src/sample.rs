//! A sample of the controller, for numbers of any kind.
//!
//! With measurements y, references r and the command u that is really applied, all as deviations from the operating
//! point, sample k is
//!
//! ```text
//! e      = y - C x_hat                                 the innovation; with a filter y_f - C x_hat
//! f_hat  = f_hat_i + P_f e                             while estimating, else f_hat_i
//! u      = K_x x_hat + K_f f_hat + K_i x_i + N_r r + u_t     K_f f_hat while compensating
//! x_hat' = A x_hat + B u + F_a f_hat_i + L_x e         the estimate for sample k + 1
//! f_hat_i' = A_f f_hat_i + L_f e                       while estimating, else f_hat_i
//! y_f'   = W (y - y_f) + y_f
//! x_i'   = T (r - H y + F_i f_hat) + L_w (u - v) + x_i v is u without limits
//! u_t'   = u_t - w u_t                                 when the law changes, u_t = u before - u
//! ```
//!
//! (R. J. Patton and S. Klinkhieo, An Adaptive Approach to Active Fault-Tolerant Control, 2009, equations (2), (4),
//! (5), (18), in their general form). A current estimator adds `L_x` e and `L_f` e to `x_hat` and `f_hat_i` before it
//! computes u, not after it. Without `P_f` the estimate `f_hat` is `f_hat_i`; each other term exists if the design
//! states its matrix.
//!
//! Every sum has its terms in the order of its equation, so that the results have the bits of the controller FMU. No
//! function here allocates, indexes or panics. All of them are inlined into the step of a design, where the compiler
//! knows every size and leaves out what the design does not have.

pub mod detection;
mod matrix;
pub mod measurements;
mod number;
pub mod reconfiguration;

pub use matrix::Matrix;
pub use number::{Number, all_finite};

/// The numbers of a design at one value of the scheduling variable and with one set of gains; n states, m actuators,
/// p measurements, q faults, t references. A matrix that it does not state is [`Matrix::NONE`], a vector empty.
#[derive(Clone, Copy)]
pub struct Design<'a, N> {
    /// T in s.
    pub sample_time: &'a N,
    /// Whether the estimator is current: the commands of a sample use its measurements.
    pub is_current: bool,
    /// A, n x n.
    pub a: Matrix<'a, N>,
    /// B, n x m.
    pub b: Matrix<'a, N>,
    /// C, p x n.
    pub c: Matrix<'a, N>,
    /// D, p x m: the commands of the sample before in the measurements.
    pub d: Matrix<'a, N>,
    /// `F_a`, n x q.
    pub f_a: Matrix<'a, N>,
    /// `A_f`, q x q; without it faults are constant.
    pub a_f: Matrix<'a, N>,
    /// `P_f`, q x p.
    pub p_f: Matrix<'a, N>,
    /// `K_x`, m x n.
    pub k_x: Matrix<'a, N>,
    /// `K_f`, m x q.
    pub k_f: Matrix<'a, N>,
    /// `L_x`, n x p.
    pub l_x: Matrix<'a, N>,
    /// `L_f`, q x p.
    pub l_f: Matrix<'a, N>,
    /// H, t x p.
    pub h: Matrix<'a, N>,
    /// `K_i`, m x t.
    pub k_i: Matrix<'a, N>,
    /// `F_i`, t x q.
    pub f_i: Matrix<'a, N>,
    /// `L_w`, t x m.
    pub l_w: Matrix<'a, N>,
    /// `N_r`, m x t.
    pub n_r: Matrix<'a, N>,
    /// The diagonal of W, p numbers.
    pub filter: &'a [N],
    /// w of `u_t`, one number.
    pub transfer: &'a [N],
    /// The bounds of the estimates of a sliding-mode law, q numbers.
    pub rho: &'a [N],
    /// The half-widths of its boundary layers, q numbers.
    pub delta: &'a [N],
    /// The states at the operating point.
    pub x_op: &'a [N],
    /// The commands at the operating point.
    pub u_op: &'a [N],
    /// The measurements at the operating point.
    pub y_op: &'a [N],
    /// The references at the operating point.
    pub r_op: &'a [N],
    /// The smallest commands: as deviations, as values; empty without limits.
    pub low: [&'a [N]; 2],
    /// The largest commands: as deviations, as values; empty without limits.
    pub high: [&'a [N]; 2],
}

/// The state of the controller before a sample, and the inputs of the sample, as values.
pub struct State<'a, N> {
    /// The estimate of the states from the measurements before this sample.
    pub x_hat: &'a mut [N],
    /// The estimate of the faults, without its direct term.
    pub f_hat: &'a mut [N],
    /// The filtered measurements.
    pub y_f: &'a mut [N],
    /// The integrals.
    pub x_i: &'a mut [N],
    /// The remaining distance of the commands from the law that is in force.
    pub u_t: &'a mut [N],
    /// The commands of the sample before as deviations, of a design with D.
    pub u_before: &'a mut [N],
    /// The commands of the last sample.
    pub u: &'a mut [N],
    /// The measurements.
    pub y: &'a [N],
    /// The references.
    pub r: &'a [N],
}

/// The signals of a sample: deviations from the operating point, then values, then the state for the next sample.
pub struct Signals<'a, N> {
    /// The measurements, without D u of the sample before.
    pub y: &'a mut [N],
    /// The filtered measurements.
    pub y_f: &'a mut [N],
    /// The references.
    pub r: &'a mut [N],
    /// The innovations.
    pub e: &'a mut [N],
    /// The estimate of the states.
    pub x_hat: &'a mut [N],
    /// The integral part of the estimate of the faults.
    pub f_hat_i: &'a mut [N],
    /// The estimate of the faults.
    pub f_hat: &'a mut [N],
    /// The commands.
    pub u: &'a mut [N],
    /// The commands without limits, then what the limits add to them; empty without `L_w`.
    pub excess: &'a mut [N],
    /// The commands as values.
    pub command: &'a mut [N],
    /// The estimate of the states as values.
    pub x_value: &'a mut [N],
    /// The estimate of the faults as values; faults have no operating point.
    pub f_value: &'a mut [N],
    /// The estimate of the states for the next sample.
    pub next_x_hat: &'a mut [N],
    /// The estimate of the faults for the next sample.
    pub next_f_hat: &'a mut [N],
    /// The next filtered measurements.
    pub next_y_f: &'a mut [N],
    /// The next integrals.
    pub next_x_i: &'a mut [N],
    /// The next `u_t`.
    pub next_u_t: &'a mut [N],
}

/// `target[i]` = `values[i]` - `points[i]`
fn subtract<N: Number>(values: &[N], points: &[N], target: &mut [N]) {
    for ((target, value), point) in target.iter_mut().zip(values).zip(points) {
        *target = value.clone() - point.clone();
    }
}

/// `target[i]` = `target[i]` + `values[i]`
fn add<N: Number>(values: &[N], target: &mut [N]) {
    for (target, value) in target.iter_mut().zip(values) {
        *target = target.clone() + value.clone();
    }
}

/// Turns -0 into 0.
fn add_zero<N: Number>(target: &mut [N]) {
    for target in target {
        *target = target.clone() + N::zero();
    }
}

fn copy<N: Number>(values: &[N], target: &mut [N]) {
    for (target, value) in target.iter_mut().zip(values) {
        *target = value.clone();
    }
}

impl<N: Number> Signals<'_, N> {
    /// Sets y, `y_f`, `x_hat`, `f_hat_i` and r: the inputs and the state as deviations from the operating point.
    #[inline(always)]
    pub fn set_deviations(&mut self, design: &Design<'_, N>, state: &State<'_, N>) {
        subtract(state.y, design.y_op, self.y);
        add_zero(self.y);
        subtract(state.y_f, design.y_op, self.y_f);
        subtract(state.x_hat, design.x_op, self.x_hat);
        copy(state.f_hat, self.f_hat_i);
        subtract(state.r, design.r_op, self.r);
        add_zero(self.r);
    }

    /// y = y - D u of the sample before
    #[inline(always)]
    pub fn remove_feedthrough(&mut self, design: &Design<'_, N>, state: &State<'_, N>) {
        design.d.subtract_product(state.u_before, self.y);
    }

    /// e = y - C `x_hat`; with a filter, `y_f` - C `x_hat`
    #[inline(always)]
    pub fn set_innovation(&mut self, design: &Design<'_, N>) {
        copy(if design.filter.is_empty() { self.y } else { self.y_f }, self.e);
        design.c.subtract_product(self.x_hat, self.e);
    }

    /// `x_hat` = `x_hat` + `L_x` e
    #[inline(always)]
    pub fn correct_states(&mut self, design: &Design<'_, N>) {
        design.l_x.accumulate(self.e, self.x_hat);
    }

    /// `f_hat_i` = `f_hat_i` + `L_f` e
    #[inline(always)]
    pub fn correct_faults(&mut self, design: &Design<'_, N>) {
        design.l_f.accumulate(self.e, self.f_hat_i);
    }

    /// s = `L_f` e of a sliding-mode law, in place of `f_hat_i`
    #[inline(always)]
    pub fn set_sliding_variable(&mut self, design: &Design<'_, N>) {
        design.l_f.set_product(self.e, self.f_hat_i);
    }

    /// `f_hat_i` = rho s / (|s| + delta), element by element; s is `f_hat_i` before the call
    #[inline(always)]
    pub fn inject(&mut self, design: &Design<'_, N>) {
        for ((f_hat, rho), delta) in self.f_hat_i.iter_mut().zip(design.rho).zip(design.delta) {
            let s = f_hat.clone();
            let size = if s.is_below(&N::zero()) { -s.clone() } else { s.clone() };
            *f_hat = rho.clone() * s / (size + delta.clone());
        }
    }

    /// `f_hat` = `f_hat_i` + `P_f` e while estimating, else `f_hat_i`
    #[inline(always)]
    pub fn add_direct_term(&mut self, design: &Design<'_, N>, estimating: bool) {
        copy(self.f_hat_i, self.f_hat);
        if estimating {
            design.p_f.add_product(self.e, self.f_hat);
        }
    }

    /// Sets the estimates as values. The estimate of the states of a predictor is the one before the sample.
    #[inline(always)]
    pub fn set_values(&mut self, design: &Design<'_, N>, state: &State<'_, N>) {
        copy(self.f_hat, self.f_value);
        if design.is_current {
            copy(self.x_hat, self.x_value);
            add(design.x_op, self.x_value);
            if !design.p_f.is_stated() {
                add_zero(self.f_value);
            }
        } else {
            copy(state.x_hat, self.x_value);
        }
    }

    /// u = `K_x` `x_hat` + `K_f` `f_hat` + `K_i` `x_i` + `N_r` r, the second term while compensating; limits ignored
    #[inline(always)]
    pub fn set_commands(
        &mut self,
        design: &Design<'_, N>,
        state: &State<'_, N>,
        compensating: bool,
    ) {
        design.k_x.set_product(self.x_hat, self.u);
        if compensating {
            design.k_f.add_product(self.f_hat, self.u);
        }
        design.k_i.add_product(state.x_i, self.u);
        design.n_r.add_product(self.r, self.u);
        copy(self.u, self.excess);
    }

    /// Sets the commands as values.
    #[inline(always)]
    pub fn set_command_values(&mut self, design: &Design<'_, N>) {
        copy(self.u, self.command);
        add(design.u_op, self.command);
    }

    /// u = u + `u_t`, `u_t`' = `u_t` - w `u_t`, of a design with `u_t`. When the law changes, `u_t` is the last command
    /// less the present one. For an actuator that is gone it is 0.
    #[inline(always)]
    pub fn transfer(
        &mut self,
        design: &Design<'_, N>,
        state: &State<'_, N>,
        is_other_law: bool,
        gone: &[bool],
    ) {
        let Some(decay) = design.transfer.first() else { return };
        let gone = gone.iter().copied().chain(core::iter::repeat(false));
        let commands = self.u.iter_mut().zip(self.command.iter_mut());
        let transfers = self.next_u_t.iter_mut().zip(state.u_t.iter()).zip(state.u.iter());
        let transfers = transfers.zip(design.u_op).zip(gone);
        for ((u, command), ((((next, u_t), before), u_op), gone)) in commands.zip(transfers) {
            if gone {
                *next = N::zero();
                continue;
            }
            let u_t = if is_other_law { before.clone() - command.clone() } else { u_t.clone() };
            *u = u.clone() + u_t.clone();
            *command = u.clone() + u_op.clone();
            *next = -(decay.clone() * u_t.clone()) + u_t;
        }
        copy(self.u, self.excess);
    }

    /// Limits the commands, except those of actuators that are gone. Returns whether one was beyond its limits.
    #[inline(always)]
    pub fn limit(&mut self, design: &Design<'_, N>, gone: &[bool]) -> bool {
        let ([low, min], [high, max]) = (design.low, design.high);
        let limits = low.iter().zip(min).zip(high.iter().zip(max));
        let gone = gone.iter().copied().chain(core::iter::repeat(false));
        let commands = self.u.iter_mut().zip(self.command.iter_mut());
        let mut is_at_limit = false;
        for (((u, command), ((low, min), (high, max))), gone) in commands.zip(limits).zip(gone) {
            if gone {
                continue;
            }
            if u.is_below(low) {
                (*u, *command) = (low.clone(), min.clone());
                is_at_limit = true;
            } else if u.is_above(high) {
                (*u, *command) = (high.clone(), max.clone());
                is_at_limit = true;
            }
        }
        is_at_limit
    }

    /// `x_hat`' = A `x_hat` + B u + `F_a` `f_hat_i` + `L_x` e, `L_x` e of a predictor only
    #[inline(always)]
    pub fn predict_states(&mut self, design: &Design<'_, N>) {
        design.a.set_product(self.x_hat, self.next_x_hat);
        design.b.add_product(self.u, self.next_x_hat);
        design.f_a.add_product(self.f_hat_i, self.next_x_hat);
        if !design.is_current {
            design.l_x.accumulate(self.e, self.next_x_hat);
        }
        add(design.x_op, self.next_x_hat);
    }

    /// `f_hat_i`' = `A_f` `f_hat_i` + `L_f` e while estimating, else `f_hat_i`; `L_f` e of a predictor only
    #[inline(always)]
    pub fn predict_faults(&mut self, design: &Design<'_, N>, estimating: bool) {
        copy(self.f_hat_i, self.next_f_hat);
        if estimating {
            if design.a_f.is_stated() {
                design.a_f.set_product(self.f_hat_i, self.next_f_hat);
                if !design.is_current {
                    design.l_f.accumulate(self.e, self.next_f_hat);
                }
            } else if !design.is_current {
                self.next_f_hat.fill(N::zero());
                design.l_f.accumulate(self.e, self.next_f_hat);
                add(self.f_hat_i, self.next_f_hat);
            }
        }
        add_zero(self.next_f_hat);
    }

    /// `y_f`' = W (y - `y_f`) + `y_f`
    #[inline(always)]
    pub fn predict_filter(&mut self, design: &Design<'_, N>) {
        let gains = self.next_y_f.iter_mut().zip(design.filter);
        for ((next, gain), (y, y_f)) in gains.zip(self.y.iter().zip(self.y_f.iter())) {
            *next = gain.clone() * (y.clone() - y_f.clone()) + y_f.clone();
        }
        add(design.y_op, self.next_y_f);
    }

    /// `excess` = u - v, of a design with `L_w`; v is `excess` before the call
    #[inline(always)]
    pub fn set_excess(&mut self) {
        for (excess, u) in self.excess.iter_mut().zip(self.u.iter()) {
            *excess = u.clone() - excess.clone();
        }
    }

    /// `x_i`' = T (r - H y + `F_i` `f_hat`) + `L_w` (u - v) + `x_i`
    #[inline(always)]
    pub fn predict_integrals(&mut self, design: &Design<'_, N>, state: &State<'_, N>) {
        copy(self.r, self.next_x_i);
        design.h.subtract_product(self.y, self.next_x_i);
        design.f_i.add_product(self.f_hat, self.next_x_i);
        for next in self.next_x_i.iter_mut() {
            *next = next.clone() * design.sample_time.clone();
        }
        design.l_w.accumulate(self.excess, self.next_x_i);
        add(state.x_i, self.next_x_i);
        add_zero(self.next_x_i);
    }

    /// Computes the estimates that the commands use: with a current estimator from the measurements of this sample.
    #[inline(always)]
    pub fn estimate(&mut self, design: &Design<'_, N>, state: &State<'_, N>, estimating: bool) {
        self.set_deviations(design, state);
        self.remove_feedthrough(design, state);
        self.set_innovation(design);
        if design.is_current {
            self.correct_states(design);
            if estimating && design.rho.is_empty() {
                self.correct_faults(design);
            } else if estimating {
                self.set_sliding_variable(design);
                self.inject(design);
            }
            if design.p_f.is_stated() {
                // The direct term uses the innovation of the corrected estimate.
                self.set_innovation(design);
            }
        }
        self.add_direct_term(design, estimating);
        self.set_values(design, state);
    }

    /// Computes the state for the next sample, except `u_t`.
    #[inline(always)]
    pub fn predict(&mut self, design: &Design<'_, N>, state: &State<'_, N>, estimating: bool) {
        self.predict_states(design);
        self.predict_faults(design, estimating);
        self.predict_filter(design);
        self.set_excess();
        self.predict_integrals(design, state);
    }

    /// Sets the controller to rest: estimates and commands are those of the operating point, without faults, and so is
    /// the state for the next sample. Integrals and `u_t` are 0.
    #[inline(always)]
    pub fn rest(&mut self, design: &Design<'_, N>) {
        self.u.fill(N::zero());
        self.set_command_values(design);
        self.x_value.fill(N::zero());
        add(design.x_op, self.x_value);
        copy(self.x_value, self.next_x_hat);
        self.f_value.fill(N::zero());
        self.next_f_hat.fill(N::zero());
        self.next_y_f.fill(N::zero());
        add(design.y_op, self.next_y_f);
        self.next_x_i.fill(N::zero());
        self.next_u_t.fill(N::zero());
    }

    /// Whether commands and estimates are finite.
    #[must_use]
    #[inline(always)]
    pub fn are_values_finite(&self) -> bool {
        all_finite(self.command) && all_finite(self.x_value) && all_finite(self.f_value)
    }

    /// Stores the commands and the state for the next sample if `is_finite` holds and all of them are finite; otherwise
    /// the estimates as values become the stored ones. Returns whether it stored them.
    #[inline(always)]
    pub fn keep(&mut self, state: &mut State<'_, N>, is_finite: bool) -> bool {
        let next = [&*self.next_x_hat, &*self.next_f_hat, &*self.next_y_f, &*self.next_x_i];
        let has_feedthrough = !state.u_before.is_empty();
        let is_finite = is_finite
            && all_finite(self.next_u_t)
            && next.into_iter().all(all_finite)
            && (!has_feedthrough || all_finite(self.u));
        if is_finite {
            copy(self.next_x_hat, state.x_hat);
            copy(self.next_f_hat, state.f_hat);
            copy(self.next_y_f, state.y_f);
            copy(self.next_x_i, state.x_i);
            copy(self.next_u_t, state.u_t);
            copy(self.u, state.u_before);
            copy(self.command, state.u);
        } else {
            copy(state.x_hat, self.x_value);
            copy(state.f_hat, self.f_value);
        }
        is_finite
    }
}

/// Returns the estimated loss of effectiveness of an actuator, `E_hat` = -u `f_hat` / (u^2 + `u_e`^2), with the command
/// u, the estimate `f_hat` of its fault and `squared_least_command` = `u_e`^2. Infinity becomes the largest finite
/// number; NaN stays.
pub fn lost_effectiveness<N: Number>(u: &N, f_hat: &N, squared_least_command: &N) -> N {
    let scale = N::whole(1) / (u.clone() * u.clone() + squared_least_command.clone());
    let loss = -(u.clone() * scale) * f_hat.clone();
    if loss.is_above(&N::largest()) {
        N::largest()
    } else if loss.is_below(&-N::largest()) {
        -N::largest()
    } else {
        loss
    }
}
