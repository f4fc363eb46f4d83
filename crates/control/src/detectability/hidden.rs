//! Faults that a state hides.

use crate::Error;
use crate::aso::FaultyPlant;
use crate::eigen::eigenvalues;
use crate::singular::{Singular, smallest};
use nalgebra::{Complex, DMatrix, DVector};

/// Singular values below this part of the largest count as zero.
const TOLERANCE: f64 = 1e-12;
/// Eigenvalues of the fault model nearer than this, relative to its norm, are one.
const SAME: f64 = 1e-6;
/// Parts of a combination below this part of its largest do not count.
const PART: f64 = 1e-6;

type Complexes = DMatrix<Complex<f64>>;
type ComplexColumn = DVector<Complex<f64>>;

/// A development of the faults that the measurements cannot tell from one of the states.
#[derive(Debug, Clone, PartialEq)]
pub struct Hidden {
    /// s: both develop as e^(s t), or s^k when sampled. An eigenvalue of `A_f`.
    pub at: Complex<f64>,
    /// How many faults develop so independently: columns of N, the eigenvectors of `A_f` for s.
    pub channels: usize,
    /// Rank of [A - s I, `F_a` N; C, 0].
    pub rank: usize,
    /// Number of its columns.
    pub expected: usize,
    /// The faults, q, scaled so that the largest is one.
    pub fault: DVector<Complex<f64>>,
    /// The states that hide them, n.
    pub state: DVector<Complex<f64>>,
}

impl Hidden {
    /// Which faults take part, from zero.
    #[must_use]
    pub fn faults(&self) -> Vec<usize> {
        parts(&self.fault)
    }

    /// Which states take part, from zero.
    #[must_use]
    pub fn states(&self) -> Vec<usize> {
        parts(&self.state)
    }
}

fn parts(v: &ComplexColumn) -> Vec<usize> {
    let largest = v.iter().map(|part| part.norm()).fold(0.0, f64::max);
    (0..v.len()).filter(|&at| v[at].norm() > PART * largest).collect()
}

/// The hidden combinations of faults, as few faults in each as elimination gives.
///
/// At each eigenvalue s of `A_f` (of a conjugate pair the one above) the null space of [A - s I,
/// `F_a` N; C, 0], rows and columns scaled to length one. For a complex s one combination is given.
pub(crate) fn hidden_faults(plant: &FaultyPlant) -> Result<Vec<Hidden>, Error> {
    let mut found = Vec::new();
    for at in developments(&plant.a_f)? {
        let directions = eigenvectors(&plant.a_f, at)?;
        let pencil = pencil(plant, at, &directions);
        let (scaled, columns) = level(&pencil);
        let (rank, null) = null_space(&scaled)?;
        let null = Complexes::from_fn(null.nrows(), null.ncols(), |i, j| null[(i, j)] / columns[i]);
        let n = plant.a.nrows();
        let faults = &directions * null.rows(n, directions.ncols());
        for (fault, state) in eliminated(faults, null.rows(0, n).into()) {
            let (channels, expected) = (directions.ncols(), pencil.ncols());
            found.push(Hidden { at, channels, rank, expected, fault, state });
        }
    }
    Ok(found)
}

/// The distinct eigenvalues of `A_f`, those of a cluster averaged, none below the real axis.
fn developments(a_f: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, Error> {
    let same = SAME * a_f.norm();
    let mut clusters: Vec<(Complex<f64>, f64)> = Vec::new();
    for value in eigenvalues(a_f)? {
        match clusters.iter_mut().find(|(sum, count)| (*sum / *count - value).norm() <= same) {
            Some((sum, count)) => (*sum, *count) = (*sum + value, *count + 1.0),
            None => clusters.push((value, 1.0)),
        }
    }
    let averages = clusters.into_iter().map(|(sum, count)| sum / count);
    Ok(averages.filter(|average| average.im >= 0.0).collect())
}

/// The null space of `A_f` - s I.
fn eigenvectors(a_f: &DMatrix<f64>, s: Complex<f64>) -> Result<Complexes, Error> {
    let q = a_f.nrows();
    let size = a_f.norm() + s.norm();
    if size <= 0.0 {
        return Ok(Complexes::identity(q, q));
    }
    let shifted = complex(a_f) - Complexes::identity(q, q) * s;
    let mut found = Vec::new();
    for index in 0..q {
        let (value, vector) = smallest(&shifted, index)?;
        if value > TOLERANCE * size {
            break;
        }
        found.push(vector);
    }
    Ok(Complexes::from_fn(q, found.len(), |i, j| found[j][i]))
}

/// [A - s I, `F_a` N; C, 0].
fn pencil(plant: &FaultyPlant, s: Complex<f64>, directions: &Complexes) -> Complexes {
    let (n, p) = (plant.a.nrows(), plant.c.nrows());
    let mut m = Complexes::zeros(n + p, n + directions.ncols());
    let shifted = complex(&plant.a) - Complexes::identity(n, n) * s;
    m.view_mut((0, 0), (n, n)).copy_from(&shifted);
    m.view_mut((0, n), (n, directions.ncols())).copy_from(&(complex(&plant.f_a) * directions));
    m.view_mut((n, 0), (p, n)).copy_from(&complex(&plant.c));
    m
}

fn complex(m: &DMatrix<f64>) -> Complexes {
    m.map(|entry| Complex::new(entry, 0.0))
}

/// Rows, then columns scaled to length one, so that units do not decide a rank; and the lengths of
/// the columns.
fn level(m: &Complexes) -> (Complexes, Vec<f64>) {
    let length = |norm: f64| if norm > 0.0 { norm } else { 1.0 };
    let mut scaled = m.clone();
    for mut row in scaled.row_iter_mut() {
        let norm = length(row.norm());
        row.unscale_mut(norm);
    }
    let lengths: Vec<f64> = scaled.column_iter().map(|column| length(column.norm())).collect();
    for (mut column, length) in scaled.column_iter_mut().zip(&lengths) {
        column.unscale_mut(*length);
    }
    (scaled, lengths)
}

/// The rank, and columns that span the null space; for a matrix that is not real one of them.
fn null_space(m: &Complexes) -> Result<(usize, Complexes), Error> {
    let cols = m.ncols();
    if m.iter().all(|entry| entry.im.abs() <= 0.0) {
        let s = Singular::of(&m.map(|entry| entry.re))?;
        let rank = s.rank(TOLERANCE);
        return Ok((rank, complex(&s.right.columns(rank, cols - rank).into())));
    }
    let largest = smallest(m, cols - 1)?.0;
    let mut null = 0;
    while null < cols && smallest(m, null)?.0 <= TOLERANCE * largest {
        null += 1;
    }
    let kept = null.min(1);
    let vector = smallest(m, 0)?.1;
    Ok((cols - null, Complexes::from_fn(cols, kept, |i, _| vector[i])))
}

/// Combines the columns so that each has a fault that the others lack; those without faults, which
/// are modes that no measurement shows, are left out.
fn eliminated(mut faults: Complexes, mut states: Complexes) -> Vec<(ComplexColumn, ComplexColumn)> {
    let zero = PART * faults.norm();
    let mut kept: Vec<usize> = Vec::new();
    for column in 0..faults.ncols() {
        let row = faults.column(column).icamax();
        let pivot = faults[(row, column)];
        if pivot.norm() <= zero {
            continue;
        }
        for m in [&mut faults, &mut states] {
            m.column_mut(column).apply(|entry| *entry /= pivot);
        }
        for other in (0..faults.ncols()).filter(|&other| other != column) {
            let factor = faults[(row, other)];
            for m in [&mut faults, &mut states] {
                let step = m.column(column) * factor;
                m.column_mut(other).zip_apply(&step, |entry, part| *entry -= part);
            }
        }
        kept.push(column);
    }
    let pair = |&at: &usize| (faults.column(at).into_owned(), states.column(at).into_owned());
    kept.iter().map(pair).collect()
}
