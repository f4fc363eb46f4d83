//! Solvers, controllers and brackets allocate no memory in the stepping loop.

use solve::{
    Anderson, Bond, Bracket, EnergyControl, ErrorControl, ForwardControl, Newton, Progress,
    QuasiNewton, Scale, SizeBounds, Solver,
};

/// Computes `g_i = 0.3 - 3 tanh(u_(i+1) + 0.1 u_i)`, a ring with gains up to 3.
fn ring(u: &[f64], g: &mut [f64]) {
    for (index, value) in g.iter_mut().enumerate() {
        let other = u[(index + 1) % u.len()];
        *value = 0.3 - 3.0 * (other + 0.1 * u[index]).tanh();
    }
}

/// Computes several solutions in a row and returns how many converged.
fn solve(solver: &mut dyn Solver, buffers: &mut [Vec<f64>; 4], solutions: usize) -> usize {
    let [u, g, next, column] = buffers;
    let mut converged = 0;
    for _ in 0..solutions {
        u.fill(0.1);
        solver.begin();
        let end = loop {
            ring(u, g);
            let mut progress = solver.next(u, g, next);
            if progress == Progress::Matrix {
                for index in 0..u.len() {
                    let (before, size) = (u[index], solver.perturbation(index, u));
                    u[index] += size;
                    ring(u, column);
                    u[index] = before;
                    column.iter_mut().zip(&*g).for_each(|(new, old)| *new = (*new - old) / size);
                    solver.set_column(index, column);
                }
                progress = solver.next(u, g, next);
            }
            match progress {
                Progress::Evaluate => u.copy_from_slice(next),
                end => break end,
            }
        };
        converged += usize::from(matches!(end, Progress::Converged { .. }));
    }
    converged
}

#[test]
fn no_solver_allocates_between_begin_and_end() {
    const N: usize = 8;
    let scale = || Scale::new(1e-8, 1e-8, vec![1.0; N]);
    let solvers: [Box<dyn Solver>; 3] = [
        Box::new(Newton::new(scale(), 100)),
        Box::new(Anderson::new(scale(), 100, 5)),
        Box::new(QuasiNewton::new(scale(), 100, 3)),
    ];
    for (number, mut solver) in solvers.into_iter().enumerate() {
        let mut buffers = std::array::from_fn(|_| vec![0.0; N]);
        let mut converged = 0;
        let measured = allocation_counter::measure(|| {
            converged = solve(&mut *solver, &mut buffers, 20);
        });
        assert_eq!(measured.count_total, 0, "solver {number}");
        assert_eq!(converged, 20, "solver {number}");
    }
}

#[test]
fn no_controller_and_no_bracket_allocates() {
    let bounds = SizeBounds { smallest: 1e-6, largest: 1.0 };
    let mut error = ErrorControl::new(bounds, 2.0);
    let mut forward = ForwardControl::new(bounds, 1.0);
    let mut energy = EnergyControl::new(bounds, 1.0, 1e-3, 1e-6, &[1.0, 1.0]);
    let bonds = [Bond { first: (1.0, 1.1), second: (2.0, 2.2) }; 2];
    let measured = allocation_counter::measure(|| {
        let _ = error.judge(0.1, 3.0);
        let _ = forward.next(0.1, 3.0);
        let _ = energy.next(0.1, &bonds);
        let mut bracket = Bracket::new((0.0, -1.0), (1.0, 2.0), 1e-9).unwrap();
        while let Some(time) = bracket.ask() {
            bracket.tell(time, time * time - 0.5);
        }
        assert!((bracket.after() - f64::sqrt(0.5)).abs() < 1e-8);
    });
    assert_eq!(measured.count_total, 0);
}
