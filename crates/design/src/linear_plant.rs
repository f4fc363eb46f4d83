//! The plant as a linear system with faults, out of the plant file's matrices or its FMU.

use control::faults::{Fault as Model, FaultEntry, FaultKind};
use fmu_import::Fmu;
use linearise::{Linearisation, Linearise, LineariseError, linearise};
use nalgebra::{DMatrix, DVector};

use super::plant_file::{self, PlantFile};
use super::signals::{Course, Entrance, Fault, Signal};

/// Largest part of its row that counts as no direct way from an input to a measurement.
const NOTHING: f64 = 1e-9;

/// x' = A x + B u + faults, y = C x + sensor faults, about an operating point.
pub(crate) struct LinearPlant {
    pub(crate) a: DMatrix<f64>,
    pub(crate) b: DMatrix<f64>,
    pub(crate) c: DMatrix<f64>,
    pub(crate) states: Vec<Signal>,
    pub(crate) actuators: Vec<Signal>,
    pub(crate) measurements: Vec<Signal>,
    /// The faults as the user named them, with their units.
    pub(crate) faults: Vec<Fault>,
    /// The same for the mathematics, in this order.
    pub(crate) models: Vec<Model>,
    /// Where the matrices come from, in a sentence.
    pub(crate) origin: String,
    /// Of an FMU: how far its operating point is from an equilibrium, relative.
    pub(crate) residual: Option<f64>,
}

impl LinearPlant {
    /// Reads the matrices of `file`, or linearises its FMU.
    pub(crate) fn of(file: &PlantFile<'_>) -> Result<Self, crate::Error> {
        match &file.model {
            plant_file::Model::Matrices { a, b, c, f_a, states } => {
                let columns = f_a.clone().unwrap_or_else(|| DMatrix::zeros(a.nrows(), 0));
                let model = |fault: &Fault| match fault.entrance {
                    Entrance::Column(at) => {
                        modelled(fault, FaultEntry::Actuator(column(&columns, at)))
                    }
                    _ => on_signals(fault, b, c.nrows()),
                };
                Ok(Self {
                    a: a.clone(),
                    b: b.clone(),
                    c: c.clone(),
                    states: states.clone(),
                    actuators: file.actuators.clone(),
                    measurements: file.measurements.clone(),
                    faults: file.faults.clone(),
                    models: file.faults.iter().map(model).collect(),
                    origin: "The matrices are those of the plant file.".to_owned(),
                    residual: None,
                })
            }
            plant_file::Model::Fmu(fmu) => linearised(file, fmu),
        }
    }
}

/// Column `at`.
fn column(m: &DMatrix<f64>, at: usize) -> DVector<f64> {
    m.column(at).into_owned()
}

fn modelled(fault: &Fault, entry: FaultEntry) -> Model {
    let kind = match fault.course {
        Course::Constant => FaultKind::Constant,
        Course::Ramp => FaultKind::Ramp,
    };
    Model { entry, kind }
}

/// A fault of an actuator or a sensor; `p` measurements.
fn on_signals(fault: &Fault, b: &DMatrix<f64>, p: usize) -> Model {
    let enters = match fault.entrance {
        Entrance::Sensor(at) => {
            FaultEntry::Sensor(DVector::from_fn(p, |row, _| f64::from(u8::from(row == at))))
        }
        Entrance::Loss { actuator, .. } => FaultEntry::LossOfEffectiveness(actuator),
        Entrance::Actuator(at) => FaultEntry::Actuator(column(b, at)),
        Entrance::Column(_) | Entrance::Input(_) => FaultEntry::Actuator(DVector::zeros(b.nrows())),
    };
    modelled(fault, enters)
}

/// The FMU of the file as a linear plant.
fn linearised(
    file: &PlantFile<'_>,
    own: &plant_file::PlantFmu,
) -> Result<LinearPlant, crate::Error> {
    let (model, found) = linearisation(file, own)?;
    let known = |signal: &linearise::Signal| Signal {
        unit: signal.unit.clone(),
        operating: Some(signal.value),
        ..Signal::named(signal.name.clone())
    };
    let merged = |own: &[Signal], found: &[linearise::Signal]| {
        own.iter().zip(found).map(|(own, found)| own.clone().or(known(found))).collect()
    };
    refuse_feedthrough(file, &found.matrices.d, &found.matrices.c)?;
    let (faults, models) = faults(file, &found)?;
    Ok(LinearPlant {
        states: found.states.iter().map(known).collect(),
        actuators: merged(&file.actuators, &found.inputs),
        measurements: merged(&file.measurements, &found.outputs),
        faults,
        models,
        origin: format!("{model}, linearised by {}.", found.method),
        residual: Some(found.residual),
        a: found.matrices.a,
        b: found.matrices.b,
        c: found.matrices.c,
    })
}

/// Linearises the FMU of the file; its name and what was found.
fn linearisation(
    file: &PlantFile<'_>,
    plant_file::PlantFmu { path, operating_point, states }: &plant_file::PlantFmu,
) -> Result<(String, Linearisation), crate::Error> {
    let fmu = Fmu::open_any(path).map_err(|error| file.error(&["plant"], sentence(&error)))?;
    let names = |signals: &[Signal]| signals.iter().map(|signal| signal.name.clone()).collect();
    let inputs = file.faults.iter().filter_map(|fault| match &fault.entrance {
        Entrance::Input(name) => Some(name.clone()),
        _ => None,
    });
    let request = Linearise {
        inputs: names(&file.actuators),
        faults: inputs.collect(),
        outputs: names(&file.measurements),
        states: states.clone(),
        at: operating_point.iter().map(|(name, value)| (name.clone(), value.to_string())).collect(),
        ..Linearise::default()
    };
    let found = linearise(&fmu, &request).map_err(|error| {
        let place = match &error {
            LineariseError::UnknownVariable { name, .. } => stating(file, operating_point, name),
            _ => "plant",
        };
        file.error(&[place, "plant"], format!("{}: {error}", path.display()))
    })?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok((format!("{} ({name})", fmu.description().model_name), found))
}

/// The entry of the file that names this variable of the FMU.
fn stating(file: &PlantFile<'_>, operating_point: &[(String, f64)], name: &str) -> &'static str {
    let among = |signals: &[Signal]| signals.iter().any(|signal| signal.name == name);
    if operating_point.iter().any(|(variable, _)| variable == name) {
        "operating_point"
    } else if among(&file.actuators) {
        "actuators"
    } else if among(&file.measurements) {
        "measurements"
    } else {
        "faults"
    }
}

/// The faults of the file with the units of the FMU, and where they enter.
fn faults(
    file: &PlantFile<'_>,
    found: &Linearisation,
) -> Result<(Vec<Fault>, Vec<Model>), crate::Error> {
    let mut inputs = 0..;
    let mut faults = file.faults.clone();
    let mut models = Vec::with_capacity(faults.len());
    for fault in &mut faults {
        let (signal, model) = match fault.entrance {
            Entrance::Input(_) => {
                let at = inputs.next().unwrap_or_default();
                (&found.faults[at], modelled(fault, entry(file, fault, &found.matrices, at)?))
            }
            Entrance::Sensor(at) => {
                let measurements = found.outputs.len();
                (&found.outputs[at], on_signals(fault, &found.matrices.b, measurements))
            }
            Entrance::Actuator(at) | Entrance::Loss { actuator: at, .. } => {
                (&found.inputs[at], on_signals(fault, &found.matrices.b, found.outputs.len()))
            }
            Entrance::Column(_) => {
                let message = format!("fault `{}`: an FMU has no F_a", fault.name);
                return Err(file.error_at(&fault.place, message).into());
            }
        };
        fault.unit = fault.unit.take().or_else(|| signal.unit.clone());
        models.push(model);
    }
    Ok((faults, models))
}

/// The observer is for measurements that the commands do not reach directly.
fn refuse_feedthrough(
    file: &PlantFile<'_>,
    d: &DMatrix<f64>,
    c: &DMatrix<f64>,
) -> Result<(), crate::Error> {
    for row in 0..d.nrows() {
        for actuator in 0..d.ncols() {
            if d[(row, actuator)].abs() > NOTHING * c.row(row).amax() {
                let message = format!(
                    "the measurement {} depends on {} directly (D is {}); the observer is for y = \
                     C x",
                    file.measurements[row].name,
                    file.actuators[actuator].name,
                    d[(row, actuator)]
                );
                return Err(file.error(&["measurements"], message).into());
            }
        }
    }
    Ok(())
}

/// How fault input `at` of the FMU enters: the states or the measurements.
fn entry(
    file: &PlantFile<'_>,
    fault: &Fault,
    found: &linearise::Matrices,
    at: usize,
) -> Result<FaultEntry, crate::Error> {
    let (states, measurements) = (column(&found.f, at), column(&found.g, at));
    match (states.amax() > 0.0, measurements.amax() > 0.0) {
        (true, false) => Ok(FaultEntry::Actuator(states)),
        (false, true) if file.filter.is_some() => Ok(FaultEntry::Sensor(measurements)),
        (false, true) => {
            let message = format!(
                "fault `{}` enters the measurements, which needs `filter`: the rates, in 1/s, of \
                 the filter that they pass",
                fault.name
            );
            Err(file.error_at(&fault.place, message).into())
        }
        (reaches_both, _) => {
            let found = if reaches_both { "both" } else { "neither" };
            let message = format!(
                "fault `{}`: expected an input of the FMU that acts on states or on measurements, \
                 found that it acts on {found}",
                fault.name
            );
            Err(file.error_at(&fault.place, message).into())
        }
    }
}

/// An error with its causes.
fn sentence(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| cause.source());
    causes.fold(error.to_string(), |said, cause| format!("{said}: {cause}"))
}
