//! The source file of a design: sizes, switches, tables, and the functions that the header declares.

use super::{RUNTIME, Source};
use crate::arithmetic::Memory;
use crate::symbols::Kind;
use crate::tables::tables;
use crate::text::{Lines, ascii};

impl Source<'_> {
    pub(super) fn implementation(&self) -> String {
        let Self { request, controller, .. } = self;
        let name = &request.prefix;
        let Memory { constants, .. } = Memory::of(controller, request.precision);
        let mut lines = Lines::default();
        lines.push(format!(
            "/* Written by {}; {name}.h describes it. */
#include \"{name}.h\"

#include <float.h>

/* The numbers and the instance of this design. */
typedef {} aso_real;
typedef {name}_State aso_State;",
            ascii(request.identity),
            self.real
        ));
        self.settings(&mut lines);
        lines.push(format!("\n/* Constants: {constants} bytes. */"));
        for table in tables(controller) {
            self.table(&mut lines, &table);
        }
        if let [input] = controller.schedule_inputs() {
            let start = self.literal(input.operating);
            lines.push(format!("static const {} theta_start = {start};", self.real));
        }
        self.integer_tables(&mut lines);
        lines.push(format!("\n#include \"{RUNTIME}\""));
        self.starts(&mut lines);
        self.step(&mut lines);
        lines.text()
    }

    /// Adds the functions that start an instance.
    fn starts(&self, lines: &mut Lines) {
        let (name, real) = (&self.request.prefix, self.real);
        let (n, q) = (self.count(Kind::State), self.count(Kind::Fault));
        lines.push(format!(
            "
void {name}_init({name}_State *state)
{{
    aso_start_without_faults(state);
}}

void {name}_init_at({name}_State *state, const {real} x_hat_0[{n}],
    const {real} f_hat_0[{q}])
{{
    aso_start(state, x_hat_0, f_hat_0);
}}"
        ));
    }

    /// Adds the function that takes a sample. It copies the named signals into vectors, and the results back.
    fn step(&self, lines: &mut Lines) {
        lines.push(format!("\n{}\n{{", self.signature()));
        lines.push("    aso_Sample sample;\n    uint32_t status = 0U;\n");
        self.inputs(lines);
        self.reconfigure(lines);
        let reset = if self.controller.detection.is_some() { "detection_reset" } else { "false" };
        lines.push(format!(
            "    status = status | aso_sample(state, &sample, compensate, {reset});\n"
        ));
        self.outputs(lines);
        lines.push("    return status;\n}");
    }

    /// Adds the statements that store the inputs that are used.
    fn inputs(&self, lines: &mut Lines) {
        let is_checked = self.controller.checks_measurements();
        for (owner, fields, vector) in [
            ("measurements", &self.fields.measurements, "y"),
            ("references", &self.fields.references, "r"),
        ] {
            lines.extend(fields.iter().enumerate().map(|(k, field)| {
                if is_checked && vector == "y" {
                    let take = format!("aso_take_measurement(state, {k}U, {owner}->{field})");
                    return format!("    status = status | {take};");
                }
                format!("    status = status | aso_take(&state->{vector}[{k}], {owner}->{field});")
            }));
        }
        lines.extend(self.fields.schedule.iter().map(|field| {
            format!("    status = status | aso_take(&state->theta, schedule->{field});")
        }));
    }

    /// Adds the choice of the gains at the start of a sample; nothing without a reconfiguration.
    fn reconfigure(&self, lines: &mut Lines) {
        let Some(reconfiguration) = &self.controller.reconfiguration else { return };
        let fall_back =
            if reconfiguration.fallback.is_some() { "actuators->fall_back" } else { "false" };
        lines.push("    if (state->sample > 0U)\n    {");
        if !reconfiguration.cases.is_empty() {
            let fields = self.fields.switches(self.controller);
            let fields = fields.iter().take(reconfiguration.cases.len());
            let reported: Vec<_> = fields.map(|field| format!("actuators->{field}")).collect();
            lines.push(format!(
                "        const bool reported[{}] = {{{}}};\n\n        find_gone(state, reported, {fall_back});",
                self.count(Kind::Case),
                reported.join(", ")
            ));
        }
        lines.push(format!("        choose_gains(state, {fall_back});\n    }}"));
    }

    fn outputs(&self, lines: &mut Lines) {
        let Self { controller, fields, .. } = self;
        let mut copy = |target: &str, fields: &[String], source: &str| {
            let fields = fields.iter().enumerate();
            lines.extend(fields.map(|(k, field)| format!("    {target}{field} = {source}[{k}];")));
        };
        copy("commands->", &fields.actuators, "state->u");
        copy("estimates->x_hat_", &fields.states, "sample.x_value");
        copy("estimates->f_hat_", &fields.faults, "sample.f_value");
        let losses: Vec<_> =
            controller.losses.iter().map(|loss| fields.faults[loss.fault].clone()).collect();
        copy("estimates->E_hat_", &losses, "sample.lost");
        copy("estimates->x_i_", &fields.integrals, "sample.x_i_value");
        lines.push_if(
            controller.reconfiguration.is_some(),
            "    *reconfiguration = state->reconfiguration;",
        );
        lines.push_if(
            controller.detection.is_some(),
            "    detection->detected = state->isolated != 0;
    detection->isolated = state->isolated;
    detection->t_detected = decision_time(state, state->detected_at);
    detection->t_onset = decision_time(state, state->onset);
    copy(detection->residual, state->residual, ASO_RESIDUALS);
    copy(detection->statistic, state->statistic, ASO_TESTS);",
        );
    }
}
