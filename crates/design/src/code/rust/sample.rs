//! The function that takes a sample.

use super::Source;
use crate::code::controller::Controller;
use crate::code::reconfiguration::Case;
use crate::code::recursion::{Operation, Statement, Term, When};
use crate::code::symbols::{Matrix, Vector};
use crate::code::tables::{kept, locals, shown};

impl Source<'_> {
    pub(super) fn step(&self, lines: &mut Vec<String>) {
        let Self { controller, recursion, fields, real, .. } = self;
        let (mut parameters, mut pairs, mut taken) = (String::new(), String::new(), String::new());
        for (owner, own, fields, count, kept) in [
            ("References", "references", &fields.references, "REFERENCES", "r"),
            ("Schedule", "schedule", &fields.schedule, "1", "theta"),
        ] {
            if !fields.is_empty() {
                parameters.extend([" ", own, ": &", owner, ","]);
                let pair = format!("\n        let {own}: [{real}; {count}] = (*{own}).into();");
                pairs.push_str(&pair);
                let held = format!("\n        status.held |= take(&mut self.{kept}, &{own});");
                taken.push_str(&held);
            }
        }
        if controller.reconfiguration.is_some() {
            parameters.push_str(" actuators: &Actuators,");
        }
        let reset = if controller.detection.is_some() { ", detection_reset: bool" } else { "" };
        lines.push(format!(
            "
    /// Takes a sample.
    #[must_use]
    pub fn step(&mut self, measurements: &Measurements,{parameters} compensate: bool{reset}) -> Outputs {{
        let mut status = Status::default();
        // The last finite inputs.
        let measured: [{real}; MEASUREMENTS] = (*measurements).into();{pairs}
        status.held |= take(&mut self.y, &measured);{taken}"
        ));
        let compensating = match controller.first_compensated {
            0 => "compensate",
            _ => "compensate && self.sample >= FIRST_COMPENSATED",
        };
        lines.push(format!("        let compensating = {compensating};"));
        for vector in locals(recursion) {
            let (name, count) = (vector.name(), vector.kind().plural());
            lines.push(format!("        let mut {name} = [0.0; {count}];"));
        }
        self.reconfigure(lines);
        self.interpolation(lines);
        if controller.filter.is_some() {
            lines.push(
                "        if !self.started {
            self.y_f = self.y;
            self.started = true;
        }"
                .to_owned(),
            );
        }
        for statement in &recursion.before_limits {
            write_statement(lines, controller, statement);
        }
        self.stuck_commands(lines);
        lines.push("        let mut finite = all_finite(&command) && all_finite(&x_value) && all_finite(&f_value);".to_owned());
        if controller.is_limited() {
            let [low, high] = match controller.schedule {
                None => ["U_LOW", "U_HIGH"],
                Some(_) => ["u_low", "u_high"],
            };
            // A stuck actuator has no limits.
            let [free, zipped, pattern] = match controller.reconfiguration {
                None => ["", ".zip(limits) {", "((low, high), (min, max))) in"],
                Some(_) => [
                    "!*gone && ",
                    ".zip(limits.zip(&self.gone)) {",
                    "(((low, high), (min, max)), gone)) in",
                ],
            };
            lines.push(
                "        // The observer uses the limited commands.
        let limits = LOW.iter().zip(&HIGH).zip(U_MIN.iter().zip(&U_MAX));
        for ((u, command), ((low, high), (min, max))) in u.iter_mut().zip(&mut command).zip(limits) {
            if FREE*u < *low {
                (*u, *command) = (*low, *min);
                status.at_limit = true;
            } else if FREE*u > *high {
                (*u, *command) = (*high, *max);
                status.at_limit = true;
            }
        }"
                .replace("LOW.", &format!("{low}."))
                .replace("&HIGH", &format!("&{high}"))
                .replace("FREE", free)
                .replace(".zip(limits) {", zipped)
                .replace("((low, high), (min, max))) in", pattern),
            );
        }
        for statement in &recursion.after_limits {
            write_statement(lines, controller, statement);
        }
        self.keep(lines);
        self.outputs(lines);
    }

    /// Keeps the results, if all of them are numbers, and counts the sample.
    fn keep(&self, lines: &mut Vec<String>) {
        let Self { controller, .. } = self;
        let kept = kept(controller);
        let checks = kept.iter().map(|(next, _)| format!(" && all_finite(&{})", next.name()));
        lines.push(format!("        finite = finite{};", checks.collect::<String>()));
        lines.push("        if finite {".to_owned());
        lines.extend(kept.iter().map(|(next, own)| {
            format!("            {} = {};", owned(controller, *own), next.name())
        }));
        lines.push("            self.u = command;".to_owned());
        if controller.detection.is_some() {
            lines.push("            if self.sample > 0 {\n                self.detect(detection_reset);\n            }".to_owned());
        }
        lines.push("        } else {".to_owned());
        for (value, stored) in shown(controller) {
            lines.push(format!("            {} = {};", value.name(), owned(controller, stored)));
        }
        lines.push(
            "            status.at_limit = false;\n            status.overflow = true;\n        }"
                .to_owned(),
        );
        if controller.counts_all() {
            // The times of a detection follow from the number of samples.
            lines.push("        self.sample = self.sample.saturating_add(1);".to_owned());
        } else if controller.first_compensated > 0 {
            lines.push(
                "        self.sample = FIRST_COMPENSATED.min(self.sample.saturating_add(1));"
                    .to_owned(),
            );
        }
    }

    fn outputs(&self, lines: &mut Vec<String>) {
        let Self { controller, fields, .. } = self;
        let [states, faults] = [("x", fields.states.len()), ("f", fields.faults.len())]
            .map(|(letter, count)| (1..=count).map(|k| format!("{letter}{k}")).collect::<Vec<_>>());
        lines.push("        let commands = Commands::from(self.u);".to_owned());
        lines.push(format!("        let [{}] = x_value;", states.join(", ")));
        lines.push(format!("        let [{}] = f_value;", faults.join(", ")));
        let integrals: Vec<_> = (1..=fields.integrals.len()).map(|k| format!("i{k}")).collect();
        if !integrals.is_empty() {
            lines.push(format!("        let [{}] = x_i_value;", integrals.join(", ")));
        }
        let losses = controller.losses.iter().map(|loss| {
            format!(
                "lost_effectiveness(commands.{}, {}, {})",
                fields.actuators[loss.actuator],
                faults[loss.fault],
                self.literal(loss.least_command * loss.least_command)
            )
        });
        let values = states.iter().chain(&faults).cloned().chain(losses).chain(integrals);
        let detection = match controller.detection {
            None => "",
            Some(_) => ", detection: self.detection()",
        };
        let reconfiguration = match controller.reconfiguration {
            None => "",
            Some(_) => ", reconfiguration: self.reconfiguration",
        };
        lines.push("        let estimates = Estimates {".to_owned());
        for (field, value) in fields.estimates(controller).iter().zip(values) {
            lines.push(format!("            {field}: {value},"));
        }
        lines.push("        };".to_owned());
        if let Some(own) = controller.reconfiguration.as_ref().filter(|own| !own.cases.is_empty()) {
            let lost = |case: &Case| match case.decision {
                None => "0.0".to_owned(),
                Some((loss, ..)) => {
                    format!("estimates.E_hat_{}", fields.faults[controller.losses[loss].fault])
                }
            };
            let lost: Vec<_> = own.cases.iter().map(lost).collect();
            lines.push(format!("        self.lost = [{}];", lost.join(", ")));
        }
        lines.push(
            "        Outputs { commands, estimates, status, DETECTION }\n    }\n}"
                .replace(", DETECTION", &format!("{detection}{reconfiguration}")),
        );
    }
}

/// Adds the loop of a statement.
fn write_statement(lines: &mut Vec<String>, controller: &Controller, statement: &Statement) {
    let Statement { when, equation, target, start, operations } = statement;
    if !equation.is_empty() {
        lines.push(format!("        // {equation}"));
    }
    let mut zipped = Zipped::of(controller, *target);
    let mut sums = vec![zipped.term(*start)];
    for operation in operations {
        let sum = match *operation {
            Operation::Add(term) => format!("sum + {}", zipped.term(term)),
            Operation::Subtract(term) => format!("sum - {}", zipped.term(term)),
            Operation::TimesPeriod => "sum * SAMPLE_TIME".to_owned(),
            Operation::Accumulate(matrix, vector) => {
                zipped.product("accumulate", "sum, ", (matrix, vector))
            }
        };
        sums.push(sum);
    }
    let depth = if *when == When::Always { 8 } else { 12 };
    let indent = " ".repeat(depth);
    match when {
        When::Always => {}
        When::Compensating => lines.push("        if compensating {".to_owned()),
        When::Estimating | When::NotEstimating => {
            let name =
                if controller.estimates_in_fallback() { "estimating" } else { "compensating" };
            let not = if *when == When::Estimating { "" } else { "!" };
            lines.push(format!("        if {not}{name} {{"));
        }
        When::First => lines.push("        if self.sample == 0 {".to_owned()),
        When::Later => lines.push("        if self.sample > 0 {".to_owned()),
    }
    lines.push(format!("{indent}for {} in {} {{", zipped.pattern, zipped.iterator));
    let last = sums.pop().unwrap_or_default();
    lines.extend(sums.iter().map(|sum| format!("{indent}    let sum = {sum};")));
    lines.push(format!("{indent}    *target = {last};"));
    lines.push(format!("{indent}}}"));
    if *when != When::Always {
        lines.push("        }".to_owned());
    }
}

/// The vectors and rows that a loop runs through together.
struct Zipped<'a> {
    controller: &'a Controller,
    target: Vector,
    pattern: String,
    iterator: String,
    known: Vec<String>,
}

impl<'a> Zipped<'a> {
    fn of(controller: &'a Controller, target: Vector) -> Self {
        let iterator = format!("{}.iter_mut()", target.name());
        Self { controller, target, pattern: "target".to_owned(), iterator, known: Vec::new() }
    }

    /// The element of a vector, or the row of a matrix, that belongs to the target. `source` is a
    /// reference.
    fn row(&mut self, source: &str) -> String {
        let name = source.trim_start_matches('&').trim_start_matches("self.");
        let name = format!("{}_i", name.to_ascii_lowercase());
        if !self.known.contains(&name) {
            self.known.push(name.clone());
            self.pattern = format!("({}, {name})", self.pattern);
            self.iterator.extend([".zip(", source, ")"]);
        }
        name
    }

    /// A call of a function that multiplies a row of a matrix by a vector.
    fn product(
        &mut self,
        function: &str,
        start: &str,
        (matrix, vector): (Matrix, Vector),
    ) -> String {
        let (name, vector) = (matrix.name(), owned(self.controller, vector));
        if self.controller.chosen(matrix).is_some() {
            let row = self.row(&super::reconfiguration::chosen(matrix));
            return format!("{function}({start}{row}, &{vector})");
        }
        if self.controller.scheduled(matrix).is_none() {
            let row = self.row(&format!("&{}", name.to_ascii_uppercase()));
            return format!("{function}({start}{row}, &{vector})");
        }
        let [low, high] = super::schedule::ends(matrix).map(|end| self.row(&end));
        format!("{function}_between({start}[{low}, {high}], weights, &{vector})")
    }

    fn term(&mut self, term: Term) -> String {
        match term {
            Term::Zero => "0.0".to_owned(),
            Term::Element(vector) if vector == self.target => "*target".to_owned(),
            Term::Element(vector) => {
                let source = format!("&{}", owned(self.controller, vector));
                format!("*{}", self.row(&source))
            }
            Term::Product(matrix, vector) => self.product("product", "", (matrix, vector)),
            Term::FilterStep => {
                let [w, y, y_f] = ["&FILTER", "&y", "&y_f"].map(|source| self.row(source));
                format!("*{w} * (*{y} - *{y_f})")
            }
            Term::Injection => {
                let [s, rho, delta] = ["&s", "&RHO", "&DELTA"].map(|source| self.row(source));
                format!("injection(*{s}, *{rho}, *{delta})")
            }
        }
    }
}

/// A vector as an expression.
fn owned(controller: &Controller, vector: Vector) -> String {
    match vector {
        Vector::XOp | Vector::UOp | Vector::YOp | Vector::ROp if controller.schedule.is_none() => {
            vector.name().to_ascii_uppercase()
        }
        _ if vector.is_stored() => format!("self.{}", vector.name()),
        _ => vector.name().to_owned(),
    }
}
