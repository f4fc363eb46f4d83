//! The three tanks with the controller that detects faults, in one program: plant, controller and master, as native.
#![deny(unsafe_code)]

#[path = "../../src/exports.rs"]
mod exports;
#[path = "../../src/linked.rs"]
mod linked;
mod models;
#[path = "../../src/run.rs"]
mod run;
#[path = "../../src/settings.rs"]
mod settings;
#[path = "../../src/text.rs"]
mod text;
