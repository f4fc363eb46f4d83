//! The tests of the residuals and the decision.

use super::{Source, wrapped};
use crate::code::detection::{Detection, Method, Test};
use crate::code::symbols::Kind;

impl Source<'_> {
    /// The structure with decision, residuals and statistics of a sample.
    pub(super) fn detection_structure(&self, lines: &mut Vec<String>) {
        if self.controller.detection.is_none() {
            return;
        }
        let (name, real) = (&self.request.prefix, self.real);
        let (residuals, tests) = (self.count(Kind::Residual), self.count(Kind::Test));
        lines.push(format!(
            "typedef struct
{{
    bool detected;
    int32_t isolated;
    {real} t_detected;
    {real} t_onset;
    {real} residual[{residuals}];
    {real} statistic[{tests}];
}} {name}_Detection;
"
        ));
    }

    /// The fields of an instance: those of real numbers, or the counters and flags.
    pub(super) fn detection_state(&self, lines: &mut Vec<String>, of_reals: bool) {
        let Some(own) = &self.controller.detection else { return };
        let (real, tests) = (self.real, self.count(Kind::Test));
        lines.extend(match (of_reals, own.method) {
            (true, Method::Cusum) => vec![
                format!("    {real} statistic[{tests}];"),
                format!("    {real} sums[{tests}][2];"),
            ],
            (true, Method::Window) => vec![
                format!("    {real} statistic[{tests}];"),
                format!("    {real} sums[{}];", self.count(Kind::Residual)),
            ],
            (false, method) => {
                let since = match method {
                    Method::Cusum => vec![format!("    uint32_t since[{tests}][2];")],
                    Method::Window => vec![
                        format!("    uint32_t since[{tests}];"),
                        format!("    uint32_t taken[{tests}];"),
                    ],
                };
                let rest = ["uint32_t detected_at;", "uint32_t onset;", "int32_t isolated;"]
                    .map(|field| format!("    {field}"));
                let flags =
                    vec![format!("    bool alarmed[{tests}];"), "    bool detected;".to_owned()];
                since.into_iter().chain(rest).chain(flags).collect()
            }
        });
    }

    /// The constants of the tests that are no real numbers.
    pub(super) fn detection_tables(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.detection else { return };
        let (tests, suspects) = (self.count(Kind::Test), self.count(Kind::Suspect));
        if own.method == Method::Window {
            for (name, value) in [
                ("taken_residuals", (|test| test.residuals.to_string()) as fn(&Test) -> String),
                ("window", |test| test.window.to_string()),
            ] {
                lines.push(format!("static const uint32_t {name}[{tests}] =\n{{"));
                let numbers = own.tests.iter().map(|test| format!("{}U", value(test)));
                lines.extend(wrapped(numbers, "    "));
                super::end_list(lines);
                lines.push("};".to_owned());
            }
        }
        lines.push("\n/* Which tests react to each fault. */".to_owned());
        lines.push(format!("static const bool reacts[{suspects}][{tests}] =\n{{"));
        for row in reactions(own) {
            lines.push(format!("    {{{}}},", row.join(", ")));
        }
        super::end_list(lines);
        lines.push("};".to_owned());
    }

    /// The start of the filter, of the tests and of the decision.
    pub(super) fn detection_start(&self, lines: &mut Vec<String>, x_op: &str) {
        if self.controller.detection.is_none() {
            return;
        }
        let (zero, states) = (self.literal(0.0), self.count(Kind::State));
        self.loop_over(
            lines,
            1,
            Kind::State,
            &[&format!("        x[i] = x_hat_0[i] - {x_op}[i];")],
        );
        let body = format!("        state->x_r[i] = {zero} + product(start_r[i], x, {states});");
        self.loop_over(lines, 1, Kind::ResidualState, &[&body]);
        self.loop_over(
            lines,
            1,
            Kind::Residual,
            &[&format!("        state->residual[i] = {zero};")],
        );
        lines.push("    clear_detection(state);".to_owned());
    }

    /// The functions of the detection.
    pub(super) fn detection_helpers(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.detection else { return };
        let (name, zero) = (&self.request.prefix, self.literal(0.0));
        let most = self.literal(f64::INFINITY);
        let sums = match own.method {
            Method::Cusum => {
                let body = [
                    format!("        state->sums[i][0] = {zero};"),
                    format!("        state->sums[i][1] = {zero};"),
                    "        state->since[i][0] = 0U;".to_owned(),
                    "        state->since[i][1] = 0U;".to_owned(),
                ];
                vec![(Kind::Test, body.join("\n"))]
            }
            Method::Window => vec![
                (Kind::Residual, format!("        state->sums[i] = {zero};")),
                (
                    Kind::Test,
                    "        state->since[i] = 0U;\n        state->taken[i] = 0U;".to_owned(),
                ),
            ],
        };
        lines.push(format!(
            "
/* Clears sums, windows and decision. */
static void clear_detection({name}_State *state)
{{
    uint32_t i;
"
        ));
        for (kind, body) in sums {
            self.loop_over(lines, 1, kind, &[&body]);
        }
        let body =
            format!("        state->statistic[i] = {zero};\n        state->alarmed[i] = false;");
        self.loop_over(lines, 1, Kind::Test, &[&body]);
        lines.push(format!(
            "    state->detected = false;
    state->isolated = 0;
    state->detected_at = 0U;
    state->onset = 0U;
}}

/* Keeps a sum within the range of the numbers; NaN and what is beyond it become the largest number. */
static {real} kept_finite({real} sum)
{{
    return is_finite(sum) ? sum : {most};
}}",
            real = self.real
        ));
        match own.method {
            Method::Cusum => self.cusum(lines),
            Method::Window => self.window(lines),
        }
        self.decision(lines);
    }

    fn cusum(&self, lines: &mut Vec<String>) {
        let (name, real, zero) = (&self.request.prefix, self.real, self.literal(0.0));
        lines.push(format!(
            "
/* A cumulative sum: the sum if it is above 0, else 0. */
static {real} above_zero({real} sum)
{{
    return (sum > {zero}) ? sum : {zero};
}}

/* Takes residual i: S+ = max(0, S+ + r - kappa), S- = max(0, S- - r - kappa); the statistic is the larger one.
 * Returns whether it is complete, and the sample since which the larger sum is above 0. */
static bool take_residuals({name}_State *state, uint32_t i, uint32_t *onset)
{{
    {real} *sums = state->sums[i];
    const {real} residual = state->residual[i];
    uint32_t larger = 0U;
    uint32_t k;

    for (k = 0U; k < 2U; k++)
    {{
        if (sums[k] <= {zero})
        {{
            state->since[i][k] = state->sample;
        }}
    }}
    sums[0] = above_zero(kept_finite((sums[0] + residual) - drift[i]));
    sums[1] = above_zero(kept_finite((sums[1] - residual) - drift[i]));
    if (sums[1] > sums[0])
    {{
        larger = 1U;
    }}
    state->statistic[i] = sums[larger];
    *onset = state->since[i][larger];
    return true;
}}"
        ));
    }

    fn window(&self, lines: &mut Vec<String>) {
        let (name, real, zero) = (&self.request.prefix, self.real, self.literal(0.0));
        lines.push(format!(
            "
/* Adds the residuals of test i to its window: s = |sum of r over N samples|^2 / N. Returns whether the window is
 * complete, and its first sample. */
static bool take_residuals({name}_State *state, uint32_t i, uint32_t *onset)
{{
    {real} squared = {zero};
    uint32_t first = 0U;
    uint32_t k;
    bool complete;

    for (k = 0U; k < i; k++)
    {{
        first = first + taken_residuals[k];
    }}
    if (state->taken[i] == 0U)
    {{
        for (k = 0U; k < taken_residuals[i]; k++)
        {{
            state->sums[first + k] = {zero};
        }}
        state->since[i] = state->sample;
    }}
    for (k = 0U; k < taken_residuals[i]; k++)
    {{
        state->sums[first + k] = kept_finite(state->sums[first + k] + state->residual[first + k]);
    }}
    state->taken[i]++;
    complete = state->taken[i] >= window[i];
    if (complete)
    {{
        state->taken[i] = 0U;
        for (k = 0U; k < taken_residuals[i]; k++)
        {{
            squared = squared + (state->sums[first + k] * state->sums[first + k]);
        }}
        state->statistic[i] = kept_finite(squared / ({real})window[i]);
    }}
    *onset = state->since[i];
    return complete;
}}"
        ));
    }

    fn decision(&self, lines: &mut Vec<String>) {
        let (name, capital) = (&self.request.prefix, &self.capital);
        let (tests, suspects) = (self.count(Kind::Test), self.count(Kind::Suspect));
        lines.push(format!(
            "
/* Finds the one fault to which exactly the tests react that have given an alarm. */
static int32_t isolate(const bool alarmed[{tests}])
{{
    int32_t isolated = -1;
    uint32_t fitting = 0U;
    uint32_t fault;
    uint32_t i;

    for (fault = 0U; fault < {suspects}; fault++)
    {{
        bool fits = true;

        for (i = 0U; i < {tests}; i++)
        {{
            if (reacts[fault][i] != alarmed[i])
            {{
                fits = false;
            }}
        }}
        if (fits)
        {{
            fitting++;
            isolated = (int32_t)fault + 1;
        }}
    }}
    return (fitting == 1U) ? isolated : -1;
}}

/* Tests the residuals of a sample. */
static void detect({name}_State *state, bool detection_reset)
{{
    uint32_t onset = 0U;
    uint32_t i;

    if (detection_reset)
    {{
        clear_detection(state);
    }}
    if (state->sample >= {capital}_FIRST_TESTED)
    {{
        for (i = 0U; i < {tests}; i++)
        {{
            if (take_residuals(state, i, &onset) && (state->statistic[i] > threshold[i]))
            {{
                state->alarmed[i] = true;
                if (!state->detected)
                {{
                    state->detected = true;
                    state->detected_at = state->sample;
                    state->onset = onset;
                }}
            }}
        }}
        if (state->detected)
        {{
            state->isolated = isolate(state->alarmed);
        }}
    }}
}}"
        ));
    }

    /// Decision, residuals and statistics of the last sample.
    pub(super) fn detection_outputs(&self, lines: &mut Vec<String>) {
        if self.controller.detection.is_none() {
            return;
        }
        let (real, period) = (self.real, format!("{}_SAMPLE_TIME", self.capital));
        let never = self.literal(-1.0);
        lines.extend([
            "    detection->detected = state->detected;".to_owned(),
            "    detection->isolated = state->isolated;".to_owned(),
        ]);
        lines.extend([("t_detected", "detected_at"), ("t_onset", "onset")].map(|(time, sample)| {
            format!(
                "    detection->{time} = state->detected ? (({real})state->{sample} * {period}) : {never};"
            )
        }));
        for (kind, field) in [(Kind::Residual, "residual"), (Kind::Test, "statistic")] {
            let body = format!("        detection->{field}[i] = state->{field}[i];");
            self.loop_over(lines, 1, kind, &[&body]);
        }
    }
}

/// For each fault whether each test reacts to it, as C and Rust write it.
pub(in crate::code) fn reactions(own: &Detection) -> Vec<Vec<String>> {
    let row = |fault: usize| own.tests.iter().map(|test| test.reacts[fault].to_string()).collect();
    (0..own.faults.len()).map(row).collect()
}
