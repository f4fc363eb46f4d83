//! Designs the law that estimates the faults, from the augmented observer of the requirement.

use control::aso::{Estimator, FaultyPlant, Gains};
use control::estimation::{
    DirectForm, FastAdaptive, Learning, OwnModel, SlidingMode, fast_adaptive, learning, mean_rate,
    proportional_integral, sliding_mode,
};
use control::faults::ExtendedPlant;
use control::stability::instability;
use control::{Domain, Error};
use nalgebra::DMatrix;

use crate::plant::linear::LinearPlant;
use crate::report::Check;
use crate::report::robustness::Number;
use plant_file::estimation::Law;
use plant_file::faults::FaultDynamics;

/// Default of the parameter `K_1` of the learning law.
const KEPT: f64 = 0.99;
/// Default of the parameter rho of the sliding-mode law, relative to the bound of the fault.
const REACH: f64 = 2.0;

/// Default ratio of the fast adaptive law's gamma to the mean rate, and of the mean rate to the sigma of the law.
const APART: f64 = 1.25;

/// The data from which a law is designed.
pub(crate) struct LawProblem<'a> {
    pub(crate) linear: &'a LinearPlant,
    /// The plant with fault models and measurement filter, in continuous time unless it is known in its samples only.
    pub(crate) extended: &'a ExtendedPlant,
    /// The model in the observer, in `domain`.
    pub(crate) plant: &'a FaultyPlant,
    /// The gains of the augmented observer.
    pub(crate) gains: &'a Gains,
    pub(crate) domain: Domain,
}

/// A designed law.
pub(crate) struct DesignedLaw {
    pub(crate) law: Law,
    /// The gains; for a sliding-mode law the gains of its linearisation.
    pub(crate) gains: Gains,
    /// `A_f` of the observer, if it differs from the fault model.
    pub(crate) a_f: Option<DMatrix<f64>>,
    pub(crate) injection: Option<Injection>,
    /// The parameters with their values.
    pub(crate) parameters: Vec<Number>,
    /// The conditions for the existence of the law, all of which hold.
    pub(crate) conditions: Vec<Check>,
}

/// The nonlinear function of a sliding-mode law.
pub(crate) struct Injection {
    /// F, q x p, which takes the place of `L_f` in the design file.
    pub(crate) f: DMatrix<f64>,
    pub(crate) rho: Vec<f64>,
    pub(crate) delta: Vec<f64>,
}

impl DesignedLaw {
    /// Whether the observer with this law keeps the error dynamics that the requirement assigns.
    pub(crate) fn keeps_error_dynamics(&self) -> bool {
        matches!(self.law, Law::Augmented | Law::ProportionalIntegral { .. })
    }

    /// Whether a constant fault leaves a lasting error: the observer's own model of the fault decays.
    pub(crate) fn leaks(&self) -> bool {
        let identity = |a_f: &DMatrix<f64>| DMatrix::identity(a_f.nrows(), a_f.ncols());
        self.a_f.as_ref().is_some_and(|a_f| *a_f != identity(a_f))
    }
}

impl LawProblem<'_> {
    /// Designs `law`; the error says in a sentence why it does not exist.
    pub(crate) fn design(&self, law: &Law) -> Result<DesignedLaw, String> {
        let mut design = DesignedLaw {
            law: law.clone(),
            gains: self.gains.clone(),
            a_f: None,
            injection: None,
            parameters: Vec::new(),
            conditions: Vec::new(),
        };
        let Self { plant, gains, domain, .. } = *self;
        match law {
            Law::Augmented => return Ok(design),
            Law::ProportionalIntegral { proportional } => {
                self.require_current()?;
                let part = proportional.unwrap_or(1.0);
                design.gains = proportional_integral(plant, gains, domain, part).map_err(text)?;
                design.parameters.push(number("proportional", None, part));
                return Ok(design);
            }
            Law::FastAdaptive { .. } | Law::SlidingMode { .. } | Law::Learning { .. } => {}
        }
        let form = self.direct_form(&mut design.conditions)?;
        if domain == Domain::Continuous && !matches!(law, Law::FastAdaptive { .. }) {
            let reason = "it is a law of sampled controllers only: expected `sample_time`";
            return Err(reason.to_owned());
        }
        self.require_current()?;
        let rate = mean_rate(&gains.error_dynamics(plant), domain).map_err(text)?;
        match law {
            Law::FastAdaptive { sigma, gamma } => {
                // Different rates: equal ones would be a multiple eigenvalue.
                let count = self.linear.faults.len();
                let gamma = gamma.clone().unwrap_or_else(|| vec![rate * APART; count]);
                let law = FastAdaptive { sigma: sigma.unwrap_or(rate / APART), gamma };
                design.gains = fast_adaptive(plant, &form, gains, &law, rate).map_err(text)?;
                design.parameters.push(number("sigma", Some("1/s"), law.sigma));
                design.parameters.extend(self.each("gamma", Some("1/s"), &law.gamma));
            }
            Law::SlidingMode { rho, delta } => {
                let rho = self.reach(rho.as_ref(), &mut design.conditions)?;
                let law = SlidingMode { rho, delta: delta.clone() };
                let refused = |error: Error| match error {
                    Error::NotSchur { .. } => format!(
                        "delta is too small for the sample time, the estimate would oscillate from \
                             sample to sample: {error}"
                    ),
                    other => text(other),
                };
                let designed = sliding_mode(plant, &form, gains, &law, rate).map_err(refused)?;
                let (OwnModel { gains, a_f, .. }, delta) = designed;
                (design.gains, design.a_f) = (gains, Some(a_f));
                design.parameters.extend(self.each("rho", None, &law.rho));
                design.parameters.extend(self.each("delta", None, &delta));
                design.injection = Some(Injection { f: form.m_1, rho: law.rho, delta });
            }
            Law::Learning { kept: share } => {
                let law = Learning { kept: share.unwrap_or(KEPT) };
                let OwnModel { gains, a_f, .. } =
                    learning(plant, &form, gains, &law, rate).map_err(text)?;
                (design.gains, design.a_f) = (gains, Some(a_f));
                design.parameters.push(number("K_1", None, law.kept));
            }
            Law::Augmented | Law::ProportionalIntegral { .. } => {}
        }
        self.require_stable(&mut design)?;
        Ok(design)
    }

    /// The names of the laws that exist with default parameters.
    pub(crate) fn existing(&self) -> Vec<&'static str> {
        let exists = |law: &Law| self.design(law).is_ok();
        Law::ALL.iter().filter(|law| exists(law)).map(Law::name).collect()
    }

    fn require_current(&self) -> Result<(), String> {
        if self.domain != Domain::Continuous && self.gains.estimator == Estimator::Prediction {
            let reason =
                "its estimate uses the newest measurement: expected estimator = \"current\"";
            return Err(reason.to_owned());
        }
        Ok(())
    }

    /// Returns the coordinates that the fast adaptive, the sliding-mode and the learning law need, and adds the
    /// conditions for them to `conditions`; the error says in a sentence which one does not hold.
    fn direct_form(&self, conditions: &mut Vec<Check>) -> Result<DirectForm, String> {
        let ramp = |fault: &&plant_file::faults::Fault| fault.dynamics == FaultDynamics::Ramp;
        if let Some(fault) = self.linear.faults.iter().find(ramp) {
            return Err(format!(
                "it has its own model of a fault: expected kind = \"constant\" for fault `{}`",
                fault.name
            ));
        }
        let form = DirectForm::new(&self.extended.plant, self.extended.domain).map_err(text)?;
        let q = self.linear.faults.len();
        #[expect(clippy::cast_precision_loss, reason = "a number of faults is far below 2^52")]
        let rank = q as f64;
        let acts_on = match self.extended.domain {
            Domain::Continuous => "the derivatives",
            Domain::Sampled { .. } => "the next sample",
        };
        conditions.push(check(
            "rank C F_a is the number of faults",
            Some(rank),
            format!("rank {q} of {q}; the faults act on {acts_on} of the measurements directly"),
        ));
        if self.extended.domain == Domain::Continuous {
            let name = "the invariant zeros of (A, F_a, C) are in the left half plane";
            conditions.push(zeros(&form, name));
        }
        if self.domain == Domain::Continuous {
            return Ok(form);
        }
        let sampled = DirectForm::new(self.plant, self.domain)
            .map_err(|error| format!("of the sampled plant: {error}"))?;
        conditions.push(zeros(&sampled, "those of the sampled plant are in the unit circle"));
        Ok(sampled)
    }

    /// Returns rho of each fault, stated or by default, and adds to `conditions` that rho is above the bound of the
    /// fault; the error says in a sentence for which fault it is not, or what is missing.
    fn reach(
        &self,
        stated: Option<&Vec<f64>>,
        conditions: &mut Vec<Check>,
    ) -> Result<Vec<f64>, String> {
        let mut all = Vec::new();
        for (at, fault) in self.linear.faults.iter().enumerate() {
            let reach = match (stated.map(|list| list[at]), fault.bound) {
                (Some(rho), _) => rho,
                (None, Some(bound)) => REACH * bound,
                (None, None) => {
                    return Err(format!("it needs `rho`, or `bound` of fault `{}`", fault.name));
                }
            };
            if let Some(bound) = fault.bound {
                if reach <= bound {
                    let name = &fault.name;
                    return Err(format!(
                        "rho = {reach} of fault `{name}` is not above its bound {bound}: expected more"
                    ));
                }
                conditions.push(check(
                    "rho is above the bound of the fault",
                    Some(reach / bound),
                    format!("{reach} above {bound}: fault {}", fault.name),
                ));
            }
            all.push(reach);
        }
        Ok(all)
    }

    /// Checks that the error dynamics with the gains of the law are stable, and adds this to its conditions.
    fn require_stable(&self, design: &mut DesignedLaw) -> Result<(), String> {
        let mut plant = self.plant.clone();
        if let Some(a_f) = &design.a_f {
            plant.a_f.copy_from(a_f);
        }
        let excess =
            instability(&design.gains.error_dynamics(&plant), self.domain).map_err(text)?;
        if excess >= 0.0 {
            return Err(format!("its error dynamics would not be stable, by {excess:.3e}"));
        }
        let linear = if design.injection.is_some() { " within the boundary layer" } else { "" };
        let margin = measure(self.domain);
        design.conditions.push(check(
            "the estimation errors decay",
            Some(excess),
            format!("{margin}{linear}"),
        ));
        Ok(())
    }

    /// Returns a parameter with one number for each fault; without `unit` in the unit of the fault.
    fn each(&self, name: &str, unit: Option<&str>, values: &[f64]) -> Vec<Number> {
        let faults = self.linear.faults.iter().zip(values);
        let one = |(fault, value): (&plant_file::faults::Fault, &f64)| Number {
            name: format!("{name} of {}", fault.name),
            unit: unit.map(str::to_owned).or_else(|| fault.unit.clone()),
            value: *value,
        };
        faults.map(one).collect()
    }
}

/// Returns the definition of the instability in a time domain, with its unit, for a report.
pub(crate) fn measure(domain: Domain) -> &'static str {
    match domain {
        Domain::Continuous => "largest real part of the eigenvalues, 1/s",
        Domain::Sampled { .. } => "largest modulus of the eigenvalues, less 1",
    }
}

fn number(name: &str, unit: Option<&str>, value: f64) -> Number {
    Number { name: name.to_owned(), unit: unit.map(str::to_owned), value }
}

fn zeros(form: &DirectForm, condition: &str) -> Check {
    let all: Vec<_> =
        form.zeros.iter().map(|zero| format!("{:.4}{:+.4}i", zero.re, zero.im)).collect();
    let list = if all.is_empty() { "there are none".to_owned() } else { all.join(", ") };
    check(condition, None, list)
}

fn check(condition: &str, value: Option<f64>, explanation: String) -> Check {
    Check { condition: condition.to_owned(), holds: true, value, explanation }
}

#[expect(clippy::needless_pass_by_value, reason = "the form that map_err needs")]
fn text(error: Error) -> String {
    error.to_string()
}
