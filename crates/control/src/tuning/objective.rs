//! The weighted singular values of a loop on a grid of frequencies, and their derivatives.

use super::minimax::Cut;
use super::{Transfer, Tuning};
use crate::blocks::{ComplexMatrix, to_complex};
use crate::response;
use crate::robustness::Point;
use crate::weight::bilinear_frequency;
use crate::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix, DVector, Dyn, SymmetricEigen};
use std::f64::consts::PI;

/// Number of frequencies per decade of the grid, which spans [`DECADES`] decades on each side of the bandwidth.
const PER_DECADE: i32 = 30;
const DECADES: i32 = 3;
/// Largest singular value of S K times the error of the approximated delays that counts as the value 1.
const DEVIATION: f64 = 0.1;
/// The largest number of iterations for the eigenvalues of a Hermitian matrix.
const ITERATIONS: usize = 1000;

/// The examined frequencies, ascending, with the response of the plant and the weights.
pub(super) struct Grid<'a> {
    pub(super) tuning: &'a Tuning<'a>,
    nodes: Vec<Node>,
}

struct Node {
    frequency: f64,
    plant: ComplexMatrix,
    /// The error of the approximated delays: the plant with the delays themselves less `plant`; None without delays.
    deviation: Option<ComplexMatrix>,
    /// The magnitude of the weight of each term, then that of the deviation by delays.
    weights: Vec<f64>,
}

/// A term at a frequency of the grid; the deviation by delays follows the terms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub(super) term: usize,
    pub(super) node: usize,
}

/// K, S and H G of a loop at one frequency.
struct ClosedLoop {
    /// K, the gain from the measurements to the commands.
    k: ComplexMatrix,
    /// `K_r`, the gain from the references to the commands.
    k_r: ComplexMatrix,
    /// S at the commands.
    at_input: ComplexMatrix,
    /// S at the measurements.
    at_output: ComplexMatrix,
    h_g: ComplexMatrix,
}

impl<'a> Grid<'a> {
    pub(super) fn new(tuning: &'a Tuning<'a>) -> Result<Self, Error> {
        let mut grid = Self { tuning, nodes: Vec::new() };
        for step in -DECADES * PER_DECADE..=DECADES * PER_DECADE {
            grid.add(tuning.rate * 10_f64.powf(f64::from(step) / f64::from(PER_DECADE)))?;
        }
        Ok(grid)
    }

    /// Adds a frequency, limited to six decades on both sides of the bandwidth, and in sampled time to just below half
    /// of the sampling rate.
    pub(super) fn add(&mut self, frequency: f64) -> Result<(), Error> {
        let Tuning { plant, terms, rate, delays, undelayed, .. } = self.tuning;
        let lowest = rate * 10_f64.powi(-2 * DECADES);
        let highest = match plant.domain {
            Domain::Continuous => rate * 10_f64.powi(2 * DECADES),
            Domain::Sampled { period } => (1.0 - 1e-6) * PI / period,
        };
        // With a bandwidth of more than six decades above the sampling rate, the sampling rate is the limit.
        let frequency = frequency.max(lowest).min(highest);
        let at = self.nodes.partition_point(|node| node.frequency < frequency);
        if self.nodes.get(at).is_some_and(|node| node.frequency <= frequency) {
            return Ok(());
        }
        let gain = response::Transfer::new(plant).gain(frequency)?;
        let mapped = bilinear_frequency(frequency, plant.domain);
        let weights = terms.iter().map(|term| term.weight.magnitude(mapped));
        let weights = weights.chain([1.0 / DEVIATION]).collect();
        let exact = || delays.responses(undelayed, plant.domain, &[frequency]);
        let exact = delays.any().then(exact).transpose()?;
        let deviation = exact.and_then(|mut all| all.pop()).map(|exact| exact - &gain);
        self.nodes.insert(at, Node { frequency, plant: gain, deviation, weights });
        Ok(())
    }

    /// The frequency of a node, in rad/s.
    pub(super) fn frequency(&self, node: usize) -> f64 {
        self.nodes[node].frequency
    }

    /// The transfer function of each term; None for the deviation by delays.
    fn transfers(&self) -> impl Iterator<Item = Option<Transfer>> {
        let Tuning { terms, delays, .. } = self.tuning;
        terms.iter().map(|term| Some(term.transfer)).chain(delays.any().then_some(None))
    }

    /// Each `step`-th frequency of each term.
    pub(super) fn places(&self, step: usize) -> Vec<Place> {
        let nodes = (0..self.nodes.len()).step_by(step);
        let terms = 0..self.transfers().count();
        nodes.flat_map(|node| terms.clone().map(move |term| Place { term, node })).collect()
    }

    /// The weighted singular values on the grid, term by term; None if they cannot be computed.
    pub(super) fn values(&self, controller: &StateSpace) -> Option<Vec<Vec<f64>>> {
        let transfer = response::Transfer::new(controller);
        let mut values = vec![Vec::with_capacity(self.nodes.len()); self.transfers().count()];
        for node in &self.nodes {
            let gain = transfer.gain(node.frequency).ok()?;
            let closed = ClosedLoop::new(&gain, &node.plant, &self.tuning.references)?;
            for (at, transfer) in self.transfers().enumerate() {
                let x = closed.transfer(transfer, node.deviation.as_ref())?;
                values[at].push(node.weights[at] * norm(&x)?);
            }
        }
        Some(values)
    }

    /// The values at `place` for [`pairs`] of vectors u and v, Re(u* X v), and their derivatives with respect to the
    /// parameters.
    ///
    /// d Re(u* X v) = Re(l dK r), l = u* `S_i`, and r = G `S_i` v at the commands,
    /// l = u* `S_o` G, r = `S_o` v at the measurements, l = u* `S_i`, r = `S_o` v for K S. For the tracking error
    /// l = -u* H G `S_i`, r = [G `S_i` `K_r` v; v], with d[K, `K_r`] in place of dK; T has the opposite sign of S. For
    /// the deviation by delays, D, l = u* `S_i`, r = `S_o` D v.
    pub(super) fn cuts(
        &self,
        controller: &StateSpace,
        differences: &[StateSpace],
        place: Place,
    ) -> Option<Vec<Cut>> {
        let Node { frequency, plant, deviation, weights } = &self.nodes[place.node];
        let (weight, transfer) = (weights[place.term], self.transfers().nth(place.term)?);
        let (order, s) = (controller.a.nrows(), controller.domain.point(*frequency));
        let pencil = ComplexMatrix::identity(order, order) * s - to_complex(&controller.a);
        let (b, c) = (to_complex(&controller.b), to_complex(&controller.c));
        let (forward, backward) = (pencil.clone().lu(), pencil.transpose().lu());
        let k = &c * forward.solve(&b)? + to_complex(&controller.d);
        let (t, p) = self.tuning.references.shape();
        let closed = ClosedLoop::new(&k, plant, &self.tuning.references)?;
        let value = closed.transfer(transfer, deviation.as_ref())?;
        let sign = if matches!(transfer, Some(Transfer::Complementary(_))) { -1.0 } else { 1.0 };
        let real = |row: &ComplexMatrix, column: &ComplexMatrix| (column * row).map(|one| one.re);
        let cut = |(u, v): &(ComplexMatrix, ComplexMatrix)| {
            use Transfer::{Complementary, Effort, Sensitivity, Tracking};
            let (left, right) = match transfer {
                Some(Sensitivity(Point::Input) | Complementary(Point::Input)) => {
                    (u.adjoint() * &closed.at_input, plant * &closed.at_input * v)
                }
                Some(Sensitivity(Point::Output) | Complementary(Point::Output)) => {
                    (u.adjoint() * &closed.at_output * plant, &closed.at_output * v)
                }
                Some(Effort) => (u.adjoint() * &closed.at_input, &closed.at_output * v),
                None => {
                    let deviation = deviation.as_ref()?;
                    (u.adjoint() * &closed.at_input, &closed.at_output * deviation * v)
                }
                Some(Tracking) => {
                    let left = -(u.adjoint() * &closed.h_g * &closed.at_input);
                    let measured = plant * &closed.at_input * &closed.k_r * v;
                    let mut right = measured.resize_vertically(p + t, Complex::from(0.0));
                    right.rows_mut(p, t).copy_from(v);
                    (left, right)
                }
            };
            // For the other transfer functions, the part of the references is zero.
            let right = right.resize_vertically(p + t, Complex::from(0.0));
            let x = forward.solve(&(&b * &right))?;
            let y = backward.solve(&(&left * &c).transpose())?.transpose();
            // Re(row M column) is the sum of the entries of M' and Re(column row).
            let [of_a, of_b, of_c, of_d] =
                [real(&y, &x), real(&y, &right), real(&left, &x), real(&left, &right)];
            let slope = |one: &StateSpace| {
                of_a.dot(&one.a.transpose())
                    + of_b.dot(&one.b.transpose())
                    + of_c.dot(&one.c.transpose())
                    + of_d.dot(&one.d.transpose())
            };
            let slopes = differences.iter().map(|one| sign * weight * slope(one));
            let gradient = DVector::from_iterator(differences.len(), slopes);
            Some(Cut { value: weight * (u.adjoint() * &value * v)[0].re, gradient })
        };
        pairs(&value)?.iter().map(cut).collect()
    }
}

impl ClosedLoop {
    /// Computes the loop from `gain` = [K, `K_r`], G = `plant` and H = `references`.
    fn new(gain: &ComplexMatrix, plant: &ComplexMatrix, references: &DMatrix<f64>) -> Option<Self> {
        let (p, m) = plant.shape();
        let k = gain.columns(0, p).into_owned();
        let k_r = gain.columns(p, references.nrows()).into_owned();
        let h_g = to_complex(references) * plant;
        let at_input = (ComplexMatrix::identity(m, m) - &k * plant).try_inverse()?;
        let at_output = (ComplexMatrix::identity(p, p) - plant * &k).try_inverse()?;
        Some(Self { k, k_r, at_input, at_output, h_g })
    }

    /// The transfer function X at the frequency; K S times the `deviation` by delays if `transfer` is None.
    fn transfer(
        &self,
        transfer: Option<Transfer>,
        deviation: Option<&ComplexMatrix>,
    ) -> Option<ComplexMatrix> {
        let complement = |s: &ComplexMatrix| ComplexMatrix::identity(s.nrows(), s.ncols()) - s;
        let Some(transfer) = transfer else { return Some(&self.k * &self.at_output * deviation?) };
        Some(match transfer {
            Transfer::Sensitivity(Point::Input) => self.at_input.clone(),
            Transfer::Sensitivity(Point::Output) => self.at_output.clone(),
            Transfer::Complementary(Point::Input) => complement(&self.at_input),
            Transfer::Complementary(Point::Output) => complement(&self.at_output),
            Transfer::Effort => &self.k * &self.at_output,
            Transfer::Tracking => complement(&(&self.h_g * &self.at_input * &self.k_r)),
        })
    }
}

/// The largest singular value; None if it cannot be computed, as for an entry that is not finite.
fn norm(x: &ComplexMatrix) -> Option<f64> {
    if x.ncols() == 1 || x.nrows() == 1 {
        return Some(x.norm()).filter(|value| value.is_finite());
    }
    Some(squares(x)?.eigenvalues.max().sqrt())
}

/// The eigenvalues and eigenvectors of X* X; None for an entry that is not finite.
fn squares(x: &ComplexMatrix) -> Option<SymmetricEigen<Complex<f64>, Dyn>> {
    let squares = x.adjoint() * x;
    let is_finite = squares.iter().all(|entry| entry.is_finite());
    is_finite.then(|| SymmetricEigen::try_new(squares, f64::EPSILON, ITERATIONS)).flatten()
}

/// Pairs of unit vectors u and v: the first two of X v = sigma u, and four for which Re(u* X v) is the mean of their
/// singular values. No pair has a larger Re(u* X v) than the largest singular value, so that these functions describe it
/// also where two singular values are equal and it has no gradient.
fn pairs(x: &ComplexMatrix) -> Option<Vec<(ComplexMatrix, ComplexMatrix)>> {
    let squares = squares(x)?;
    let mut order: Vec<_> = (0..x.ncols()).collect();
    order.sort_by(|&i, &j| squares.eigenvalues[j].total_cmp(&squares.eigenvalues[i]));
    order.truncate(x.nrows().min(2));
    let pair = |at: &usize| {
        let v: ComplexMatrix = squares.eigenvectors.columns(*at, 1).into();
        let u = x * &v;
        let size = Complex::from(u.norm().max(f64::MIN_POSITIVE));
        (u / size, v)
    };
    let mut pairs: Vec<_> = order.iter().map(pair).collect();
    if let [(u, v), (other_u, other_v)] = pairs.as_slice() {
        let half = Complex::from(0.5_f64.sqrt());
        let means = [1.0.into(), (-1.0).into(), Complex::i(), -Complex::i()]
            .map(|phase| ((u + other_u * phase) * half, (v + other_v * phase) * half));
        pairs.extend(means);
    }
    Some(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocks::beside;
    use crate::delay::Delays;
    use crate::tuning::Term;
    use crate::weight::Weight;

    /// A controller of second order for two channels and a reference, whose entries are the parameters.
    fn controller(parameters: &DVector<f64>, domain: Domain) -> StateSpace {
        let part = |at: usize| DMatrix::from_row_slice(2, 2, &parameters.as_slice()[at..at + 4]);
        let with = |at: usize, column: usize| {
            let column = &parameters.as_slice()[column..column + 2];
            beside(&part(at), &DMatrix::from_column_slice(2, 1, column))
        };
        StateSpace { a: part(0), b: with(4, 16), c: part(8), d: with(12, 18), domain }
    }

    #[test]
    fn gradients_are_those_of_central_differences() -> Result<(), Error> {
        let two = |values: &[f64; 4]| DMatrix::from_row_slice(2, 2, values);
        let stable = [(Domain::Continuous, -1.0), (Domain::Sampled { period: 0.2 }, 0.5)];
        for (domain, pole) in stable {
            let plant = StateSpace {
                a: two(&[pole, 0.3, -0.2, 0.7 * pole]),
                b: two(&[1.0, 0.2, -0.4, 0.8]),
                c: two(&[0.5, 0.1, 0.3, -0.6]),
                d: DMatrix::zeros(2, 2),
                domain,
            };
            let build = |parameters: &DVector<f64>| Ok(controller(parameters, domain));
            let transfers = [
                Transfer::Sensitivity(Point::Input),
                Transfer::Sensitivity(Point::Output),
                Transfer::Complementary(Point::Input),
                Transfer::Complementary(Point::Output),
                Transfer::Effort,
                Transfer::Tracking,
            ];
            let weight = Weight::lead_lag(2.0, 1.0, 0.5, 1)?;
            let term = |transfer| Term { transfer, weight: weight.clone() };
            let is_continuous = domain == Domain::Continuous;
            let inputs = if is_continuous { vec![0.3, 0.1] } else { vec![0.0; 2] };
            let delays = Delays { inputs, outputs: vec![0.0; 2] };
            let tuning = Tuning {
                undelayed: plant.clone(),
                plant,
                delays: &delays,
                controller: &build,
                references: DMatrix::from_row_slice(1, 2, &[0.8, -0.3]),
                terms: transfers.map(term).to_vec(),
                instability: 0.0,
                is_allowed: &|_| true,
                rate: 1.0,
                is_over: &|| false,
            };
            let grid = Grid::new(&tuning)?;
            let first = [pole, 0.1, 0.2, pole / 2.0, 0.4, -0.3, 0.2, 0.5, 0.1, 0.3, -0.2, 0.4];
            let rest = [-0.1, 0.2, 0.05, -0.15, 0.3, 0.2, -0.1, 0.4];
            let start = DVector::from_vec([first.as_slice(), &rest].concat());
            let moved = |at: usize, by: f64| {
                let mut parameters = start.clone();
                parameters[at] += by;
                controller(&parameters, domain)
            };
            let slope = |at: usize| {
                let (mut above, below) = (moved(at, 0.5), moved(at, -0.5));
                above.a -= below.a;
                above.b -= below.b;
                above.c -= below.c;
                above.d -= below.d;
                above
            };
            let differences: Vec<_> = (0..start.len()).map(slope).collect();
            let nominal = controller(&start, domain);
            let values = |k: &StateSpace| grid.values(k).ok_or(Error::Overflow { what: "S" });
            let node = 80;
            assert_eq!(grid.transfers().count(), transfers.len() + usize::from(is_continuous));
            for term in 0..grid.transfers().count() {
                let place = Place { term, node };
                let cuts = grid.cuts(&nominal, &differences, place).expect("a gradient");
                let Cut { value, gradient } = &cuts[0];
                assert!((value - values(&nominal)?[term][node]).abs() < 1e-8 * value);
                if let [first, second, means @ ..] = cuts.as_slice() {
                    let mean = f64::midpoint(first.value, second.value);
                    assert!(means.iter().all(|cut| (cut.value - mean).abs() < 1e-12 * *value));
                }
                for at in 0..start.len() {
                    let after = |by: f64| Ok::<_, Error>(values(&moved(at, by))?[term][node]);
                    let expected = (after(1e-5)? - after(-1e-5)?) / 2e-5;
                    let error = (gradient[at] - expected).abs();
                    assert!(error < 1e-6 * (1.0 + expected.abs()), "{term} {at}: {error}");
                }
            }
        }
        Ok(())
    }
}
