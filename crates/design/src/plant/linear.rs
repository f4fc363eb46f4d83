//! The plant as a linear system with faults, from the matrices of the plant file or from its FMU.

use std::ops::Range;

use control::delay::Delays;
use control::detection::UnknownInput;
use control::faults::{Fault as Model, FaultEntry, FaultKind};
use control::hold::zero_order_hold;
use control::rank::Mode;
use control::{Domain, Error, StateSpace};
use fmu_import::Fmu;
use linearise::{Linearisation, Linearise, LineariseError, Method, linearise};
use nalgebra::{DMatrix, DVector};

use crate::plant::delays::{self, DelayedPlant, delayed};
use files::PlaceError;
use plant_file::PlantFile;
use plant_file::detection::{Disturbance, DisturbanceEntry};
use plant_file::faults::{EntryPoint, Fault, FaultDynamics};
use plant_file::pid::Pid;
use plant_file::requirements::Requirement;
use plant_file::signals::{Signal, is_one_unit, is_one_unit_of_differences};

/// Relative distance from an equilibrium below which an operating point counts as an equilibrium.
pub(crate) const AT_REST: f64 = 1e-6;

/// Part of the largest entry of a row of C below which an entry of D or G (from faults to measurements) counts as zero,
/// in units of typical sizes.
const NEGLIGIBLE: f64 = 1e-9;

/// Part of the largest entry of a row above which the error of a linearisation is more than rounding.
pub(crate) const INACCURATE: f64 = 0.01;

/// x' = A x + B u + faults, y = C x + D u + faults, about an operating point; x\[k+1\] in place of x' if the plant is
/// known in its samples only.
///
/// The states are those of the plant, then those of its approximated delays, then those of the filters of controllers
/// of low order.
pub(crate) struct LinearPlant {
    pub(crate) a: DMatrix<f64>,
    pub(crate) b: DMatrix<f64>,
    pub(crate) c: DMatrix<f64>,
    pub(crate) d: DMatrix<f64>,
    pub(crate) states: Vec<Signal>,
    pub(crate) actuators: Vec<Signal>,
    pub(crate) measurements: Vec<Signal>,
    /// The faults as named in the file, with their units.
    pub(crate) faults: Vec<Fault>,
    /// The time domain of the matrices.
    pub(crate) domain: Domain,
    /// The models of `faults`, in the same order.
    pub(crate) models: Vec<Model>,
    /// Where the disturbances of the file act, in the order of the file.
    pub(crate) disturbances: Vec<UnknownInput>,
    /// The plant without the states of delays and filters.
    pub(crate) undelayed: StateSpace,
    /// The delays of commands and measurements.
    pub(crate) delays: Delays,
    /// Number of states of each delay.
    pub(crate) delay_order: usize,
    /// The source of the matrices, in a sentence.
    pub(crate) origin: String,
    /// Relative distance of the operating point from an equilibrium, for an FMU.
    pub(crate) residual: Option<f64>,
    /// Largest error of an entry relative to the largest entry of its row, for an FMU; None if no error is known.
    pub(crate) inaccuracy: Option<f64>,
}

impl LinearPlant {
    /// Whether a measurement depends on a command directly.
    pub(crate) fn has_feedthrough(&self) -> bool {
        self.d.amax() > 0.0
    }

    /// Returns the plant from the commands to the measurements.
    pub(crate) fn state_space(&self) -> StateSpace {
        system([&self.a, &self.b, &self.c, &self.d], self.domain)
    }

    /// Returns the matrix of the states in the condition of rest: A in A x + B u = 0, in sampled time A - I.
    pub(crate) fn a_at_rest(&self) -> DMatrix<f64> {
        let n = self.a.nrows();
        &self.a - DMatrix::from_diagonal_element(n, n, self.domain.constant())
    }

    /// Returns Phi and Gamma, with which the states after `time` are Phi x + Gamma u if u is held. `inputs`: the
    /// columns through which u acts, such as those of B. In sampled time the states are those after one sample, for any
    /// `time`.
    pub(crate) fn held(
        &self,
        inputs: &DMatrix<f64>,
        time: f64,
    ) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
        match self.domain {
            Domain::Continuous => zero_order_hold(&self.a, inputs, time),
            Domain::Sampled { .. } => Ok((self.a.clone(), inputs.clone())),
        }
    }

    /// Returns the times after a sample that divide `period` into `parts` equal parts; none if the plant is known in
    /// its samples only.
    pub(crate) fn times_between(&self, period: f64, parts: u32) -> Vec<f64> {
        match self.domain {
            Domain::Continuous => {
                (1..parts).map(|part| period * f64::from(part) / f64::from(parts)).collect()
            }
            Domain::Sampled { .. } => Vec::new(),
        }
    }

    /// Returns the plant from the commands to the measurements for the verdict: with better approximations of its
    /// delays, and without filters.
    pub(crate) fn judged(&self) -> Result<StateSpace, Error> {
        self.delays.approximated(&self.undelayed, delays::JUDGED)
    }

    /// Returns the states of the plant without the states of delays and filters.
    pub(crate) fn plant_states(&self) -> &[Signal] {
        &self.states[..self.undelayed.a.nrows()]
    }

    /// Returns the positions of the states of delays and filters.
    pub(crate) fn delay_states(&self) -> Range<usize> {
        self.undelayed.a.nrows()..self.states.len()
    }

    /// Returns the positions of the states of the filters of controllers of low order, the last ones.
    pub(crate) fn filter_states(&self, file: &PlantFile<'_>) -> Range<usize> {
        let count = file.pid().map_or(0, Pid::states);
        self.states.len() - count..self.states.len()
    }

    /// Whether a mode is one of delays or filters, which is stable. If two signals have equal delays, there is such a
    /// mode that no gain moves.
    pub(crate) fn is_of_delays(&self, mode: &Mode) -> bool {
        mode.dominant.iter().all(|state| self.delay_states().contains(state))
    }

    /// Returns a requirement on a gain for `order` states. Weights of a plant file, which states none for delays, get
    /// zeros for these: they are stable, and the controller knows their inputs. Other requirements stay.
    pub(crate) fn with_delays(&self, requirement: &Requirement, order: usize) -> Requirement {
        let delays = self.delay_states();
        match requirement {
            Requirement::Weights { states, channels }
                if states.is_square() && states.nrows() + delays.len() == order =>
            {
                let (first, count) = (delays.start, delays.len());
                let states = states.clone().insert_rows(first, count, 0.0);
                let states = states.insert_columns(first, count, 0.0);
                Requirement::Weights { states, channels: channels.clone() }
            }
            _ => requirement.clone(),
        }
    }

    /// Returns the part of matrices, shaped as those of [`Self::judged`], that belongs to the plant without delays.
    pub(crate) fn of_plant(&self, matrices: &[DMatrix<f64>; 4]) -> [DMatrix<f64>; 4] {
        self.delays.of_plant(self.undelayed.a.nrows(), delays::JUDGED, matrices)
    }

    /// Reads the matrices of `file`, or linearises its FMU.
    pub(crate) fn of(file: &PlantFile<'_>) -> Result<Self, crate::Error> {
        match &file.model {
            plant_file::Model::Matrices { a, b, c, d, f_a, states, sampled } => {
                let domain = sampled.as_ref().map_or(Domain::Continuous, |sampled| sampled.domain);
                let undelayed = system([a, b, c, d], domain);
                let delays = delays::of(file);
                if domain != Domain::Continuous && delays.any() {
                    let message = "a delay needs a continuous plant with the samples of A and B, and there is none; expected \
                                   states of the delay in A, B and C, one for each sample of it";
                    return Err(file.error(&["actuators", "measurements"], message).into());
                }
                let f = f_a.clone().unwrap_or_else(|| DMatrix::zeros(a.nrows(), 0));
                let g = DMatrix::zeros(c.nrows(), f.ncols());
                let DelayedPlant { a, b, c, d, f, .. } = delayed(file, &undelayed, [&f, &g])?;
                let model = |fault: &Fault| match fault.entry_point {
                    EntryPoint::Column(at) => modelled(fault, FaultEntry::Actuator(column(&f, at))),
                    _ => on_signals(fault, &b, &d),
                };
                Ok(Self {
                    states: delays::states(file, states, [&file.actuators, &file.measurements]),
                    actuators: file.actuators.clone(),
                    measurements: file.measurements.clone(),
                    faults: file.faults.clone(),
                    models: file.faults.iter().map(model).collect(),
                    disturbances: disturbances(file, &b, &d, None)?,
                    origin: match sampled {
                        None => "The plant file states the matrices.",
                        Some(sampled) if sampled.only_samples.is_some() => {
                            "The plant file states sampled matrices, which no continuous plant has: x[k+1] = A x[k] + B u[k]."
                        }
                        Some(_) => {
                            "The plant file states sampled matrices; these are of the continuous plant with the \
                             same samples."
                        }
                    }
                    .to_owned(),
                    residual: None,
                    inaccuracy: None,
                    domain,
                    a,
                    b,
                    c,
                    d,
                    undelayed,
                    delays,
                    delay_order: file.delay_order,
                })
            }
            plant_file::Model::Fmu(fmu) => linearised(file, fmu),
        }
    }
}

/// Returns column `at`.
fn column(m: &DMatrix<f64>, at: usize) -> DVector<f64> {
    m.column(at).into_owned()
}

fn modelled(fault: &Fault, entry: FaultEntry) -> Model {
    let kind = match fault.dynamics {
        FaultDynamics::Constant => FaultKind::Constant,
        FaultDynamics::Ramp => FaultKind::Ramp,
    };
    Model { entry, kind }
}

/// Returns the model of a fault of an actuator or sensor; other faults are handled before, and have no effect here.
fn on_signals(fault: &Fault, b: &DMatrix<f64>, d: &DMatrix<f64>) -> Model {
    let enters = match fault.entry_point {
        EntryPoint::Sensor(at) => {
            FaultEntry::Sensor(DVector::from_fn(d.nrows(), |row, _| f64::from(u8::from(row == at))))
        }
        EntryPoint::Loss { actuator, .. } => FaultEntry::LossOfEffectiveness(actuator),
        EntryPoint::Actuator(at) if d.column(at).amax() > 0.0 => {
            FaultEntry::Both { states: column(b, at), measurements: column(d, at) }
        }
        EntryPoint::Actuator(at) => FaultEntry::Actuator(column(b, at)),
        EntryPoint::Column(_) | EntryPoint::Input(_) => {
            FaultEntry::Actuator(DVector::zeros(b.nrows()))
        }
    };
    modelled(fault, enters)
}

/// Returns the FMU of the file as a linear plant.
fn linearised(
    file: &PlantFile<'_>,
    fmu: &plant_file::PlantFmu,
) -> Result<LinearPlant, crate::Error> {
    let (model, linearised) = linearisation(file, fmu)?;
    check_units(file, &file.actuators, &linearised.inputs)?;
    check_units(file, &file.measurements, &linearised.outputs)?;
    let known = |signal: &linearise::Signal| Signal {
        unit: signal.unit.clone(),
        operating: Some(signal.value),
        ..Signal::named(signal.name.clone())
    };
    let merged = |signals: &[Signal], from_fmu: &[linearise::Signal]| -> Vec<_> {
        let both = signals.iter().zip(from_fmu);
        both.map(|(signal, known_signal)| signal.clone().or(known(known_signal))).collect()
    };
    let linearise::Matrices { a, b, c, f, .. } = &linearised.matrices;
    let [d, g] = direct_terms(&linearised);
    let undelayed = system([a, b, c, &d], Domain::Continuous);
    let delays = delays::of(file);
    let matrices = delayed(file, &undelayed, [f, &g])?;
    let (faults, models) = faults(file, &linearised, &matrices)?;
    let DelayedPlant { a, b, c, d, .. } = &matrices;
    let states: Vec<_> = linearised.states.iter().map(known).collect();
    let actuators = merged(&file.actuators, &linearised.inputs);
    let measurements = merged(&file.measurements, &linearised.outputs);
    let signals = [&actuators[..], &measurements[..]];
    Ok(LinearPlant {
        disturbances: disturbances(file, b, d, Some(&matrices))?,
        states: delays::states(file, &states, signals),
        actuators,
        measurements,
        faults,
        models,
        origin: format!("{model}, linearised by {}.", linearised.method),
        residual: Some(linearised.residual),
        inaccuracy: inaccuracy(&linearised),
        domain: Domain::Continuous,
        a: a.clone(),
        b: b.clone(),
        c: c.clone(),
        d: d.clone(),
        undelayed,
        delays,
        delay_order: file.delay_order,
    })
}

/// Checks that the units in the file for signals of the FMU equal the units in the FMU, which the matrices have.
fn check_units(
    file: &PlantFile<'_>,
    signals: &[Signal],
    from_fmu: &[linearise::Signal],
) -> Result<(), PlaceError> {
    for (signal, known) in signals.iter().zip(from_fmu) {
        let (Some(stated), Some(unit)) = (&signal.unit, &known.unit) else { continue };
        if !is_one_unit(stated, unit) {
            let name = &signal.name;
            let message =
                format!("the FMU has `{name}` in {unit}; expected this unit, found {stated}");
            let place = signal.places[0].clone();
            return Err(place.map_or_else(
                || file.error(&["actuators", "measurements"], &message),
                |place| file.error_at(&place, &message),
            ));
        }
    }
    Ok(())
}

fn system([a, b, c, d]: [&DMatrix<f64>; 4], domain: Domain) -> StateSpace {
    StateSpace { a: a.clone(), b: b.clone(), c: c.clone(), d: d.clone(), domain }
}

/// Opens the FMU of the file, with the libraries that it needs.
pub(crate) fn open(file: &PlantFile<'_>, fmu: &plant_file::PlantFmu) -> Result<Fmu, crate::Error> {
    for library in &fmu.preload {
        fmu_import::preload(library.as_ref())
            .map_err(|error| file.error(&["preload"], files::sentence(&error)))?;
    }
    let opened = Fmu::open_any(&fmu.path);
    Ok(opened.map_err(|error| file.error(&["plant"], files::sentence(&error)))?)
}

/// Returns the request for the linear plant at the operating point of the file; its faults are the inputs of faults,
/// then the inputs of disturbances.
pub(crate) fn request(file: &PlantFile<'_>, fmu: &plant_file::PlantFmu) -> Linearise {
    let names = |signals: &[Signal]| signals.iter().map(|signal| signal.name.clone()).collect();
    let inputs = file.faults.iter().filter_map(|fault| match &fault.entry_point {
        EntryPoint::Input(name) => Some(name.clone()),
        _ => None,
    });
    let at = fmu.operating_point.iter();
    Linearise {
        inputs: names(&file.actuators),
        faults: inputs.chain(disturbance_inputs(file)).collect(),
        outputs: names(&file.measurements),
        states: fmu.states.clone(),
        at: at.map(|(name, value)| (name.clone(), value.to_string())).collect(),
        step: fmu.step,
        ..Linearise::default()
    }
}

/// Returns the inputs of the FMU that are disturbances.
fn disturbance_inputs<'a>(file: &'a PlantFile<'_>) -> impl Iterator<Item = String> + 'a {
    file.disturbances.iter().filter_map(|disturbance| match &disturbance.entry_point {
        DisturbanceEntry::Input(name) => Some(name.clone()),
        _ => None,
    })
}

/// Returns how the disturbances of the file act on a plant with the input matrices `b` and `d`; an error names one that
/// does not act. Disturbances that are inputs of an FMU act by the last columns of F and G in `matrices`.
fn disturbances(
    file: &PlantFile<'_>,
    b: &DMatrix<f64>,
    d: &DMatrix<f64>,
    matrices: Option<&DelayedPlant>,
) -> Result<Vec<UnknownInput>, PlaceError> {
    let columns = matrices.map_or(0, |matrices| matrices.f.ncols());
    let first = columns - disturbance_inputs(file).count().min(columns);
    let mut input_columns = first..;
    let (n, p) = (b.nrows(), d.nrows());
    let one = |disturbance: &Disturbance| {
        let (mut on_states, mut on_measurements) = (DVector::zeros(n), DVector::zeros(p));
        match (&disturbance.entry_point, matrices) {
            (DisturbanceEntry::Column(e), _) => on_states.rows_mut(0, e.len()).copy_from(e),
            (DisturbanceEntry::Actuator(at), _) => {
                (on_states, on_measurements) = (column(b, *at), column(d, *at));
            }
            (DisturbanceEntry::Sensor(at), _) => on_measurements[*at] = 1.0,
            (DisturbanceEntry::Input(_), None) => {}
            (DisturbanceEntry::Input(_), Some(matrices)) => {
                let at = input_columns.next().unwrap_or_default();
                (on_states, on_measurements) = (column(&matrices.f, at), column(&matrices.g, at));
            }
        }
        if on_states.amax() <= 0.0 && on_measurements.amax() <= 0.0 {
            let message = format!(
                "disturbance `{}` acts neither on a state nor on a measurement at the operating point",
                disturbance.name
            );
            return Err(file.error_at(&disturbance.place, message));
        }
        Ok(UnknownInput { on_states, on_measurements })
    };
    file.disturbances.iter().map(one).collect()
}

/// Linearises the FMU of the file; returns its name and the result.
fn linearisation(
    file: &PlantFile<'_>,
    fmu_table: &plant_file::PlantFmu,
) -> Result<(String, Linearisation), crate::Error> {
    let plant_file::PlantFmu { path, operating_point, .. } = fmu_table;
    let fmu = open(file, fmu_table)?;
    let linearised = linearise(&fmu, &request(file, fmu_table)).map_err(|error| {
        let (place, help) = match &error {
            LineariseError::UnknownVariable { name, .. } => {
                (stating(file, operating_point, name), "")
            }
            LineariseError::NoStep { .. } => {
                ("linearisation_step", " (`linearisation_step` states it)")
            }
            LineariseError::StatesNotNamed { .. } => ("plant", " (`states` names them)"),
            _ => ("plant", ""),
        };
        file.error(&[place, "plant"], format!("{}: {error}{help}", path.display()))
    })?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok((format!("{} ({name})", fmu.description().model_name), linearised))
}

/// Returns the entry of the file that names the FMU's variable `name`; the entry of the faults for other variables.
fn stating(file: &PlantFile<'_>, operating_point: &[(String, f64)], name: &str) -> &'static str {
    let among = |signals: &[Signal]| signals.iter().any(|signal| signal.name == name);
    if operating_point.iter().any(|(variable, _)| variable == name) {
        "operating_point"
    } else if among(&file.actuators) {
        "actuators"
    } else if among(&file.measurements) {
        "measurements"
    } else if disturbance_inputs(file).any(|input| input == name) {
        "disturbances"
    } else {
        "faults"
    }
}

/// Returns the faults of the file with units of the FMU, and their models.
fn faults(
    file: &PlantFile<'_>,
    linearised: &Linearisation,
    matrices: &DelayedPlant,
) -> Result<(Vec<Fault>, Vec<Model>), crate::Error> {
    let DelayedPlant { b, d, .. } = matrices;
    let mut inputs = 0..;
    let mut faults = file.faults.clone();
    let mut models = Vec::with_capacity(faults.len());
    for fault in &mut faults {
        let (signal, model) = match fault.entry_point {
            EntryPoint::Input(_) => {
                let at = inputs.next().unwrap_or_default();
                (&linearised.faults[at], modelled(fault, entry(file, fault, matrices, at)?))
            }
            EntryPoint::Sensor(at) => (&linearised.outputs[at], on_signals(fault, b, d)),
            EntryPoint::Actuator(at) | EntryPoint::Loss { actuator: at, .. } => {
                (&linearised.inputs[at], on_signals(fault, b, d))
            }
            EntryPoint::Column(_) => {
                let message = format!("fault `{}`: an FMU has no F_a", fault.name);
                return Err(file.error_at(&fault.place, message).into());
            }
        };
        if let (Some(stated), Some(unit)) = (&fault.unit, &signal.unit)
            && !is_one_unit_of_differences(stated, unit)
        {
            let message = format!(
                "fault `{}`: the FMU has `{}` in {unit}; expected this unit, found {stated}",
                fault.name, signal.name
            );
            return Err(file.error_at(&fault.place, message).into());
        }
        fault.unit = fault.unit.take().or_else(|| signal.unit.clone());
        models.push(model);
    }
    Ok((faults, models))
}

/// Returns where the fault input `at` of the FMU enters: the states, the measurements or both. Refuses one that acts on
/// neither, and one that enters the measurements without `filter`.
fn entry(
    file: &PlantFile<'_>,
    fault: &Fault,
    matrices: &DelayedPlant,
    at: usize,
) -> Result<FaultEntry, crate::Error> {
    let (states, measurements) = (column(&matrices.f, at), column(&matrices.g, at));
    if measurements.amax() > 0.0 && file.filter.is_none() {
        let message = format!(
            "fault `{}` enters the measurements, which needs `filter`: the rates, in 1/s, of the filter \
             that they pass",
            fault.name
        );
        return Err(file.error_at(&fault.place, message).into());
    }
    match (states.amax() > 0.0, measurements.amax() > 0.0) {
        (true, false) => Ok(FaultEntry::Actuator(states)),
        (false, true) => Ok(FaultEntry::Sensor(measurements)),
        (true, true) => Ok(FaultEntry::Both { states, measurements }),
        (false, false) => {
            let message = format!(
                "fault `{}`: expected an input of the FMU that acts on states or on measurements, found \
                 that it acts on neither",
                fault.name
            );
            Err(file.error_at(&fault.place, message).into())
        }
    }
}

/// Returns the largest error of an entry, relative to the largest entry of its row: the error of differences, or the
/// deviation of directional derivatives from differences; None if no error is known.
fn inaccuracy(linearised: &Linearisation) -> Option<f64> {
    match &linearised.method {
        Method::FiniteDifferences { .. } => linearised.relative_error(),
        Method::DirectionalDerivatives { disagreement, .. } => {
            disagreement.as_ref().map(|worst| worst.relative)
        }
    }
}

/// Returns D and G with zeros for entries that are rounding errors beside the row of C, or not larger than the error of
/// their differences. An error above [`INACCURATE`] of the row, as at a kink, removes no entry.
pub(crate) fn direct_terms(linearised: &Linearisation) -> [DMatrix<f64>; 2] {
    let Linearisation { states, inputs, faults, matrices, .. } = linearised;
    let linearise::Matrices { d, g, .. } = matrices;
    let errors = match &linearised.method {
        Method::FiniteDifferences { errors, .. } => Some(errors),
        Method::DirectionalDerivatives { .. } => None,
    };
    let joined = matrices.joined();
    let columns = states.iter().chain(inputs).chain(faults);
    let typical: Vec<f64> = columns.map(|signal| signal.typical).collect();
    let largest = |row: usize, columns: usize| {
        let entries = joined.row(states.len() + row);
        let sizes = entries.iter().zip(&typical).take(columns);
        sizes.map(|(entry, size)| entry.abs() * size).fold(0.0, f64::max)
    };
    let significant = |values: &DMatrix<f64>, errors: Option<&DMatrix<f64>>, first: usize| {
        values.map_with_location(|row, column, entry| {
            let error = errors.map_or(0.0, |errors| errors[(row, column)]);
            let size = typical[first + column];
            let is_rounding = error * size <= INACCURATE * largest(row, typical.len());
            let rounding = if is_rounding { error } else { 0.0 };
            let negligible = rounding.max(NEGLIGIBLE * largest(row, states.len()) / size);
            if entry.abs() <= negligible { 0.0 } else { entry }
        })
    };
    let first_fault = states.len() + inputs.len();
    [
        significant(d, errors.map(|errors| &errors.d), states.len()),
        significant(g, errors.map(|errors| &errors.g), first_fault),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::read;

    fn row(entries: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(1, entries.len(), entries)
    }

    /// `x' = A x + 2 u_1 + u_2`, `y = x + D u + G f`, with the error `of_a` of A, and `of_direct` of D and G.
    fn differences([a, d, g]: [&[f64]; 3], [of_a, of_direct]: [f64; 2]) -> Linearisation {
        let matrices = linearise::Matrices {
            a: row(a),
            b: row(&[2.0, 1.0]),
            f: row(&[0.0]),
            c: row(&[1.0]),
            d: row(d),
            g: row(g),
        };
        let errors = linearise::Matrices {
            a: row(&[of_a]),
            b: row(&[0.0; 2]),
            f: row(&[0.0]),
            c: row(&[0.0]),
            d: row(&[of_direct; 2]),
            g: row(&[of_direct]),
        };
        let signal =
            linearise::Signal { name: String::new(), unit: None, value: 0.0, typical: 1.0 };
        let how = linearise::Differences::OfEquations { steps: Vec::new() };
        Linearisation {
            matrices,
            states: vec![signal.clone()],
            inputs: vec![signal.clone(); 2],
            faults: vec![signal],
            outputs: Vec::new(),
            rates: Vec::new(),
            residual: 0.0,
            method: Method::FiniteDifferences { how, errors: Box::new(errors) },
        }
    }

    /// Of D = [2, 1e-7] and G = [1e-7], each to 1e-6, only the first entry is not zero.
    #[test]
    fn a_direct_term_within_the_error_of_its_difference_is_none() {
        let linearised = differences([&[-1.0], &[2.0, 1e-7], &[1e-7]], [0.0, 1e-6]);
        assert_eq!(direct_terms(&linearised), [row(&[2.0, 0.0]), row(&[0.0])]);
    }

    /// `y = 1e9 x + D u`, x of 1e-9: the first input acts half as much as x, the second one 1e-10 times as much.
    #[test]
    fn a_direct_term_counts_beside_the_typical_size_of_the_states() {
        let mut linearised = differences([&[-1.0], &[0.5, 1e-10], &[0.0]], [0.0; 2]);
        linearised.matrices.c = row(&[1e9]);
        linearised.states[0].typical = 1e-9;
        assert_eq!(direct_terms(&linearised), [row(&[0.5, 0.0]), row(&[0.0])]);
    }

    /// `y = x + max(u_1, 0)`: the difference at 0 is 1/2, and may be off by 1/2.
    #[test]
    fn a_direct_term_with_a_kink_is_kept() {
        let linearised = differences([&[-1.0], &[0.5, 0.0], &[0.0]], [0.0, 0.5]);
        assert_eq!(direct_terms(&linearised), [row(&[0.5, 0.0]), row(&[0.0])]);
    }

    /// `x' = |x| + 2 u_1 + u_2`: the difference at 0 is 0, and may be off by 1, half of the largest entry.
    #[test]
    fn the_inaccuracy_at_a_kink_is_half_of_its_jump_relative_to_the_row() {
        let linearised = differences([&[0.0], &[0.0; 2], &[0.0]], [1.0, 0.0]);
        assert_eq!(inaccuracy(&linearised), Some(0.5));
    }

    /// N m and N.m are one unit; rad and deg, K and degC are not.
    #[test]
    fn a_signal_of_an_fmu_has_the_unit_of_the_fmu() {
        let refusal = |stated: &str, unit: &str| {
            let text = format!(
                "A = [[-1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = \"all\"\n\
                 measurements = [{{ name = \"y\", unit = \"{stated}\" }}]\n"
            );
            let (name, unit) = ("y".to_owned(), Some(unit.to_owned()));
            let output = linearise::Signal { name, unit, value: 0.0, typical: 1.0 };
            let refusal =
                read(&text, |file| check_units(file, &file.measurements, &[output]).err());
            refusal.unwrap().map(|error| error.message().to_owned())
        };
        assert_eq!(refusal("N.m", "N m"), None);
        let message = "the FMU has `y` in rad; expected this unit, found deg";
        assert_eq!(refusal("deg", "rad").as_deref(), Some(message));
        assert!(refusal("degC", "K").is_some() && refusal("m", "s").is_some());
    }
}
