//! The experiment of the paper in one program: plant, controller and master, as native.
#![deny(unsafe_code)]

mod exports;
mod linked;
mod models;
mod run;
mod settings;
mod text;
