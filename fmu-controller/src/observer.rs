//! The augmented state observer with its feedback as one piecewise linear system, stepped exactly.
//!
//! With z = [x_hat; f_hat], measurements y and the command u that is really applied (equations
//! (1), (2), (4), (5), (18) of Patton and Klinkhieo (2009) in the general form)
//!
//! ```text
//! x_hat' = A x_hat + B u + F_a f_hat + L_x (y - C x_hat)
//! f_hat' = L_f (y - C x_hat)                    while estimating, else 0
//! u      = K_x x_hat + K_f f_hat                while compensating, else K_x x_hat
//! ```
//!
//! and every channel of u kept within its limits. As long as no channel enters or leaves a limit
//! this is `z' = M z + N [y; w]`, w being the commands of the channels at a limit, so one step is
//! exact for `y = y_0 + y_1 t`: the hold of [`FirstOrderHold`].

use std::sync::Arc;

use control::hold::FirstOrderHold;
use nalgebra::DMatrix;

use crate::design::Design;

/// Halvings of a step until the instant at which a channel reaches its limit is accepted.
const HALVINGS: u32 = 20;
/// Propagators kept; a step that comes back finds its own.
const KEPT: usize = 96;

/// Which of the linear systems is in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Mode {
    /// K_f f_hat is part of the command.
    pub(crate) compensating: bool,
    /// f_hat follows the observer.
    pub(crate) estimating: bool,
    /// Bit j: channel j is at its lower limit.
    lower: u64,
    /// Bit j: channel j is at its upper limit.
    upper: u64,
}

impl Mode {
    /// Bit j: channel j is at a limit.
    fn limited(self) -> u64 {
        self.lower | self.upper
    }

    /// Whether both have the same matrices.
    fn has_the_system_of(self, other: Self) -> bool {
        (self.compensating, self.estimating, self.limited())
            == (other.compensating, other.estimating, other.limited())
    }
}

/// The measurements over a step: y(t) = `value` + `slope` t.
#[derive(Clone, Copy)]
pub(crate) struct Measurement<'a> {
    pub(crate) value: &'a [f64],
    pub(crate) slope: &'a [f64],
}

/// The matrices, the limits, and what was computed from them for the steps so far.
#[derive(Clone)]
pub(crate) struct Observer {
    matrices: Matrices,
    /// Smallest and largest command of each channel; infinite where there is no limit.
    limits: Vec<[f64; 2]>,
    kept: Vec<(Mode, f64, Arc<FirstOrderHold>)>,
    next: usize,
    /// Space for [y; w] and its slope, and for z before and after a step.
    input: Vec<f64>,
    input_slope: Vec<f64>,
    before: Vec<f64>,
    after: Vec<f64>,
}

#[derive(Clone)]
struct Matrices {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    f_a: DMatrix<f64>,
    k_x: DMatrix<f64>,
    k_f: DMatrix<f64>,
    l_x: DMatrix<f64>,
    l_f: DMatrix<f64>,
}

impl Matrices {
    /// M and N of `mode`.
    fn system(&self, mode: Mode) -> (DMatrix<f64>, DMatrix<f64>) {
        let (n, q) = (self.a.nrows(), self.f_a.ncols());
        let (p, m) = (self.c.nrows(), self.b.ncols());
        let mut free = self.b.clone();
        let mut held = self.b.clone();
        for j in 0..m {
            let one = if mode.limited() & (1 << j) == 0 { &mut held } else { &mut free };
            one.column_mut(j).fill(0.0);
        }
        let compensating = f64::from(mode.compensating);
        let estimating = f64::from(mode.estimating);
        let mut state = DMatrix::zeros(n + q, n + q);
        state
            .view_mut((0, 0), (n, n))
            .copy_from(&(&self.a + &free * &self.k_x - &self.l_x * &self.c));
        state.view_mut((0, n), (n, q)).copy_from(&(&self.f_a + &free * &self.k_f * compensating));
        state.view_mut((n, 0), (q, n)).copy_from(&(&self.l_f * &self.c * -estimating));
        let mut input = DMatrix::zeros(n + q, p + m);
        input.view_mut((0, 0), (n, p)).copy_from(&self.l_x);
        input.view_mut((0, p), (n, m)).copy_from(&held);
        input.view_mut((n, 0), (q, p)).copy_from(&(&self.l_f * estimating));
        (state, input)
    }

    /// Channel `j` of K_x x_hat + K_f f_hat, the second part while compensating.
    fn free_command(&self, z: &[f64], compensating: bool, j: usize) -> f64 {
        let (x_hat, f_hat) = z.split_at(self.a.nrows());
        let mut command = dot(&self.k_x, j, x_hat);
        if compensating {
            command += dot(&self.k_f, j, f_hat);
        }
        command
    }
}

/// Row `row` of `matrix` times `vector`.
fn dot(matrix: &DMatrix<f64>, row: usize, vector: &[f64]) -> f64 {
    vector.iter().enumerate().map(|(column, value)| matrix[(row, column)] * value).sum()
}

impl Observer {
    /// The observer of `design`, its commands within `limits` (one pair for each channel).
    pub(crate) fn new(design: &Design, limits: Vec<[f64; 2]>) -> Self {
        let inputs = design.c.rows + design.b.columns;
        let states = design.a.rows + design.f_a.columns;
        let matrices = Matrices {
            a: design.a.dense(),
            b: design.b.dense(),
            c: design.c.dense(),
            f_a: design.f_a.dense(),
            k_x: design.k_x.dense(),
            k_f: design.k_f.dense(),
            l_x: design.l_x.dense(),
            l_f: design.l_f.dense(),
        };
        Self {
            matrices,
            limits,
            kept: Vec::with_capacity(KEPT),
            next: 0,
            input: vec![0.0; inputs],
            input_slope: vec![0.0; inputs],
            before: vec![0.0; states],
            after: vec![0.0; states],
        }
    }

    /// Changes the limits of the commands.
    pub(crate) fn set_limits(&mut self, limits: impl Iterator<Item = [f64; 2]>) {
        self.limits.iter_mut().zip(limits).for_each(|(mine, given)| *mine = given);
    }

    /// The mode in which z evolves from here.
    pub(crate) fn mode(&self, z: &[f64], compensating: bool, estimating: bool) -> Mode {
        let (mut lower, mut upper) = (0, 0);
        for (j, [low, high]) in self.limits.iter().enumerate() {
            let command = self.matrices.free_command(z, compensating, j);
            lower |= u64::from(command < *low) << j;
            upper |= u64::from(command > *high) << j;
        }
        Mode { compensating, estimating, lower, upper }
    }

    /// The command u applied at z.
    pub(crate) fn command(&self, z: &[f64], compensating: bool, u: &mut [f64]) {
        for ((j, u), [low, high]) in u.iter_mut().enumerate().zip(&self.limits) {
            *u = self.matrices.free_command(z, compensating, j).clamp(*low, *high);
        }
    }

    /// z' and u' at z in `mode` under the command `u`, `offset` s after the begin of `y`.
    pub(crate) fn slopes(
        &self,
        mode: Mode,
        z: &[f64],
        (y, offset): (Measurement<'_>, f64),
        u: &[f64],
        (z_slope, u_slope): (&mut [f64], &mut [f64]),
    ) {
        let Matrices { a, b, c, f_a, k_x, k_f, l_x, l_f } = &self.matrices;
        let (x_hat, f_hat) = z.split_at(a.nrows());
        z_slope.fill(0.0);
        let (x_slope, f_slope) = z_slope.split_at_mut(a.nrows());
        for (row, slope) in x_slope.iter_mut().enumerate() {
            *slope = dot(a, row, x_hat) + dot(b, row, u) + dot(f_a, row, f_hat);
        }
        for (k, (value, slope)) in y.value.iter().zip(y.slope).enumerate() {
            let innovation = value + slope * offset - dot(c, k, x_hat);
            for (row, slope) in x_slope.iter_mut().enumerate() {
                *slope += l_x[(row, k)] * innovation;
            }
            for (row, slope) in f_slope.iter_mut().enumerate().filter(|_| mode.estimating) {
                *slope += l_f[(row, k)] * innovation;
            }
        }
        for (j, slope) in u_slope.iter_mut().enumerate() {
            let free = mode.limited() & (1 << j) == 0;
            let fault = if mode.compensating { dot(k_f, j, f_slope) } else { 0.0 };
            *slope = if free { dot(k_x, j, x_slope) + fault } else { 0.0 };
        }
    }

    /// Advances `z` by `size` s, from `offset` s after the instant to which `y` belongs.
    ///
    /// Where a channel reaches or leaves a limit on the way, the step is halved until that instant
    /// is known to 2^-20 of the step; a channel that leaves its mode and is back in it both at the
    /// middle and at the end of a part is not noticed.
    pub(crate) fn advance(
        &mut self,
        z: &mut [f64],
        (compensating, estimating): (bool, bool),
        y: Measurement<'_>,
        (offset, size): (f64, f64),
    ) -> Result<(), control::Error> {
        self.before.copy_from_slice(z);
        let span = Span { offset, size, halvings: HALVINGS };
        self.advance_part(compensating, estimating, y, span)?;
        z.copy_from_slice(&self.before);
        Ok(())
    }

    fn advance_part(
        &mut self,
        compensating: bool,
        estimating: bool,
        y: Measurement<'_>,
        span: Span,
    ) -> Result<(), control::Error> {
        let mode = self.mode(&self.before, compensating, estimating);
        let limited = self.limits.iter().any(|[low, high]| low.is_finite() || high.is_finite());
        if limited && span.halvings > 0 {
            let stays = self.stays(mode, y, span.half(0))? && self.stays(mode, y, span)?;
            if !stays {
                self.advance_part(compensating, estimating, y, span.half(0))?;
                return self.advance_part(compensating, estimating, y, span.half(1));
            }
        } else {
            self.propagate(mode, y, span)?;
        }
        std::mem::swap(&mut self.before, &mut self.after);
        Ok(())
    }

    /// Propagates over `span` into `after`; whether the mode holds at its end.
    fn stays(
        &mut self,
        mode: Mode,
        y: Measurement<'_>,
        span: Span,
    ) -> Result<bool, control::Error> {
        self.propagate(mode, y, span)?;
        Ok(self.mode(&self.after, mode.compensating, mode.estimating) == mode)
    }

    /// From `before` to `after` over `span` in `mode`.
    fn propagate(
        &mut self,
        mode: Mode,
        y: Measurement<'_>,
        span: Span,
    ) -> Result<(), control::Error> {
        for (k, (value, slope)) in y.value.iter().zip(y.slope).enumerate() {
            self.input[k] = value + slope * span.offset;
            self.input_slope[k] = *slope;
        }
        for (j, [low, high]) in self.limits.iter().enumerate() {
            let at_limit = if mode.limited() & (1 << j) == 0 {
                0.0
            } else {
                let before = &self.before;
                self.matrices.free_command(before, mode.compensating, j).clamp(*low, *high)
            };
            self.input[y.value.len() + j] = at_limit;
        }
        let position = self.propagator(mode, span)?;
        let (_, _, hold) = &self.kept[position];
        hold.step_into(&self.before, &self.input, &self.input_slope, &mut self.after)
    }

    /// Position of the propagator for `mode` and the size of `span`, computed when it is new.
    ///
    /// Only the same size counts: what is kept must not decide what comes out, so that a restored
    /// instance, which has kept nothing, continues with the same bits.
    fn propagator(&mut self, mode: Mode, span: Span) -> Result<usize, control::Error> {
        let known = self.kept.iter().position(|(kept, size, _)| {
            kept.has_the_system_of(mode) && size.to_bits() == span.size.to_bits()
        });
        if let Some(position) = known {
            return Ok(position);
        }
        let (state, input) = self.matrices.system(mode);
        let hold = Arc::new(FirstOrderHold::new(&state, &input, span.size)?);
        if self.kept.len() < KEPT {
            self.kept.push((mode, span.size, hold));
            return Ok(self.kept.len() - 1);
        }
        self.next = (self.next + 1) % KEPT;
        self.kept[self.next] = (mode, span.size, hold);
        Ok(self.next)
    }
}

/// A part of a communication step, in s after its begin.
#[derive(Clone, Copy)]
struct Span {
    offset: f64,
    size: f64,
    halvings: u32,
}

impl Span {
    /// The first (0) or second (1) half.
    fn half(self, which: u32) -> Self {
        let size = 0.5 * self.size;
        let offset = self.offset + f64::from(which) * size;
        Self { offset, size, halvings: self.halvings - 1 }
    }
}
