//! Examines a design: margins, certificates, bounds, responses, and the verdict.

pub(crate) mod estimation;
pub(crate) mod references;
