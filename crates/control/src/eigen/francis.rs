//! Eigenvalues without vectors: the QR algorithm on a Hessenberg matrix.

use super::pair;
use nalgebra::{Complex, DMatrix};
use std::ops::Range;

/// Largest number of sweeps for one eigenvalue or pair; three or four are usual.
const SWEEPS: usize = 120;
/// Interval between exceptional shifts, in sweeps without a result.
const EXCEPTIONAL: usize = 10;

/// Computes the eigenvalues of an upper Hessenberg matrix, in no particular order; None if the
/// algorithm does not converge.
///
/// Implicit double-shift QR steps (Francis) on the part that has not been deflated. Rows and columns
/// outside of this part do not change the eigenvalues and are not updated, so that a matrix of order n
/// needs about 6 n^3 operations, a quarter of what the Schur form with its vectors needs. A
/// subdiagonal entry counts as zero by the criterion of M. Ahues and F. Tisseur (LAPACK Working Note
/// 122, 1997). Entries below the subdiagonal must be zero up to rounding: the bulge is added to them.
///
/// Source: J. G. F. Francis, The QR transformation, part 2, Comput. J. 4 (1962); exceptional shifts: LAPACK's `dlahqr`.
pub(super) fn eigenvalues(mut h: DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    let n = h.nrows();
    let smallest = f64::MIN_POSITIVE / f64::EPSILON;
    let mut eigenvalues = Vec::with_capacity(n);
    let mut end = n;
    while end > 0 {
        let last = end - 1;
        let mut sweeps = 0;
        loop {
            let first = start_of_block(&h, last, smallest);
            if first > 0 {
                h[(first, first - 1)] = 0.0;
            }
            if first + 1 >= last {
                if first == last {
                    eigenvalues.push(Complex::new(h[(last, last)], 0.0));
                } else {
                    eigenvalues.extend(pair(&h, first));
                }
                end = first;
                break;
            }
            if sweeps == SWEEPS {
                return None;
            }
            sweeps += 1;
            let shift = Shift::new(&h, first, last, sweeps);
            sweep(&mut h, first, last, &shift);
        }
    }
    Some(eigenvalues)
}

/// Returns the first row of the block that ends in row `last` and has no negligible subdiagonal entry. Entries up to
/// `smallest` are always negligible.
fn start_of_block(h: &DMatrix<f64>, last: usize, smallest: f64) -> usize {
    for k in (1..=last).rev() {
        let below = h[(k, k - 1)].abs();
        if below <= smallest {
            return k;
        }
        let (here, before) = (h[(k, k)], h[(k - 1, k - 1)]);
        let mut size = here.abs() + before.abs();
        if size <= 0.0 {
            size += if k >= 2 { h[(k - 1, k - 2)].abs() } else { 0.0 };
            size += if k < last { h[(k + 1, k)].abs() } else { 0.0 };
        }
        if below <= f64::EPSILON * size {
            let above = h[(k - 1, k)].abs();
            let (large, small) = (below.max(above), below.min(above));
            let difference = (before - here).abs();
            let (wide, narrow) = (here.abs().max(difference), here.abs().min(difference));
            let sum = wide + large;
            let product = small * (large / sum);
            if product <= smallest.max(f64::EPSILON * (narrow * (wide / sum))) {
                return k;
            }
        }
    }
    0
}

/// The shifts real + i imaginary and real - i imaginary of a double QR step.
struct Shift {
    real: f64,
    /// The modulus of the imaginary part.
    imaginary: f64,
}

impl Shift {
    /// Returns the eigenvalues of the last 2 x 2 block as shifts; if they are real, twice the one nearer to the last
    /// entry. Every [`EXCEPTIONAL`] sweeps, returns the shifts of LAPACK that break cycles.
    fn new(h: &DMatrix<f64>, first: usize, last: usize, sweeps: usize) -> Self {
        if sweeps.is_multiple_of(EXCEPTIONAL) {
            let at_start = (sweeps / EXCEPTIONAL) % 2 == 1;
            let (corner, size) = if at_start {
                (h[(first, first)], h[(first + 1, first)].abs() + h[(first + 2, first + 1)].abs())
            } else {
                (h[(last, last)], h[(last, last - 1)].abs() + h[(last - 1, last - 2)].abs())
            };
            return Self { real: 0.75 * size + corner, imaginary: 0.4375_f64.sqrt() * size };
        }
        let corner = h[(last, last)];
        let [one, other] = pair(h, last - 1);
        let nearer = if (one.re - corner).abs() < (other.re - corner).abs() { one } else { other };
        Self { real: nearer.re, imaginary: nearer.im.abs() }
    }

    /// The direction of the first column of (H - s1 I) (H - s2 I) for the shifts s1 and s2 and the rows of H from `at`
    /// on. Differences are formed first: in a cluster of eigenvalues the products would cancel.
    fn column(&self, h: &DMatrix<f64>, at: usize) -> [f64; 3] {
        let (here, next) = (h[(at, at)] - self.real, h[(at + 1, at + 1)] - self.real);
        let (below, right) = (h[(at + 1, at)], h[(at, at + 1)]);
        let size = here.abs() + self.imaginary + below.abs();
        let column = [
            here * (here / size)
                + self.imaginary * (self.imaginary / size)
                + right * (below / size),
            (here + next) * (below / size),
            h[(at + 2, at + 1)] * (below / size),
        ];
        let size: f64 = column.iter().map(|entry| entry.abs()).sum();
        if size > 0.0 { column.map(|entry| entry / size) } else { column }
    }
}

/// One implicit double QR step on the rows and columns from `first` to `last`, at least three.
fn sweep(h: &mut DMatrix<f64>, first: usize, last: usize, shift: &Shift) {
    // The step may begin below two consecutive small subdiagonal entries.
    let mut start = last - 2;
    let mut column = shift.column(h, start);
    while start > first {
        let small = h[(start, start - 1)].abs() * (column[1].abs() + column[2].abs());
        let around = h[(start - 1, start - 1)].abs()
            + h[(start, start)].abs()
            + h[(start + 1, start + 1)].abs();
        if small <= f64::EPSILON * column[0].abs() * around {
            break;
        }
        start -= 1;
        column = shift.column(h, start);
    }
    for k in start..last {
        let has_third = k + 2 <= last;
        if k > start {
            let third = if has_third { h[(k + 2, k - 1)] } else { 0.0 };
            column = [h[(k, k - 1)], h[(k + 1, k - 1)], third];
        }
        let Some(reflection) = Reflection::new(column) else { continue };
        if k > start {
            h[(k, k - 1)] = reflection.image;
            h[(k + 1, k - 1)] = 0.0;
            if has_third {
                h[(k + 2, k - 1)] = 0.0;
            }
        } else if start > first {
            h[(k, k - 1)] *= 1.0 - reflection.weights[0];
        }
        let rows = first..(k + 3).min(last) + 1;
        if has_third {
            reflection.apply(h, k, last, rows);
        } else {
            reflection.apply_to_two(h, k, last, rows);
        }
    }
}

/// The reflection I - w (1, v)' with w = tau (1, v), which maps a vector to a multiple of the first axis.
struct Reflection {
    v: [f64; 2],
    weights: [f64; 3],
    /// The first component of the reflected vector.
    image: f64,
}

impl Reflection {
    /// The reflection of a vector; None if the vector is on the first axis, or not finite.
    fn new([first, second, third]: [f64; 3]) -> Option<Self> {
        let size = first.abs() + second.abs() + third.abs();
        if second.abs() + third.abs() <= 0.0 || !size.is_finite() {
            return None;
        }
        let [x, y, z] = [first / size, second / size, third / size];
        let image = -(x * x + y * y + z * z).sqrt().copysign(x);
        let tau = (image - x) / image;
        let v = [y / (x - image), z / (x - image)];
        Some(Self { v, weights: [tau, tau * v[0], tau * v[1]], image: image * size })
    }

    /// Reflects rows k to k + 2, from column k to `last`, then columns k to k + 2 in `rows`.
    fn apply(&self, h: &mut DMatrix<f64>, k: usize, last: usize, rows: Range<usize>) {
        let n = h.nrows();
        let ([v, w], [x, y, z]) = (self.v, self.weights);
        let entries = h.as_mut_slice();
        for column in entries[k * n..(last + 1) * n].chunks_exact_mut(n) {
            if let Some([a, b, c]) = column[k..].first_chunk_mut::<3>() {
                let sum = *a + v * *b + w * *c;
                *a -= sum * x;
                *b -= sum * y;
                *c -= sum * z;
            }
        }
        let (left, rest) = entries[k * n..(k + 3) * n].split_at_mut(n);
        let (middle, right) = rest.split_at_mut(n);
        let (left, middle, right) =
            (&mut left[rows.clone()], &mut middle[rows.clone()], &mut right[rows]);
        for ((a, b), c) in left.iter_mut().zip(middle).zip(right) {
            let sum = *a + v * *b + w * *c;
            *a -= sum * x;
            *b -= sum * y;
            *c -= sum * z;
        }
    }

    /// Reflects rows k and k + 1, from column k to `last`, then columns k and k + 1 in `rows`.
    fn apply_to_two(&self, h: &mut DMatrix<f64>, k: usize, last: usize, rows: Range<usize>) {
        let (v, [x, y, _]) = (self.v[0], self.weights);
        for column in k..=last {
            let sum = h[(k, column)] + v * h[(k + 1, column)];
            h[(k, column)] -= sum * x;
            h[(k + 1, column)] -= sum * y;
        }
        for row in rows {
            let sum = h[(row, k)] + v * h[(row, k + 1)];
            h[(row, k)] -= sum * x;
            h[(row, k + 1)] -= sum * y;
        }
    }
}
