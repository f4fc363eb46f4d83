//! The types of the crate, and how an instance starts.

use super::Source;
use crate::summary::{descriptions, descriptions_of_estimates};
use crate::symbols::{Matrix, Vector};
use crate::tables::{starts, stored};
use crate::text::Lines;

impl Source<'_> {
    pub(super) fn structures(&self, lines: &mut Lines) {
        let Self { controller, fields, real, .. } = self;
        let estimates = fields.estimates(controller);
        let described = [
            descriptions(&controller.measurements),
            descriptions(&controller.references),
            descriptions(controller.schedule_inputs()),
            descriptions(&controller.actuators),
            descriptions_of_estimates(controller),
        ];
        let groups = [
            ("Measurements", "The measurements of a sample.", "MEASUREMENTS", &fields.measurements),
            ("References", "The references of a sample.", "REFERENCES", &fields.references),
            ("Schedule", "The scheduling variable of a sample.", "1", &fields.schedule),
            ("Commands", "The commands of a sample.", "ACTUATORS", &fields.actuators),
            ("Estimates", "The estimates of a sample.", "ESTIMATES", &estimates),
        ];
        for ((name, text, count, fields), described) in groups.into_iter().zip(&described) {
            if fields.is_empty() {
                continue;
            }
            lines.push(format!(
                "\n/// {text}\n#[derive(Clone, Copy, Debug, Default, PartialEq)]\npub struct {name} {{"
            ));
            for (field, text) in fields.iter().zip(described) {
                lines.push(format!("    /// {text}.\n    pub {field}: {real},"));
            }
            lines.push("}");
            lines.push(conversions(name, fields, &format!("[{real}; {count}]")));
        }
        self.actuators_structure(lines);
        self.detection_structure(lines);
        self.outputs_structure(lines);
        lines.push(
            "
/// One instance of the controller.
#[derive(Clone, Debug, PartialEq)]
pub struct Controller {",
        );
        for vector in stored(controller).into_iter().chain([Vector::U]) {
            lines.push(format!("    {}: [{real}; {}],", vector.name(), vector.kind().plural()));
        }
        let is_input = !controller.schedule_inputs().is_empty();
        lines.push_if(is_input, format!("    theta: [{real}; 1],"));
        lines.extend(
            self.other_fields().map(|field| format!("    {}: {},", field.name, field.kind)),
        );
        lines.push_if(controller.has_counter(), "    sample: u32,");
        lines.push_if(controller.filter.is_some(), "    started: bool,");
        lines.push("}");
    }

    /// Adds the structures of the status of a sample, and of its results.
    fn outputs_structure(&self, lines: &mut Lines) {
        let controller = self.controller;
        let inputs = match controller.schedule_inputs() {
            [] => "A measurement or reference",
            _ => "A measurement, a reference or the scheduling variable",
        };
        let held = if controller.checks_measurements() {
            ", or a measurement
    /// outside of its range; its last other value was used."
        } else {
            "; its last finite value was used."
        };
        lines.push(format!(
            "
/// What was unusual in a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {{
    /// {inputs} was NaN or infinite{held}
    pub held: bool,
    /// A command is at a limit.
    pub at_limit: bool,
    /// A sum was beyond the range of the numbers; commands and estimates keep their values.
    pub overflow: bool,"
        ));
        lines.push_if(
            controller.schedule.is_some(),
            "    /// The scheduling variable is outside of the schedule; the nearest point was used.
    pub outside: bool,",
        );
        lines.push_if(
            controller.limits_holds(),
            "    /// The last value of a measurement was used for too long; commands and estimates are those of the operating point.
    pub lost: bool,",
        );
        lines.push(
            "}

/// The results of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outputs {
    /// The commands.
    pub commands: Commands,
    /// The estimates.
    pub estimates: Estimates,",
        );
        lines.push_if(
            controller.detection.is_some(),
            "    /// Decision, residuals and statistics.\n    pub detection: Detection,",
        );
        lines.push_if(
            controller.reconfiguration.is_some(),
            "    /// The position from 1 of the first actuator that the controller does without; 0 if there is none, -1 in the
    /// fall-back.
    pub reconfiguration: i32,",
        );
        lines.push("    /// What was unusual.\n    pub status: Status,\n}");
    }

    /// Adds the functions that start an instance.
    pub(super) fn start(&self, lines: &mut Lines) {
        let Self { controller, real, .. } = self;
        let [x, u, y, r] = starts(controller).map(|(name, _)| name.to_ascii_uppercase());
        let filter = match controller.detection {
            None => String::new(),
            Some(_) => format!(
                "
        let (mut deviations, mut x_r) = (x_hat, [0.0; RESIDUAL_STATES]);
        for (deviation, x_op) in deviations.iter_mut().zip(&{x}) {{
            *deviation -= *x_op;
        }}
        Matrix::new(&START_R).add_product(&deviations, &mut x_r);"
            ),
        };
        lines.push(format!(
            "
impl Default for Controller {{
    fn default() -> Self {{
        Self::new()
    }}
}}

impl Controller {{
    /// Starts at the operating point, without faults.
    #[must_use]
    pub fn new() -> Self {{
        Self::starting_at({x}, [0.0; FAULTS])
    }}

    /// Starts at these estimates of states and faults.
    #[must_use]
    pub fn starting_at(x_hat: [{real}; STATES], f_hat: [{real}; FAULTS]) -> Self {{{filter}
        Self {{
            x_hat,
            f_hat,"
        ));
        lines.push_if(
            controller.filter.is_some(),
            format!("            y_f: {y},\n            started: false,"),
        );
        lines.extend(
            self.other_fields()
                .map(|field| format!("            {}: {},", field.name, field.start)),
        );
        lines.push_if(controller.has_counter(), "            sample: 0,");
        lines.push_if(
            controller.detection.is_some(),
            "            x_r,\n            residual: [0.0; RESIDUALS],",
        );
        lines.push_if(!controller.references.is_empty(), format!("            r: {r},"));
        lines.push_if(controller.has(Matrix::H), "            x_i: [0.0; REFERENCES],");
        lines.push_if(controller.has(Matrix::D), "            u_before: [0.0; ACTUATORS],");
        lines.push_if(controller.transfer.is_some(), "            u_t: [0.0; ACTUATORS],");
        if let [input] = controller.schedule_inputs() {
            lines.push(format!("            theta: [{}],", self.literal(input.operating)));
        }
        lines.push(format!("            y: {y},\n            u: {u},\n        }}\n    }}\n}}"));
    }

    /// Adds the structure with decision, residuals and statistics of a sample; nothing without a detection.
    fn detection_structure(&self, lines: &mut Lines) {
        if self.controller.detection.is_none() {
            return;
        }
        let real = self.real;
        lines.push(format!(
            "
/// Decision, residuals and statistics of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {{
    /// Whether a test has given an alarm since the last reset.
    pub detected: bool,
    /// The position from 1 of the fault that the alarms fit; 0 without an alarm, -1 if they fit none or several.
    pub isolated: i32,
    /// The time of the first alarm in s; -1 before.
    pub t_detected: {real},
    /// The estimated time in s at which the fault started; -1 before an alarm.
    pub t_onset: {real},
    /// The residuals in standard deviations.
    pub residual: [{real}; RESIDUALS],
    /// The statistics of the tests.
    pub statistic: [{real}; TESTS],
}}

impl Default for Detection {{
    fn default() -> Self {{
        Self {{
            detected: false,
            isolated: 0,
            t_detected: -1.0,
            t_onset: -1.0,
            residual: [0.0; RESIDUALS],
            statistic: [0.0; TESTS],
        }}
    }}
}}"
        ));
    }

    /// Adds the structure with the inputs about actuators that are gone; nothing without a reconfiguration.
    fn actuators_structure(&self, lines: &mut Lines) {
        if self.controller.reconfiguration.is_none() {
            return;
        }
        let fields = self.fields.switches(self.controller);
        let count = fields.len();
        lines.push(format!(
            "
/// Number of [`Actuators`].
pub const SWITCHES: usize = {count};

/// What is known about the actuators in a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Actuators {{"
        ));
        for field in &fields {
            let text = match field.strip_prefix("gone_") {
                Some(actuator) => format!("Whether `{actuator}` is gone"),
                None => {
                    "Whether an unknown actuator has failed: the gains are those of the fall-back"
                        .to_owned()
                }
            };
            lines.push(format!("    /// {text}.\n    pub {field}: bool,"));
        }
        lines.push("}");
        lines.push(conversions("Actuators", &fields, "[bool; SWITCHES]"));
    }
}

/// The conversions between a structure and the array of its fields.
fn conversions(name: &str, fields: &[String], array: &str) -> String {
    let values: Vec<_> = (1..=fields.len()).map(|k| format!("v{k}")).collect();
    let pairs: Vec<_> =
        fields.iter().zip(&values).map(|(field, value)| format!("{field}: {value}")).collect();
    let reads: Vec<_> = fields.iter().map(|field| format!("own.{field}")).collect();
    format!(
        "
impl From<{array}> for {name} {{
    fn from([{}]: {array}) -> Self {{
        Self {{ {} }}
    }}
}}

impl From<{name}> for {array} {{
    fn from(own: {name}) -> Self {{
        [{}]
    }}
}}",
        values.join(", "),
        pairs.join(", "),
        reads.join(", ")
    )
}
