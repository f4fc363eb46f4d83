//! The peak-to-peak gain.

use super::impulse_sum::impulse_sums;
use super::interval::{Bounds, Intervals, Length};
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{DMatrix, DVector};
use std::collections::HashMap;
use std::rc::Rc;

/// Largest number of rounds; each round halves the intervals whose bounds differ most.
const ROUNDS: usize = 200;
/// A round halves only intervals whose bounds differ by more than 1 / `GAP_RATIO` of the largest difference.
const GAP_RATIO: f64 = 32.0;
const MOST_INTERVALS: usize = 1 << 18;
/// Number of outputs that share the states after an impulse.
const OUTPUTS_AT_ONCE: usize = 8;
/// Largest number of states that are stored for other outputs.
const MOST_STATES: usize = 1 << 14;

/// Lower and upper bounds of a matrix, entry by entry.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Bracket {
    /// The lower bounds, p x m.
    pub lower: DMatrix<f64>,
    /// The upper bounds, p x m.
    pub upper: DMatrix<f64>,
}

/// Computes the peak-to-peak gain from each input to each output.
///
/// ```text
/// gain[i,j] = |D[i,j]| + integral of |h_ij(t)|,  h(t) = C e^(A t) B       continuous
/// gain[i,j] = |D[i,j]| + sum of |h_ij[k]|,       h[k] = C A^k B           sampled
/// ```
///
/// This gain is the least upper bound of |`z_i`| from rest over all inputs `w_j` with |`w_j`| <= 1. With several
/// inputs, |`z_i`| <= sum over j of `gain[i,j]` times the bound of |`w_j`|. `width`:
/// relative width of the bracket, 1e-3 for example. The gain is finite when A is stable. Method:
/// over an interval the integral of |h| lies between |integral of h| and the root of its length
/// times the integral of h^2, both exact up to rounding; intervals of dyadic length are
/// halved where the two differ most, so that fast and slow modes get the steps they need; the
/// contraction of the state bounds the integral after the last interval. In sampled time all samples are
/// added where that needs fewer operations. The bracket is proven up to rounding; it is not narrowed below
/// the rounding error of the root of the integral of h^2.
///
/// Cost: for each output, or each input if there are fewer, about 100 n^3, and for each pair and each time constant
/// or oscillation some 50 intervals of (r + 1) n multiplications, r <= n the rank of the Gramian of the interval,
/// and n^2 for the states, which up to 8 outputs share.
///
/// Source: M. A. Dahleh and J. B. Pearson, L1-optimal compensators for continuous-time systems,
/// IEEE Trans. Autom. Control 32 (1987), for the gain; the bracket is elementary.
///
/// # Example
///
/// ```
/// use control::response::peak_gain;
/// use control::{Domain, StateSpace};
/// use nalgebra::DMatrix;
/// // 1 / (s^2 + 0.2 s + 1): the impulse response changes its sign at multiples of pi / w.
/// let system = StateSpace {
///     a: DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0, -0.2]),
///     b: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
///     c: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
///     d: DMatrix::zeros(1, 1),
///     domain: Domain::Continuous,
/// };
/// let gain = peak_gain(&system, 1e-3)?;
/// let exact = 1.0 / (0.1 * std::f64::consts::PI / 0.99_f64.sqrt() / 2.0).tanh();
/// assert!(gain.lower[(0, 0)] <= exact && exact <= gain.upper[(0, 0)]);
/// assert!(gain.upper[(0, 0)] / gain.lower[(0, 0)] < 1.0011);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`StateSpace::check`]; [`Error::OutOfRange`] for `width`; [`Error::NotHurwitz`],
/// [`Error::NotSchur`]; [`Error::NotConverged`] when a lightly damped system needs more than 260000
/// intervals, or when rounding errors grow more than A contracts.
pub fn peak_gain(system: &StateSpace, width: f64) -> Result<Bracket, Error> {
    let eigenvalues = system.stable_eigenvalues()?;
    check::positive("width", width)?;
    if let Domain::Sampled { .. } = system.domain
        && let Some(sums) = impulse_sums(system, &eigenvalues, width)?
    {
        return Ok(sums);
    }
    // h_ij is the response of the dual system from output i to input j, too.
    if system.b.ncols() < system.c.nrows() {
        let Bracket { lower, upper } = by_intervals(&system.dual(), width)?;
        return Ok(Bracket { lower: lower.transpose(), upper: upper.transpose() });
    }
    by_intervals(system, width)
}

/// The peak gains by intervals, which are chosen for each output separately.
fn by_intervals(system: &StateSpace, width: f64) -> Result<Bracket, Error> {
    let mut intervals = Intervals::new(system)?;
    let mut lower = system.d.abs();
    let mut upper = lower.clone();
    let outputs: Vec<_> = (0..system.c.nrows()).collect();
    for outputs in outputs.chunks(OUTPUTS_AT_ONCE) {
        let mut lengths: Vec<_> = outputs.iter().map(|at| vec![intervals.first(*at)]).collect();
        for input in 0..system.b.ncols() {
            let mut trajectory = Trajectory::new(intervals.starts.column(input).into());
            for (output, lengths) in outputs.iter().zip(&mut lengths) {
                let count = intervals.extend(lengths, input, 0.25 * width)?;
                let (least, most) = integral(&lengths[..count], &mut trajectory, 0.5 * width)?;
                lower[(*output, input)] += least;
                upper[(*output, input)] += most;
            }
        }
    }
    Ok(Bracket { lower, upper })
}

/// The states after an impulse, which all outputs share.
struct Trajectory {
    start: Rc<DVector<f64>>,
    /// The states; the key is the time of the state, counted in shortest intervals.
    states: HashMap<u128, Rc<DVector<f64>>>,
}

impl Trajectory {
    fn new(start: DVector<f64>) -> Self {
        Self { start: Rc::new(start), states: HashMap::new() }
    }

    /// The starts of the second halves of intervals from `firsts`; `half`: 2^`level` times the shortest interval.
    fn middles(&mut self, half: &Length, level: usize, firsts: &[Start]) -> Vec<Start> {
        let time = |first: &Start| first.time + (1_u128 << level);
        let is_missing = |first: &&Start| !self.states.contains_key(&time(first));
        let missing: Vec<_> = firsts.iter().filter(is_missing).map(|first| &first.state).collect();
        let products = &*half.phi * columns(&missing);
        let mut products = products.column_iter();
        let middle = |first: &Start| {
            let time = time(first);
            let state = self.states.get(&time).map(Rc::clone).or_else(|| {
                let state: Rc<DVector<f64>> = Rc::new(products.next()?.into());
                if self.states.len() < MOST_STATES {
                    self.states.insert(time, Rc::clone(&state));
                }
                Some(state)
            })?;
            Some(Start { time, state })
        };
        let middles: Vec<_> = firsts.iter().filter_map(middle).collect();
        debug_assert_eq!(middles.len(), firsts.len());
        middles
    }
}

#[derive(Clone)]
struct Start {
    /// Time in shortest intervals.
    time: u128,
    state: Rc<DVector<f64>>,
}

struct Piece {
    start: Start,
    bounds: Bounds,
}

impl Piece {
    fn gap(&self) -> f64 {
        self.bounds.upper - self.bounds.lower
    }
}

/// The lower and the upper bound of the integral of |h| over all time. Their difference is at most `width` times the
/// lower bound, plus the rounding errors and the bound of the integral after the longest of `lengths`.
fn integral(
    lengths: &[Length],
    trajectory: &mut Trajectory,
    width: f64,
) -> Result<(f64, f64), Error> {
    let longest = lengths.len() - 1;
    let start = Start { time: 0, state: Rc::clone(&trajectory.start) };
    let tail = lengths[longest].tail(&(&*lengths[longest].phi * &*start.state));
    // The pieces of each length: products with all of their states at once are fast.
    let mut pieces: Vec<Vec<Piece>> = lengths.iter().map(|_| Vec::new()).collect();
    pieces[longest] = from_starts(&lengths[longest], vec![start]);
    let error = |iterations| Error::NotConverged { what: "the peak-to-peak gain", iterations };
    for round in 0..ROUNDS {
        let sum = |part: fn(&Bounds) -> f64| -> f64 {
            pieces.iter().flatten().map(|piece| part(&piece.bounds)).sum()
        };
        let (lower, upper) = (sum(|bounds| bounds.lower), sum(|bounds| bounds.upper));
        let allowed = width * lower + sum(|bounds| bounds.rounding);
        let count: usize = pieces.iter().map(Vec::len).sum();
        let share = allowed / check::as_number(count);
        let widest = pieces[1..].iter().flatten().map(Piece::gap).fold(0.0, f64::max);
        if upper - lower <= allowed || widest <= share {
            return Ok((lower, upper + tail));
        }
        if count > MOST_INTERVALS {
            return Err(error(round));
        }
        let least = share.max(widest / GAP_RATIO);
        for length in 1..=longest {
            let wide = |piece: &mut Piece| piece.gap() > least;
            let wide: Vec<_> =
                pieces[length].extract_if(.., wide).map(|piece| piece.start).collect();
            if !wide.is_empty() {
                let half = &lengths[length - 1];
                let middles = trajectory.middles(half, length - 1, &wide);
                pieces[length - 1].extend(from_starts(half, [wide, middles].concat()));
            }
        }
    }
    Err(error(ROUNDS))
}

/// The pieces of length `length` that begin at `starts`.
fn from_starts(length: &Length, starts: Vec<Start>) -> Vec<Piece> {
    let states: Vec<_> = starts.iter().map(|start| &start.state).collect();
    let bounds = length.bounds(&columns(&states));
    starts.into_iter().zip(bounds).map(|(start, bounds)| Piece { start, bounds }).collect()
}

fn columns(states: &[&Rc<DVector<f64>>]) -> DMatrix<f64> {
    let order = states.first().map_or(0, |state| state.len());
    let mut matrix = DMatrix::zeros(order, states.len());
    matrix.column_iter_mut().zip(states).for_each(|(mut column, state)| column.copy_from(state));
    matrix
}
