//! The loop of a sampled controller and a plant whose entries vary.

use super::blocks::Block;
use super::gauss::{Gauss, Step};
use super::generalised_plant::{Channels, GeneralisedPlant};
use super::remainder::remainder;
use crate::balance::Balance;
use crate::blocks::beside;
use crate::robustness::{Loop, held_plant};
use crate::svd::norm_2;
use crate::{Error, StateSpace};
use nalgebra::{DMatrix, DVector};

/// The Gauss method has enough stages when its error, relative to the effect of the tolerances, is below this.
const PRECISE: f64 = 1e-2;
const MOST_STAGES: usize = 3;
/// The least fraction of the tolerances for which the error is bounded.
const LEAST: f64 = 1e-4;

/// A plant whose entries vary and whose inputs are held, and the controller.
pub(super) struct HeldFamily<'a> {
    controller: &'a StateSpace,
    period: f64,
    /// The matrix [A, B; 0, 0] of the plant.
    z: DMatrix<f64>,
    /// The changes of [A, B; 0, 0] by the deviations.
    on_states: Channels,
    /// The changes of [C, D] by the deviations.
    on_outputs: Channels,
    /// The sum of the moduli of the changes of [A, B; 0, 0], entry by entry.
    size: DMatrix<f64>,
    /// The plant in sampled time.
    held: StateSpace,
    /// Units of the plant's states that balance the dynamics of the loop.
    units: DVector<f64>,
    states: usize,
}

/// The system M in feedback with the perturbation, and the blocks of the perturbation.
pub(super) struct HeldLoop {
    pub(super) system: StateSpace,
    pub(super) blocks: Vec<Block>,
    /// The fraction of the tolerances up to which the error of the Gauss method is bounded.
    pub(super) fraction: f64,
    /// Whether the error of the Gauss method is small, relative to the effect of the tolerances.
    pub(super) precise: bool,
}

/// A bound of the error of the Gauss method for deviations up to a fraction of the tolerances.
struct GaussError {
    stages: usize,
    fraction: f64,
    precise: bool,
    /// The bound of each entry in the rows of the states, divided by `fraction`.
    bound: DMatrix<f64>,
}

impl<'a> HeldFamily<'a> {
    /// `changes`: the change of [A, B; C, D] by each deviation.
    pub(super) fn new(
        plant: &StateSpace,
        changes: &[DMatrix<f64>],
        controller: &'a StateSpace,
        period: f64,
    ) -> Result<Self, Error> {
        let (n, m) = plant.b.shape();
        let p = plant.c.nrows();
        let held = held_plant(plant, period)?;
        let dynamics = Loop::new(held.clone(), controller.clone())?.dynamics();
        let square = |rows: DMatrix<f64>| rows.resize_vertically(n + m, 0.0);
        let on_states: Vec<_> =
            changes.iter().map(|change| square(change.rows(0, n).into())).collect();
        let on_outputs: Vec<_> =
            changes.iter().map(|change| change.rows(n, p).into_owned()).collect();
        let zero = DMatrix::zeros(n + m, n + m);
        Ok(Self {
            controller,
            period,
            z: square(beside(&plant.a, &plant.b)),
            size: on_states.iter().map(DMatrix::abs).fold(zero, |sum, size| sum + size),
            on_states: Channels::of(&on_states, (n + m, n + m)),
            on_outputs: Channels::of(&on_outputs, (p, n + m)),
            held,
            units: Balance::new(&dynamics).scale.rows(0, n).into(),
            states: n,
        })
    }

    /// M for deviations up to the fraction `assumed` of the tolerances, or up to a smaller fraction for which the error
    /// of the Gauss method has a bound; None if there is no such fraction.
    pub(super) fn system(&self, assumed: f64) -> Result<Option<HeldLoop>, Error> {
        let Some(error) = self.error(assumed) else { return Ok(None) };
        let (n, inner) = (self.states, self.z.nrows());
        let Channels { left, right, .. } = &self.on_states;
        let Step { b, c, d } =
            Gauss::new(error.stages).step(&self.z, [left, right], self.period)?;
        let [error_input, error_output] = self.weights(&error)?;
        // Channels in this order: the stages of the changes of [A, B], the changes of [C, D], the error.
        let (staged, outputs) = (d.nrows(), self.on_outputs.left.ncols());
        let channels = staged + outputs + inner;
        let order = self.held.a.nrows();
        let mut b1 = DMatrix::zeros(order, channels);
        b1.view_mut((0, 0), (n, staged)).copy_from(&b.rows(0, n));
        b1.view_mut((0, staged + outputs), (n, n)).copy_from(&error_input);
        // [A, B] acts on [x; u], u the command of this sample, [C, D] on [x; v], v the previous command.
        let held = order.min(inner);
        let mut c1 = DMatrix::zeros(channels, order);
        let mut d12 = DMatrix::zeros(channels, inner - n);
        c1.view_mut((0, 0), (staged, n)).copy_from(&c.columns(0, n));
        d12.view_mut((0, 0), (staged, inner - n)).copy_from(&c.columns(n, inner - n));
        let read = self.on_outputs.right.rows(0, held).transpose();
        c1.view_mut((staged, 0), (outputs, held)).copy_from(&read);
        let first = staged + outputs;
        c1.view_mut((first, 0), (inner, n)).copy_from(&error_output.columns(0, n));
        d12.view_mut((first, 0), (inner, inner - n)).copy_from(&error_output.columns(n, inner - n));
        let mut d11 = DMatrix::zeros(channels, channels);
        d11.view_mut((0, 0), (staged, staged)).copy_from(&d);
        let mut d21 = DMatrix::zeros(self.held.c.nrows(), channels);
        d21.columns_mut(staged, outputs).copy_from(&self.on_outputs.left);
        let StateSpace { a, b, c, d, domain } = self.held.clone();
        let plant =
            GeneralisedPlant { a, b: [b1, b], c: [c1, c], d: [[d11, d12], [d21, d]], domain };
        let (places, blocks) = self.places(error.stages);
        let system = plant.with_controller(self.controller);
        let system = StateSpace {
            b: system.b.select_columns(&places),
            c: system.c.select_rows(&places),
            d: system.d.select_rows(&places).select_columns(&places),
            ..system
        };
        let GaussError { fraction, precise, .. } = error;
        Ok(Some(HeldLoop { system, blocks, fraction, precise }))
    }

    /// The error of the Gauss method with the fewest stages that make it precise, or with the most stages that have a
    /// bound. The fraction is `assumed`, halved until there is a bound; None if no fraction above 1e-4 has one.
    fn error(&self, assumed: f64) -> Option<GaussError> {
        let (x, y) = (self.z.abs() * self.period, &self.size * self.period);
        let mut fraction = assumed;
        while fraction >= LEAST {
            let largest = &y * fraction;
            let mut last = None;
            for stages in 1..=MOST_STAGES {
                let bound = remainder(&x, &largest, stages);
                let is_finite = |bound: &DMatrix<f64>| bound.iter().all(|entry| entry.is_finite());
                let Some(bound) = bound.filter(is_finite) else { continue };
                let precise = bound.norm() <= PRECISE * largest.norm();
                let bound = bound.rows(0, self.states) / fraction;
                last = Some(GaussError { stages, fraction, precise, bound });
                if precise {
                    break;
                }
            }
            if last.is_some() {
                return last;
            }
            fraction *= 0.5;
        }
        None
    }

    /// V and W such that every matrix within the bound of the error is V Delta W with a norm of Delta up to one: V from
    /// the output of Delta to the states, W from [x; u] to the input of Delta.
    fn weights(&self, error: &GaussError) -> Result<[DMatrix<f64>; 2], Error> {
        let mut relative = error.bound.clone();
        for (mut row, unit) in relative.row_iter_mut().zip(&self.units) {
            row.unscale_mut(*unit);
        }
        let sizes: Vec<f64> = relative.column_iter().map(|column| column.norm()).collect();
        for (mut column, size) in relative.column_iter_mut().zip(&sizes) {
            if *size > 0.0 {
                column.unscale_mut(*size);
            }
        }
        // The norm of a matrix is at most the norm of the moduli of its entries.
        let norm = norm_2(&relative.transpose())?;
        Ok([
            DMatrix::from_diagonal(&(&self.units * norm)),
            DMatrix::from_diagonal(&DVector::from_vec(sizes)),
        ])
    }

    /// The channels in the order of the blocks, and the blocks: all channels of a deviation together, then the channels
    /// of the error.
    fn places(&self, stages: usize) -> (Vec<usize>, Vec<Block>) {
        let (state_ranks, output_ranks) = (&self.on_states.ranks, &self.on_outputs.ranks);
        let (per_stage, outputs) = (self.on_states.left.ncols(), self.on_outputs.left.ncols());
        let (mut places, mut blocks) = (Vec::new(), Vec::new());
        let (mut first_state, mut first_output) = (0, 0);
        for (state_rank, output_rank) in state_ranks.iter().zip(output_ranks) {
            let in_stage = |stage: usize| (stage * per_stage + first_state..).take(*state_rank);
            places.extend((0..stages).flat_map(in_stage));
            places.extend((stages * per_stage + first_output..).take(*output_rank));
            (first_state, first_output) = (first_state + state_rank, first_output + output_rank);
            if stages * state_rank + output_rank > 0 {
                blocks.push(Block::Real(stages * state_rank + output_rank));
            }
        }
        let inner = self.z.nrows();
        let first_error = stages * per_stage + outputs;
        if self.size.amax() > 0.0 {
            places.extend(first_error..first_error + inner);
            blocks.push(Block::Full(inner));
        }
        (places, blocks)
    }
}
