//! SSP 1.0 and 2.0, and libcosim's format: what system structures mean, by examples with answers computed by hand.
#![expect(clippy::unwrap_used, reason = "tests")]

mod bench;
mod connections;
mod files;
mod newer;
mod osp;
mod parameters;
mod reading;
mod units;
mod writing;
