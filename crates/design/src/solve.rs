//! Solves for the controller: the gains for one plant, a family, a schedule, and actuators that are gone.

pub(crate) mod bandwidth;
pub(crate) mod designed;
pub(crate) mod existence;
pub(crate) mod fallback;
pub(crate) mod family;
pub(crate) mod gain;
pub(crate) mod gain_problem;
pub(crate) mod gains;
pub(crate) mod law;
pub(crate) mod loop_shape;
pub(crate) mod names;
pub(crate) mod norm_gains;
pub(crate) mod pairing;
pub(crate) mod pid;
pub(crate) mod reconfiguration;
pub(crate) mod refusal;
pub(crate) mod schedule;
pub(crate) mod solution;
pub(crate) mod tracking;
