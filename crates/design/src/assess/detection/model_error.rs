//! The residuals that errors of the model cause without a fault.

mod parameter_box;

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use control::detection::UncertainPlant;
use control::robustness::{PlantFamily, Tolerances, random_deviations};
use control::{Domain, Error};
use nalgebra::{DMatrix, DVector};

use crate::assess::detection::decoupling::Decoupling;
use crate::plant::delays::with_delays;
use crate::plant::entries::tolerances;
use crate::plant::linear::LinearPlant;
use crate::plant::parameters::ParameterFamily;
use crate::solve::designed::Designed;
use plant_file::PlantFile;
use plant_file::detection::ModelError;
use plant_file::signals::Signal;

/// A linearised plant, and the largest deviation of each of its inputs from the operating point.
type Case = Rc<(UncertainPlant, DVector<f64>)>;

/// A bound of the means of residuals that errors of the model cause.
#[derive(Clone, Copy)]
pub(super) struct LargestMean {
    /// Norm of the largest mean in standard deviations, times the stated factor, [`ModelError::margin`].
    pub(super) mean: f64,
    /// For parameters of an FMU: relative excess of the largest mean in the interior over that at the corners.
    pub(super) interior_excess: Option<f64>,
}

/// The plants within the tolerances of `[robustness]`, and the bounds of the commands.
pub(super) struct ModelErrors<'a> {
    file: &'a PlantFile<'a>,
    request: &'a ModelError,
    /// The plant and the members of its family, with the tolerances of the entries unless `parameters` is stated.
    plants: Vec<UncertainPlant>,
    /// The FMU with the parameters that deviate, if there is one; all entries of `plants` are then exact.
    parameters: Option<&'a ParameterFamily<'a>>,
    /// The random cases: deviations of the parameters, from -1 to 1.
    random: Vec<Vec<f64>>,
    /// Cache of the linearised plants by the bits of the parameter deviations, because all tests need the same plants.
    cases: RefCell<HashMap<Vec<u64>, Case>>,
    /// The values of the measurements at the operating point.
    measured: DVector<f64>,
    domain: Domain,
    /// The largest deviation of each command from its operating point.
    bounds: DVector<f64>,
}

impl<'a> ModelErrors<'a> {
    pub(super) fn new(
        file: &'a PlantFile<'a>,
        request: &'a ModelError,
        designed: &Designed,
        parameters: Option<&'a ParameterFamily<'a>>,
    ) -> Result<Self, crate::Error> {
        let linear = &designed.nominal.linear;
        let bound = |(at, actuator): (usize, &Signal)| {
            let operating = actuator.operating.unwrap_or(0.0);
            let of_limits =
                actuator.limits.map(|[low, high]| (operating - low).max(high - operating));
            request.commands.get(at).copied().flatten().or(of_limits).ok_or_else(|| {
                let message = format!(
                    "the residuals of a wrong model are bounded only for bounded commands: expected \
                     `limits` of the actuator `{0}`, or commands.{0}, its largest deviation from the \
                     operating point",
                    actuator.name
                );
                file.error_at(&request.place, message)
            })
        };
        let bounds = linear.actuators.iter().enumerate().map(bound);
        let members = designed.family.iter().flat_map(|family| &family.members);
        let plants = std::iter::once(linear).chain(members.map(|member| &member.linear));
        Ok(Self {
            file,
            request,
            plants: plants.map(|plant| uncertain(plant, file)).collect(),
            parameters,
            random: parameters.map_or_else(Vec::new, |family| {
                let limits = &file.robustness;
                random_deviations(family.count(), limits.cases, u64::from(limits.seed))
            }),
            cases: RefCell::default(),
            measured: DVector::from_iterator(
                linear.measurements.len(),
                linear.measurements.iter().map(|signal| signal.operating.unwrap_or(0.0)),
            ),
            domain: designed.nominal.domain,
            bounds: DVector::from_vec(bounds.collect::<Result<_, _>>()?),
        })
    }

    /// Returns the largest mean of combinations of residuals: a bound for all plants whose entries are within their
    /// tolerances; for parameters of an FMU the largest bound of the plants that were tried, at the corners and inside.
    pub(super) fn largest_mean(
        &self,
        decoupling: &Decoupling<'_>,
        rows: &DMatrix<f64>,
    ) -> Result<LargestMean, crate::Error> {
        let scale = match self.domain {
            Domain::Sampled { .. } => 1.0,
            Domain::Continuous => decoupling.problem.period.sqrt(),
        };
        let scale = scale * self.request.margin;
        let Some(family) = self.parameters else {
            let bound = |plant| self.bound_of(plant, &self.bounds, decoupling, rows);
            let most = |most: f64, plant| Ok::<_, crate::Error>(most.max(bound(plant)?));
            let mean = scale * self.plants.iter().try_fold(0.0, most)?;
            return Ok(LargestMean { mean, interior_excess: None });
        };
        let largest = parameter_box::largest(family.count(), &self.random, |deviations| {
            let case = self.case(family, deviations)?;
            self.bound_of(&case.0, &case.1, decoupling, rows)
        })?;
        let excess =
            if largest.corners > 0.0 { largest.everywhere / largest.corners - 1.0 } else { 0.0 };
        Ok(LargestMean { mean: scale * largest.everywhere, interior_excess: Some(excess) })
    }

    /// Returns the number of random cases of the parameters of an FMU; None if no parameters vary.
    pub(super) fn random_cases(&self) -> Option<usize> {
        self.parameters.map(|_| self.random.len())
    }

    /// Returns [`Self::with_parameters`], computed once for each point.
    fn case(&self, family: &ParameterFamily<'_>, deviations: &[f64]) -> Result<Case, crate::Error> {
        let key: Vec<u64> = deviations.iter().map(|deviation| deviation.to_bits()).collect();
        if let Some(case) = self.cases.borrow().get(&key) {
            return Ok(Rc::clone(case));
        }
        let case = Rc::new(self.with_parameters(family, deviations)?);
        self.cases.borrow_mut().insert(key, Rc::clone(&case));
        Ok(case)
    }

    /// Returns the linearised FMU with other parameters, and the bounds of its inputs. This plant is not at rest at the
    /// operating point of the plant file: an additional input, always 1, stands for the rates of the states and the
    /// changes of the measurements at this point.
    fn with_parameters(
        &self,
        family: &ParameterFamily<'_>,
        deviations: &[f64],
    ) -> Result<(UncertainPlant, DVector<f64>), crate::Error> {
        let (plant, rates, measured) = family.at_operating_point(deviations)?;
        let [rates, offsets] =
            [rates, measured - &self.measured].map(|column| DMatrix::from_columns(&[column]));
        let plant = with_delays(self.file, &plant, [&rates, &offsets])?;
        let exact = |of: &DMatrix<f64>| DMatrix::zeros(of.nrows(), of.ncols());
        let sizes = [exact(&plant.a), exact(&plant.b), exact(&plant.c)];
        Ok((UncertainPlant { nominal: plant, sizes }, self.bounds.clone().push(1.0)))
    }

    /// Returns the norm of the bounds of combinations of residuals for a plant whose inputs are within `bounds`.
    fn bound_of(
        &self,
        plant: &UncertainPlant,
        bounds: &DVector<f64>,
        decoupling: &Decoupling<'_>,
        rows: &DMatrix<f64>,
    ) -> Result<f64, crate::Error> {
        let refuse = |message: String| self.file.error_at(&self.request.place, message);
        let mut filter = decoupling.filter.generator.clone();
        let inputs = bounds.len();
        filter.b_u = filter.b_u.resize_horizontally(inputs, 0.0);
        filter.d_u = filter.d_u.resize_horizontally(inputs, 0.0);
        let bound = plant.largest_mean(&filter, rows, bounds).map_err(|error| match error {
            error @ (Error::NotHurwitz { .. } | Error::NotSchur { .. }) => refuse(format!(
                "the residuals of a wrong model are bounded only if the plant is stable without the \
                 controller: {error}"
            )),
            error => refuse(error.to_string()),
        })?;
        let bounds = bound.ok_or_else(|| {
            refuse(
                "the tolerances of [robustness] are too large for a bound of the residuals: expected smaller \
                 ones, or `parameters` if the plant is an FMU"
                    .to_owned(),
            )
        })?;
        Ok(bounds.norm())
    }
}

/// Returns the linear plant without D, with the largest errors of its entries within the tolerances.
fn uncertain(linear: &LinearPlant, file: &PlantFile<'_>) -> UncertainPlant {
    let mut nominal = linear.state_space();
    let Tolerances { of: [a, b, c, _], .. } =
        tolerances(linear, file.delay_order, &file.robustness).placed;
    nominal.d.fill(0.0);
    let sizes = [
        a.component_mul(&nominal.a.abs()),
        b.component_mul(&nominal.b.abs()),
        c.component_mul(&nominal.c.abs()),
    ];
    UncertainPlant { nominal, sizes }
}
