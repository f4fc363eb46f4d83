//! The observer with its feedback as one piecewise linear system, stepped exactly.
//!
//! While no channel reaches or leaves a limit, the equations are `z' = M z + N [y; r; w]` with the commands w of the
//! channels at a limit, so one step is exact for `y = y_0 + y_1 t` and r likewise: the hold of [`FirstOrderHold`].

use std::sync::Arc;

use control::hold::FirstOrderHold;
use nalgebra::DMatrix;

use crate::equations::Equations;
use crate::mode::Mode;
use crate::signals::Signals;
use aso_controller::Design;

/// The most halvings of a step to locate the instant at which a channel reaches its limit.
const HALVINGS: u32 = 20;
/// The most propagators in the cache.
const CACHE_SIZE: usize = 96;

/// Propagators with the mode and the step size that they were computed for.
#[derive(Clone, Default)]
pub(crate) struct Propagators {
    cache: Vec<(Mode, f64, Arc<FirstOrderHold>)>,
    /// Position of the propagator that was replaced last.
    replaced: usize,
}

impl Propagators {
    /// The propagator for a mode and a step size in s. A propagator that is not in the cache is computed from the
    /// matrices that `system` returns, and replaces another one if the cache is full.
    ///
    /// Only a propagator for exactly this size is used: the content of the cache must not change results, so that a
    /// restored instance, whose cache is empty, continues with the same bits.
    pub(crate) fn of(
        &mut self,
        mode: Mode,
        size: f64,
        system: impl FnOnce() -> (DMatrix<f64>, DMatrix<f64>),
    ) -> Result<&FirstOrderHold, control::Error> {
        let known = self.cache.iter().position(|(cached_mode, cached_size, _)| {
            cached_mode.has_the_matrices_of(mode) && cached_size.to_bits() == size.to_bits()
        });
        if let Some(position) = known {
            return Ok(&self.cache[position].2);
        }
        let (state, input) = system();
        let hold = Arc::new(FirstOrderHold::new(&state, &input, size)?);
        if self.cache.len() < CACHE_SIZE {
            self.cache.reserve_exact(CACHE_SIZE - self.cache.len());
            self.cache.push((mode, size, hold));
            return Ok(&self.cache[self.cache.len() - 1].2);
        }
        self.replaced = (self.replaced + 1) % CACHE_SIZE;
        self.cache[self.replaced] = (mode, size, hold);
        Ok(&self.cache[self.replaced].2)
    }
}

/// Steps the observer of one design.
#[derive(Clone)]
pub(crate) struct Observer {
    propagators: Propagators,
    /// Space for the inputs [y; r; w] and their slopes.
    input: Vec<f64>,
    input_slope: Vec<f64>,
    /// Space for the measurements and references [y; r].
    known: Vec<f64>,
    /// The estimates z at the start and at the end of a part of a step.
    before: Vec<f64>,
    after: Vec<f64>,
}

/// A part of a communication step.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    /// The start of the part, in s after the start of the step.
    pub(crate) offset: f64,
    /// The length of the part in s.
    pub(crate) size: f64,
}

impl Part {
    /// The first (0) or second (1) half.
    fn half(self, which: u32) -> Self {
        let size = 0.5 * self.size;
        Self { offset: self.offset + f64::from(which) * size, size }
    }
}

/// A callback for each part of a step in which the mode stays, with z at its start, the mode and the part.
pub(crate) type Follow<'a> = &'a mut dyn FnMut(&[f64], Mode, Part) -> Result<(), control::Error>;

/// The design, the inputs and the mode without limits, which do not change during a step.
#[derive(Clone, Copy)]
pub(crate) struct Conditions<'a> {
    /// The design; its matrices are the same in every step.
    pub(crate) design: &'a Design,
    /// The measurements at the start of the step, and their slopes.
    pub(crate) y: [&'a [f64]; 2],
    /// The references at the start of the step, and their slopes.
    pub(crate) r: [&'a [f64]; 2],
    /// The mode with no channel at a limit.
    pub(crate) mode: Mode,
}

impl Conditions<'_> {
    /// The mode with the channels that are at a limit at `z`, `time` s after the start of the step; `inputs` is space
    /// for measurements and references.
    fn mode_at(&self, time: f64, z: &[f64], inputs: &mut [f64]) -> Mode {
        let Self { y, r, .. } = self;
        let known = y[0].iter().zip(y[1]).chain(r[0].iter().zip(r[1]));
        for (input, (value, slope)) in inputs.iter_mut().zip(known) {
            *input = value + slope * time;
        }
        self.mode.limited(self.design, z, inputs.split_at(y[0].len()).into())
    }
}

/// z' and u at the unit vectors of z, y, r and w in turn, w the commands of the channels at a limit. The response to w
/// of a free channel is 0.
pub(crate) fn unit_responses(design: &Design, mode: Mode) -> Vec<[Vec<f64>; 2]> {
    let equations = Equations::<f64>::new(design, mode);
    let (n, p, m) = (design.order(), design.measurements.len(), design.actuators.len());
    let t = design.references.len();
    let responses = |set: &dyn Fn(&mut Signals)| {
        let mut unit = Signals::zero(design);
        set(&mut unit);
        let mut slopes = vec![0.0; n];
        equations.evaluate(&mut &mut unit, &mut &mut slopes[..]);
        [slopes, unit.u]
    };
    let state = (0..n).map(|j| responses(&|unit| unit.z[j] = 1.0));
    let measured = (0..p).map(|k| responses(&|unit| unit.y[k] = 1.0));
    let referred = (0..t).map(|k| responses(&|unit| unit.r[k] = 1.0));
    let held = (0..m).map(|j| {
        let command = if mode.is_limited(j) { 1.0 } else { 0.0 };
        responses(&|unit| unit.u[j] = command)
    });
    state.chain(measured).chain(referred).chain(held).collect()
}

/// M and N of `mode`: as the equations are linear, their columns are z' at unit vectors.
fn system(design: &Design, mode: Mode) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = design.order();
    let responses = unit_responses(design, mode);
    let matrix = |columns: &[[Vec<f64>; 2]]| {
        let values = columns.iter().flat_map(|[slopes, _]| slopes.iter().copied());
        DMatrix::from_iterator(n, columns.len(), values)
    };
    (matrix(&responses[..n]), matrix(&responses[n..]))
}

impl Observer {
    /// The observer of `design` with an empty cache.
    pub(crate) fn new(design: &Design) -> Self {
        let known = design.measurements.len() + design.references.len();
        let inputs = known + design.actuators.len();
        let states = design.order();
        Self {
            propagators: Propagators::default(),
            input: vec![0.0; inputs],
            input_slope: vec![0.0; inputs],
            known: vec![0.0; known],
            before: vec![0.0; states],
            after: vec![0.0; states],
        }
    }

    /// Advances `z` over a part of the step.
    ///
    /// If a channel reaches or leaves a limit, the part is halved until that instant is known to 2^-20 of its size. A
    /// channel that reaches and leaves a limit within one half of a part is not detected.
    ///
    /// Calls `follow` for each part in which the mode stays.
    pub(crate) fn advance(
        &mut self,
        z: &mut [f64],
        conditions: Conditions<'_>,
        part: Part,
        follow: Follow<'_>,
    ) -> Result<(), control::Error> {
        self.before.copy_from_slice(z);
        if conditions.design.actuators.iter().any(|actuator| actuator.limits.is_some()) {
            self.advance_part(conditions, part, HALVINGS, follow)?;
            z.copy_from_slice(&self.before);
        } else {
            self.propagate(conditions.mode, conditions, part)?;
            follow(&self.before, conditions.mode, part)?;
            z.copy_from_slice(&self.after);
        }
        Ok(())
    }

    /// Advances `before` over a part, halved at most `halvings` times.
    fn advance_part(
        &mut self,
        conditions: Conditions<'_>,
        part: Part,
        halvings: u32,
        follow: Follow<'_>,
    ) -> Result<(), control::Error> {
        let mode = conditions.mode_at(part.offset, &self.before, &mut self.known);
        if halvings > 0 {
            let stays = self.keeps_mode(mode, conditions, part.half(0))?
                && self.keeps_mode(mode, conditions, part)?;
            if !stays {
                self.advance_part(conditions, part.half(0), halvings - 1, follow)?;
                return self.advance_part(conditions, part.half(1), halvings - 1, follow);
            }
        } else {
            self.propagate(mode, conditions, part)?;
        }
        follow(&self.before, mode, part)?;
        std::mem::swap(&mut self.before, &mut self.after);
        Ok(())
    }

    /// Computes `after` from `before` over `part` in `mode`; returns whether the mode is the same at the end of the
    /// part.
    fn keeps_mode(
        &mut self,
        mode: Mode,
        conditions: Conditions<'_>,
        part: Part,
    ) -> Result<bool, control::Error> {
        self.propagate(mode, conditions, part)?;
        let end = part.offset + part.size;
        Ok(conditions.mode_at(end, &self.after, &mut self.known) == mode)
    }

    /// Computes `after` from `before` over `part` in `mode`.
    fn propagate(
        &mut self,
        mode: Mode,
        Conditions { design, y, r, .. }: Conditions<'_>,
        part: Part,
    ) -> Result<(), control::Error> {
        let known = y[0].iter().zip(y[1]).chain(r[0].iter().zip(r[1]));
        let (inputs, held) = self.input.split_at_mut(y[0].len() + r[0].len());
        for (k, (value, slope)) in known.enumerate() {
            inputs[k] = value + slope * part.offset;
            self.input_slope[k] = *slope;
        }
        for (j, held) in held.iter_mut().enumerate() {
            *held = mode.held_deviation(design, j).unwrap_or(0.0);
        }
        let hold = self.propagators.of(mode, part.size, || system(design, mode))?;
        hold.step_into(&self.before, &self.input, &self.input_slope, &mut self.after)
    }
}
