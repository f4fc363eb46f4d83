//! The choice of eigenvectors with the best condition number.

use super::assignable::Assignable;
use super::descent::minimise;
use crate::Error;
use crate::singular::Singular;
use nalgebra::{DMatrix, DVector};

const STARTS: usize = 3;
/// A later start must be better by more than rounding, or else the earliest wins.
const BETTER: f64 = 1.0 - 1e-5;
const SWEEPS: usize = 20;
const ROUNDS: usize = 5;
/// Another round of descent is worth its cost if it lowers ln(condition) by this.
const WORTHWHILE: f64 = 1e-6;

/// Directions w, of length one, of the best of several descents from fixed starts.
pub(crate) fn best_directions(problem: &Assignable) -> Result<Vec<DVector<f64>>, Error> {
    let mut best: Option<(f64, Vec<DVector<f64>>)> = None;
    let starts = if problem.inputs() == 1 { 1 } else { STARTS };
    for start in 0..starts {
        let directions = descend(problem, project(problem, spread(problem, start)));
        let value = condition(problem, &directions)?;
        if best.as_ref().is_none_or(|(least, _)| value < BETTER * least) {
            best = Some((value, directions));
        }
    }
    best.map(|(_, directions)| directions).ok_or(Error::Overflow { what: "K" })
}

/// Condition number of the matrix of eigenvectors of length one, in the given coordinates.
pub(crate) fn condition(problem: &Assignable, directions: &[DVector<f64>]) -> Result<f64, Error> {
    Ok(Singular::of(&problem.eigenvectors(directions).transpose())?.condition())
}

/// Directions spread without pattern: the fractional parts of multiples of square roots.
fn spread(problem: &Assignable, start: usize) -> Vec<DVector<f64>> {
    let (poles, inputs) = (problem.states.len(), problem.inputs());
    let mut seed = (2 + start * poles * inputs..).map(|k| {
        #[expect(clippy::cast_precision_loss, reason = "the count is far below 2^52")]
        let root = (k as f64).sqrt();
        (1000.0 * root).fract() - 0.5
    });
    let mut direction = |_| {
        let w = DVector::from_fn(inputs, |_, _| seed.next().unwrap_or(1.0));
        let length = w.norm();
        if length > 0.0 { w / length } else { DVector::from_element(inputs, 1.0).normalize() }
    };
    (0..poles).map(&mut direction).collect()
}

/// Method 0 of Kautsky, Nichols and Van Dooren: each eigenvector in turn becomes the projection,
/// onto its subspace, of the normal of the plane that the others span.
fn project(problem: &Assignable, mut directions: Vec<DVector<f64>>) -> Vec<DVector<f64>> {
    for _ in 0..SWEEPS {
        for pole in 0..directions.len() {
            let Some(inverse) = problem.inverse(&directions) else {
                return directions;
            };
            let projection = problem.states[pole].tr_mul(&inverse.row(pole).transpose());
            let length = projection.norm();
            if length.is_normal() {
                directions[pole] = projection / length;
            }
        }
    }
    directions
}

/// Descent on ln(condition) in local coordinates that are centred anew in each round.
fn descend(problem: &Assignable, mut directions: Vec<DVector<f64>>) -> Vec<DVector<f64>> {
    let mut value = f64::INFINITY;
    for _ in 0..ROUNDS {
        let chart = Chart::around(directions);
        let (at, lowest) = minimise(&|t| chart.objective(problem, t), chart.dimension());
        directions = chart.directions(&at);
        if value <= lowest + WORTHWHILE {
            break;
        }
        value = lowest;
    }
    directions
}

/// Directions near given ones: w = (w0 + N t) / |w0 + N t|, the columns of N orthonormal and normal
/// to w0.
struct Chart {
    centres: Vec<DVector<f64>>,
    normals: Vec<DMatrix<f64>>,
}

impl Chart {
    fn around(centres: Vec<DVector<f64>>) -> Self {
        let normals = centres.iter().map(normals).collect();
        Self { centres, normals }
    }

    fn dimension(&self) -> usize {
        self.normals.iter().map(DMatrix::ncols).sum()
    }

    fn directions(&self, t: &DVector<f64>) -> Vec<DVector<f64>> {
        let each = self.normals[0].ncols();
        let direction = |(pole, centre): (usize, &DVector<f64>)| {
            (centre + &self.normals[pole] * t.rows(pole * each, each)).normalize()
        };
        self.centres.iter().enumerate().map(direction).collect()
    }

    /// ln(s1 / sn) of the eigenvector matrix V = sum of s x u', and its gradient: ds = x' dV u.
    fn objective(&self, problem: &Assignable, t: &DVector<f64>) -> Option<(f64, DVector<f64>)> {
        let directions = self.directions(t);
        let v = Singular::of(&problem.eigenvectors(&directions).transpose()).ok()?;
        let last = v.values.len() - 1;
        let value = v.condition().ln();
        let mut gradient = DVector::zeros(t.len());
        let each = self.normals[0].ncols();
        for (pole, w) in directions.iter().enumerate() {
            let slope = v.right.column(0) * (v.left[(pole, 0)] / v.values[0])
                - v.right.column(last) * (v.left[(pole, last)] / v.values[last]);
            let slope = problem.states[pole].tr_mul(&slope);
            let tangential = &slope - w * w.dot(&slope);
            let length = (1.0 + t.rows(pole * each, each).norm_squared()).sqrt();
            let part = self.normals[pole].tr_mul(&tangential) / length;
            gradient.rows_mut(pole * each, each).copy_from(&part);
        }
        value.is_finite().then_some((value, gradient))
    }
}

/// Orthonormal columns normal to w: the reflection that takes w to an axis, without its first
/// column.
fn normals(w: &DVector<f64>) -> DMatrix<f64> {
    let mut mirror = w.clone();
    mirror[0] += 1.0_f64.copysign(w[0]);
    let factor = 2.0 / mirror.norm_squared();
    DMatrix::from_fn(w.len(), w.len() - 1, |i, j| {
        let unit = if i == j + 1 { 1.0 } else { 0.0 };
        unit - factor * mirror[i] * mirror[j + 1]
    })
}
