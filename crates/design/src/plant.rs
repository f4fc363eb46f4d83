//! The plant: linear, at the operating point, with its faults; and the plants of varied parameters.

pub(crate) mod attainable;
pub(crate) mod delays;
pub(crate) mod entries;
pub(crate) mod feedthrough;
pub(crate) mod filters;
pub(crate) mod fixed_mode;
pub(crate) mod linear;
pub(crate) mod parameters;
pub(crate) mod plausibility;
pub(crate) mod rest;
