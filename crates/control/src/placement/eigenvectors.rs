//! Eigenvectors of large volume and of small condition number.

use super::descent::minimise;
use super::subspace::{AssignableSubspace, AssignableSubspaces};
use crate::Error;
use crate::balance::multiply_rows;
use crate::check::as_number;
use crate::svd::Svd;
use nalgebra::{DMatrix, DVector, RowDVector};

/// Number of starts of the search for the largest volume, and of results from which the condition number is minimised.
const STARTS: usize = 6;
const DESCENTS: usize = 3;
/// A later start is preferred only if it is better by this factor, so that rounding errors do not decide.
const BETTER: f64 = 1.0 - 1e-5;
const SWEEPS: usize = 20;
const ROUNDS: usize = 5;
/// Order up to which the condition number itself is minimised, because each step costs a singular value
/// decomposition by Jacobi rotations.
pub(crate) const LARGEST_DESCENT: usize = 24;
/// Decrease of ln(condition) at which the descent ends.
const CONDITION_TOLERANCE: f64 = 1e-6;

/// Directions w of length one, one for each eigenvalue or pair, see [`AssignableSubspaces`].
pub(crate) type Directions = Vec<DVector<f64>>;

/// The directions of largest volume from each of several fixed starts.
pub(crate) fn widest_directions(problem: &AssignableSubspaces) -> Result<Vec<Directions>, Error> {
    let starts = if problem.inputs() == 1 { 1 } else { STARTS };
    (0..starts).map(|start| enlarge_volume(problem, start)).collect()
}

/// The directions of largest volume from further starts; none above the order `LARGEST_DESCENT`, and none with one
/// input.
pub(crate) fn more_directions(problem: &AssignableSubspaces) -> Result<Vec<Directions>, Error> {
    let small = problem.scale.len() <= LARGEST_DESCENT && problem.inputs() > 1;
    let further = if small { STARTS..2 * STARTS } else { 0..0 };
    further.map(|start| enlarge_volume(problem, start)).collect()
}

/// The directions of least condition number that descents from the first three `starts` find; above the order
/// `LARGEST_DESCENT` the best of these starts.
pub(crate) fn best_conditioned(
    problem: &AssignableSubspaces,
    starts: &[Directions],
) -> Result<Directions, Error> {
    let mut best: Option<(f64, Directions)> = None;
    for start in starts.iter().take(DESCENTS) {
        let mut directions = start.clone();
        if problem.scale.len() <= LARGEST_DESCENT {
            let condition = |directions: &[DVector<f64>]| condition_slope(problem, directions);
            directions = descend(problem, directions, &condition, CONDITION_TOLERANCE)?;
        }
        let value = condition(&problem.eigenvectors(&directions))?;
        if best.as_ref().is_none_or(|(least, _)| value < BETTER * least) {
            best = Some((value, directions));
        }
    }
    best.map(|(_, directions)| directions).ok_or(Error::Overflow { what: "K" })
}

/// Largest over smallest singular value, precise for rows of very different size.
pub(crate) fn condition(eigenvectors: &DMatrix<f64>) -> Result<f64, Error> {
    Ok(Svd::new(&eigenvectors.transpose())?.condition())
}

/// Quasi-random directions: the fractional parts of 1000 sqrt(k), with a separate range of k for each start.
fn start_directions(problem: &AssignableSubspaces, start: usize) -> Directions {
    let count = problem.scale.len() * problem.inputs();
    let mut seed = (2 + start * count..).map(|k| (1000.0 * as_number(k).sqrt()).fract() - 0.5);
    let mut direction = |space: &AssignableSubspace| {
        let w = DVector::from_fn(space.states.ncols(), |_, _| seed.next().unwrap_or(1.0));
        let length = w.norm();
        if length > 0.0 { w / length } else { DVector::from_element(w.len(), 1.0).normalize() }
    };
    problem.spaces.iter().map(&mut direction).collect()
}

/// Replaces each eigenvector, or pair, in turn by the eigenvector, or pair, that spans the largest volume with the
/// others, in 20 sweeps from a start; ends early if the eigenvectors become dependent.
///
/// For a real eigenvalue this is the normal of the plane that the others span, projected onto the
/// subspace of the eigenvalue: method 0 of Kautsky, Nichols and Van Dooren. A pair V = [v1, v2] and the
/// others span a volume in proportion to v1' (p q' - q p') v2, p and q normal to the others. It is
/// greatest at an eigenvector of a symmetric matrix: Tits and Yang. Sources: see [`super::place`].
fn enlarge_volume(problem: &AssignableSubspaces, start: usize) -> Result<Directions, Error> {
    let mut directions = start_directions(problem, start);
    for _ in 0..SWEEPS {
        let mut column = 0;
        for (number, space) in problem.spaces.iter().enumerate() {
            let Some(inverse) = problem.inverse(&directions) else {
                return Ok(directions);
            };
            let count = space.poles.count();
            let normals = inverse.rows(column, count).transpose();
            if normals.norm().is_normal() {
                let best = widest(space, &(&normals / normals.norm()))?;
                let length = best.norm();
                if length.is_normal() {
                    directions[number] = best / length;
                }
            }
            column += count;
        }
    }
    Ok(directions)
}

/// The direction w, of any length, whose eigenvectors span the largest volume with the other eigenvectors.
///
/// `normals`: n x 1 for a real eigenvalue, n x 2 for a pair, its columns normal to the other eigenvectors.
/// `space.states` maps w to v, or to [v1; v2] of a pair, whose volume is in proportion to |w' `form` w|. `shift` makes
/// `form` and -`form` positive semidefinite, so that their first singular vectors are the eigenvectors of the highest
/// and of the lowest eigenvalue of `form`.
fn widest(space: &AssignableSubspace, normals: &DMatrix<f64>) -> Result<DVector<f64>, Error> {
    let n = normals.nrows();
    if space.poles.count() == 1 {
        return Ok(space.states.tr_mul(&normals.column(0)));
    }
    let first = space.states.rows(0, n).tr_mul(normals);
    let second = space.states.rows(n, n).tr_mul(normals);
    let half = first.column(0) * second.column(1).transpose()
        - first.column(1) * second.column(0).transpose();
    let form = &half + half.transpose();
    let shift = DMatrix::from_diagonal_element(form.nrows(), form.nrows(), form.norm());
    let highest = Svd::new(&(&shift + &form))?.right.column(0).into_owned();
    let lowest = Svd::new(&(&shift - &form))?.right.column(0).into_owned();
    let size = |w: &DVector<f64>| w.dot(&(&form * w)).abs();
    Ok(if size(&highest) >= size(&lowest) { highest } else { lowest })
}

/// The value of a function of directions, and its gradients with respect to the eigenvectors V and the responses G.
pub(crate) struct Slope {
    pub(crate) value: f64,
    /// The gradient with respect to the eigenvectors V.
    pub(crate) of_v: DMatrix<f64>,
    /// The gradient with respect to the responses G, r rows; None if the function does not depend on G.
    pub(crate) of_g: Option<DMatrix<f64>>,
}

/// Minimises a function by up to five descents, each in local coordinates around the end of the previous one, until one
/// lowers the value by less than `tolerance`. The function is None where it is not defined.
pub(crate) fn descend(
    problem: &AssignableSubspaces,
    mut directions: Directions,
    function: &dyn Fn(&[DVector<f64>]) -> Option<Slope>,
    tolerance: f64,
) -> Result<Directions, Error> {
    let mut value = f64::INFINITY;
    for _ in 0..ROUNDS {
        let chart = Chart::around(problem, directions)?;
        let local = |t: &DVector<f64>| {
            let directions = chart.directions(t);
            let slope = function(&directions)?;
            Some((slope.value, chart.gradient(problem, &directions, t, &slope)))
        };
        let dimension = chart.normals.iter().map(DMatrix::ncols).sum();
        let (at, lowest) = minimise(&local, dimension, tolerance);
        directions = chart.directions(&at);
        if value <= lowest + tolerance {
            break;
        }
        value = lowest;
    }
    Ok(directions)
}

/// ln(s1 / sn) of the eigenvector matrix V = sum of s x u' (singular value decomposition), and its gradient, from ds =
/// x' dV u.
fn condition_slope(problem: &AssignableSubspaces, directions: &[DVector<f64>]) -> Option<Slope> {
    let v = Svd::new(&problem.eigenvectors(directions).transpose()).ok()?;
    let last = v.values.len() - 1;
    let value = v.condition().ln();
    let of_v = v.right.column(0) * (v.left.column(0) / v.values[0]).transpose()
        - v.right.column(last) * (v.left.column(last) / v.values[last]).transpose();
    value.is_finite().then_some(Slope { value, of_v, of_g: None })
}

/// Directions near given ones: w = (w0 + N t) / |w0 + N t|.
///
/// The columns of N are orthonormal and normal to w0. For a pair they are also normal to the
/// direction of i v, because a complex factor does not change an eigenvector.
struct Chart {
    centres: Vec<DVector<f64>>,
    normals: Vec<DMatrix<f64>>,
}

impl Chart {
    /// Local coordinates that are zero at `centres`.
    fn around(problem: &AssignableSubspaces, centres: Vec<DVector<f64>>) -> Result<Self, Error> {
        let pairs = problem.spaces.iter().zip(&centres);
        let normals = pairs.map(|(space, w)| normals(space, w)).collect::<Result<_, _>>()?;
        Ok(Self { centres, normals })
    }

    /// The directions at local coordinates t.
    fn directions(&self, t: &DVector<f64>) -> Vec<DVector<f64>> {
        let mut first = 0;
        let direction = |(centre, normals): (&DVector<f64>, &DMatrix<f64>)| {
            let part = t.rows(first, normals.ncols());
            first += normals.ncols();
            (centre + normals * part).normalize()
        };
        self.centres.iter().zip(&self.normals).map(direction).collect()
    }

    /// The gradient with respect to the local coordinates t of `directions`: for each w, with the gradient `of_w`,
    /// N' (I - w w') `of_w` / |w0 + N t|.
    fn gradient(
        &self,
        problem: &AssignableSubspaces,
        directions: &[DVector<f64>],
        t: &DVector<f64>,
        slope: &Slope,
    ) -> DVector<f64> {
        let Slope { of_v, of_g, .. } = slope;
        let of_g = of_g.as_ref().map(|of_g| multiply_rows(of_g, &problem.response_scale));
        let mut gradient = DVector::zeros(t.len());
        let (mut column, mut first) = (0, 0);
        for ((space, normals), w) in problem.spaces.iter().zip(&self.normals).zip(directions) {
            let (count, free) = (space.poles.count(), normals.ncols());
            let stacked = |m: &DMatrix<f64>| {
                let columns = m.columns(column, count).into_owned();
                DVector::from_column_slice(columns.as_slice())
            };
            let mut of_w = space.states.tr_mul(&stacked(of_v));
            if let Some(of_g) = &of_g {
                of_w += space.responses.tr_mul(&stacked(of_g));
            }
            let tangential = &of_w - w * w.dot(&of_w);
            let length = (1.0 + t.rows(first, free).norm_squared()).sqrt();
            gradient.rows_mut(first, free).copy_from(&(normals.tr_mul(&tangential) / length));
            column += count;
            first += free;
        }
        gradient
    }
}

/// Orthonormal columns normal to w and, for a pair, to the w of i v.
fn normals(space: &AssignableSubspace, w: &DVector<f64>) -> Result<DMatrix<f64>, Error> {
    let count = space.poles.count();
    let mut fixed = vec![w.transpose()];
    if count == 2 {
        fixed.push(quarter_turn(space, w));
    }
    let across = Svd::new(&DMatrix::from_rows(&fixed))?.right;
    Ok(across.columns(count, w.len() - count).into())
}

/// The w of i v as a row: v1 + i v2 becomes -v2 + i v1.
fn quarter_turn(space: &AssignableSubspace, w: &DVector<f64>) -> RowDVector<f64> {
    let v = &space.states * w;
    let n = v.len() / 2;
    let turned = DVector::from_fn(2 * n, |i, _| if i < n { -v[n + i] } else { v[i - n] });
    (space.states.tr_mul(&turned) / 2.0).transpose()
}
