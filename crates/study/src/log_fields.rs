//! The fields of a log message.

use std::fmt::{self, Write as _};

use tracing::field::{Field, Visit};

/// The fields of a message of the libraries or of an FMU, as `tracing` records them.
#[derive(Debug, Default)]
pub struct LogFields {
    /// The text of the message.
    pub message: String,
    /// The instance name of the FMU; empty for messages that come from no FMU.
    pub instance: String,
    /// The category that the FMU states; empty if the FMU states none.
    pub category: String,
    /// Simulated time in s, if stated.
    pub time: Option<f64>,
    /// Number of lost messages, for a message that reports a loss; `message` contains the number, too.
    pub lost: Option<u64>,
    /// All further fields, each as `, name = value`.
    pub others: String,
}

impl Visit for LogFields {
    fn record_f64(&mut self, field: &Field, value: f64) {
        if field.name() == "time" {
            self.time = Some(value);
        } else {
            self.record_debug(field, &value);
        }
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        if field.name() == "lost" {
            self.lost = Some(value);
        } else {
            self.record_debug(field, &value);
        }
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        match field.name() {
            "message" => value.clone_into(&mut self.message),
            "instance" => value.clone_into(&mut self.instance),
            "category" => value.clone_into(&mut self.category),
            _ => self.record_debug(field, &value),
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        match field.name() {
            "message" => self.message = format!("{value:?}"),
            name => {
                // Writing to a String cannot fail.
                let _ = write!(self.others, ", {name} = {value:?}");
            }
        }
    }
}
