//! The residuals that errors of the model cause without a fault.

use control::hold::zero_order_hold;
use control::response::peak_gain;
use control::robustness::{EntryFamily, PlantFamily, Tolerances};
use control::{Domain, StateSpace};
use nalgebra::DMatrix;

use super::decoupling::Decoupling;
use super::problem::Problem;
use crate::designed::ControllerDesign;
use crate::detection_request::ModelError;
use crate::linear_plant::LinearPlant;
use crate::parameters::ParameterFamily;
use crate::plant_file::PlantFile;

/// Relative width of the bracket of a peak gain.
const WIDTH: f64 = 1e-2;

/// The plants within the tolerances of `[robustness]`, and the bounds of the commands.
pub(super) struct ModelErrors<'a> {
    plants: Plants<'a>,
    domain: Domain,
    /// The largest deviation of each command from its operating point.
    bounds: Vec<f64>,
    /// Factor of the largest residual that is found.
    margin: f64,
}

enum Plants<'a> {
    Entries(Box<(StateSpace, Tolerances)>),
    Parameters(&'a ParameterFamily<'a>),
}

impl<'a> ModelErrors<'a> {
    pub(super) fn new(
        file: &PlantFile<'_>,
        request: &ModelError,
        (linear, designed): (&LinearPlant, &ControllerDesign),
        family: Option<&'a ParameterFamily<'a>>,
    ) -> Result<Self, crate::Error> {
        let bound = |(at, actuator): (usize, &crate::signals::Signal)| {
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
        let plant = StateSpace {
            a: linear.a.clone(),
            b: linear.b.clone(),
            c: linear.c.clone(),
            d: DMatrix::zeros(linear.c.nrows(), linear.b.ncols()),
            domain: Domain::Continuous,
        };
        let tolerances = Tolerances::of_values(&plant, file.robustness.tolerance);
        Ok(Self {
            plants: family
                .map_or_else(|| Plants::Entries(Box::new((plant, tolerances))), Plants::Parameters),
            domain: designed.domain,
            bounds: linear.actuators.iter().enumerate().map(bound).collect::<Result<_, _>>()?,
            margin: request.margin,
        })
    }

    /// The largest mean of a combination of residuals that was found, in standard deviations, times the
    /// margin. From the nominal plant, each parameter in turn goes to the limit that makes it worse, twice.
    pub(super) fn largest_mean(
        &self,
        problem: &Problem,
        (decoupling, rows): (&Decoupling, &DMatrix<f64>),
    ) -> Result<f64, crate::Error> {
        let mean = |plant: StateSpace| self.mean_of(problem, (decoupling, rows), plant);
        let found = match &self.plants {
            Plants::Entries(nominal) => {
                let (plant, tolerances) = &**nominal;
                let family = EntryFamily::new(plant, tolerances)?;
                search(family.count(), |deviations| mean(family.plant(deviations)?))
            }
            Plants::Parameters(family) => {
                search(family.count(), |deviations| mean(family.plant(deviations)?))
            }
        };
        Ok(found? * self.margin)
    }

    /// The largest mean of the residuals of a plant for all commands within their bounds.
    fn mean_of(
        &self,
        problem: &Problem,
        (decoupling, rows): (&Decoupling, &DMatrix<f64>),
        mut plant: StateSpace,
    ) -> Result<f64, crate::Error> {
        let mut scale = problem.period.sqrt();
        if let Domain::Sampled { period } = self.domain {
            (plant.a, plant.b) = zero_order_hold(&plant.a, &plant.b, period)?;
            scale = 1.0;
        }
        let filter = &decoupling.filter.generator;
        let (n, k) = (plant.a.nrows(), filter.a.nrows());
        let mut a = DMatrix::zeros(n + k, n + k);
        a.view_mut((0, 0), (n, n)).copy_from(&plant.a);
        a.view_mut((n, 0), (k, n)).copy_from(&(&filter.b_y * &plant.c));
        a.view_mut((n, n), (k, k)).copy_from(&filter.a);
        let mut b = plant.b.clone().resize_vertically(n + k, 0.0);
        b.rows_mut(n, k).copy_from(&filter.b_u);
        let mut c = DMatrix::zeros(rows.nrows(), n + k);
        c.columns_mut(0, n).copy_from(&(rows * &filter.d_y * &plant.c));
        c.columns_mut(n, k).copy_from(&(rows * &filter.c));
        let d = rows * &filter.d_u;
        let gain = peak_gain(&StateSpace { a, b, c, d, domain: self.domain }, WIDTH)?.upper;
        let of_row = |row: usize| -> f64 {
            self.bounds.iter().enumerate().map(|(j, bound)| gain[(row, j)] * bound).sum()
        };
        Ok((0..rows.nrows()).map(of_row).fold(0.0_f64, f64::hypot) * scale)
    }
}

/// The largest value at the ends of one deviation, and then from there on at vertices.
fn search(
    count: usize,
    value: impl Fn(&[f64]) -> Result<f64, crate::Error>,
) -> Result<f64, crate::Error> {
    let mut best = vec![0.0; count];
    let mut largest = value(&best)?;
    for at in (0..count).chain(0..count) {
        for end in [-1.0, 1.0] {
            let mut other = best.clone();
            other[at] = end;
            let found = value(&other)?;
            if found > largest {
                (largest, best) = (found, other);
            }
        }
    }
    Ok(largest)
}
