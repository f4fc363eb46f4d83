//! The design file `resources/design.toml`: the matrices of plant, gains and observer, and the
//! names and units of the signals.

mod checks;
pub mod detection;
mod error;
mod reconfiguration;
pub mod schedule;
mod signals;
mod written;

use serde::{Deserialize, Serialize};

use crate::matrix::Matrix;
pub use checks::Refusal;
use detection::DetectionDesign;
pub use error::{DesignError, Reason};
pub use reconfiguration::{Combination, Fallback, GainSet, Reconfiguration};
use schedule::Schedule;
pub use signals::{
    Actuator, Fault, HOLD_ROUNDING, Label, Loss, Measurement, Signal, integral_unit,
};

/// The matrices of a design or of a point of its schedule with their names: the eight required ones, then the optional
/// ones of the listed fields that are stated.
macro_rules! named_matrices {
    ($owner:ident: $($name:literal $field:ident),*) => {{
        let always = [
            ("A", &$owner.a),
            ("B", &$owner.b),
            ("C", &$owner.c),
            ("F_a", &$owner.f_a),
            ("K_x", &$owner.k_x),
            ("K_f", &$owner.k_f),
            ("L_x", &$owner.l_x),
            ("L_f", &$owner.l_f),
        ];
        let stated = [$(($name, &$owner.$field)),*];
        let stated = stated.into_iter().filter_map(|(name, matrix)| Some((name, matrix.as_ref()?)));
        always.into_iter().chain(stated)
    }};
}
use named_matrices;

/// The content of a design file. Shapes: n states, m actuators, p measurements, q states of the
/// fault model, t references.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// What the controller is for, in one sentence.
    pub description: String,
    /// Start of the compensation in s.
    pub t_on: f64,
    /// Whether faults are also estimated while they are not compensated.
    #[serde(default)]
    pub monitor: bool,
    /// The sample time of a sampled controller in s; all matrices then describe the sampled plant.
    pub sample_time: Option<f64>,
    /// The estimator of a sampled controller.
    pub estimator: Option<Estimator>,
    /// The diagonal of W, the rates of the measurement filter, p numbers in 1/s; in a sampled controller without unit.
    /// `None`: no filter.
    pub filter: Option<Vec<f64>>,
    /// A, n x n.
    #[serde(rename = "A")]
    pub a: Matrix,
    /// B, n x m.
    #[serde(rename = "B")]
    pub b: Matrix,
    /// C, p x n.
    #[serde(rename = "C")]
    pub c: Matrix,
    /// D, p x m, of y = C x + D u, stated together with a filter; `None`: no feedthrough.
    #[serde(rename = "D")]
    pub d: Option<Matrix>,
    /// F_a, n x q: the effect of the faults on the states.
    #[serde(rename = "F_a")]
    pub f_a: Matrix,
    /// A_f, q x q; `None`: the faults are constant.
    #[serde(rename = "A_f")]
    pub a_f: Option<Matrix>,
    /// P_f, q x p: the direct term of the fault estimate; `None`: no direct term.
    #[serde(rename = "P_f")]
    pub p_f: Option<Matrix>,
    /// The sliding-mode law that estimates the faults; `None`: a linear law.
    pub sliding_mode: Option<SlidingMode>,
    /// K_x, m x n: the feedback of the estimated states.
    #[serde(rename = "K_x")]
    pub k_x: Matrix,
    /// K_f, m x q: the compensation of the estimated faults.
    #[serde(rename = "K_f")]
    pub k_f: Matrix,
    /// L_x, n x p: the observer gain of the states.
    #[serde(rename = "L_x")]
    pub l_x: Matrix,
    /// L_f, q x p: the observer gain of the faults.
    #[serde(rename = "L_f")]
    pub l_f: Matrix,
    /// H, t x p, of the integral action x_i' = r - H y + ...; see `fmu-controller/src/equations.rs`.
    #[serde(rename = "H")]
    pub h: Option<Matrix>,
    /// K_i, m x t: the gain of the integral action, stated together with H.
    #[serde(rename = "K_i")]
    pub k_i: Option<Matrix>,
    /// F_i, t x q: H times the estimated sensor faults.
    #[serde(rename = "F_i")]
    pub f_i: Option<Matrix>,
    /// L_w, t x m: the back-calculation of commands at a limit.
    #[serde(rename = "L_w")]
    pub l_w: Option<Matrix>,
    /// N_r, m x t: the feedforward of the references.
    #[serde(rename = "N_r")]
    pub n_r: Option<Matrix>,
    /// The decay of u_t, which prevents a jump of the commands when the law changes: u_t' = -transfer u_t, in 1/s; in a
    /// sampled controller the fraction that decays in one sample. Without it the commands jump.
    pub transfer: Option<f64>,
    /// The n states.
    pub states: Vec<Signal>,
    /// The m actuators.
    pub actuators: Vec<Actuator>,
    /// The p measurements; the inputs of the FMU have the same names.
    pub measurements: Vec<Measurement>,
    /// The q states of the fault model.
    pub faults: Vec<Fault>,
    /// The t references; the inputs of the FMU have the same names.
    #[serde(default)]
    pub references: Vec<Signal>,
    /// The gains without an actuator, one entry for each actuator that may be gone.
    #[serde(default)]
    pub reconfigurations: Vec<Reconfiguration>,
    /// The gains without several actuators.
    #[serde(default)]
    pub combinations: Vec<Combination>,
    /// The feedback that does not need to know which actuator has failed.
    pub fallback: Option<Fallback>,
    /// The experiment that importers run by default.
    pub experiment: Defaults,
    /// Matrices and operating points by a scheduling variable, in place of the constant ones.
    pub schedule: Option<Schedule>,
    /// The detection of faults, if there is one.
    pub detection: Option<DetectionDesign>,
}

/// The measurements that the command of a sampled controller is computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Estimator {
    /// All measurements up to and including those of the present sample.
    Current,
    /// The measurements before the sample.
    Prediction,
}

/// The nonlinear injection of a sliding-mode law; each list has one number for each fault.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlidingMode {
    /// rho: the largest estimate, in the unit of the fault.
    pub rho: Vec<f64>,
    /// delta: the half-width of the boundary layer, in the unit of the fault.
    pub delta: Vec<f64>,
}

/// `DefaultExperiment`, times in s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Defaults {
    /// End of the experiment.
    pub stop_time: f64,
    /// The communication step; a continuous controller must state it, the default of a sampled one is the sample time.
    pub step_size: Option<f64>,
}

impl Design {
    /// Reads a design from `text`; `path` is for messages.
    ///
    /// # Errors
    ///
    /// [`DesignError`] if the text is no TOML, or for the first entry that is missing, unknown, out of its range, or
    /// does not fit the others.
    pub fn parse(text: &str, path: &str) -> Result<Self, DesignError> {
        let refused = |reason| DesignError { path: path.to_owned(), reason };
        let mut design: Self = toml::from_str(text)
            .map_err(|error| refused(Reason::Malformed(error.to_string().trim_end().to_owned())))?;
        design.complete_operating_point();
        design.check().map_err(refused)?;
        design.locate_reconfigurations();
        Ok(design)
    }

    /// The values of the operating point: states, commands, measurements, references.
    pub(crate) fn operating_mut(&mut self) -> impl Iterator<Item = &mut Option<f64>> {
        let Self { states, actuators, measurements, references, .. } = self;
        let commands = actuators.iter_mut().map(|signal| &mut signal.operating);
        let measured = measurements.iter_mut().map(|signal| &mut signal.operating);
        let [states, references] =
            [states, references].map(|all| all.iter_mut().map(|signal| &mut signal.operating));
        states.chain(commands).chain(measured).chain(references)
    }

    /// Sets the missing values of the operating point to 0 if the file states at least one value.
    fn complete_operating_point(&mut self) {
        if self.operating_mut().any(|value| value.is_some()) {
            self.operating_mut().for_each(|value| *value = value.or(Some(0.0)));
        }
    }

    /// Sets the positions of the actuators and faults that reconfigurations and combinations name.
    fn locate_reconfigurations(&mut self) {
        let position = |name: &String| self.faults.iter().position(|fault| fault.name == *name);
        for case in &mut self.reconfigurations {
            let actuator = self.actuators.iter().position(|actuator| actuator.name == case.gone);
            case.actuator = actuator.unwrap_or_default();
            case.restarted = case.restart.iter().filter_map(position).collect();
        }
        for combination in &mut self.combinations {
            let positions = self.actuators.iter().enumerate();
            let gone = positions.filter(|(_, actuator)| combination.gone.contains(&actuator.name));
            combination.mask = gone.fold(0, |mask, (j, _)| mask | 1 << j);
        }
    }

    /// The faults that are losses of effectiveness, in the order of the faults.
    #[must_use]
    pub fn losses(&self) -> Vec<Loss> {
        let loss = |(fault, signal): (usize, &Fault)| {
            let name = signal.loss_of.as_ref()?;
            let actuator = self.actuators.iter().position(|actuator| actuator.name == *name)?;
            Some(Loss { fault, actuator, least_command: signal.least_command? })
        };
        self.faults.iter().enumerate().filter_map(loss).collect()
    }

    /// The gains without the actuators whose bits are set in `gone`, bit j for actuator j; `None` if the design has no
    /// gains for exactly these actuators.
    pub fn gains_without(&self, gone: u64) -> Option<GainSet<'_>> {
        if gone.is_power_of_two() {
            let case = self.without(gone.trailing_zeros() as usize)?;
            return case.k_x.as_ref().map(|_| GainSet::Single(case));
        }
        self.combinations.iter().find(|combination| combination.mask == gone).map(GainSet::Several)
    }

    /// The reconfiguration without actuator `j`, if there is one.
    #[must_use]
    pub fn without(&self, j: usize) -> Option<&Reconfiguration> {
        self.reconfigurations.iter().find(|case| case.actuator == j)
    }

    /// Sets the gains of reconfigurations, combinations and fall-back to zero, as in a direction of differentiation:
    /// these gains are no variables of the FMU.
    pub fn clear_reconfigurations(&mut self) {
        for case in &mut self.reconfigurations {
            case.k_x.iter_mut().chain(&mut case.k_f).for_each(Matrix::clear);
            case.k_s.iter_mut().flatten().for_each(|value| *value = 0.0);
        }
        for combination in &mut self.combinations {
            let matrices = [&mut combination.k_x, &mut combination.k_f, &mut combination.k_s];
            matrices.into_iter().for_each(Matrix::clear);
        }
        if let Some(fallback) = &mut self.fallback {
            fallback.k_f.iter_mut().chain([&mut fallback.k_x]).for_each(Matrix::clear);
        }
    }

    /// Whether a measurement has a range or a longest hold.
    #[must_use]
    pub fn checks_measurements(&self) -> bool {
        self.measurements.iter().any(|signal| signal.range.is_some()) || self.limits_holds()
    }

    /// Whether a measurement has a longest hold.
    #[must_use]
    pub fn limits_holds(&self) -> bool {
        self.measurements.iter().any(|signal| signal.longest_hold.is_some())
    }

    /// Whether gains other than the gains of the intact plant may be in force.
    #[must_use]
    pub fn is_reconfigurable(&self) -> bool {
        !self.reconfigurations.is_empty() || self.fallback.is_some()
    }

    /// Copies the design without its schedule, as a place for the matrices and the operating point at one value of the
    /// scheduling variable; `None` if there is no schedule.
    // Inlined, so that a WebAssembly module contains the code that copies a design only once.
    #[inline]
    #[must_use]
    pub fn unscheduled(&self) -> Option<Self> {
        self.schedule.is_some().then(|| Self { schedule: None, ..self.clone() })
    }

    /// The matrices that depend on the scheduling variable; P_f, K_i, L_w and N_r where they are stated.
    pub fn scheduled_mut(&mut self) -> impl Iterator<Item = &mut Matrix> {
        let Self { a, b, c, f_a, k_x, k_f, l_x, l_f, p_f, k_i, l_w, n_r, .. } = self;
        let stated = [p_f, k_i, l_w, n_r].into_iter().flatten();
        [a, b, c, f_a, k_x, k_f, l_x, l_f].into_iter().chain(stated)
    }

    /// Sets A_f, H and F_i to zero, as in a direction of differentiation: these matrices do not depend on the
    /// scheduling variable.
    pub fn clear_constant(&mut self) {
        [&mut self.a_f, &mut self.h, &mut self.f_i].into_iter().flatten().for_each(Matrix::clear);
    }

    /// Copies from `other` what the importer can change: the limits of the actuators and the filter.
    pub fn take_parameters(&mut self, other: &Self) {
        for (actuator, other) in self.actuators.iter_mut().zip(&other.actuators) {
            actuator.limits = other.limits;
        }
        let filters = self.filter.iter_mut().flatten().zip(other.filter.iter().flatten());
        filters.for_each(|(weight, other)| *weight = *other);
    }

    /// Whether the file states an operating point that does not depend on a scheduling variable.
    #[must_use]
    pub fn has_operating_point(&self) -> bool {
        self.schedule.is_none()
            && self.actuators.iter().any(|actuator| actuator.operating.is_some())
    }

    /// The position of the filtered measurement `k` in z.
    #[must_use]
    pub fn filtered_at(&self, k: usize) -> usize {
        self.states.len() + self.faults.len() + k
    }

    /// The position of the integral `k` in z.
    pub fn integral_at(&self, k: usize) -> usize {
        self.filtered_at(self.filter.as_ref().map_or(0, Vec::len)) + k
    }

    /// The number of integrals: one for each reference, or none.
    #[must_use]
    pub fn integrals(&self) -> usize {
        self.k_i.as_ref().map_or(0, |k_i| k_i.columns)
    }

    /// The position of u_t of command `j` in z.
    #[must_use]
    pub fn transfer_at(&self, j: usize) -> usize {
        self.integral_at(self.integrals()) + j
    }

    /// The number of elements of u_t: one for each actuator, or none.
    #[must_use]
    pub fn transfers(&self) -> usize {
        self.transfer.map_or(0, |_| self.actuators.len())
    }

    /// The length of z = [x_hat; f_hat; y_f; x_i; u_t].
    #[must_use]
    pub fn order(&self) -> usize {
        self.transfer_at(self.transfers())
    }

    /// Splits z into x_hat, f_hat, y_f, x_i and u_t; parts that the design does not have are empty.
    pub fn parts_mut<'a>(&self, z: &'a mut [f64]) -> [&'a mut [f64]; 5] {
        let (z, u_t) = z.split_at_mut(self.transfer_at(0));
        let (z, x_i) = z.split_at_mut(self.integral_at(0));
        let (x_hat, rest) = z.split_at_mut(self.states.len());
        let (f_hat, y_f) = rest.split_at_mut(self.faults.len());
        [x_hat, f_hat, y_f, x_i, u_t]
    }

    /// The matrices with their names in the file and as FMI variables; A_f and the matrices after it only if they are
    /// stated.
    pub fn matrices(&self) -> impl Iterator<Item = (&'static str, &Matrix)> {
        named_matrices! {
            self: "A_f" a_f, "D" d, "P_f" p_f, "H" h, "K_i" k_i, "F_i" f_i, "L_w" l_w, "N_r" n_r
        }
    }
}
