//! Claims of the libraries and the command, a module for each subject. Tests that need a process
//! for themselves are in binaries of their own.
#![forbid(unsafe_code)]

mod author;
mod check;
mod closed_loop;
mod command;
mod coupling;
mod discrete;
mod engine;
mod linearise;
mod misbehaviour;
mod misbehaviour_calls;
mod misbehaviour_files;
mod misbehaviour_isolated;
mod misbehaviour_loading;
mod misbehaviour_process;
mod misbehaviour_run;
mod model_exchange;
mod modules;
mod network;
mod order;
mod package;
mod preload;
mod programs;
mod run;
mod scheduled;
mod source_code;
mod step_hints;
mod tidy;
mod versions;
