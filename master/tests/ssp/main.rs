//! SSP 1.0: what system structures mean, by examples with answers computed by hand.
#![expect(clippy::unwrap_used, reason = "tests")]

mod bench;
mod connections;
mod files;
mod parameters;
mod reading;
mod units;
mod writing;
