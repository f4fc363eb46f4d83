//! Our FMUs in the crates `fmi` and `fmi-rs`, and the FMUs of the first in our master.

mod coupled;
mod fmi3;
mod fmi_rs;
