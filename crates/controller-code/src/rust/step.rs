//! The function that takes a sample.

use super::Source;
use crate::detection::Method;
use crate::numbers::SIGNALS;
use crate::reconfiguration::Case;
use crate::symbols::{Matrix, Vector};
use crate::tables::operating_vectors;
use crate::text::Lines;
use aso_controller::design::Estimator;

impl Source<'_> {
    /// The imports of the library from the sources that all designs share.
    pub(super) fn imports(&self) -> String {
        let mut lines = Lines::default();
        if let Some(detection) = &self.controller.detection {
            let test = match detection.method {
                Method::Cusum => "Cumulative",
                Method::Window => "Sums, Window",
            };
            lines.push(format!("use sample::detection::{{Decision, Filter, Outcomes, {test}}};"));
        }
        if let Some(reconfiguration) = &self.controller.reconfiguration {
            let cases =
                if reconfiguration.cases.is_empty() { "" } else { "Case, Request, Watch, " };
            lines.push(format!("use sample::reconfiguration::{{{cases}Choice, Sets, Stuck}};"));
        }
        lines.push_if(self.controller.checks_measurements(), "use sample::measurements::Validity;");
        lines.push("use sample::{Design, Matrix, Signals, State};");
        lines.0.join("\n")
    }

    /// Adds the function that takes a sample, and the functions called by it.
    pub(super) fn step(&self, lines: &mut Lines) {
        let Self { controller, fields, real, .. } = self;
        let (mut parameters, mut inputs) = (String::new(), String::new());
        for (owner, name, fields, count, stored) in [
            ("References", "references", &fields.references, "REFERENCES", "r"),
            ("Schedule", "schedule", &fields.schedule, "1", "theta"),
        ] {
            if !fields.is_empty() {
                parameters.extend([" ", name, ": &", owner, ","]);
                let input = format!(
                    "
        let {name}: [{real}; {count}] = (*{name}).into();
        status.held |= take(&mut self.{stored}, &{name});"
                );
                inputs.push_str(&input);
            }
        }
        if controller.reconfiguration.is_some() {
            parameters.push_str(" actuators: &Actuators,");
        }
        let reset = if controller.detection.is_some() { ", detection_reset: bool" } else { "" };
        let is_checked = controller.checks_measurements();
        if !is_checked || !inputs.is_empty() {
            lines.push(format!(
                "
/// Keeps the finite values; returns whether another one is NaN or infinite.
fn take(kept: &mut [{real}], values: &[{real}]) -> bool {{
    let mut held = false;
    for (kept, value) in kept.iter_mut().zip(values) {{
        if value.is_finite() {{
            *kept = *value;
        }} else {{
            held = true;
        }}
    }}
    held
}}"
            ));
        }
        let measured = match (is_checked, controller.limits_holds()) {
            (false, _) => "take(&mut self.y, &measured);",
            (true, false) => "VALIDITY.take(&measured, &mut self.y, &mut []);",
            (true, true) => {
                "VALIDITY.take(&measured, &mut self.y, &mut self.held);
        status.lost = VALIDITY.is_lost(&self.held);"
            }
        };
        let last =
            if is_checked { "The last inputs that are used." } else { "The last finite inputs." };
        lines.push(format!(
            "
impl Controller {{
    /// Takes a sample.
    #[must_use]
    pub fn step(&mut self, measurements: &Measurements,{parameters} compensate: bool{reset}) -> Outputs {{
        let mut status = Status::default();
        // {last}
        let measured: [{real}; MEASUREMENTS] = (*measurements).into();
        status.held |= {measured}{inputs}"
        ));
        let compensating = match controller.first_compensated {
            0 => "compensate",
            _ => "compensate && self.sample >= FIRST_COMPENSATED",
        };
        lines.push(format!("        let compensating = {compensating};"));
        self.reconfigure(lines);
        self.follow_schedule(lines);
        lines.push_if(
            controller.filter.is_some(),
            "        if !self.started {
            self.y_f = self.y;
            self.started = true;
        }",
        );
        if controller.has(Matrix::H) {
            let mutable = if controller.limits_holds() { "mut " } else { "" };
            lines.push(format!("        let {mutable}x_i_value = self.x_i;"));
        }
        self.design(lines);
        self.signals(lines);
        if controller.limits_holds() {
            let mut regular = Lines::default();
            self.take_sample(&mut regular);
            self.rest(lines);
            lines.extend(regular.0.iter().map(|part| indented(part)));
            lines.push("        }");
        } else {
            self.take_sample(lines);
        }
        self.count_sample(lines);
        self.outputs(lines);
    }

    /// Adds the branch for a sample with a lost measurement, and opens the branch for all other samples.
    fn rest(&self, lines: &mut Lines) {
        let controller = self.controller;
        lines.push("        if status.lost {\n            signals.rest(&design);");
        lines.push_if(
            controller.reconfiguration.is_some(),
            "            let stuck = Stuck {
                k_s: Matrix::NONE,
                without: &[false; ACTUATORS],
                gone: &self.gone,
                commands: [&U_STUCK, &STUCK_AT],
            };
            signals.add_stuck(&design, &stuck);",
        );
        lines.push("            signals.keep(&mut state, true);");
        lines.push_if(controller.transfer.is_some(), "            self.law = None;");
        lines.push_if(controller.filter.is_some(), "            self.started = false;");
        lines.push_if(controller.has(Matrix::H), "            x_i_value = [0.0; REFERENCES];");
        if controller.detection.is_some() {
            lines.push("            self.x_r = [0.0; RESIDUAL_STATES];");
            lines.push("            self.residual = [0.0; RESIDUALS];");
            // The decision stays, and the alarms from which it follows.
            let fields = self.fields_of_tests().into_iter();
            let cleared = fields.filter(|field| !["alarmed", "decision"].contains(&field.name));
            lines.extend(
                cleared.map(|field| format!("            self.{} = {};", field.name, field.start)),
            );
            lines.push("            self.running = 0;");
        }
        lines.push("        } else {");
    }

    /// The name of the counter of samples for the detection: since the controller rested if it can rest, otherwise
    /// since the start.
    fn running(&self) -> &'static str {
        if self.controller.counts_since_rest() { "self.running" } else { "self.sample" }
    }

    /// Adds the choice of the gains at the start of a sample, and whether faults are estimated.
    fn reconfigure(&self, lines: &mut Lines) {
        let controller = self.controller;
        let estimating = if controller.monitor { "true" } else { "compensating" };
        let Some(reconfiguration) = &controller.reconfiguration else {
            lines.push(format!("        let estimating = {estimating};"));
            return;
        };
        let last = reconfiguration.sets.len() - 1;
        let fall_back =
            if reconfiguration.fallback.is_some() { "actuators.fall_back" } else { "false" };
        lines.push("        if self.sample > 0 {");
        if !reconfiguration.cases.is_empty() {
            lines.push(format!(
                "            let reported: [bool; SWITCHES] = (*actuators).into();
            let memory = self.lost.iter().zip(&mut self.above_for).zip(&mut self.decided);
            for ((((lost, above_for), decided), case), (limit, is_reported)) in
                memory.zip(&ALL_CASES).zip(MOST_LOST.iter().zip(reported))
            {{
                let request = Request {{ is_reported, is_fall_back: {fall_back} }};
                let mut watch = Watch {{ lost, above_for, decided }};
                let is_gone = watch.decide(case, limit, request);
                case.note(is_gone, &mut self.gone, &mut self.f_hat);
            }}"
            ));
        }
        lines.push(format!(
            "            self.choice = sets().choose(&self.gone, {fall_back});\n        }}"
        ));
        let estimating = if reconfiguration.fallback.is_some() && !controller.monitor {
            format!("compensating || self.choice.set == {last}")
        } else {
            estimating.to_owned()
        };
        lines.push(format!("        let estimating = {estimating};"));
        if reconfiguration.fallback == Some(false) {
            lines.push(format!(
                "        let compensating = compensating && self.choice.set != {last};"
            ));
        }
    }

    /// Adds the grid interval of theta, the operating point, and the limits as deviations from the operating point;
    /// nothing without a schedule.
    fn follow_schedule(&self, lines: &mut Lines) {
        let controller = self.controller;
        let Some(schedule) = &controller.schedule else { return };
        // `theta` shadows the input in a sample.
        let pattern = match schedule.measurement {
            Some(k) => (0..k).map(|_| "_, ").chain(["theta, .."]).collect(),
            None => "theta".to_owned(),
        };
        let owner = if schedule.measurement.is_some() { "y" } else { "theta" };
        lines.extend([
            "        // The operating point at the scheduling variable.".to_owned(),
            format!("        let [{pattern}] = self.{owner};"),
            "        let (at, weights, outside) = find_place(theta);".to_owned(),
            "        status.outside = outside;".to_owned(),
        ]);
        for (vector, table) in operating_vectors(controller) {
            let table = table.to_ascii_uppercase();
            lines.push(format!("        let {} = between(&{table}, at, weights);", vector.name()));
        }
        if controller.is_limited() {
            lines.extend([("u_low", "U_MIN"), ("u_high", "U_MAX")].map(|(name, limit)| {
                format!(
                    "        let mut {name} = {limit};
        for (limit, u_op) in {name}.iter_mut().zip(&u_op) {{
            *limit -= *u_op;
        }}"
                )
            }));
        }
    }

    /// Adds the numbers of the design in this sample.
    fn design(&self, lines: &mut Lines) {
        let controller = self.controller;
        let stated: Vec<_> = Matrix::all_stated(controller).collect();
        let is_scheduled = controller.schedule.is_some();
        lines.push("        let design = Design {\n            sample_time: &SAMPLE_TIME,");
        let is_current = controller.estimator == Estimator::Current;
        lines.push(format!("            is_current: {is_current},"));
        for matrix in Matrix::of_sample() {
            let (name, table) =
                (matrix.name().to_ascii_lowercase(), matrix.name().to_ascii_uppercase());
            let value = if !stated.contains(&matrix) {
                "Matrix::NONE".to_owned()
            } else if controller.scheduled(matrix).is_some() {
                format!("at_place(&{table}, at, &weights)")
            } else if controller.chosen(matrix).is_some() {
                format!("Matrix::new(of_set(&{table}, self.choice.set))")
            } else {
                format!("Matrix::new(&{table})")
            };
            lines.push(format!("            {name}: {value},"));
        }
        let empty = "&[]".to_owned();
        let stated = |table: &str, is_stated: bool| {
            if is_stated { format!("&{table}") } else { empty.clone() }
        };
        let has_bounds = controller.sliding_mode.is_some();
        let mut vectors = vec![
            ("filter", stated("FILTER", controller.filter.is_some())),
            ("transfer", stated("[TRANSFER]", controller.transfer.is_some())),
            ("rho", stated("RHO", has_bounds)),
            ("delta", stated("DELTA", has_bounds)),
        ];
        for (name, is_stated) in [
            ("x_op", true),
            ("u_op", true),
            ("y_op", true),
            ("r_op", !controller.references.is_empty()),
        ] {
            let table = if is_scheduled { name.to_owned() } else { name.to_ascii_uppercase() };
            vectors.push((name, stated(&table, is_stated)));
        }
        lines.extend(
            vectors.into_iter().map(|(name, value)| format!("            {name}: {value},")),
        );
        let is_limited = controller.is_limited();
        for (name, deviations, values) in [("low", "u_low", "U_MIN"), ("high", "u_high", "U_MAX")] {
            let table =
                if is_scheduled { deviations.to_owned() } else { deviations.to_ascii_uppercase() };
            let (deviations, values) = (stated(&table, is_limited), stated(values, is_limited));
            lines.push(format!("            {name}: [{deviations}, {values}],"));
        }
        lines.push("        };");
    }

    /// Adds the vectors of a sample and the state.
    fn signals(&self, lines: &mut Lines) {
        let controller = self.controller;
        lines.extend(Vector::of_sample(controller).map(|vector| {
            format!("        let mut {} = [0.0; {}];", vector.name(), vector.kind().plural())
        }));
        lines.push("        let mut signals = Signals {");
        lines.extend(SIGNALS.map(|vector| {
            let name = vector.name();
            let place = if vector.length(controller) > 0 { name } else { "[]" };
            format!("            {name}: &mut {place},")
        }));
        lines.push("        };\n        let mut state = State {");
        for (name, is_stated) in [
            ("x_hat", true),
            ("f_hat", true),
            ("y_f", controller.filter.is_some()),
            ("x_i", controller.has(Matrix::H)),
            ("u_t", controller.transfer.is_some()),
            ("u_before", controller.has(Matrix::D)),
            ("u", true),
        ] {
            let place = if is_stated { format!("self.{name}") } else { "[]".to_owned() };
            lines.push(format!("            {name}: &mut {place},"));
        }
        let r = if controller.references.is_empty() { "[]" } else { "self.r" };
        lines.push(format!("            y: &self.y,\n            r: &{r},\n        }};"));
    }

    /// Adds the equations of a sample and the statements that store the results.
    fn take_sample(&self, lines: &mut Lines) {
        let controller = self.controller;
        lines.push(
            "        signals.estimate(&design, &state, estimating);
        signals.set_commands(&design, &state, compensating);
        signals.set_command_values(&design);",
        );
        let gone = if controller.reconfiguration.is_some() {
            lines.push(
                "        let stuck = Stuck {
            k_s: Matrix::new(of_set(&K_S, self.choice.set)),
            without: of_set(&SET_GONE, self.choice.set),
            gone: &self.gone,
            commands: [&U_STUCK, &STUCK_AT],
        };
        signals.add_stuck(&design, &stuck);",
            );
            "&self.gone"
        } else {
            "&[]"
        };
        if controller.transfer.is_some() {
            let law = match controller.reconfiguration {
                None => "compensating",
                Some(_) => "(compensating, self.gone, self.choice.set)",
            };
            lines.push(format!(
                "        let law = Some({law});
        let is_other_law = self.law.is_some() && self.law != law;
        signals.transfer(&design, &state, is_other_law, {gone});"
            ));
        }
        lines.push(format!(
            "        let is_finite = signals.are_values_finite();
        status.at_limit = signals.limit(&design, {gone});
        signals.predict(&design, &state, estimating);"
        ));
        let running = self.running();
        if controller.detection.is_some() {
            lines.push(format!(
                "        let (mut x_r, mut residual) = ([0.0; RESIDUAL_STATES], [0.0; RESIDUALS]);
        let inputs: [&[_]; 3] = [&self.x_r, signals.u, signals.y];
        let is_finite = RESIDUAL_FILTER.advance(inputs, {running} == 0, &mut x_r, &mut residual) && is_finite;"
            ));
        }
        lines.push("        if signals.keep(&mut state, is_finite) {");
        lines.push_if(controller.transfer.is_some(), "            self.law = law;");
        if controller.detection.is_some() {
            lines.push(format!(
                "            (self.x_r, self.residual) = (x_r, residual);
            if {running} > 0 {{
                self.detect(detection_reset);
            }}"
            ));
        }
        lines.push(
            "        } else {
            (status.at_limit, status.overflow) = (false, true);
        }",
        );
        lines.push_if(
            controller.counts_since_rest(),
            "        self.running = self.running.saturating_add(1);",
        );
    }

    /// Adds the statement that counts the samples; nothing if the code needs no number of samples.
    fn count_sample(&self, lines: &mut Lines) {
        let controller = self.controller;
        if controller.counts_all() {
            // The times of a detection follow from the number of samples.
            lines.push("        self.sample = self.sample.saturating_add(1);");
        } else if controller.first_compensated > 0 {
            lines.push(
                "        self.sample = FIRST_COMPENSATED.min(self.sample.saturating_add(1));",
            );
        }
    }

    fn outputs(&self, lines: &mut Lines) {
        let Self { controller, fields, .. } = self;
        let [states, faults] = [("x", fields.states.len()), ("f", fields.faults.len())]
            .map(|(letter, count)| (1..=count).map(|k| format!("{letter}{k}")).collect::<Vec<_>>());
        lines.push("        let commands = Commands::from(self.u);");
        lines.push(format!("        let [{}] = x_value;", states.join(", ")));
        lines.push(format!("        let [{}] = f_value;", faults.join(", ")));
        let integrals: Vec<_> = (1..=fields.integrals.len()).map(|k| format!("i{k}")).collect();
        if !integrals.is_empty() {
            lines.push(format!("        let [{}] = x_i_value;", integrals.join(", ")));
        }
        let losses = controller.losses.iter().map(|loss| {
            format!(
                "sample::lost_effectiveness(&commands.{}, &{}, &{})",
                fields.actuators[loss.actuator],
                faults[loss.fault],
                self.literal(loss.least_command * loss.least_command)
            )
        });
        let values = states.iter().chain(&faults).cloned().chain(losses).chain(integrals);
        lines.push("        let estimates = Estimates {");
        for (field, value) in fields.estimates(controller).iter().zip(values) {
            lines.push(format!("            {field}: {value},"));
        }
        lines.push("        };");
        let cases = controller.reconfiguration.iter().flat_map(|all| &all.cases);
        let lost = |case: &Case| match case.decision {
            None => "0.0".to_owned(),
            Some(decision) => {
                let fault = controller.losses[decision.loss].fault;
                format!("estimates.E_hat_{}", fields.faults[fault])
            }
        };
        let lost: Vec<_> = cases.map(lost).collect();
        if !lost.is_empty() {
            lines.push(format!("        self.lost = [{}];", lost.join(", ")));
        }
        let mut results = "commands, estimates, status".to_owned();
        if controller.detection.is_some() {
            results.push_str(", detection: self.detection()");
        }
        if controller.reconfiguration.is_some() {
            results.push_str(", reconfiguration: self.choice.reconfiguration");
        }
        lines.push(format!("        Outputs {{ {results} }}\n    }}"));
        self.detect(lines);
        lines.push("}");
        self.places(lines);
    }

    /// Adds the methods that test the residuals and return the decision; nothing without a detection.
    fn detect(&self, lines: &mut Lines) {
        let Some(detection) = &self.controller.detection else { return };
        let tests = match detection.method {
            Method::Cusum => {
                "outcomes.test_sums(&mut self.tests, &self.residual, &DRIFT, self.sample);"
            }
            Method::Window => {
                "let mut sums = Sums { sums: &mut self.sums, residuals: &self.residual };
        outcomes.test_windows(&mut self.tests, &mut sums, &COUNTS, &LENGTHS, self.sample);"
            }
        };
        let fields = self.fields_of_tests().into_iter();
        let clear: Vec<_> = fields
            .map(|field| format!("\n            self.{} = {};", field.name, field.start))
            .collect();
        let (clear, running) = (clear.concat(), self.running());
        lines.push(format!(
            "
    /// Tests the residuals of a sample.
    fn detect(&mut self, detection_reset: bool) {{
        if detection_reset {{{clear}
        }}
        if {running} < FIRST_TESTED {{
            return;
        }}
        let mut outcomes = Outcomes {{
            statistic: &mut self.statistic,
            alarmed: &mut self.alarmed,
            threshold: &THRESHOLD,
            reacts: &REACTS,
            decision: &mut self.decision,
        }};
        {tests}
    }}

    /// Decision, residuals and statistics of the last sample.
    fn detection(&self) -> Detection {{
        Detection {{
            detected: self.decision.is_detected(),
            isolated: self.decision.isolated,
            t_detected: self.decision.time(self.decision.detected_at, SAMPLE_TIME),
            t_onset: self.decision.time(self.decision.onset, SAMPLE_TIME),
            residual: self.residual,
            statistic: self.statistic,
        }}
    }}"
        ));
    }

    /// Adds the functions of a schedule; nothing without one.
    fn places(&self, lines: &mut Lines) {
        if self.controller.schedule.is_none() {
            return;
        }
        let real = self.real;
        lines.push(format!(
            "
/// Finds the interval of the grid that has theta, and the weights of its two points. Theta beyond the grid is held
/// at its end; the flag says so.
fn find_place(theta: {real}) -> (usize, [{real}; 2], bool) {{
    let [first, second, ..] = GRID;
    let [.., last] = GRID;
    let theta = theta + 0.0;
    let (value, outside) = if theta < first {{
        (first, true)
    }} else if theta > last {{
        (last, true)
    }} else {{
        (theta, false)
    }};
    let (mut at, mut low, mut high) = (0, first, second);
    for (i, (from, to)) in GRID.iter().zip(GRID.iter().skip(1)).enumerate().skip(1) {{
        if value >= *from {{
            (at, low, high) = (i, *from, *to);
        }}
    }}
    let part = (value - low) / (high - low);
    (at, [1.0 - part, part], outside)
}}

/// The tables of a point of the grid and of the next one.
fn ends<T>(table: &[T; POINTS], at: usize) -> [&T; 2] {{
    let [first, ..] = table;
    [at, at + 1].map(|at| table.get(at).unwrap_or(first))
}}

/// A vector between two points.
fn between<const N: usize>(table: &[[{real}; N]; POINTS], at: usize, weights: [{real}; 2]) -> [{real}; N] {{
    let ([low, high], [before, after]) = (ends(table, at), weights);
    let mut vector = *low;
    for (element, high) in vector.iter_mut().zip(high) {{
        *element = *element * before + high * after;
    }}
    vector
}}

/// A matrix between two points.
fn at_place<'a, const N: usize>(
    table: &'a [[{real}; N]; POINTS],
    at: usize,
    weights: &'a [{real}; 2],
) -> Matrix<'a, {real}> {{
    let [low, high] = ends(table, at);
    Matrix::new(low).towards(high, weights)
}}"
        ));
    }
}

/// The lines of a part, one level deeper.
fn indented(part: &str) -> String {
    let lines: Vec<_> = part.lines().map(|line| format!("    {line}")).collect();
    lines.join("\n")
}
