//! Case study `CS2_1`: faults of air data sensors, one constant gain for all masses.

use crate::matrices;
use control::isolation::{DisturbedPlant, Requirements, residual_generator};
use control::lmi::{ConstantGain, constant_gain};
use control::response::h_infinity;
use control::{Domain, StateSpace};
use nalgebra::DMatrix;
use std::error::Error;

const FILE: &str = include_str!("../../tests/data/air_data_sensors.txt");
/// The nominal model, from 0.
pub(crate) const NOMINAL: usize = 6;
pub(crate) const MODELS: usize = 11;
/// The measurements whose sensors may fail, from 0: angle of attack, calibrated airspeed.
const FAULTS: [usize; 2] = [1, 3];
/// Number of commands; the other inputs are winds.
const COMMANDS: usize = 3;

/// The model with that index as a plant.
pub(crate) fn plant(index: usize) -> Result<DisturbedPlant, Box<dyn Error>> {
    let StateSpace { a, b, c, d, domain } = matrices::model(FILE, index + 1)?;
    let winds = b.ncols() - COMMANDS;
    Ok(DisturbedPlant {
        b_u: b.columns(0, COMMANDS).into_owned(),
        b_d: b.columns(COMMANDS, winds).into_owned(),
        b_f: DMatrix::zeros(a.nrows(), FAULTS.len()),
        d_u: d.columns(0, COMMANDS).into_owned(),
        d_d: d.columns(COMMANDS, winds).into_owned(),
        d_f: DMatrix::identity(c.nrows(), c.nrows()).select_columns(&FAULTS),
        a,
        c,
        domain,
    })
}

/// The exact static generator of one model, [y, u] to two residuals, each the estimate of one fault.
pub(crate) fn exact_gain(plant: &DisturbedPlant) -> Result<DMatrix<f64>, Box<dyn Error>> {
    let (p, m) = (plant.c.nrows(), plant.b_u.ncols());
    let mut gain = DMatrix::zeros(FAULTS.len(), p + m);
    for fault in 0..FAULTS.len() {
        let pattern: Vec<bool> = (0..FAULTS.len()).map(|other| other == fault).collect();
        let residual = residual_generator(plant, &pattern, &Requirements::with_pole(-5.0))?;
        if residual.generator.a.nrows() > 0 {
            return Err("the residual generator is not static".into());
        }
        gain.view_mut((fault, 0), (1, p)).copy_from(&residual.generator.d_y);
        gain.view_mut((fault, p), (1, m)).copy_from(&residual.generator.d_u);
    }
    Ok(gain)
}

/// From [u; d; f] to [y; u].
fn extended(plant: &DisturbedPlant) -> StateSpace {
    let (p, m) = (plant.c.nrows(), plant.b_u.ncols());
    let beside = |parts: [&DMatrix<f64>; 3]| {
        let columns: Vec<_> = parts.iter().flat_map(|part| part.column_iter()).collect();
        DMatrix::from_columns(&columns)
    };
    let mut d = beside([&plant.d_u, &plant.d_d, &plant.d_f]).resize_vertically(p + m, 0.0);
    d.view_mut((p, 0), (m, m)).fill_with_identity();
    let c = plant.c.clone().resize_vertically(p + m, 0.0);
    let b = beside([&plant.b_u, &plant.b_d, &plant.b_f]);
    StateSpace { a: plant.a.clone(), b, c, d, domain: Domain::Continuous }
}

/// [0, 0, I]: the response of an exact fault estimate to [u; d; f].
fn target(plant: &DisturbedPlant) -> DMatrix<f64> {
    let others = plant.b_u.ncols() + plant.b_d.ncols();
    let mut target = DMatrix::zeros(FAULTS.len(), others + FAULTS.len());
    target.columns_mut(others, FAULTS.len()).fill_with_identity();
    target
}

/// H-infinity norm of the error of the fault estimate of a constant gain.
pub(crate) fn error(plant: &DisturbedPlant, gain: &DMatrix<f64>) -> Result<f64, Box<dyn Error>> {
    let system = extended(plant);
    let d = gain * &system.d - target(plant);
    let error = StateSpace { c: gain * &system.c, d, ..system };
    Ok(h_infinity(&error, 1e-6)?.lower)
}

/// The constant gain with the least worst error; its entries for the two monitored sensors are those of
/// an exact response to their faults.
pub(crate) fn best_gain(plants: &[DisturbedPlant]) -> Result<ConstantGain, Box<dyn Error>> {
    let family: Vec<StateSpace> = plants.iter().map(extended).collect();
    let mut fixed = Vec::new();
    for (row, _) in FAULTS.iter().enumerate() {
        for (at, &sensor) in FAULTS.iter().enumerate() {
            fixed.push((row, sensor, if row == at { 1.0 } else { 0.0 }));
        }
    }
    Ok(constant_gain(&family, &target(&plants[NOMINAL]), &fixed, 1e-3)?)
}
