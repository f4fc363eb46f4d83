//! Isolated FMUs. These tests have time limits, so they do not share a process with other tests.
#![forbid(unsafe_code)]

mod isolate;
mod isolate_together;
