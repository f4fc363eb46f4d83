//! How far a design is.

use std::sync::atomic::{AtomicU32, Ordering};

/// A step of a design that begins.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// What is computed from now on, a noun.
    pub step: &'static str,
    /// The part of the work that is done, 0 to 1: an estimate for a large plant.
    pub done: f64,
}

/// Is called when a step begins, by several threads at the same time.
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

    fn name(self) -> &'static str {
        match self {
            Self::Gains => "gains",
            Self::Detection => "detection",
            Self::Reconfiguration => "reconfiguration",
            Self::Margins => "margins",
            Self::Comparison => "comparison",
            Self::Tolerances => "parameter tolerances",
            Self::Certificates => "certificates",
            Self::Bounds => "bounds",
            Self::Responses => "responses",
            Self::Remedies => "remedies",
        }
    }

    /// The part of the time of a design with 100 states, relative to the other steps.
    fn weight(self) -> u32 {
        match self {
            Self::Gains | Self::Remedies => 5,
            Self::Margins => 45,
            Self::Comparison => 10,
            Self::Responses => 13,
            Self::Tolerances | Self::Bounds => 20,
            Self::Certificates | Self::Detection | Self::Reconfiguration => 2,
        }
    }
}

/// The steps of one design that are done.
pub(crate) struct Steps<'a> {
    observer: &'a Observer<'a>,
    done: AtomicU32,
}

impl<'a> Steps<'a> {
    pub(crate) fn new(observer: &'a Observer<'a>) -> Self {
        Self { observer, done: AtomicU32::new(0) }
    }

    /// Runs `compute` as a step.
    pub(crate) fn run<T>(&self, step: Step, compute: impl FnOnce() -> T) -> T {
        let all: u32 = Step::ALL.into_iter().map(Step::weight).sum();
        let done = f64::from(self.done.load(Ordering::Relaxed)) / f64::from(all);
        (self.observer)(Progress { step: step.name(), done });
        let computed = compute();
        self.done.fetch_add(step.weight(), Ordering::Relaxed);
        computed
    }
}
