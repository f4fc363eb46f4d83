//! The time that the phases of a design may take.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use control::lmi::{Ending, until};

/// The time that a design may take, and how to end it.
#[derive(Debug, Clone)]
pub struct TimeLimits {
    /// Time for the search for gains. A design whose gains are not found in this time is refused.
    pub gains: Duration,
    /// Time for certificates and bounds together. Certificates and bounds that are not computed in this time are left
    /// out, and the report says so. Zero leaves all of them out.
    pub certificates: Duration,
    /// True ends the search for gains, certificates and bounds; the report has what was done by then.
    pub interrupted: Arc<AtomicBool>,
}

impl Default for TimeLimits {
    /// Five minutes for the gains, 30 s for certificates and bounds.
    fn default() -> Self {
        Self {
            gains: Duration::from_secs(300),
            certificates: Duration::from_secs(30),
            interrupted: Arc::default(),
        }
    }
}

impl TimeLimits {
    /// Starts the clock of the gains.
    pub(crate) fn of_gains(&self) -> Budget {
        Budget::start(self.gains, "the search for gains", "--gain-time", &self.interrupted)
    }

    /// Starts the clock of certificates and bounds.
    pub(crate) fn of_certificates(&self) -> Budget {
        let (option, flag) = ("--certificate-time", &self.interrupted);
        Budget::start(self.certificates, "certificates and bounds", option, flag)
    }
}

/// Time that a phase of one design may take before the rest of this phase is left out.
#[derive(Clone)]
pub(crate) struct Budget {
    start: Instant,
    limit: Duration,
    phase: &'static str,
    /// The command-line option that allows more time.
    option: &'static str,
    interrupted: Arc<AtomicBool>,
}

impl Budget {
    fn start(
        limit: Duration,
        phase: &'static str,
        option: &'static str,
        interrupted: &Arc<AtomicBool>,
    ) -> Self {
        let interrupted = Arc::clone(interrupted);
        Self { start: Instant::now(), limit, phase, option, interrupted }
    }

    /// Starts the clock of a phase within this one, which has the fraction `part` of the whole time.
    pub(crate) fn part(&self, part: f64, phase: &'static str) -> Self {
        Self { start: Instant::now(), limit: self.limit.mul_f64(part), phase, ..self.clone() }
    }

    pub(crate) fn is_over(&self) -> bool {
        self.start.elapsed() >= self.limit || self.interrupted.load(Ordering::Relaxed)
    }

    /// Runs `compute`; its linear matrix inequalities are abandoned when the time is over.
    pub(crate) fn run<T>(&self, compute: impl FnOnce() -> T) -> T {
        let budget = self.clone();
        let ending: Ending = Arc::new(move || budget.is_over());
        until(Some(ending), compute)
    }

    /// Returns why something was left out, as a part of a sentence that begins with "left out".
    pub(crate) fn reason(&self) -> String {
        let Self { limit, phase, option, .. } = self;
        if self.interrupted.load(Ordering::Relaxed) {
            return "left out: the design was interrupted".to_owned();
        }
        let seconds = limit.as_secs_f64();
        format!("left out after {seconds} s, the time for {phase}; {option} allows more")
    }
}
