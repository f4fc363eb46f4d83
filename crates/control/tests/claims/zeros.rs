use crate::data::reference;
use crate::{integers, matrix};
use control::zeros::zeros;
use nalgebra::{Complex, DMatrix, DVector};

/// The example of `AB08ND` in SLICOT 5: six states, two inputs, three outputs.
pub(crate) fn slicot() -> (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>) {
    let a = DMatrix::from_diagonal(&DVector::from_vec(vec![1., 1., 3., -4., -1., 3.]));
    let b = matrix(6, 2, &[0., -1., -1., 0., 1., -1., 0., 0., 0., 1., -1., -1.]);
    let c = [
        1., 0., 0., 1., 0., 0., //
        0., 1., 0., 1., 0., 1., //
        0., 0., 1., 0., 0., 1.,
    ];
    (a, b, matrix(3, 6, &c))
}

fn assert_zeros(zeros: &[Complex<f64>], expected: &[Complex<f64>], allowed: f64) {
    assert_eq!(zeros.len(), expected.len(), "{zeros:?}");
    for zero in expected {
        let nearest = zeros.iter().map(|x| (x - zero).norm()).fold(f64::INFINITY, f64::min);
        assert!(nearest < allowed * zero.norm().max(1.0), "{zero}: {zeros:?}");
    }
}

/// Finite invariant zeros 2 and -1; the latter is an unobservable mode.
#[test]
fn the_example_of_slicot_has_its_published_zeros() {
    let (a, b, c) = slicot();
    let actual = zeros(&a, &b, &c).unwrap();
    assert_zeros(&actual.finite, &[Complex::new(-1.0, 0.0), Complex::new(2.0, 0.0)], 1e-12);
    assert_eq!(actual.rank, 2);
    let dual = zeros(&a.transpose(), &c.transpose(), &b.transpose()).unwrap();
    assert_zeros(&dual.finite, &[Complex::new(-1.0, 0.0), Complex::new(2.0, 0.0)], 1e-12);
}

#[test]
fn square_systems_have_the_zeros_that_scipy_finds() {
    for case in 0..3 {
        let of = |part: &str| reference(&format!("zeros_{case}{part}"));
        let actual = zeros(&of("_a"), &of("_b"), &of("_c")).unwrap();
        let expected: Vec<_> =
            of("").column_iter().map(|zero| Complex::new(zero[0], zero[1])).collect();
        assert_zeros(&actual.finite, &expected, 1e-9);
        assert_eq!(actual.rank, of("_b").ncols());
    }
}

/// Units of states, inputs and outputs from 1e-9 to 1e12.
#[test]
fn units_do_not_move_the_zeros() {
    let units = DMatrix::from_diagonal(&DVector::from_vec(vec![1., 1e6, 1e-9, 1e12, 1e3, 1.]));
    let inverse = units.map(|unit| if unit > 0.0 { 1.0 / unit } else { 0.0 });
    let of = |part: &str| reference(&format!("zeros_1{part}"));
    let actual =
        zeros(&(&units * of("_a") * &inverse), &(&units * of("_b") * 1e7), &(of("_c") * inverse));
    let expected: Vec<_> =
        of("").column_iter().map(|zero| Complex::new(zero[0], zero[1])).collect();
    assert_zeros(&actual.unwrap().finite, &expected, 1e-9);
}

/// With two copies of one input, combinations that cancel have no effect; the zeros are those of
/// one copy.
#[test]
fn a_transfer_function_without_full_rank_is_reported() {
    let a = integers(5, 5, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5);
    let b = matrix(5, 1, &[1., 0., 2., -1., 1.]);
    let c = matrix(1, 5, &[0., 1., 1., 0., -3.]);
    let one = zeros(&a, &b, &c).unwrap();
    let two = zeros(&a, &DMatrix::from_columns(&[b.column(0), b.column(0)]), &c).unwrap();
    assert_eq!((one.rank, two.rank), (1, 1));
    assert_zeros(&two.finite, &one.finite, 1e-9);
    let none = zeros(&a, &DMatrix::zeros(5, 1), &c).unwrap();
    assert_eq!(none.rank, 0);
}
