//! The observer with its feedback as one piecewise linear system, stepped exactly.
//!
//! As long as no channel enters or leaves a limit, the equations are `z' = M z + N [y; w]`, w being
//! the commands of the channels at a limit, so one step is exact for `y = y_0 + y_1 t`: the hold of
//! [`FirstOrderHold`].

use std::sync::Arc;

use control::hold::FirstOrderHold;
use control::product;
use nalgebra::DMatrix;

use crate::design::Design;
use crate::equations::Mode;
use crate::matrix::Matrix;

/// Halvings of a step until the instant at which a channel reaches its limit is accepted.
const HALVINGS: u32 = 20;
/// Propagators kept; a step that comes back finds its own.
const KEPT: usize = 96;

/// What was computed from one design for the steps so far.
#[derive(Clone)]
pub(crate) struct Observer {
    kept: Vec<(Mode, f64, Arc<FirstOrderHold>)>,
    next: usize,
    /// Space for [y; w] and its slope, and for z before and after a step.
    input: Vec<f64>,
    input_slope: Vec<f64>,
    before: Vec<f64>,
    after: Vec<f64>,
}

/// What holds over a step. The matrices of `design` are those of all steps before.
#[derive(Clone, Copy)]
pub(crate) struct Conditions<'a> {
    pub(crate) design: &'a Design,
    /// The measurements at the begin of the step, and their slopes.
    pub(crate) y: [&'a [f64]; 2],
    pub(crate) compensating: bool,
    pub(crate) estimating: bool,
}

impl Conditions<'_> {
    /// The mode in which z evolves from here.
    fn mode(&self, z: &[f64]) -> Mode {
        Mode::of(self.design, z, self.compensating, self.estimating)
    }
}

/// M and N of `mode`.
fn system(design: &Design, mode: Mode) -> (DMatrix<f64>, DMatrix<f64>) {
    let dense = |matrix: fn(&Design) -> &Matrix| matrix(design).dense();
    let (c, l_x, l_f) = (dense(|own| &own.c), dense(|own| &own.l_x), dense(|own| &own.l_f));
    let (f_a, mut free) = (dense(|own| &own.f_a), dense(|own| &own.b));
    let ((n, q), (p, m)) = (f_a.shape(), (c.nrows(), free.ncols()));
    let mut held = free.clone();
    for j in 0..m {
        let one = if mode.is_limited(j) { &mut free } else { &mut held };
        one.column_mut(j).fill(0.0);
    }
    let compensating = f64::from(mode.compensating);
    let estimating = f64::from(mode.estimating);
    let (a, k_x, k_f) = (dense(|own| &own.a), dense(|own| &own.k_x), dense(|own| &own.k_f));
    let mut state = DMatrix::zeros(design.order(), design.order());
    state.view_mut((0, 0), (n, n)).copy_from(&(&a + product(&free, &k_x) - product(&l_x, &c)));
    state.view_mut((0, n), (n, q)).copy_from(&(&f_a + product(&free, &k_f) * compensating));
    state.view_mut((n, 0), (q, n)).copy_from(&(product(&l_f, &c) * -estimating));
    if let Some(a_f) = &design.a_f {
        state.view_mut((n, n), (q, q)).copy_from(&(a_f.dense() * estimating));
    }
    let mut input = DMatrix::zeros(design.order(), p + m);
    input.view_mut((0, p), (n, m)).copy_from(&held);
    // The innovation follows y, or y_f, which is part of z.
    let source = if design.filter.is_some() { &mut state } else { &mut input };
    let column = if design.filter.is_some() { n + q } else { 0 };
    source.view_mut((0, column), (n, p)).copy_from(&l_x);
    source.view_mut((n, column), (q, p)).copy_from(&(&l_f * estimating));
    for (k, w) in design.filter.iter().flatten().enumerate() {
        let at = design.filtered_at(k);
        (state[(at, at)], input[(at, k)]) = (-w, *w);
    }
    (state, input)
}

impl Observer {
    /// The observer of `design`, which has not stepped yet.
    pub(crate) fn new(design: &Design) -> Self {
        let inputs = design.measurements.len() + design.actuators.len();
        let states = design.order();
        Self {
            kept: Vec::with_capacity(KEPT),
            next: 0,
            input: vec![0.0; inputs],
            input_slope: vec![0.0; inputs],
            before: vec![0.0; states],
            after: vec![0.0; states],
        }
    }

    /// Advances `z` by `size` s, from `offset` s after the instant of the measurements.
    ///
    /// Where a channel reaches or leaves a limit on the way, the step is halved until that instant
    /// is known to 2^-20 of the step; a channel that leaves its mode and is back in it both at the
    /// middle and at the end of a part is not noticed.
    pub(crate) fn advance(
        &mut self,
        z: &mut [f64],
        conditions: Conditions<'_>,
        (offset, size): (f64, f64),
    ) -> Result<(), control::Error> {
        let span = Span { offset, size, halvings: HALVINGS };
        self.before.copy_from_slice(z);
        if conditions.design.actuators.iter().any(|actuator| actuator.limits.is_some()) {
            self.advance_part(conditions, span)?;
            z.copy_from_slice(&self.before);
        } else {
            let mode = Mode::free(conditions.compensating, conditions.estimating);
            self.propagate(mode, conditions, span)?;
            z.copy_from_slice(&self.after);
        }
        Ok(())
    }

    fn advance_part(
        &mut self,
        conditions: Conditions<'_>,
        span: Span,
    ) -> Result<(), control::Error> {
        let mode = conditions.mode(&self.before);
        if span.halvings > 0 {
            let stays = self.stays(mode, conditions, span.half(0))?
                && self.stays(mode, conditions, span)?;
            if !stays {
                self.advance_part(conditions, span.half(0))?;
                return self.advance_part(conditions, span.half(1));
            }
        } else {
            self.propagate(mode, conditions, span)?;
        }
        std::mem::swap(&mut self.before, &mut self.after);
        Ok(())
    }

    /// Propagates over `span` into `after`; whether the mode holds at its end.
    fn stays(
        &mut self,
        mode: Mode,
        conditions: Conditions<'_>,
        span: Span,
    ) -> Result<bool, control::Error> {
        self.propagate(mode, conditions, span)?;
        Ok(conditions.mode(&self.after) == mode)
    }

    /// From `before` to `after` over `span` in `mode`.
    fn propagate(
        &mut self,
        mode: Mode,
        Conditions { design, y, .. }: Conditions<'_>,
        span: Span,
    ) -> Result<(), control::Error> {
        let [values, slopes] = y;
        let (measured, held) = self.input.split_at_mut(values.len());
        for (k, (value, slope)) in values.iter().zip(slopes).enumerate() {
            measured[k] = value + slope * span.offset;
            self.input_slope[k] = *slope;
        }
        for (j, held) in held.iter_mut().enumerate() {
            *held = mode.limit(design, j).unwrap_or(0.0);
        }
        let position = self.propagator(design, mode, span)?;
        let (_, _, hold) = &self.kept[position];
        hold.step_into(&self.before, &self.input, &self.input_slope, &mut self.after)
    }

    /// Position of the propagator for `mode` and the size of `span`, computed when it is new.
    ///
    /// Only the same size counts: what is kept must not decide what comes out, so that a restored
    /// instance, which has kept nothing, continues with the same bits.
    fn propagator(
        &mut self,
        design: &Design,
        mode: Mode,
        span: Span,
    ) -> Result<usize, control::Error> {
        let known = self.kept.iter().position(|(kept, size, _)| {
            kept.has_the_system_of(mode) && size.to_bits() == span.size.to_bits()
        });
        if let Some(position) = known {
            return Ok(position);
        }
        let (state, input) = system(design, mode);
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
