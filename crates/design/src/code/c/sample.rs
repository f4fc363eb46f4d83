//! The function that takes a sample.

use super::Source;
use crate::code::recursion::{Operation, Statement, Term, When};
use crate::code::symbols::{Kind, Matrix, Vector};
use crate::code::tables::{kept, locals, shown};

impl Source<'_> {
    pub(super) fn step(&self, lines: &mut Vec<String>) {
        let Self { controller, recursion, real, capital, .. } = self;
        lines.extend([String::new(), self.signature(), "{".to_owned()]);
        for vector in locals(recursion) {
            lines.push(format!("    {real} {}[{}];", vector.name(), self.count(vector.kind())));
        }
        self.schedule_locals(lines);
        let compensating = match controller.first_compensated {
            0 => "compensate".to_owned(),
            _ => format!("compensate && (state->sample >= {capital}_FIRST_COMPENSATED)"),
        };
        let reconfiguration = controller.reconfiguration.as_ref();
        let changes = reconfiguration.is_some_and(|own| own.fallback == Some(false));
        let constant = if changes { "" } else { "const " };
        lines.extend([
            format!("    {real} sum;"),
            "    uint32_t i;".to_owned(),
            "    uint32_t status = 0U;".to_owned(),
            "    bool finite = true;".to_owned(),
            format!("    {constant}bool compensating = {compensating};"),
        ]);
        if controller.estimates_in_fallback() {
            lines.push("    bool estimating;".to_owned());
        }
        if controller.reconfiguration.is_some() {
            lines.push("    uint32_t set;\n    uint32_t k;".to_owned());
        }
        lines.push(String::new());
        self.inputs(lines);
        self.reconfigure(lines);
        self.interpolation(lines);
        if controller.filter.is_some() {
            lines.extend(["    if (!state->started)".to_owned(), "    {".to_owned()]);
            self.loop_over(
                lines,
                2,
                Kind::Measurement,
                &["            state->y_f[i] = state->y[i];"],
            );
            lines.extend(["        state->started = true;".to_owned(), "    }".to_owned()]);
        }
        for statement in &recursion.before_limits {
            self.statement(lines, statement);
        }
        self.stuck_commands(lines);
        lines.extend([String::new(), "    /* Is every output a number? */".to_owned()]);
        self.check(lines, &[Vector::Command, Vector::XValue, Vector::FValue]);
        self.limits(lines);
        for statement in &recursion.after_limits {
            self.statement(lines, statement);
        }
        lines.extend([String::new(), "    /* Is the next estimate one? */".to_owned()]);
        let kept = kept(controller);
        self.check(lines, &kept.iter().map(|(next, _)| *next).collect::<Vec<_>>());
        self.keep(lines, &kept);
        self.outputs(lines);
        lines.extend(["    return status;".to_owned(), "}".to_owned()]);
    }

    /// Takes the inputs that are numbers.
    fn inputs(&self, lines: &mut Vec<String>) {
        lines.push("    /* The last finite inputs. */".to_owned());
        for (owner, fields, vector) in [
            ("measurements", &self.fields.measurements, "y"),
            ("references", &self.fields.references, "r"),
            ("schedule", &self.fields.schedule, "theta"),
        ] {
            for (k, field) in fields.iter().enumerate() {
                let capital = &self.capital;
                let kept = match owner {
                    "schedule" => format!("state->{vector}"),
                    _ => format!("state->{vector}[{k}]"),
                };
                lines.push(format!(
                    "    status = status | take(&{kept}, {owner}->{field}, {capital}_HELD);"
                ));
            }
        }
    }

    fn check(&self, lines: &mut Vec<String>, vectors: &[Vector]) {
        for vector in vectors {
            let body = format!("        finite = is_finite({}[i]) && finite;", vector.name());
            self.loop_over(lines, 1, vector.kind(), &[&body]);
        }
    }

    fn limits(&self, lines: &mut Vec<String>) {
        if !self.controller.is_limited() {
            return;
        }
        lines.extend([
            String::new(),
            "    /* The observer uses the limited commands. */".to_owned(),
        ]);
        // A stuck actuator has no limits.
        let (free, close) = match self.controller.reconfiguration {
            None => ("", ""),
            Some(_) => ("(!state->gone[i]) && (", ")"),
        };
        let mut body = Vec::new();
        for (start, sign, own, value) in
            [("if", '<', "u_low", "u_min"), ("else if", '>', "u_high", "u_max")]
        {
            body.extend([
                format!("        {start} ({free}u[i] {sign} {own}[i]{close})"),
                "        {".to_owned(),
                format!("            u[i] = {own}[i];"),
                format!("            command[i] = {value}[i];"),
                format!("            status = status | {}_AT_LIMIT;", self.capital),
                "        }".to_owned(),
            ]);
        }
        body.extend(
            ["        else", "        {", "            /* not at a limit */", "        }"]
                .map(str::to_owned),
        );
        let body: Vec<_> = body.iter().map(String::as_str).collect();
        self.loop_over(lines, 1, Kind::Actuator, &body);
    }

    fn keep(&self, lines: &mut Vec<String>, kept: &[(Vector, Vector)]) {
        lines.extend(["    if (finite)".to_owned(), "    {".to_owned()]);
        for (next, stored) in kept {
            let body = format!("            {} = {}[i];", element(*stored), next.name());
            self.loop_over(lines, 2, next.kind(), &[&body]);
        }
        self.loop_over(lines, 2, Kind::Actuator, &["            state->u[i] = command[i];"]);
        if self.controller.detection.is_some() {
            lines.extend([
                "        if (state->sample > 0U)".to_owned(),
                "        {".to_owned(),
                "            detect(state, detection_reset);".to_owned(),
                "        }".to_owned(),
            ]);
        }
        lines.extend(["    }".to_owned(), "    else".to_owned(), "    {".to_owned()]);
        for (value, stored) in shown(self.controller) {
            let body = format!("            {}[i] = {};", value.name(), element(stored));
            self.loop_over(lines, 2, value.kind(), &[&body]);
        }
        let capital = &self.capital;
        lines.extend([
            match self.controller.schedule {
                None => format!("        status = (status & {capital}_HELD) | {capital}_OVERFLOW;"),
                Some(_) => format!(
                    "        status = (status & ({capital}_HELD | {capital}_OUTSIDE)) | {capital}_OVERFLOW;"
                ),
            },
            "    }".to_owned(),
        ]);
        if self.controller.has_counter() {
            // The times of a detection follow from the number of samples.
            let last = if self.controller.counts_all() {
                "UINT32_MAX".to_owned()
            } else {
                format!("{capital}_FIRST_COMPENSATED")
            };
            lines.extend([
                format!("    if (state->sample < {last})"),
                "    {".to_owned(),
                "        state->sample++;".to_owned(),
                "    }".to_owned(),
            ]);
        }
    }

    fn outputs(&self, lines: &mut Vec<String>) {
        let Self { controller, fields, .. } = self;
        lines.push(String::new());
        for (j, field) in fields.actuators.iter().enumerate() {
            lines.push(format!("    commands->{field} = state->u[{j}];"));
        }
        for (i, field) in fields.states.iter().enumerate() {
            lines.push(format!("    estimates->x_hat_{field} = x_value[{i}];"));
        }
        for (i, field) in fields.faults.iter().enumerate() {
            lines.push(format!("    estimates->f_hat_{field} = f_value[{i}];"));
        }
        for loss in &controller.losses {
            lines.push(format!(
                "    estimates->E_hat_{} = lost_effectiveness(state->u[{}], f_value[{}],\n        {});",
                fields.faults[loss.fault],
                loss.actuator,
                loss.fault,
                self.literal(loss.least_command * loss.least_command)
            ));
        }
        let cases = controller.reconfiguration.iter().flat_map(|own| &own.cases);
        for (i, case) in cases.enumerate() {
            lines.extend(case.decision.map(|(loss, ..)| {
                let fault = &fields.faults[controller.losses[loss].fault];
                format!("    state->lost[{i}] = estimates->E_hat_{fault};")
            }));
        }
        if controller.reconfiguration.is_some() {
            lines.push("    *reconfiguration = state->reconfiguration;".to_owned());
        }
        for (i, field) in fields.integrals.iter().enumerate() {
            lines.push(format!("    estimates->x_i_{field} = x_i_value[{i}];"));
        }
        self.detection_outputs(lines);
    }

    fn statement(&self, lines: &mut Vec<String>, statement: &Statement) {
        let Statement { when, equation, target, start, operations } = statement;
        if !equation.is_empty() {
            lines.extend([String::new(), format!("    /* {equation} */")]);
        }
        let depth = usize::from(*when != When::Always);
        match when {
            When::Always => {}
            When::Compensating => lines.push("    if (compensating)".to_owned()),
            When::Estimating | When::NotEstimating => {
                let name = if self.controller.estimates_in_fallback() {
                    "estimating"
                } else {
                    "compensating"
                };
                let not = if *when == When::Estimating { "" } else { "!" };
                lines.push(format!("    if ({not}{name})"));
            }
            When::First => lines.push("    if (state->sample == 0U)".to_owned()),
            When::Later => lines.push("    if (state->sample > 0U)".to_owned()),
        }
        if depth > 0 {
            lines.push("    {".to_owned());
        }
        let indent = "    ".repeat(depth + 2);
        let mut body = Vec::new();
        if operations.is_empty() {
            body.push(format!("{indent}{}[i] = {};", target.name(), self.term(*start)));
        } else {
            body.push(format!("{indent}sum = {};", self.term(*start)));
            for operation in operations {
                body.push(format!(
                    "{indent}sum = {};",
                    match *operation {
                        Operation::Add(term) => format!("sum + {}", self.term(term)),
                        Operation::Subtract(term) => format!("sum - {}", self.term(term)),
                        Operation::TimesPeriod => format!("sum * {}_SAMPLE_TIME", self.capital),
                        Operation::Accumulate(matrix, vector) => {
                            self.row_product("accumulate", "sum, ", (matrix, vector))
                        }
                    }
                ));
            }
            body.push(format!("{indent}{}[i] = sum;", target.name()));
        }
        let body: Vec<_> = body.iter().map(String::as_str).collect();
        self.loop_over(lines, depth + 1, target.kind(), &body);
        if depth > 0 {
            lines.push("    }".to_owned());
        }
    }

    /// A call of a function that multiplies row i of a matrix by a vector.
    fn row_product(
        &self,
        function: &str,
        start: &str,
        (matrix, vector): (Matrix, Vector),
    ) -> String {
        let (name, vector, count) = (matrix.name(), variable(vector), self.count(vector.kind()));
        match self.controller.scheduled(matrix) {
            None if self.controller.chosen(matrix).is_some() => {
                format!("{function}({start}{name}[set][i], {vector}, {count})")
            }
            None => format!("{function}({start}{name}[i], {vector}, {count})"),
            Some(_) => format!(
                "{function}_between({start}{name}[at][i], {name}[at + 1U][i], weights, {vector}, {count})"
            ),
        }
    }

    fn term(&self, term: Term) -> String {
        match term {
            Term::Zero => self.literal(0.0),
            Term::Element(vector) => element(vector),
            Term::Product(matrix, vector) => self.row_product("product", "", (matrix, vector)),
            Term::FilterStep => "filter[i] * (y[i] - y_f[i])".to_owned(),
            Term::Injection => "injection(s[i], rho[i], delta[i])".to_owned(),
        }
    }
}

/// Element i of a vector.
fn element(vector: Vector) -> String {
    format!("{}[i]", variable(vector))
}

/// A vector as an expression.
fn variable(vector: Vector) -> String {
    let owner = if vector.is_stored() { "state->" } else { "" };
    format!("{owner}{}", vector.name())
}
