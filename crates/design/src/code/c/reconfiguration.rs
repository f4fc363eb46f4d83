//! The choice of the gains by the actuators that are gone, and the commands of stuck ones.

use super::Source;
use crate::code::reconfiguration::Reconfiguration;
use crate::code::symbols::Kind;

impl Source<'_> {
    /// The structure of what is known about the actuators in a sample.
    pub(super) fn actuators_structure(&self, lines: &mut Vec<String>) {
        if self.controller.reconfiguration.is_none() {
            return;
        }
        lines.push("typedef struct\n{".to_owned());
        let fields = self.fields.switches(self.controller);
        lines.extend(fields.iter().map(|field| format!("    bool {field};")));
        lines.push(format!("}} {}_Actuators;\n", self.request.prefix));
    }

    /// The fields of an instance: those of real numbers, or the counters and flags.
    pub(super) fn reconfiguration_state(&self, lines: &mut Vec<String>, of_reals: bool) {
        let Some(own) = &self.controller.reconfiguration else { return };
        let (real, cases, actuators) =
            (self.real, self.count(Kind::Case), self.count(Kind::Actuator));
        let has_cases = !own.cases.is_empty();
        if of_reals {
            lines.extend(has_cases.then(|| format!("    {real} lost[{cases}];")));
            return;
        }
        lines.extend(has_cases.then(|| format!("    uint32_t above_since[{cases}];")));
        lines.extend(["    uint32_t set;", "    int32_t reconfiguration;"].map(str::to_owned));
        lines.push(format!("    bool gone[{actuators}];"));
        if has_cases {
            lines.extend(["above", "decided"].map(|flag| format!("    bool {flag}[{cases}];")));
        }
    }

    /// The start of an instance: nothing is gone.
    pub(super) fn reconfiguration_start(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.reconfiguration else { return };
        if !own.cases.is_empty() {
            let body = [
                format!("        state->lost[i] = {};", self.literal(0.0)),
                "        state->above_since[i] = 0U;".to_owned(),
                "        state->above[i] = false;".to_owned(),
                "        state->decided[i] = false;".to_owned(),
            ];
            self.loop_over(lines, 1, Kind::Case, &[&body.join("\n")]);
        }
        self.loop_over(lines, 1, Kind::Actuator, &["        state->gone[i] = false;"]);
        lines.push("    state->set = 0U;\n    state->reconfiguration = 0;".to_owned());
    }

    /// The constants that are no real numbers.
    pub(super) fn reconfiguration_tables(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.reconfiguration else { return };
        let (cases, actuators) = (self.count(Kind::Case), self.count(Kind::Actuator));
        let (sets, faults) = (self.count(Kind::GainSet), self.count(Kind::Fault));
        let mut table = |meaning: &str, head: String, rows: Vec<String>| {
            lines.push(format!("\n/* {meaning} */\nstatic const {head} =\n{{"));
            lines.push(format!("    {}\n}};", rows.join(",\n    ")));
        };
        let row = |row: &[bool]| {
            format!("{{{}}}", row.iter().map(bool::to_string).collect::<Vec<_>>().join(", "))
        };
        table(
            "The actuators without which each set of gains is.",
            format!("bool set_gone[{sets}][{actuators}]"),
            own.sets.iter().map(|own| row(&own.gone)).collect(),
        );
        if own.cases.is_empty() {
            return;
        }
        let numbers = |own: Vec<usize>| own.iter().map(|own| format!("{own}U")).collect();
        if own.fallback.is_none() {
            table(
                "The set of gains without one actuator; 0 if there is none.",
                format!("uint32_t single_set[{actuators}]"),
                numbers(own.single_sets(self.controller.actuators.len())),
            );
        }
        table(
            "The actuators that may be gone.",
            format!("uint32_t case_actuator[{cases}]"),
            numbers(own.cases.iter().map(|own| own.actuator).collect()),
        );
        table(
            "The samples for which a loss must last.",
            format!("uint32_t case_samples[{cases}]"),
            own.cases
                .iter()
                .map(|own| format!("{}U", own.decision.map_or(0, |own| own.2)))
                .collect(),
        );
        table(
            "The faults whose estimates restart at 0.",
            format!("bool case_restarts[{cases}][{faults}]"),
            own.cases.iter().map(|own| row(&own.restarts)).collect(),
        );
    }

    /// The function that decides which actuators are gone.
    pub(super) fn reconfiguration_helpers(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.reconfiguration else { return };
        let name = &self.request.prefix;
        if !own.cases.is_empty() {
            self.gone_helper(lines, own);
        }
        let actuators = self.count(Kind::Actuator);
        let parameter = if own.fallback.is_some() { ", bool fall_back" } else { "" };
        let regular = own.regular_sets();
        let last = own.sets.len() - 1;
        lines.push(format!(
            "
/* Chooses the set of gains for the actuators that are gone. */
static void choose_gains({name}_State *state{parameter})
{{
    uint32_t first = {actuators};
    uint32_t set = 0U;
    uint32_t i;
    uint32_t k;

    for (i = {actuators}; i > 0U; i--)
    {{
        if (state->gone[i - 1U])
        {{
            first = i - 1U;
        }}
    }}
    state->reconfiguration = (first < {actuators}) ? ((int32_t)first + 1) : 0;
    if (first < {actuators})
    {{
        for (k = 1U; k < {regular}U; k++)
        {{
            bool fits = true;

            for (i = 0U; i < {actuators}; i++)
            {{
                if (set_gone[k][i] != state->gone[i])
                {{
                    fits = false;
                }}
            }}
            if (fits)
            {{
                set = k;
            }}
        }}"
        ));
        lines.push(match own.fallback {
            None if own.cases.is_empty() => "    }".to_owned(),
            None => "        if (set == 0U)\n        {\n            set = single_set[first];\n        }\n    }".to_owned(),
            Some(_) => format!(
                "    }}
    if (fall_back || ((first < {actuators}) && (set == 0U)))
    {{
        set = {last}U;
        state->reconfiguration = -1;
    }}"
            ),
        });
        lines.push("    state->set = set;\n}".to_owned());
    }

    fn gone_helper(&self, lines: &mut Vec<String>, own: &Reconfiguration) {
        let name = &self.request.prefix;
        let (cases, faults, zero) =
            (self.count(Kind::Case), self.count(Kind::Fault), self.literal(0.0));
        let asked = if own.fallback.is_some() { "(!actuators->fall_back) && " } else { "" };
        let reported: Vec<_> = self.fields.switches(self.controller);
        let reported = reported.iter().take(own.cases.len());
        let reported: Vec<_> = reported.map(|field| format!("actuators->{field}")).collect();
        lines.push(format!(
            "
/* Decides which actuators are gone; the estimates of the faults of those that are gone or back since the last
 * sample restart at 0. */
static void find_gone({name}_State *state, const {name}_Actuators *actuators)
{{
    const bool reported[{cases}] = {{{}}};
    uint32_t i;
    uint32_t k;

    for (i = 0U; i < {cases}; i++)
    {{
        bool gone;

        if ({asked}(state->lost[i] > most_lost[i]))
        {{
            if (!state->above[i])
            {{
                state->above[i] = true;
                state->above_since[i] = state->sample;
            }}
            if ((state->sample - state->above_since[i]) >= case_samples[i])
            {{
                state->decided[i] = true;
            }}
        }}
        else
        {{
            state->above[i] = false;
        }}
        gone = reported[i] || state->decided[i];
        if (gone != state->gone[case_actuator[i]])
        {{
            for (k = 0U; k < {faults}; k++)
            {{
                if (case_restarts[i][k])
                {{
                    state->f_hat[k] = {zero};
                }}
            }}
        }}
        state->gone[case_actuator[i]] = gone;
    }}
}}",
            reported.join(", ")
        ));
    }

    /// The choice of the gains at the start of a sample.
    pub(super) fn reconfigure(&self, lines: &mut Vec<String>) {
        let Some(own) = &self.controller.reconfiguration else { return };
        let last = own.sets.len() - 1;
        let fall_back = if own.fallback.is_some() { ", actuators->fall_back" } else { "" };
        lines.push("    if (state->sample > 0U)\n    {".to_owned());
        lines.extend(
            (!own.cases.is_empty()).then(|| "        find_gone(state, actuators);".to_owned()),
        );
        lines.push(format!(
            "        choose_gains(state{fall_back});\n    }}\n    set = state->set;"
        ));
        if own.fallback.is_some() && !self.controller.monitor {
            lines.push(format!("    estimating = compensating || (set == {last}U);"));
        }
        if own.fallback == Some(false) {
            lines.push(format!("    compensating = compensating && (set != {last}U);"));
        }
    }

    /// The commands with and of stuck actuators.
    pub(super) fn stuck_commands(&self, lines: &mut Vec<String>) {
        if self.controller.reconfiguration.is_none() {
            return;
        }
        let actuators = self.count(Kind::Actuator);
        lines.extend([String::new(), "    /* u = u + K_s u_stuck */".to_owned()]);
        let body = format!(
            "        sum = -{zero};
        for (k = 0U; k < {actuators}; k++)
        {{
            if (set_gone[set][k])
            {{
                sum = sum + (K_s[set][i][k] * u_stuck[k]);
            }}
        }}
        u[i] = state->gone[i] ? u_stuck[i] : (u[i] + sum);
        command[i] = state->gone[i] ? stuck_at[i] : (u[i] + u_op[i]);",
            zero = self.literal(0.0)
        );
        self.loop_over(lines, 1, Kind::Actuator, &[&body]);
    }
}
