//! The element `ModelStructure` of a model description.

use serde::Serialize;

use super::DependencyKind;
use crate::hash_form::{is_default, numbered};

/// `ModelStructure`: indices are 1-based positions in `ModelDescription::variables`. The value
/// references of FMI 3.0 are converted when a file is read or written.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ModelStructure {
    /// `Outputs`; `Output` in FMI 3.0.
    pub outputs: Vec<Unknown>,
    /// `Derivatives`; `ContinuousStateDerivative` in FMI 3.0.
    pub derivatives: Vec<Unknown>,
    /// `InitialUnknowns`; `InitialUnknown` in FMI 3.0.
    pub initial_unknowns: Vec<Unknown>,
    /// `ClockedState` (FMI 3.0).
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<1, _, _>")]
    pub clocked_states: Vec<Unknown>,
    /// `EventIndicator` (FMI 3.0): the event indicators, which are variables. FMI 2.0 states only their number.
    #[serde(skip_serializing_if = "is_default", serialize_with = "numbered::<2, _, _>")]
    pub event_indicators: Vec<Unknown>,
}

/// `Unknown`: one row of `ModelStructure`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Unknown {
    /// `index`, 1-based; `valueReference` in FMI 3.0.
    pub index: u32,
    /// `dependencies`: `None` (absent) means a dependency on all knowns, an empty list on none.
    pub dependencies: Option<Vec<u32>>,
    /// `dependenciesKind`, with one entry for each of `dependencies`.
    pub kinds: Option<Vec<DependencyKind>>,
}
