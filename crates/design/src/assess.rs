//! Examines a design: margins, certificates, bounds, responses, detection, and the verdict.

pub(crate) mod analysis;
pub(crate) mod bandwidths;
pub(crate) mod certificate;
pub(crate) mod checks;
pub(crate) mod detection;
pub(crate) mod estimation;
pub(crate) mod fallback;
pub(crate) mod family;
pub(crate) mod judged;
pub(crate) mod losses;
pub(crate) mod matrices;
pub(crate) mod pid;
pub(crate) mod reconfiguration;
pub(crate) mod references;
pub(crate) mod remedies;
pub(crate) mod reporting;
pub(crate) mod responses;
pub(crate) mod robustness;
pub(crate) mod schedule;
pub(crate) mod slow_estimates;
pub(crate) mod verdict;
pub(crate) mod worst_case;
