//! The plant: its matrices, or its FMU.

use std::path::PathBuf;

use nalgebra::DMatrix;

use crate::Sampling;
use crate::matrix::{matrix, shaped};
use crate::read::{Result, optional, positive, refuse};
use crate::sampled_matrices::SampledMatrices;
use crate::signals::{ACTUATOR, MEASUREMENT, STATE, Signal, signals};
use files::{Entry, Source, Table};

/// The source of the plant's matrices.
#[derive(Clone)]
pub enum Model {
    /// The file states the matrices.
    Matrices {
        /// A, n x n.
        a: DMatrix<f64>,
        /// B, n x m.
        b: DMatrix<f64>,
        /// C, p x n.
        c: DMatrix<f64>,
        /// D, p x m; zero if not stated.
        d: DMatrix<f64>,
        /// F_a, n x q, with a column for each fault that enters through F_a; `None` if not stated.
        f_a: Option<DMatrix<f64>>,
        /// The states.
        states: Vec<Signal>,
        /// The sampled matrices, if the file states `matrices = "sampled"`: then `a`, `b` and `f_a` belong to the
        /// continuous plant with these samples or, if none exists, are the stated ones.
        sampled: Option<Box<SampledMatrices>>,
    },
    /// The matrices are linearised from an FMU.
    Fmu(PlantFmu),
}

impl Model {
    /// Why the plant is known in its samples only; `None` for a plant that is known in continuous time.
    #[must_use]
    pub fn only_samples(&self) -> Option<&str> {
        match self {
            Self::Matrices { sampled: Some(sampled), .. } => sampled.only_samples.as_deref(),
            _ => None,
        }
    }
}

/// The FMU of a plant and its operating point.
#[derive(Clone)]
pub struct PlantFmu {
    /// The file of the FMU.
    pub path: PathBuf,
    /// Values of variables at the operating point.
    pub operating_point: Vec<(String, f64)>,
    /// Names of the states, for an FMU whose description does not list them; empty if not stated.
    pub states: Vec<String>,
    /// Shared libraries to load before the FMU.
    pub preload: Vec<String>,
    /// Communication step, s, of an FMU that is linearised by steps, if stated.
    pub step: Option<f64>,
}

/// Reads a plant that is an FMU; returns actuators and measurements, too.
pub(crate) fn read_fmu_plant(
    source: &Source,
    file: &Table<'_>,
    plant: &Entry<'_>,
) -> Result<(Model, [Vec<Signal>; 2])> {
    let message = "an FMU is the plant; its matrices are not stated";
    refuse(file, &["A", "B", "C", "D", "F_a", "matrices"], message)?;
    let folder = source.path.parent().map(PathBuf::from).unwrap_or_default();
    let mut operating_point = Vec::new();
    if let Some(entry) = file.get("operating_point") {
        for (name, value) in entry.table()?.entries() {
            operating_point.push((name.to_owned(), value.number()?));
        }
    }
    let states = optional(file, "states", |entry| signals(entry, STATE))?;
    let model = Model::Fmu(PlantFmu {
        path: folder.join(plant.text()?),
        operating_point,
        states: states.unwrap_or_default().into_iter().map(|signal| signal.name).collect(),
        preload: optional(file, "preload", texts)?.unwrap_or_default(),
        step: positive(file, "linearisation_step")?,
    });
    let actuators = file.require("actuators", "the inputs of the FMU that the controller sets")?;
    let meaning = "the outputs of the FMU that the controller reads";
    let measurements = file.require("measurements", meaning)?;
    Ok((model, [signals(&actuators, ACTUATOR)?, signals(&measurements, MEASUREMENT)?]))
}

fn texts(entry: &Entry<'_>) -> Result<Vec<String>> {
    if entry.is_text() {
        return Ok(vec![entry.text()?.to_owned()]);
    }
    entry.list()?.iter().map(|member| member.text().map(str::to_owned)).collect()
}

/// Reads a plant whose matrices the file states; also returns actuators and measurements.
pub(crate) fn read_matrices(
    file: &Table<'_>,
    sampling: Option<Sampling>,
) -> Result<(Model, [Vec<Signal>; 2])> {
    refuse(file, &["preload", "linearisation_step"], "it belongs to `plant`, an FMU")?;
    let advice = "it belongs to `plant`; with matrices, `operating` in each signal states it";
    refuse(file, &["operating_point"], advice)?;
    let meaning = "the plant x' = A x + B u + F_a f_a, y = C x + D u; or `plant`, an FMU";
    let entry = file.require("A", meaning)?;
    let n = matrix(&entry)?.nrows();
    let a = shaped(&entry, [n, n], "states x states")?;
    let b = file.require("B", meaning)?;
    let b = shaped(&b, [n, matrix(&b)?.ncols()], "states x actuators")?;
    let c = file.require("C", meaning)?;
    let c = shaped(&c, [matrix(&c)?.nrows(), n], "measurements x states")?;
    let d = match file.get("D") {
        Some(entry) => shaped(&entry, [c.nrows(), b.ncols()], "measurements x actuators")?,
        None => DMatrix::zeros(c.nrows(), b.ncols()),
    };
    let columns = |entry: &Entry<'_>| shaped(entry, [n, matrix(entry)?.ncols()], "states x faults");
    let f_a = optional(file, "F_a", columns);
    let states = read_signals(file, "states", "x", n, "states, the rows of A")?;
    let actuators = read_signals(file, "actuators", "u", b.ncols(), "actuators, the columns of B")?;
    let measurements =
        read_signals(file, "measurements", "y", c.nrows(), "measurements, the rows of C")?;
    let f_a = f_a?;
    let sampled = SampledMatrices::read(file, sampling, (&a, &b))?;
    let (a, b, f_a) = match &sampled {
        None => (a, b, f_a),
        Some(sampled) => {
            (sampled.a.clone(), sampled.b.clone(), f_a.map(|f_a| sampled.input_columns(&f_a)))
        }
    };
    let model = Model::Matrices { a, b, c, d, f_a, states, sampled };
    Ok((model, [actuators, measurements]))
}

/// Reads the `count` signals under `key`; without this entry the names are `letter` and a number from 1.
fn read_signals(
    file: &Table<'_>,
    key: &str,
    letter: &str,
    count: usize,
    meaning: &str,
) -> Result<Vec<Signal>> {
    let Some(entry) = file.get(key) else {
        return Ok((1..=count).map(|k| Signal::named(format!("{letter}{k}"))).collect());
    };
    let keys = match key {
        "actuators" => ACTUATOR,
        "measurements" => MEASUREMENT,
        _ => STATE,
    };
    let members = signals(&entry, keys)?;
    if members.len() == count {
        return Ok(members);
    }
    Err(entry.error(format!("expected {count} {meaning}, found {}", members.len())))
}
