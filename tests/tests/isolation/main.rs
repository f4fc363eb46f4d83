//! FMUs in processes of their own, with limits of time that the tests of other subjects would use up.
#![forbid(unsafe_code)]

mod isolate;
mod isolate_together;
