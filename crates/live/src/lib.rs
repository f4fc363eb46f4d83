//! A page on localhost that shows a running simulation and passes requests to it.
//!
//! [`View::open`] starts a server at a random port of 127.0.0.1; the address of the page contains a random token. The
//! thread of the run calls [`View::is_called`] at each communication point, one atomic load. If this returns true, the
//! run publishes a [`Sample`] if [`View::take_calls`] returns true, and answers requests. Publishing never waits for
//! the server: samples and messages that do not fit into its queue are dropped and counted. [`View::end`] waits for the
//! server, and [`View::request`] for a request of a page, up to a time that the caller states.
//!
//! The server answers requests that state the token, the address of the server as `Host`, and no foreign
//! `Origin`; it limits the size of a request, the time for it and the number of connections
//! (`server.rs`, `request.rs`, `guard.rs`).
#![forbid(unsafe_code)]

mod action;
mod answer;
mod facts;
mod guard;
mod request;
mod routes;
mod server;
mod shared;
mod store;
mod view;

pub use action::{Action, Request};
pub use facts::{Facts, Source, Subject, Variable};
pub use shared::Phase;
pub use store::Sample;
pub use view::{Messages, View};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
