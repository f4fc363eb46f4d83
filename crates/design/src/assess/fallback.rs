//! The loops of the fall-back, case by case: decay, margins, price (relative H2 norm), and equilibrium.

use control::aso::Gains;
use control::controller::controller;
use control::lmi::Vertex;
use control::response::energy;
use control::robustness::{delay_margin, sampled_delay_margin};
use control::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, DVector};

use crate::assess::family::{common, reported};
use crate::assess::robustness::{Physical, loop_points, refine_delays};
use crate::budget::Budget;
use crate::matrix::rows;
use crate::plant::linear::LinearPlant;
use crate::plant::rest::{Rest, beyond_limits, commands};
use crate::report::fallback::{FallbackCase, FallbackReport};
use crate::report::robustness::{Level, LoopPoint, Number};
use crate::solve::fallback::{Cases, Fallback, LOSSES, remaining};
use crate::solve::solution::{Solution, looped};
use crate::solve::tracking::decay;
use plant_file::PlantFile;
use plant_file::signals::Signal;

/// Returns the report on the fall-back of `designed`; None if the plant file asks for none.
pub(crate) fn report(
    file: &PlantFile<'_>,
    designed: &Solution,
    fallback: &Fallback,
    budget: &Budget,
) -> Result<Option<FallbackReport>, crate::Error> {
    let Some(request) = &file.fallback else { return Ok(None) };
    let plants = Cases { designed, request };
    let gains = fallback.gains(designed);
    let intact = plants.whole(&designed.gains, None)?;
    let reference = noise(designed, &intact)?;
    let stuck_at =
        |actuator| file.reconfiguration.as_ref().map_or(0.0, |table| table.stuck_at(actuator));
    let examination = Examination { cases: plants, gains, reference };
    let plants = &examination.cases;
    let cases = plants.all().into_iter().enumerate();
    let cases = cases.map(|(at, case)| {
        examination.case(at, case.map(|actuator| (actuator, stuck_at(actuator))))
    });
    let cases = cases.collect::<Result<Vec<_>, _>>()?;
    let loops = plants.all().into_iter().map(|case| {
        let lossy = case.map(|actuator| (actuator, request.loss));
        plants.whole(&examination.gains, lossy)
    });
    let loops = loops.collect::<Result<Vec<_>, Error>>()?;
    let whole = common(&loops, designed.domain, budget, |at| plants.name(at))?;
    let whole_left_out = whole.is_err() && budget.is_over();
    Ok(Some(FallbackReport {
        loss: request.loss,
        method: fallback.method.clone(),
        decay: cases.iter().map(|case| case.decay).fold(f64::INFINITY, f64::min),
        compensates: fallback.k_f.is_some(),
        k_x: rows(&fallback.k_x),
        gain_norm: fallback.k_x.norm(),
        intact_gain_norm: designed.gains.k_x.norm(),
        intact_decay: decay(&intact, designed.domain)?,
        feedback: reported(&fallback.certificate),
        whole,
        whole_left_out,
        cases,
    }))
}

/// The examination of the cases of the fall-back.
struct Examination<'a> {
    cases: Cases<'a>,
    gains: Gains,
    /// H2 norms of the intact loop, one for each measurement, to which the norms of the cases are compared.
    reference: Vec<f64>,
}

impl Examination<'_> {
    /// Returns the case at a position; `failed`: the actuator of the case, and the command at which it is stuck if it
    /// is gone.
    fn case(&self, at: usize, failed: Option<(usize, f64)>) -> Result<FallbackCase, crate::Error> {
        let Cases { designed, request } = self.cases;
        let Solution { linear, extended, domain, .. } = designed;
        let actuator = failed.map(|(actuator, _)| actuator);
        let closed_loop = self
            .cases
            .whole(&self.gains, actuator.map(|failed_actuator| (failed_actuator, request.loss)))?;
        let Vertex { a, b } = self.cases.vertices().swap_remove(at);
        let fed_back = &a + &b * self.gains.k_x.columns(0, extended.states);
        let (points, delay_margin) = self.margins(actuator)?;
        let relative = |(signal, (norm, intact)): (&Signal, (&f64, &f64))| {
            let (name, value) = (signal.name.clone(), norm / intact);
            value.is_finite().then_some(Number { name, unit: None, value })
        };
        let noise = self::noise(designed, &closed_loop)?;
        let norms = linear.measurements.iter().zip(noise.iter().zip(&self.reference));
        let (equilibrium, stuck) = self.equilibrium(&closed_loop, failed)?;
        let commands = commands(&linear.actuators, &equilibrium.u, &stuck);
        let lost: Vec<_> = stuck.iter().map(|(actuator, _)| *actuator).collect();
        Ok(FallbackCase {
            name: self.cases.name(at),
            decay: decay(&closed_loop, *domain)?,
            feedback_decay: decay(&fed_back, *domain)?,
            points,
            delay_margin,
            price: norms.filter_map(relative).collect(),
            beyond_limits: beyond_limits(&linear.actuators, &commands, &lost),
            commands,
            measurements: equilibrium.measurements,
        })
    }

    /// Returns margins, and the delay margin in s, while an actuator has failed. An actuator that is gone is no input
    /// of the loop: the plant has no column and the controller no command for it, although the observer still has it.
    fn margins(&self, failed: Option<usize>) -> Result<(Vec<LoopPoint>, f64), Error> {
        let Cases { designed, request } = self.cases;
        let LinearPlant { actuators, measurements, .. } = &designed.linear;
        let Physical { mut plant, mut controller, .. } =
            Physical::of_gains(designed, &designed.linear, &self.gains)?;
        plant.b = remaining(&plant.b, failed, request.loss);
        let mut inputs = actuators.clone();
        if let Some(gone) = failed.filter(|_| request.loss >= 1.0) {
            inputs.remove(gone);
            (plant.b, plant.d) = (plant.b.remove_column(gone), plant.d.remove_column(gone));
            controller.c = controller.c.remove_row(gone);
            controller.d = controller.d.remove_row(gone);
        }
        let closed_loop = looped(&plant, &controller)?;
        let delay = match designed.domain {
            Domain::Continuous => delay_margin(&closed_loop),
            Domain::Sampled { .. } => sampled_delay_margin(&plant, &controller),
        };
        let mut points = loop_points(&closed_loop, &inputs, measurements)?;
        refine_delays(&mut points, &plant, &controller)?;
        Ok((points, delay?))
    }

    /// Returns the equilibrium of the loop, and the actuator with its command if it is gone.
    ///
    /// The input of the loop is what the failure adds to the actuator's command at the operating point: the stuck
    /// command less that command, or the lost part with a negative sign.
    fn equilibrium(
        &self,
        closed_loop: &DMatrix<f64>,
        failed: Option<(usize, f64)>,
    ) -> Result<(Rest, Vec<(usize, f64)>), Error> {
        let Cases { designed, request } = self.cases;
        let Solution { linear, plant, extended, domain, .. } = designed;
        let (n, order) = (plant.a.nrows(), closed_loop.nrows());
        let mut input = DVector::zeros(order);
        let mut stuck = Vec::new();
        if let Some((actuator, stuck_at)) = failed {
            let operating = linear.actuators[actuator].operating.unwrap_or(0.0);
            let gone = request.loss >= 1.0;
            let part = if gone { stuck_at - operating } else { -request.loss * operating };
            input.rows_mut(0, n).copy_from(&(plant.b.column(actuator) * part));
            stuck.extend(gone.then_some((actuator, stuck_at)));
        }
        let held = match domain {
            Domain::Continuous => -closed_loop,
            Domain::Sampled { .. } => DMatrix::identity(order, order) - closed_loop,
        };
        let solved = held.lu().solve(&input);
        let what = "the equilibrium of the fall-back";
        let solution = solved.ok_or(Error::NotConverged { what, iterations: 1 })?;
        let StateSpace { c, d, .. } = controller(plant, &self.gains, *domain)?;
        let x: DVector<f64> = solution.rows(0, n).into();
        let u = c * solution.rows(n, order - n) + d * &plant.c * &x;
        Ok((Rest::of(linear, &x.rows(0, extended.states).into(), u, true), stuck))
    }
}

/// Returns the H2 norms from white noise on the commands, before a loss, to the measurements of the closed loop.
fn noise(designed: &Solution, closed_loop: &DMatrix<f64>) -> Result<Vec<f64>, Error> {
    let Solution { linear, plant, domain, .. } = designed;
    let order = closed_loop.nrows();
    let b = plant.b.clone().resize_vertically(order, 0.0);
    let c = linear.c.clone().resize_horizontally(order, 0.0);
    let system = StateSpace::strictly_proper(closed_loop.clone(), b, c, *domain);
    Ok(energy(&system)?.peaks)
}

/// Returns the reasons that the fall-back adds to the verdict; `limit`: the peak of S above which a design is red and
/// its fall-back amber.
pub(crate) fn reasons(report: &FallbackReport, limit: f64) -> Vec<(Level, String)> {
    let mut reasons = Vec::new();
    let mut amber = |text: String| reasons.push((Level::Amber, text + " (amber)"));
    if let (Err(reason), false) = (&report.whole, report.whole_left_out) {
        amber(format!(
            "the fall-back is not proven for losses that change with time: {reason}; {LOSSES} constant \
             losses of each actuator alone were tested, and are stable"
        ));
    }
    for case in &report.cases {
        let name = &case.name;
        if !case.beyond_limits.is_empty() {
            let names = case.beyond_limits.join(", ");
            amber(format!(
                "the fall-back needs commands at rest beyond the limits of {names}, {name}"
            ));
        }
        let highest = case.points.iter().max_by(|x, y| x.judged.total_cmp(&y.judged));
        if let Some(point) = highest.filter(|point| point.judged > limit) {
            let (peak, place) = (point.judged, &point.point);
            amber(format!(
                "the peak of S of the fall-back at the {place}, {name}, is {peak:.3}, above {limit}"
            ));
        }
    }
    reasons
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::family::CommonCertificate;

    #[test]
    fn the_constant_losses_that_were_tested_are_counted() {
        let report = FallbackReport {
            loss: 0.5,
            method: String::new(),
            decay: 1.0,
            compensates: true,
            k_x: Vec::new(),
            gain_norm: 1.0,
            intact_gain_norm: 1.0,
            intact_decay: 1.0,
            feedback: CommonCertificate { p: Vec::new(), margin: 1.0 },
            whole: Err("no P was found".to_owned()),
            whole_left_out: false,
            cases: Vec::new(),
        };
        let reasons = reasons(&report, 4.0);
        let expected = "no P was found; 10 constant losses of each actuator alone were tested";
        assert!(reasons[0].1.contains(expected), "{}", reasons[0].1);
    }
}
