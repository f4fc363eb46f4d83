//! The experiment of the paper: plant, controller and master in one program.
#![deny(unsafe_code)]

mod exports;
mod linked;
mod models;
mod run;
mod settings;
mod text;
