//! The results of the search for a gain.

use control::lmi::{Outcome, Synthesis};
use control::placement::Quality;
use control::rank::Mode;
use control::{Domain, Error};
use nalgebra::{Complex, DMatrix};

use crate::report::NormReport;
use plant_file::requirements::Region;

/// A gain and the method that found it.
#[derive(Clone, Default)]
pub(crate) struct GainResult {
    pub(crate) gain: DMatrix<f64>,
    /// The method, in a sentence.
    pub(crate) method: String,
    /// The required eigenvalues, if any, in the plane of the domain.
    pub(crate) required: Vec<Complex<f64>>,
    /// Accuracy and conditioning of an eigenvalue assignment.
    pub(crate) quality: Option<Quality>,
    /// The H-infinity norm, if the gain minimises or bounds it.
    pub(crate) norm: Option<NormReport>,
    /// The noise of a Kalman filter.
    pub(crate) noise: Option<Box<Noise>>,
    /// All results of an eigenvalue assignment; None for other methods.
    pub(crate) choice: Option<Box<GainChoice>>,
}

/// The noise for which a Kalman filter is optimal, and the covariance of its predicted estimate.
#[derive(Clone)]
pub(crate) struct Noise {
    /// W, the covariance of the noise on the states of the observer; its intensity in continuous time.
    pub(crate) process: DMatrix<f64>,
    /// V, the covariance of the noise of the measurements; its intensity in continuous time.
    pub(crate) measurements: DMatrix<f64>,
    /// P, the covariance of the predicted states of the observer.
    pub(crate) covariance: DMatrix<f64>,
    /// Whether all three are known up to a common factor only, which the gain does not depend on.
    pub(crate) is_relative: bool,
}

/// The gains that assign the same eigenvalues, from which the gain with the lowest peaks of S of the loop is chosen.
#[derive(Clone)]
pub(crate) struct GainChoice {
    /// See [`control::placement::Alternatives::candidates`].
    pub(crate) candidates: [Vec<GainResult>; 2],
    /// The gains of the standard methods, see [`control::placement::Alternatives::standard`].
    pub(crate) standard: [Option<DMatrix<f64>>; 2],
}

/// Why no gain was found.
pub(crate) enum Refusal {
    /// A numerical method failed or rejected its data.
    Control(Error),
    /// The requirements contradict each other, or no result could be verified.
    Conflict(String),
    /// The requirement excludes the eigenvalue of a mode that no gain moves.
    Fixed(Mode),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Control(error)
    }
}

/// The system for the state feedback, and its faults.
pub(crate) struct FeedbackProblem<'a> {
    pub(crate) a: &'a DMatrix<f64>,
    pub(crate) b: &'a DMatrix<f64>,
    pub(crate) c: &'a DMatrix<f64>,
    /// Number of states of the plant, before the integrals of references.
    pub(crate) states: usize,
    pub(crate) f_a: &'a DMatrix<f64>,
}

/// Returns a gain of a method that has neither a choice of gains nor required eigenvalues.
pub(crate) fn unique(gain: DMatrix<f64>, method: String) -> GainResult {
    GainResult { gain, method, ..GainResult::default() }
}

pub(crate) fn synthesised(
    outcome: Outcome<Synthesis>,
    method: &str,
) -> Result<GainResult, Refusal> {
    match outcome {
        Outcome::Optimal(synthesis) => {
            let bound = synthesis.bound.as_ref();
            let bound = bound.map_or(String::new(), |bound| {
                format!("; bound {:.4e}, verified with margin {:.1e}", bound.gamma, bound.margin)
            });
            let margin = synthesis.region.margin;
            let method = format!("{method}; region verified with margin {margin:.1e}{bound}.");
            Ok(unique(synthesis.gain, method))
        }
        Outcome::Infeasible { conflict } => Err(Refusal::Conflict(contradiction(&conflict))),
        Outcome::Inconclusive(reason) => Err(Refusal::Conflict(format!(
            "no answer could be verified: {reason}; other requirements, or units nearer to the size of \
             the signals may help"
        ))),
    }
}

/// Names the conflicting requirements as in the plant file.
fn contradiction(conflict: &[&str]) -> String {
    let name = |requirement: &&str| match *requirement {
        "gain" => "h_infinity".to_owned(),
        other => other.to_owned(),
    };
    match conflict {
        [one] => format!("this cannot be met, even without the other requirements: {}", name(one)),
        several => {
            let names: Vec<_> = several.iter().map(name).collect();
            format!("these requirements contradict each other: {}", names.join(", "))
        }
    }
}

impl GainChoice {
    pub(crate) fn candidates(&self) -> [Vec<&GainResult>; 2] {
        self.candidates.each_ref().map(|results| results.iter().collect())
    }
}

impl GainResult {
    /// Applies `map` to the gain; the gains in `choice` stay.
    pub(crate) fn mapped(self, map: impl Fn(&DMatrix<f64>) -> DMatrix<f64>) -> Self {
        Self { gain: map(&self.gain), ..self }
    }

    /// Returns the candidates among which the peaks of S select; without a choice, this result as the only candidate.
    pub(crate) fn into_choice(mut self) -> GainChoice {
        if let Some(choice) = self.choice.take() {
            return *choice;
        }
        let standard = [Some(self.gain.clone()), Some(self.gain.clone())];
        GainChoice { candidates: [vec![self], vec![]], standard }
    }
}

/// Refuses a region that excludes the eigenvalue of one of the modes `fixed`, which no gain moves.
pub(crate) fn require(region: Region, fixed: &[Mode], domain: Domain) -> Result<(), Refusal> {
    match fixed.iter().find(|mode| !region.contains(mode.eigenvalue, domain)) {
        Some(mode) => Err(Refusal::Fixed(mode.clone())),
        None => Ok(()),
    }
}
