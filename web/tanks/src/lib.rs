//! The three tanks with a controller that detects faults: plant, controller and master in one program.
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
