//! The progress of a design.

use std::sync::atomic::{AtomicU32, Ordering};

/// The start of a step of a design.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// The name of what is computed from now on.
    pub step: &'static str,
    /// The part of the work that is done, from 0 to below 1, estimated for a large plant.
    pub done: f64,
}

/// A function that is called when a step begins, possibly by several threads at the same time.
pub type Observer<'a> = dyn Fn(Progress) + Sync + 'a;

/// The steps that take the time of a design. Some of them run at the same time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Step {
    Gains,
    Detection,
    Reconfiguration,
    Margins,
    Comparison,
    Tolerances,
    Certificates,
    Bounds,
    Responses,
    Remedies,
}

impl Step {
    const ALL: [Self; 10] = [
        Self::Gains,
        Self::Detection,
        Self::Reconfiguration,
        Self::Margins,
        Self::Comparison,
        Self::Tolerances,
        Self::Certificates,
        Self::Bounds,
        Self::Responses,
        Self::Remedies,
    ];

    /// Returns the name of the step, and its part of the time of a design with 100 states, relative to the other steps.
    fn name_and_weight(self) -> (&'static str, u32) {
        match self {
            Self::Gains => ("gains", 5),
            Self::Detection => ("detection", 2),
            Self::Reconfiguration => ("reconfiguration", 2),
            Self::Margins => ("margins", 45),
            Self::Comparison => ("comparison", 10),
            Self::Tolerances => ("parameter tolerances", 20),
            Self::Certificates => ("certificates", 2),
            Self::Bounds => ("bounds", 20),
            Self::Responses => ("responses", 13),
            Self::Remedies => ("remedies", 5),
        }
    }
}

/// Counts the steps of one design that are done.
pub(crate) struct Steps<'a> {
    observer: &'a Observer<'a>,
    done: AtomicU32,
}

impl<'a> Steps<'a> {
    pub(crate) fn new(observer: &'a Observer<'a>) -> Self {
        Self { observer, done: AtomicU32::new(0) }
    }

    /// Tells the observer that `step` begins, and runs `compute`.
    pub(crate) fn run<T>(&self, step: Step, compute: impl FnOnce() -> T) -> T {
        let all: u32 = Step::ALL.into_iter().map(|step| step.name_and_weight().1).sum();
        let (name, weight) = step.name_and_weight();
        let done = f64::from(self.done.load(Ordering::Relaxed)) / f64::from(all);
        (self.observer)(Progress { step: name, done });
        let computed = compute();
        self.done.fetch_add(weight, Ordering::Relaxed);
        computed
    }
}
