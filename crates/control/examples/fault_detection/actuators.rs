//! Case study `CS1_1`: faults of flight actuators. No angle of a control surface is measured.

use crate::matrices;
use control::isolation::{DisturbedPlant, Requirements, Residual, residual_generator};
use control::{Domain, StateSpace};
use nalgebra::DMatrix;
use std::error::Error;

const FILE: &str = include_str!("../../tests/data/flight_actuators.txt");
/// The nominal model, from 0.
pub(crate) const NOMINAL: usize = 6;
pub(crate) const MODELS: usize = 11;
/// The surfaces whose actuators may fail, from 0: four ailerons, two elevators, stabiliser, rudder.
const FAULTS: [usize; 8] = [0, 1, 14, 15, 16, 18, 17, 19];
/// The rows of the structure matrix of the case study.
pub(crate) const PATTERNS: [[u8; 8]; 6] = [
    [0, 1, 1, 1, 1, 0, 1, 0],
    [1, 0, 1, 1, 0, 1, 1, 0],
    [1, 1, 0, 1, 1, 0, 1, 0],
    [1, 1, 1, 0, 1, 1, 0, 0],
    [1, 1, 1, 1, 0, 0, 0, 0],
    [0, 0, 0, 0, 0, 0, 0, 1],
];
/// Relative width of a computed norm.
const WIDTH: f64 = 1e-5;

/// The model with that index as a plant: aircraft and actuators in series.
pub(crate) fn plant(index: usize) -> Result<DisturbedPlant, Box<dyn Error>> {
    let aircraft = matrices::model(FILE, index + 1)?;
    let [a, b, c] =
        ["actuator_a", "actuator_b", "actuator_c"].map(|name| matrices::read(FILE, name));
    let (a, b, c) = (diagonal(&a?), diagonal(&b?), diagonal(&c?));
    let (n, surfaces) = (aircraft.a.nrows(), a.nrows());
    let winds = aircraft.b.ncols() - surfaces;
    let mut whole = DMatrix::zeros(n + surfaces, n + surfaces);
    whole.view_mut((0, 0), (n, n)).copy_from(&aircraft.a);
    whole.view_mut((0, n), (n, surfaces)).copy_from(&(aircraft.b.columns(0, surfaces) * &c));
    whole.view_mut((n, n), (surfaces, surfaces)).copy_from(&a);
    let mut commands = DMatrix::zeros(n + surfaces, surfaces);
    commands.rows_mut(n, surfaces).copy_from(&b);
    let mut measured = aircraft.c.clone().resize_horizontally(n + surfaces, 0.0);
    measured.columns_mut(n, surfaces).copy_from(&(aircraft.d.columns(0, surfaces) * &c));
    let p = measured.nrows();
    Ok(DisturbedPlant {
        a: whole,
        b_f: commands.select_columns(&FAULTS),
        b_u: commands,
        b_d: aircraft.b.columns(surfaces, winds).into_owned().resize_vertically(n + surfaces, 0.0),
        c: measured,
        d_u: DMatrix::zeros(p, surfaces),
        d_d: aircraft.d.columns(surfaces, winds).into_owned(),
        d_f: DMatrix::zeros(p, FAULTS.len()),
        domain: Domain::Continuous,
    })
}

fn diagonal(row: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(row.len(), row.len(), |i, j| if i == j { row[i] } else { 0.0 })
}

/// All poles at -5; ranks are decided at 1e-6, as in the published study: the weakest couplings of the
/// model, near 1e-8, are errors of its data.
pub(crate) fn requirements() -> Requirements {
    Requirements { tolerance: 1e-6, ..Requirements::with_pole(-5.0) }
}

/// The residuals of the nominal model, one for each row of the structure matrix.
pub(crate) fn residuals(nominal: &DisturbedPlant) -> Result<Vec<Residual>, Box<dyn Error>> {
    let requirements = requirements();
    let design = |row: &[u8; 8]| {
        let pattern: Vec<bool> = row.iter().map(|entry| *entry == 1).collect();
        Ok(residual_generator(nominal, &pattern, &requirements)?)
    };
    PATTERNS.iter().map(design).collect()
}

/// H-infinity norms from v, from d, and from f less the nominal response, to all residuals in the loop
/// u = K y + v around one model.
pub(crate) fn norms(
    plant: &DisturbedPlant,
    residuals: &[Residual],
) -> Result<[f64; 3], Box<dyn Error>> {
    let k = matrices::read(FILE, "K")?;
    let (m, d) = (plant.b_u.ncols(), plant.b_d.ncols());
    // The norm of the quaternion of the attitude, which no input moves, is left out.
    let (plant, _) = plant.reachable_part(1e-9)?;
    let system = in_loop(&plant, &k, residuals)?;
    let from = |first: usize, count: usize| StateSpace {
        b: system.b.columns(first, count).into_owned(),
        d: system.d.columns(first, count).into_owned(),
        ..system.clone()
    };
    let difference = less_nominal(&from(m + d, plant.b_f.ncols()), residuals);
    let norm =
        |system: &StateSpace| control::response::h_infinity(system, WIDTH).map(|norm| norm.lower);
    Ok([norm(&from(0, m))?, norm(&from(m, d))?, norm(&difference)?])
}

/// From [v; d; f] to the residuals, with u = K y + v: states of the plant, then of the generators.
fn in_loop(
    plant: &DisturbedPlant,
    k: &DMatrix<f64>,
    residuals: &[Residual],
) -> Result<StateSpace, Box<dyn Error>> {
    let beside = |parts: [&DMatrix<f64>; 3]| {
        let columns: Vec<_> = parts.iter().flat_map(|part| part.column_iter()).collect();
        DMatrix::from_columns(&columns)
    };
    // y = S (C x + D_u v + D_d d + D_f f) with S = (I - `D_u K`)^-1; u = K y + v.
    let p = plant.c.nrows();
    let s =
        (DMatrix::identity(p, p) - &plant.d_u * k).try_inverse().ok_or("I - D_u K is singular")?;
    let (y_x, y_w) = (&s * &plant.c, &s * beside([&plant.d_u, &plant.d_d, &plant.d_f]));
    let mut u_w = k * &y_w;
    let m = plant.b_u.ncols();
    u_w.columns_mut(0, m).iter_mut().step_by(m + 1).for_each(|entry| *entry += 1.0);
    let u_x = k * &y_x;
    let mut b_w = &plant.b_u * k * &y_w + beside([&plant.b_u, &plant.b_d, &plant.b_f]);
    let (n, order) =
        (plant.a.nrows(), residuals.iter().map(|one| one.generator.a.nrows()).sum::<usize>());
    let mut a = (&plant.a + &plant.b_u * &u_x).resize(n + order, n + order, 0.0);
    b_w = b_w.resize_vertically(n + order, 0.0);
    let mut c = DMatrix::zeros(residuals.len(), n + order);
    let mut d = DMatrix::zeros(residuals.len(), b_w.ncols());
    let mut at = n;
    for (row, residual) in residuals.iter().enumerate() {
        let q = &residual.generator;
        let size = q.a.nrows();
        a.view_mut((at, at), (size, size)).copy_from(&q.a);
        a.view_mut((at, 0), (size, n)).copy_from(&(&q.b_u * &u_x + &q.b_y * &y_x));
        b_w.rows_mut(at, size).copy_from(&(&q.b_u * &u_w + &q.b_y * &y_w));
        c.view_mut((row, at), (1, size)).copy_from(&q.c);
        c.view_mut((row, 0), (1, n)).copy_from(&(&q.d_u * &u_x + &q.d_y * &y_x));
        d.rows_mut(row, 1).copy_from(&(&q.d_u * &u_w + &q.d_y * &y_w));
        at += size;
    }
    Ok(StateSpace { a, b: b_w, c, d, domain: Domain::Continuous })
}

/// `system` - [responses of the residuals to the faults at the nominal model].
fn less_nominal(system: &StateSpace, residuals: &[Residual]) -> StateSpace {
    let StateSpace { a, b, c, d, domain } = system.clone();
    let (n, order) =
        (a.nrows(), residuals.iter().map(|one| one.from_faults.a.nrows()).sum::<usize>());
    let mut difference = StateSpace {
        a: a.resize(n + order, n + order, 0.0),
        b: b.resize_vertically(n + order, 0.0),
        c: c.resize_horizontally(n + order, 0.0),
        d,
        domain,
    };
    let mut at = n;
    for (row, residual) in residuals.iter().enumerate() {
        let nominal = &residual.from_faults;
        let size = nominal.a.nrows();
        difference.a.view_mut((at, at), (size, size)).copy_from(&nominal.a);
        difference.b.rows_mut(at, size).copy_from(&nominal.b);
        difference.c.view_mut((row, at), (1, size)).copy_from(&-&nominal.c);
        for fault in 0..nominal.d.ncols() {
            difference.d[(row, fault)] -= nominal.d[(0, fault)];
        }
        at += size;
    }
    difference
}
