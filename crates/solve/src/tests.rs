//! Tests of the solvers on loops with a known solution.

use super::*;

/// Returns the solution and the last progress. Difference quotients of `g` give the matrix dG/du.
fn solve(
    solver: &mut dyn Solver,
    start: &[f64],
    g: &dyn Fn(&[f64]) -> Vec<f64>,
) -> (Vec<f64>, Progress) {
    let (mut u, mut next) = (start.to_vec(), vec![0.0; start.len()]);
    solver.begin();
    loop {
        let value = g(&u);
        let mut progress = solver.next(&u, &value, &mut next);
        if progress == Progress::Matrix {
            for column in 0..u.len() {
                let size = solver.perturbation(column, &u);
                let mut moved = u.clone();
                moved[column] += size;
                let change: Vec<_> =
                    g(&moved).iter().zip(&value).map(|(a, b)| (a - b) / size).collect();
                solver.set_column(column, &change);
            }
            progress = solver.next(&u, &value, &mut next);
        }
        match progress {
            Progress::Evaluate => u.copy_from_slice(&next),
            end => return (u, end),
        }
    }
}

fn scale(n: usize) -> Scale {
    Scale::new(1e-10, 1e-10, vec![1.0; n])
}

fn all(n: usize, limit: u32) -> [(&'static str, Box<dyn Solver>); 3] {
    [
        ("newton", Box::new(Newton::new(scale(n), limit))),
        ("anderson", Box::new(Anderson::new(scale(n), limit, n))),
        ("quasi-newton", Box::new(QuasiNewton::new(scale(n), limit, 5))),
    ]
}

fn assert_near(name: &str, actual: &[f64], expected: &[f64], bound: f64) {
    for (actual, expected) in actual.iter().zip(expected) {
        assert!((actual - expected).abs() <= bound, "{name}: {actual} for {expected}");
    }
}

fn evaluations(progress: Progress) -> u32 {
    match progress {
        Progress::Converged { iterations } => iterations,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_scalar_loop_is_solved_for_any_gain() {
    for gain in [-1e6, -1000.0, -3.0, -1.0, 0.0, 0.5, 0.999, 1.5, 30.0, 1e6] {
        // u = 2 + gain u
        let expected = 2.0 / (1.0 - gain);
        for (name, mut solver) in all(1, 10) {
            let (u, end) = solve(&mut *solver, &[0.3], &|u| vec![2.0 + gain * u[0]]);
            let count = evaluations(end);
            assert_near(name, &u, &[expected], 1e-9 * (1.0 + expected.abs()));
            assert!(count <= 5, "{name}, gain {gain}: {count}");
        }
    }
}

#[test]
fn a_linear_loop_of_two_has_the_solution_computed_by_hand() {
    // u1 = 1 + 4 u2, u2 = 2 - 3 u1: 13 u1 = 9, 13 u2 = -1; spectral radius sqrt(12).
    for (name, mut solver) in all(2, 10) {
        let g = |u: &[f64]| vec![1.0 + 4.0 * u[1], 2.0 - 3.0 * u[0]];
        let (u, end) = solve(&mut *solver, &[0.0, 0.0], &g);
        assert_near(name, &u, &[9.0 / 13.0, -1.0 / 13.0], 1e-9);
        assert!(evaluations(end) <= 6, "{name}: {end:?}");
    }
}

/// Returns M and b of `G(u) = M u + b`, M with pseudo-random entries between -size and size.
fn scattered(n: usize, size: f64) -> (nalgebra::DMatrix<f64>, nalgebra::DVector<f64>) {
    let mut state = 11_u64;
    let mut draw = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        f64::from(u32::try_from(state >> 32).unwrap()) / f64::from(u32::MAX) * 2.0 - 1.0
    };
    let matrix = nalgebra::DMatrix::from_fn(n, n, |_, _| size * draw());
    (matrix, nalgebra::DVector::from_fn(n, |_, _| draw()))
}

#[test]
fn linear_loops_of_one_to_fifty_unknowns_have_the_solution_of_the_library() {
    for n in [1, 2, 3, 5, 10, 20, 50] {
        let (matrix, right) = scattered(n, 2.0);
        let whole = nalgebra::DMatrix::identity(n, n) - &matrix;
        let expected = whole.lu().solve(&right).unwrap();
        let g = |u: &[f64]| {
            (&matrix * nalgebra::DVector::from_column_slice(u) + &right).as_slice().to_vec()
        };
        for (name, mut solver) in all(n, u32::try_from(3 * n + 10).unwrap()) {
            let (u, end) = solve(&mut *solver, &vec![0.0; n], &g);
            let name = format!("{name}, n = {n}, {end:?}");
            assert!(matches!(end, Progress::Converged { .. }), "{name}");
            assert_near(&name, &u, expected.as_slice(), 1e-7 * expected.amax());
        }
    }
}

#[test]
fn plain_iteration_diverges_on_the_loops_that_these_solve() {
    let (matrix, right) = scattered(10, 2.0);
    let mut u = nalgebra::DVector::zeros(10);
    for _ in 0..50 {
        u = &matrix * u + &right;
    }
    assert!(u.amax() > 1e10);
}

#[test]
fn nominals_make_the_solution_independent_of_units() {
    // Pa against m3/s: u1 = 2e5 - 3e10 u2, u2 = 1e-5 + 1e-10 u1.
    let expected = [(2e5 - 3e10 * 1e-5) / 4.0, 1e-5 + 1e-10 * (2e5 - 3e5) / 4.0];
    let scale = || Scale::new(1e-10, 1e-10, vec![1e5, 1e-5]);
    let solvers: [(&str, Box<dyn Solver>); 3] = [
        ("newton", Box::new(Newton::new(scale(), 10))),
        ("anderson", Box::new(Anderson::new(scale(), 10, 2))),
        ("quasi-newton", Box::new(QuasiNewton::new(scale(), 10, 0))),
    ];
    for (name, mut solver) in solvers {
        let g = |u: &[f64]| vec![2e5 - 3e10 * u[1], 1e-5 + 1e-10 * u[0]];
        let (u, _) = solve(&mut *solver, &[0.0, 0.0], &g);
        assert_near(name, &u[..1], &expected[..1], 1e-4);
        assert_near(name, &u[1..], &expected[1..], 1e-14);
    }
}

#[test]
fn nonlinear_loops_are_solved() {
    // u = cos(u), Dottie's number; u1 = 1 - 10 u2^3, u2 = tanh(u1): 1 - u1 = 10 tanh(u1)^3.
    for (name, mut solver) in all(1, 30) {
        let (u, _) = solve(&mut *solver, &[0.0], &|u| vec![u[0].cos()]);
        assert_near(name, &u, &[0.739_085_133_215_160_6], 1e-9);
    }
    for (name, mut solver) in all(2, 60) {
        let g = |u: &[f64]| vec![1.0 - 10.0 * u[1].powi(3), u[0].tanh()];
        let (u, end) = solve(&mut *solver, &[0.0, 0.0], &g);
        assert!(matches!(end, Progress::Converged { .. }), "{name}: {end:?}");
        assert!((1.0 - u[0] - 10.0 * u[0].tanh().powi(3)).abs() < 1e-7, "{name}: {u:?}");
    }
}

#[test]
fn newton_halves_a_step_that_overshoots() {
    // u - G(u) = atan(u): undamped Newton diverges from |u| > 1.3917.
    let mut newton = Newton::new(scale(1), 40);
    let (u, end) = solve(&mut newton, &[20.0], &|u| vec![u[0] - u[0].atan()]);
    assert!(matches!(end, Progress::Converged { .. }), "{end:?}");
    assert_near("newton", &u, &[0.0], 1e-9);
}

#[test]
fn newton_keeps_its_matrix_and_asks_for_a_new_one_when_it_no_longer_serves() {
    let mut newton = Newton::new(scale(1), 20);
    let mut solved = |gain: f64, start: f64| {
        let (mut u, mut next, mut matrices) = ([start], [0.0], 0);
        newton.begin();
        loop {
            match newton.next(&u, &[1.0 + gain * u[0]], &mut next) {
                Progress::Evaluate => u = next,
                Progress::Matrix => {
                    matrices += 1;
                    newton.set_column(0, &[gain]);
                }
                Progress::Converged { .. } => return (u[0], matrices),
                other => panic!("{other:?}"),
            }
        }
    };
    assert_eq!(solved(-5.0, 0.0), (1.0 / 6.0, 1));
    assert_eq!(solved(-5.0, 7.0).1, 0);
    let (u, matrices) = solved(40.0, 0.0);
    assert!((u + 1.0 / 39.0).abs() < 1e-12);
    assert_eq!(matrices, 1);
}

#[test]
fn quasi_newton_reuses_differences_in_the_next_solution() {
    let (matrix, right) = scattered(5, 2.0);
    let mut solver = QuasiNewton::new(scale(5), 30, 5);
    let mut counts = Vec::new();
    for shift in [0.0, 0.1, 0.2] {
        let g = |u: &[f64]| {
            let u = nalgebra::DVector::from_column_slice(u);
            (&matrix * u + &right).add_scalar(shift).as_slice().to_vec()
        };
        counts.push(evaluations(solve(&mut solver, &[0.0; 5], &g).1));
    }
    assert!(counts[0] >= 6 && counts[1] <= 3 && counts[2] <= 3, "{counts:?}");
    solver.forget();
    let g = |u: &[f64]| vec![0.5; u.len()];
    assert!(evaluations(solve(&mut solver, &[0.0; 5], &g).1) > 2);
}

#[test]
fn a_loop_without_a_solution_is_no_convergence() {
    // u = u + 1.
    let ends: Vec<_> = all(1, 20)
        .into_iter()
        .map(|(_, mut solver)| solve(&mut *solver, &[0.0], &|u| vec![u[0] + 1.0]).1)
        .collect();
    assert!(matches!(ends[0], Progress::Singular { .. }), "{ends:?}");
    for end in &ends[1..] {
        assert!(matches!(end, Progress::NotConverged { iterations: 20, .. }), "{ends:?}");
    }
}

#[test]
fn values_that_are_not_finite_end_the_iteration() {
    for bad in [f64::NAN, f64::INFINITY] {
        for (name, mut solver) in all(2, 20) {
            let (_, end) = solve(&mut *solver, &[1.0, 1.0], &|_| vec![0.0, bad]);
            assert_eq!(end, Progress::Diverged { iterations: 1 }, "{name}");
        }
    }
    let mut newton = Newton::new(scale(1), 20);
    let mut next = [0.0];
    newton.begin();
    assert_eq!(newton.next(&[0.0], &[1.0], &mut next), Progress::Matrix);
    newton.set_column(0, &[f64::NAN]);
    let end = newton.next(&[0.0], &[1.0], &mut next);
    assert_eq!(end, Progress::Singular { condition: f64::INFINITY });
}

#[test]
fn the_distance_counts_each_component_by_its_nominal() {
    let scale = Scale::new(0.01, 0.1, vec![1.0, 100.0]);
    // |1| / (0.1 + 0.01 * 3), |5| / (10 + 0.01 * 5)
    assert!((scale.distance(&[2.0, 0.0], &[3.0, 5.0]) - 1.0 / 0.13).abs() < 1e-12);
    assert!((scale.distance(&[3.0, 0.0], &[3.0, 5.0]) - 5.0 / 10.05).abs() < 1e-12);
    assert!(scale.distance(&[f64::NAN, 0.0], &[3.0, 5.0]).is_infinite());
    assert!(Scale::new(0.0, 0.0, vec![0.0, f64::NAN]).distance(&[0.0; 2], &[0.0; 2]) == 0.0);
}
