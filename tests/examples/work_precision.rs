//! Computes the error over the number of steps, for fixed steps and for every step control.
//!
//! `cargo run --release -p tests --example work_precision > docs/figures/work_precision.csv`, then
//! `python scripts/study/work_precision.py` draws the figure.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a program for the table it prints")]

use master::algorithm::PowerBond;
use master::{Algorithm, Extrapolation, Method, StepControl};
use tests::linear::ABLE;
use tests::network::{Network, Run};
use tests::problems;

use StepControl::{Doubling, Embedded, Energy, Increment};

/// Length of every run in s.
const STOP: f64 = 5.0;

fn print(problem: &str, control: StepControl, parameter: f64, run: &Run) {
    let (control, Run { points, calls, error, .. }) = (control.name(), run);
    println!("{problem},{control},{parameter:e},{points},{calls},{error:.4e}");
}

fn study(problem: &str, network: &Network, bonds: &[PowerBond]) {
    let fixed = |step: f64| Algorithm::fixed(Method::GaussSeidel, Extrapolation::Linear, step);
    for power in 6..=14 {
        let step = STOP / 2.0_f64.powi(power);
        print(problem, StepControl::Fixed, step, &network.run(ABLE, &fixed(step), STOP).unwrap());
    }
    for control in [Doubling, Embedded, Increment, Energy] {
        // `increment` bounds the change in a step by the tolerance, the others bound an error.
        let powers = if control == Increment { 2..=7 } else { 4..=14 };
        for power in powers {
            let tolerance = 10.0_f64.powf(-0.5 * f64::from(power));
            let algorithm = Algorithm {
                control,
                relative_tolerance: tolerance,
                absolute_tolerance: tolerance,
                largest_step: 1.0,
                smallest_step: 1e-9,
                bonds: bonds.to_vec(),
                ..fixed(1e-4)
            };
            if control != Energy || !bonds.is_empty() {
                let run = network.run(ABLE, &algorithm, STOP).unwrap();
                print(problem, control, tolerance, &run);
            }
        }
    }
}

fn main() {
    println!("problem,step control,step in s or tolerance,steps,fmi2DoStep,largest error");
    study("transient", &problems::transient(), &[]);
    let masses = problems::two_masses(1e3, 20.0);
    let system = masses.system(ABLE, &std::sync::Arc::default());
    let (first, second) = (system.port("b.u1").unwrap(), system.port("a.u0").unwrap());
    study("two masses", &masses, &[PowerBond { first, second }]);
}
