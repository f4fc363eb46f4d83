//! The progress of a design.

use std::sync::atomic::{AtomicU32, Ordering};

/// The start of a step of a design.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// The name of the step.
    pub step: &'static str,
    /// The part of the work that is done, from 0 to below 1, estimated for a large plant.
    pub done: f64,
}

/// A function that is called when a step begins, possibly by several threads at the same time.
pub type Observer<'a> = dyn Fn(Progress) + Sync + 'a;

/// The steps of a design that take most of the time. Some of them run at the same time.
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

/// The name of each step, and its part of the time of a design with 100 states, relative to the other steps.
const STEPS: [(&str, u32); 10] = [
    ("gains", 5),
    ("detection", 2),
    ("reconfiguration", 2),
    ("margins", 45),
    ("comparison", 10),
    ("parameter tolerances", 20),
    ("certificates", 2),
    ("bounds", 20),
    ("responses", 13),
    ("remedies", 5),
];

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
        let all: u32 = STEPS.iter().map(|(_, weight)| weight).sum();
        let (name, weight) = STEPS[step as usize];
        let done = f64::from(self.done.load(Ordering::Relaxed)) / f64::from(all);
        (self.observer)(Progress { step: name, done });
        let computed = compute();
        self.done.fetch_add(weight, Ordering::Relaxed);
        computed
    }
}
