//! Computes how the references act: the plant of the feedback, integral action or feedforward, the
//! conditions for both.

use control::aso::{FaultyPlant, Gains};
use control::controller::{CompleteController, complete_controller, with_feedthrough};
use control::faults::{ExtendedPlant, FaultEntry};
use control::stability::instability;
use control::tracking::{
    IntegralAction, IntegralFeedforward, TrackingRank, extended_pair, feedforward,
    integral_feedforward, tracking_rank, windup_gain,
};
use control::{Domain, Error, StateSpace};
use files::PlaceError;
use nalgebra::DMatrix;

use crate::plant::linear::LinearPlant;
use control::blocks::beside;
use plant_file::PlantFile;
use plant_file::references::References;
use plant_file::requirements::Requirement;
use plant_file::signals::{Signal, is_one_unit, signal_names};
use plant_file::variants::Variant;

/// Relative error at rest below which a constant reference counts as reached.
pub(crate) const REACHED: f64 = 1e-9;

/// The references of a design.
pub(crate) struct Tracking {
    /// The references, with operating points and units.
    pub(crate) signals: Vec<Signal>,
    /// The size of the step of each reference that the report shows, if stated.
    pub(crate) steps: Vec<Option<f64>>,
    /// H, t x p, from the measurements to the quantities that follow references.
    pub(crate) h: DMatrix<f64>,
    /// H C, t x n, of the plant without filter.
    pub(crate) output: DMatrix<f64>,
    pub(crate) action: TrackingAction,
}

/// How the references act.
pub(crate) enum TrackingAction {
    /// Integral action, whose gain is in the design's gains.
    Integral {
        /// L_w, t x m, the gain of the back-calculation, if commands have limits.
        windup: Option<DMatrix<f64>>,
        /// Time constant of the back-calculation, s.
        windup_time: f64,
        /// N_r and the modes that N_r does not excite, if there is a feedforward beside the integrals.
        feedforward: Option<IntegralFeedforward>,
    },
    /// N_r, m x t, from the references to the commands.
    Feedforward(DMatrix<f64>),
}

/// Checks that the reference of a measurement has the unit of the measurement, that the plant can hold each reference
/// at every constant value, and that integral action with `h_infinity` has a required decay rate.
pub(crate) fn check_references(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
) -> Result<(), PlaceError> {
    let Some(References { signals, h, places, integral, .. }) = &file.references else {
        return Ok(());
    };
    for ((signal, row), place) in signals.iter().zip(h.row_iter()).zip(places) {
        let mut terms = row.iter().zip(&linear.measurements).filter(|(weight, _)| **weight != 0.0);
        if let (Some((weight, measurement)), None) = (terms.next(), terms.next())
            && (weight - 1.0).abs() == 0.0
            && let (Some(stated), Some(unit)) = (&signal.unit, &measurement.unit)
            && !is_one_unit(stated, unit)
        {
            let message = format!(
                "the measurement `{}` is in {unit}, and its reference is compared with it; expected this unit, found \
                 {stated}",
                measurement.name
            );
            return Err(file.error_at(place, message));
        }
    }
    let count = signals.len();
    let names = signal_names(signals);
    let commands = linear.actuators.len();
    if count > commands {
        let message = format!(
            "{count} references ({names}) need at least {count} commands, found {commands}; expected \
             fewer references"
        );
        return Err(file.error_at(&places[commands], message));
    }
    let TrackingRank { rank, expected, outputs, .. } =
        tracking_rank(&linear.a_at_rest(), &linear.b, &(h * &linear.c))
            .map_err(|error| file.error(&["reference"], error.to_string()))?;
    if outputs < count {
        let message = format!(
            "the references {names} are set points of {outputs} independent combination{} of the \
             states only, so that one of them follows from the others; expected fewer references",
            if outputs == 1 { "" } else { "s" }
        );
        return Err(file.error_at(&places[count - 1], message));
    }
    if rank < expected {
        let action = if *integral { "integral action" } else { "feedforward" };
        let (matrix, zero) = match linear.domain {
            Domain::Continuous => ("A", "s = 0"),
            Domain::Sampled { .. } => ("A - I", "z = 1"),
        };
        let message = format!(
            "no {action} exists for {names}: the commands cannot hold every constant value of what is to \
             follow (rank [{matrix}, B; H C, 0] is {rank}, expected {expected}: the plant has a zero at {zero}, \
             or its commands act on these outputs in one direction); expected other measurements, a \
             position in place of its speed for example"
        );
        return Err(file.error(&["reference"], message));
    }
    if *integral
        && let Requirement::HInfinity { region, .. } = &file.feedback.requirement
        && region.decay.is_none()
    {
        let message = "with integral action, `h_infinity` also needs `region` with `decay`: the norm from \
                       faults to measurements and commands alone leaves the integrals arbitrarily slow";
        return Err(file.error_at(&file.feedback.place, message));
    }
    Ok(())
}

/// Checks that a member of a family can hold each reference at every constant value.
pub(crate) fn check_member(
    file: &PlantFile<'_>,
    variant: &Variant,
    linear: &LinearPlant,
) -> Result<(), PlaceError> {
    let Some(References { h, .. }) = &file.references else { return Ok(()) };
    let rank = tracking_rank(&linear.a_at_rest(), &linear.b, &(h * &linear.c))
        .map_err(|error| file.error_at(&variant.place, error.to_string()))?;
    if rank.is_full() {
        return Ok(());
    }
    let message = format!(
        "no integral action exists for the member `{}`: its commands cannot hold every constant value of \
         what is to follow (rank [A, B; H C, 0] is {}, expected {}); expected a member without a \
         zero at s = 0",
        variant.name, rank.rank, rank.expected
    );
    Err(file.error_at(&variant.place, message))
}

/// Returns A and B of the system that the state feedback controls: the plant, extended by the integrals as last states
/// if the references have integral action. `plant`: A, B and C.
pub(crate) fn feedback_pair(
    references: Option<&References>,
    plant: [&DMatrix<f64>; 3],
    domain: Domain,
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let [a, b, c] = plant;
    match references.filter(|references| references.integral) {
        Some(References { h, .. }) => extended_pair(a, b, &(h * c), domain),
        None => Ok((a.clone(), b.clone())),
    }
}

/// Returns the integral action with the gain K = [K_x, K_i] of the feedback; None if no references are integrated.
pub(crate) fn integral_action(
    references: Option<&References>,
    linear: &LinearPlant,
    extended: &ExtendedPlant,
    k: &DMatrix<f64>,
) -> Option<IntegralAction> {
    let References { h, .. } = references.filter(|references| references.integral)?;
    let (all, q) = extended.plant.f_a.shape();
    let mut faults = DMatrix::zeros(h.nrows(), q);
    for (model, channel) in linear.models.iter().zip(&extended.channels) {
        if let FaultEntry::Sensor(column) = &model.entry {
            faults.set_column(channel.estimate, &(h * column));
        }
    }
    Some(IntegralAction {
        h: h.clone(),
        output: (h * &linear.c).resize_horizontally(all, 0.0),
        faults,
        gain: k.columns(extended.states, h.nrows()).into(),
    })
}

/// The data for which the action of the references is computed.
pub(crate) struct TrackingProblem<'a> {
    pub(crate) file: &'a PlantFile<'a>,
    pub(crate) linear: &'a LinearPlant,
    /// A of the plant, in the domain of the design.
    pub(crate) a: &'a DMatrix<f64>,
    /// B of the plant, in the domain of the design.
    pub(crate) b: &'a DMatrix<f64>,
    pub(crate) gains: &'a Gains,
    /// A + B K of [`feedback_pair`].
    pub(crate) feedback: &'a DMatrix<f64>,
    pub(crate) domain: Domain,
}

impl TrackingProblem<'_> {
    /// Returns the references of the file and their action; None if the file has no references.
    pub(crate) fn solve(&self) -> Result<Option<Tracking>, PlaceError> {
        let Self { file, linear, a, b, gains, feedback, domain } = *self;
        let Some(references) = &file.references else { return Ok(None) };
        let refuse = |error: Error| file.error(&["reference"], error.to_string());
        let output = &references.h * &linear.c;
        let k_x = gains.k_x.columns(0, linear.a.nrows()).into_owned();
        let action = if let Some(integral) = &gains.integral {
            let rate = references.windup_time.map(f64::recip);
            let rate = rate.map_or_else(|| decay(feedback, domain), Ok).map_err(refuse)?;
            let range = |signal: &Signal| signal.limits.map(|[low, high]| high - low);
            let ranges: Vec<_> = linear.actuators.iter().map(range).collect();
            let windup = windup_gain(&integral.gain, &ranges, rate, domain).map_err(refuse)?;
            let k = beside(&k_x, &integral.gain);
            let feedforward = references.feedforward.then(|| {
                let gain = integral_feedforward(a, b, &output, &k, domain).map_err(refuse)?;
                gain.map_err(|reason| without_feedforward(references, file, reason))
            });
            TrackingAction::Integral {
                windup: ranges.iter().any(Option::is_some).then_some(windup),
                windup_time: rate.recip(),
                feedforward: feedforward.transpose()?,
            }
        } else {
            let n_r = feedforward(a, b, &output, &k_x, domain).map_err(refuse)?;
            TrackingAction::Feedforward(n_r)
        };
        Ok(Some(Tracking {
            signals: references.completed(&linear.measurements),
            steps: references.steps.clone(),
            h: references.h.clone(),
            output,
            action,
        }))
    }
}

/// Returns the refusal of a feedforward beside integrals.
fn without_feedforward(references: &References, file: &PlantFile<'_>, reason: &str) -> PlaceError {
    let message = format!(
        "no feedforward beside the integrals leaves the slowest modes of the feedback at rest: \
         {reason}; or `feedforward = false`"
    );
    file.error_at(&references.action_places[1], message)
}

impl Tracking {
    /// Returns N_r, m x t, if the references act by a feedforward, alone or beside integrals.
    pub(crate) fn feedforward(&self) -> Option<&DMatrix<f64>> {
        match &self.action {
            TrackingAction::Feedforward(n_r) => Some(n_r),
            TrackingAction::Integral { feedforward, .. } => Some(&feedforward.as_ref()?.gain),
        }
    }

    /// Returns L_w, t x m, if there is a back-calculation.
    pub(crate) fn windup(&self) -> Option<&DMatrix<f64>> {
        match &self.action {
            TrackingAction::Feedforward(_) => None,
            TrackingAction::Integral { windup, .. } => windup.as_ref(),
        }
    }
}

/// Returns the decay rate of the slowest eigenvalue, 1/s; negative if it grows.
pub(crate) fn decay(dynamics: &DMatrix<f64>, domain: Domain) -> Result<f64, Error> {
    Ok(domain.decay_rate(instability(dynamics, domain)?))
}

/// The loop of the design: a plant, and the controller from its measurements to its commands.
#[derive(Clone)]
pub(crate) struct DesignLoop {
    /// The model in the observer; with integral action, which receives the measurements before their
    /// filter, the plant without filter.
    pub(crate) plant: FaultyPlant,
    /// The controller, with integral action together with the filter.
    pub(crate) controller: StateSpace,
}

/// Plant, filter and time domain for which a loop is computed.
#[derive(Clone, Copy)]
pub(crate) struct LoopModel<'a> {
    /// The plant without measurement filter.
    pub(crate) linear: &'a LinearPlant,
    /// The model in the observer.
    pub(crate) plant: &'a FaultyPlant,
    /// The coefficients of the measurement filter.
    pub(crate) filter: Option<&'a [f64]>,
    pub(crate) domain: Domain,
}

impl LoopModel<'_> {
    /// Returns the loop of the model in the observer and the controller with `gains`.
    pub(crate) fn design_loop(self, gains: &Gains) -> Result<DesignLoop, Error> {
        let Self { linear, plant, filter, domain } = self;
        if gains.integral.is_none() {
            let controller = control::controller::controller(plant, gains, domain)?;
            return Ok(DesignLoop { plant: plant.clone(), controller });
        }
        let n = linear.a.nrows();
        let faulty = FaultyPlant {
            a: plant.a.view((0, 0), (n, n)).into(),
            b: plant.b.rows(0, n).into(),
            c: linear.c.clone(),
            f_a: plant.f_a.rows(0, n).into(),
            a_f: plant.a_f.clone(),
        };
        let whole = complete_controller(plant, gains, filter, domain)?;
        Ok(DesignLoop { plant: faulty, controller: whole.commands })
    }

    /// Returns the controller with `gains`, its filter and its integrals. With direct feedthrough the controller
    /// subtracts D u from the measurements.
    pub(crate) fn complete(self, gains: &Gains) -> Result<CompleteController, Error> {
        let controller = complete_controller(self.plant, gains, self.filter, self.domain)?;
        if !self.linear.has_feedthrough() {
            return Ok(controller);
        }
        let complete = |system| with_feedthrough(system, &controller.commands.c, &self.linear.d);
        Ok(CompleteController {
            commands: complete(&controller.commands)?,
            estimates: complete(&controller.estimates)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::read;

    /// A combination has a unit of its own: 0.001 of millimetres are metres.
    #[test]
    fn the_reference_of_a_measurement_has_its_unit() {
        let refusal = |track: &str| {
            let text = format!(
                "A = [[-1]]\nB = [[1]]\nC = [[1]]\nactuator_faults = \"all\"\n\
                 measurements = [{{ name = \"y\", unit = \"mm\" }}]\nreference.track = [{{ {track} }}]\n"
            );
            let refusal =
                read(&text, |file| check_references(file, &LinearPlant::of(file).unwrap()).err());
            refusal.unwrap().map(|error| error.message().to_owned())
        };
        assert_eq!(refusal("measurement = \"y\", unit = \"mm\""), None);
        assert_eq!(refusal("combination = { y = 0.001 }, name = \"r\", unit = \"m\""), None);
        let message = refusal("measurement = \"y\", unit = \"m\"").unwrap();
        assert!(message.ends_with("expected this unit, found m"), "{message}");
    }

    /// A difference of 5 degC is no temperature of 278.15 K.
    #[test]
    fn the_reference_of_temperatures_in_degrees_celsius_has_this_unit_only_if_it_is_a_mean() {
        let unit_of = |combination: &str, unit: &str| {
            let text = format!(
                "A = [[-1, 0], [0, -2]]\nB = [[1], [1]]\nC = [[1, 0], [0, 1]]\nactuator_faults = \"all\"\n\
                 measurements = [{{ name = \"y\", unit = \"{unit}\" }}, {{ name = \"z\", unit = \"{unit}\" }}]\n\
                 reference.track = [{{ name = \"r\", combination = {{ {combination} }} }}]\n"
            );
            let completed = |references: &References, measurements: &[Signal]| {
                references.completed(measurements)[0].unit.clone()
            };
            let unit = read(&text, |file| {
                file.references.as_ref().map(|references| completed(references, &file.measurements))
            });
            unit.unwrap().unwrap()
        };
        assert_eq!(unit_of("y = 0.5, z = 0.5", "degC").as_deref(), Some("degC"));
        assert_eq!(unit_of("y = 1.0, z = -1.0", "degC"), None);
        assert_eq!(unit_of("y = 1.0, z = -1.0", "m").as_deref(), Some("m"));
    }
}
