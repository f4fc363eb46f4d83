//! The plants of an FMU whose parameters vary within the tolerances that the plant file states.

use control::robustness::PlantFamily;
use control::{Domain, StateSpace};
use fmu_description::{Causality, Kind};
use fmu_import::Fmu;
use linearise::{Linearise, linearise};
use nalgebra::{DMatrix, DVector};

use crate::plant::delays::{self, JUDGED};
use crate::plant::linear;
use crate::report::robustness::Parameter;
use plant_file::parameters::{ParameterTolerance, Tolerance};
use plant_file::{PlantFile, PlantFmu};

/// Number of equal steps in which the worst direction is followed to the limits.
const STEPS: u32 = 20;

/// The linearised FMU as a function of its parameters.
pub(crate) struct ParameterFamily<'a> {
    file: &'a PlantFile<'a>,
    table: &'a PlantFmu,
    fmu: Fmu,
    request: Linearise,
    parameters: Vec<FmuParameter>,
    /// Half of the change of A, B, C and D from the lowest to the highest value of each parameter.
    directions: Vec<[DMatrix<f64>; 4]>,
}

/// A parameter of the FMU that varies.
struct FmuParameter {
    name: String,
    unit: Option<String>,
    nominal: f64,
    limits: [f64; 2],
}

impl<'a> ParameterFamily<'a> {
    /// Returns the family that the plant file asks for; None without an FMU, or without `parameters`.
    pub(crate) fn of(file: &'a PlantFile<'a>) -> Result<Option<Self>, crate::Error> {
        let tolerances = &file.robustness.parameters;
        let plant_file::Model::Fmu(table) = &file.model else { return Ok(None) };
        if tolerances.is_empty() {
            return Ok(None);
        }
        let fmu = linear::open(file, table)?;
        let parameters = tolerances
            .iter()
            .map(|tolerance| resolve(file, table, &fmu, tolerance))
            .collect::<Result<Vec<_>, _>>()?;
        let request = linear::request(file, table);
        let directions = Vec::new();
        let mut family = Self { file, table, fmu, request, parameters, directions };
        family.directions =
            (0..family.count()).map(|at| family.direction(at)).collect::<Result<_, _>>()?;
        Ok(Some(family))
    }

    fn direction(&self, at: usize) -> Result<[DMatrix<f64>; 4], crate::Error> {
        let end = |deviation: f64| {
            let mut deviations = vec![0.0; self.count()];
            deviations[at] = deviation;
            self.at_operating_point(&deviations)
        };
        let ((high, ..), (low, ..)) = (end(1.0)?, end(-1.0)?);
        let half = |high, low| (high - low) * 0.5;
        Ok([half(high.a, low.a), half(high.b, low.b), half(high.c, low.c), half(high.d, low.d)])
    }

    /// Linearises the FMU at the operating point of the plant file, with other parameters. Returns the plant without
    /// its delays, the rates of its states there, and its measurements.
    pub(crate) fn at_operating_point(
        &self,
        deviations: &[f64],
    ) -> Result<(StateSpace, DVector<f64>, DVector<f64>), crate::Error> {
        let mut request = self.request.clone();
        let mut values = Vec::with_capacity(deviations.len());
        for (parameter, deviation) in self.parameters.iter().zip(deviations) {
            let value = parameter.value(*deviation).to_string();
            values.push(format!("{} = {value}", parameter.name));
            request.at.retain(|(name, _)| *name != parameter.name);
            request.at.push((parameter.name.clone(), value));
        }
        let linearised = linearise(&self.fmu, &request).map_err(|error| {
            let (path, values) = (self.table.path.display(), values.join(", "));
            let message = format!("{path} with {values}: {error}");
            crate::Error::from(self.file.error(&["robustness"], message))
        })?;
        let measured = linearised.outputs.iter().map(|signal| signal.value);
        let measured = DVector::from_iterator(linearised.outputs.len(), measured);
        let [d, _] = linear::direct_terms(&linearised);
        let linearise::Matrices { a, b, c, .. } = linearised.matrices;
        let plant = StateSpace { a, b, c, d, domain: Domain::Continuous };
        Ok((plant, DVector::from_vec(linearised.rates), measured))
    }

    /// Returns the parameters for the report; `deviations`: the parameter deviations of the worst plant; `peaks`:
    /// derivatives of the peaks of S at the commands and at the measurements with respect to the entries.
    pub(crate) fn report(&self, deviations: &[f64], peaks: &[[DMatrix<f64>; 4]]) -> Vec<Parameter> {
        let effects: Vec<Vec<f64>> = peaks.iter().map(|entries| self.slopes(entries)).collect();
        let one = |(at, parameter): (usize, &FmuParameter)| Parameter {
            name: parameter.name.clone(),
            unit: parameter.unit.clone(),
            value: parameter.nominal,
            limits: parameter.limits,
            worst: parameter.value(deviations[at]),
            effects: effects.iter().map(|point| point[at]).collect(),
        };
        self.parameters.iter().enumerate().map(one).collect()
    }
}

impl FmuParameter {
    /// Returns the value at a deviation between -1, the lower limit, and 1, the upper one; linear on either side of 0.
    fn value(&self, deviation: f64) -> f64 {
        let [low, high] = self.limits;
        let end = if deviation < 0.0 { low } else { high };
        self.nominal + (end - self.nominal) * deviation.abs()
    }
}

/// Finds a parameter in the FMU, with its value at the operating point and its limits. Refuses a variable that is no
/// real parameter, and limits that do not contain the value or exceed `min` and `max`.
fn resolve(
    file: &PlantFile<'_>,
    table: &PlantFmu,
    fmu: &Fmu,
    parameter: &ParameterTolerance,
) -> Result<FmuParameter, crate::Error> {
    let ParameterTolerance { name, tolerance, place } = parameter;
    let refused = |message: String| crate::Error::from(file.error_at(place, message));
    let description = fmu.description();
    let variable = description.variable(name).ok_or_else(|| {
        let nearest = fmu_description::similar::nearest(description, name);
        refused(format!("{} has no variable {name:?}{nearest}", description.model_name))
    })?;
    let real = match (&variable.kind, variable.causality) {
        (Kind::Real(real), Causality::Parameter) if variable.dimensions.is_empty() => real,
        (kind, causality) => {
            let (kind, causality) = (kind.element(), causality.as_str());
            return Err(refused(format!(
                "{name}: expected a parameter of type Real, found {kind} of causality {causality}"
            )));
        }
    };
    let stated = table.operating_point.iter().find(|(other, _)| other == name);
    let nominal = stated.map(|(_, value)| *value).or(real.start).ok_or_else(|| {
        refused(format!("{name} has no start value; `operating_point` can state it"))
    })?;
    let limits = match *tolerance {
        Tolerance::Relative(_) if nominal.abs() <= 0.0 => {
            return Err(refused(format!(
                "{name} is 0, of which a fraction is nothing: expected the lowest and the highest \
                 value, {name} = [low, high]"
            )));
        }
        Tolerance::Relative(fraction) => {
            let half_width = fraction * nominal.abs();
            [nominal - half_width, nominal + half_width]
        }
        Tolerance::Limits(limits) => limits,
    };
    let [low, high] = limits;
    if !(low <= nominal && nominal <= high && low < high) {
        return Err(refused(format!(
            "{name}: expected limits around its value {nominal}, found {low} and {high}"
        )));
    }
    let allowed = real.min.is_none_or(|min| min <= low) && real.max.is_none_or(|max| high <= max);
    if !allowed {
        let end = |end: Option<f64>| end.map_or_else(|| "none".to_owned(), |end| end.to_string());
        return Err(refused(format!(
            "{name}: {low} to {high} is not within `min` ({}) and `max` ({}) of the FMU",
            end(real.min),
            end(real.max)
        )));
    }
    Ok(FmuParameter { name: name.clone(), unit: real.unit.clone(), nominal, limits })
}

impl PlantFamily for ParameterFamily<'_> {
    type Error = crate::Error;

    fn count(&self) -> usize {
        self.parameters.len()
    }

    /// Linearises the FMU at the operating point of the plant file, with other parameters and its delays.
    fn plant(&self, deviations: &[f64]) -> Result<StateSpace, crate::Error> {
        let (undelayed, ..) = self.at_operating_point(deviations)?;
        Ok(delays::of(self.file).approximated(&undelayed, JUDGED)?)
    }

    /// `entries`: derivatives with respect to the entries of [`Self::plant`].
    fn slopes(&self, entries: &[DMatrix<f64>; 4]) -> Vec<f64> {
        let n = self.directions.first().map_or(0, |[a, ..]| a.nrows());
        let entries = &delays::of(self.file).of_plant(n, JUDGED, entries);
        let slope = |direction: &[DMatrix<f64>; 4]| {
            direction.iter().zip(entries).map(|(change, slopes)| change.dot(slopes)).sum()
        };
        self.directions.iter().map(slope).collect()
    }

    /// Returns [`STEPS`] multiples in equal steps up to 1, the limits: beyond them a parameter may have no meaning.
    fn multiples(&self) -> Vec<f64> {
        (1..=STEPS).map(|step| f64::from(step) / f64::from(STEPS)).collect()
    }
}
