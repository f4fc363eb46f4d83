//! Requirements on a gain that cannot be met, as errors in the plant file.

use std::ops::Range;

use control::rank::Mode;
use control::{Domain, Error};
use files::PlaceError;
use plant_file::PlantFile;
use plant_file::requirements::{Request, Requirement};

use crate::plant::fixed_mode::{described_in, has_rate};
use crate::plant::linear::LinearPlant;
use crate::solve::gain::Refusal;
use crate::solve::names::feedback_states;

/// The states that a gain is for.
pub(crate) struct States {
    pub(crate) names: Vec<String>,
    /// Kind of the states, in words for a message.
    pub(crate) meaning: &'static str,
    /// The positions of the states of delays and filters, for which a plant file states no weights.
    pub(crate) of_delays: Range<usize>,
}

impl States {
    /// Returns the name of the state to which a row of weights belongs.
    pub(crate) fn weighted(&self, row: usize) -> &str {
        let skipped = if row < self.of_delays.start { 0 } else { self.of_delays.len() };
        self.names.get(row + skipped).map_or("", String::as_str)
    }
}

pub(crate) fn feedback_refused(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    domain: Domain,
    refusal: Refusal,
) -> PlaceError {
    let names = feedback_states(file, linear);
    let more = names.len() > linear.states.len();
    let meaning = if more { "states and integrals of references" } else { "states" };
    let states = States { names, meaning, of_delays: linear.delay_states() };
    refused(file, domain, &file.feedback, refusal, &states)
}

/// Converts the refusal of a gain for `states` to an error at the requirement in the file.
pub(crate) fn refused(
    file: &PlantFile<'_>,
    domain: Domain,
    request: &Request,
    refusal: Refusal,
    states: &States,
) -> PlaceError {
    let (order, meaning) = (states.names.len(), states.meaning);
    let name = |at: usize| states.names[at].clone();
    let message = match refusal {
        Refusal::Conflict(message) => message,
        Refusal::Fixed(mode) => fixed(&request.requirement, &mode, domain, name),
        Refusal::Control(Error::PoleCount { .. }) => {
            let count = request.requirement.eigenvalues().len();
            let of_delays = match states.of_delays.len() {
                0 => String::new(),
                count => format!(" ({count} of them those of delays)"),
            };
            format!(
                "expected {order} eigenvalues, one for each of the {meaning}{of_delays}, found {count}"
            )
        }
        Refusal::Control(ref error @ Error::Unweighted { weight: "W", .. }) => {
            match request.requirement.without_noise() {
                Some(at) => format!(
                    "W states no noise for `{}` (its row {} is zero), so that the observer would not \
                     correct it; expected a number above 0 there",
                    states.weighted(at),
                    at + 1
                ),
                None => error.to_string(),
            }
        }
        Refusal::Control(error @ Error::Shape { matrix: "Q", .. }) => {
            format!("{error}, one row for each of the {meaning}")
        }
        Refusal::Control(error) => error.to_string(),
    };
    match &request.other {
        Some((name, place)) if message.starts_with(&format!("{name} ")) => {
            file.error_at(place, message)
        }
        _ => file.error_at(&request.place, message),
    }
}

/// Returns a sentence that a requirement excludes the eigenvalue of a mode that no gain moves.
pub(crate) fn fixed(
    requirement: &Requirement,
    mode: &Mode,
    domain: Domain,
    name: impl Fn(usize) -> String,
) -> String {
    let sampled = matches!(requirement, Requirement::SampledEigenvalues(_));
    let described = described_in(mode, domain, sampled, name);
    match requirement {
        Requirement::Eigenvalues(_) if domain != Domain::Continuous && !has_rate(mode) => format!(
            "no gain moves {described}; expected `sampled_eigenvalues` with it, or `region` or weights in \
             place of eigenvalues"
        ),
        Requirement::Eigenvalues(_) | Requirement::SampledEigenvalues(_) => format!(
            "no gain moves {described}; expected it among the requested eigenvalues, or `region` or \
             weights in place of eigenvalues"
        ),
        _ => format!("no gain moves {described}, into the region; expected a region around it"),
    }
}
