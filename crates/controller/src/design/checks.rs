//! The checks of a design file: counts, shapes, ranges, entries that belong together.

use super::{Defaults, Design, Estimator, Fault, Measurement, Reason, SlidingMode};
use crate::channel::channel;
use crate::matrix::Matrix;

/// Range of `least_command`: its square and the inverse of the square are finite.
const COMMANDS: std::ops::RangeInclusive<f64> = 1e-100..=1e100;
/// The most samples in a step of the default experiment.
const MOST_SAMPLES: f64 = 1e6;

/// A number that is out of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value}, expected {rule}")]
pub struct Refusal {
    /// The name of the entry.
    pub name: String,
    /// The value of the entry.
    pub value: f64,
    /// The allowed range of the entry.
    pub rule: &'static str,
}

impl Refusal {
    pub(super) fn new(name: String, value: f64, rule: &'static str) -> Self {
        Self { name, value, rule }
    }

    /// The first element of a matrix that is not finite.
    pub(super) fn of_matrix(name: &str, matrix: &Matrix) -> Option<Self> {
        let k = matrix.values.iter().position(|value| !value.is_finite())?;
        Some(Self::new(matrix.element(name, k), matrix.values[k], "a finite number"))
    }
}

impl Design {
    /// Checks combinations of entries, names that refer to others, shapes, the schedule and ranges, in this order.
    pub(super) fn check(&self) -> Result<(), Reason> {
        let entry = |contradiction| Err(Reason::Entry(contradiction));
        self.contradiction().map_or(Ok(()), entry)?;
        self.check_shapes()?;
        self.contradiction_of_schedule().map_or(Ok(()), entry)?;
        let refused = self.refused_number().or_else(|| self.refused_signal());
        let refused = refused.or_else(|| self.refused_time());
        refused.map_or(Ok(()), |refusal| Err(Reason::Value(refusal)))
    }

    fn check_shapes(&self) -> Result<(), Reason> {
        let n = ("states", self.states.len());
        let m = ("actuators", self.actuators.len());
        let p = ("measurements", self.measurements.len());
        let q = ("faults", self.faults.len());
        let t = ("references", self.references.len());
        let expected = |name| match name {
            "A" => (n, n),
            "B" => (n, m),
            "C" => (p, n),
            "D" => (p, m),
            "F_a" => (n, q),
            "K_x" => (m, n),
            "K_f" => (m, q),
            "L_x" => (n, p),
            "L_f" | "P_f" => (q, p),
            "H" => (t, p),
            "K_i" | "N_r" => (m, t),
            "F_i" => (t, q),
            "L_w" => (t, m),
            _ => (q, q),
        };
        for (what, matrix) in self.matrices() {
            let (rows, columns) = expected(what);
            if (matrix.rows, matrix.columns) != (rows.1, columns.1) {
                return Err(Reason::Shape {
                    what,
                    actual: format!("{} x {}", matrix.rows, matrix.columns),
                    expected: format!("{} x {}", rows.1, columns.1),
                    meaning: format!("{} x {}", rows.0, columns.0),
                });
            }
        }
        match &self.filter {
            Some(filter) if filter.len() != p.1 => Err(Reason::Shape {
                what: "filter",
                actual: format!("{} numbers", filter.len()),
                expected: format!("{} numbers", p.1),
                meaning: p.0.to_owned(),
            }),
            _ => Ok(()),
        }
    }

    /// Describes what is wrong in the grid of a schedule, or in the shapes and numbers at its points.
    fn contradiction_of_schedule(&self) -> Option<String> {
        let schedule = self.schedule.as_ref()?;
        if self.sliding_mode.is_some() {
            let text = "schedule and sliding_mode are stated, expected one of them";
            return Some(text.to_owned());
        }
        // The exporter integrates such a controller, which has no whole steps in which to check or test measurements.
        if self.sample_time.is_none() && (self.checks_measurements() || self.detection.is_some()) {
            let text = "schedule is stated together with detection, or with range or longest_hold of a measurement; \
                        expected sample_time, too";
            return Some(text.to_owned());
        }
        if schedule.points.len() < 2 {
            return Some("schedule: expected at least two points".to_owned());
        }
        let mut last = f64::NEG_INFINITY;
        for (at, point) in schedule.points.iter().enumerate() {
            let place = format!("point {} of the schedule", at + 1);
            if !(point.at > last && point.at.is_finite()) {
                return Some(format!(
                    "{place}: at = {}, expected a finite number above {last}",
                    point.at
                ));
            }
            last = point.at;
            let scheduled = |name: &&str| ["P_f", "K_i", "L_w", "N_r"].contains(name);
            let names = |all: &mut dyn Iterator<Item = &'static str>| {
                let mut all: Vec<_> = all.filter(scheduled).collect();
                all.sort_unstable();
                all.join(", ")
            };
            let stated = names(&mut point.matrices().map(|(name, _)| name));
            let expected = names(&mut self.matrices().map(|(name, _)| name));
            if stated != expected {
                return Some(format!(
                    "{place}: of P_f, K_i, L_w, N_r it states [{stated}], expected [{expected}] as above"
                ));
            }
            for (name, matrix) in point.matrices() {
                let Some((_, expected)) = self.matrices().find(|(other, _)| *other == name) else {
                    continue;
                };
                if (matrix.rows, matrix.columns) != (expected.rows, expected.columns) {
                    return Some(format!(
                        "{place}: {name} is {} x {}, expected {} x {}",
                        matrix.rows, matrix.columns, expected.rows, expected.columns
                    ));
                }
                if let Some(k) = matrix.values.iter().position(|value| !value.is_finite()) {
                    let name = matrix.element(name, k);
                    return Some(format!("{place}: {name} is not a finite number"));
                }
            }
            let lists = [
                ("x_op", &point.x_op, self.states.len()),
                ("u_op", &point.u_op, self.actuators.len()),
                ("y_op", &point.y_op, self.measurements.len()),
                ("r_op", &point.r_op, self.references.len()),
            ];
            for (name, values, expected) in lists {
                if values.len() != expected || values.iter().any(|value| !value.is_finite()) {
                    return Some(format!("{place}: {name}: expected {expected} finite numbers"));
                }
            }
            let measured = self.measurements.iter().zip(&point.y_op);
            let measured =
                measured.map(|(signal, value)| ("y_op", &signal.name, signal.range, value));
            let commands = self.actuators.iter().zip(&point.u_op);
            let commands =
                commands.map(|(signal, value)| ("u_op", &signal.name, signal.limits, value));
            for (list, name, limits, value) in measured.chain(commands) {
                if limits.is_some_and(|[low, high]| *value < low || *value > high) {
                    let limits = if list == "y_op" { "range" } else { "limits" };
                    return Some(format!(
                        "{place}: {list} of {name} is {value}, outside of its {limits}"
                    ));
                }
            }
        }
        None
    }

    /// Describes the first entry that is missing, not allowed, or in contradiction to other entries.
    fn contradiction(&self) -> Option<String> {
        let lists = [
            (self.states.len(), "state"),
            (self.actuators.len(), "actuator"),
            (self.measurements.len(), "measurement"),
            (self.faults.len(), "fault"),
        ];
        if let Some((_, name)) = lists.iter().find(|(count, _)| *count == 0) {
            return Some(format!("at least one {name} is needed"));
        }
        if self.actuators.len() > 64 {
            let count = self.actuators.len();
            return Some(format!("found {count} actuators, expected at most 64"));
        }
        match (self.sample_time, self.estimator, self.experiment.step_size) {
            (Some(_), None, _) => {
                let text = "sample_time is stated and estimator is not, \
                            expected estimator = \"current\" or \"prediction\"";
                return Some(text.to_owned());
            }
            (None, Some(_), _) => {
                return Some("estimator is stated and sample_time is not".to_owned());
            }
            (None, None, None) => return Some("step_size is missing in experiment".to_owned()),
            _ => {}
        }
        if self.d.is_some() && (self.filter.is_none() || self.schedule.is_some()) {
            return Some("D is stated, expected a filter and no schedule".to_owned());
        }
        let of_faults = self.faults.iter().find_map(|fault| self.contradiction_of(fault));
        of_faults
            .or_else(|| self.contradiction_of_references())
            .or_else(|| self.contradiction_of_sliding_mode())
            .or_else(|| self.detection.as_ref()?.contradiction(self))
            .or_else(|| self.contradiction_of_reconfigurations())
    }

    fn contradiction_of_sliding_mode(&self) -> Option<String> {
        let SlidingMode { rho, delta } = self.sliding_mode.as_ref()?;
        if self.estimator != Some(Estimator::Current) {
            let text = "sliding_mode is stated, expected sample_time and estimator = \"current\"";
            return Some(text.to_owned());
        }
        if self.p_f.is_some() {
            return Some("sliding_mode and P_f exclude each other".to_owned());
        }
        let count = self.faults.len();
        [("rho", rho), ("delta", delta)].into_iter().find_map(|(name, list)| {
            let length = list.len();
            let text = format!("{name} has {length} numbers, expected {count}, one for each fault");
            (length != count).then_some(text)
        })
    }

    fn contradiction_of_reconfigurations(&self) -> Option<String> {
        let others = !self.references.is_empty()
            || self.p_f.is_some()
            || self.sliding_mode.is_some()
            || self.schedule.is_some();
        if self.is_reconfigurable() && others {
            return Some(
                "reconfigurations and fallback exclude references, P_f, sliding_mode and schedule"
                    .to_owned(),
            );
        }
        let singles = self.contradiction_of_single_reconfigurations();
        singles.or_else(|| self.contradiction_of_combinations())
    }

    fn contradiction_of_single_reconfigurations(&self) -> Option<String> {
        let (n, m, q) = (self.states.len(), self.actuators.len(), self.faults.len());
        self.reconfigurations.iter().enumerate().find_map(|(at, case)| {
            let gone = &case.gone;
            let begin = format!("reconfiguration without {gone}: ");
            let parts = (case.k_x.as_ref(), case.k_f.as_ref(), case.k_s.as_ref());
            let fits = match parts {
                (Some(k_x), Some(k_f), Some(k_s)) => {
                    shape(k_x) == (m, n) && shape(k_f) == (m, q) && k_s.len() == m
                }
                (None, None, None) => self.fallback.is_some(),
                _ => false,
            };
            let limit = case.loss.zip(case.time);
            let lost = self.faults.iter().any(|fault| fault.loss_of.as_ref() == Some(gone));
            let matrices = case.k_x.iter().chain(&case.k_f).flat_map(|matrix| &matrix.values);
            let mut numbers = matrices.chain(case.k_s.iter().flatten()).chain([&case.stuck_at]);
            let text = if !self.actuators.iter().any(|actuator| actuator.name == *gone) {
                "there is no actuator of this name"
            } else if self.reconfigurations[..at].iter().any(|other| other.gone == *gone) {
                "it is there twice"
            } else if !fits {
                "expected K_x of actuators x states, K_f of actuators x faults, K_s with one number \
                 for each actuator; or none of them together with [fallback]"
            } else if numbers.any(|value| !value.is_finite()) {
                "a number is not finite"
            } else if case.restart.iter().any(|name| !self.faults.iter().any(|f| f.name == *name)) {
                "`restart` names a fault that does not exist"
            } else if case.loss.is_some() != case.time.is_some() || limit.is_some() && !lost {
                "loss and time belong together, and to a fault with loss_of"
            } else if limit.is_some_and(|(loss, time)| !(loss > 0.0 && (0.0..1e9).contains(&time))) {
                "expected a loss above 0 and a time of at least 0 s and below 1e9 s"
            } else {
                return None;
            };
            Some(begin + text)
        })
    }

    fn contradiction_of_combinations(&self) -> Option<String> {
        let (n, m, q) = (self.states.len(), self.actuators.len(), self.faults.len());
        let finite = |matrix: &Matrix| matrix.values.iter().all(|value| value.is_finite());
        if let Some(fallback) = &self.fallback {
            let k_f = fallback.k_f.as_ref();
            if shape(&fallback.k_x) != (m, n) || k_f.is_some_and(|k_f| shape(k_f) != (m, q)) {
                let text =
                    "fallback: expected K_x of actuators x states, K_f of actuators x faults";
                return Some(text.to_owned());
            }
            if !finite(&fallback.k_x) || !k_f.is_none_or(finite) {
                return Some("fallback: a number is not finite".to_owned());
            }
        }
        let has_entry = |name: &String| self.reconfigurations.iter().any(|r| r.gone == *name);
        let order =
            |name: &String| self.actuators.iter().position(|actuator| actuator.name == *name);
        self.combinations.iter().enumerate().find_map(|(at, combination)| {
            let ordered = combination.gone.windows(2).all(|pair| order(&pair[0]) < order(&pair[1]));
            let count = combination.gone.len();
            let text = if count < 2 || !combination.gone.iter().all(has_entry) {
                "expected at least two actuators, each with an entry in reconfigurations"
            } else if !ordered {
                "expected each actuator once, in the order of the actuators"
            } else if self.combinations[..at].iter().any(|other| other.gone == combination.gone) {
                "it is there twice"
            } else if shape(&combination.k_x) != (m, n)
                || shape(&combination.k_f) != (m, q)
                || shape(&combination.k_s) != (m, count)
            {
                "expected K_x of actuators x states, K_f of actuators x faults, K_s with one number \
                 for each actuator and each that is gone"
            } else if ![&combination.k_x, &combination.k_f, &combination.k_s].into_iter().all(finite) {
                "a number is not finite"
            } else {
                return None;
            };
            Some(format!("combination without {}: {text}", combination.gone.join(", ")))
        })
    }

    fn contradiction_of_references(&self) -> Option<String> {
        let Self { h, k_i, f_i, l_w, n_r, .. } = self;
        let text = if h.is_some() != k_i.is_some() {
            "H and K_i belong together, expected both or neither"
        } else if k_i.is_none() && (f_i.is_some() || l_w.is_some()) {
            "F_i and L_w belong to K_i, which is missing"
        } else if self.references.is_empty() == (k_i.is_some() || n_r.is_some()) {
            "references belong to K_i or N_r, expected [[references]] and one of them, or none"
        } else {
            return None;
        };
        Some(text.to_owned())
    }

    fn contradiction_of(&self, fault: &Fault) -> Option<String> {
        let name = &fault.name;
        let Some(actuator) = &fault.loss_of else {
            let text = format!("fault {name}: least_command is stated and loss_of is not");
            return fault.least_command.map(|_| text);
        };
        if fault.least_command.is_none() {
            return Some(format!("fault {name}: loss_of is stated and least_command is not"));
        }
        let names: Vec<_> = self.actuators.iter().map(|actuator| actuator.name.as_str()).collect();
        match names.iter().filter(|name| *name == actuator).count() {
            1 => None,
            count => Some(format!(
                "fault {name}: loss_of = {actuator:?} is the name of {count} actuators, expected \
                 one of {}",
                names.join(", ")
            )),
        }
    }

    fn refused_number(&self) -> Option<Refusal> {
        let mut matrices = self.matrices();
        let of_matrices = matrices.find_map(|(name, matrix)| Refusal::of_matrix(name, matrix));
        of_matrices
            .or_else(|| self.refused_filter())
            .or_else(|| self.refused_sliding_mode())
            .or_else(|| self.refused_transfer())
            .or_else(|| self.detection.as_ref()?.refused_number(self))
    }

    /// The first of rho and delta that is not a number above 0.
    #[must_use]
    pub fn refused_sliding_mode(&self) -> Option<Refusal> {
        let SlidingMode { rho, delta } = self.sliding_mode.as_ref()?;
        let lists = [("rho", rho), ("delta", delta)].into_iter();
        let mut all = lists.flat_map(|(name, list)| {
            list.iter().enumerate().map(move |(k, value)| (name, k, list.len(), *value))
        });
        let (name, k, count, value) =
            all.find(|(.., value)| !(*value > 0.0 && value.is_finite()))?;
        Some(Refusal::new(channel(name, k, count), value, "a finite number above 0"))
    }

    /// The first element of `filter` that is out of its range.
    #[must_use]
    pub fn refused_filter(&self) -> Option<Refusal> {
        let (most, rule) = self.rates();
        let filter = self.filter.as_ref()?;
        let k = filter.iter().position(|value| !(*value > 0.0 && *value <= most))?;
        Some(Refusal::new(channel("filter", k, filter.len()), filter[k], rule))
    }

    /// A refusal of `transfer`, if it is out of range.
    fn refused_transfer(&self) -> Option<Refusal> {
        let (most, rule) = self.rates();
        let value = self.transfer.filter(|value| !(*value > 0.0 && *value <= most))?;
        Some(Refusal::new("transfer".to_owned(), value, rule))
    }

    /// The largest allowed value of `filter` and `transfer`, and the allowed range in words. The values are rates in
    /// 1/s; in a sampled controller, they are the fractions that decay in one sample.
    fn rates(&self) -> (f64, &'static str) {
        match self.sample_time {
            None => (f64::MAX, "more than 0 1/s"),
            Some(_) => (1.0, "more than 0 and at most 1"),
        }
    }

    fn refused_signal(&self) -> Option<Refusal> {
        let signals = self.states.iter().chain(&self.references);
        let values = signals.map(|signal| (&signal.name, signal.operating));
        let measured = self.measurements.iter().map(|signal| (&signal.name, signal.operating));
        let commands = self.actuators.iter().map(|actuator| (&actuator.name, actuator.operating));
        let refused = values.chain(measured).chain(commands).find_map(|(name, value)| {
            let value = value.filter(|value| !value.is_finite())?;
            Some(Refusal::new(format!("operating of {name}"), value, "a finite number"))
        });
        let of_hold = || self.measurements.iter().find_map(|signal| self.refused_hold(signal));
        if let Some(refusal) = refused.or_else(of_hold) {
            return Some(refusal);
        }
        for actuator in &self.actuators {
            let Some([low, high]) = actuator.limits else { continue };
            if !(low.is_finite() && high.is_finite() && low < high) {
                let what = format!("limits of {} from {low} to", actuator.name);
                return Some(Refusal::new(what, high, "two finite numbers, the smaller one first"));
            }
            if let Some(value) = actuator.operating.filter(|value| *value < low || *value > high) {
                let what = format!("operating of {}", actuator.name);
                return Some(Refusal::new(what, value, "a command within its limits"));
            }
        }
        self.faults.iter().find_map(|fault| {
            let value = fault.least_command.filter(|value| !COMMANDS.contains(value))?;
            let what = format!("least_command of {}", fault.name);
            Some(Refusal::new(what, value, "1e-100 to 1e100"))
        })
    }

    /// Checks range, operating point within the range, and longest hold of a measurement; returns the first one that
    /// is refused.
    fn refused_hold(&self, signal: &Measurement) -> Option<Refusal> {
        let name = &signal.name;
        if let Some([low, high]) = signal.range {
            if !(low.is_finite() && high.is_finite() && low < high) {
                let what = format!("range of {name} from {low} to");
                return Some(Refusal::new(what, high, "two finite numbers, the smaller one first"));
            }
            let operating = signal.operating.unwrap_or(0.0);
            if self.schedule.is_none() && !(low..=high).contains(&operating) {
                let what = format!("operating of {name}");
                return Some(Refusal::new(what, operating, "a value within its range"));
            }
        }
        let longest = signal.longest_hold?;
        let what = || format!("longest_hold of {name}");
        if !(longest > 0.0 && longest.is_finite()) {
            return Some(Refusal::new(what(), longest, "a time above 0 s"));
        }
        let has_too_many = |period| signal.most_held(period).is_none();
        let rule = "fewer than 2^32 samples";
        self.sample_time.is_some_and(has_too_many).then(|| Refusal::new(what(), longest, rule))
    }

    fn refused_time(&self) -> Option<Refusal> {
        let refuse = |what: &str, value, rule| Some(Refusal::new(what.to_owned(), value, rule));
        if !self.t_on.is_finite() {
            return refuse("t_on", self.t_on, "a time in s");
        }
        let positive = |value: &f64| *value > 0.0 && value.is_finite();
        if let Some(value) = self.sample_time.filter(|value| !positive(value)) {
            return refuse("sample_time", value, "more than 0 s");
        }
        let Defaults { stop_time, step_size } = self.experiment;
        if let Some(value) = step_size.filter(|value| !positive(value)) {
            return refuse("step_size", value, "more than 0 s");
        }
        let step_size = self.step_size();
        if self.sample_time.is_some_and(|sample_time| step_size / sample_time > MOST_SAMPLES) {
            return refuse("step_size", step_size, "at most 1e6 times sample_time");
        }
        if !(stop_time > step_size && stop_time.is_finite()) {
            return refuse("stop_time", stop_time, "more than step_size");
        }
        None
    }

    /// The communication step of the default experiment in s: the stated one, otherwise the sample time.
    #[must_use]
    pub fn step_size(&self) -> f64 {
        self.experiment.step_size.or(self.sample_time).unwrap_or_default()
    }
}

fn shape(matrix: &Matrix) -> (usize, usize) {
    (matrix.rows, matrix.columns)
}
