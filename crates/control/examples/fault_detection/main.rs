//! Two published case studies of fault detection, beside the published figures: A. Varga, Solving fault
//! diagnosis problems, chapter 8, `CS1_1` (flight actuators) and `CS2_1` (air data sensors).
//!
//! `cargo run --release -p aso-control --features lmi --example fault_detection`. Ends with status 1 if a figure
//! is missed.
#![expect(clippy::print_stdout, reason = "the result of the example is what it prints")]

mod actuators;
mod matrices;
mod sensors;

use control::isolation::{achievable_patterns, structure};
use std::error::Error;
use std::process::ExitCode;

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let mut missed = 0;
    flight_actuators(&mut missed)?;
    air_data_sensors(&mut missed)?;
    println!("\n{missed} figures missed");
    Ok(if missed > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Prints a figure beside the published one; counts it if it is missed.
fn compare(what: &str, published: &str, computed: &str, reached: bool, missed: &mut u32) {
    println!(
        "{what:<68} {published:>14} {computed:>14}  {}",
        if reached { "reached" } else { "MISSED" }
    );
    *missed += u32::from(!reached);
}

fn flight_actuators(missed: &mut u32) -> Result<(), Box<dyn Error>> {
    println!("CS1_1: faults of flight actuators{:<34} {:>14} {:>14}", "", "published", "here");
    let nominal = actuators::plant(actuators::NOMINAL)?;
    let residuals = actuators::residuals(&nominal)?;
    let matrix = structure(&residuals, 0.0, 1e-3)?;
    let matched = matrix.iter().zip(&actuators::PATTERNS).all(|(row, pattern)| {
        row.iter().zip(pattern).all(|(reacts, expected)| u8::from(*reacts) == *expected)
    });
    let shown = if matched { "matched" } else { "differs" };
    compare("structure matrix, constant faults", "matched", shown, matched, missed);
    let norms = actuators::norms(&nominal, &residuals)?;
    for (what, norm) in ["commands", "winds", "faults, less the design"].iter().zip(norms) {
        let what = format!("nominal closed loop, H-infinity norm from {what}");
        compare(&what, "< 1e-6", &format!("{norm:.1e}"), norm < 1e-6, missed);
    }
    let patterns = achievable_patterns(&nominal, &actuators::requirements())?;
    let strong = patterns.iter().filter(|pattern| pattern.strong).count();
    println!("achievable patterns: {}, for constant faults: {strong}", patterns.len());
    for (residual, pattern) in residuals.iter().zip(&actuators::PATTERNS) {
        let (order, (smallest, dropped)) = (residual.generator.a.nrows(), residual.rank_gap);
        let error = residual.decoupling_error;
        println!("pattern {pattern:?}: order {order}, decoupled to {error:.0e}");
        println!("  ranks decided between {dropped:.0e} and {smallest:.0e}");
    }
    println!("other masses, H-infinity norms from commands, winds, faults less the design:");
    for index in 0..actuators::MODELS {
        let [u, d, f] = actuators::norms(&actuators::plant(index)?, &residuals)?;
        println!("  model {:>2} {u:>10.2e} {d:>10.2e} {f:>10.2e}", index + 1);
    }
    Ok(())
}

/// Compares the errors of fault estimates with the published ones, for the aircraft at all masses: with the exact
/// static generator of each mass, that of the nominal mass, the mean of all, and the best constant one. An error is
/// the H-infinity norm from commands, winds and faults to the estimates less the faults.
fn air_data_sensors(missed: &mut u32) -> Result<(), Box<dyn Error>> {
    println!("\nCS2_1: faults of air data sensors{:<34} {:>14} {:>14}", "", "published", "here");
    let plants: Vec<_> = (0..sensors::MODELS).map(sensors::plant).collect::<Result<_, _>>()?;
    let exact: Vec<_> = plants.iter().map(sensors::exact_gain).collect::<Result<_, _>>()?;
    let over_family = |gain: &nalgebra::DMatrix<f64>| -> Result<Vec<f64>, Box<dyn Error>> {
        plants.iter().map(|plant| sensors::error(plant, gain)).collect()
    };
    let worst = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
    let each: Vec<f64> = plants
        .iter()
        .zip(&exact)
        .map(|(plant, gain)| sensors::error(plant, gain))
        .collect::<Result<_, _>>()?;
    let nominal = over_family(&exact[sensors::NOMINAL])?;
    let sum = exact.iter().skip(1).fold(exact[0].clone(), |sum, gain| sum + gain);
    #[expect(clippy::cast_precision_loss, reason = "eleven")]
    let mean = over_family(&(sum / plants.len() as f64))?;
    let best = sensors::best_gain(&plants)?;
    let error = worst(&each);
    compare(
        "worst error, a gain for each mass",
        "< 1e-7",
        &format!("{error:.1e}"),
        error < 1e-7,
        missed,
    );
    let error = worst(&nominal);
    let close = (error - 643.56).abs() < 0.01;
    compare("worst error, the nominal gain", "> 643", &format!("{error:.2}"), close, missed);
    let error = worst(&mean);
    compare(
        "worst error, the mean of the gains",
        "> 504",
        &format!("{error:.2}"),
        error > 504.0,
        missed,
    );
    let error = best.worst;
    compare(
        "worst error, the best constant gain",
        "0.76",
        &format!("{error:.4}"),
        error < 0.77,
        missed,
    );
    println!("no constant gain is below {:.4}", best.lower_bound);
    println!(
        "errors of the models: a gain for each mass, nominal gain, mean gain, best constant gain"
    );
    for index in 0..sensors::MODELS {
        let (a, b, c, d) = (each[index], nominal[index], mean[index], best.norms[index]);
        println!("  model {:>2} {a:>10.2e} {b:>10.2} {c:>10.2} {d:>10.4}", index + 1);
    }
    Ok(())
}
